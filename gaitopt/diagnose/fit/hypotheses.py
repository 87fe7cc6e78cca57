"""The hypotheses: every effect that applies to a robot, on each target that it can have."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from gaitopt.diagnose.fit.settings import FIT, FitSettings
from gaitopt.effects import EFFECTS, Effect
from gaitopt.effects.active import Values
from gaitopt.effects.parts import ALL, Parts
from gaitopt.effects.prior import Prior

_OUTSIDE = 0.25
"""How far a fit of several effects may leave the range that is searched first, in ranges."""

_AT_BOUND = 1e-3
"""A coordinate closer to the end of its range than this share of it lies at the end."""


@dataclass(frozen=True)
class Hypothesis:
    """One effect on one target, with one unknown parameter.

    The parameter is searched in its coordinate: its value, or the logarithm of its value for effects with a
    logarithmic scale.

    Attributes:
        effect: the effect.
        target: actuator that it acts on; `ALL` for all of them, and for effects without a target.
        low, high: searched range of the coordinate.
        neutral: coordinate at which nothing changes, or the bound nearest to it.
        nominal: parts of the nominal robot, for priors.
    """

    effect: Effect
    target: str
    low: float
    high: float
    neutral: float
    nominal: Parts

    @property
    def name(self) -> str:
        """The effect, and its target where it has one: ``servo_trim.foot1``."""
        return self.effect.name if self.effect.target == "none" else f"{self.effect.name}.{self.target}"

    def value(self, coordinate: float) -> float:
        """Return the parameter at a coordinate, in its unit."""
        return math.exp(coordinate) if self.effect.scale == "log" else coordinate

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a parameter's value."""
        return math.log(value) if self.effect.scale == "log" else value

    def share(self, coordinate: float) -> float:
        """Return a coordinate in ranges: 0 at the lower bound, 1 at the upper one."""
        return (coordinate - self.low) / (self.high - self.low)

    def moved(self, coordinate: float) -> float:
        """Return how far a coordinate is from neutral, in ranges, signed."""
        return self.share(coordinate) - self.share(self.neutral)

    def coordinate_at(self, share: float) -> float:
        """Return the coordinate at a share of the range."""
        return self.low + share * (self.high - self.low)

    def coordinate_along(self, share: float) -> float:
        """Return the coordinate at a share of the way from neutral to a bound: the lower one if negative."""
        bound = self.high if share > 0.0 else self.low
        return self.neutral + abs(share) * (bound - self.neutral)

    @cached_property
    def share_limits(self) -> tuple[float, float]:
        """How far a fit may go, in ranges: beyond the searched range where the mechanism allows it."""
        ends = []
        for share, outside in ((0.0, -_OUTSIDE), (1.0, _OUTSIDE)):
            value = self.value(self.coordinate_at(share + outside))
            ends.append(share + outside if self.effect.allows(value) else share)
        return ends[0], ends[1]

    def values(self, coordinate: float) -> Values:
        """Return the effect at a coordinate, as a problem file states it."""
        values: dict[str, float | str] = {self.effect.parameter: self.value(coordinate)}
        return values if self.effect.target == "none" else values | {"target": self.target}

    def log_prior(self, coordinate: float) -> float:
        """Return the logarithm of the prior density at a coordinate, up to a constant; at most 0."""
        prior, reference = self._prior
        return prior.log_density(self.value(coordinate), reference)

    @cached_property
    def _prior(self) -> tuple[Prior, float]:  # a fit asks for it some hundred thousand times
        return self.effect.prior_on(self.nominal)

    @property
    def log_target_share(self) -> float:
        """Logarithm of the target's share of the effect's prior probability."""
        kind, channels = self.effect.target, len(self.nominal.channels)
        return {"none": 0.0, "any": -math.log(channels + 1.0), "one": -math.log(channels)}[kind]

    @property
    def measurement_only(self) -> bool:
        """Whether the effect changes only the measurement, so that nothing needs to be simulated."""
        return not self.effect.changes_robot

    def screened(self, settings: FitSettings = FIT) -> list[float]:
        """Return the coordinates at which the hypothesis is tried first, ascending."""
        shares = settings.screened_measurement if self.measurement_only else settings.screened
        return sorted(self._toward_sides(shares))

    def probes(self, settings: FitSettings = FIT) -> list[float]:
        """Return those of them that say whether the others are worth simulating: one on each side."""
        if self.measurement_only:
            return self.screened(settings)
        return self._toward_sides((settings.probe,))

    def _toward_sides(self, shares: Sequence[float]) -> list[float]:
        """Return the coordinates at some shares of the way from neutral to each bound."""
        return [self.neutral + s * (bound - self.neutral) for bound in self.sides for s in shares]

    @property
    def sides(self) -> list[float]:
        """Bounds other than neutral."""
        return [bound for bound in (self.low, self.high) if abs(bound - self.neutral) > 1e-9]

    def at_bound(self, coordinate: float) -> bool:
        """Whether a coordinate lies at a bound other than neutral; nothing was tried beyond it."""
        return any(abs(coordinate - bound) < _AT_BOUND * (self.high - self.low) for bound in self.sides)


def hypotheses(
    nominal: Parts,
    channels: Sequence[str],
    offset_known: bool,
    active: Iterable[str] = (),
    one_clock: bool = False,
) -> list[Hypothesis]:
    """Return every hypothesis that applies to a robot.

    Args:
        nominal: parts of the nominal robot.
        channels: its actuators.
        offset_known: whether any trial says when its recording starts; if none does, the
            clock's offset is fitted for every trial and is no hypothesis.
        active: effects that the problem has switched on already, which are taken as known.
        one_clock: whether recordings and logged commands share a clock, which then has no error.
    """
    known = set(active)
    found = []
    for effect in EFFECTS.values():
        nuisance = effect.shifts_start and not offset_known
        shared = effect.of_clock and one_clock
        fixed = effect.of_free_robot and nominal.on_bench
        if effect.found_in_record or nuisance or shared or fixed or effect.name in known:
            continue
        for target in _targets(effect, channels):
            parts = replace(nominal, target=target)
            if effect.why_not(parts) is None:
                found.append(_hypothesis(effect, target, parts))
    return found


def _targets(effect: Effect, channels: Sequence[str]) -> list[str]:
    if effect.target == "none" or len(channels) == 1:
        return [ALL] if effect.target != "one" else []  # what one of one servos does, all of them do
    return [*([ALL] if effect.target == "any" else []), *channels]


def _hypothesis(effect: Effect, target: str, parts: Parts) -> Hypothesis:
    low, high = effect.bounds(parts)
    neutral = effect.neutral_value(parts)
    if effect.scale == "log":
        low, high = math.log(low), math.log(high)
        neutral = math.log(neutral) if neutral > 0.0 else -math.inf
    return Hypothesis(effect, target, low, high, min(max(neutral, low), high), parts)
