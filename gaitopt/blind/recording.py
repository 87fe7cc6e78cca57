"""Recordings of a case: a robot of other numerics walks, and a camera with noise sees it."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
import tomli_w
from numpy.typing import NDArray

from gaitopt.blind.drawing import Draw
from gaitopt.blind.errors import as_effects
from gaitopt.blind.factory import CaseFactory, observed
from gaitopt.blind.misfits import Misfit, draw_misfit, walk_with
from gaitopt.blind.sealed import PlantedEffect
from gaitopt.core.errors import bad_value
from gaitopt.core.files import csv_text, write_text
from gaitopt.diagnose.judge.small_errors import with_small_errors
from gaitopt.effects.active import ActiveEffect
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.problem.robot import Robot
from gaitopt.robot.signals import is_position, measured_column_of
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.metrics import SPEED, measure
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario
from gaitopt.simulation.tolerances import SmallErrors, draw_errors, draw_measurement

Array = NDArray[np.float64]

_LONGEST_NAME = 200
"""A longer name of a gait names no file, bytes: file systems allow 255 with all that is added."""

_CASE, _NOTHING = "the case", "nothing"
"""Labels of the case's robot, and of that without what was planted."""


@dataclass(frozen=True)
class Camera:
    """What was drawn for a case's recordings.

    Attributes:
        known: whether the recordings say when they begin.
        fps: frames per second.
        noise_m: standard deviation of the marker's noise, m.
    """

    known: bool
    fps: float
    noise_m: float


@dataclass(frozen=True)
class Recording:
    """What a case's robot did, and what else was drawn.

    Attributes:
        paths: its trajectories, by gait.
        gap: how far the effect alone moved marker and joints, the largest of all gaits, in floors.
        camera: what was drawn for the recordings.
        figures: the robot's numerics and the camera, for the sealed truth.
        seen: of several effects, how far each moves the robot beside the others, in floors; by effect.
        seen_beside_errors: the same, over how far other small errors move it.
        misfits: what is wrong with trials that do not fit the others.
        misfits_beside_errors: how far each of these moved its trial, over how far small errors move it.
        errors: its small errors, as effects, where it is a little wrong in everything.
        speeds: how fast it goes in the baselines that were not recorded, from the nominal pose, m/s.
    """

    paths: Mapping[str, Trajectory]
    gap: float
    camera: Camera
    figures: Mapping[str, float]
    seen: Mapping[str, float]
    seen_beside_errors: Mapping[str, float]
    misfits: Mapping[str, Misfit]
    misfits_beside_errors: Mapping[str, float]
    errors: Sequence[PlantedEffect]
    speeds: Mapping[str, float]


@dataclass(frozen=True)
class Numerics:
    """Numerics that the diagnosis does not use, and small errors.

    Attributes:
        fidelity: integrator and timestep.
        impratio: stiffness of the friction cones.
        errors_seed: seed of the small errors.
        everything: whether everything is a little wrong, by the problem's tolerances; else masses and hinges.
    """

    fidelity: Fidelity
    impratio: float
    errors_seed: int
    everything: bool

    def errors(self, factory: CaseFactory) -> tuple[PlantedEffect, ...]:
        """Return the small errors as effects; none where not everything is a little wrong."""
        if not self.everything:
            return ()
        return as_effects(*self._drawn(factory), factory.hypotheses, factory.nominal.effects.nominal)

    def _drawn(self, factory: CaseFactory) -> tuple[SmallErrors, tuple[ActiveEffect, ...]]:
        """Return the errors of a robot that is a little wrong in everything, and those of its camera."""
        tolerances, rng = factory.problem.file.tolerances, np.random.default_rng(self.errors_seed)
        errors = draw_errors(factory.nominal.effects.nominal, tolerances, rng)
        return errors, draw_measurement(tolerances, rng)

    def robot(self, factory: CaseFactory, draw: Draw) -> Simulator:
        """Return a robot with what was planted, and small errors; those of a scenario are in it."""
        problem = factory.problem
        if self.everything:
            errors, measurement = self._drawn(factory)
            robot = draw.robot(problem, self.fidelity, Scenario(errors))
            seen = replace(robot.effects, active=(*robot.effects.active, *measurement))
            robot, model = replace(robot, effects=seen), copy.copy(robot.models[0])
        else:
            robot = draw.robot(problem, self.fidelity)
            rng = np.random.default_rng(self.errors_seed)
            model = with_small_errors(copy.copy(robot.models[0]), robot, rng)
        model.opt.impratio = self.impratio
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return robot.with_model(model)


