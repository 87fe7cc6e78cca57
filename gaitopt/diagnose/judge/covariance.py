"""All rivals judged by one covariance, and again by the one that the robots in question teach.

What nobody knows of a robot does more to some robots than to others: with a payload behind its feet, a
percent of a link's mass decides which foot slips. The covariance that the nominal robot teaches would
take that for evidence. So robots are drawn about the rivals that lead, everything is whitened by what
these teach, and the question is asked again, until the leaders stay.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.fitting import Bench, Fit, Note, Point, finish
from gaitopt.diagnose.fit.pairs import PairFit
from gaitopt.diagnose.judge import evidence, precision
from gaitopt.diagnose.judge.evidence import Rival

_CONTENDERS = 3
"""So many rivals at most teach the covariance, one of the same effects."""

_LOOKS = 3
"""How often it is taught anew at most."""


@dataclass(frozen=True)
class Look:
    """The trials, the fits, and what they are worth by one covariance.

    Attributes:
        bench: the trials.
        nominal: the trials beside the nominal robot.
        fits: the effects' fits.
        pairs: fits of two effects; none where these were not tried.
    """

    bench: Bench
    nominal: Point
    fits: tuple[Fit, ...]
    pairs: tuple[PairFit, ...] = ()

    @cached_property
    def none(self) -> Rival:
        """The rival without any effect."""
        return evidence.nothing(self.bench, self.nominal)

    @cached_property
    def singles(self) -> list[Rival]:
        """The rivals of one effect; those that could not be simulated are left out."""
        return [evidence.single(fit) for fit in self.fits if len(fit.points) > 1]

    @cached_property
    def doubles(self) -> list[Rival]:
        """The rivals of two."""
        return [evidence.double(pair) for pair in self.pairs]

    @property
    def rivals(self) -> list[Rival]:
        """The rivals of two effects where there are any, else of one."""
        return self.doubles or self.singles

    @property
    def first(self) -> Rival:
        """The most probable rival."""
        return self.ranked[0][0]

    @cached_property
    def ranked(self) -> tuple[list[Rival], NDArray[np.float64]]:
        """The rivals, the most probable first, and their probabilities if one of them is right."""
        weights = evidence.scores(self.bench, self.rivals)
        order = np.argsort(-weights, kind="stable")
        return [self.rivals[i] for i in order], evidence.probabilities(weights[order])

    def closer(self, executor: Executor, seed: int, note: Note) -> Look:
        """Return the same with a covariance that those who lead by it have taught.

        Args:
            executor: where robots are simulated.
            seed: seed of the draws.
            note: called as it goes.
        """
        look, known = self, set[str]()
        for _ in range(_LOOKS):
            leaders = look._contenders()
            names = {rival.label for rival in leaders}
            if names <= known:
                break
            look, known = look._taught_by(leaders, executor, seed), names
            finish(look.fits, executor, note)
        return look

    def _contenders(self) -> list[Rival]:
        """Return the first of the rivals that the data cannot rule out, each with other effects."""
        chosen: dict[frozenset[str], Rival] = {}
        order, chances = self.ranked
        for rival, chance in zip(order, chances.tolist(), strict=True):
            if chance >= evidence.IN_SET * float(chances[0]) and len(chosen) < _CONTENDERS:
                chosen.setdefault(frozenset(rival.names), rival)
        return list(chosen.values())

    def _taught_by(self, rivals: Sequence[Rival], executor: Executor, seed: int) -> Look:
        first = self.bench.first
        drawn = [precision.drawn_about(first, rival, executor, seed).changes for rival in rivals]
        bench = first.taught(np.concatenate(drawn))
        return Look(
            bench,
            bench.seen(self.nominal, self.bench),
            tuple(fit.on(bench) for fit in self.fits),
            tuple(pair.on(bench) for pair in self.pairs),
        )
