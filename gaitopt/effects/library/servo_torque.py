"""The torque that a servo can produce."""

from __future__ import annotations

import math

from gaitopt.effects.effect import Effect
from gaitopt.effects.library.servo import torque_limit, torque_scale
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior


def _limit_torque(parts: Parts, limit: float, nominal: float) -> None:
    """Limit the torque; servos of different strength keep their proportion."""
    model = parts.model
    for i in parts.servos:
        if model.actuator_forcelimited[i]:
            model.actuator_forcerange[i] *= limit / nominal
        else:
            model.actuator_forcelimited[i] = 1
            model.actuator_forcerange[i] = -limit, limit


SERVO_TORQUE_LIMIT = Effect(
    name="servo_torque_limit",
    summary="saturation of the servo's torque",
    parameter="limit_n_m",
    unit="N m",
    neutral=torque_limit,
    low=0.15,
    high=1.5,
    scale="log",
    prior=Prior(
        "log-normal",
        0.85,
        0.35,
        "datasheets of 9 g servos: 1.2 to 2.5 kgf cm at 4.8 V; copies, a sagging supply and heat lower it",
    ),
    reference=torque_scale,
    reference_name="the nominal limit",
    allowed=(0.0, math.inf),
    target="any",
    on_joints=True,
    model=_limit_torque,
)