def record(factory: CaseFactory, draw: Draw, rng: np.random.Generator, executor: Executor) -> Recording:
    """Simulate a case's robot.

    It has another integrator, timestep and cone stiffness, a start pose with errors, and small errors of
    masses and hinges. Its twin has all of that too, but not the effect: their distance is the gap.

    Args:
        factory: what all cases share.
        draw: what is planted.
        rng: where the numerics and the camera come from.
        executor: where robots are simulated.
    """
    settings = factory.settings
    fidelity = settings.fidelities[int(rng.integers(len(settings.fidelities)))]
    impratio = float(rng.choice(settings.impratios))
    needed = any(planted.hypothesis.effect.needs_known_start for planted in draw.planted)
    known = needed or bool(rng.random() < settings.known_share)
    fps, noise = float(rng.choice(settings.frame_rates)), float(rng.uniform(*settings.marker_noise_m))
    errors_seed = int(rng.integers(2**31))
    spread = settings.start_pose * factory.problem.file.tolerances.start_pose_rad
    poses = {
        name: Scenario(start_pose_rad=spread, pose_seed=int(rng.integers(2**31))) for name in factory.gaits
    }
    figures = {"timestep_s": fidelity.timestep_s, "impratio": impratio, "noise_m": noise, "fps": fps}
    misfits: dict[str, Misfit] = {}
    if draw.kind == "several":
        draw = replace(draw, grip=float(rng.uniform(*settings.grip)))
        chosen = [name for name in factory.gaits if rng.random() < settings.misfit_share]
        most = len(factory.gaits) // 2
        misfits = {name: draw_misfit(factory, name, rng) for name in chosen[:most]}
        figures["grip"] = draw.grip
    others = _without_each(draw) if draw.rows else {}
    numerics = Numerics(fidelity, impratio, errors_seed, draw.kind == "several")
    robots = {label: numerics.robot(factory, one) for label, one in {_CASE: draw, **others}.items()}
    twins = _twins(factory, numerics, draw)
    robots |= twins
    futures = {
        label: _walks(factory, robot, poses, misfits if label == _CASE else {}, executor)
        for label, robot in robots.items()
    }
    ordinary = _walks(factory, robots[_CASE], {name: poses[name] for name in misfits}, {}, executor)
    unseen = {
        name: executor.submit(_speed, factory.problem, robots[_CASE], gait)
        for name, gait in factory.problem.baselines.items()
        if name not in factory.gaits
    }
    paths = {label: {n: f.result() for n, f in of_robot.items()} for label, of_robot in futures.items()}
    fitting = {name: path for name, path in paths[_CASE].items() if name not in misfits}
    apart = {
        label: factory.floors_apart({name: of_robot[name] for name in fitting}, fitting)
        for label, of_robot in paths.items()
        if label != _CASE
    }
    if draw.kind == "several" and len(draw.planted) == 1:  # without the only effect nothing is planted
        apart[draw.planted[0].hypothesis.effect.name] = apart[_NOTHING]
    gaps = {label: float(one.max()) for label, one in apart.items() if label not in twins}
    gap = gaps.pop(_NOTHING, 0.0)
    beside = _beside_errors({label: apart[label] for label in gaps}, [apart[label] for label in twins])
    usual = {name: future.result() for name, future in ordinary.items()}
    odd = _misfits_beside_errors(factory, usual, paths[_CASE], [paths[label] for label in twins])
    camera = Camera(known, fps, noise)
    figures["known"] = float(known)
    speeds = {name: future.result() for name, future in unseen.items()}
    going = {name: speed for name, speed in speeds.items() if math.isfinite(speed)}
    errors = numerics.errors(factory)
    return Recording(paths[_CASE], gap, camera, figures, gaps, beside, misfits, odd, errors, going)


def _speed(problem: Problem, robot: Simulator, gait: Gait) -> float:
    """Return the forward speed of a robot, m/s; NaN if it cannot be simulated."""
    return measure(problem, gait, robot.run(gait), Robot.of(robot.models[0]))[SPEED.name]


def _twins(factory: CaseFactory, numerics: Numerics, draw: Draw) -> dict[str, Simulator]:
    """Return robots with the same effects and other small errors, where everything is a little wrong."""
    if not numerics.everything:
        return {}
    seeds = np.random.default_rng(numerics.errors_seed).integers(2**31, size=factory.settings.floor_robots)
    return {
        f"twin {number}": replace(numerics, errors_seed=seed).robot(factory, draw)
        for number, seed in enumerate(seeds.tolist())
    }


def _beside_errors(gaps: Mapping[str, Array], twins: Sequence[Array]) -> dict[str, float]:
    """Return each gap over how far small errors move the robot, the largest of all gaits and signals.

    Args:
        gaps: in floors, shape (gaits, signals) each.
        twins: the same between robots with the same effects.
    """
    if not twins:
        return {}
    floors = np.maximum(1.0, np.sqrt(np.mean(np.square(twins), axis=0)))
    return {name: float(np.max(gap / floors)) for name, gap in gaps.items()}


