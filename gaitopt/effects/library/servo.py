"""The nominal servo: its torque limit.

A nominal servo is a MuJoCo position actuator: torque kp (ctrl - q) [N m], clipped to its `forcerange`,
on a joint whose `damping` is the slope of the motor's torque-speed line and whose `armature` is the
rotor's inertia behind its gear.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.parts import Parts


def torque_limits(parts: Parts) -> NDArray[np.float64]:
    """Return the torque limit of each target servo, N m; inf where there is none."""
    model, servos = parts.model, parts.servos
    limited = model.actuator_forcelimited[servos].astype(bool)
    return np.where(limited, model.actuator_forcerange[servos, 1], math.inf)


def torque_limit(parts: Parts) -> float:
    """Return the largest torque limit of the target servos, N m; inf without one."""
    return float(torque_limits(parts).max(initial=0.0))


def torque_scale(parts: Parts) -> float:
    """Return the torque limit, N m; where there is none, the torque at an error of 5 degrees."""
    limit = torque_limit(parts)
    if math.isfinite(limit):
        return limit
    return float(parts.model.actuator_gainprm[parts.servos, 0].max()) * math.radians(5.0)
