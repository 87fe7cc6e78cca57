"""Servos: what a hobby servo does that a nominal position actuator does not.

A nominal servo is a MuJoCo position actuator: torque kp (ctrl - q) [N m], clipped to its `forcerange`,
on a joint whose `damping` is the slope of the motor's torque-speed line and whose `armature` is the
rotor's inertia behind its gear.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import accumulate

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.effect import (
    LOOP_INTERVAL_S,
    Effect,
    Parts,
    Prior,
    Update,
    added_name,
    owner_of,
)
from gaitopt.gait.drive import Commands
from gaitopt.robot.trajectory import Trajectory

_LINK_SHARE = 0.05
"""Share of a servo's inertia and damping on the link's side of its free play: horn and output shaft."""

_LEAST_INERTIA = 0.05
"""Inertia of a rotor without armature, in inertias of its link: without any, it could not be moved."""

_STOP_S = 2e-3
"""Time constant of the stop at the end of the free play; the shortest that a step of 1 ms can integrate."""

_HARD = (0.9999, 0.9999, 1e-3, 0.5, 2.0)
"""Impedance of that stop: a full 0.25 N m presses into it by less than 1e-4 rad."""


def _servo_missing(parts: Parts) -> str | None:
    if not parts.servo_joints or min(parts.servo_joints) < 0:
        return "an actuator does not turn a joint"
    return None


def _torque_limits(parts: Parts) -> NDArray[np.float64]:
    """Return the torque limit of each target servo, N m; inf where there is none."""
    model, servos = parts.model, parts.servos
    limited = model.actuator_forcelimited[servos].astype(bool)
    return np.where(limited, model.actuator_forcerange[servos, 1], math.inf)


def torque_limit(parts: Parts) -> float:
    """Return the largest torque limit of the target servos, N m; inf without one."""
    return float(_torque_limits(parts).max(initial=0.0))


def torque_scale(parts: Parts) -> float:
    """Return the torque limit, or where there is none the torque at an error of 5 degrees, N m."""
    limit = torque_limit(parts)
    if math.isfinite(limit):
        return limit
    return float(parts.model.actuator_gainprm[parts.servos, 0].max()) * math.radians(5.0)


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
        "datasheets of 9 g servos: 1.2 to 2.5 kgf cm at 4.8 V; copies, a sagging supply and heat take more",
    ),
    reference=torque_scale,
    reference_name="the nominal limit",
    allowed=(0.0, math.inf),
    target="any",
    missing=_servo_missing,
    model=_limit_torque,
)


def _limit_speed(sent: Commands, limit: float, parts: Parts) -> Commands:
    """Let the angle that the servo follows slew no faster than `limit` from the angle held before."""
    step_s, servos = parts.step_s, parts.servos
    most = limit * step_s

    def followed(time: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = sent(time).copy()
        before = sent(time[:1] - step_s)[0]
        for i in servos:
            rows[:, i] = _slewed(before[i], rows[:, i].tolist(), most)
        return rows

    return followed


def _slewed(before: float, angles: Iterable[float], most: float) -> list[float]:
    def follow(at: float, asked: float) -> float:
        return min(max(asked, at - most), at + most)

    return list(accumulate(angles, follow, initial=before))[1:]


SERVO_SPEED_LIMIT = Effect(
    name="servo_speed_limit",
    summary="the commanded angle is followed no faster than this",
    parameter="limit_rad_s",
    unit="rad/s",
    neutral=math.inf,
    low=1.0,
    high=40.0,
    scale="log",
    prior=Prior(
        "log-normal",
        8.0,
        0.6,
        "datasheets of 9 g servos: 0.08 to 0.12 s per 60 degrees unloaded at 4.8 V, so 9 to 13 rad/s; less "
        "under load",
    ),
    allowed=(0.0, math.inf),
    target="any",
    commands=_limit_speed,
)


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


def _no_damping(parts: Parts) -> str | None:
    if not parts.model.dof_damping[parts.servo_dofs].any():
        return "the driven joints have no damping to scale"
    return _servo_missing(parts)


def _scale_damping(parts: Parts, scale: float, _: float) -> None:
    parts.model.dof_damping[parts.servo_dofs] *= scale
    parts.model.dof_dampingpoly[parts.servo_dofs] *= scale


SERVO_DAMPING = Effect(
    name="servo_damping",
    summary="damping of the driven joint",
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
    missing=_no_damping,
    model=_scale_damping,
)


def _armature(parts: Parts) -> float:
    return float(parts.model.dof_armature[parts.servo_dofs].max(initial=0.0))


def _armature_scale(parts: Parts) -> float:
    """Return the nominal armature, or where there is none the inertia that the servo turns, kg m^2."""
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
    missing=_servo_missing,
    model=_set_armature,
)


# --- free play ----------------------------------------------------------------------------------


def _add_rotor(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    """Put the servo on a joint of its own, which carries the link between two stops.

    The rotor turns about an axis fixed in the world: all its inertia is armature, which acts along its
    own coordinate and nowhere else. The link's joint keeps its name, limits, springs and couplings.
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
    missing=_servo_missing,
    structure=_add_rotor,
    model=_set_play,
)


