"""The supply that servos share."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.added import added_name
from gaitopt.effects.effect import Effect, Update, loop_interval_s
from gaitopt.effects.library.servo import torque_limit
from gaitopt.effects.library.servo_deadband import net_torque_limits
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior

_SUPPLY_S = 0.01
"""Time constant with which the limits follow the torques, s: assumed, half a servo's frame. Without one
the limits chatter."""


def _no_limit(parts: Parts) -> str | None:
    if not math.isfinite(torque_limit(parts)):
        return "a servo has no torque limit that can fall"
    return None


def _sense_torques(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    """Add a sensor of each servo's torque, where the supply of another target has not added it."""
    for index in range(len(nominal.channels)):
        actuator = spec.actuators[index]
        if spec.sensor(added_name("torque", actuator.name)) is not None:
            continue
        spec.add_sensor(
            name=added_name("torque", actuator.name),
            type=mujoco.mjtSensor.mjSENS_ACTUATORFRC,
            objtype=mujoco.mjtObj.mjOBJ_ACTUATOR,
            objname=actuator.name,
        )


def _sag(parts: Parts, share: float) -> Update:
    """Return the loop that sets each limit to L (1 - share drawn); drawn is sum|torque| / sum L, smoothed."""
    model, servos = parts.model, parts.servos
    names = [added_name("torque", model.actuator(i).name) for i in range(len(parts.channels))]
    addresses = [int(model.sensor(name).adr[0]) for name in names]
    limits = net_torque_limits(model)[: len(names)]
    lost = (share * limits[servos, None] * (-1.0, 1.0)).ravel().tolist()
    ranges = model.actuator_forcerange.reshape(-1)
    places = [2 * servo + side for servo in servos for side in (0, 1)]
    ends = [*zip(places, ranges[places].tolist(), lost, strict=True)]
    available, drawn = float(limits.sum()), 0.0
    share_new = min(1.0, loop_interval_s(parts.step_s) / _SUPPLY_S)

    def update(sensed: NDArray[np.float64]) -> None:
        nonlocal drawn
        now = 0.0
        for address in addresses:
            now += abs(sensed.item(address))
        drawn += share_new * (min(1.0, now / available) - drawn)
        for index, end, most in ends:  # a few numbers: an array of them takes several times as long
            ranges[index] = end - drawn * most

    return Update(update)


SERVO_SAG = Effect(
    name="servo_sag",
    summary="shared supply: the torque available falls by this share when all servos draw their full torque",
    parameter="share_lost",
    unit="",
    neutral=0.0,
    low=0.0,
    high=0.8,
    scale="lin",
    prior=Prior(
        "half-normal",
        0.0,
        0.25,
        "three stalled 9 g servos draw about 2 A; 0.3 to 0.6 ohm of cable, breadboard and regulator take "
        "0.6 to 1.2 V of 5 V, and stall torque is proportional to voltage",
    ),
    allowed=(0.0, 1.0),
    target="any",
    missing=_no_limit,
    structure=_sense_torques,
    loop=_sag,
)
