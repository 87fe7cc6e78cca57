"""The search for two effects that together explain the trials.

Pairs are found in three ways. The changes of two single effects are added up, at every simulated size. Every
effect is simulated on top of the best single one, because it may act differently there. Effects with a
similar signature take the place of either of the best two. The most promising pairs are fitted by
Gauss–Newton with slopes measured at the pair; more pairs follow while none leaves little. At the end, effects
that act like one of the best pair are fitted from there. So the answer names all effects that these trials
cannot tell apart.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.pair import PairFit, hypothesis_names
from gaitopt.diagnose.fit.pair_sums import Start, few_alike, least_added, promising_sums
from gaitopt.diagnose.fit.runner import Compare
from gaitopt.diagnose.fit.settings import PAIRS, PairRound, PairSettings
from gaitopt.diagnose.fit.single import Fit
from gaitopt.diagnose.fit.trials import Comparison

Array = NDArray[np.float64]
Work = list[tuple[PairFit, Array]]
"""Pairs, and the coordinates at which each is to be simulated, shape (2,)."""


class PairSearch:
    """Looks for the pairs of effects that leave least.

    Attributes:
        fits: the single fits.
        nominal: the trials compared with the nominal robot.
        compare: compares trials with robots.
        settings: how pairs are chosen and fitted.
    """

    def __init__(
        self,
        fits: Sequence[Fit],
        nominal: Comparison,
        compare: Compare,
        settings: PairSettings = PAIRS,
    ):
        self.fits, self.nominal, self.compare, self.settings = fits, nominal, compare, settings

    def run(self) -> list[PairFit]:
        """Return the pairs that look best, fitted; none where no pair can be simulated."""
        pairs = self.fit_batches()
        if not pairs:
            return pairs
        twins = self.keep(self._begun(self.twins(min(pairs, key=_loss), self._near(pairs))))
        self._improve(twins, self.settings.twin_rounds)
        pairs += twins
        for _ in range(self.settings.probes):
            self._probe(sorted(pairs, key=_loss)[: self.settings.probe_rounds[0].pairs])
            self._improve(pairs, self.settings.probe_rounds)
        pairs += self.fit_substitutes(pairs)
        self._fit_without_folds(pairs)
        return pairs

    def fit_batches(self) -> list[PairFit]:
        """Return the most promising pairs, fitted: batch after batch while the best leaves too much."""
        settings = self.settings
        begun, pairs = self._begun(self.starts()), list[PairFit]()
        for _ in range(settings.batches):
            batch = self.keep(begun, pairs)
            self._improve(batch, settings.rounds)
            pairs += batch
            if not batch or min(map(_loss, pairs)) <= settings.right * len(self.nominal.whitened):
                break
        return pairs

    def keep(self, pairs: Sequence[PairFit], before: Sequence[PairFit] = ()) -> list[PairFit]:
        """Return the most promising pairs that are not kept before, few of the same effects."""
        ordered = [pair for pair in sorted(pairs, key=lambda pair: pair.expected_loss) if pair not in before]
        fits, kept = [pair.fits for pair in ordered], [pair.fits for pair in before]
        chosen = few_alike(fits, self.settings.per_batch, self.settings.targets, kept)
        return [ordered[i] for i in chosen]

    def starts(self) -> list[Start]:
        """Return the sums that look best, and every other effect on top of the best single one."""
        sums = promising_sums(self.fits, self.nominal, self.settings)
        found = {hypothesis_names(start.fits): start for start in sums}
        best = min(self.fits, key=lambda fit: float(fit.loss().sum()))
        for fit in self.fits:
            names = hypothesis_names((best, fit))
            if fit.hypothesis.effect.name != best.hypothesis.effect.name and names not in found:
                _, at = least_added(best.at_best("whitened"), fit, self.nominal)
                found[names] = Start(best, fit, np.array([best.best(), at]))
        return list(found.values())

    def twins(self, pair: PairFit, near: Sequence[PairFit]) -> list[Start]:
        """Return each effect with the signature of one of a pair, together with the other one.

        Args:
            pair: the pair.
            near: pairs that are known already.
        """
        known = {other.hypotheses for other in near}
        found: list[tuple[float, Start]] = []
        for index, one in enumerate(pair.fits):
            stays = pair.fits[1 - index]
            at = float(pair.best().at[1 - index])
            if len(stays.comparisons) < 2:
                continue
            remaining, _ = stays.line(at)
            for fit in self.fits:
                new = fit.hypothesis.effect.name not in pair.names
                new = new and hypothesis_names((stays, fit)) not in known
                if new and one.cosine(fit) >= self.settings.alike:
                    least, other = least_added(remaining, fit, self.nominal)
                    found.append((least, Start(stays, fit, np.array([at, other]))))
        return _first(found, self.settings.twins)

    def substitutes(self, pair: PairFit) -> list[Start]:
        """Return the effects that act nearly like one of a pair, together with the other one."""
        found: list[tuple[float, Start]] = []
        for index, one in enumerate(pair.fits):
            stays, at = pair.fits[1 - index], pair.best().at
            if len(one.comparisons) < 2:
                continue
            change = one.line(float(at[index]))[0] - self.nominal.whitened
            limit = (1.0 - self.settings.alike**2) * float(change @ change)
            for fit in self.fits:
                least, there = least_added(-change, fit, self.nominal)
                if fit.hypothesis.effect.name not in pair.names and least <= limit:
                    found.append((least, Start(stays, fit, np.array([at[1 - index], there]))))
        return _first(found, self.settings.substitutes)

    def fit_substitutes(self, pairs: Sequence[PairFit]) -> list[PairFit]:
        """Fit the substitutes of the best pair from where that pair is; return the pairs that are new.

        So two valleys of a similar shape are compared at their minima, not one's minimum with the other's
        slope.
        """
        known = {pair.hypotheses: pair for pair in pairs}
        work: Work = []
        for start in self.substitutes(min(pairs, key=_loss)):
            new = PairFit(start.fits, [], self._no_slopes(), self.settings.max_step)
            pair = known.get(hypothesis_names(start.fits), new)
            work.append((pair, start.at if pair.fits[0] is start.one else start.at[::-1]))
        found = self._simulate_and_add(work)
        self._improve(found, self.settings.substitute_rounds)
        return [pair for pair in found if pair not in pairs]

    def _begun(self, starts: Sequence[Start]) -> list[PairFit]:
        """Simulate each pair once, and take its slopes from that."""
        work: Work = []
        for start in starts:
            at = start.at
            if abs(at[1] - start.other.hypothesis.neutral) < 1e-9:
                at = np.array([at[0], self._screened(start.other)])
            work.append((PairFit(start.fits, [], self._no_slopes(), self.settings.max_step), at))
        begun = []
        for pair, comparison in self._simulated(work):
            one, other = pair.fits
            alone, pair.slopes[:, 0] = one.line(float(comparison.at[0]))
            moved = comparison.at[1] - other.hypothesis.neutral
            pair.slopes[:, 1] = (comparison.whitened - alone) / moved
            pair.comparisons.append(comparison)
            begun.append(pair)
        return begun

    def _no_slopes(self) -> Array:
        return np.zeros((len(self.nominal.whitened), 2))

    def _screened(self, fit: Fit) -> float:
        """Return where an effect is tried on top of another, if its sum with that is least at neutral."""
        h = fit.hypothesis
        part = (h.high - h.low) / self.settings.screened_part
        return min(h.screened(fit.settings), key=lambda at: abs(abs(at - h.neutral) - part))

    def _improve(self, pairs: Sequence[PairFit], rounds: Sequence[PairRound]) -> None:
        """Fit the best of some pairs further, round by round."""
        for one in rounds:
            leading = sorted(pairs, key=_loss)[: one.pairs]
            if one.measure_slopes:
                self._measure_slopes(leading)
            work = [(pair, pair.best().at + pair.step()) for pair in leading]
            for pair, comparison in self._simulated(work):
                pair.learn(comparison)

    def _measure_slopes(self, pairs: Sequence[PairFit]) -> None:
        """Measure the slopes of pairs at their best points: they differ from those of single effects."""
        bests = {id(pair): pair.best() for pair in pairs}
        work: Work = []
        for pair in pairs:
            for index, fit in enumerate(pair.fits):
                h, at = fit.hypothesis, bests[id(pair)].at.copy()
                size = self.settings.difference * (h.high - h.low)
                at[index] += size if at[index] + size <= h.high else -size
                work.append((pair, at))
        for pair, comparison in self._simulated(work):
            best = bests[id(pair)]
            moved = comparison.at - best.at
            index = int(np.argmax(np.abs(moved)))
            pair.slopes[:, index] = (comparison.whitened - best.whitened) / moved[index]
            pair.comparisons.append(comparison)
            pair.max_step = self.settings.max_step

    def _probe(self, pairs: Sequence[PairFit]) -> None:
        """Simulate pairs away from the best along each coordinate: there may be more than one valley."""
        work: Work = []
        for pair in pairs:
            for way in np.concatenate([np.diag(pair.spans), -np.diag(pair.spans)]):
                at = pair.within(pair.best().at + self.settings.probe_distance * way)
                if not np.array_equal(at, pair.best().at):
                    work.append((pair, at))
        self._simulate_and_add(work)

    def _fit_without_folds(self, pairs: Sequence[PairFit]) -> None:
        """Simulate the pairs that may count where they fit best without each fold.

        Slopes do not tell what such a pair predicts of a gait that it has not seen: fast gaits
        are not linear.
        """
        self._simulate_and_add(
            [
                (pair, pair.best(weights).at + pair.step(weights))
                for pair in self._near(pairs)
                for _, weights in pair.trial_set.fold_weights
            ]
        )

    def _near(self, pairs: Sequence[PairFit]) -> list[PairFit]:
        """Return the pairs that do not leave many times what the best one leaves."""
        limit = self.settings.hopeless * min(map(_loss, pairs), default=0.0)
        return [pair for pair in pairs if pair.loss <= limit]

    def _simulate_and_add(self, work: Work) -> list[PairFit]:
        """Simulate pairs, add the results to them, and return the pair of each result."""
        done = self._simulated(work)
        for pair, comparison in done:
            pair.comparisons.append(comparison)
        return [pair for pair, _ in done]

    def _simulated(self, work: Work) -> list[tuple[PairFit, Comparison]]:
        """Return each pair with its simulation at some coordinates; those that failed are left out."""
        if not work:
            return []
        found = self.compare(work[0][0].trial_set, [pair.request(at) for pair, at in work])
        pairs = [pair for pair, _ in work]
        return [(pair, one) for pair, one in zip(pairs, found, strict=True) if one is not None]


def _loss(pair: PairFit) -> float:
    return pair.loss


def _first(found: list[tuple[float, Start]], most: int) -> list[Start]:
    """Return the starts of the least losses."""
    return [start for _, start in sorted(found, key=lambda entry: entry[0])[:most]]
