"""Does the robot rest at its start, under the targets held before a gait?"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gaitopt.problem.start import start_targets
from gaitopt.simulation.audit.finding import DIVERGED, UNREST_AT_START, Finding
from gaitopt.simulation.audit.settings import CheckSettings
from gaitopt.simulation.audit.standing import check_standing
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]


def check_rest(simulator: Simulator, settings: CheckSettings) -> Iterator[Finding]:
    """Hold the robot at its start, and find what moves."""
    time = simulator.clock(settings.rest_s)
    held = np.tile(start_targets(simulator.problem), (len(time), 1))
    trajectory = simulator.play(time, held)
    if trajectory.status != "ok":
        message = f"held at its start, the simulation {trajectory.status}"
        yield Finding(DIVERGED.name, "", math.inf, 0.0, message)
        return
    yield from check_standing(simulator, trajectory, settings)
    where = f"held at its start for {settings.rest_s:g} s"
    marker = trajectory.stacked("marker")
    speed, limit = _fastest(trajectory.time, marker), settings.rest_marker_m_s
    if not speed <= limit:
        moved = np.linalg.norm(marker[-1] - marker[0])
        message = f"{where} the marker moves at up to {speed:.3g} m/s and ends {moved:.3g} m away"
        yield Finding(UNREST_AT_START.name, "", speed, limit, message)
    speed, limit = _fastest(trajectory.time, trajectory.stacked("joint")), settings.rest_joint_rad_s
    if not speed <= limit:
        message = f"{where} a joint turns at up to {speed:.3g} rad/s"
        yield Finding(UNREST_AT_START.name, "", speed, limit, message)


def _fastest(time: Array, series: Array) -> float:
    """Return the largest speed of a vector series between samples, in its unit per second."""
    steps = np.diff(series, axis=0) / np.diff(time)[:, None]
    return float(np.linalg.norm(steps, axis=1).max(initial=0.0)) if len(steps) else math.inf
