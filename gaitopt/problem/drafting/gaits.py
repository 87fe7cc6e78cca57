"""First gaits by family: trot, walk and bound on four legs, a tripod on six, waves along a body."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.gait.gait import EDGE_TOLERANCE, Channel, Gait
from gaitopt.problem.drafting.family import Limb, limbs_of, rows_of
from gaitopt.problem.drafting.standing import Standing
from gaitopt.problem.robot import Robot
from gaitopt.robot.tree import driven_joints, trunk

Array = NDArray[np.float64]

_SWING_DEG = 30.0
_LIFT_DEG = 25.0
_WAVE_DEG = 50.0
"""Travel of a servo that swings a leg, that lifts one, and that bends a body: usual for small robots."""

_TRIALS = ((1.0, 1.0), (0.7, 1.0), (0.7, 1.5), (0.5, 1.5), (0.5, 2.0), (0.35, 2.0))
"""Shares of the usual travel, and multiples of the usual period: a first gait has the first with which the
robot stays on its feet."""

_MOST_FLIGHT = 0.35
"""Largest share of time without contact in a first gait."""

_TRIAL_S = 4.0
_TIPPED_RAD = 0.8
"""Time for which a first gait is tried, s, and the tilt at which a robot that walks is about to fall, rad; at
rest it may be more, see `standing.FALLEN_RAD`."""

_LONGEST_S = 4.0
"""Longest period of a first gait, s: that of the drafted search."""

_MOVES_M = 1e-3
"""A servo that moves the foot by less than this for 1 rad does not move it, m."""

_STEP = 5.0
"""Periods of a trot in units of the pendulum time sqrt(h / g) of a robot h high: 0.5 s for 0.1 m."""

_WAVES = 1.0
"""Waves along a body that undulates: eels and swimming snakes have about one."""


@dataclass(frozen=True)
class Wave:
    """One servo's wave in a first gait; see `gait.Channel`."""

    duty: float
    phase: float
    amplitude_deg: float
    offset_deg: float
    smoothing: float


@dataclass(frozen=True)
class FirstGait:
    """A first gait: what it is, its period and the wave of each servo, by name."""

    name: str
    meaning: str
    period_s: float
    waves: Mapping[str, Wave]


@dataclass(frozen=True)
class Travel:
    """What a servo may do: name, ends of its range and its start target, degrees; the sign of amplitudes."""

    name: str
    low: float
    high: float
    rest: float
    sign: float


@dataclass(frozen=True)
class _Leg:
    """A leg, and how its foot moves.

    Attributes:
        ahead: by servo, how far it moves the foot forward for 1 rad, m.
        up: by servo, how high it lifts the foot when it turns by `_LIFT_DEG` the better way, m.
        ways: by servo, the sign of that way.
        place: of the foot, forward and to the left of the trunk, m.
    """

    ahead: Mapping[int, float]
    up: Mapping[int, float]
    ways: Mapping[int, float]
    place: tuple[float, float]

    @property
    def swing(self) -> int | None:
        """The servo that moves the foot most forward and back."""
        able = [servo for servo in self.ahead if abs(self.ahead[servo]) > _MOVES_M]
        return max(able, key=lambda servo: abs(self.ahead[servo]), default=None)

    @property
    def lift(self) -> int | None:
        """The servo, another one, that lifts the foot highest."""
        able = [servo for servo in self.up if servo != self.swing and self.up[servo] > 0.1 * _MOVES_M]
        return max(able, key=lambda servo: self.up[servo], default=None)


def first_gaits(
    family: str,
    model: mujoco.MjModel,
    standing: Standing,
    pads: Sequence[int],
    axes: Array,
    travels: Sequence[Travel],
) -> list[FirstGait]:
    """Return the first gaits of a robot, the most promising first.

    Args:
        family: one of `family.FAMILIES`.
        model: the robot.
        standing: how it stands.
        pads: geoms that grip.
        axes: forward, left and up as rows.
        travels: what each servo may do, in the model's order.
    """
    if family in ("snake", "swimmer"):
        return [_undulation(model, standing, axes, travels)]
    legs = [_leg(model, standing, limb, axes) for limb in limbs_of(model, pads)]
    period = max(_period(model, standing, axes), _slowest(model, _SWING_DEG))
    gaits = []
    for order in _orders(family, legs):
        for reach, slower in _TRIALS:
            waves = _stepping(legs, order, travels, reach)
            seconds = max(round(min(_LONGEST_S, slower * order.periods * period), 3), _followed(model, waves))
            if _stays_up(model, standing, waves, seconds):
                break
        gaits.append(FirstGait(order.name, order.meaning, seconds, waves))
    return gaits or [_in_turn(model, travels)]


@dataclass(frozen=True)
class _Order:
    """In which order legs step.

    Attributes:
        name, meaning: what it is called, and is.
        periods: its period, in periods of a trot.
        phases: phase of each leg, cycles.
        lifted: share of the cycle in which a leg is lifted.
    """

    name: str
    meaning: str
    periods: float
    phases: Sequence[float]
    lifted: float = 0.5


