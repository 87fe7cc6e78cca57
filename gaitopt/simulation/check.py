"""The audit of a model: what would make its gaits mean nothing on a real robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from gaitopt.core.statistics import NORMAL_95
from gaitopt.gait.gait import Gait
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.problem.robot import Robot
from gaitopt.problem.start import start_targets
from gaitopt.robot.contact import can_touch, ground_geoms, mixed_friction
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.metrics import SPEED, measure
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario

REST_MARKER_M_S = 1e-4
REST_JOINT_RAD_S = 1e-3
REST_S = 5.0

AIRTIME = 0.02
SIDEWAYS_RATIO = 0.5
REACHED = 0.95
GROWTH = 1e3
TIMESTEP_CHANGE = 0.05
TIMESTEP_FLOOR_M_S = 5e-4

REMEDIES = {
    "unrest_at_start": "Let the robot settle under its start targets, and start there; look for overlapping "
    "geoms and for springs that are not at rest.",
    "inert_parameter": "Make the parameter reach what it is meant to change, or take it out: whoever sets it "
    "believes a number that does nothing.",
    "diverged": "Take a smaller timestep, an implicit integrator, or softer or fewer contacts.",
    "self_collision": "Exclude pairs of parts that are meant to touch, and move apart those that are not.",
    "airtime": "A crawler does not fly: look for servos without a torque limit, masses and lengths in wrong "
    "units, and contacts that throw.",
    "sideways_drift": "Look for what is not symmetric: contacts, inertias, start pose; or steer against it.",
    "chaos": "Judge by means over many start poses, never by one rollout; leaps and self-collision cause it.",
    "command_not_followed": "Make the gait slower or smaller, or the servo stronger, whichever is true to "
    "the robot; until then commanded angles say little about motion.",
    "timestep_convergence": "Take a smaller timestep or another integrator until halving it changes nothing.",
}
"""What to do about each kind of finding."""

_NUDGE_RAD = 1e-6
_PARAMETER_CHANGE = 1.1
_INERT_S = 2.0
_STARTS = 16
_STEP_BUDGET = 500_000
"""Steps that the timestep's check may spend on a gait before it makes do with fewer starts."""

_START_SPREAD_RAD = 5e-3


