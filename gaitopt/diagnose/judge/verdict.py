"""The verdict: the answer that the evidence allows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.judge import evidence
from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.diagnose.judge.perturbed import PerturbedRobots
from gaitopt.diagnose.judge.precision import Precision
from gaitopt.diagnose.judge.settings import VerdictSettings


@dataclass(frozen=True)
class Verdict:
    """The answer.

    Attributes:
        kind: ``no_gap``, ``explained``, ``ambiguous``, ``partly_explained`` or ``unexplained``.
        causes: the effects blamed.
        ambiguous_with: effects that the data cannot tell from these, or that may be at work beside them.
        other_probability: probability that the cause is not in the library, or not the only one.
        p_value: how often chance alone gains as much as the first candidate.
    """

    kind: str
    causes: tuple[str, ...] = ()
    ambiguous_with: tuple[str, ...] = ()
    other_probability: float = 0.0
    p_value: float = 1.0

    def without_causes(self) -> Verdict:
        """Return the answer where the effects predict held-out gaits worse than the nominal robot does."""
        if self.kind == "no_gap":
            return self
        other = max(self.other_probability, 0.5)
        return replace(self, kind="unexplained", causes=(), ambiguous_with=(), other_probability=other)

    def beside_chance(self, other_probability: float) -> Verdict:
        """Return the answer where the recorded cycles differ more than any effect explains.

        Args:
            other_probability: probability of another cause, by how much they differ.
        """
        kind = "partly_explained" if self.causes else "unexplained"
        return replace(self, kind=kind, other_probability=max(self.other_probability, other_probability))


@dataclass(frozen=True)
class _Answer:
    """The effects of an answer: those blamed, and those that cannot be told from them."""

    causes: tuple[str, ...] = ()
    rest: tuple[str, ...] = ()


def conclude(
    judgement: Judgement,
    robots: PerturbedRobots,
    above_floor: NDArray[np.bool_],
    uneven: float,
    faint: bool,
    seed: int,
) -> Verdict:
    """Return the answer that the evidence allows.

    Args:
        judgement: the candidates.
        robots: robots perturbed about the first of them.
        above_floor: whether the gap of each trial is above its floor: only there an effect can be shown.
        uneven: by how much the recorded cycles differ, in differences of these robots' cycles.
        faint: whether the gap counts as none if no effect explains it.
        seed: seed of the draws for the p-value.
    """
    settings, trial_set = judgement.settings.verdict, judgement.trial_set
    none, first = judgement.none, judgement.first
    chance_alone = evidence.p_value(
        trial_set,
        judgement.nominal,
        judgement.singles,
        first,
        above_floor,
        seed,
        judgement.settings.evidence,
        judgement.settings.response,
    )
    remains = first.left(trial_set)
    other = max(
        other_probability(remains / settings.other_half, settings),
        other_probability(uneven / settings.uneven, settings),
    )
    answer = _answer(judgement)
    if chance_alone > settings.significance or not is_shown(judgement, robots):
        kind, answer = "no_gap" if faint and uneven <= settings.uneven else "unexplained", _Answer()
    elif remains > settings.left or uneven > settings.uneven:
        explained = 1.0 - float(np.sqrt(first.heldout_loss.sum() / none.heldout_loss.sum()))
        kind = "partly_explained"
        if explained < settings.little:
            kind, answer = "unexplained", _Answer()
    else:
        kind = "ambiguous" if answer.rest else "explained"
    return Verdict(kind, answer.causes, answer.rest, other, chance_alone)


def falls_short(judgement: Judgement) -> bool:
    """Whether the best single effect leaves more than a correct one, or its parameter ends at a bound.

    At the end of its range it may stand for a second effect too. The covariance estimated there would hide
    this.
    """
    best = min(judgement.singles, key=lambda candidate: candidate.total_loss)
    (hypothesis,), (at,) = best.hypotheses, best.at
    return hypothesis.at_bound(at) or best.left(judgement.trial_set) > judgement.settings.verdict.short


def is_shown(judgement: Judgement, robots: PerturbedRobots) -> bool:
    """Whether the interval of every parameter of the first candidate excludes its neutral value."""
    return Precision(robots.changes, judgement.settings).excludes_neutral(judgement.first)


def other_probability(share: float, settings: VerdictSettings) -> float:
    """Return the probability of another cause: one half where `share` is 1, more where it is larger."""
    return 1.0 / (1.0 + math.exp(-settings.other_slope * math.log(max(share, 1e-9))))


def _answer(judgement: Judgement) -> _Answer:
    """Return the effects that are not ruled out and clearly more probable than no effect."""
    settings, ranking = judgement.settings, judgement.ranking
    weights = judgement.scores([*ranking.candidates, judgement.none])
    idle = settings.verdict.above_none * float(ranking.probabilities[0] * np.exp(weights[-1] - weights.max()))
    totals = evidence.by_effect(ranking.candidates, ranking.probabilities)
    names = evidence.answer_set(totals, settings.evidence)
    return _Answer(tuple(names[:1]), tuple(name for name in names[1:] if totals[name] >= idle))