# --- dead band ----------------------------------------------------------------------------------


def _add_opposition(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    """Add to each servo an actuator that takes back what it does while its error is small.

    kp clip(e, -d, d) subtracted from kp e leaves kp (e - d) outside the band and nothing inside. The
    servo's torque is then the joint's.
    """
    for index in nominal.servos:
        servo = spec.actuators[index]
        spec.add_actuator(
            name=added_name("dead_band", servo.name),
            trntype=servo.trntype,
            target=servo.target,
            gear=servo.gear,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            forcelimited=mujoco.mjtLimited.mjLIMITED_TRUE,
            forcerange=[-1.0, 1.0],
        )
        for sensor in spec.sensors:
            if sensor.type == mujoco.mjtSensor.mjSENS_ACTUATORFRC and sensor.objname == servo.name:
                sensor.type = mujoco.mjtSensor.mjSENS_JOINTACTFRC
                sensor.objtype = mujoco.mjtObj.mjOBJ_JOINT
                sensor.objname = servo.target


def _oppose(parts: Parts, half_width: float, _: float) -> None:
    model = parts.model
    for servo in parts.servos:
        opposed = model.actuator(added_name("dead_band", model.actuator(servo).name)).id
        gain, bias = model.actuator_gainprm[servo, 0], model.actuator_biasprm[servo]
        model.actuator_gainprm[opposed, 0] = -gain
        model.actuator_biasprm[opposed, :2] = -bias[:2]
        band = gain * half_width
        model.actuator_forcerange[opposed] = -band, band
        if model.actuator_forcelimited[servo]:
            model.actuator_forcerange[servo] += (-band, band)


SERVO_DEADBAND = Effect(
    name="servo_deadband",
    summary="no torque while the error is smaller than this; beyond it, torque grows from zero",
    parameter="half_width_rad",
    unit="rad",
    neutral=0.0,
    low=0.0,
    high=0.1,
    scale="lin",
    prior=Prior(
        "half-normal",
        0.0,
        0.015,
        "datasheets of 9 g servos: a dead band of 4 to 10 us of pulse, where 2000 us are 180 degrees",
    ),
    allowed=(0.0, 1.0),
    target="any",
    missing=_servo_missing,
    structure=_add_opposition,
    model=_oppose,
)


def net_torque_limits(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Return each actuator's upper torque limit less what a dead band takes back of it, N m, shape (nu,)."""
    limits = np.array(model.actuator_forcerange[:, 1])
    for i in range(model.nu):
        name = model.actuator(i).name
        if name == added_name("dead_band", owner_of(name)):
            limits[model.actuator(owner_of(name)).id] -= limits[i]
    return limits


# --- commanded angle ----------------------------------------------------------------------------


def _scale_travel(sent: Commands, gain: float, parts: Parts) -> Commands:
    def turned(time: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = sent(time).copy()
        rows[:, parts.servos] *= gain
        return rows

    return turned


SERVO_TRAVEL = Effect(
    name="servo_travel",
    summary="gain of the commanded angle, about the servo's zero",
    parameter="gain",
    unit="",
    neutral=1.0,
    low=0.7,
    high=1.3,
    scale="lin",
    prior=Prior(
        "normal",
        1.0,
        0.07,
        "pulse widths at the ends of travel of uncalibrated micro servos differ by 5 to 10 %",
    ),
    target="any",
    commands=_scale_travel,
)


def _offset(sent: Commands, offset: float, parts: Parts) -> Commands:
    def turned(time: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = sent(time).copy()
        rows[:, parts.servos] += offset
        return rows

    return turned


SERVO_TRIM = Effect(
    name="servo_trim",
    summary="zero offset of the commanded angle",
    parameter="offset_rad",
    unit="rad",
    neutral=0.0,
    low=-0.26,
    high=0.26,
    scale="lin",
    prior=Prior(
        "normal", 0.0, 0.07, "a horn goes on in steps of 360/21 = 17 degrees, so at worst 8.6 degrees off"
    ),
    target="any",
    commands=_offset,
)


# --- supply -------------------------------------------------------------------------------------

_SUPPLY_S = 0.01
"""Time constant with which the limits follow the torques: assumed, half a servo's frame; without one the
limits chatter."""


def _no_limit(parts: Parts) -> str | None:
    if not math.isfinite(torque_limit(parts)):
        return "a servo has no torque limit to fall"
    return _servo_missing(parts)


def _sense_torques(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    for index in range(len(nominal.channels)):
        actuator = spec.actuators[index]
        spec.add_sensor(
            name=added_name("torque", actuator.name),
            type=mujoco.mjtSensor.mjSENS_ACTUATORFRC,
            objtype=mujoco.mjtObj.mjOBJ_ACTUATOR,
            objname=actuator.name,
        )


def _sag(parts: Parts, share: float) -> Update:
    """Return what sets each limit to L (1 - share drawn), where drawn is sum|torque| / sum L, smoothed."""
    model, servos = parts.model, parts.servos
    names = [added_name("torque", model.actuator(i).name) for i in range(len(parts.channels))]
    addresses = [int(model.sensor(name).adr[0]) for name in names]
    ranges = model.actuator_forcerange[servos].copy()
    limits = net_torque_limits(model)[: len(names)]
    lost = share * limits[servos, None] * (-1.0, 1.0)
    available, drawn = float(limits.sum()), 0.0

    def update(sensed: NDArray[np.float64]) -> None:
        nonlocal drawn
        now = min(1.0, sum(map(abs, sensed[addresses].tolist())) / available)
        drawn += LOOP_INTERVAL_S / _SUPPLY_S * (now - drawn)
        model.actuator_forcerange[servos] = ranges - drawn * lost

    return update


SERVO_SAG = Effect(
    name="servo_sag",
    summary="shared supply: the torque available falls by this share when all servos draw all of theirs",
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
        "0.6 to 1.2 V of 5 V, and stall torque goes with voltage",
    ),
    allowed=(0.0, 1.0),
    target="any",
    missing=_no_limit,
    structure=_sense_torques,
    loop=_sag,
)


# --- timing -------------------------------------------------------------------------------------


def _in_steps(delay: float, step_s: float) -> tuple[int, float]:
    """Return the whole steps of the clock in a delay, and what is left of a step as its share."""
    whole = math.floor(delay / step_s + 1e-6)
    rest = delay / step_s - whole
    return whole, rest if rest > 1e-6 else 0.0


def _delay_all(sent: Commands, delay: float, parts: Parts) -> Commands:
    """Return the commands late by the whole steps of the clock in `delay`; `_see_late` has the rest."""
    whole, _ = _in_steps(delay, parts.step_s)
    return lambda time: sent(time - whole * parts.step_s)


def _see_late(trajectory: Trajectory, delay: float, parts: Parts, __: np.random.Generator) -> Trajectory:
    """Return the trajectory late by what `_delay_all` leaves of a delay.

    A robot at rest, all of whose commands come later, does the same later. What is sent is held
    for a step, and stays in it.
    """
    _, rest = _in_steps(delay, parts.step_s)
    return replace(trajectory, time=trajectory.time + rest * parts.step_s) if rest else trajectory


COMMAND_LATENCY = Effect(
    name="command_latency",
    summary="all commands late",
    parameter="delay_s",
    unit="s",
    neutral=0.0,
    low=0.0,
    high=0.2,
    scale="lin",
    prior=Prior(
        "half-normal", 0.0, 0.04, "a 20 ms servo frame, a frame in the servo, and tens of ms in a script"
    ),
    allowed=(0.0, 10.0),
    needs_known_start=True,
    commands=_delay_all,
    observe=_see_late,
)


def _saturation(parts: Parts) -> NDArray[np.float64]:
    """Return the error of angle at which each target servo reaches its torque limit, rad; inf without one."""
    gains: NDArray[np.float64] = parts.model.actuator_gainprm[parts.servos, 0]
    return _torque_limits(parts) / gains


def _delay_one(sent: Commands, delay: float, parts: Parts) -> Commands:
    """Return the commands, those of the target `delay` s late; where one changes within a step, in part.

    A command that changes within a step should act for the rest of that step. So the servo gets that part
    of the change, of as much of it as it answers to: more than saturates it would act like all of it, and
    delays would go in whole steps. Exact where the servo has come to rest under the command before; where
    it has not, a jump is up to a step off.
    """
    step_s, servos, most = parts.step_s, parts.servos, _saturation(parts)
    whole, rest = _in_steps(delay, step_s)

    def late(time: NDArray[np.float64]) -> NDArray[np.float64]:
        shifted = sent(time - whole * step_s)[:, servos]
        if rest:
            before = sent(time - (whole + 1) * step_s)[:, servos]
            shifted = before + (1.0 - rest) * np.clip(shifted - before, -most, most)
        rows = sent(time).copy()
        rows[:, servos] = shifted
        return rows

    return late


CHANNEL_TIMING = Effect(
    name="channel_timing",
    summary="one servo's command late (positive) or early",
    parameter="delay_s",
    unit="s",
    neutral=0.0,
    low=-0.15,
    high=0.15,
    scale="lin",
    prior=Prior(
        "normal", 0.0, 0.04, "commands written one after another in MicroPython, with sleeps between"
    ),
    allowed=(-10.0, 10.0),
    target="one",
    commands=_delay_one,
)
