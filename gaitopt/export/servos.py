"""Which actuators are servos: only what turns one joint to an angle can be played by an RC or a bus servo."""

from __future__ import annotations

import mujoco

from gaitopt.core.errors import GaitoptError
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem

_TRANSMISSIONS = {
    mujoco.mjtTrn.mjTRN_TENDON: "pulls a tendon",
    mujoco.mjtTrn.mjTRN_SITE: "pushes at a site",
    mujoco.mjtTrn.mjTRN_SLIDERCRANK: "moves a slider-crank",
    mujoco.mjtTrn.mjTRN_BODY: "sticks to what a body touches",
}
"""What an actuator does that turns no joint, by its transmission."""

_JOINTS = {
    mujoco.mjtJoint.mjJNT_SLIDE: "moves a slide joint, which goes along a line",
    mujoco.mjtJoint.mjJNT_BALL: "turns a ball joint, which takes three servos",
    mujoco.mjtJoint.mjJNT_FREE: "pushes a free joint",
}
"""The same by the kind of its joint."""


def check_servos(problem: Problem) -> None:
    """Check that every channel is a position servo on a hinge.

    Raises:
        GaitoptError: one is not; the message says what it is instead.
    """
    model = build_model(problem)
    for name in problem.channel_names:
        reason = _no_servo(model, model.actuator(name).id)
        if reason is not None:
            raise GaitoptError(
                f"{problem.source}: channels.{name}: its actuator {reason}; allowed: a position servo on a "
                "hinge, as RC and bus servos are"
            )


def _no_servo(model: mujoco.MjModel, actuator: int) -> str | None:
    """Return why an actuator is no servo, as what it does instead; None for a servo."""
    transmission = mujoco.mjtTrn(int(model.actuator_trntype[actuator]))
    if transmission in _TRANSMISSIONS:
        return _TRANSMISSIONS[transmission]
    joint = mujoco.mjtJoint(int(model.jnt_type[int(model.actuator_trnid[actuator, 0])]))
    if joint in _JOINTS:
        return _JOINTS[joint]
    if model.actuator_dyntype[actuator] == mujoco.mjtDyn.mjDYN_INTEGRATOR:
        return "is sent speeds, not angles"
    return None
