"""The noun: one unmodelled effect, as data and one small function that makes it happen.

An effect acts through exactly one or two hooks, each for one kind of mechanism:

- ``structure`` adds joints, actuators, tendons, sensors or pairs to the `mujoco.MjSpec` before it is
  compiled;
- ``model`` edits fields of the compiled `mujoco.MjModel`;
- ``commands`` changes what arrives at the servos;
- ``loop`` edits fields of the model while it runs, from sensors, every `LOOP_INTERVAL_S`;
- ``observe`` changes what is measured.

Every hook finds what it acts on through `Parts`: roles, actuators and axes, never names.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.gait.drive import Commands
from gaitopt.robot.roles import Roles
from gaitopt.robot.trajectory import Trajectory

ALL = "all"
"""The target that stands for every actuator."""

LOOP_INTERVAL_S = 2e-3
"""Time between two calls of a ``loop``; a step where steps are longer.

Far below what it stands for: a supply's bulk capacitor and a servo's 20 ms frame; a pad's slip of a
tenth of a second.
"""

_PREFIX = "gaitopt:"


def added_name(what: str, owner: str) -> str:
    """Return the name of a part that an effect adds to a model for the part `owner`."""
    return f"{_PREFIX}{what}:{owner}"


def is_added(name: str) -> bool:
    """Whether a part of a model was added by an effect."""
    return name.startswith(_PREFIX)


def owner_of(name: str) -> str:
    """Return the part of the nominal model that an added part belongs to."""
    return name.removeprefix(_PREFIX).partition(":")[2]


@dataclass(frozen=True)
class Parts:
    """The parts of a compiled model that effects act on.

    Attributes:
        model: the model, nominal or being edited.
        roles: the problem's roles.
        channels: the problem's actuators, which come first in the model.
        target: one of the channels, or `ALL`.
    """

    model: mujoco.MjModel
    roles: Roles
    channels: Sequence[str]
    target: str = ALL

    @property
    def step_s(self) -> float:
        """Step of the clock on which the model runs, s."""
        return float(self.model.opt.timestep)

    @property
    def servos(self) -> list[int]:
        """Actuator ids of the target, which are also its columns in a command."""
        return [i for i, name in enumerate(self.channels) if self.target in (ALL, name)]

    @cached_property
    def servo_joints(self) -> list[int]:
        """Joint ids that the target's actuators turn; -1 for another transmission."""
        joint = int(mujoco.mjtTrn.mjTRN_JOINT)
        types, ids = self.model.actuator_trntype, self.model.actuator_trnid
        return [int(ids[i, 0]) if int(types[i]) == joint else -1 for i in self.servos]

    @cached_property
    def servo_dofs(self) -> list[int]:
        """Degrees of freedom that the target's actuators turn."""
        return [int(self.model.jnt_dofadr[j]) for j in self.servo_joints if j >= 0]

    @cached_property
    def hinges(self) -> list[int]:
        """Joint ids of the passive hinges."""
        return [self.model.joint(name).id for name in self.roles.hinges]

    @cached_property
    def undriven_hinges(self) -> list[int]:
        """Joint ids of the passive hinges that no actuator turns as well."""
        driven = Parts(self.model, self.roles, self.channels).servo_joints
        return [j for j in self.hinges if j not in driven]

    @cached_property
    def pads(self) -> list[int]:
        """Geom ids of the pads."""
        return [self.model.geom(name).id for name in self.roles.pads]

    @cached_property
    def body(self) -> list[int]:
        """Geom ids of the other geoms that may touch the ground."""
        return [self.model.geom(name).id for name in self.roles.body]

    @property
    def axes(self) -> NDArray[np.float64]:
        """Forward, left and up as the rows of a rotation, shape (3, 3)."""
        return self.roles.axes

    @cached_property
    def at_zero(self) -> mujoco.MjData:
        """The model's kinematics in its reference pose."""
        data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, data)
        return data


Figure = Callable[[Parts], float]
"""A figure of the nominal robot: its mass, its servos' torque limit, …"""

Update = Callable[[NDArray[np.float64]], None]
"""Called with the last ``sensordata``; edits the model that runs."""


@dataclass(frozen=True)
class Prior:
    """How plausible a value is before anything is measured.

    Attributes:
        kind: ``normal``; ``half-normal``, from 0 up; ``log-normal``, whose logarithm is normal.
        centre: mean, or median of a log-normal, in multiples of the effect's `reference`.
        spread: standard deviation in multiples of the reference; of the logarithm for a log-normal.
        source: where that comes from.
    """

    kind: Literal["normal", "half-normal", "log-normal"]
    centre: float
    spread: float
    source: str

    def log_density(self, value: float, reference: float = 1.0) -> float:
        """Return the logarithm of the density at `value`, up to a constant; -inf outside."""
        if self.kind == "log-normal":
            if not 0.0 < value < math.inf:
                return -math.inf
            distance = math.log(value / (self.centre * reference)) / self.spread
        else:
            if self.kind == "half-normal" and value < 0.0:
                return -math.inf
            distance = (value / reference - self.centre) / self.spread
        return -0.5 * distance**2

    def __str__(self) -> str:
        return f"{self.kind}, {self.centre:g}, {self.spread:g}"


