"""The search for a set of effects: what adds up, what follows when the best is in, what replaces what.

First the set grows by one effect at a time. For each addition the effects that promise most are tried at a
few values beside the present set; the slopes then tell how well all of them together would fit. The best
ones are fitted. After each addition effects are dropped that no longer pay for themselves, and effects are
exchanged for others.

A real servo is wrong in ten ways at once, and one step at a time leads to a set in which one effect stands
for several others. So where a few effects leave too much, all effects are fitted together from several starts
near the nominal robot, and those that do not pay for themselves are dropped one by one. Such a fit begins
with a loss that no trial can leave: its errors count in shares of its motion. Only then follows the robust
loss.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.firsts import firsts
from gaitopt.diagnose.fit.beside import Beside, Tried
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.proposals import Proposals
from gaitopt.diagnose.fit.responses import SingleResponses
from gaitopt.diagnose.fit.set_fit import Point, SetFit, SetFitter
from gaitopt.diagnose.fit.settings import SetSettings
from gaitopt.diagnose.fit.single import robot_request
from gaitopt.diagnose.fit.trials import Comparison

Array = NDArray[np.float64]


@dataclass
class SetSearch:
    """A search over sets of effects.

    Attributes:
        fitter: fits sets.
        hypotheses: every effect on each of its targets.
        nominal: the trials compared with the nominal robot.
        settings: how sets are searched.
        coarse: fits sets by the errors in shares of the motion.
        proposals: as of `Beside`.
        known: effects that are at work as other evidence says, each at its coordinate: in every set.
        begin: sets from the best of which the search sets out; from no effect where there is none.
        responses: as of `Beside`.
        found: every set that was fitted, by its effects with their targets.
    """

    fitter: SetFitter
    hypotheses: Sequence[Hypothesis]
    nominal: Comparison
    settings: SetSettings
    coarse: SetFitter
    proposals: Proposals | None = None
    known: Point = ()
    begin: Sequence[Point] = ()
    responses: SingleResponses | None = None
    found: dict[frozenset[str], SetFit] = field(default_factory=dict)

    @cached_property
    def _beside(self) -> Beside:
        return Beside(self.fitter, self.hypotheses, self.settings, self.proposals, self.responses)

    def run(self) -> list[SetFit]:
        """Return the sets that were fitted, the best score first; the empty set is among them."""
        best = self._kept([self.fitter.empty(self.nominal), *self.fitter.placed(self._known_points)])[-1]
        places = sorted(self.fitter.placed(self.begin), key=self.fitter.score)[: self.settings.begun]
        begun = [self._pruned(one) for one in self._nearly_best(self._kept(self._refined(places)))]
        if begun:
            best = self._exchanged(min(begun, key=self.fitter.score))
        best = self._climbed(best)
        if best.hypotheses and self._falls_short(best):
            best = self._climbed_otherwise(best)
        if best.hypotheses and self._falls_short(best):
            self._all_together(best)
        self._fit_twins()
        self._fit_merged()
        self._finish()
        return self.ranked

    def _nearly_best(self, fits: Sequence[SetFit]) -> list[SetFit]:
        """Return the sets that score nearly as well as the best of them."""
        score = self.fitter.score
        limit = min(map(score, fits), default=0.0) + self.settings.begun_within
        return [fit for fit in fits if score(fit) <= limit]

    def _climbed(self, best: SetFit) -> SetFit:
        """Return a set to which effects were added one by one, as long as that pays."""
        while len(best.hypotheses) < self.settings.most_effects:
            if len(best.hypotheses) >= self.settings.one_by_one and self._falls_short(best):
                break
            grown = self._exchanged(self._pruned(self._grown(best)))
            if self.fitter.score(grown) >= self.fitter.score(best) - self.settings.worth:
                break
            best = grown
        return best

    def _climbed_otherwise(self, best: SetFit) -> SetFit:
        """Return the best set after other ways up, from the best pairs of effects that are not in it.

        One effect may do much of what two do, and then neither of these two comes in beside it.
        """
        pairs = [fit for fit in self.ranked if len(fit.hypotheses) == 2 and not fit.names <= best.names]
        climbed = [self._climbed(fit) for fit in pairs[: self.settings.other_ways]]
        return min([best, *climbed], key=self.fitter.score)

    @property
    def _known_points(self) -> list[Point]:
        return [self.known] if self.known else []

    def _droppable(self, fit: SetFit) -> list[int]:
        """Return the places of the effects of a set that it may do without."""
        known = [h.name for h, _ in self.known]
        return [i for i, h in enumerate(fit.hypotheses) if h.name not in known]

    def _falls_short(self, fit: SetFit) -> bool:
        """Whether a set leaves much more than a correct one in more than a few trials."""
        left = self.fitter.loss.mean_squares(fit.robot.whitened)
        return bool(np.mean(left > self.settings.right) > self.settings.few)

    def _all_together(self, grown: SetFit) -> None:
        """Fit all effects together from several starts, and drop those that do not pay for themselves."""
        wide = self.coarse.placed([self._start(grown, share) for share in self.settings.starts])
        if not wide:  # none of them can be simulated
            return
        for count in self.settings.coarse_rounds:
            wide = sorted(wide, key=self.coarse.score)[:count]
            wide = [replace(fit, radius=max(fit.radius, self.settings.coarse_radius)) for fit in wide]
            wide = self.coarse.descend(self.coarse.measure_slopes(wide), self.settings.fine_rounds)
        wide = self._kept(self._refined([self.fitter.at_robot(fit, fit.robot) for fit in wide]))
        best = self._thinned(min(wide, key=self.fitter.score))
        for _ in range(self.settings.robust_rounds):
            best = self._kept(self._refined([best]))[0]
        self._exchanged(self._pruned(best))

    def _start(self, grown: SetFit, share: float) -> Point:
        """Return all effects a little away from neutral: those that were found, and what promised most alone.

        Effects with a rough response are left out: a fit that starts far off ends in one of their jumps.
        """
        smooth = [one for one in self._beside.first.values() if not one.hypothesis.effect.rough]
        promising = sorted(smooth, key=lambda one: one.expected)
        order = sorted(
            firsts(promising, lambda one: one.hypothesis.effect.name),
            key=lambda one: one.hypothesis.effect.name not in grown.effects,
        )
        begun = [
            (one.hypothesis, one.hypothesis.coordinate_along(math.copysign(share, one.share)))
            for one in order[: self.settings.widest_set]
        ]
        return [*self.known, *begun]

    def _thinned(self, fit: SetFit) -> SetFit:
        """Return a set without the effects that, as the slopes predict, do not pay for themselves.

        First those are dropped that do nothing, then those that do little: the slopes may be wrong of these.
        """
        for worth in (self.settings.price - self.settings.worth, 0.0):
            thin = fit
            while len(self._droppable(thin)) > 1:
                smaller = [self.fitter.without_effect(thin, i) for i in self._droppable(thin)]
                best = min(smaller, key=self.fitter.expected_score)
                if self.fitter.expected_score(best) > self.fitter.expected_score(thin) - worth:
                    break
                thin = replace(best, radius=fit.radius)
            if thin is not fit:
                fitted = self._fitted(self._simulated([thin]), 1)
                fit = fitted if self.fitter.score(fitted) < self.fitter.score(fit) else fit
        return fit

    @property
    def ranked(self) -> list[SetFit]:
        """The sets, the best score first."""
        return sorted(self.found.values(), key=lambda fit: (self.fitter.score(fit), sorted(fit.names)))

    def _grown(self, fit: SetFit) -> SetFit:
        """Return the best set with one more effect."""
        tried = self._beside.tried(fit)
        if not tried:
            return fit
        work = [begun for one in tried[: self.settings.started] for begun in self._begun(one)]
        return self._fitted(work, self.settings.refined)

    def _begun(self, one: Tried) -> list[SetFit]:
        """Return a set with one more effect as its fits begin.

        A fit from the neutral value may not reach where the effect was tried, and a limit changes nothing on
        most of that way: then another fit sets out from there.
        """
        if one.hypothesis.effect.rough:
            return [one.fit]
        first = self.settings.first_radius
        begun = [one.fit]
        if not self.settings.centred and one.distance > first:
            begun.append(self.fitter.at_robot(one.fit, one.robot))
        return [replace(fit, radius=first) for fit in begun]

    def _fitted(self, work: Sequence[SetFit], refined: int) -> SetFit:
        """Return the best of some sets after all were fitted roughly and the best `refined` of them well."""
        rough = self._kept(self.fitter.descend(work, self.settings.rough_rounds))
        best_of_each = firsts(sorted(rough, key=self.fitter.score), lambda fit: fit.names)
        fine = self._kept(self._refined(best_of_each[:refined]))
        return min([*fine, *best_of_each], key=self.fitter.score)

    def _refined(self, fits: Sequence[SetFit]) -> list[SetFit]:
        return self.fitter.descend(self.fitter.measure_slopes(fits), self.settings.fine_rounds)

    def _pruned(self, fit: SetFit) -> SetFit:
        """Return a set without the effects that do not pay for themselves.

        Each is left out of a simulated robot: near its neutral value the slopes may be those of its far side.
        """
        while len(fit.hypotheses) > 1:
            smaller = [self.fitter.without_effect(fit, i) for i in self._droppable(fit)]
            without = self._simulated([one for one in smaller if one.names not in self.found])
            limit = self.fitter.score(fit) + self.settings.doubtful
            doubtful = sorted(
                (one for one in without if self.fitter.expected_score(one) < limit),
                key=self.fitter.expected_score,
            )
            if not doubtful:
                return fit
            better = self._fitted(doubtful[: self.settings.dropped], 1)
            if self.fitter.score(better) >= self.fitter.score(fit):
                return fit
            fit = better
        return fit

    def _simulated(self, fits: Sequence[SetFit]) -> list[SetFit]:
        """Return sets whose residual was only predicted with that of a simulated robot."""
        requests = [robot_request(fit.point) for fit in fits]
        robots = self.fitter.simulate(requests)
        return [
            self.fitter.at_robot(fit, robot)
            for fit, robot in zip(fits, robots, strict=True)
            if robot is not None
        ]

    def _exchanged(self, fit: SetFit) -> SetFit:
        """Return a set in which an effect was exchanged for another, where that is better."""
        for _ in range(self.settings.exchanges):
            if len(fit.hypotheses) < 2:
                return fit
            swaps = self._swaps(fit)
            if not swaps:
                return fit
            better = self._fitted(self._simulated(swaps), 1)
            if self.fitter.score(better) >= self.fitter.score(fit) - self.settings.worth:
                return fit
            fit = self._pruned(better)
        return fit

    def _swaps(self, fit: SetFit) -> list[SetFit]:
        """Return the sets with one effect exchanged that are expected to be best."""
        smaller = self._smaller_beside(fit) if self.responses is None else self._replaced(fit, self.responses)
        found: dict[frozenset[str], tuple[float, SetFit]] = {}
        for one in smaller:
            if one.names not in self.found:
                wide = replace(one, radius=self.settings.widest)
                step, _ = self.fitter.expected(wide)
                found[one.names] = (self.fitter.expected_score(wide), self.fitter.stepped(one, step))
        ordered = sorted(found.values(), key=lambda one: one[0])
        limit = self.fitter.score(fit) + self.settings.doubtful
        return [one for expected, one in ordered if expected < limit][: self.settings.swapped]

    def _smaller_beside(self, fit: SetFit) -> list[SetFit]:
        """Return sets with one effect more and one less, by what was simulated beside the whole set."""
        droppable = self._droppable(fit)
        tried = self._beside.tried(fit, [self.fitter.without_effect(fit, index) for index in droppable])
        return [self.fitter.without_effect(beside.fit, index) for beside in tried for index in droppable]

    def _replaced(self, fit: SetFit, responses: SingleResponses) -> list[SetFit]:
        """Return the same, by what was simulated without each effect, and the responses of the others."""
        smaller = self._simulated([self.fitter.without_effect(fit, i) for i in self._droppable(fit)])
        found = []
        for one in smaller:
            found += [beside for beside, _ in self._beside.promising(one, responses)]
        return found

    def _fit_twins(self) -> None:
        """Fit the best set with each effect replaced by others that do nearly the same."""
        best = self.ranked[0]
        if self.responses is not None and best.hypotheses:
            twins = self._simulated(self._twins(best, self.responses))
            if twins:
                self._fitted(twins, self.settings.refined)

    def _twins(self, fit: SetFit, responses: SingleResponses) -> list[SetFit]:
        """Return the sets in which an effect gave way to one that alone does nearly the same.

        Each effect gives way to a few others: those of one must not take the places of those of another.
        """
        found, others = list[SetFit](), self._beside.others(fit)
        for smaller in self._simulated([self.fitter.without_effect(fit, i) for i in self._droppable(fit)]):
            likes = [
                self._beside.with_one_more(smaller, like.hypothesis, like.at, like.robot)
                for like in responses.likes(smaller.robot, fit.robot, others, self.settings.alike)
            ]
            fresh = [one for one in likes if one.names not in self.found]
            on_best_targets = firsts(
                sorted(fresh, key=self.fitter.expected_score), lambda one: one.effects[-1]
            )
            found += on_best_targets[: self.settings.twins]
        return found

    def _fit_merged(self) -> None:
        """Replace two effects of the best set by one that alone does nearly what both do, where that pays.

        In turn they do not give way to it: beside either one it does too much.
        """
        responses = self._beside.alone if self.responses is None else None
        while responses is not None:
            best = self.ranked[0]
            merged = self._kept(self._refined(self.fitter.placed(self._merged(best, responses))))
            better = min(merged, key=self.fitter.score, default=best)
            if self.fitter.score(better) >= self.fitter.score(best):
                return
            self._pruned(better)

    def _merged(self, fit: SetFit, responses: SingleResponses) -> list[Point]:
        """Return sets in which two effects gave way to one, each effect for those that it is likest to."""
        pairs = combinations(self._droppable(fit), 2)
        smaller = [self.fitter.without_effect(self.fitter.without_effect(fit, j), i) for i, j in pairs]
        others = self._beside.others(fit)
        found = [
            (like, one.point)
            for one in self._simulated(smaller)
            for like in responses.likes(one.robot, fit.robot, others, self.settings.like_two)
        ]
        found.sort(key=lambda one: -one[0].cosine)
        likest = firsts(found, lambda one: one[0].hypothesis.effect.name)
        points: list[Point] = [[*point, (like.hypothesis, like.at)] for like, point in likest]
        fresh = [point for point in points if frozenset(h.name for h, _ in point) not in self.found]
        return fresh[: self.settings.merged]

    def _finish(self) -> None:
        """Fit the leading sets well, so that sets are compared by what they can do."""
        for _ in range(self.settings.finish_rounds):
            first = self.fitter.score(self.ranked[0])
            leading = [
                fit
                for fit in self.ranked
                if fit.hypotheses and self.fitter.score(fit) < first + self.settings.leading
            ][: self.settings.finished]
            before = [fit.loss for fit in leading]
            after = self._kept(self._refined([self._placed_again(fit) for fit in leading]))
            if max((b - a.loss for b, a in zip(before, after, strict=True)), default=0.0) < 1.0:
                break

    def _placed_again(self, fit: SetFit) -> SetFit:
        """Return a set with its effects that jump placed anew beside the others, which moved since."""
        if self.proposals is None:
            return fit
        for hypothesis in [h for h in fit.hypotheses if h.effect.jumps]:
            index = fit.hypotheses.index(hypothesis)
            for without in self._simulated([self.fitter.without_effect(fit, index)]):
                placed = self._beside.placed(without, hypothesis)
                if placed is not None and self.fitter.expected_score(placed) < self.fitter.score(fit):
                    fit = min(fit, *self._refined([placed]), key=self.fitter.score)
        return fit

    def _kept(self, fits: Iterable[SetFit]) -> list[SetFit]:
        """Keep fits, the better one of equal sets, and return them."""
        fits = list(fits)
        for fit in fits:
            known = self.found.get(fit.names)
            if known is None or fit.loss < known.loss or (fit.measured and fit.loss <= known.loss):
                self.found[fit.names] = fit
        return fits
