"""What a film shows: a robot that moves, simulated with its poses."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.gap.predict import latest_gait_time
from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.drive import Drive
from gaitopt.gait.gait import Gait
from gaitopt.problem.robot import Robot
from gaitopt.report.film.ghost import Ghost, ghost_of
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.metrics import SPEED, measure
from gaitopt.simulation.rollout import Simulator


@dataclass(frozen=True)
class Take:
    """One robot that moves, and what is written above it.

    Attributes:
        model: the compiled robot, as simulated.
        trajectory: its motion, with poses.
        axes: forward, left and up as rows, shape (3, 3); see `Roles.axes`.
        name: the gait's name.
        period_s: the gait's period; None for commands without one.
        block_s: length of a block, a gait's cycle.
        speed_m_s: its mean forward speed; NaN where it is not known.
        speed_of: what that speed is of, in words.
        ghost: the measured marker, if it is shown.
    """

    model: mujoco.MjModel
    trajectory: Trajectory
    axes: NDArray[np.float64]
    name: str
    period_s: float | None
    block_s: float
    speed_m_s: float
    ghost: Ghost | None = None
    speed_of: str = "this rollout"

    @property
    def poses(self) -> NDArray[np.float64]:
        """The robot's pose at each time of the trajectory, shape (n, nq)."""
        assert self.trajectory.poses is not None
        return self.trajectory.poses

    def named(self, name: str) -> Take:
        """Return the same take under another name."""
        return replace(self, name=name)

    def index(self, at: float) -> int:
        """Return the first sample of the trajectory that is not before a gait time, s; else the last one."""
        time = self.trajectory.time
        return int(np.clip(np.searchsorted(time, at), 0, len(time) - 1))


def take(simulator: Simulator, drive: Drive, duration: float | None = None) -> Take:
    """Simulate a drive on the nominal robot and keep what its pictures need.

    Args:
        simulator: the robot.
        drive: the commands; a mean speed is measured of a gait only.
        duration: how long, s; at least the problem's horizon is simulated, for the mean speed.

    Raises:
        GaitoptError: the simulation failed.
    """
    simulator.problem.require("a film", "roles.marker")
    length = max(simulator.duration(drive), duration or 0.0)
    trajectory = simulator.run(drive, duration=length, poses=True)
    if trajectory.status != "ok":
        raise GaitoptError(f"{drive.name}: nothing to show: the simulation {trajectory.status}")
    model = simulator.models[0]
    speed = math.nan
    if isinstance(drive, Gait):
        speed = measure(simulator.problem, drive, trajectory, Robot.of(model))[SPEED.name]
    axes = simulator.problem.roles.axes
    return Take(model, trajectory, axes, drive.name, drive.period_s, drive.block_s, speed)


def take_beside(simulator: Simulator, trial: Trial, duration: float) -> Take:
    """Simulate the drive of a trial and keep what its pictures need, with the measured marker.

    Args:
        simulator: the robot.
        trial: the measured trial.
        duration: how long, s; the whole recording is simulated in any case.

    Raises:
        GaitoptError: the simulation failed, or no marker was measured.
    """
    shown = take(simulator, trial.drive, max(duration, latest_gait_time(trial)))
    return replace(shown, ghost=ghost_of(simulator, trial, shown.trajectory))
