"""How far servos at their speed limit fall behind a gait."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.gait.calibration import Calibration
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem

_STEPS = 4096
"""Points of a cycle at which a servo is followed."""

_BEHIND_DEG = 0.5
"""A servo closer than this to its target, degrees, has reached it: the dead band of a 9 g servo."""


@dataclass(frozen=True)
class Lag:
    """How far a servo at its speed limit falls behind its commands, at most, once it is walking."""

    channel: str
    angle_deg: float
    time_s: float


def lags(problem: Problem, gait: Gait) -> list[Lag]:
    """Return how far each servo falls behind the gait; servos that keep up are left out."""
    found = []
    cycles = np.arange(2 * _STEPS) / _STEPS
    targets = np.rad2deg(gait.targets(cycles * gait.period_s))
    for index, name in enumerate(gait.channels):
        behind = _behind(targets[:, index], problem.file.channels[name].servo, gait.period_s / _STEPS)
        angle = float(behind.max(initial=0.0))
        if angle > _BEHIND_DEG:
            found.append(Lag(name, angle, _longest(behind > _BEHIND_DEG) * gait.period_s / _STEPS))
    return found


def _behind(targets: NDArray[np.float64], servo: Calibration, step_s: float) -> NDArray[np.float64]:
    """Return the distance of a speed-limited follower from its target in the second cycle, degrees."""
    reach = servo.speed_limit_deg_s * step_s
    position = float(targets[0])
    behind = np.empty_like(targets)
    for step, target in enumerate(targets.tolist()):
        behind[step] = abs(target - position)
        position += min(max(target - position, -reach), reach)
    return behind[len(targets) // 2 :]


def _longest(true: NDArray[np.bool_]) -> int:
    """Return the length of the longest run of a periodic series, at most its own."""
    if true.all():
        return len(true)
    edges = np.flatnonzero(~true)
    return int(np.diff(np.append(edges, edges[0] + len(true))).max()) - 1
