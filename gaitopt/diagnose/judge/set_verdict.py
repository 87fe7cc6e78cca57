"""The verdict on sets of effects: which effects are at work, and what they leave."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.gap.floor import Floors, marker_floor
from gaitopt.diagnose.judge import evidence
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.gap import GapMeter
from gaitopt.diagnose.judge.judged_sets import JudgedSets
from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.diagnose.judge.settings import VerdictSettings
from gaitopt.diagnose.judge.verdict import Verdict, other_probability

Array = NDArray[np.float64]


def conclude_sets(
    judgement: Judgement,
    sets: JudgedSets,
    n_hypotheses: int,
    doubtful: Collection[str] = (),
    closes_gap: bool = False,
) -> Verdict:
    """Return the answer that sets of effects allow.

    What other evidence shows explains a part, however little the fit gains by it: that of effects of chance
    lies in how repeats differ. A gap of angles that only small changes close is explained by these. No effect
    of gaits is named if the best of so many would gain as much by chance.

    Args:
        judgement: the trials and the sets.
        sets: the sets.
        n_hypotheses: number of effects tried, each on each of its targets.
        doubtful: effects that may be at work and are no causes, see `JudgedSets.doubtful`.
        closes_gap: whether the first set takes a gap of logged commands from above its floor to within it.
    """
    settings = judgement.settings.verdict
    gain = float(sets.scores[0]) - sets.none if sets.candidates else 0.0
    chance_alone = min(1.0, n_hypotheses * math.exp(-max(0.0, gain)))
    if gain <= 0.0 or (judgement.fits and chance_alone > settings.significance):
        before = _typical(judgement, sets, judgement.none)
        return _without_effects(Verdict("no_gap", p_value=chance_alone), before, settings)
    first = judgement.first
    causes, rest = _named(judgement, sets, doubtful, settings.matters)
    if closes_gap and not causes + rest:
        causes, rest = _named(judgement, sets, doubtful, _least_hinted(judgement))
    hints = tuple(name for name in _hinted(judgement, sets) if name not in causes + rest)
    if causes or rest or chance_alone <= settings.certain:
        rest += hints
    clear = bool(causes) and not rest
    if not causes:
        causes, rest = rest[:1], rest[1:]
    remains = _typical(judgement, sets, first)
    other = other_probability(remains / settings.other_half, settings)
    before = _typical(judgement, sets, judgement.none)
    if not causes:  # each effect does less than shows, or is a small error
        # What a floor of the sensor alone does not hide under logged commands may be significant and tiny.
        small = judgement.small_errors(first) >= set(first.names) and remains <= settings.left
        nothing = small or (before <= settings.left and not judgement.tolerant)
        kind = "no_gap" if nothing else "unexplained"
    elif remains <= settings.left:
        kind = "explained" if clear else "ambiguous"
    else:
        explained = 1.0 - math.sqrt(remains / max(before, 1e-300))
        shown = explained >= settings.little or bool(sets.known)
        kind = "partly_explained" if shown else "unexplained"
        if kind == "unexplained":
            causes, rest = (), ()
    return Verdict(kind, causes, rest, other, chance_alone)


def by_own_covariance(verdict: Verdict, judgement: Judgement, sets: JudgedSets, own: Judgement) -> Verdict:
    """Return an answer without any effect, by the covariance of the nominal robot itself.

    Sets are judged by the covariance about the best of them. Small errors may do much more to that robot than
    to the nominal one, as where a tether nearly stops it. What is allowed there is allowed there only.

    Args:
        verdict: the answer by the covariance about the best set.
        judgement: the trials and the sets.
        sets: the sets; trials that the first of them does not fit do not count.
        own: the trials by the covariance of the nominal robot.
    """
    remains = _upper(judgement, sets, own.trial_set.mean_squares(own.none.whitened))
    return _without_effects(verdict, remains, judgement.settings.verdict)


def _without_effects(verdict: Verdict, remains: float, settings: VerdictSettings) -> Verdict:
    """Return an answer that names no effect, by what the nominal robot leaves."""
    kind = "no_gap" if remains <= settings.left else "unexplained"
    other = other_probability(remains / settings.other_half, settings)
    return replace(verdict, kind=kind, other_probability=other)


def _named(
    judgement: Judgement, sets: JudgedSets, doubtful: Collection[str], least: float
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the effects that are at work and change at least so much, and those that may be."""
    settings = judgement.settings.verdict
    chances = at_work(judgement, sets, least)
    likely = tuple(name for name, chance in chances.items() if chance > settings.at_work)
    rest = [name for name in likely if name in doubtful]
    rest += [n for n, chance in chances.items() if settings.possible <= chance <= settings.at_work]
    rest += stand_ins(judgement, sets, likely, least)
    return tuple(name for name in likely if name not in doubtful), tuple(dict.fromkeys(rest))


