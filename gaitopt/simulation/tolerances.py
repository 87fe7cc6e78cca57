"""Robots that are wrong in many ways at once: the small errors that a problem's tolerances allow."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects import EFFECTS
from gaitopt.effects.active import ActiveEffect
from gaitopt.effects.added import is_added
from gaitopt.effects.parts import Parts
from gaitopt.problem.tolerances import WIDEST, Tolerances

Factors = tuple[float, ...]


@dataclass(frozen=True)
class SmallErrors:
    """What is wrong with one robot and its floor; an empty tuple stands for parts without errors.

    Attributes:
        friction: factor on the friction of each geom that may touch the ground, the pads first.
        servo_strength: factor on each servo's torque limit.
        servo_gain: factor on each servo's gain.
        servo_damping: factor on the damping of each servo and of the joint that it turns.
        servo_trim_rad: zero error of each servo, rad.
        mass: factor on the mass and inertia of each body, the world first.
        hinge_stiffness: factor on the stiffness of each passive hinge.
        slope_rad: slope of the floor forward and to the left, uphill positive, rad.
    """

    friction: Factors = ()
    servo_strength: Factors = ()
    servo_gain: Factors = ()
    servo_damping: Factors = ()
    servo_trim_rad: Factors = ()
    mass: Factors = ()
    hinge_stiffness: Factors = ()
    slope_rad: tuple[float, float] = (0.0, 0.0)


NO_ERRORS = SmallErrors()
"""The nominal robot."""


def draw_errors(parts: Parts, tolerances: Tolerances, rng: np.random.Generator) -> SmallErrors:
    """Return the errors of one robot and its floor, each drawn uniformly by its tolerance.

    Every draw is made, whatever the tolerances: an error does not depend on the size of another one.

    Args:
        parts: the nominal robot.
        tolerances: standard deviation of each error.
        rng: where the draws come from.
    """
    servos = len(parts.channels)

    def draws(sd: float, count: int) -> list[float]:
        values: list[float] = (sd * rng.uniform(-WIDEST, WIDEST, count)).tolist()
        return values

    def factors(common: float, each: float, count: int) -> Factors:
        (of_all,) = draws(common, 1)
        return tuple((1.0 + of_all) * (1.0 + own) for own in draws(each, count))

    friction = factors(tolerances.friction, tolerances.friction_each, len(touching_geoms(parts)))
    strength = factors(tolerances.servo_strength, tolerances.servo_strength_each, servos)
    gain = factors(0.0, tolerances.servo_gain_each, servos)
    damping = factors(0.0, tolerances.servo_damping_each, servos)
    trim = draws(math.radians(tolerances.servo_trim_deg), servos)
    mass = factors(0.0, tolerances.mass_each, len(own_bodies(parts.model)))
    hinges = factors(0.0, tolerances.hinge_stiffness_each, len(parts.hinges))
    forward, left = draws(math.radians(tolerances.slope_deg), 2)
    return SmallErrors(
        friction=friction,
        servo_strength=strength,
        servo_gain=gain,
        servo_damping=damping,
        servo_trim_rad=tuple(trim),
        mass=mass,
        hinge_stiffness=hinges,
        slope_rad=(forward, left),
    )


def allowed(effect: str, neutral: float, tolerances: Tolerances) -> tuple[float, float]:
    """Return the least and the largest parameter of an effect that small errors may give it, in its unit.

    Both are the neutral one for an effect that is no small error.

    Args:
        effect: name of the effect.
        neutral: its parameter on the nominal robot.
        tolerances: standard deviation of each error.
    """
    low, high = (neutral * _factors(tolerances, end).get(effect, 1.0) for end in (-WIDEST, WIDEST))
    offset = WIDEST * _offsets(tolerances).get(effect, 0.0)
    return low - offset, high + offset


def _factors(tolerances: Tolerances, units: float) -> dict[str, float]:
    """Return the factor on each effect's parameter where every error is so many standard deviations."""

    def factor(*sds: float) -> float:
        return math.prod(1.0 + units * sd for sd in sds)

    friction = factor(tolerances.friction, tolerances.friction_each)
    return {
        "pad_friction": friction,
        "body_friction": friction,
        "pad_imbalance": factor(tolerances.friction_each) / factor(-tolerances.friction_each),
        "servo_torque_limit": factor(tolerances.servo_strength, tolerances.servo_strength_each),
        "servo_gain": factor(tolerances.servo_gain_each),
        "servo_damping": factor(tolerances.servo_damping_each),
        "hinge_stiffness": factor(tolerances.hinge_stiffness_each),
    }


