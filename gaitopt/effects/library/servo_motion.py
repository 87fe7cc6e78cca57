"""How a servo moves its joint: gain, damping and inertia."""

from __future__ import annotations

import math

from gaitopt.effects.effect import Effect, Plausible
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior


def _scale_gain(parts: Parts, scale: float, _: float) -> None:
    """Scale kp, which MuJoCo keeps as the gain and as minus the bias on the angle."""
    parts.model.actuator_gainprm[parts.servos, 0] *= scale
    parts.model.actuator_biasprm[parts.servos, 1] *= scale


SERVO_GAIN = Effect(
    name="servo_gain",
    summary="proportional gain of the servo",
    parameter="scale",
    unit="",
    neutral=1.0,
    low=0.2,
    high=5.0,
    scale="log",
    prior=Prior(
        "log-normal",
        1.0,
        0.5,
        "gains of micro servos are not published; full drive at 3 to 10 degrees of error",
    ),
    allowed=(0.0, math.inf),
    target="any",
    model=_scale_gain,
)


def _damped_joints(parts: Parts) -> bool:
    return bool(parts.model.dof_damping[parts.servo_dofs].any())


def _no_damping(parts: Parts) -> str | None:
    if not (_damped_joints(parts) or parts.model.actuator_biasprm[parts.servos, 2].any()):
        return "neither the driven joints nor their servos have damping to scale"
    return None


def _damping_of_servos_alone(parts: Parts) -> Plausible | None:
    return None if _damped_joints(parts) else _VELOCITY_GAIN


def _scale_damping(parts: Parts, scale: float, _: float) -> None:
    """Scale the joints' damping, and kv, which MuJoCo keeps as minus the bias on the speed."""
    parts.model.dof_damping[parts.servo_dofs] *= scale
    parts.model.dof_dampingpoly[parts.servo_dofs] *= scale
    parts.model.actuator_biasprm[parts.servos, 2] *= scale


_VELOCITY_GAIN = Plausible(
    0.02,
    4.0,
    Prior(
        "log-normal",
        0.4,
        1.2,
        "hobby servos mostly have no feedback of speed, and where a servo alone has damping, its gain was "
        "chosen for the simulator",
    ),
)


SERVO_DAMPING = Effect(
    name="servo_damping",
    summary="damping of the driven joint, and of the servo's own feedback of speed",
    parameter="scale",
    unit="",
    neutral=1.0,
    low=0.2,
    high=4.0,
    scale="log",
    prior=Prior(
        "log-normal",
        1.0,
        0.4,
        "stall torque over no-load speed of 9 g servos: 0.01 to 0.03 N m s/rad, and gear losses on top",
    ),
    allowed=(0.0, math.inf),
    target="any",
    otherwise=_damping_of_servos_alone,
    on_joints=True,
    missing=_no_damping,
    model=_scale_damping,
)


def _armature(parts: Parts) -> float:
    return float(parts.model.dof_armature[parts.servo_dofs].max(initial=0.0))


def _armature_scale(parts: Parts) -> float:
    """Return the nominal armature, kg m^2; where there is none, the inertia that the servo turns."""
    return _armature(parts) or float(parts.model.dof_M0[parts.servo_dofs].max(initial=1e-6))


def _set_armature(parts: Parts, armature: float, nominal: float) -> None:
    """Set the rotor's inertia; servos of different inertia keep their proportion."""
    dofs = parts.servo_dofs
    if nominal > 0.0:
        parts.model.dof_armature[dofs] *= armature / nominal
    else:
        parts.model.dof_armature[dofs] = armature


SERVO_INERTIA = Effect(
    name="servo_inertia",
    summary="rotor's inertia, reflected through the gear",
    parameter="armature_kg_m2",
    unit="kg m^2",
    neutral=_armature,
    low=0.1,
    high=10.0,
    scale="log",
    prior=Prior(
        "log-normal",
        1.0,
        0.8,
        "a rotor of 0.5e-9 to 4e-9 kg m^2 behind a gear of 1:200 to 1:350 in 9 g servos",
    ),
    reference=_armature_scale,
    reference_name="the nominal armature",
    allowed=(0.0, math.inf),
    target="any",
    on_joints=True,
    model=_set_armature,
)
