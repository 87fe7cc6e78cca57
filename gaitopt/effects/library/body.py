"""Masses, lengths, gravity and outside forces."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from gaitopt.effects.added import added_name
from gaitopt.effects.effect import Effect
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior


def _module_length(parts: Parts) -> float:
    """Return the radius of the trunk's largest geom, m."""
    model = parts.model
    radii = model.geom_rbound[model.geom_bodyid == parts.trunk]
    return float(radii.max(initial=0.0)) or float(model.stat.meansize)


def _tilt_gravity(parts: Parts, angle: float, _: float) -> None:
    """Turn gravity backward about the left axis: forward is then uphill."""
    turn = np.empty(4)
    mujoco.mju_axisAngle2Quat(turn, parts.axes[1], angle)
    gravity = np.array(parts.model.opt.gravity)
    mujoco.mju_rotVecQuat(parts.model.opt.gravity, gravity, turn)


GROUND_SLOPE = Effect(
    name="ground_slope",
    summary="slope of the ground along forward, uphill positive",
    parameter="angle_rad",
    unit="rad",
    neutral=0.0,
    low=-0.12,
    high=0.12,
    scale="lin",
    prior=Prior("normal", 0.0, 0.02, "tables and floors: within a degree or two of level"),
    allowed=(-1.5, 1.5),
    model=_tilt_gravity,
)


def _trunk_is_held(parts: Parts) -> str | None:
    return "the trunk is held" if parts.model.body_weldid[parts.trunk] == 0 else None


def _add_mass(parts: Parts, mass: float, _: float) -> None:
    """Add a point mass at the trunk's centre of mass, where it adds no rotational inertia."""
    parts.model.body_mass[parts.trunk] += mass


PAYLOAD_MASS = Effect(
    name="payload_mass",
    summary="point mass at the trunk's centre",
    parameter="mass_kg",
    unit="kg",
    neutral=0.0,
    low=0.0,
    high=0.6,
    scale="lin",
    prior=Prior("half-normal", 0.0, 0.12, "glue, wires and connectors that were not weighed"),
    reference=lambda parts: parts.mass,
    reference_name="the robot's mass",
    allowed=(0.0, math.inf),
    missing=_trunk_is_held,
    of_free_robot=True,
    model=_add_mass,
)


def _shift_centre(parts: Parts, offset: float, _: float) -> None:
    model = parts.model
    forward = parts.at_zero.xmat[parts.trunk].reshape(3, 3).T @ parts.axes[0]
    model.body_ipos[parts.trunk] += offset * forward


COM_OFFSET = Effect(
    name="com_offset",
    summary="shift of the trunk's centre of mass along forward",
    parameter="offset_m",
    unit="m",
    neutral=0.0,
    low=-0.7,
    high=0.7,
    scale="lin",
    prior=Prior(
        "normal", 0.0, 0.15, "servos and brackets glued by hand, to within a few mm on a module of 50 mm"
    ),
    reference=_module_length,
    reference_name="the trunk's radius",
    missing=_trunk_is_held,
    of_free_robot=True,
    model=_shift_centre,
)


def _scale_inertia(parts: Parts, scale: float, _: float) -> None:
    parts.model.body_inertia[:] *= scale


LINK_INERTIA = Effect(
    name="link_inertia",
    summary="rotational inertia of all links",
    parameter="scale",
    unit="",
    neutral=1.0,
    low=0.3,
    high=3.0,
    scale="log",
    prior=Prior(
        "log-normal", 1.0, 0.3, "boxes of uniform density stand for panels, servos, brackets and glue"
    ),
    allowed=(0.0, math.inf),
    model=_scale_inertia,
)


def _scale_lengths(spec: mujoco.MjSpec, nominal: Parts, scale: float) -> None:
    """Put the robot into a frame that scales lengths, and inertias by the square, but not masses."""
    frame = spec.worldbody.add_frame(
        scale=[scale] * 3, massscale=1.0, scaling=mujoco.mjtScaling.mjSCALING_GEOMETRY
    )
    others = set(range(nominal.model.nbody)) - set(np.flatnonzero(nominal.robot_bodies).tolist())
    for index, body in enumerate(list(spec.bodies)):
        if index and body.parent.name == spec.worldbody.name and index not in others:
            outermost = body.frame
            while outermost is not None and outermost.frame is not None:
                outermost = outermost.frame
            (outermost or body).set_frame(frame)


GEOMETRY_SCALE = Effect(
    name="geometry_scale",
    summary="all lengths of the robot, masses kept",
    parameter="scale",
    unit="",
    neutral=1.0,
    low=0.85,
    high=1.15,
    scale="log",
    prior=Prior(
        "log-normal", 1.0, 0.03, "laser cut to 0.2 mm; folds and hinge gaps change 50 mm by a few mm"
    ),
    allowed=(0.0, 100.0),
    of_free_robot=True,
    structure=_scale_lengths,
)


def _add_tether(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    """Add an actuator that needs no command: a force on the trunk along an axis of the world."""
    body = spec.bodies[nominal.trunk]
    name = added_name("tether", nominal.channels[0])
    body.add_site(name=name, pos=nominal.model.body_ipos[nominal.trunk])
    world = added_name("world", nominal.channels[0])
    spec.worldbody.add_site(name=world)
    spec.add_actuator(
        name=name,
        trntype=mujoco.mjtTrn.mjTRN_SITE,
        target=name,
        refsite=world,
        gear=[*-nominal.axes[0], 0.0, 0.0, 0.0],
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
    )


def _pull(parts: Parts, force: float, _: float) -> None:
    tether = parts.model.actuator(added_name("tether", parts.channels[0])).id
    parts.model.actuator_gainprm[tether] = 0.0
    parts.model.actuator_biasprm[tether, :3] = force, 0.0, 0.0


TETHER_DRAG = Effect(
    name="tether_drag",
    summary="constant backward force on the trunk",
    parameter="force_n",
    unit="N",
    neutral=0.0,
    low=0.0,
    high=0.3,
    scale="lin",
    prior=Prior(
        "half-normal", 0.0, 0.05, "a thin cable that bends and drags: 10 to 50 mN on a robot of 0.8 N"
    ),
    reference=lambda parts: parts.weight,
    reference_name="the robot's weight",
    missing=_trunk_is_held,
    of_free_robot=True,
    structure=_add_tether,
    model=_pull,
)
