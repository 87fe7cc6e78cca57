"""Fits of two effects together.

Which two is found in three ways: by adding up what each changes alone; by simulating every effect on top of
the best one, since with that the others may do something else than without; and by putting effects of like
signature in the place of either of the best two. The most promising pairs are fitted by Gauss and Newton,
with slopes measured where the pair is.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fitting import ALIKE, Bench, Count, Fit, Note, Point, simulate

Array = NDArray[np.float64]

_FIRSTS = 8
_PAIRS = 8
_ROUNDS = ((8, False), (4, True), (4, False), (3, True), (3, False), (2, False))
"""How many pairs are fitted further, round by round, and whether their slopes are measured anew before."""

_TARGETS = 2
"""How many pairs of the same two effects, on other targets, may be among them."""

_TWINS = 8
_TWIN_ROUNDS = ((4, False), (3, True), (3, False), (2, True), (2, False))
"""How many effects are tried in the place of one of the best two, and the rounds of these pairs."""

_PROBES = 2
_PROBED = 0.15
_PROBED_ROUNDS = ((2, True), (2, False))
"""How often, and how far off, in ranges, the best are probed at last, and the rounds after each time."""

_FARTHEST = 0.3
"""Share of a range that one step may go at most; halved where that was no step down."""

_DIFFERENCE = 0.02
"""Share of a range over which a slope is measured."""

_HOPELESS = 4.0
"""A pair that leaves so many times the least loss is not near, and need not be fitted without each fold."""

Start = tuple[Fit, Fit, Array]
"""Two fits, and the coordinates at which they are tried together."""


@dataclass
class PairFit:
    """Two hypotheses together.

    Attributes:
        fits: their single fits.
        points: simulated pairs.
        slopes: change of the whitened residual with each coordinate, shape (rows, 2).
        farthest: share of a range that the next step may go at most.
    """

    fits: tuple[Fit, Fit]
    points: list[Point]
    slopes: Array
    farthest: float = _FARTHEST

    @property
    def names(self) -> list[str]:
        """The two effects."""
        return [fit.hypothesis.effect.name for fit in self.fits]

    def on(self, bench: Bench) -> PairFit:
        """Return the pair as another bench of the same trials sees it."""
        one, other = self.fits
        before = one.bench
        points = [bench.seen(point, before) for point in self.points]
        slopes = bench.rewhitened(self.slopes, before)
        return PairFit((one.on(bench), other.on(bench)), points, slopes, self.farthest)

    def best(self, weights: Array | None = None) -> Point:
        """Return the simulated pair of the least loss, blocks weighted."""
        return min(self.points, key=lambda point: self._loss(point, weights))

    def _loss(self, point: Point, weights: Array | None) -> float:
        losses = self.fits[0].bench.losses(point.whitened, point.whitened)
        return float(losses.sum() if weights is None else weights @ losses)

    def step(self, weights: Array | None = None) -> Array:
        """Return the Gauss–Newton step from the best point, each coordinate's, blocks weighted."""
        point = self.best(weights)
        bench = self.fits[0].bench
        by_row = np.ones(len(point.whitened)) if weights is None else weights[bench.blocks]
        root = np.sqrt(by_row)[:, None]
        step, *_ = np.linalg.lstsq(root * self.slopes, -root[:, 0] * point.whitened, rcond=None)
        step *= min(1.0, self.farthest / max(float(np.abs(step / self.spans).max()), 1e-9))
        wanted: Array = self.within(point.at + step) - point.at
        return wanted

    def within(self, at: Array) -> Array:
        """Return the nearest coordinates inside the ranges."""
        inside: Array = np.clip(at, self._ends(0), self._ends(1))
        return inside

    @property
    def spans(self) -> Array:
        """Length of each coordinate's range."""
        return self._ends(1) - self._ends(0)

    def _ends(self, side: int) -> Array:
        return np.array([(fit.hypothesis.low, fit.hypothesis.high)[side] for fit in self.fits])


def fit_pairs(
    fits: Sequence[Fit], nominal: Point, executor: Executor, note: Note, measured: bool = False
) -> list[PairFit]:
    """Fit the pairs that look best.

    Args:
        fits: the single fits.
        nominal: the trials beside the nominal robot.
        executor: where robots are simulated.
        note: called as it goes.
        measured: whether one of the two must be an effect on the measurement, not on the robot.
    """
    count = Count("fitting pairs of effects", note)
    starts = [s for s in _starts(fits, nominal) if not measured or s[0].observed or s[1].observed]
    pairs = _kept(_begun(starts, executor, count), _PAIRS)
    _improve(pairs, _ROUNDS, executor, count)
    if pairs:
        best = min(pairs, key=_least)
        starts = [] if measured else _twins(best, fits, nominal, _near(pairs))
        twins = _kept(_begun(starts, executor, count), _PAIRS)
        _improve(twins, _TWIN_ROUNDS, executor, count)
        pairs += twins
    for _ in range(_PROBES):
        _probe(sorted(pairs, key=_least)[: _PROBED_ROUNDS[0][0]], executor, count)
        _improve(pairs, _PROBED_ROUNDS, executor, count)
    _leave_out(pairs, executor, count)
    return pairs


