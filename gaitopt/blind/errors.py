"""The small errors of a case's robot in the words of the library: what is there without being planted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gaitopt.blind.sealed import PlantedEffect
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.effects.active import ActiveEffect
from gaitopt.effects.parts import ALL, Parts
from gaitopt.simulation.tolerances import SmallErrors


def as_effects(
    errors: SmallErrors,
    measurement: Sequence[ActiveEffect],
    hypotheses: Sequence[Hypothesis],
    parts: Parts,
) -> tuple[PlantedEffect, ...]:
    """Return the small errors of a robot and its camera as effects; those that are none are left out.

    An effect on all servos has their mean error, as one on all pads or hinges has.

    Args:
        errors: the robot's.
        measurement: the camera's and its clock's.
        hypotheses: the effects that a diagnosis may name.
        parts: the nominal robot.
    """
    factors, offsets = _factors(errors, len(parts.pads)), _offsets(errors)
    found = []
    for one in hypotheses:
        name = one.effect.name
        own = [each.value for each in measurement if each.effect.name == name]
        if name in factors:
            value = one.value(one.neutral) * _of_target(factors[name], one.target, parts)
        elif name in offsets:
            value = one.value(one.neutral) + _of_target(offsets[name], one.target, parts)
        elif own:
            (value,) = own
        else:
            continue
        found.append(PlantedEffect(name=name, target=one.target, parameters={one.effect.parameter: value}))
    return tuple(found)


def _factors(errors: SmallErrors, pads: int) -> Mapping[str, Sequence[float]]:
    """Return the factors on each effect's parameter: one for each servo, geom or hinge."""
    of_pads = errors.friction[:pads]
    named = {
        "pad_friction": of_pads,
        "body_friction": errors.friction[pads:],
        "pad_imbalance": (of_pads[0] / float(np.mean(of_pads[1:])),) if pads > 1 else (),
        "servo_torque_limit": errors.servo_strength,
        "servo_gain": errors.servo_gain,
        "servo_damping": errors.servo_damping,
        "hinge_stiffness": errors.hinge_stiffness,
    }
    return {name: values for name, values in named.items() if values}


def _offsets(errors: SmallErrors) -> Mapping[str, Sequence[float]]:
    """Return what is added to each effect's parameter."""
    return {"servo_trim": errors.servo_trim_rad, "ground_slope": errors.slope_rad[:1]}


def _of_target(values: Sequence[float], target: str, parts: Parts) -> float:
    """Return the mean error of all, or that of one servo."""
    return float(np.mean(values)) if target == ALL else values[parts.channels.index(target)]
