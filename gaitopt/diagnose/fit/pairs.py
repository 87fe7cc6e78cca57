"""Fits of two effects together.

Which two is found in three ways: by adding up what each changes alone, at every size simulated; by simulating
every effect on top of the best one, since with that the others may do something else than without; and by
putting effects of like signature in the place of either of the best two. The most promising pairs are fitted
by Gauss and Newton, with slopes measured where the pair is, and more of them while none comes near to what a
right one leaves. What does the same as one of the best pair is fitted from there in the end, so that a set
says what these trials cannot tell apart.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.fitting import ALIKE, Comparison, Count, Fit, Note, TrialSet, simulate

Array = NDArray[np.float64]

_REFINED = 300
_TURNS = 3
_SUMS = 16
"""How many sums are moved to where they are least, how often, and how many of these are simulated."""

_PAIRS = 8
_BATCHES = 3
_RIGHT = 2.0
"""How many pairs are fitted at a time, and how often while the best leaves so many times what is right."""

_ROUNDS = ((8, False), (4, True), (4, False), (3, True), (3, False), (2, False))
"""How many pairs are fitted further, round by round, and whether their slopes are measured anew before."""

_TARGETS = 2
"""How many pairs of the same two effects, on other targets, may be among them."""

_TWINS = 8
_TWIN_ROUNDS = ((4, False), (3, True), (3, False), (2, True), (2, False))
"""How many effects are tried in the place of one of the best two, and the rounds of these pairs."""

_SUBSTITUTES = 4
_BESIDE_ROUNDS = ((4, True), (4, False), (4, True), (4, False))
"""How many are fitted again from where the best pair is, and the rounds of these."""

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


@dataclass(eq=False)
class PairFit:
    """Two hypotheses together.

    Attributes:
        fits: their single fits.
        points: simulated pairs.
        slopes: change of the whitened residual with each coordinate, shape (rows, 2).
        farthest: share of a range that the next step may go at most.
    """

    fits: tuple[Fit, Fit]
    comparisons: list[Comparison]
    slopes: Array
    farthest: float = _FARTHEST

    @property
    def names(self) -> list[str]:
        """The two effects."""
        return [fit.hypothesis.effect.name for fit in self.fits]

    def on(self, trial_set: TrialSet) -> PairFit:
        """Return the pair as another trial_set of the same trials sees it."""
        one, other = self.fits
        before = one.trial_set
        points = [trial_set.rewhiten_comparison(point, before) for point in self.comparisons]
        slopes = trial_set.rewhiten(self.slopes, before)
        return PairFit((one.on(trial_set), other.on(trial_set)), points, slopes, self.farthest)

    def best(self, weights: Array | None = None) -> Comparison:
        """Return the simulated pair of the least loss, blocks weighted."""
        return min(self.comparisons, key=lambda point: self._loss(point, weights))

    def _loss(self, point: Comparison, weights: Array | None) -> float:
        losses = self.fits[0].trial_set.losses(point.whitened, point.whitened)
        return float(losses.sum() if weights is None else weights @ losses)

    def step(self, weights: Array | None = None) -> Array:
        """Return the Gauss–Newton step from the best point, each coordinate's, blocks weighted."""
        point = self.best(weights)
        trial_set = self.fits[0].trial_set
        by_row = np.ones(len(point.whitened)) if weights is None else weights[trial_set.blocks]
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


def fit_pairs(fits: Sequence[Fit], nominal: Comparison, executor: Executor, note: Note) -> list[PairFit]:
    """Fit the pairs that look best.

    Args:
        fits: the single fits.
        nominal: the trials beside the nominal robot.
        executor: where robots are simulated.
        note: called as it goes.
    """
    count = Count("fitting pairs of effects", note)
    pairs = _searched(fits, nominal, executor, count)
    if not pairs:
        return pairs
    best = min(pairs, key=_least)
    twins = _kept(_begun(_twins(best, fits, nominal, _near(pairs)), executor, count), _PAIRS)
    _improve(twins, _TWIN_ROUNDS, executor, count)
    pairs += twins
    for _ in range(_PROBES):
        _probe(sorted(pairs, key=_least)[: _PROBED_ROUNDS[0][0]], executor, count)
        _improve(pairs, _PROBED_ROUNDS, executor, count)
    pairs += _beside(pairs, fits, nominal, executor, count)
    _leave_out(pairs, executor, count)
    return pairs


