"""A servo on a bench by numerics of its own: an arm against gravity, without MuJoCo and without effects.

Everything here is written from the physics, so that a diagnosis has to find it with another simulator:

- a command is quantised, scaled and shifted by the servo, arrives late, is slewed and filtered;
- torque kp e - kv v inside the clamp, with a dead band in e; minus a loss per speed outside it while powered;
- dry friction (Coulomb's, a share of the servo's torque, and an excess near standstill) by the maximum
  dissipation of Moreau's time stepping: the arm sticks exactly, and no speed is smoothed;
- free play as two bodies with a plastic impact at either stop.

Time steps are trapezoids (of second order between two events) of 0.1 ms. Recordings run side by side as
the columns of arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP_S = 1e-4
"""Time step, s."""

SETTLE_S = 1.5
"""How long a servo holds its first angle before a recording, s."""

ROW_S = 0.02
"""Time between two rows of a log, s."""

COUNT_RAD = 0.0015
"""Angle of an encoder's count, rad."""


@dataclass(frozen=True)
class Servo:
    """A servo and its arm, in SI units and rad. The defaults are the nominal servo of the bench.

    Attributes:
        gain: torque per error, N m/rad.
        damping: torque per speed inside the clamp, N m s/rad.
        limit: the clamp, N m.
        lag_s: time constant of the angle that is followed.
        friction: dry friction, N m.
        load_share: dry friction as a share of the servo's torque.
        stiction: what dry friction is more near standstill, N m.
        stiction_speed: speed at which 1/e of that is left, rad/s.
        armature: inertia of the rotor behind its gear, kg m2.
        inertia: inertia of the arm, kg m2.
        weight: torque of the arm's weight where it is level, N m.
        tilt: angle at which the arm is level, by the tilt of its bench.
        deadband: half the width of the errors that give no torque.
        play: half the free play between rotor and arm.
        travel, trim: gain and offset of the commanded angle.
        resolution: step of the commanded angle.
        speed_limit: the commanded angle is followed no faster, rad/s.
        back_emf: torque lost per speed outside the clamp, N m s/rad, while powered.
        latency_s: how late all commands are.
        jitter_s: each command is later by its own time, uniform from none, with this standard deviation.
    """

    gain: float = 25.0
    damping: float = 5.0
    limit: float = 2.7
    lag_s: float = 0.1
    friction: float = 0.1
    load_share: float = 0.0
    stiction: float = 0.0
    stiction_speed: float = 0.1
    armature: float = 0.005
    inertia: float = 0.0105
    weight: float = 0.354 * 9.81 * 0.168
    tilt: float = 0.0
    deadband: float = 0.0
    play: float = 0.0
    travel: float = 1.0
    trim: float = 0.0
    resolution: float = 0.0
    speed_limit: float = np.inf
    back_emf: float = 0.0
    latency_s: float = 0.0
    jitter_s: float = 0.0


EFFECTS: dict[str, Callable[[Servo, float], Servo]] = {
    "servo_torque_limit": lambda servo, value: replace(servo, limit=value),
    "servo_speed_limit": lambda servo, value: replace(servo, speed_limit=value),
    "servo_gain": lambda servo, value: replace(servo, gain=servo.gain * value),
    "servo_damping": lambda servo, value: replace(servo, damping=servo.damping * value),
    "servo_inertia": lambda servo, value: replace(servo, armature=value),
    "servo_deadband": lambda servo, value: replace(servo, deadband=value),
    "servo_backlash": lambda servo, value: replace(servo, play=value),
    "servo_travel": lambda servo, value: replace(servo, travel=value),
    "servo_trim": lambda servo, value: replace(servo, trim=value),
    "servo_friction": lambda servo, value: replace(servo, friction=value),
    "servo_friction_load": lambda servo, value: replace(servo, load_share=value),
    "servo_stiction": lambda servo, value: replace(servo, stiction=value),
    "servo_lag": lambda servo, value: replace(servo, lag_s=value),
    "servo_resolution": lambda servo, value: replace(servo, resolution=value),
    "servo_back_emf": lambda servo, value: replace(servo, back_emf=value),
    "command_latency": lambda servo, value: replace(servo, latency_s=value),
    "command_jitter": lambda servo, value: replace(servo, jitter_s=value),
    "ground_slope": lambda servo, value: replace(servo, tilt=-value),
}
"""What each effect does to a servo; its value is the parameter of the effect with this name."""


def planted(servo: Servo, effects: Mapping[str, float]) -> Servo:
    """Return a servo with effects."""
    for name, value in effects.items():
        servo = EFFECTS[name](servo, value)
    return servo


@dataclass(frozen=True)
class Log:
    """One recording's commands.

    Attributes:
        rows: targets, one every `row_s` from time 0, rad; NaN: unpowered.
        held: target before time 0, rad.
        start: angle from which the servo goes there, `SETTLE_S` before time 0, rad.
        waits: how late each row is among the latest possible, 0 to 1; None where none is.
        row_s: time between two rows, s.
    """

    rows: Array
    held: float = 0.0
    start: float = 0.0
    waits: Array | None = None
    row_s: float = ROW_S