@dataclass(frozen=True)
class Finding:
    """One defect: its name, the gait it shows at (empty for the model itself), figure and limit."""

    name: str
    gait: str
    value: float
    limit: float
    message: str
    parameter: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the finding for a JSON file."""
        return asdict(self)


def check(
    problem: Problem, executor: Executor, on_step: Callable[[str], None] = lambda _: None
) -> list[Finding]:
    """Return every defect found, the model's first and then gait by gait.

    Chaos, drift and the timestep are judged by the marker, and not at all without one.
    """
    simulator = Simulator.build(problem)
    findings: list[Finding] = []
    steps: dict[str, Callable[[], Iterator[Finding]]] = {
        "rest at the start": lambda: _unrest(simulator),
        "inert parameters": lambda: _inert(problem, executor),
        "gaits": lambda: _gaits(simulator, executor),
        "timestep": lambda: _timestep(problem, executor, {f.gait for f in findings if f.name == "diverged"}),
    }
    for title, step in steps.items():
        on_step(title)
        findings.extend(step())
    return findings


def _unrest(simulator: Simulator) -> Iterator[Finding]:
    """Does the robot rest at its start, under the targets held before the gait?"""
    time = simulator.clock(REST_S)
    held = np.tile(start_targets(simulator.problem), (len(time), 1))
    trajectory = simulator.play(time, held)
    if trajectory.status != "ok":
        yield _diverged("", f"held at its start, the simulation {trajectory.status}")
        return
    marker = trajectory.stacked("marker")
    speed = _fastest(trajectory.time, marker)
    if not speed <= REST_MARKER_M_S:
        moved = np.linalg.norm(marker[-1] - marker[0])
        yield Finding(
            "unrest_at_start",
            "",
            speed,
            REST_MARKER_M_S,
            f"held at its start for {REST_S:g} s the marker moves at up to {speed:.3g} m/s and ends "
            f"{moved:.3g} m away",
        )
    joints = _fastest(trajectory.time, trajectory.stacked("joint"))
    if not joints <= REST_JOINT_RAD_S:
        message = f"held at its start for {REST_S:g} s a joint turns at up to {joints:.3g} rad/s"
        yield Finding("unrest_at_start", "", joints, REST_JOINT_RAD_S, message)


def _diverged(gait: str, message: str) -> Finding:
    return Finding("diverged", gait, math.inf, 0.0, message)


def _fastest(time: np.ndarray, series: np.ndarray) -> float:
    """Return the largest speed of a vector series between samples, in its unit per second."""
    steps = np.diff(series, axis=0) / np.diff(time)[:, None]
    return float(np.linalg.norm(steps, axis=1).max(initial=0.0)) if len(steps) else math.inf


def _inert(problem: Problem, executor: Executor) -> Iterator[Finding]:
    """Which named parameters change nothing: to the last bit, or nothing on the ground?"""
    gait = min(problem.baselines.values(), key=lambda g: g.period_s, default=None)
    if gait is None:
        return
    names = list(problem.file.parameters)
    problems = [problem, *(_changed(problem, name) for name in names)]
    futures = [executor.submit(_short_rollout, changed, gait) for changed in problems]
    nominal, *others = [future.result() for future in futures]
    for name, changed, trajectory in zip(names, problems[1:], others, strict=True):
        reason = _inert_friction(problem, changed)
        same = nominal.status == "ok" and all(
            np.array_equal(nominal[s], trajectory[s], equal_nan=True) for s in nominal.signals
        )
        if reason or same:
            what = reason or "nothing, to the last bit"
            message = f"changing {name} by 10 % changes {what}"
            yield Finding("inert_parameter", gait.name, 0.0, 0.0, message, parameter=name)


def _changed(problem: Problem, name: str) -> Problem:
    value = problem.file.parameters[name].value
    return problem.with_parameters({name: value * _PARAMETER_CHANGE if value else 1e-3})


def _short_rollout(problem: Problem, gait: Gait) -> Trajectory:
    return Simulator.build(problem).run(gait, duration=max(_INERT_S, gait.period_s))


def _inert_friction(problem: Problem, changed: Problem) -> str:
    """Return why a changed friction coefficient does nothing on the ground, or an empty string."""
    one, other = build_model(problem), build_model(changed)
    geoms = np.flatnonzero((one.geom_friction != other.geom_friction).any(axis=1))
    pairs = [(g, w) for g in geoms.tolist() for w in ground_geoms(one) if can_touch(one, g, w)]
    if not pairs or any((mixed_friction(one, *pair) != mixed_friction(other, *pair)).any() for pair in pairs):
        return ""
    geom = one.geom(pairs[0][1])
    return (
        "no friction on the ground: of two geoms of equal priority MuJoCo takes the larger coefficient, "
        f"and {geom.name or 'the ground'} has {geom.friction[0]:g}; give the robot's geoms a higher priority"
    )


def _gaits(simulator: Simulator, executor: Executor) -> Iterator[Finding]:
    """Does the robot stay on the ground, off itself and on course, and does it come out the same twice?"""
    robot = Robot.of(simulator.models[0])
    nudged = replace(simulator, scenarios=(Scenario(start_pose_rad=_NUDGE_RAD, pose_seed=1),))
    gaits = list(simulator.problem.baselines.values())
    pairs = zip(executor.map(simulator.run, gaits), executor.map(nudged.run, gaits), strict=True)
    for gait, (trajectory, other) in zip(gaits, pairs, strict=True):
        if trajectory.status != "ok":
            yield _diverged(gait.name, f"the simulation {trajectory.status}")
            continue
        yield from _conduct(simulator.problem, gait, trajectory, robot)
        if simulator.problem.roles.marker:
            yield from _chaos(gait, trajectory, other)


def _conduct(problem: Problem, gait: Gait, trajectory: Trajectory, robot: Robot) -> Iterator[Finding]:
    """Does the robot collide with itself, fly, drift, or fall behind its commands?"""
    metrics = measure(problem, gait, trajectory, robot)
    touching = trajectory["contacts_all"] - trajectory["contacts"]
    if touching.max() > 0.0:
        message = (
            f"up to {touching.max():.0f} contacts between the robot's own parts, "
            f"{touching[0]:.0f} of them at t = 0"
        )
        yield Finding("self_collision", gait.name, float(touching.max()), 0.0, message)
    if metrics["airtime"] > AIRTIME:
        message = f"in the air {metrics['airtime']:.0%} of the time"
        if problem.roles.marker:
            rise = float(trajectory["marker.z"].max() - trajectory["marker.z"].min())
            message += f"; the marker rises by {rise:.3g} m"
        yield Finding("airtime", gait.name, metrics["airtime"], AIRTIME, message)
    if metrics.get("sideways_ratio", 0.0) > SIDEWAYS_RATIO:
        message = (
            f"drifts sideways at {1e3 * metrics['sideways_m_s']:.3g} mm/s while it goes forward at "
            f"{1e3 * metrics['speed_m_s']:.3g} mm/s"
        )
        yield Finding("sideways_drift", gait.name, metrics["sideways_ratio"], SIDEWAYS_RATIO, message)
    for name in gait.channels:
        reached = metrics[f"reached.{name}"]
        if reached < REACHED:
            message = f"{name} reaches {reached:.0%} of its commanded travel"
            yield Finding("command_not_followed", gait.name, reached, REACHED, message)


def _chaos(gait: Gait, one: Trajectory, other: Trajectory) -> Iterator[Finding]:
    """How much does a nudge of a millionth of a radian in the start pose grow?"""
    if other.status != "ok":
        return
    apart = np.linalg.norm(one.stacked("marker") - other.stacked("marker"), axis=1)
    size = float(np.linalg.norm(np.ptp(one.stacked("marker"), axis=0))) or 1.0
    growth = float(apart.max()) / (_NUDGE_RAD * size)
    if growth > GROWTH:
        message = (
            f"start poses {_NUDGE_RAD:g} rad apart put the marker up to {apart.max():.3g} m apart within "
            f"{one.time[-1]:.3g} s, on a path {size:.3g} m long: judge it by means over many starts"
        )
        yield Finding("chaos", gait.name, growth, GROWTH, message)


def _timestep(problem: Problem, executor: Executor, diverged: Collection[str]) -> Iterator[Finding]:
    """Does the mean speed over perturbed starts change when the timestep is halved?

    Gaits that are known to have diverged are left out.
    """
    if problem.roles.marker is None:
        return
    working = problem.simulation.working
    halved = Fidelity(timestep_s=working.timestep_s / 2.0, integrator=working.integrator)
    starts = tuple(Scenario(start_pose_rad=_START_SPREAD_RAD, pose_seed=i) for i in range(_STARTS))
    coarse = Simulator.build(problem, starts, working)
    fine = coarse.at(halved)
    robot = Robot.of(coarse.models[0])
    for gait in problem.baselines.values():
        if gait.name in diverged:
            continue
        steps = 3.0 * coarse.duration(gait) / working.timestep_s
        count = int(np.clip(_STEP_BUDGET // steps, 2, _STARTS))
        runs = [list(executor.map(each.run, [gait] * count, range(count))) for each in (coarse, fine)]
        failed = [[run.status for run in some if run.status != "ok"] for some in runs]
        if any(failed):
            yield _diverged(
                gait.name,
                f"from perturbed starts, {len(failed[0])} of {count} simulations fail at "
                f"{working.timestep_s:g} s and {len(failed[1])} at half of it: "
                f"{', '.join(sorted({*failed[0], *failed[1]}))}",
            )
            continue
        speeds = [[measure(problem, gait, run, robot)[SPEED.name] for run in some] for some in runs]
        before, after = np.mean(speeds, axis=1).tolist()
        error = float(np.sqrt(np.var(speeds, axis=1, ddof=1).sum() / count))
        limit = max(TIMESTEP_CHANGE * abs(after), TIMESTEP_FLOOR_M_S)
        if not abs(after - before) <= limit + NORMAL_95 * error:
            message = (
                f"halving the timestep of {working.timestep_s:g} s changes the mean speed over {count} "
                f"starts from {1e3 * before:.3g} to {1e3 * after:.3g} mm/s "
                f"(standard error {1e3 * error:.2g} mm/s)"
            )
            yield Finding("timestep_convergence", gait.name, abs(after - before), limit, message)
