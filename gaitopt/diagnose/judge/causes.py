"""The cause of a gap: all candidates fitted and judged, and the answer that their evidence allows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.fit.cache import SimulationCache
from gaitopt.diagnose.fit.fitting import Comparison, Note, TrialSet, build_trial_set, fit_all
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.pairs import fit_pairs
from gaitopt.diagnose.fit.residual import whiten_trial
from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.gap.floor import Floors
from gaitopt.diagnose.gap.predict import predict_each
from gaitopt.diagnose.judge import evidence, precision
from gaitopt.diagnose.judge.covariance import Judgement
from gaitopt.diagnose.judge.evidence import Candidate, Gap
from gaitopt.diagnose.judge.precision import PerturbedRobots
from gaitopt.diagnose.judge.small_errors import perturbed_robots
from gaitopt.diagnose.judge.unevenness import UNEVEN, unevenness
from gaitopt.simulation.rollout import Simulator

NO_GAP = 0.8
"""A nominal robot that leaves no more whitened squares than this, in every trial, has no significant gap.

It is less than a right model may leave: a small effect that does the same in all trials hides in their mean
squares, not from a robot that has it.
"""

FAINT_GAP = 1.8
"""And one that leaves no more than this has none either, if no effect explains it."""

LEFT = 2.0
"""A candidate that leaves more than this leaves a significant gap."""

_OTHER_HALF, _OTHER_SLOPE = 3.0, 3.0
"""Something else is as likely as not where the best candidate leaves so much; and how fast that changes."""

SIGNIFICANCE = 0.02
"""An effect is blamed where chance alone lets one gain as much no more often than this."""

_ABOVE_NONE = 3.0
"""An effect belongs to the answer beside the first if it is so many times as probable as none."""

_TRY_PAIRS = 1.2
"""Where the best effect leaves more than this, two are tried: a right one leaves less, nearly always."""

_PAIR_ERRORS = 1.0
"""Standard errors by which two effects must foretell more than one."""

_PAIR_GAIN = 0.75
"""Share of the loss of one effect that two may leave at most."""

_LITTLE = 0.3
"""A smaller part of the whitened residual explains nothing."""


@dataclass(frozen=True)
class Causes:
    """What may have caused the gap.

    Attributes:
        trial_set: the trials.
        nominal: the trials beside the nominal robot.
        none: the candidate without effect.
        candidates: the other candidates, the most probable first.
        chances: their probabilities, if the cause is in the library.
        verdict: the answer's kind.
        causes: the effects blamed.
        ambiguous_with: effects that the data cannot tell from these.
        other_probability: how likely the cause is not in the library, or not alone.
        p_value: of the first candidate against none.
        gap: on held-out data; None where nothing was fitted.
        perturbations: whitened changes with robots drawn about the first candidate, shape (draws, rows).
        uneven: by how much the recorded cycles differ, in differences of such robots' cycles.
        seed: seed of what is random.
        robots: robots simulated.
    """

    trial_set: TrialSet
    nominal: Comparison
    none: Candidate
    candidates: tuple[Candidate, ...]
    chances: NDArray[np.float64]
    verdict: str
    causes: list[str]
    ambiguous_with: list[str]
    other_probability: float
    p_value: float
    gap: Gap | None
    perturbations: NDArray[np.float64]
    uneven: float
    seed: int
    robots: int

    @property
    def best(self) -> Candidate | None:
        """The most probable candidate."""
        return self.candidates[0] if self.candidates else None

    @cached_property
    def effects(self) -> list[dict[str, Any]]:
        """Rows of ``effects``: one for each effect, with its most probable target."""
        rows: dict[str, dict[str, Any]] = {}
        for candidate, chance in zip(self.candidates, self.chances.tolist(), strict=True):
            for index, fit in enumerate(candidate.fits):
                name, target = fit.hypothesis.effect.name, fit.hypothesis.target
                if name not in rows:
                    rows[name] = self._row(candidate, index)
                rows[name]["probability"] += (1.0 - self.other_probability) * chance
                targets = rows[name]["targets"]
                targets[target] = targets.get(target, 0.0) + chance
        return sorted(rows.values(), key=lambda row: -row["probability"])

    def gap_of_trial(self, trial: int, floor: float) -> Gap | None:
        """Return the held-out gap of one trial, its floor given in m; None where nothing was fitted."""
        if self.gap is None or self.best is None:
            return None
        return evidence.gap_of(self.trial_set, self.nominal, self.best, floor, self.seed, trial)

    def _row(self, candidate: Candidate, index: int) -> dict[str, Any]:
        fit = candidate.fits[index]
        effect, at = fit.hypothesis.effect, candidate.at[index]
        ci90 = precision.intervals(candidate, self.trial_set, self.perturbations)[index]
        floor = self.gap.floor if self.gap else 0.0
        gap = evidence.gap_of(self.trial_set, self.nominal, candidate, floor, self.seed) if self.gap else None
        return {
            "name": effect.name,
            "target": fit.hypothesis.target,
            "probability": 0.0,
            "parameters": {effect.parameter: {"value": fit.hypothesis.value(at), "ci90": list(ci90)}},
            "unit": effect.unit,
            "heldout_shrinkage": gap.shrinkage if gap else None,
            "heldout_left": evidence.left(self.trial_set, candidate),
            "alike": evidence.cosine(self.nominal, candidate, self.candidates[0]),
            "targets": {},
        }


def prepared(
    simulator: Simulator,
    trials: Sequence[Aligned],
    floors: Sequence[Floors],
    executor: Executor,
    seed: int,
    cache: SimulationCache | None = None,
) -> tuple[TrialSet, Comparison, list[Comparison | None]]:
    """Return the trials ready for fitting, beside the nominal robot, and beside robots drawn about it."""
    robots = perturbed_robots(simulator, seed)
    records = [aligned.trial for aligned in trials]
    drawn = predict_each([(robot, 0) for robot in robots], records, executor)
    views = [
        whiten_trial(aligned, floor, [row[i] for row in drawn])
        for i, (aligned, floor) in enumerate(zip(trials, floors, strict=True))
    ]
    nominal = [aligned.simulated for aligned in trials]
    ready = build_trial_set(simulator.problem, simulator, views, nominal, cache)
    point = ready.point([0.0], nominal)
    if point is None:
        raise ValueError("the nominal prediction was checked when it was aligned")
    return ready, point, [ready.point([], row) for row in drawn]


def find_causes(
    simulator: Simulator,
    trials: Sequence[Aligned],
    floors: Sequence[Floors],
    floor_m: float,
    executor: Executor,
    seed: int,
    note: Note,
    candidates: Sequence[Hypothesis],
    cache: SimulationCache | None = None,
) -> Causes:
    """Fit and judge every candidate.

    Args:
        simulator: the nominal robot.
        trials: the trials beside the nominal prediction.
        floors: floor of each signal of each.
        floor_m: the marker's floor over all trials, m.
        executor: where robots are simulated.
        seed: seed of what is random.
        note: called as it goes.
        candidates: what is to be tried.
        cache: keeps what is simulated, and has what was; None to keep nothing.

    Raises:
        GaitoptError: no robot that is to be tried can be simulated.
    """
    ready, nominal, about = prepared(simulator, trials, floors, executor, seed, cache)
    look = Judgement(ready, nominal, ())
    uneven = unevenness(ready, floors, about)
    before = evidence.left(ready, look.none)
    if before <= NO_GAP and uneven <= UNEVEN:
        return _without_gap(look, uneven, seed)
    look = replace(look, fits=tuple(fit_all(ready, candidates, nominal, executor, note)))
    if not look.singles:
        raise GaitoptError("no effect can be tried: the simulation of every robot that has one fails")
    wide, look = look, look.refine_covariance(executor, seed, note)
    drawn = precision.perturbed_about(look.trial_set, look.first, executor, seed)
    uneven = unevenness(ready, floors, drawn.comparisons)
    if _one_falls_short(look):
        # By the first covariance: effects that do not explain the gap must not teach what explains it.
        found = _of_two(wide, executor, seed, note)
        if found and (uneven_two := unevenness(ready, floors, found[1].comparisons)) <= UNEVEN:
            look, drawn, uneven = *found, uneven_two
    return _concluded(look, drawn, uneven, floor_m, before <= FAINT_GAP, seed)


def _one_falls_short(look: Judgement) -> bool:
    """Whether the best single effect leaves more than a right one does, or would go on where its range ends.

    At its end it may do another effect's work besides its own, and the covariance learnt there hides that.
    """
    best = min(look.singles, key=lambda candidate: candidate.evidence)
    (fit,), (at,) = best.fits, best.at
    return fit.hypothesis.at_bound(at) or evidence.left(look.trial_set, best) > _TRY_PAIRS


def _of_two(
    wide: Judgement, executor: Executor, seed: int, note: Note
) -> tuple[Judgement, PerturbedRobots] | None:
    """Return the candidates of two effects and robots drawn about the first, if two are needed and shown.

    Args:
        wide: every candidate of one effect.
        executor: where robots are simulated.
        seed: seed of the draws.
        note: called as it goes.
    """
    pairs = tuple(fit_pairs(wide.fits, wide.nominal, executor, note))
    if not pairs:
        return None
    two = replace(wide, pairs=pairs).refine_covariance(executor, seed, note)
    if not _needed(two):
        return None
    drawn = precision.perturbed_about(two.trial_set, two.first, executor, seed)
    return (two, drawn) if _shown(two, drawn) else None


def _without_gap(look: Judgement, uneven: float, seed: int) -> Causes:
    nothing = np.empty((0, len(look.trial_set.blocks)))
    return Causes(
        look.trial_set, look.nominal, look.none, (), np.empty(0), "no_gap", [], [], 0.0, 1.0, None, nothing,
        uneven, seed, 0,
    )  # fmt: skip


def _concluded(
    look: Judgement, drawn: PerturbedRobots, uneven: float, floor_m: float, faint: bool, seed: int
) -> Causes:
    """Return the answer that the evidence allows.

    Args:
        look: the candidates.
        drawn: robots drawn about the first of them.
        uneven: by how much the recorded cycles differ, in differences of these.
        floor_m: the marker's floor over all trials, m.
        faint: whether there is no gap to speak of, if no effect explains it.
        seed: seed of what is random.
    """
    ready, none, first, (order, chances) = look.trial_set, look.none, look.first, look.ranked
    chance_alone = evidence.p_value(ready, look.nominal, look.singles, none.evidence - first.evidence, seed)
    gap = evidence.gap_of(ready, look.nominal, first, floor_m, seed)
    remains = evidence.left(ready, first)
    other = max(_other(remains / _OTHER_HALF), _other(uneven / UNEVEN))
    causes, rest = _named(look)
    if chance_alone > SIGNIFICANCE or not _shown(look, drawn):
        verdict, causes, rest = "no_gap" if faint and uneven <= UNEVEN else "unexplained", [], []
    elif remains > LEFT or uneven > UNEVEN:
        explained = 1.0 - float(np.sqrt(first.heldout_loss.sum() / none.heldout_loss.sum()))
        verdict = "partly_explained"
        if explained < _LITTLE:
            verdict, causes, rest = "unexplained", [], []
    else:
        verdict = "ambiguous" if rest else "explained"
    robots = sum(len(fit.comparisons) for fit in look.fits)
    return Causes(
        ready, look.nominal, none, tuple(order), chances, verdict, causes, rest, other, chance_alone, gap,
        drawn.changes, uneven, seed, robots,
    )  # fmt: skip


def _shown(look: Judgement, drawn: PerturbedRobots) -> bool:
    """Whether the first candidate has no parameter that may as well be neutral."""
    return precision.excludes_none(look.first, look.trial_set, drawn.changes)


def _other(share: float) -> float:
    """Return how likely something else is, from a sign of it in units of that which makes it even odds."""
    return 1.0 / (1.0 + math.exp(-_OTHER_SLOPE * math.log(max(share, 1e-9))))


def _needed(look: Judgement) -> bool:
    """Whether two effects foretell enough more than one, and fit as much better.

    Where a response jumps, one effect may foretell a gait badly that it fits well; a second one does not mend
    that.
    """
    one, both = (
        min(candidates, key=lambda candidate: candidate.evidence)
        for candidates in (look.singles, look.doubles)
    )
    foretold = float(both.heldout_loss.sum()) < _PAIR_GAIN * float(one.heldout_loss.sum())
    fitted = float(both.seen.sum()) < _PAIR_GAIN * float(one.seen.sum())
    return foretold and fitted and evidence.better_by(look.trial_set, both, one) > _PAIR_ERRORS


def _named(look: Judgement) -> tuple[list[str], list[str]]:
    """Return the effects blamed, and those that cannot be told from them; none that is as good as idle."""
    candidates, chances = look.ranked
    if not look.pairs:
        weights = evidence.scores(look.trial_set, [*candidates, look.none])
        idle = _ABOVE_NONE * float(chances[0] * np.exp(weights[-1] - weights.max()))
        totals = evidence.by_effect(candidates, chances)
        names = evidence.answer_set(totals)
        return names[:1], [name for name in names[1:] if totals[name] >= idle]
    first = candidates[0].names
    kept = dict.fromkeys(first, 0.0)
    for candidate, chance in zip(candidates, chances.tolist(), strict=True):
        if chance >= evidence.IN_SET * float(chances[0]):
            for name in candidate.names:
                kept[name] = kept.get(name, 0.0) + chance
    return list(first), [name for name in kept if name not in first]