def angles(servos: Sequence[Servo], logs: Sequence[Log], step_s: float = STEP_S) -> list[Array]:
    """Return the angle of each arm at the times of its log's rows, before each row acts, rad.

    Args:
        servos: one for each log.
        logs: the commands, all with rows at the same times.
        step_s: time step, s; the time between two rows is a multiple of it.
    """
    found: list[Array] = [np.empty(0)] * len(logs)
    for loose in (False, True):
        columns = [i for i, servo in enumerate(servos) if (servo.play > 0.0) == loose]
        if columns:
            rows = _run([servos[i] for i in columns], [logs[i] for i in columns], step_s, loose)
            for column, row in zip(columns, rows, strict=True):
                found[column] = row
    return found


def _run(servos: Sequence[Servo], logs: Sequence[Log], step_s: float, loose: bool) -> list[Array]:
    """Return the same for servos that all have free play, or all have none."""
    each = round(logs[0].row_s / step_s)
    before = round(SETTLE_S / step_s)
    longest = max(len(log.rows) for log in logs)
    steps = before + each * (longest - 1)
    asked, powered = followed(servos, logs, steps, before, step_s)
    start = np.array([log.start for log in logs])
    arm = (_LooseArm if loose else _Arm)(_Figures.of(servos), start, step_s)
    angle = np.empty((longest, len(logs)))
    for step in range(steps):
        if step >= before and (step - before) % each == 0:
            angle[(step - before) // each] = arm.angle
        arm.advance(asked[step], powered[step])
    angle[-1] = arm.angle
    return [angle[: len(log.rows), i].copy() for i, log in enumerate(logs)]


# --- commands ---------------------------------------------------------------------------------


def followed(
    servos: Sequence[Servo], logs: Sequence[Log], steps: int, before: int, step_s: float
) -> tuple[Array, Array]:
    """Return the angle that each servo follows, rad, and its power, 0 or 1, in each step; shape (steps, n).

    Args:
        servos, logs: one of each for a column.
        steps: number of steps.
        before: how many of them are before time 0.
        step_s: time step, s.
    """
    middle = (np.arange(steps) - before + 0.5) * step_s
    sent = np.column_stack([_arrived(s, log, middle) for s, log in zip(servos, logs, strict=True)])
    powered = np.isfinite(sent)
    largest = np.array([servo.speed_limit * step_s for servo in servos])
    lag = np.array([servo.lag_s for servo in servos])
    share = np.where(lag > 0.0, -np.expm1(-step_s / np.maximum(lag, 1e-12)), 1.0)
    slewed, filtered = sent[0].copy(), sent[0].copy()
    for step, target in enumerate(sent):
        on = powered[step]
        change = np.where(on, _within(target - slewed, largest), 0.0)
        slewed += change
        moved = np.where(on, share * (slewed - filtered), 0.0)
        sent[step] = np.where(lag > 0.0, filtered + 0.5 * moved, slewed)
        filtered += moved
    return sent, powered.astype(float)


def _arrived(servo: Servo, log: Log, time: Array) -> Array:
    """Return the angle that a servo is asked for at some times, rad; NaN: unpowered."""
    late = np.full(len(log.rows), servo.latency_s)
    if log.waits is not None:
        late += np.sqrt(12.0) * servo.jitter_s * log.waits
    arrives = np.arange(len(log.rows)) * log.row_s + late
    arrives = np.minimum.accumulate(arrives[::-1])[::-1]  # a later command that came first replaces it
    index = np.searchsorted(arrives, time, side="right") - 1
    asked = np.where(index < 0, log.held, log.rows[np.maximum(index, 0)])
    if servo.resolution > 0.0:
        asked = np.round(asked / servo.resolution) * servo.resolution
    return servo.travel * asked + servo.trim


def _within(values: Array, most: Array) -> Array:
    """Return values within -most and most."""
    found: Array = np.minimum(np.maximum(values, -most), most)  # quicker than np.clip for a few columns
    return found


# --- motion -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Figures:
    """The figures of some servos as columns, shape (n,)."""

    gain: Array
    damping: Array
    limit: Array
    friction: Array
    load_share: Array
    stiction: Array
    stiction_speed: Array
    armature: Array
    inertia: Array
    weight: Array
    tilt: Array
    deadband: Array
    play: Array
    back_emf: Array

    @staticmethod
    def of(servos: Iterable[Servo]) -> _Figures:
        rows = list(servos)
        names = _Figures.__dataclass_fields__
        return _Figures(**{name: np.array([getattr(row, name) for row in rows]) for name in names})

    def gravity(self, angle: Array) -> Array:
        """Return the torque of the arm's weight, N m."""
        return -self.weight * np.cos(angle - self.tilt)

    def dry(self, speed: Array, torque: Array) -> Array:
        """Return the largest torque of dry friction, N m."""
        excess = self.stiction * np.exp(-((speed / self.stiction_speed) ** 2))
        return self.friction + self.load_share * np.abs(torque) + excess


@dataclass(frozen=True)
class _Drive:
    """The servo's torque in one step, a falling function of the speed.

    Attributes:
        at_rest: torque without speed and clamp, N m.
        damping: inside the clamp, N m s/rad.
        limit: the clamp, N m.
        loss: torque lost per speed outside it, N m s/rad.
    """

    at_rest: Array
    damping: Array
    limit: Array
    loss: Array

    @staticmethod
    def of(figures: _Figures, followed: Array, angle: Array, powered: Array) -> _Drive:
        error = followed - angle
        error = np.where(powered > 0.0, error - _within(error, figures.deadband), 0.0)
        on = figures.damping * powered, figures.limit * powered, figures.back_emf * powered
        return _Drive(figures.gain * error, *on)

    def torque(self, speed: Array) -> Array:
        """Return the torque at a speed, the loss included, N m."""
        inside = _within(self.at_rest - self.damping * speed, self.limit)
        return inside - self.loss * speed


def _moved(
    figures: _Figures,
    drive: _Drive,
    speed: Array,
    inertia: Array,
    external: Array,
    step_s: float,
    mean: float,
) -> Array:
    """Return the speed after a step, rad/s: J (v' - v) / h = T(w) + external - F; F opposes v'.

    w = (1 - mean) v + mean v' is the speed at which the servo's torque counts. Where friction can hold the
    arm, v' is 0.
    """
    per = inertia / step_s
    rest = (1.0 - mean) * speed
    holding = drive.torque(rest)
    free = holding + external + per * speed
    sign = np.sign(free)
    dry = figures.dry(0.0 * speed, holding)
    sticks = np.abs(free) <= dry
    dry = figures.dry(speed, drive.torque(speed))
    for _ in range(2):
        push = per * speed + external - sign * dry - drive.loss * rest
        after = (push + drive.at_rest - drive.damping * rest) / (per + mean * (drive.damping + drive.loss))
        wanted = drive.at_rest - drive.damping * (rest + mean * after)
        clamped = _within(wanted, drive.limit)
        after = np.where(wanted == clamped, after, (push + clamped) / (per + mean * drive.loss))
        among = rest + mean * after
        dry = figures.dry(among, drive.torque(among))
    after = np.where(after * sign > 0.0, after, 0.0)
    return np.where(sticks, 0.0, after)


class _Arm:
    """Arms that are fixed to their servos.

    Attributes:
        angle: rad, shape (n,).
        speed: rad/s, shape (n,).
    """

    def __init__(self, figures: _Figures, start: Array, step_s: float):
        self.figures, self.step_s = figures, step_s
        self.angle, self.speed = start.copy(), np.zeros_like(start)

    def advance(self, followed: Array, powered: Array) -> None:
        """Advance by a step: a trapezoid of the motion."""
        figures, step_s = self.figures, self.step_s
        middle = self.angle + 0.5 * step_s * self.speed
        drive = _Drive.of(figures, followed, middle, powered)
        inertia = figures.inertia + figures.armature
        after = _moved(figures, drive, self.speed, inertia, figures.gravity(middle), step_s, 0.5)
        self.angle = self.angle + 0.5 * step_s * (self.speed + after)
        self.speed = after


class _LooseArm(_Arm):
    """Arms with free play. Damping and dry friction are the servo's: motor and gear.

    Attributes:
        rotor, rotor_speed: of the servo's shaft, rad and rad/s, shape (n,).
    """

    def __init__(self, figures: _Figures, start: Array, step_s: float):
        super().__init__(figures, start, step_s)
        self.rotor, self.rotor_speed = start.copy(), np.zeros_like(start)

    def advance(self, followed: Array, powered: Array) -> None:
        """Advance by an implicit step: apart where the play allows it, else together, without a rebound."""
        figures, step_s = self.figures, self.step_s
        drive = _Drive.of(figures, followed, self.rotor + 0.5 * step_s * self.rotor_speed, powered)
        weight = figures.gravity(self.angle + 0.5 * step_s * self.speed)
        none = np.zeros_like(weight)
        apart = _moved(figures, drive, self.rotor_speed, figures.armature, none, step_s, 1.0)
        arm = self.speed + step_s * weight / figures.inertia
        gap = self.rotor - self.angle
        stop = _within(gap + step_s * (apart - arm), figures.play)
        closing = (stop - gap) / step_s
        touch = np.abs(closing - (apart - arm)) > 1e-12
        both = figures.armature + figures.inertia
        shared = figures.armature * self.rotor_speed + figures.inertia * (self.speed + closing)
        together = _moved(figures, drive, shared / both, both, weight, step_s, 1.0)
        self.rotor_speed = np.where(touch, together, apart)
        self.speed = np.where(touch, together - closing, arm)
        self.rotor = self.rotor + step_s * self.rotor_speed
        self.angle = self.angle + step_s * self.speed


# --- measurement ------------------------------------------------------------------------------


def read(angle: Array, noise_rad: float, rng: np.random.Generator) -> Array:
    """Return angles as an encoder gives them: with noise, in counts."""
    noisy = angle + rng.normal(0.0, noise_rad, angle.shape)
    return np.round(noisy / COUNT_RAD) * COUNT_RAD