def _orders(family: str, legs: Sequence[_Leg]) -> list[_Order]:
    """Return the orders in which the legs of a family step; none where legs are not where they should be."""
    places = rows_of([leg.place for leg in legs], {"quadruped": 2, "hexapod": 3}.get(family, 0))
    if not places:
        return []
    across = [0.5 * ((row + side) % 2) for side, row in places]
    if family == "hexapod":
        ripple = [(row / 3.0 + 0.5 * side) % 1.0 for side, row in places]
        return [
            _Order("tripod", "three legs and three legs in turn", 1.0, across),
            _Order("ripple", "one leg after another on each side", 2.0, ripple, 0.3),
        ]
    walk = {(True, 1): 0.0, (True, 0): 0.75, (False, 1): 0.5, (False, 0): 0.25}
    return [
        _Order("trot", "diagonal legs together", 1.0, across, 0.4),
        _Order("walk", "one leg after another", 2.0, [walk[place] for place in places], 0.25),
        _Order("bound", "front legs together, hind legs together", 1.0, [0.5 * row for _, row in places]),
    ]


def _leg(model: mujoco.MjModel, standing: Standing, limb: Limb, axes: Array) -> _Leg:
    """Return how the servos of a limb move its foot, from the pose at rest.

    The foot's height is that after a whole turn by `_LIFT_DEG`: a straight leg has no slope.
    """
    data, foot = standing.rested, limb.feet[0]
    at, jacobian = np.array(data.geom_xpos[foot]), np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, jacobian, None, at, int(model.geom_bodyid[foot]))
    ahead, up, ways = {}, {}, {}
    for servo in limb.servos:
        shares = driven_joints(model, servo)
        turned = sum(share**2 for share in shares.values())
        velocity = np.zeros(model.nv)
        for joint, share in shares.items():
            velocity[model.jnt_dofadr[joint]] = share / turned
        ahead[servo] = float(axes[0] @ jacobian @ velocity)
        raised = {}
        for way in (1.0, -1.0):
            moved = mujoco.MjData(model)
            moved.qpos[:] = data.qpos
            mujoco.mj_integratePos(model, moved.qpos, velocity, way * math.radians(_LIFT_DEG))
            mujoco.mj_kinematics(model, moved)
            raised[way] = float(axes[2] @ (moved.geom_xpos[foot] - at))
        ways[servo] = max(raised, key=lambda way: raised[way])
        up[servo] = raised[ways[servo]]
    offset = at - data.xpos[trunk(model)]
    return _Leg(ahead, up, ways, (float(axes[0] @ offset), float(axes[1] @ offset)))


def _stepping(
    legs: Sequence[_Leg], order: _Order, travels: Sequence[Travel], reach: float
) -> dict[str, Wave]:
    """Return the waves of legs that swing forward while they are lifted; other servos hold still.

    Args:
        legs: the legs.
        order: in which order they step.
        travels: what each servo may do.
        reach: travel as a share of the usual one.
    """
    waves = {travel.name: _still(travel) for travel in travels}
    for leg, phase in zip(legs, order.phases, strict=True):
        swing, lift = leg.swing, leg.lift
        if swing is not None:
            width = math.copysign(reach * _SWING_DEG, leg.ahead[swing])
            waves[travels[swing].name] = _swung(travels[swing], width, phase)
        if lift is not None:
            width = leg.ways[lift] * reach * _LIFT_DEG
            begin = phase + 0.5 * order.lifted
            waves[travels[lift].name] = _raised(travels[lift], width, begin, order.lifted)
    return waves


def _stays_up(model: mujoco.MjModel, standing: Standing, waves: Mapping[str, Wave], period: float) -> bool:
    """Return whether the trunk never tilts far, nor the robot hops, while a gait is played from rest."""
    model = copy.copy(model)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    data = copy.copy(standing.rested)
    channels = [Channel(**asdict(wave)) for wave in waves.values()]
    step, body = float(model.opt.timestep), trunk(model)
    drawn = standing.drawn.xmat[body].reshape(3, 3).T @ -model.opt.gravity
    least = math.cos(_TIPPED_RAD) * float(np.linalg.norm(model.opt.gravity)) ** 2
    cycles = np.arange(0.0, _TRIAL_S, step) / period
    targets = np.stack([channel.targets(cycles, EDGE_TOLERANCE) for channel in channels], axis=-1)
    flights = 0
    for row in targets:
        data.ctrl[:] = row
        mujoco.mj_step(model, data)
        flights += data.ncon == 0
        if data.warning.number.any() or data.xmat[body].reshape(3, 3) @ drawn @ -model.opt.gravity < least:
            return False
    return flights <= _MOST_FLIGHT * len(targets)


def _still(travel: Travel) -> Wave:
    return Wave(0.5, 0.0, 0.0, round(travel.rest, 3), 1.0)


