"""The exported table, played in simulation first: does the robot still get the gait?"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.statistics import interval90
from gaitopt.export.gait_player import RAMP_US
from gaitopt.export.output import LEDC, Output
from gaitopt.export.stages import command_stages
from gaitopt.gait.drive import Commands
from gaitopt.gait.table import GaitTable
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.simulation.metrics import SPEED, measure
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario


@dataclass(frozen=True)
class ReplaySettings:
    """How the exported table is tried in simulation.

    Attributes:
        warn_loss: a larger share of the speed lost is worth a warning; so is one gained, because it is no
            longer the same gait.
        starts: simulations, each from another start pose.
        start_spread_rad: standard deviation of the joints' start angles, rad.
    """

    warn_loss: float = 0.05
    starts: int = 8
    start_spread_rad: float = 5e-3


@dataclass(frozen=True)
class Replay:
    """How the exported table compares with the gait itself, over the same perturbed starts.

    Attributes:
        ideal_m_s, replayed_m_s: mean speeds.
        loss: share of the ideal speed that is lost; None if the gait does not go forward.
        loss_ci90: its 90 % interval over the starts.
        causes: share lost to each step from the gait to the servo, in order; only where `loss` is large and
            more than scatter.
        settings: how it was tried.
    """

    ideal_m_s: float
    replayed_m_s: float
    loss: float | None
    loss_ci90: tuple[float, float] | None
    causes: Mapping[str, float]
    settings: ReplaySettings = ReplaySettings()

    @property
    def warning(self) -> str | None:
        """What to tell the user, if anything."""
        if self.loss is None:
            return "the gait does not go forward in simulation, so a loss of speed cannot be told"
        if abs(self.loss) <= self.settings.warn_loss:
            return None
        if not self.causes:
            return f"the speed changes by {-self.loss:+.1%}, which is not more than the scatter over starts"
        what = "loses" if self.loss > 0.0 else "gains"
        cause = max(self.causes, key=lambda name: self.causes[name] * (1.0 if what == "loses" else -1.0))
        shares = ", ".join(f"{name} {-share:+.1%}" for name, share in self.causes.items())
        return f"the exported gait {what} {abs(self.loss):.1%} of its speed, most of it by {cause} ({shares})"


def replay(
    problem: Problem,
    table: GaitTable,
    executor: Executor,
    settings: ReplaySettings = ReplaySettings(),
    output: Output = LEDC,
) -> Replay:
    """Return the speed lost between the gait and the servos, in simulation over several start poses.

    Args:
        problem: the problem.
        table: the gait as it is exported.
        executor: where it is simulated.
        settings: from how many starts, and what is worth a warning.
        output: what the servos are sent.

    Raises:
        GaitoptError: there is no marker, the model does not compile or does not fit the problem, or no
            simulation succeeds.
    """
    problem.require("the replay of an export", "roles.marker")
    starts = _Starts.of(problem, table, executor, settings)
    stages = command_stages(problem, table, output)
    ideal, replayed = starts.speeds(stages["gait"]), starts.speeds(stages["player"])
    mean = float(ideal.mean())
    if not mean > 0.0:
        return Replay(mean, float(replayed.mean()), None, None, {}, settings)
    low, high = interval90((ideal - replayed) / mean)
    loss = float((ideal - replayed).mean()) / mean
    causes = {}
    if abs(loss) > settings.warn_loss and not low <= 0.0 <= high:
        causes = _causes(starts, stages, ideal, replayed)
    return Replay(mean, float(replayed.mean()), loss, (low, high), causes, settings)


def _causes(
    starts: _Starts, stages: dict[str, Commands], ideal: NDArray[np.float64], replayed: NDArray[np.float64]
) -> dict[str, float]:
    """Return the share of speed that goes with each step from the gait to the player."""
    names = list(stages)[1:]
    speeds = [ideal, *(starts.speeds(stages[name]) for name in names[:-1]), replayed]
    means = [float(speed.mean()) for speed in speeds]
    losses = [(before - after) / means[0] for before, after in pairwise(means)]
    named = dict(zip(names, losses, strict=True))
    named["ramp and slew clamp"] = named.pop("player")
    return named


@dataclass(frozen=True)
class _Starts:
    """Perturbed start poses, and a horizon that begins once the player has ramped in."""

    problem: Problem
    table: GaitTable
    simulator: Simulator
    executor: Executor

    @staticmethod
    def of(problem: Problem, table: GaitTable, executor: Executor, settings: ReplaySettings) -> _Starts:
        simulation = problem.simulation
        late_s = 1e-6 * (RAMP_US + 2 * table.frame_us)
        horizon = simulation.horizon.model_copy(
            update={"transient_s": simulation.horizon.transient_s + late_s}
        )
        patient = problem.with_horizon(horizon)
        spread = settings.start_spread_rad
        poses = [Scenario(start_pose_rad=spread, pose_seed=seed) for seed in range(settings.starts)]
        return _Starts(patient, table, Simulator.build(patient, poses), executor)

    def speeds(self, commands: Commands) -> NDArray[np.float64]:
        """Return the speed from each start, m/s; 0 where the simulation fails.

        Raises:
            GaitoptError: it fails from every start.
        """
        gait, simulator = self.table.gait, self.simulator
        time = simulator.clock(simulator.duration(gait))
        sent = commands(time)
        poses = range(len(simulator.scenarios))
        futures = [self.executor.submit(simulator.play, time, sent, pose) for pose in poses]
        runs = [future.result() for future in futures]
        if all(run.status != "ok" for run in runs):
            raise GaitoptError(f"{gait.name}: the simulation {runs[0].status}")
        robot = Robot.of(simulator.models[0])
        speeds = np.array([measure(self.problem, gait, run, robot)[SPEED.name] for run in runs])
        speeds[np.isnan(speeds)] = 0.0
        return speeds