def _misfits_beside_errors(
    factory: CaseFactory,
    usual: Mapping[str, Trajectory],
    recorded: Mapping[str, Trajectory],
    twins: Sequence[Mapping[str, Trajectory]],
) -> dict[str, float]:
    """Return how far each misfit moved its trial, over how far small errors move it, by its gait.

    Args:
        factory: what all cases share.
        usual: what the robot does in these gaits without the misfit.
        recorded: what it did in every gait.
        twins: the same of robots with other small errors, without a misfit.
    """
    moved: dict[str, float] = {}
    for name, path in usual.items():
        apart = [factory.floors_apart({name: path}, other) for other in (recorded, *twins)]
        moved |= _beside_errors({name: apart[0]}, apart[1:])
    return moved


def _without_each(draw: Draw) -> dict[str, Draw]:
    """Return the case with nothing planted, and of several effects that without each of them, by its name."""
    without = {_NOTHING: replace(draw, kind="none", planted=(), disturbance=None)}
    if draw.kind == "several" and len(draw.planted) > 1:
        for one in draw.planted:
            rest = tuple(other for other in draw.planted if other is not one)
            without[one.hypothesis.effect.name] = replace(draw, planted=rest)
    return without


def _walks(
    factory: CaseFactory,
    robot: Simulator,
    poses: Mapping[str, Scenario],
    misfits: Mapping[str, Misfit],
    executor: Executor,
) -> dict[str, Future[Trajectory]]:
    """Return the walks of a robot, each from its own start pose; one for each gait that has a pose."""
    walks = {}
    for name, pose in poses.items():
        gait = factory.gaits[name]
        posed = replace(robot, scenarios=(replace(pose, errors=robot.scenarios[0].errors),))
        if name in misfits:
            walks[name] = executor.submit(walk_with, misfits[name], factory, posed, gait)
        else:
            walks[name] = executor.submit(observed, posed, gait, factory.walked_s(gait))
    return walks


def check_file_names(gaits: Iterable[str]) -> None:
    """Check that a trial of each gait can have a file of that name: a problem may be a stranger's.

    Args:
        gaits: names of the gaits.

    Raises:
        GaitoptError: a name leads to another folder, or is too long.
    """
    for name in gaits:
        if Path(f"{name}.csv").name != f"{name}.csv" or "\\" in name or len(name.encode()) > _LONGEST_NAME:
            allowed = "names of files, as each gait has a file: without / and \\, of at most 200 bytes"
            raise bad_value("blind make", "gait", name, allowed)


def write_recording(
    factory: CaseFactory, recording: Recording, folder: Path, rng: np.random.Generator
) -> None:
    """Write a case's data set: the camera has noise, a frame rate, and a start that may be unknown.

    Args:
        factory: what all cases share.
        recording: what the robot did.
        folder: the data set's folder.
        rng: where starts, origins and noise come from.
    """
    folder.mkdir(parents=True, exist_ok=True)
    camera = recording.camera
    entries = []
    for name in recording.paths:
        period = factory.gaits[name].period_s
        begin = float(rng.uniform(0.0, 0.3) if camera.known else rng.uniform(-0.9, 0.9) * period)
        columns = _columns(factory, recording, name, begin, rng)
        write_text(folder / f"{name}.csv", csv_text(columns))
        start = {"starts_at_gait_time_s": begin} if camera.known else {}
        signals = dict(zip(factory.signals, list(columns)[1:], strict=True))
        entries.append(
            {"name": name, "gait": name, "file": f"{name}.csv", "fps": camera.fps, "signals": signals} | start
        )
    write_text(folder / "dataset.toml", tomli_w.dumps({"trial": entries}))


def _columns(
    factory: CaseFactory, recording: Recording, name: str, begin: float, rng: np.random.Generator
) -> dict[str, NDArray[np.float64]]:
    """Return the columns of a trial that begins at gait time `begin`, s."""
    path, camera = recording.paths[name], recording.camera
    time = np.arange(0.0, factory.recorded_s(factory.gaits[name]), 1.0 / camera.fps)
    origin = rng.uniform(-0.3, 0.3, len(factory.signals))
    columns = {"t_s": time}
    for index, signal in enumerate(factory.signals):
        series = np.interp(time + begin, path.time, path[signal])
        noise = rng.standard_normal(len(time))
        if is_position(signal):
            columns[measured_column_of(signal)] = series + origin[index] + camera.noise_m * noise
        else:
            columns[measured_column_of(signal)] = series + factory.settings.angle_noise_rad * noise
    return columns