def _kept(pairs: Sequence[PairFit], most: int) -> list[PairFit]:
    """Return the most promising pairs, few of the same effects on other targets."""
    kept: list[PairFit] = []
    for pair in sorted(pairs, key=_promised):
        alike = sum(set(other.names) == set(pair.names) for other in kept)
        if alike < _TARGETS and len(kept) < most:
            kept.append(pair)
    return kept


def _improve(
    pairs: Sequence[PairFit], rounds: Sequence[tuple[int, bool]], executor: Executor, count: Count
) -> None:
    """Fit the best of some pairs further, round by round."""
    for most, fresh in rounds:
        leading = sorted(pairs, key=_least)[:most]
        if fresh:
            _measure_slopes(leading, executor, count)
        work = [(pair, pair.best().at + pair.step()) for pair in leading]
        for pair, point in _simulated(work, executor, count):
            _learn(pair, point)


def _starts(fits: Sequence[Fit], nominal: Point) -> list[Start]:
    """Return the sums that look best, and every other effect on top of the best one."""
    found = {
        (one.hypothesis.name, other.hypothesis.name): (one, other, at)
        for one, other, at in _promising(fits, nominal)
    }
    best = min(fits, key=lambda fit: float(fit.loss().sum()))
    for fit in fits:
        names = (best.hypothesis.name, fit.hypothesis.name)
        if fit.hypothesis.effect.name != best.hypothesis.effect.name and names not in found:
            _, at = _least_added(best.between("whitened"), fit, nominal)
            found[names] = (best, fit, np.array([best.best(), at]))
    return list(found.values())


def _twins(pair: PairFit, fits: Sequence[Fit], nominal: Point, near: Sequence[PairFit]) -> list[Start]:
    """Return each effect that does much the same as one of a pair, beside the other, if not near yet."""
    known = {frozenset(fit.hypothesis.name for fit in other.fits) for other in near}
    found: list[tuple[float, Start]] = []
    for index, one in enumerate(pair.fits):
        stays = pair.fits[1 - index]
        at = float(pair.best().at[1 - index])
        if len(stays.points) < 2:
            continue
        remaining, _ = _line(stays, at)
        for fit in fits:
            names = frozenset((stays.hypothesis.name, fit.hypothesis.name))
            same = fit.hypothesis.effect.name in pair.names
            if not same and names not in known and one.alike(fit) >= ALIKE:
                least, other = _least_added(remaining, fit, nominal)
                found.append((least, (stays, fit, np.array([at, other]))))
    found.sort(key=lambda entry: entry[0])
    return [start for _, start in found[:_TWINS]]


def _line(fit: Fit, at: float) -> tuple[Array, Array]:
    """Return the whitened residual of a fit at a coordinate, between the robots simulated, and its slope."""
    known = np.array([float(p.at[0]) for p in fit.points])
    right = int(np.clip(np.searchsorted(known, at), 1, len(known) - 1))
    low, high = fit.points[right - 1], fit.points[right]
    gap = known[right] - known[right - 1]
    share = (at - known[right - 1]) / gap
    mixed: Array = (1.0 - share) * low.whitened + share * high.whitened
    slope: Array = (high.whitened - low.whitened) / gap
    return mixed, slope


def _screened(fit: Fit) -> float:
    """Return where an effect is tried on top of another, if not where both added up look best."""
    h = fit.hypothesis
    return min(h.screened, key=lambda at: abs(abs(at - h.neutral) - (h.high - h.low) / 6.0))


def _begun(starts: Sequence[Start], executor: Executor, count: Count) -> list[PairFit]:
    """Simulate each pair once, and take its slopes from that."""
    work = []
    for one, other, at in starts:
        if abs(at[1] - other.hypothesis.neutral) < 1e-9:
            at = np.array([at[0], _screened(other)])
        work.append((PairFit((one, other), [], np.empty((len(one.points[0].whitened), 2))), at))
    begun = []
    for pair, point in _simulated(work, executor, count):
        one, other = pair.fits
        alone, pair.slopes[:, 0] = _line(one, float(point.at[0]))
        pair.slopes[:, 1] = (point.whitened - alone) / (point.at[1] - other.hypothesis.neutral)
        pair.points.append(point)
        begun.append(pair)
    return begun


def _promised(pair: PairFit) -> float:
    """Return the loss that the next step promises."""
    left = pair.best().whitened + pair.slopes @ pair.step()
    return float(left @ left)


def _least(pair: PairFit) -> float:
    return float(np.sum(pair.best().whitened ** 2))


def _near(pairs: Sequence[PairFit]) -> list[PairFit]:
    """Return the pairs that do not leave many times what the best one leaves."""
    limit = _HOPELESS * min((_least(pair) for pair in pairs), default=0.0)
    return [pair for pair in pairs if _least(pair) <= limit]