def _hinted(judgement: Judgement, sets: JudgedSets) -> list[str]:
    """Return the effects of gaits that are as probable as causes, and change at least half as much.

    Single effects were fitted only to gaits.
    """
    chances = at_work(judgement, sets, _least_hinted(judgement)) if judgement.fits else {}
    return [name for name, chance in chances.items() if chance > judgement.settings.verdict.at_work]


def _least_hinted(judgement: Judgement) -> float:
    """Return how much an effect changes at least that may be a cause though it changes less than matters."""
    settings = judgement.settings.verdict
    share = settings.hinted if judgement.tolerant else settings.hinted**2  # of floors, or of squares
    return share * settings.matters


def at_work(judgement: Judgement, sets: JudgedSets, least: float) -> Mapping[str, float]:
    """Return the probability over all sets that an effect is at work and matters, the likeliest first.

    An effect that is no larger than the tolerances allow is a small error of the robot, and does not count.

    Args:
        judgement: the trials and the sets.
        sets: the sets.
        least: how much an effect that matters changes at least.
    """
    totals: dict[str, float] = {}
    chances = judgement.ranking.probabilities.tolist()
    for candidate, changes, chance in zip(sets.candidates, sets.changes, chances, strict=True):
        small = judgement.small_errors(candidate)
        for one in candidate.hypotheses:
            shows = changes[one.name] >= least and one.effect.name not in small
            if one.name in sets.known or shows:
                totals[one.effect.name] = totals.get(one.effect.name, 0.0) + chance
    return dict(sorted(totals.items(), key=lambda item: -item[1]))


def stand_ins(
    judgement: Judgement, sets: JudgedSets, causes: Collection[str], least: float
) -> tuple[str, ...]:
    """Return effects that do to the data what a cause does, and are no causes because they are unusual.

    Their probability is that over the sets without one of the causes, all effects being as usual.

    Args:
        judgement: the trials and the sets.
        sets: the sets.
        causes: the effects that are at work.
        least: how much an effect that matters changes at least.
    """
    settings = judgement.settings.verdict
    totals: dict[str, float] = {}
    chances = evidence.probabilities(sets.scores_if_usual).tolist()
    for candidate, changes, chance in zip(sets.candidates, sets.changes, chances, strict=True):
        if not set(causes) <= set(candidate.names):
            for one in candidate.hypotheses:
                if one.effect.unusual and changes[one.name] >= least:
                    totals[one.effect.name] = totals.get(one.effect.name, 0.0) + chance
    return tuple(n for n, chance in totals.items() if chance >= settings.possible and n not in causes)


def misfit_trials(judgement: Judgement, sets: JudgedSets) -> dict[str, float]:
    """Return the trials that the first set does not fit, with how many times the median trial they leave."""
    left = sets.judge.heldout_left(judgement.first)
    typical = max(1.0, float(np.median(left)))
    names = [one.aligned.trial.name for one in judgement.trial_set.trials]
    limit = sets.judge.settings.misfit
    return {
        name: float(one / typical)
        for name, one in zip(names, left.tolist(), strict=True)
        if one > limit * typical
    }


def predicts(judgement: Judgement, sets: JudgedSets, meter: GapMeter, floors: Sequence[Floors]) -> bool:
    """Whether the first set predicts the marker of held-out gaits no worse than the nominal robot does.

    Where the covariance is wide, as in a fast gait of a robot that is a little wrong, a worse prediction may
    be as likely as a better one. No effect is then blamed. Trials that the set does not fit do not count, and
    a gap within the floor of its trial counts as the floor. Without a marker nothing is said against the set.
    """
    odd = misfit_trials(judgement, sets)
    names = [one.aligned.trial.name for one in judgement.trial_set.trials]
    least = [marker_floor(own) for own in floors]
    gaps = [meter.measure(judgement.first, least[i], i) for i, name in enumerate(names) if name not in odd]
    after = sum(max(gap.after, gap.floor) ** 2 for gap in gaps)
    return after <= sum(max(gap.before, gap.floor) ** 2 for gap in gaps)


def _typical(judgement: Judgement, sets: JudgedSets, candidate: Candidate) -> float:
    """Return the mean whitened square that is left of held-out data, see `_upper`."""
    return _upper(judgement, sets, sets.judge.heldout_left(candidate))


def _upper(judgement: Judgement, sets: JudgedSets, left: Array) -> float:
    """Return what is left of the trial at the upper quartile.

    Trials that the first set does not fit do not count, where these are fewer than half.

    Args:
        judgement: the trials and the sets.
        sets: the sets.
        left: what is left of each trial, shape (trials,).
    """
    if sets.candidates:
        odd = misfit_trials(judgement, sets)
        fits = np.array([one.aligned.trial.name not in odd for one in judgement.trial_set.trials])
        left = left[fits] if 2 * np.sum(fits) > len(fits) else left
    return float(np.quantile(left, 0.75))