def _searched(fits: Sequence[Fit], nominal: Comparison, executor: Executor, count: Count) -> list[PairFit]:
    """Fit the most promising pairs, and as many more while what the best leaves is far from right."""
    begun, pairs = _begun(_starts(fits, nominal), executor, count), list[PairFit]()
    for _ in range(_BATCHES):
        batch = _kept(begun, _PAIRS, pairs)
        _improve(batch, _ROUNDS, executor, count)
        pairs += batch
        if not batch or min(map(_least, pairs)) <= _RIGHT * len(nominal.whitened):
            break
    return pairs


def _kept(pairs: Sequence[PairFit], most: int, before: Sequence[PairFit] = ()) -> list[PairFit]:
    """Return the most promising pairs not kept before, few of the same effects on other targets."""
    ordered = [pair for pair in sorted(pairs, key=_promised) if pair not in before]
    chosen = _few_alike([pair.fits for pair in ordered], most, [pair.fits for pair in before])
    return [ordered[i] for i in chosen]


def _few_alike(
    pairs: Sequence[tuple[Fit, Fit]], most: int, before: Sequence[tuple[Fit, Fit]] = ()
) -> list[int]:
    """Return which pairs come first, at most `_TARGETS` of the same effects, those before counted in."""
    alike = Counter(_effects(pair) for pair in before)
    chosen: list[int] = []
    for index, pair in enumerate(pairs):
        if alike[_effects(pair)] < _TARGETS and len(chosen) < most:
            alike[_effects(pair)] += 1
            chosen.append(index)
    return chosen


def _effects(pair: tuple[Fit, Fit]) -> frozenset[str]:
    return frozenset(fit.hypothesis.effect.name for fit in pair)


def _hypotheses(pair: tuple[Fit, Fit]) -> frozenset[str]:
    return frozenset(fit.hypothesis.name for fit in pair)


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


def _starts(fits: Sequence[Fit], nominal: Comparison) -> list[Start]:
    """Return the sums that look best, and every other effect on top of the best one."""
    found = {_hypotheses((one, other)): (one, other, at) for one, other, at in _promising(fits, nominal)}
    best = min(fits, key=lambda fit: float(fit.loss().sum()))
    for fit in fits:
        names = _hypotheses((best, fit))
        if fit.hypothesis.effect.name != best.hypothesis.effect.name and names not in found:
            _, at = _least_added(best.between("whitened"), fit, nominal)
            found[names] = (best, fit, np.array([best.best(), at]))
    return list(found.values())


def _twins(pair: PairFit, fits: Sequence[Fit], nominal: Comparison, near: Sequence[PairFit]) -> list[Start]:
    """Return each effect that does much the same as one of a pair, beside the other, if not near yet."""
    known = {_hypotheses(other.fits) for other in near}
    found: list[tuple[float, Start]] = []
    for index, one in enumerate(pair.fits):
        stays = pair.fits[1 - index]
        at = float(pair.best().at[1 - index])
        if len(stays.comparisons) < 2:
            continue
        remaining, _ = _line(stays, at)
        for fit in fits:
            same = fit.hypothesis.effect.name in pair.names
            if not same and _hypotheses((stays, fit)) not in known and one.alike(fit) >= ALIKE:
                least, other = _least_added(remaining, fit, nominal)
                found.append((least, (stays, fit, np.array([at, other]))))
    found.sort(key=lambda entry: entry[0])
    return [start for _, start in found[:_TWINS]]