@dataclass(frozen=True)
class Effect:
    """One unmodelled effect.

    `low`, `high`, and the prior are in multiples of a figure of the nominal robot, `reference`, so that
    another robot gets sensible ones. `low` to `high` is what is plausible and searched; `allowed` is what
    the mechanism can do, and what a problem file may ask for. The neutral value may lie outside the
    searched range (infinity, or 0 on a logarithmic scale).

    Attributes:
        name: its name.
        summary: what it is, in a line.
        parameter: name of its one parameter, with the unit as suffix.
        unit: unit of the parameter; empty for a ratio.
        neutral: the value that changes nothing, or the figure of the nominal robot that is it.
        low, high: searched range, in multiples of `reference`.
        scale: whether steps in the value or in its logarithm are alike.
        prior: what is plausible.
        reference: figure of the nominal robot; 1 by default.
        reference_name: that figure in words; empty for 1.
        allowed: smallest and largest value that the mechanism can do; excluded where infinite or where
            the value is a positive quantity and the limit is 0.
        target: ``none``, ``any`` (`ALL` or one actuator) or ``one`` actuator.
        role: the role it acts on, which must not be empty; empty for none.
        missing: returns why it does not apply to a nominal robot, or None.
        found_in_record: whether it is a defect of the recording, which the recording itself shows before
            anything is simulated; the diagnosis does not fit it.
        needs_known_start: whether it can be seen only where the start of the recording is known.
        shifts_start: whether it only shifts the start of the recording; where that start is unknown, the
            diagnosis fits it in every trial as a nuisance.
    """

    name: str
    summary: str
    parameter: str
    unit: str
    neutral: float | Figure
    low: float
    high: float
    scale: Literal["lin", "log"]
    prior: Prior
    reference: Figure = lambda parts: 1.0
    reference_name: str = ""
    allowed: tuple[float, float] = (-math.inf, math.inf)
    target: Literal["none", "any", "one"] = "none"
    role: str = ""
    missing: Callable[[Parts], str | None] = lambda parts: None
    found_in_record: bool = False
    needs_known_start: bool = False
    shifts_start: bool = False
    structure: Callable[[mujoco.MjSpec, Parts, float], None] | None = None
    model: Callable[[Parts, float, float], None] | None = None
    commands: Callable[[Commands, float, Parts], Commands] | None = None
    loop: Callable[[Parts, float], Update] | None = None
    observe: Callable[[Trajectory, float, Parts, np.random.Generator], Trajectory] | None = None

    def __reduce__(self) -> tuple[Callable[[str], Effect], tuple[str]]:
        """Travel to another process by name: hooks are functions, and every process has the library."""
        return _by_name, (self.name,)

    @property
    def changes_robot(self) -> bool:
        """Whether it changes the robot or its commands, not the measurement alone."""
        hooks = (self.structure, self.model, self.commands, self.loop)
        return any(hook is not None for hook in hooks)

    def neutral_value(self, nominal: Parts) -> float:
        """Return the value that changes nothing on a robot."""
        return self.neutral(nominal) if callable(self.neutral) else self.neutral

    def bounds(self, nominal: Parts) -> tuple[float, float]:
        """Return the searched range on a robot, in the parameter's unit."""
        reference = self.reference(nominal)
        return self.low * reference, self.high * reference

    def log_prior(self, value: float, nominal: Parts) -> float:
        """Return the logarithm of the prior density on a robot, up to a constant."""
        return self.prior.log_density(value, self.reference(nominal))

    def why_not(self, nominal: Parts) -> str | None:
        """Return why the effect does not apply to a robot, or None where it does."""
        return self.missing_role(nominal.roles) or self.missing(nominal)

    def missing_role(self, roles: Roles) -> str | None:
        """Return that the role it acts on is empty, or None."""
        if self.role and not getattr(roles, self.role):
            return f"the problem names no roles.{self.role}"
        return None

    def allows(self, value: float) -> bool:
        """Whether the mechanism can do this value."""
        low, high = self.allowed
        above = value > low if low == 0.0 and self.scale == "log" else value >= low
        finite = math.isfinite(value) or (value == self.neutral)
        return above and value <= high and finite

    @property
    def allowed_text(self) -> str:
        """What `allows` accepts, in words."""
        low, high = self.allowed
        strict = low == 0.0 and self.scale == "log"
        lower = "" if low == -math.inf else f"above {low:g}" if strict else f"at least {low:g}"
        upper = "" if high == math.inf else f"at most {high:g}"
        return " and ".join(filter(None, (lower, upper))) or "a finite number"


def _by_name(name: str) -> Effect:
    from gaitopt.effects import EFFECTS  # which imports this file

    return EFFECTS[name]
