"""Passive hinges of a laminate: stiffness, damping, friction, hysteresis and asymmetry.

The nominal hinge is a spring and a damper, torque -k q - b dq/dt [N m]. Of a hinge that a
servo turns as well, only the spring belongs here; the damping is the servo's.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from gaitopt.effects.effect import Effect
from gaitopt.effects.library.dry_friction import stiffen_friction
from gaitopt.effects.library.servo import torque_scale
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior

_OFF_CENTRE = 0.05
"""A hinge counts as left or right beyond this share of the outermost hinge's distance from the middle."""


def hinge_stiffness(parts: Parts) -> float:
    """Return the hinges' mean stiffness, N m/rad; where there is none, a hundredth of the servos' torque."""
    stiffness = float(parts.model.jnt_stiffness[parts.hinges].mean()) if parts.hinges else 0.0
    return stiffness or 0.01 * torque_scale(Parts(parts.model, parts.roles, parts.channels))


def _no_stiffness(parts: Parts) -> str | None:
    return None if parts.model.jnt_stiffness[parts.hinges].any() else "the hinges have no stiffness"


def _scale_stiffness(parts: Parts, scale: float, _: float) -> None:
    parts.model.jnt_stiffness[parts.hinges] *= scale
    parts.model.jnt_stiffnesspoly[parts.hinges] *= scale


HINGE_STIFFNESS = Effect(
    name="hinge_stiffness",
    summary="stiffness of the passive hinges, all alike",
    parameter="scale",
    unit="",
    neutral=1.0,
    low=0.2,
    high=5.0,
    scale="log",
    prior=Prior(
        "log-normal", 1.0, 0.4, "a fold's stiffness differs by tens of per cent with film, gap width and wear"
    ),
    allowed=(0.0, math.inf),
    role="hinges",
    missing=_no_stiffness,
    model=_scale_stiffness,
)


def _add_cubic(parts: Parts, cubic: float, _: float) -> None:
    """Add -cubic q^3; MuJoCo keeps the coefficients of q^2 and q^3 beside the stiffness."""
    parts.model.jnt_stiffnesspoly[parts.hinges, 1] += cubic


HINGE_NONLINEARITY = Effect(
    name="hinge_nonlinearity",
    summary="cubic stiffness of the passive hinges; positive hardens",
    parameter="cubic_n_m_rad3",
    unit="N m/rad^3",
    neutral=0.0,
    low=-0.3,
    high=3.0,
    scale="lin",
    prior=Prior(
        "normal",
        0.0,
        0.7,
        "folded laminates harden towards 90 degrees, by up to their linear stiffness at 1 rad",
    ),
    reference=hinge_stiffness,
    reference_name="the hinges' stiffness",
    role="hinges",
    model=_add_cubic,
)


def _no_damping(parts: Parts) -> str | None:
    dofs = parts.model.jnt_dofadr[parts.undriven_hinges]
    return None if parts.model.dof_damping[dofs].any() else "no hinge without a servo has damping"


def _scale_damping(parts: Parts, scale: float, _: float) -> None:
    dofs = parts.model.jnt_dofadr[parts.undriven_hinges]
    parts.model.dof_damping[dofs] *= scale
    parts.model.dof_dampingpoly[dofs] *= scale


HINGE_DAMPING = Effect(
    name="hinge_damping",
    summary="damping of the passive hinges that no servo turns",
    parameter="scale",
    unit="",
    neutral=1.0,
    low=0.1,
    high=1000.0,
    scale="log",
    prior=Prior(
        "log-normal",
        1.0,
        1.5,
        "a ring-down test misses most of a film's loss; assembled robots are damped far more",
    ),
    allowed=(0.0, math.inf),
    role="hinges",
    missing=_no_damping,
    model=_scale_damping,
)


def _add_friction(parts: Parts, torque: float, _: float) -> None:
    dofs = parts.model.jnt_dofadr[parts.hinges]
    parts.model.dof_frictionloss[dofs] += torque
    stiffen_friction(parts.model, dofs)


HINGE_FRICTION = Effect(
    name="hinge_friction",
    summary="dry friction of each passive hinge",
    parameter="torque_n_m",
    unit="N m",
    neutral=0.0,
    low=0.0,
    high=5.0,
    scale="lin",
    prior=Prior(
        "half-normal",
        0.0,
        1.0,
        "folds that rub on glue and on each other: of the order of their spring's torque",
    ),
    reference=hinge_stiffness,
    reference_name="the hinges' stiffness times 1 rad",
    allowed=(0.0, math.inf),
    role="hinges",
    model=_add_friction,
)


def _let_yield(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    for joint in nominal.hinges:
        spec.joints[joint].springyield = 1.0


def _set_yield(parts: Parts, torque: float, _: float) -> None:
    """Let each spring yield beyond the angle at which it carries `torque`."""
    stiffness = parts.model.jnt_stiffness[parts.hinges]
    angles = np.full(len(stiffness), 1e9)
    np.divide(torque, stiffness, out=angles, where=stiffness > 0.0)
    parts.model.jnt_springyield[parts.hinges] = angles


HINGE_HYSTERESIS = Effect(
    name="hinge_hysteresis",
    summary="elasto-plastic hinges: the spring yields at this torque and keeps its new rest angle",
    parameter="yield_n_m",
    unit="N m",
    neutral=math.inf,
    low=0.05,
    high=1.6,
    scale="log",
    prior=Prior("log-normal", 0.7, 0.8, "creased card and film keep a set after a fold of 30 to 90 degrees"),
    reference=hinge_stiffness,
    reference_name="the hinges' stiffness times 1 rad",
    allowed=(0.0, math.inf),
    role="hinges",
    missing=_no_stiffness,
    structure=_let_yield,
    model=_set_yield,
)


def _sides(parts: Parts) -> tuple[list[int], list[int]]:
    """Return the hinges on the left and on the right of their middle, in the reference pose."""
    left_axis = parts.axes[1]
    across = parts.at_zero.xanchor[parts.hinges] @ left_axis
    across = across - 0.5 * (across.max(initial=-math.inf) + across.min(initial=math.inf))
    edge = _OFF_CENTRE * float(np.abs(across).max(initial=0.0))
    left = [j for j, at in zip(parts.hinges, across, strict=True) if at > max(edge, 1e-9)]
    right = [j for j, at in zip(parts.hinges, across, strict=True) if at < -max(edge, 1e-9)]
    return left, right


def _one_sided(parts: Parts) -> str | None:
    left, right = _sides(parts)
    if not (left and right):
        return "it needs hinges on both sides"
    return _no_stiffness(parts)


def _stiffen_left(parts: Parts, ratio: float, _: float) -> None:
    for side, factor in zip(_sides(parts), (2.0 * ratio / (1.0 + ratio), 2.0 / (1.0 + ratio)), strict=True):
        parts.model.jnt_stiffness[side] *= factor
        parts.model.jnt_stiffnesspoly[side] *= factor


HINGE_ASYMMETRY = Effect(
    name="hinge_asymmetry",
    summary="hinges on the left stiffer than on the right by this ratio, mean kept",
    parameter="ratio",
    unit="",
    neutral=1.0,
    low=0.3,
    high=3.0,
    scale="log",
    prior=Prior("log-normal", 1.0, 0.3, "two sides of a hand-made laminate: tens of per cent"),
    allowed=(0.0, math.inf),
    role="hinges",
    missing=_one_sided,
    model=_stiffen_left,
)
