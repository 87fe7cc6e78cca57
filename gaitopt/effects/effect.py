"""One unmodelled effect, as data and small functions that make it happen.

An effect acts through one or two of these hooks. Each is for one kind of mechanism:

- ``structure`` adds joints, actuators, tendons, sensors or pairs to the `mujoco.MjSpec` before it is
  compiled;
- ``model`` edits fields of the compiled `mujoco.MjModel`;
- ``commands`` changes what arrives at the servos;
- ``loop`` edits fields of the model while it runs, from sensors (`Update`);
- ``observe`` changes what is measured.

Every hook finds what it acts on through `Parts`: roles, actuators and axes, never names.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.parts import ALL, Figure, Parts
from gaitopt.effects.prior import Prior
from gaitopt.gait.drive import Commands
from gaitopt.robot.roles import Roles
from gaitopt.robot.trajectory import Trajectory

_LOOP_S = 2e-3
"""About the time between two calls of a ``loop`` that is not prompt.

It is far below the times that loops stand for: a supply's bulk capacitor and a servo's 20 ms frame, a
pad's slip of a tenth of a second.
"""


@dataclass(frozen=True)
class Update:
    """What edits the model while it runs.

    Attributes:
        edit: called with the last ``sensordata``, every `loop_steps`.
        prompt: whether it is called after each step instead, and before one in which a command jumps with
            what the sensors measure under the new command. It must not count its calls, then.
    """

    edit: Callable[[NDArray[np.float64]], None]
    prompt: bool = False


Structure = Callable[[mujoco.MjSpec, Parts, float], None]
"""Called with the specification, the nominal robot's parts and the parameter's value."""

Edit = Callable[[Parts, float, float], None]
"""Called with the edited robot's parts, the parameter's value and its neutral value."""

Send = Callable[[Commands, float, Parts], Commands]
"""Called with what is sent, the parameter's value and the edited robot's parts; returns what arrives."""

Loop = Callable[[Parts, float], Update]
"""Called with the running robot's parts and the parameter's value; returns what is called as it runs."""

Observe = Callable[[Trajectory, float, Parts, np.random.Generator], Trajectory]
"""Called with what happened, the parameter's value and the robot's parts; returns what is measured."""


def loop_steps(step_s: float) -> int:
    """Return how many steps lie between two calls of a ``loop`` that is not prompt.

    Args:
        step_s: length of a step, s.
    """
    return max(1, round(_LOOP_S / step_s))


def loop_interval_s(step_s: float) -> float:
    """Return the time between two calls of a ``loop`` that is not prompt, s.

    Args:
        step_s: length of a step, s.
    """
    return loop_steps(step_s) * step_s


@dataclass(frozen=True)
class Plausible:
    """What is plausible of an effect on some robots: range and prior, in multiples of its `reference`."""

    low: float
    high: float
    prior: Prior


@dataclass(frozen=True)
class Effect:
    """One unmodelled effect.

    `low`, `high` and the prior are in multiples of a figure of the nominal robot, `reference`, so that they
    suit other robots too. `low` to `high` is what is plausible and searched; `allowed` is what the mechanism
    can do, and what a problem file may set. The neutral value may lie outside the searched range (infinity,
    or 0 on a logarithmic scale).

    Attributes:
        name: its name.
        summary: what it is, in a line.
        parameter: name of its one parameter, with the unit as suffix.
        unit: unit of the parameter; empty for a ratio.
        neutral: the value that changes nothing, or the figure of the nominal robot that is this value.
        low, high: searched range, in multiples of `reference`.
        scale: ``lin`` if equal steps of the value count equally, ``log`` if equal ratios do.
        prior: what is plausible.
        reference: figure of the nominal robot; 1 by default.
        reference_name: that figure in words; empty for 1.
        otherwise: returns another range and prior for a nominal robot that needs them, or None.
        allowed: smallest and largest value that the mechanism can do. A limit is excluded where it is
            infinite, and where it is 0 on a logarithmic scale.
        target: ``none``, ``any`` (`ALL` or one actuator) or ``one`` actuator.
        role: the role it acts on, which must not be empty; empty for none.
        missing: returns why it does not apply to a nominal robot, or None.
        found_in_record: whether it is a defect of the recording, which the recording itself shows before
            anything is simulated; the diagnosis does not fit it.
        needs_known_start: whether it can be seen only where the start of the recording is known.
        shifts_start: whether it only shifts the start of the recording; where that start is unknown, the
            diagnosis fits it in every trial as a nuisance.
        of_clock: whether it is an error of the recording's clock; logged commands may share that clock.
        of_free_robot: whether it is the cause of a gap only where the trunk moves freely: on a bench,
            it would stand for another error of the arm.
        unusual: minus twice the logarithm of the odds that it is at work, beside other effects: it is named
            only where none of these does the same.
        on_joints: whether it acts on actuators that turn a joint, and on no others of its target.
        jumps: whether the commands jump where the parameter changes smoothly, and otherwise are known; such
            an effect is rough, from a neutral lower bound up.
        rough: whether the response jumps, or is left to chance, where the parameter changes smoothly: slopes
            mislead a fit of many effects.
        structure, model, commands, loop, observe: the hooks; None where it does not use one.
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
    otherwise: Callable[[Parts], Plausible | None] = lambda parts: None
    allowed: tuple[float, float] = (-math.inf, math.inf)
    target: Literal["none", "any", "one"] = "none"
    role: str = ""
    missing: Callable[[Parts], str | None] = lambda parts: None
    found_in_record: bool = False
    needs_known_start: bool = False
    shifts_start: bool = False
    of_clock: bool = False
    of_free_robot: bool = False
    unusual: float = 0.0
    on_joints: bool = False
    rough: bool = False
    jumps: bool = False
    structure: Structure | None = None
    model: Edit | None = None
    commands: Send | None = None
    loop: Loop | None = None
    observe: Observe | None = None

    def __reduce__(self) -> tuple[Callable[[str], Effect], tuple[str]]:
        """Travel to another process by name: hooks are functions, which every process has in the library."""
        return _by_name, (self.name,)

    @property
    def changes_robot(self) -> bool:
        """Whether it changes the robot or its commands, and not the measurement only."""
        hooks = (self.structure, self.model, self.commands, self.loop)
        return any(hook is not None for hook in hooks)

    def neutral_value(self, nominal: Parts) -> float:
        """Return the value that changes nothing on a robot."""
        return self.neutral(self.acting(nominal)) if callable(self.neutral) else self.neutral

    def acting(self, parts: Parts) -> Parts:
        """Return the parts of a robot that it acts on: of its target, the actuators that it is meant for."""
        return replace(parts, on_joints=True) if self.on_joints else parts

    def bounds(self, nominal: Parts) -> tuple[float, float]:
        """Return the searched range on a robot, in the parameter's unit."""
        reference, plausible = self.reference(self.acting(nominal)), self.plausible(nominal)
        return plausible.low * reference, plausible.high * reference

    def plausible(self, nominal: Parts) -> Plausible:
        """Return the range and the prior on a robot, in multiples of `reference`."""
        return self.otherwise(self.acting(nominal)) or Plausible(self.low, self.high, self.prior)

    def prior_on(self, nominal: Parts) -> tuple[Prior, float]:
        """Return the prior on a robot, and the figure of that robot that it is in multiples of."""
        return self.plausible(nominal).prior, self.reference(self.acting(nominal))

    def log_prior(self, value: float, nominal: Parts) -> float:
        """Return the logarithm of the prior density on a robot, up to a constant."""
        prior, reference = self.prior_on(nominal)
        return prior.log_density(value, reference)

    def why_not(self, nominal: Parts) -> str | None:
        """Return why the effect does not apply to a robot, or None where it does."""
        acting = self.acting(nominal)
        if self.on_joints and not acting.servos:
            return (
                "no actuator turns a joint" if nominal.target == ALL else "its actuator does not turn a joint"
            )
        return self.missing_role(nominal.roles) or self.missing(acting)

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