def _swung(travel: Travel, amplitude: float, phase: float) -> Wave:
    """Return a sine wave about the start target; it rises fastest at minus its phase."""
    width = min(abs(amplitude), travel.high - travel.low)
    low = min(max(travel.rest - 0.5 * width, travel.low), travel.high - width)
    begin, end = (low, low + width) if amplitude > 0.0 else (low + width, low)
    return _signed(travel, 0.5, phase, end - begin, begin)


def _raised(travel: Travel, amplitude: float, phase: float, duty: float) -> Wave:
    """Return a wave from the start target and back, inside the range; it is up around duty/2 - phase."""
    width = min(abs(amplitude), travel.high - travel.low)
    end = min(max(travel.rest + math.copysign(width, amplitude), travel.low), travel.high)
    begin = end - math.copysign(width, amplitude)
    return _signed(travel, duty, phase, end - begin, begin)


def _signed(travel: Travel, duty: float, phase: float, amplitude: float, offset: float) -> Wave:
    """Return a wave with an amplitude of the sign that a search of this servo uses."""
    if amplitude * travel.sign < 0.0:
        offset, amplitude, phase, duty = offset + amplitude, -amplitude, phase - duty, 1.0 - duty
    return Wave(round(duty, 3), round(phase % 1.0, 4) % 1.0, round(amplitude, 3), round(offset, 3), 1.0)


def _undulation(
    model: mujoco.MjModel, standing: Standing, axes: Array, travels: Sequence[Travel]
) -> FirstGait:
    """Return a wave that runs from the front of a body to its rear, and drives it forward."""
    order = from_front(model, standing, axes)
    waves = {
        travel.name: _swung(travel, travel.sign * _WAVE_DEG, -_WAVES * order.index(servo) / (model.nu + 1))
        for servo, travel in enumerate(travels)
    }
    period = max(1.0, round(min(_LONGEST_S, _slowest(model, _WAVE_DEG)), 3), _followed(model, waves))
    return FirstGait("undulation", "a wave from front to rear", period, waves)


def from_front(model: mujoco.MjModel, standing: Standing, axes: Array) -> list[int]:
    """Return the servos by how far forward their joints are, the foremost first; see `first_gaits`."""

    def ahead(servo: int) -> float:
        joints = list(driven_joints(model, servo))
        return float((standing.drawn.xanchor[joints] @ axes[0]).mean()) if joints else 0.0

    return sorted(range(model.nu), key=ahead, reverse=True)


def _in_turn(model: mujoco.MjModel, travels: Sequence[Travel]) -> FirstGait:
    """Return every servo through half its range, one after another."""
    count, waves = len(travels), {}
    for index, travel in enumerate(travels):
        reach = travel.sign * (travel.high - travel.low)
        low = travel.low if reach > 0.0 else travel.high
        phase = 0.25 * index if count == 2 else round(index / count, 4)
        waves[travel.name] = Wave(0.5, phase, round(0.5 * reach, 3), round(low + 0.25 * reach, 3), 0.5)
    period = max(1.0, _followed(model, waves))
    return FirstGait("first-guess", "every servo through half its range, one after another", period, waves)


def _followed(model: mujoco.MjModel, waves: Mapping[str, Wave]) -> float:
    """Return the period at which each servo keeps to its speed without load, s, or the longest one."""
    gait = Gait(1.0, {name: Channel(**asdict(wave)) for name, wave in waves.items()})
    shares = gait.peak_command_speed() / Robot.of(model).no_load_speed
    return min(_LONGEST_S, math.ceil(1e3 * float(shares.max(initial=0.0))) / 1e3)


def _period(model: mujoco.MjModel, standing: Standing, axes: Array) -> float:
    """Return the period of a trot, s."""
    gravity = float(np.linalg.norm(model.opt.gravity)) or 9.81
    low = min((_bottom(model, standing.rested, geom, axes[2]) for geom in standing.touching), default=0.0)
    height = max(0.01, float(axes[2] @ standing.rested.xpos[trunk(model)]) - low)
    return round(max(0.25, _STEP * math.sqrt(height / gravity)), 3)


def _bottom(model: mujoco.MjModel, data: mujoco.MjData, geom: int, up: Array) -> float:
    """Return the height of the lowest corner of a geom's box, m."""
    middle, half = np.split(np.array(model.geom_aabb[geom]), 2)
    turn = data.geom_xmat[geom].reshape(3, 3)
    return float(up @ (data.geom_xpos[geom] + turn @ middle)) - float(np.abs(up @ turn) @ half)


def _slowest(model: mujoco.MjModel, travel_deg: float) -> float:
    """Return the period at which half the torque of the weakest servo moves its load through a sine, s."""
    slowest = 0.0
    for actuator in range(model.nu):
        limit = float(model.actuator_forcerange[actuator, 1])
        if not model.actuator_forcelimited[actuator] or limit <= 0.0:
            continue
        for joint, share in driven_joints(model, actuator).items():
            inertia = float(model.dof_M0[model.jnt_dofadr[joint]]) / share**2
            swing = 0.5 * math.radians(travel_deg)
            slowest = max(slowest, 2.0 * math.pi * math.sqrt(swing * inertia / (0.5 * limit)))
    return slowest
