"""Speed against cost of transport: which gaits no other gait beats in both."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gaitopt.optimise.journal import Entry
from gaitopt.optimise.verification import Verified
from gaitopt.simulation.metrics import SPEED

_OUT_OF_REACH = 1e3
"""Value of a gait that violates a limit, before the size of the violation is added: worse than any that
keeps every limit."""

Aim = Callable[[Entry], float]
"""What a search of the front minimises."""


@dataclass(frozen=True)
class FrontSettings:
    """How the front is searched.

    Attributes:
        share: share of the budget that goes to the front. The rest searches for the best gait first, as
            without a front.
        levels: limits of the cost of transport; the fastest gait under each is searched.
        shown: gaits of the front that are verified, at most.
        spread: length of the first steps, from the best known gait, in units of the box.
    """

    share: float = 0.5
    levels: int = 3
    shown: int = 6
    spread: float = 0.1


@dataclass(frozen=True)
class FrontGait:
    """A gait of the front.

    Attributes:
        entry: the gait as the search saw it.
        verified: the gait as verified.
        efficient: whether it is still on the front when verified.
    """

    entry: Entry
    verified: Verified
    efficient: bool


def speed(entry: Entry) -> float:
    """Return the mean speed of a gait, m/s."""
    return entry.evaluation.metrics[SPEED.name]


def transport(entry: Entry) -> float:
    """Return the mean cost of transport of a gait."""
    return entry.evaluation.metrics["cost_of_transport"]


def cheapest(entry: Entry) -> float:
    """Aim: the lowest cost of transport."""
    return _within(entry, transport(entry))


def fastest_within(limit: float) -> Aim:
    """Return the aim of the highest speed at a cost of transport of at most `limit`."""

    def aim(entry: Entry) -> float:
        excess = max(0.0, transport(entry) / limit - 1.0)
        return _within(entry, -speed(entry), excess)

    return aim


def limits(entries: Sequence[Entry], levels: int = FrontSettings.levels) -> list[float]:
    """Return limits of the cost of transport between those of the cheapest and of the fastest gait.

    Each is larger than the one before by the same ratio. Fewer than two gaits on the front give none.
    """
    front = front_of(entries)
    if len(front) < 2:
        return []
    ratio = transport(front[-1]) / transport(front[0])
    return [transport(front[0]) * ratio ** ((i + 1) / (levels + 1)) for i in range(levels)]


def front_of(entries: Sequence[Entry]) -> list[Entry]:
    """Return the gaits that keep every limit and that no other such gait beats, slowest first."""
    able = [e for e in entries if e.evaluation.constraints_met and speed(e) > 0.0 and transport(e) < math.inf]
    kept = efficient([speed(e) for e in able], [transport(e) for e in able])
    return sorted((e for e, keep in zip(able, kept, strict=True) if keep), key=speed)


def efficient(speeds: Sequence[float], costs: Sequence[float]) -> list[bool]:
    """Return which gaits no other gait beats, that is, is as fast and as cheap and better in one of both.

    Of equal gaits the first counts.
    """
    order = sorted(range(len(speeds)), key=lambda i: (-speeds[i], costs[i], i))
    kept, lowest = [False] * len(speeds), math.inf
    for i in order:
        if costs[i] < lowest:
            kept[i], lowest = True, costs[i]
    return kept


def thinned(front: Sequence[Entry], count: int = FrontSettings.shown) -> list[Entry]:
    """Return at most `count` gaits, spread evenly along the front, its ends among them."""
    if len(front) <= count:
        return list(front)
    costs = np.log([transport(entry) for entry in front])
    speeds = np.array([speed(entry) for entry in front])
    steps = np.hypot(np.diff(costs) / np.ptp(costs), np.diff(speeds) / np.ptp(speeds))
    along = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.linspace(0.0, along[-1], count)
    chosen = {int(np.abs(along - place).argmin()) for place in wanted}
    return [front[i] for i in sorted(chosen)]


def verified_front(entries: Sequence[Entry], verified: Sequence[Verified]) -> list[FrontGait]:
    """Return gaits of the front as the search saw them and as verified in scenarios that it did not see."""
    met = [v.evaluation.constraints_met for v in verified]
    costs = [v.evaluation.metrics["cost_of_transport"] for v in verified]
    able = [i for i, ok in enumerate(met) if ok and math.isfinite(costs[i])]
    kept = efficient([verified[i].speed for i in able], [costs[i] for i in able])
    still = {i for i, keep in zip(able, kept, strict=True) if keep}
    pairs = enumerate(zip(entries, verified, strict=True))
    return [FrontGait(entry, found, i in still) for i, (entry, found) in pairs]


def _within(entry: Entry, value: float, excess: float = 0.0) -> float:
    """Return `value` of a gait that keeps every limit, else how far it is from that."""
    if entry.evaluation.status != "ok":
        return 1e3 * _OUT_OF_REACH
    beyond = sum(entry.evaluation.violations.values()) + excess
    if beyond > 0.0 or not math.isfinite(value):
        return _OUT_OF_REACH + min(beyond, _OUT_OF_REACH)
    return value
