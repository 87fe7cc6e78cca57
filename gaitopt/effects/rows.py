"""Rows of `gaitopt effects`: what each effect is, and whether it applies to a robot."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from gaitopt.effects import EFFECTS, Effect
from gaitopt.effects.parts import Figure, Parts

_TARGETS = {"none": "", "any": "all or one actuator", "one": "one actuator"}


@dataclass(frozen=True)
class EffectRow:
    """One effect as `gaitopt effects` lists it.

    Attributes:
        name: the effect.
        meaning: what it is, in a line.
        parameter: name of its parameter, with the unit as suffix.
        unit: unit of the parameter; empty for a ratio.
        neutral: the value that changes nothing; in words where it is infinite or a figure of the robot.
        bounds: lower and upper end of the searched range, in multiples of `bounds_times`.
        bounds_times: a figure of the nominal robot in words; empty where the bounds are in `unit`.
        scale: ``lin`` or ``log``.
        prior: kind, centre and spread of the prior.
        prior_source: where the prior comes from.
        target: what it can act on, in words; empty for an effect without a target.
        applies: whether it applies to the robot; None where no robot is given.
        why_not: why it does not apply; None where no robot is given.
    """

    name: str
    meaning: str
    parameter: str
    unit: str
    neutral: float | str
    bounds: tuple[float, float]
    bounds_times: str
    scale: str
    prior: str
    prior_source: str
    target: str
    applies: bool | None = None
    why_not: str | None = None

    @staticmethod
    def of(effect: Effect, nominal: Parts | None = None) -> EffectRow:
        """Return the row of an effect, with a robot's own figures where it applies to the robot."""
        reason = None if nominal is None else effect.why_not(nominal)
        own = nominal if reason is None else None
        prior = effect.prior if own is None else effect.plausible(own).prior
        return EffectRow(
            name=effect.name,
            meaning=effect.summary,
            parameter=effect.parameter,
            unit=effect.unit,
            neutral=_words(effect.neutral if own is None else effect.neutral_value(own)),
            bounds=(effect.low, effect.high) if own is None else effect.bounds(own),
            bounds_times=effect.reference_name if own is None else "",
            scale=effect.scale,
            prior=str(prior),
            prior_source=prior.source,
            target=_TARGETS[effect.target],
            applies=None if nominal is None else reason is None,
            why_not=None if nominal is None else reason or "",
        )

    def to_dict(self) -> dict[str, object]:
        """Return the row for JSON; without a robot, it does not say whether the effect applies."""
        row = asdict(self) | {"bounds": list(self.bounds)}
        return {key: value for key, value in row.items() if value is not None}


def effect_rows(nominal: Parts | None = None) -> list[EffectRow]:
    """Return one row per effect of the library.

    Args:
        nominal: the parts of a nominal robot, for its own figures; without, they are in multiples of
            what is named.
    """
    return [EffectRow.of(effect, nominal) for effect in EFFECTS.values()]


def _words(neutral: float | Figure) -> float | str:
    """Return a neutral value as JSON and a reader take it: infinity and a robot's figure are words."""
    if callable(neutral):
        return "the nominal's"
    return "inf" if math.isinf(neutral) else neutral