def _simulated(
    work: Sequence[tuple[PairFit, Array]], executor: Executor, count: Count
) -> list[tuple[PairFit, Point]]:
    """Return each pair with its simulation at some coordinates, those left out that failed."""
    count.add(0, len(work))
    futures = [(pair, executor.submit(_simulate_pair, pair, at)) for pair, at in work]
    found = []
    for pair, future in futures:
        point = future.result()
        count.add(1, 0)
        if point is not None:
            found.append((pair, point))
    return found


def _measure_slopes(pairs: Sequence[PairFit], executor: Executor, count: Count) -> None:
    """Measure the slopes of pairs at their best points: with another effect, or far off, they are others."""
    bests = {id(pair): pair.best() for pair in pairs}
    work = []
    for pair in pairs:
        for index, fit in enumerate(pair.fits):
            h, at = fit.hypothesis, bests[id(pair)].at.copy()
            size = _DIFFERENCE * (h.high - h.low)
            at[index] += size if at[index] + size <= h.high else -size
            work.append((pair, at))
    for pair, point in _simulated(work, executor, count):
        best = bests[id(pair)]
        moved = point.at - best.at
        index = int(np.argmax(np.abs(moved)))
        pair.slopes[:, index] = (point.whitened - best.whitened) / moved[index]
        pair.points.append(point)
        pair.farthest = _FARTHEST


def _probe(pairs: Sequence[PairFit], executor: Executor, count: Count) -> None:
    """Look a good way off along each coordinate of pairs: a jagged response has more than one valley."""
    work = []
    for pair in pairs:
        for way in np.concatenate([np.diag(pair.spans), -np.diag(pair.spans)]):
            at = pair.within(pair.best().at + _PROBED * way)
            if not np.array_equal(at, pair.best().at):
                work.append((pair, at))
    for pair, point in _simulated(work, executor, count):
        pair.points.append(point)


def _leave_out(pairs: Sequence[PairFit], executor: Executor, count: Count) -> None:
    """Simulate the pairs that may count where they fit best without each of the folds.

    Slopes do not tell what such a pair foretells of a gait that it has not seen: fast ones are not even.
    """
    work = [
        (pair, pair.best(weights).at + pair.step(weights))
        for pair in _near(pairs)
        for _, weights in pair.fits[0].bench.left_out
    ]
    for pair, point in _simulated(work, executor, count):
        pair.points.append(point)


def _promising(fits: Sequence[Fit], nominal: Point) -> list[Start]:
    """Return the best sums of two changes: both fits and the coordinates."""
    ordered = sorted(fits, key=lambda fit: float(fit.loss().sum()))[: 2 * _FIRSTS]
    found: dict[tuple[str, str], tuple[float, Fit, Fit, Array]] = {}
    for first in ordered[:_FIRSTS]:
        remaining = first.between("whitened")
        for second in fits:
            if second.hypothesis.effect.name == first.hypothesis.effect.name:
                continue
            least, at = _least_added(remaining, second, nominal)
            names = sorted((first.hypothesis.name, second.hypothesis.name))
            key = (names[0], names[1])
            if key not in found or least < found[key][0]:
                found[key] = (least, first, second, np.array([first.best(), at]))
    best = sorted(found.values(), key=lambda entry: entry[0])[:_PAIRS]
    return [(one, other, at) for _, one, other, at in best]


def _least_added(remaining: Array, fit: Fit, nominal: Point) -> tuple[float, float]:
    """Return the least loss, and its coordinate, when a fit's change is added to a residual."""
    best, at = float(remaining @ remaining), fit.hypothesis.neutral
    for low, high in zip(fit.points[:-1], fit.points[1:], strict=True):
        begin = remaining + low.whitened - nominal.whitened
        along = high.whitened - low.whitened
        share = float(np.clip(-(begin @ along) / max(float(along @ along), 1e-12), 0.0, 1.0))
        moved = begin + share * along
        loss = float(moved @ moved)
        if loss < best:
            best, at = loss, float(low.at[0] + share * (high.at[0] - low.at[0]))
    return best, at


def _simulate_pair(pair: PairFit, at: Array) -> Point | None:
    effects, observed = {}, True
    for fit, coordinate in zip(pair.fits, at.tolist(), strict=True):
        effects[fit.hypothesis.effect.name] = fit.hypothesis.values(coordinate)
        observed = observed and fit.observed
    return simulate(pair.fits[0].bench, effects, at.tolist(), observed)


def _learn(pair: PairFit, point: Point) -> None:
    """Take in a simulated pair, correct slopes by it as Broyden does; go less far if it is worse."""
    before = pair.best()
    moved = (point.at - before.at) / pair.spans
    size = float(moved @ moved)
    if size > 1e-10:
        scaled = pair.slopes * pair.spans
        missed = point.whitened - before.whitened - scaled @ moved
        pair.slopes = (scaled + np.outer(missed, moved) / size) / pair.spans
    pair.points.append(point)
    if pair.best() is before:
        pair.farthest = 0.5 * min(pair.farthest, float(np.abs(moved).max()))