def _offsets(tolerances: Tolerances) -> dict[str, float]:
    """Return the standard deviation of each effect's parameter to which an error is added."""
    return {
        "servo_trim": math.radians(tolerances.servo_trim_deg),
        "ground_slope": math.radians(tolerances.slope_deg),
        **_of_measurement(tolerances),
    }


def touching_geoms(parts: Parts) -> list[int]:
    """Return the geoms whose friction differs: those of the roles, or all where none is named."""
    return parts.touching or list(range(parts.model.ngeom))


def own_bodies(model: mujoco.MjModel) -> list[int]:
    """Return the bodies that no effect has added, the world first."""
    return [i for i in range(model.nbody) if not is_added(model.body(i).name)]


def apply_errors(parts: Parts, errors: SmallErrors) -> None:
    """Edit a compiled model, that of `parts`, by a robot's errors; trims are part of the commands."""
    model = parts.model
    if errors.friction:
        _scale_friction(parts, np.array(errors.friction))
    for servo, factor in enumerate(errors.servo_strength):
        model.actuator_forcerange[servo] *= factor
    for name, values in (("servo_gain", errors.servo_gain), ("servo_damping", errors.servo_damping)):
        for channel, factor in zip(parts.channels, values, strict=bool(values)):
            edit = EFFECTS[name].model
            if edit is not None:
                edit(replace(parts, target=channel), factor, 1.0)
    if errors.mass:
        bodies = own_bodies(model)
        model.body_mass[bodies] *= errors.mass
        model.body_inertia[bodies] *= np.array(errors.mass)[:, None]
        mujoco.mj_setConst(model, mujoco.MjData(model))
    if errors.hinge_stiffness:
        model.jnt_stiffness[parts.hinges] *= errors.hinge_stiffness
        model.jnt_stiffnesspoly[parts.hinges] *= np.array(errors.hinge_stiffness)[:, None]
    if any(errors.slope_rad):
        _tilt_gravity(parts, *errors.slope_rad)


def _scale_friction(parts: Parts, factors: NDArray[np.float64]) -> None:
    """Scale the friction of each geom, and of pairs by the mean factor of the pair's geoms."""
    model, touching = parts.model, touching_geoms(parts)
    of_geom = dict(zip(touching, factors.tolist(), strict=True))
    model.geom_friction[touching] *= factors[:, None]
    for pair, geoms in enumerate(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)):
        found = [of_geom[geom] for geom in geoms if geom in of_geom]
        if found:
            model.pair_friction[pair] *= sum(found) / len(found)


def _tilt_gravity(parts: Parts, forward: float, left: float) -> None:
    """Turn gravity so that forward and left are uphill by these angles, rad."""
    ahead, aside, _ = parts.axes
    for axis, angle in ((aside, forward), (-ahead, left)):
        turn, gravity = np.empty(4), np.array(parts.model.opt.gravity)
        mujoco.mju_axisAngle2Quat(turn, axis, angle)
        mujoco.mju_rotVecQuat(parts.model.opt.gravity, gravity, turn)


def draw_measurement(tolerances: Tolerances, rng: np.random.Generator) -> tuple[ActiveEffect, ...]:
    """Return the errors of one camera and its clock as effects, each drawn uniformly by its tolerance."""
    sizes = _of_measurement(tolerances)
    drawn = rng.uniform(-WIDEST, WIDEST, len(sizes)).tolist()
    pairs = zip(sizes.items(), drawn, strict=True)
    middles = {"camera_scale": 1.0, "clock_rate": 1.0}
    return tuple(ActiveEffect(EFFECTS[n], middles.get(n, 0.0) + size * unit) for (n, size), unit in pairs)


def _of_measurement(tolerances: Tolerances) -> dict[str, float]:
    """Return the standard deviation of each effect's parameter that a camera or its clock has."""
    return {
        "camera_scale": tolerances.camera_scale,
        "camera_tilt": math.radians(tolerances.camera_tilt_deg),
        "clock_offset": tolerances.clock_offset_s,
        "clock_rate": tolerances.clock_rate,
    }
