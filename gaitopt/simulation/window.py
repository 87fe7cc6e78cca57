"""The part of a rollout that is measured, and the figures that several metrics share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gaitopt.gait.drive import Drive
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.rotation import rotation_matrices
from gaitopt.robot.signals import MARKER
from gaitopt.robot.trajectory import Trajectory

Array = NDArray[np.float64]

_EDGE_S = 1e-9
"""A sample this close before an end of the window counts as on it."""


@dataclass(frozen=True)
class Window:
    """The measured part of a rollout: whole cycles after the transient, where there are cycles.

    Attributes:
        problem: the problem, for its roles and axes.
        drive: what was commanded.
        trajectory: the rollout, with status ``ok``.
        robot: weight and servo limits.
        begin_s, end_s: ends of the window, gait time, s.
        cycles: number of cycles in it; None where nothing repeats.
    """

    problem: Problem
    drive: Drive
    trajectory: Trajectory
    robot: Robot
    begin_s: float
    end_s: float
    cycles: int | None

    @staticmethod
    def of(problem: Problem, drive: Drive, trajectory: Trajectory, robot: Robot) -> Window:
        """Return the window of a rollout: by the problem's horizon, or all of one without cycles."""
        if drive.period_s is None:
            return Window(problem, drive, trajectory, robot, 0.0, float(trajectory.time[-1]), None)
        transient, measured = problem.simulation.horizon.cycles(drive.period_s)
        begin, end = transient * drive.period_s, (transient + measured) * drive.period_s
        return Window(problem, drive, trajectory, robot, begin, end, measured)

    @property
    def duration_s(self) -> float:
        """Length, s."""
        return self.end_s - self.begin_s

    @cached_property
    def rows(self) -> slice:
        """Samples in the window: at its begin, and before its end."""
        ends = (self.begin_s - _EDGE_S, self.end_s - _EDGE_S)
        return slice(*np.searchsorted(self.trajectory.time, ends).tolist())

    @property
    def axes(self) -> Array:
        """Forward, left and up as the rows of a rotation, shape (3, 3)."""
        return self.problem.roles.axes

    def __getitem__(self, signal: str) -> Array:
        """Return the samples of a signal in the window, shape (n,)."""
        return self.trajectory[signal][self.rows]

    def stacked(self, kind: str) -> Array:
        """Return the samples of all signals of a kind in the window, shape (n, k)."""
        return self.trajectory.stacked(kind)[self.rows]

    @cached_property
    def time(self) -> Array:
        """Times of the samples, s, shape (n,)."""
        return self.trajectory.time[self.rows]

    @property
    def sample_s(self) -> float:
        """Mean time between two samples, s."""
        return float((self.time[-1] - self.time[0]) / max(1, len(self.time) - 1))

    @cached_property
    def velocity(self) -> tuple[float, float]:
        """Net forward and leftward speed of the marker between the ends, m/s."""
        ends, trajectory = (self.begin_s, self.end_s), self.trajectory
        marker = [np.interp(ends, trajectory.time, trajectory[name]) for name in MARKER]
        forward, left, _ = self.axes @ np.diff(marker, axis=1)[:, 0]
        return float(forward) / self.duration_s, float(left) / self.duration_s

    @cached_property
    def power(self) -> float:
        """Mean mechanical power at the servos' shafts, W: braking costs nothing and returns nothing."""
        rate = self.stacked("rate")
        shaft_torque = self.stacked("torque") - self.robot.damping * rate
        return float(np.maximum(shaft_torque * rate, 0.0).sum(axis=1).mean())

    @cached_property
    def reached(self) -> dict[str, float]:
        """Share of the commanded travel that the joint goes through, by channel; 1 without travel."""
        shares = {}
        for name in self.problem.channel_names:
            target = self[f"target.{name}"]
            low, high = float(np.fmin.reduce(target)), float(np.fmax.reduce(target))
            inside = np.clip(self[f"position.{name}"], low, high)
            travel = high - low
            shares[name] = float(inside.max() - inside.min()) / travel if travel > 0.0 else 1.0
        return shares

    @cached_property
    def peak_command_speed(self) -> Array:
        """Largest commanded speed of each channel, rad/s, shape (nu,): of a gait exact, else by samples."""
        if isinstance(self.drive, Gait):
            return self.drive.peak_command_speed()
        targets = np.stack([self[f"target.{name}"] for name in self.problem.channel_names], axis=-1)
        speeds: Array = np.nanmax(np.abs(np.diff(targets, axis=0)), axis=0, initial=0.0)
        speeds /= self.sample_s
        return speeds

    def rotation(self, every: int) -> Array:
        """Return the rotation matrix of the trunk at one sample in `every`, shape (n, 3, 3)."""
        rows = slice(self.rows.start, self.rows.stop, every)
        return rotation_matrices(*(self.trajectory[f"heading.{part}"][rows] for part in "wxyz"))
