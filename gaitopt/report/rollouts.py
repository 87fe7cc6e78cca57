"""Rollouts on the nominal robot, for the figures of a page."""

from __future__ import annotations

from collections.abc import Mapping

from gaitopt.gait.gait import Gait
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator


def rollouts(simulator: Simulator, gaits: Mapping[str, Gait]) -> dict[str, Trajectory]:
    """Return a rollout of each gait with poses, by name, all as long as the longest horizon."""
    duration = max((simulator.duration(gait) for gait in gaits.values()), default=0.0)
    return {name: simulator.run(gait, duration=duration, poses=True) for name, gait in gaits.items()}
