"""Trials with a planted gap, and where it is found.

The trials are made with RK4 at half the timestep and another impratio, from another start pose, with noise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from planting import SIGNALS, dataset, recording_of, rollout

from gaitopt.diagnose.diagnosis import Diagnosis, locate
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.effects.active import Values
from gaitopt.problem.problem import Problem
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

TRIALS = {"2s": ("square-2s", 8.5), "1s": ("square-1s", 6.0)}
Diagnosed = Callable[..., Diagnosis]
"""Locates the gap of trials with effects in them."""


@pytest.fixture(scope="session")
def simulator(arcfold: Problem) -> Simulator:
    """The nominal robot."""
    return Simulator.build(arcfold)


@pytest.fixture(scope="session")
def diagnosed(arcfold: Problem, simulator: Simulator, tmp_path_factory: pytest.TempPathFactory) -> Diagnosed:
    """Locate the gap of trials with effects in them; what was simulated once is not simulated again."""
    rollouts: dict[str, dict[str, Trajectory]] = {}

    def run(
        effects: Mapping[str, Values] | None = None,
        begin: float = 0.0,
        sync: bool = True,
        change: Callable[[dict[str, np.ndarray]], None] | None = None,
        signals: tuple[str, ...] | None = None,
        repeats: int = 1,
    ) -> Diagnosis:
        key = str(effects)
        if key not in rollouts:
            rollouts[key] = {
                n: rollout(arcfold, gait, length, effects) for n, (gait, length) in TRIALS.items()
            }
        trials = {}
        for name, trajectory in rollouts[key].items():
            for repeat in range(repeats):
                columns = recording_of(trajectory, begin, seed=1 + repeat, signals=signals or SIGNALS)
                if change is not None:
                    change(columns)
                trials[f"{name}-{repeat}" if repeats > 1 else name] = (TRIALS[name][0], columns)
        folder = tmp_path_factory.mktemp("planted")
        dataset(folder, trials, **({"starts_at_gait_time_s": begin} if sync else {}))
        known = [name for name in simulator.signals if name]
        with ThreadPoolExecutor(2) as executor:
            return locate(simulator, load_dataset(folder, arcfold, known), executor, 1)

    return run
