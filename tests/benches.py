"""A made bench: an arm on a servo, its angle recorded under logged commands, without any marker."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import rigs
import tomli_w
from responses import FRAME_S, commands

from gaitopt.core.files import csv_text
from gaitopt.diagnose.diagnosis import Diagnosis, locate
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.instruments import measurable_signals
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator

CHANNEL = "turn"
SIGNAL = "joint.elbow"
NOISE_RAD = 5e-4

Series = np.ndarray
Change = Callable[[Series, Callable[[Series], Series]], Series]
"""Returns what is measured at some times, given the simulated response as a function of time."""

Played = Callable[[LoggedCommands, np.random.Generator], LoggedCommands]
"""Returns the commands that the robot gets in one recording, of those that are logged."""

KINDS = {
    "step": ("step", 0.3, 1.0),
    "ramp": ("ramp", 0.6, 2.0),
    "square": ("square", 0.3, 2.0),
    "telegraph": ("telegraph", 0.2, 2.0),
}
"""Kind, size, rad, and length, s, of commands."""


def bench(folder: Path) -> Problem:
    """A damped arm of 0.1 kg on a servo, in a vertical plane."""
    return rigs.build(folder, rigs.arm(damping=0.2), {"forward": [1, 0, 0]})


def write_bench(
    folder: Path,
    problem: Problem,
    change: Change | None = None,
    trials: Mapping[str, int] = {"step": 2, "ramp": 1, "square": 2, "telegraph": 1},
    played: Played = lambda drive, _: drive,
    **more: object,
) -> Path:
    """Write a data set: some repeats of some `KINDS` of commands, played by the problem's own robot.

    Args:
        folder: the folder.
        problem: the bench.
        change: what is measured instead of the simulated response.
        trials: number of repeats of each kind.
        played: what the robot gets of the logged commands.
        more: what each entry says besides.
    """
    folder.mkdir(parents=True, exist_ok=True)
    robot, entries = Simulator.build(problem), []
    for kind, repeats in trials.items():
        made = commands(*KINDS[kind])
        drive = LoggedCommands.of((CHANNEL,), made.time, made.rows).recorded(made.duration_s, FRAME_S)
        for number in range(1, repeats + 1):
            rng = np.random.default_rng(number)
            noise = NOISE_RAD * rng.standard_normal(len(made.time))
            path = robot.run(played(drive, rng), duration=KINDS[kind][2] + 0.5)
            response = partial(np.interp, xp=path.time, fp=path[SIGNAL])
            angle = response(made.time) if change is None else change(made.time, response)
            name = f"{kind}-{number}"
            columns = {"t_s": made.time, "target_rad": made.rows[:, 0], "angle_rad": angle + noise}
            (folder / f"{name}.csv").write_text(csv_text(columns))
            entries.append(
                {
                    "name": name,
                    "file": f"{name}.csv",
                    "commands": f"{name}.csv",
                    "channels": {CHANNEL: "target_rad"},
                    "signals": {SIGNAL: "angle_rad"},
                }
                | more
            )
    (folder / "dataset.toml").write_text(tomli_w.dumps({"trial": entries}))
    return folder


def located(problem: Problem, folder: Path) -> Diagnosis:
    """Where the gap of a data set lies."""
    with ThreadPoolExecutor(1) as executor:
        dataset = load_dataset(folder, problem, measurable_signals(problem))
        return locate(Simulator.build(problem), dataset, executor, 1)
