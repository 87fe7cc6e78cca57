"""First gaits by family: trot, walk and bound on four legs, a tripod on six, waves along a body."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.gait.gait import Channel, Gait
from gaitopt.problem.drafting.family import Limb, limbs_of, rows_of
from gaitopt.problem.drafting.standing import Standing
from gaitopt.problem.drafting.trials import Trial, Wave, play
from gaitopt.problem.robot import Robot
from gaitopt.robot.tree import driven_joints, trunk

Array = NDArray[np.float64]

_SWING_DEG = 30.0
_LIFT_DEG = 25.0
_BENDS_DEG = (50.0, 100.0)
"""Travel of a servo that swings a leg, that lifts one, and that bends a body, with many joints and with few:
usual for small robots."""

_TRIALS = ((1.0, 1.0), (0.7, 1.0), (0.7, 1.5), (0.5, 1.5), (0.5, 2.0), (0.35, 2.0))
"""Shares of the usual travel, and multiples of the usual period: a first gait has the first with which the
robot stays on its feet and goes forward, or else the first with which it stays on its feet."""

_PACES = (1.0, 0.6, 1.7)
"""Multiples of the usual period of a wave along a body. Of all paces and travels the fastest is taken."""

_SHORTEST_S = 0.25

_LONGEST_S = 4.0
"""Shortest and longest period of a first gait, s: those of the drafted search."""

_MOVES_M = 1e-3
"""A servo that moves the foot by less than this for 1 rad does not move it, m."""

_STEP = 5.0
"""Periods of a trot in units of the pendulum time sqrt(h / g) of a robot h high: 0.5 s for 0.1 m."""

_WAVES = 1.0
"""Waves along a body that undulates: eels and swimming snakes have about one."""


@dataclass(frozen=True)
class FirstGait:
    """A first gait: what it is, its period and the wave of each servo, by name."""

    name: str
    meaning: str
    period_s: float
    waves: Mapping[str, Wave]


Try = Callable[[FirstGait], Trial]
"""Plays a gait, and returns how it went."""


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

    def tried(gait: FirstGait) -> Trial:
        return play(model, standing, gait.waves, gait.period_s, axes)

    if family in ("snake", "swimmer"):
        return [_undulation(model, from_front(model, standing, axes), travels, tried)]
    legs = [_leg(model, standing, limb, axes) for limb in limbs_of(model, pads)]
    period = max(_period(model, standing, axes), _slowest(model, _SWING_DEG))
    gaits = [
        _first_that_goes(_ever_milder(order, legs, model, travels, period), tried)
        for order in _orders(family, legs)
    ]
    return gaits or [_fastest(_in_turn(model, travels), tried)[0]]


def _first_that_goes(gaits: Iterable[FirstGait], tried: Try) -> FirstGait:
    """Return the first gait that keeps the robot on its feet and goes forward.

    Without one it is the first that keeps it on its feet, or the last.
    """
    upright: list[FirstGait] = []
    for gait in gaits:
        trial = tried(gait)
        if trial.upright and trial.ahead_m_s > 0.0:
            return gait
        upright += [gait] * trial.upright
    return (upright or [gait])[0]


def _fastest(gaits: Sequence[FirstGait], tried: Try) -> tuple[FirstGait, Trial]:
    """Return the gait that goes forward fastest, of those that stay on the ground, and how it went."""
    return max(((gait, tried(gait)) for gait in gaits), key=_speed)


def _speed(went: tuple[FirstGait, Trial]) -> tuple[bool, float]:
    return went[1].ran, went[1].ahead_m_s


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


def _ever_milder(
    order: _Order, legs: Sequence[_Leg], model: mujoco.MjModel, travels: Sequence[Travel], period: float
) -> Iterator[FirstGait]:
    """Yield the gait of each of `_TRIALS`; `period` is that of a trot, s."""
    for reach, slower in _TRIALS:
        waves = _stepping(legs, order, travels, reach)
        seconds = max(round(min(_LONGEST_S, slower * order.periods * period), 3), _followed(model, waves))
        yield FirstGait(order.name, order.meaning, seconds, waves)


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
    model: mujoco.MjModel, order: Sequence[int], travels: Sequence[Travel], tried: Try
) -> FirstGait:
    """Return a wave along a body: the way in which it drives it forward, then the fastest pace and travel.

    Args:
        model: the robot.
        order: its servos, the foremost first.
        travels: what each servo may do.
        tried: plays a gait.
    """

    def wave(rearward: bool, bend: float, pace: float) -> FirstGait:
        way = -1.0 if rearward else 1.0
        waves = {
            travel.name: _swung(
                travel, travel.sign * bend, way * _WAVES * order.index(servo) / (model.nu + 1)
            )
            for servo, travel in enumerate(travels)
        }
        usual = min(max(1.0, _slowest(model, bend)), _LONGEST_S)
        period = max(round(min(max(pace * usual, _SHORTEST_S), _LONGEST_S), 3), _followed(model, waves))
        meaning = "a wave from front to rear" if rearward else "a wave from rear to front"
        return FirstGait("undulation", meaning, period, waves)

    ways = [wave(rearward, _BENDS_DEG[0], _PACES[0]) for rearward in (True, False)]
    better = _fastest(ways, tried)
    rearward = better[0] is ways[0]
    others = [wave(rearward, bend, pace) for bend, pace in itertools.product(_BENDS_DEG, _PACES)]
    return max(better, _fastest(others[1:], tried), key=_speed)[0]


def from_front(model: mujoco.MjModel, standing: Standing, axes: Array) -> list[int]:
    """Return the servos by how far forward their joints are, the foremost first; see `first_gaits`."""

    def ahead(servo: int) -> float:
        joints = list(driven_joints(model, servo))
        return float((standing.drawn.xanchor[joints] @ axes[0]).mean()) if joints else 0.0

    return sorted(range(model.nu), key=ahead, reverse=True)


def _in_turn(model: mujoco.MjModel, travels: Sequence[Travel]) -> list[FirstGait]:
    """Return every servo through half its range, one after another, in either order."""
    count, gaits = len(travels), []
    for way in (1.0, -1.0):
        waves = {}
        for index, travel in enumerate(travels):
            reach = travel.sign * (travel.high - travel.low)
            low = travel.low if reach > 0.0 else travel.high
            phase = way * (0.25 * index if count == 2 else index / count)
            waves[travel.name] = Wave(
                0.5, round(phase, 4) % 1.0, round(0.5 * reach, 3), round(low + 0.25 * reach, 3), 0.5
            )
        followed = _followed(model, waves)
        for period in dict.fromkeys(max(usual, followed) for usual in (1.0, 2.0)):
            meaning = "every servo through half its range, one after another"
            gaits.append(FirstGait("first-guess", meaning, period, waves))
    return gaits


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
