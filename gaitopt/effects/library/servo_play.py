"""Free play between servo and link."""

from __future__ import annotations

import mujoco
import numpy as np

from gaitopt.effects.added import added_name
from gaitopt.effects.effect import Effect
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior

_LINK_SHARE = 0.05
"""Share of a servo's inertia and damping on the link's side of its free play: horn and output shaft."""

_LEAST_INERTIA = 0.05
"""Inertia of a rotor without armature, as a share of its link's: it needs some to be simulated."""

_STOP_S = 2e-3
"""Time constant of the stop at the end of the free play, s: the shortest that steps of 1 ms can integrate."""

_HARD = (0.9999, 0.9999, 1e-3, 0.5, 2.0)
"""Impedance of that stop: a torque of 0.25 N m presses into it by less than 1e-4 rad."""


def _add_rotor(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    """Give the servo a joint of its own, which moves the link between two stops.

    The rotor turns about an axis fixed in the world. All its inertia is armature, which acts along its
    own coordinate only. The link's joint keeps its name, limits, springs and couplings; its dry friction is
    the servo's.
    """
    for index, joint in zip(nominal.servos, nominal.servo_joints, strict=True):
        actuator, link = spec.actuators[index], spec.joints[joint]
        link.name = link.name or f"link of {actuator.name}"
        name = added_name("rotor", link.name)
        body = spec.worldbody.add_body(name=name, mass=1e-9, inertia=[1e-12] * 3, explicitinertial=True)
        rotor = body.add_joint(name=name, type=link.type, axis=[0.0, 0.0, 1.0], ref=link.ref)
        least = _LEAST_INERTIA * float(nominal.model.dof_M0[nominal.model.jnt_dofadr[joint]])
        rotor.armature = max((1.0 - _LINK_SHARE) * link.armature, least)
        link.armature *= _LINK_SHARE
        damping = np.array(link.damping)
        rotor.damping, link.damping = (1.0 - _LINK_SHARE) * damping, _LINK_SHARE * damping
        rotor.frictionloss, link.frictionloss = link.frictionloss, 0.0
        rotor.solref_friction, rotor.solimp_friction = link.solref_friction, link.solimp_friction
        actuator.target = name
        play = spec.add_tendon(
            name=name,
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            range=[-1.0, 1.0],
            solref_limit=[_STOP_S, 1.0],
            solimp_limit=_HARD,
        )
        play.wrap_joint(link.name, 1.0)
        play.wrap_joint(name, -1.0)


def _set_play(parts: Parts, half_width: float, _: float) -> None:
    for joint in parts.servo_joints:
        play = parts.model.tendon(parts.model.joint(joint).name).id
        parts.model.tendon_range[play] = -half_width, half_width


SERVO_BACKLASH = Effect(
    name="servo_backlash",
    summary="free play between servo and link, to either side",
    parameter="half_width_rad",
    unit="rad",
    neutral=0.0,
    low=0.0,
    high=0.12,
    scale="lin",
    prior=Prior(
        "half-normal", 0.0, 0.025, "plastic gear trains of 9 g servos and their horns: 1 to 3 degrees of play"
    ),
    allowed=(0.0, 1.0),
    target="any",
    on_joints=True,
    structure=_add_rotor,
    model=_set_play,
)
