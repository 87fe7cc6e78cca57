"""Synthetic trials with a planted gap, simulated with another integrator than the diagnosis uses."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import tomli_w

from gaitopt.core.files import csv_text
from gaitopt.effects.active import Values
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.robot.signals import is_position, measured_column_of
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario
from gaitopt.simulation.tolerances import NO_ERRORS, SmallErrors

OTHER = Fidelity(timestep_s=5e-4, integrator="RK4")
SIGNALS = ("marker.x", "marker.y", "marker.z", "joint.mid_left")


def rollout(
    problem: Problem,
    gait: str,
    duration: float,
    effects: Mapping[str, Values] | None = None,
    errors: SmallErrors = NO_ERRORS,
) -> Trajectory:
    """Simulate a gait on a robot with effects and errors, from a start pose with errors of 2 mrad."""
    pose = Scenario(errors, start_pose_rad=0.002, pose_seed=7)
    simulator = Simulator.build(problem.with_effects(effects or {}), (pose,), OTHER)
    model = copy.copy(simulator.models[0])
    model.opt.impratio = 20
    other = simulator.with_model(model)
    return other.observe(other.run(problem.baselines[gait], duration=duration))


def recording_of(
    trajectory: Trajectory,
    begin_s: float = 0.0,
    fps: float = 30.0,
    noise_m: float = 5e-4,
    seed: int = 1,
    signals: tuple[str, ...] = SIGNALS,
) -> dict[str, np.ndarray]:
    """Return what a camera records from gait time `begin_s` on: columns with units; its clock starts at 0."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, trajectory.time[-1] - max(begin_s, 0.0), 1.0 / fps)
    columns = {"t_s": time}
    for name in signals:
        noise = noise_m if is_position(name) else 2e-3
        series = np.interp(time + begin_s, trajectory.time, trajectory[name])
        columns[measured_column_of(name)] = series + noise * rng.standard_normal(len(time))
    return columns


def dataset(folder: Path, trials: Mapping[str, tuple[str, Mapping[str, np.ndarray]]], **more: object) -> Path:
    """Write a data set: for each trial its gait and its columns; `more` is added to each entry."""
    folder.mkdir(parents=True, exist_ok=True)
    entries = []
    for name, (gait, columns) in trials.items():
        (folder / f"{name}.csv").write_text(csv_text(dict(columns)))
        signals = {_signal(column): column for column in columns if column != "t_s"}
        entries.append({"name": name, "gait": gait, "file": f"{name}.csv", "signals": signals} | more)
    (folder / "dataset.toml").write_text(tomli_w.dumps({"trial": entries}))
    return folder


def _signal(column: str) -> str:
    name, _, unit = column.rpartition("_")
    return f"joint.{name}" if unit in ("rad", "deg") else f"marker.{name}"
