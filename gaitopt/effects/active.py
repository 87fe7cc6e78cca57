"""Active effects: those that a problem file switches on, checked, and their action on one robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from gaitopt.core.errors import GaitoptError, bad_value, unknown_name
from gaitopt.effects import EFFECTS, Effect
from gaitopt.effects.effect import Update
from gaitopt.effects.parts import ALL, Parts
from gaitopt.gait.drive import Commands
from gaitopt.robot.roles import Roles
from gaitopt.robot.trajectory import Trajectory

Values = Mapping[str, float | str]
"""A file's table of one effect: its parameter, and ``target`` for a servo's."""

Tables = Values | Sequence[Values]
"""One table of an effect, or several: one for each of its targets, as ``[[effects.NAME]]`` in a file."""


def tables_of(asked: Tables) -> list[Values]:
    """Return the tables of one effect, one for each target."""
    return [asked] if isinstance(asked, Mapping) else list(asked)


def written(asked: Tables) -> dict[str, float | str] | list[dict[str, float | str]]:
    """Return the same as a file holds it: a copy that nothing else changes."""
    return dict(asked) if isinstance(asked, Mapping) else [dict(one) for one in asked]


@dataclass(frozen=True)
class EffectValue:
    """One effect of a robot, by name.

    Attributes:
        name: the effect.
        target: `ALL` or one actuator; `ALL` for an effect without a target.
        value: its parameter's value.
    """

    name: str
    target: str
    value: float


EffectValues = tuple[EffectValue, ...]
"""The effects of one robot; none of the nominal one."""


def as_tables(values: EffectValues) -> dict[str, Tables]:
    """Return the effects of a robot as a problem file states them; they are in the library."""
    found: dict[str, list[Values]] = {}
    for one in values:
        effect = EFFECTS[one.name]
        own: dict[str, float | str] = {effect.parameter: one.value}
        own |= {} if effect.target == "none" else {"target": one.target}
        found.setdefault(one.name, []).append(own)
    return {name: own[0] if len(own) == 1 else own for name, own in found.items()}


@dataclass(frozen=True)
class ActiveEffect:
    """One effect as a problem file sets it.

    Attributes:
        effect: the effect.
        value: its parameter's value.
        target: `ALL` or one actuator.
    """

    effect: Effect
    value: float
    target: str = ALL


def active_effects(
    asked: Mapping[str, Tables], roles: Roles, channels: Sequence[str], source: object
) -> tuple[ActiveEffect, ...]:
    """Return the effects that a file switches on, in the order in which they act.

    Args:
        asked: the file's table of each effect, or its tables, one for each target, by the effect's name.
        roles: the problem's roles.
        channels: the problem's actuators.
        source: the file, for messages.

    Raises:
        GaitoptError: there is no such effect, parameter or target, a value is not allowed, the role that an
            effect acts on is empty, or two tables of an effect act on the same actuator.
    """
    for name in asked:
        if name not in EFFECTS:
            raise unknown_name(source, "effect in effects:", name, EFFECTS)
    active: list[ActiveEffect] = []
    for name, effect in EFFECTS.items():
        if name in asked:
            where = f"{source}: effects.{name}"
            own = [
                _active_effect(effect, values, roles, channels, where) for values in tables_of(asked[name])
            ]
            _check_apart([one.target for one in own], where)
            active += own
    return tuple(active)


def _check_apart(targets: Sequence[str], source: str) -> None:
    """Check that no actuator has an effect twice."""
    if len(targets) > 1 and (ALL in targets or len(set(targets)) < len(targets)):
        raise bad_value(source, "target", ", ".join(targets), f"each actuator once, or {ALL} alone")


def _active_effect(
    effect: Effect, values: Values, roles: Roles, channels: Sequence[str], source: str
) -> ActiveEffect:
    keys = [effect.parameter] + (["target"] if effect.target != "none" else [])
    for key in values:
        if key not in keys and (key, values[key]) != ("target", ALL):  # which every effect may say
            raise unknown_name(source, "parameter", key, keys)
    if effect.parameter not in values:
        raise GaitoptError(f"{source}: {effect.parameter}: missing; it is required")
    value = values[effect.parameter]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not effect.allows(float(value)):
        raise bad_value(source, effect.parameter, value, effect.allowed_text)
    reason = effect.missing_role(roles)
    if reason:
        raise GaitoptError(f"{source}: not applicable: {reason}")
    return ActiveEffect(effect, float(value), _target(effect, values, channels, source))


def _target(effect: Effect, values: Values, channels: Sequence[str], source: str) -> str:
    if effect.target == "one" and "target" not in values:
        raise GaitoptError(f"{source}: target: missing; allowed: one of {', '.join(channels)}")
    allowed = list(channels) if effect.target == "one" else [ALL, *channels]
    target = values.get("target", ALL)
    if effect.target != "none" and target not in allowed:
        raise unknown_name(source, "target", target, allowed)
    return str(target)


@dataclass(frozen=True)
class RobotEffects:
    """The effects that change one robot: those that apply and are not at their neutral value.

    Attributes:
        active: the effects, in the order in which they act.
        nominal: the parts of the nominal robot.
    """

    active: tuple[ActiveEffect, ...]
    nominal: Parts

    @staticmethod
    def of(asked: Sequence[ActiveEffect], nominal: Parts, source: object) -> RobotEffects:
        """Return the effects that change a robot.

        Raises:
            GaitoptError: an effect does not apply to this robot.
        """
        changing = []
        for active in asked:
            parts = replace(nominal, target=active.target)
            reason = active.effect.why_not(parts)
            if reason:
                raise GaitoptError(f"{source}: effects.{active.effect.name}: not applicable: {reason}")
            if active.value != active.effect.neutral_value(parts):
                changing.append(active)
        return RobotEffects(tuple(changing), nominal)

    def _parts(self, active: ActiveEffect, model: mujoco.MjModel | None = None) -> Parts:
        parts = replace(self.nominal, target=active.target, model=model or self.nominal.model)
        return active.effect.acting(parts)

    def restructure(self, spec: mujoco.MjSpec) -> None:
        """Add the parts that the effects need to a nominal robot's specification."""
        for active in self.active:
            if active.effect.structure is not None:
                active.effect.structure(spec, self._parts(active), active.value)

    def edit(self, model: mujoco.MjModel) -> None:
        """Edit a compiled model that has been through `restructure`."""
        edits = [s for s in self.active if s.effect.model is not None]
        for active in edits:
            neutral = active.effect.neutral_value(self._parts(active))
            if active.effect.model is not None:
                active.effect.model(self._parts(active, model), active.value, neutral)
        if edits:
            mujoco.mj_setConst(model, mujoco.MjData(model))

    @property
    def changes_robot(self) -> bool:
        """Whether any effect changes the robot or its commands, and not the measurement only."""
        return any(s.effect.changes_robot for s in self.active)

    @property
    def loops(self) -> bool:
        """Whether any effect needs to edit the model while it runs."""
        return any(s.effect.loop is not None for s in self.active)

    def updates(self, model: mujoco.MjModel) -> list[Update]:
        """Return what edits `model` while it runs; nothing else may use that model."""
        return [s.effect.loop(self._parts(s, model), s.value) for s in self.active if s.effect.loop]

    def commands(self, sent: Commands, model: mujoco.MjModel) -> Commands:
        """Return what arrives at the servos when `sent` is sent, on the clock of the edited `model`."""
        for active in self.active:
            if active.effect.commands is not None:
                sent = active.effect.commands(sent, active.value, self._parts(active, model))
        return sent

    def observe(self, trajectory: Trajectory, model: mujoco.MjModel, rng: np.random.Generator) -> Trajectory:
        """Return a trajectory of the edited `model` as camera, tracker and clock measure it."""
        for active in self.active:
            if active.effect.observe is not None:
                parts = self._parts(active, model)
                trajectory = active.effect.observe(trajectory, active.value, parts, rng)
        return trajectory