def _beside(
    pairs: Sequence[PairFit], fits: Sequence[Fit], nominal: Comparison, executor: Executor, count: Count
) -> list[PairFit]:
    """Fit what does the same as one of the best pair from where that pair is; return the pairs that are new.

    So two valleys of like shape are compared at their floors, not the floor of one with a slope of the other.
    """
    known = {_hypotheses(pair.fits): pair for pair in pairs}
    work = []
    for one, other, at in _substitutes(min(pairs, key=_least), fits, nominal):
        new = PairFit((one, other), [], np.zeros((len(nominal.whitened), 2)))
        pair = known.get(_hypotheses((one, other)), new)
        work.append((pair, at if pair.fits[0] is one else at[::-1]))
    begun = _simulated(work, executor, count)
    for pair, point in begun:
        pair.comparisons.append(point)
    found = [pair for pair, _ in begun]
    _improve(found, _BESIDE_ROUNDS, executor, count)
    return [pair for pair in found if pair not in pairs]


def _substitutes(pair: PairFit, fits: Sequence[Fit], nominal: Comparison) -> list[Start]:
    """Return the effects that come near to what one of a pair does where it is, beside the other."""
    found: list[tuple[float, Start]] = []
    for index, one in enumerate(pair.fits):
        stays, at = pair.fits[1 - index], pair.best().at
        if len(one.comparisons) < 2:
            continue
        change = _line(one, float(at[index]))[0] - nominal.whitened
        for fit in fits:
            apart, there = _least_added(-change, fit, nominal)
            same = fit.hypothesis.effect.name in pair.names
            if not same and apart <= (1.0 - ALIKE**2) * float(change @ change):
                found.append((apart, (stays, fit, np.array([at[1 - index], there]))))
    found.sort(key=lambda entry: entry[0])
    return [start for _, start in found[:_SUBSTITUTES]]


def _line(fit: Fit, at: float) -> tuple[Array, Array]:
    """Return the whitened residual of a fit at a coordinate, between the robots simulated, and its slope."""
    known = np.array([float(p.at[0]) for p in fit.comparisons])
    right = int(np.clip(np.searchsorted(known, at), 1, len(known) - 1))
    low, high = fit.comparisons[right - 1], fit.comparisons[right]
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
        work.append((PairFit((one, other), [], np.empty((len(one.comparisons[0].whitened), 2))), at))
    begun = []
    for pair, point in _simulated(work, executor, count):
        one, other = pair.fits
        alone, pair.slopes[:, 0] = _line(one, float(point.at[0]))
        pair.slopes[:, 1] = (point.whitened - alone) / (point.at[1] - other.hypothesis.neutral)
        pair.comparisons.append(point)
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
) -> list[tuple[PairFit, Comparison]]:
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
        pair.comparisons.append(point)
        pair.farthest = _FARTHEST


def _probe(pairs: Sequence[PairFit], executor: Executor, count: Count) -> None:
    """Judgement a good way off along each coordinate of pairs: a jagged response has more than one valley."""
    work = []
    for pair in pairs:
        for way in np.concatenate([np.diag(pair.spans), -np.diag(pair.spans)]):
            at = pair.within(pair.best().at + _PROBED * way)
            if not np.array_equal(at, pair.best().at):
                work.append((pair, at))
    for pair, point in _simulated(work, executor, count):
        pair.comparisons.append(point)


def _leave_out(pairs: Sequence[PairFit], executor: Executor, count: Count) -> None:
    """Simulate the pairs that may count where they fit best without each of the folds.

    Slopes do not tell what such a pair foretells of a gait that it has not seen: fast ones are not even.
    """
    work = [
        (pair, pair.best(weights).at + pair.step(weights))
        for pair in _near(pairs)
        for _, weights in pair.fits[0].trial_set.left_out
    ]
    for pair, point in _simulated(work, executor, count):
        pair.comparisons.append(point)


