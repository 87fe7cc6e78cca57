"""Does the robot stay on the ground and on course, without self-contact, and is its motion repeatable?"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.trajectory import Trajectory
from gaitopt.robot.tree import in_water
from gaitopt.simulation.audit.finding import (
    AIRTIME,
    CHAOS,
    COMMAND_NOT_FOLLOWED,
    DIVERGED,
    SELF_COLLISION,
    SIDEWAYS_DRIFT,
    Finding,
)
from gaitopt.simulation.audit.settings import CheckSettings
from gaitopt.simulation.audit.standing import check_upright
from gaitopt.simulation.metrics import Metrics, measure
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario


def check_conduct(
    simulator: Simulator, gaits: Sequence[Gait], executor: Executor, settings: CheckSettings
) -> Iterator[Finding]:
    """Play each gait twice, the second time from a start pose next to the first."""
    problem, robot = simulator.problem, Robot.of(simulator.models[0])
    nudged = replace(simulator, scenarios=(Scenario(start_pose_rad=settings.nudge_rad, pose_seed=1),))
    pairs = zip(executor.map(simulator.run, gaits), executor.map(nudged.run, gaits), strict=True)
    for gait, (trajectory, other) in zip(gaits, pairs, strict=True):
        if trajectory.status != "ok":
            message = f"the simulation {trajectory.status}"
            yield Finding(DIVERGED.name, gait.name, math.inf, 0.0, message)
            continue
        metrics = measure(problem, gait, trajectory, robot)
        yield from check_upright(gait, metrics, settings)
        yield from _self_collision(gait, trajectory)
        if not in_water(simulator.models[0]):
            yield from _airtime(problem, gait, trajectory, metrics, settings)
        yield from _drift(gait, metrics, settings)
        yield from _servos(gait, metrics, settings)
        if problem.roles.marker:
            yield from _chaos(gait, trajectory, other, settings)


def _self_collision(gait: Gait, trajectory: Trajectory) -> Iterator[Finding]:
    touching = trajectory["contacts_all"] - trajectory["contacts"]
    if touching.max() > 0.0:
        message = (
            f"up to {touching.max():.0f} contacts between the robot's own parts, "
            f"{touching[0]:.0f} of them at t = 0"
        )
        yield Finding(SELF_COLLISION.name, gait.name, float(touching.max()), 0.0, message)


def _airtime(
    problem: Problem, gait: Gait, trajectory: Trajectory, metrics: Metrics, settings: CheckSettings
) -> Iterator[Finding]:
    share = metrics.get("airtime", 0.0)  # a robot that is held has none
    if share > settings.airtime:
        message = f"in the air {share:.0%} of the time"
        if problem.roles.marker:
            rise = float(trajectory["marker.z"].max() - trajectory["marker.z"].min())
            message += f"; the marker rises by {rise:.3g} m"
        yield Finding(AIRTIME.name, gait.name, share, settings.airtime, message)


def _drift(gait: Gait, metrics: Metrics, settings: CheckSettings) -> Iterator[Finding]:
    """Without a marker, there is no sideways travel to judge."""
    ratio, limit = metrics.get("sideways_ratio", 0.0), settings.sideways_ratio
    if ratio > limit:
        message = (
            f"drifts sideways at {1e3 * metrics['sideways_m_s']:.3g} mm/s while it goes forward at "
            f"{1e3 * metrics['speed_m_s']:.3g} mm/s"
        )
        yield Finding(SIDEWAYS_DRIFT.name, gait.name, ratio, limit, message)


def _servos(gait: Gait, metrics: Metrics, settings: CheckSettings) -> Iterator[Finding]:
    for name in gait.channels:
        reached = metrics[f"reached.{name}"]
        if reached < settings.reached:
            message = f"{name} reaches {reached:.0%} of its commanded travel"
            yield Finding(
                COMMAND_NOT_FOLLOWED.name, gait.name, reached, settings.reached, message, servo=name
            )


def _chaos(gait: Gait, one: Trajectory, other: Trajectory, settings: CheckSettings) -> Iterator[Finding]:
    """How much does a perturbation of the start pose grow, relative to its size and the path length?"""
    if other.status != "ok":
        return
    apart = np.linalg.norm(one.stacked("marker") - other.stacked("marker"), axis=1)
    size = float(np.linalg.norm(np.ptp(one.stacked("marker"), axis=0))) or 1.0
    growth = float(apart.max()) / (settings.nudge_rad * size)
    if growth > settings.growth:
        message = (
            f"start poses {settings.nudge_rad:g} rad apart put the marker up to {apart.max():.3g} m apart "
            f"within {one.time[-1]:.3g} s, on a path {size:.3g} m long: judge it by means over many starts"
        )
        yield Finding(CHAOS.name, gait.name, growth, settings.growth, message)
