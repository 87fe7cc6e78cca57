"""What a problem file needs so that its servos get given figures: effects, or parameters of the MJCF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.effects import EFFECTS
from gaitopt.effects.active import Values, written
from gaitopt.effects.parts import ALL, Parts
from gaitopt.problem.model import nominal_parts, with_includes
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Parameter
from gaitopt.problem.servo_figures import (
    BACK_EMF,
    FIGURES,
    JOINT_DAMPING,
    SPEED_FEEDBACK,
    TORQUE_LOST,
    Term,
)

Array = NDArray[np.float64]

_SAME = 1e-9
"""Relative difference of two figures that are the same but for rounding."""

_SPEED_FEEDBACK, _JOINT_DAMPING = "servo_speed_feedback", "servo_joint_damping"
"""Parameters for what no effect expresses."""

_RATIO = Term("servo_damping", lambda parts: np.ones(len(parts.channels)), ratio=True)
"""The scale of the damping itself."""


@dataclass(frozen=True)
class LeftOut:
    """What was not carried over.

    Attributes:
        what: the effect, or the figure.
        reason: why, in words.
    """

    what: str
    reason: str

    def to_dict(self) -> dict[str, str]:
        """Return a row for JSON."""
        return asdict(self)


@dataclass(frozen=True)
class Changes:
    """Changes of a problem file.

    Attributes:
        effects: tables of effects by name; None for one that is switched off.
        parameters: parameters that are added, by name.
        left_out: figures that cannot be had.
    """

    effects: Mapping[str, Values | None] = field(default_factory=dict)
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    left_out: tuple[LeftOut, ...] = ()

    def __or__(self, other: Changes) -> Changes:
        return Changes(
            {**self.effects, **other.effects},
            {**self.parameters, **other.parameters},
            self.left_out + other.left_out,
        )

    def applied(self, problem: Problem) -> Problem:
        """Return a problem with these changes; parameters that are added act last."""
        asked = {**problem.file.effects, **self.effects}
        effects = {name: written(one) for name, one in asked.items() if one is not None}
        kept = {name: one for name, one in problem.file.parameters.items() if name not in self.parameters}
        update = {"effects": effects, "parameters": {**kept, **self.parameters}}
        file = problem.file.model_copy(update=update)
        return Problem.from_file(file, problem.source, problem.model_path, problem.carried)


@dataclass(frozen=True)
class Target:
    """The servos of a problem that get other figures.

    Attributes:
        problem: the problem.
        nominal: its nominal robot.
        servos: index of each servo that gets other figures.
    """

    problem: Problem
    nominal: Parts
    servos: tuple[int, ...]

    def changes(self, wanted: Mapping[str, Array], powered: Array, learnt: str) -> Changes:
        """Return what the problem file needs.

        Args:
            wanted: each of `FIGURES` by name, one value for each of `servos`.
            powered: what of the torque lost with speed is lost only while the servo is powered, N m s/rad.
            learnt: where they come from, in words.

        Raises:
            GaitoptError: a problem file cannot hold what the servos need.
        """
        changes = self._damping(wanted[SPEED_FEEDBACK.name], wanted[TORQUE_LOST.name], powered, learnt)
        for figure in FIGURES:
            if figure not in (SPEED_FEEDBACK, TORQUE_LOST):
                changes |= self._effect(figure.terms[0], figure.name, wanted[figure.name])
        return changes

    def check(
        self, corrected: Problem, nominal: Parts, wanted: Mapping[str, Array], changes: Changes
    ) -> None:
        """Check that the servos of a changed problem have their figures.

        Args:
            corrected: the problem with the changes.
            nominal: its nominal robot.
            wanted: as of `changes`.
            changes: the changes.

        Raises:
            GaitoptError: they do not: something in the MJCF acts against it.
        """
        lacking = {one.what for one in changes.left_out}
        for figure in FIGURES:
            got = figure.of(corrected, nominal)[list(self.servos)]
            if figure.name not in lacking and not _same(got, wanted[figure.name]).all():
                raise GaitoptError(
                    f"{self.problem.model_path}: {figure.name} of a servo: found {got.tolist()} where "
                    f"{wanted[figure.name].tolist()} was written: does its MJCF or a parameter set it twice?"
                )

    def _damping(self, feedback: Array, lost: Array, powered: Array, learnt: str) -> Changes:
        """Return what gives the servos a feedback of speed, and a torque lost with speed, N m s/rad."""
        servos = list(self.servos)
        own = SPEED_FEEDBACK.terms[0].nominal(self.nominal)[servos]
        damping = JOINT_DAMPING.nominal(self.nominal)[servos]
        scale = np.ones(len(servos))
        for figure, nominal in ((lost, damping), (feedback, own)):
            np.divide(figure, nominal, out=scale, where=nominal > 0.0)
        rest = lost - scale * damping
        rest[_same(lost, scale * damping)] = 0.0
        scaled = _same(feedback, scale * own).all() and _same(scale, scale[0]).all() and scale[0] > 0.0
        if scaled and (not rest.any() or not damping.any()):
            return self._effect(_RATIO, SPEED_FEEDBACK.name, scale) | self._effect(
                BACK_EMF, TORQUE_LOST.name, rest
            )
        return self._attributes(feedback, lost - powered, powered, learnt)

    def _attributes(self, feedback: Array, damping: Array, powered: Array, learnt: str) -> Changes:
        """Return the parameters that write feedback and damping into the MJCF, and what they leave over."""
        root = with_includes(self.problem)
        paths: list[tuple[str, str]] = []
        for index in self.servos:
            channel = self.nominal.channels[index]
            joint = self.nominal.model.joint(self.nominal.servo_joints[index]).name
            pair = _path("actuator/position", channel), _path("worldbody//joint", joint)
            if any(not path or len(root.findall(path)) != 1 for path in pair):
                reason = f"{channel} or its joint is no <position> or <joint> with a name in the MJCF"
                return Changes(
                    left_out=tuple(LeftOut(one.name, reason) for one in (SPEED_FEEDBACK, TORQUE_LOST))
                )
            paths.append(pair)
        origin = f"learnt: {learnt}"
        written = Changes(
            parameters={
                **_parameters(_SPEED_FEEDBACK, [f"{one}/@kv" for one, _ in paths], feedback, origin),
                **_parameters(_JOINT_DAMPING, [f"{one}/@damping" for _, one in paths], damping, origin),
            }
        )
        problem = written.applied(self.problem)
        target = replace(self, problem=problem, nominal=nominal_parts(problem))
        unscaled = target._effect(_RATIO, SPEED_FEEDBACK.name, np.ones(len(self.servos)))
        return written | unscaled | target._effect(BACK_EMF, TORQUE_LOST.name, powered)

    def _effect(self, term: Term, figure: str, wanted: Array) -> Changes:
        """Return the table of an effect that gives the servos a figure, if they need one."""
        effect, nominal = EFFECTS[term.effect], term.nominal(self.nominal)
        if _same(term.of(self.problem, self.nominal)[list(self.servos)], wanted).all():
            return Changes()
        changed = [i for i, value in zip(self.servos, wanted, strict=True) if not _same(nominal[i], value)]
        self._check_others(term)
        if not changed:
            return Changes({term.effect: None})
        if effect.target == "none" and len(self.servos) < len(self.nominal.channels):
            reason = f"{term.effect} acts on all channels, and not all have this servo"
            return Changes(left_out=(LeftOut(figure, reason),))
        target = self._target(term, changed)
        here = changed if target != ALL else list(range(len(nominal)))
        asked = wanted[[self.servos.index(i) for i in here]]
        largest = int(np.argmax(nominal[here]))
        value = float(asked[largest] / nominal[here][largest] if term.ratio else asked[largest])
        reason = effect.why_not(replace(self.nominal, target=target)) or ""
        if not reason and not effect.allows(value):
            reason = f"{term.effect} cannot be {value:g}: allowed: {effect.allowed_text}"
        if reason:
            return Changes(left_out=(LeftOut(figure, reason),))
        if not _same(term.with_effect(nominal[here], value), asked).all():
            raise GaitoptError(
                f"{self.problem.source}: effects.{term.effect}: found channels that need different values "
                f"for a {figure} of {_listed(asked)}; allowed: one value; name one channel with --channel"
            )
        named: Values = {} if effect.target == "none" else {"target": target}
        return Changes({term.effect: {effect.parameter: value, **named}})

    def _target(self, term: Term, changed: Sequence[int]) -> str:
        """Return the target of an effect that acts on some servos."""
        names = [self.nominal.channels[i] for i in changed]
        if len(names) in (1, len(self.nominal.channels)):
            return ALL if len(names) == len(self.nominal.channels) else names[0]
        raise GaitoptError(
            f"{self.problem.source}: effects.{term.effect}: found {len(names)} of "
            f"{len(self.nominal.channels)} channels that need it, {', '.join(names)}; allowed: one or all: a "
            "problem file has one table for each effect"
        )

    def _check_others(self, term: Term) -> None:
        """Check that no table of the problem's own acts on a servo that is to stay as it is."""
        stay = {name for i, name in enumerate(self.nominal.channels) if i not in self.servos}
        for active in self.problem.effects:
            if active.effect.name == term.effect and stay and active.target in (ALL, *stay):
                raise GaitoptError(
                    f"{self.problem.source}: effects.{term.effect}: found one for {active.target} already; "
                    "allowed: none for channels that are to stay as they are"
                )


def _same(one: Array | float, other: Array | float) -> NDArray[np.bool_]:
    """Return where two figures are the same but for rounding."""
    return np.isclose(one, other, rtol=_SAME, atol=0.0)


def _path(tag: str, name: str) -> str:
    """Return the XPath of an element by its name; empty for a name that an XPath cannot hold."""
    if "'" in name and '"' in name:
        return ""
    quote = '"' if "'" in name else "'"
    return f"{tag}[@name={quote}{name}{quote}]"


def _parameters(name: str, paths: Sequence[str], values: Array, origin: str) -> dict[str, Parameter]:
    """Return the parameter that writes attributes, or one for each where their values differ."""
    if _same(values, values[0]).all():
        sets = dict.fromkeys(paths, "{}")
        return {name: Parameter(value=float(values[0]), unit="N m s/rad", origin=origin, sets=sets)}
    return {
        f"{name}_{number}": Parameter(value=value, unit="N m s/rad", origin=origin, sets={path: "{}"})
        for number, (path, value) in enumerate(zip(paths, values.tolist(), strict=True), start=1)
    }


def _listed(values: Array) -> str:
    return ", ".join(f"{value:.4g}" for value in values.tolist())