def _promising(fits: Sequence[Fit], nominal: Comparison) -> list[Start]:
    """Return the best sums of two changes, few of the same effects: both fits and the coordinates.

    Each set that was simulated of one effect is added to each of another, not only those that fit best alone:
    beside another effect the best may be elsewhere.
    """
    tried = [fit for fit in fits if len(fit.comparisons) > 1]
    sums = sorted(_sums(tried, nominal), key=lambda entry: entry[0])[:_REFINED]
    found = [_refined(start, nominal) for _, start in sums]
    found.sort(key=lambda entry: entry[0])
    starts = [start for _, start in found]
    return [starts[i] for i in _few_alike([(one, other) for one, other, _ in starts], _SUMS)]


def _sums(fits: Sequence[Fit], nominal: Comparison) -> list[tuple[float, Start]]:
    """Return, for each two effects, the least loss of a sum of sets that were simulated, and the sets."""
    changes = np.stack([point.whitened - nominal.whitened for fit in fits for point in fit.comparisons])
    products = changes @ changes.T
    alone = np.diag(products) + 2.0 * changes @ nominal.whitened
    losses = float(nominal.whitened @ nominal.whitened) + alone[:, None] + alone + 2.0 * products
    ends = np.cumsum([0, *(len(fit.comparisons) for fit in fits)])
    found = []
    for (i, one), (j, other) in combinations(enumerate(fits), 2):
        if one.hypothesis.effect.name != other.hypothesis.effect.name:
            block = losses[ends[i] : ends[i + 1], ends[j] : ends[j + 1]]
            least = np.unravel_index(int(np.argmin(block)), block.shape)
            at = [float(fit.comparisons[k].at[0]) for fit, k in zip((one, other), least, strict=True)]
            found.append((float(block[least]), (one, other, np.array(at))))
    return found


def _refined(start: Start, nominal: Comparison) -> tuple[float, Start]:
    """Return the loss of a sum, and its coordinates, each in turn moved to where the sum is least."""
    one, other, (here, there) = start
    for _ in range(_TURNS):
        _, there = _least_added(_line(one, here)[0], other, nominal)
        least, here = _least_added(_line(other, there)[0], one, nominal)
    return least, (one, other, np.array([here, there]))


def _least_added(remaining: Array, fit: Fit, nominal: Comparison) -> tuple[float, float]:
    """Return the least loss, and its coordinate, when a fit's change is added to a residual."""
    best, at = float(remaining @ remaining), fit.hypothesis.neutral
    for low, high in zip(fit.comparisons[:-1], fit.comparisons[1:], strict=True):
        begin = remaining + low.whitened - nominal.whitened
        along = high.whitened - low.whitened
        share = float(np.clip(-(begin @ along) / max(float(along @ along), 1e-12), 0.0, 1.0))
        moved = begin + share * along
        loss = float(moved @ moved)
        if loss < best:
            best, at = loss, float(low.at[0] + share * (high.at[0] - low.at[0]))
    return best, at


def _simulate_pair(pair: PairFit, at: Array) -> Comparison | None:
    effects, observed = {}, True
    for fit, coordinate in zip(pair.fits, at.tolist(), strict=True):
        effects[fit.hypothesis.effect.name] = fit.hypothesis.values(coordinate)
        observed = observed and fit.observed
    return simulate(pair.fits[0].trial_set, effects, at.tolist(), observed)


def _learn(pair: PairFit, point: Comparison) -> None:
    """Take in a simulated pair, correct slopes by it as Broyden does; go less far if it is worse."""
    before = pair.best()
    moved = (point.at - before.at) / pair.spans
    size = float(moved @ moved)
    if size > 1e-10:
        scaled = pair.slopes * pair.spans
        missed = point.whitened - before.whitened - scaled @ moved
        pair.slopes = (scaled + np.outer(missed, moved) / size) / pair.spans
    pair.comparisons.append(point)
    if pair.best() is before:
        pair.farthest = 0.5 * min(pair.farthest, float(np.abs(moved).max()))
