"""What one more effect promises beside a set of effects, by a few robots with it.

Where nothing is known of an effect, it is simulated at a few values beside the set. Where each effect was
simulated alone, what it does alone is added, and only what promises most is simulated. On made-up benches the
effect that gains most beside a set was among the first four by such sums, but for those that jump: they are
always simulated.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from gaitopt.core.firsts import firsts
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.proposals import Proposals
from gaitopt.diagnose.fit.responses import SingleResponses
from gaitopt.diagnose.fit.set_fit import SetFit, SetFitter
from gaitopt.diagnose.fit.settings import SetSettings
from gaitopt.diagnose.fit.single import robot_request
from gaitopt.diagnose.fit.trials import Comparison


@dataclass(frozen=True)
class _Place:
    """Where an effect is tried.

    Attributes:
        hypothesis: the effect.
        share: its place as a share of the way from neutral to a bound, signed by the side,
        at: and its coordinate there.
    """

    hypothesis: Hypothesis
    share: float
    at: float

    @staticmethod
    def along(hypothesis: Hypothesis, share: float) -> _Place:
        return _Place(hypothesis, share, hypothesis.coordinate_along(share))


@dataclass(frozen=True)
class Tried:
    """An effect that was tried beside a set.

    Attributes:
        fit: the set with the effect, at its neutral value.
        share: where it was tried, as a share of the way from neutral to a bound, signed by the side,
        robot: and the robot there.
        expected: score that the slopes predict.
    """

    fit: SetFit
    share: float
    robot: Comparison
    expected: float

    @property
    def hypothesis(self) -> Hypothesis:
        return self.fit.hypotheses[-1]

    @property
    def distance(self) -> float:
        """How far from neutral it was tried, in ranges."""
        return abs(self.hypothesis.moved(float(self.robot.at[-1])))


@dataclass
class Beside:
    """Tries effects beside sets.

    Attributes:
        fitter: fits sets.
        hypotheses: every effect on each of its targets.
        settings: how sets are searched.
        proposals: proposes where to try an effect that changes commands in jumps; None where nothing can.
        responses: what each effect does alone, where fits of single effects tell it.
        first: what was tried beside the first set, by the name of the hypothesis,
        last: and the last time.
        alone: what each effect does alone, by what was tried beside the first set.
    """

    fitter: SetFitter
    hypotheses: Sequence[Hypothesis]
    settings: SetSettings
    proposals: Proposals | None
    responses: SingleResponses | None
    first: dict[str, Tried] = field(default_factory=dict)
    last: dict[str, Tried] = field(default_factory=dict)
    alone: SingleResponses | None = None

    def tried(self, fit: SetFit, smaller: Sequence[SetFit] = ()) -> list[Tried]:
        """Return other effects beside a set, the best expected score first, each effect once.

        Args:
            fit: the set.
            smaller: the set without one of its effects each: those effects are tried that may take their
                places. By default those that may go beside them all.
        """
        shown = self._shown(fit, self._places(fit, smaller))
        best = self._best(fit, shown)
        if self.alone is None:
            self.first, self.alone = best, _alone(fit, shown)
        score = self.fitter.score(fit)  # a place is kept beside a set that the effect does not help at all
        self.last |= {n: one for n, one in best.items() if n not in self.last or one.expected < score}
        order = sorted(best.values(), key=lambda one: (one.expected, one.hypothesis.name))
        return firsts(order, lambda one: one.hypothesis.effect.name)

    def others(self, fit: SetFit) -> list[Hypothesis]:
        """Return the hypotheses of effects that a set does not have."""
        return [h for h in self.hypotheses if h.effect.name not in fit.effects]

    def placed(self, fit: SetFit, hypothesis: Hypothesis) -> SetFit | None:
        """Return a set with one more effect where that is best; None where it cannot be simulated."""
        places = [_Place.along(hypothesis, share) for share in self._shares(fit, hypothesis)]
        shown = self._shown(fit, places)
        return next((one.fit for one in self._best(fit, shown).values()), None)

    def _shown(self, fit: SetFit, places: Sequence[_Place]) -> list[tuple[_Place, Comparison]]:
        """Return the robots at some places, and at those that were learnt from them."""
        shown = self._simulated_at(fit, places)
        shown += self._simulated_at(fit, self._learn(fit, shown))
        unsettled = shown
        for _ in range(self.settings.nearer):
            better = self._between(unsettled)
            if not better:
                break
            shown += self._simulated_at(fit, better)
            names = {place.hypothesis.name for place in better}
            unsettled = [one for one in shown if one[0].hypothesis.name in names]
        return shown

    def _best(self, fit: SetFit, shown: Iterable[tuple[_Place, Comparison]]) -> dict[str, Tried]:
        """Return the best place of each effect, by the name of its hypothesis."""
        best: dict[str, Tried] = {}
        for place, robot in shown:
            beside = self.with_one_more(fit, place.hypothesis, place.at, robot)
            one = Tried(beside, place.share, robot, self.fitter.expected_score(beside))
            name = place.hypothesis.name
            if name not in best or one.expected < best[name].expected:
                best[name] = one
        return best

    def with_one_more(self, fit: SetFit, hypothesis: Hypothesis, at: float, robot: Comparison) -> SetFit:
        """Return a set with one more effect, and how far the robot with it shows where that may go."""
        moved = abs(hypothesis.moved(at))
        rough = hypothesis.effect.rough
        reach = self.settings.difference if rough else moved * self.settings.beyond
        return replace(self.fitter.with_effect(fit, hypothesis, at, robot), radius=reach)

    def promising(self, fit: SetFit, responses: SingleResponses) -> list[tuple[SetFit, float]]:
        """Return the set with each effect that promises most, at its best coordinate, the best first."""
        others = self.others(fit)
        best: list[tuple[float, int, float, SetFit]] = []
        for index, h in enumerate(others):
            sums = [
                (self.with_one_more(fit, h, at, robot), at) for at, robot in responses.beside(fit.robot, h)
            ]
            tried = [(self.fitter.expected_score(beside), index, at, beside) for beside, at in sums]
            best += sorted(tried, key=lambda one: one[:3])[:1]
        chosen, targets = list[tuple[SetFit, float]](), Counter[str]()
        for _, index, at, beside in sorted(best, key=lambda one: one[:3]):
            name = others[index].effect.name
            if targets[name] < self.settings.promising_targets:
                targets[name] += 1
                chosen.append((beside, at))
        return chosen[: self.settings.promising]

    def _places(self, fit: SetFit, smaller: Sequence[SetFit]) -> list[_Place]:
        """Return where other effects are tried beside a set."""
        if self.responses is None:
            others = self._shortlist(fit, smaller)
            return [_Place.along(h, share) for h in others for share in self._shares(fit, h)]
        promising = [(one.hypotheses[-1], at) for one, at in self.promising(fit, self.responses)]
        return [_Place(h, _signed_share(h, at), at) for h, at in promising]

    def _shortlist(self, fit: SetFit, smaller: Sequence[SetFit]) -> list[Hypothesis]:
        """Return the effects to try beside a set: all at first, then what promises most, and what jumps."""
        others = self.others(fit)
        if self.alone is None:
            return others
        most = self.settings.swapped if smaller else self.settings.promising
        chosen = [self.promising(one, self.alone)[:most] for one in smaller or [fit]]
        names = {beside.hypotheses[-1].name for some in chosen for beside, _ in some}
        return [h for h in others if h.name in names or h.effect.jumps]

    def _shares(self, fit: SetFit, hypothesis: Hypothesis) -> list[float]:
        """Return where an effect is tried: everywhere at first, then where it was best, and a little."""
        if self.proposals is not None and hypothesis.effect.jumps:
            return self.proposals.shares(fit, hypothesis)
        signs = [1.0 if bound > hypothesis.neutral else -1.0 for bound in hypothesis.sides]
        if hypothesis.name not in self.last:
            rough = hypothesis.effect.rough
            shares = self.settings.screened_rough if rough else self.settings.screened
            return [sign * share for sign in signs for share in shares]
        last = self.last[hypothesis.name].share
        return sorted({last, *(sign * self.settings.screened[0] for sign in signs)})

    def _learn(self, fit: SetFit, shown: Iterable[tuple[_Place, Comparison]]) -> list[_Place]:
        """Learn how joints follow effects that jump; return better places of those that were not known."""
        if self.proposals is None:
            return []
        robots: dict[str, list[tuple[_Place, Comparison]]] = {}
        for place, robot in shown:
            if place.hypothesis.effect.jumps:
                robots.setdefault(place.hypothesis.name, []).append((place, robot))
        found = []
        for own in robots.values():
            hypothesis = own[0][0].hypothesis
            known = self.proposals.knows(hypothesis)
            self.proposals.learn(fit, hypothesis, [(place.share, robot) for place, robot in own])
            shares = [] if known else self.proposals.shares(fit, hypothesis)
            found += [_Place.along(hypothesis, share) for share in shares]
        return found

    def _between(self, shown: Iterable[tuple[_Place, Comparison]]) -> list[_Place]:
        """Return better places of effects, between two where they were tried.

        A limit does little up to where it is reached, and soon far more than is recorded. Then what it
        does at either place, made larger or smaller, is not what it does between them.
        """
        sides: dict[tuple[str, bool], list[tuple[_Place, Comparison]]] = {}
        for place, robot in shown:
            if not place.hypothesis.effect.rough:
                sides.setdefault((place.hypothesis.name, place.share > 0.0), []).append((place, robot))
        found = []
        for own in sides.values():
            own.sort(key=lambda one: abs(one[0].share))
            least = min(self.fitter.loss.total(robot.whitened) for _, robot in own)
            expected = [self._best_between(*pair) for pair in pairwise(own)]
            loss, share = min(expected, default=(math.inf, 0.0))
            if loss < least - self.settings.price:
                found.append(_Place.along(own[0][0].hypothesis, share))
        return found

    def _best_between(
        self, near: tuple[_Place, Comparison], far: tuple[_Place, Comparison]
    ) -> tuple[float, float]:
        """Return the least loss between two places, if what changes grows evenly from one to the other.

        Returns:
            The loss, and the share where it is.
        """
        (begin, start), (end, stop) = near, far
        ways = np.linspace(0.0, 1.0, self.settings.between + 2)[1:-1]
        change = stop.whitened - start.whitened
        losses = self.fitter.loss.totals(start.whitened + ways[:, None] * change)
        best = int(np.argmin(losses))
        return float(losses[best]), begin.share + float(ways[best]) * (end.share - begin.share)

    def _simulated_at(self, fit: SetFit, places: Sequence[_Place]) -> list[tuple[_Place, Comparison]]:
        """Return the robots of a set with one more effect each, those that can be simulated."""
        requests = [robot_request([*fit.point, (place.hypothesis, place.at)]) for place in places]
        robots = self.fitter.simulate(requests)
        return [(place, robot) for place, robot in zip(places, robots, strict=True) if robot is not None]


def _alone(fit: SetFit, shown: Iterable[tuple[_Place, Comparison]]) -> SingleResponses:
    """Return what each effect does beside a set, by the robots that were simulated with it."""
    robots: dict[str, list[tuple[float, Comparison]]] = {}
    for place, robot in shown:
        robots.setdefault(place.hypothesis.name, []).append((place.at, robot))
    return SingleResponses(robots, fit.robot)


def _signed_share(hypothesis: Hypothesis, coordinate: float) -> float:
    """Return a coordinate as a share of the way from neutral to the bound on its side, signed by the side."""
    bound = hypothesis.high if coordinate > hypothesis.neutral else hypothesis.low
    share = (coordinate - hypothesis.neutral) / (bound - hypothesis.neutral)
    return math.copysign(share, coordinate - hypothesis.neutral)
