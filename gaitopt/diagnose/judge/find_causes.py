"""The search for the cause of a gap: all hypotheses fitted and judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.fit.heads import head_of
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.pair_search import PairSearch
from gaitopt.diagnose.fit.residual import WhitenedTrial
from gaitopt.diagnose.fit.runner import FITTING_PAIRS
from gaitopt.diagnose.fit.schedule import complete, finish, fit_all, fit_leading
from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.gap.floor import Floors
from gaitopt.diagnose.gap.predict import predict_each
from gaitopt.diagnose.judge.causes import Causes
from gaitopt.diagnose.judge.chance import fitted_chance
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.gait_sets import (
    judged_by_gait_sets,
    log_evidence,
    log_evidence_of,
    with_tolerances,
)
from gaitopt.diagnose.judge.gap import GapMeter
from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.diagnose.judge.perturbed import PerturbedRobots, perturbed_about
from gaitopt.diagnose.judge.set_causes import judged_by_sets
from gaitopt.diagnose.judge.set_verdict import conclude_sets
from gaitopt.diagnose.judge.sets import JudgedSets
from gaitopt.diagnose.judge.small_errors import perturbed_robots
from gaitopt.diagnose.judge.unevenness import unevenness
from gaitopt.diagnose.judge.verdict import (
    Verdict,
    conclude,
    falls_short,
    is_shown,
    other_probability,
    pair_is_needed,
)
from gaitopt.simulation.rollout import Simulator


@dataclass(frozen=True)
class NominalGap:
    """Trials aligned with the nominal robot.

    Attributes:
        simulator: the nominal robot.
        trials: the trials aligned with its predictions.
        floors: floor of each signal of each trial.
        floor_m: the marker's floor over all trials, m.
        floor_rad: the same of the angles, rad; None where no angle was measured.
    """

    simulator: Simulator
    trials: Sequence[Aligned]
    floors: Sequence[Floors]
    floor_m: float
    floor_rad: float | None = None

    @property
    def has_logs(self) -> bool:
        """Whether the commands of any trial have no period."""
        return any(aligned.trial.has_log for aligned in self.trials)


@dataclass(frozen=True)
class PreparedTrials:
    """Trials ready for fitting.

    Attributes:
        trial_set: the trials, whitened by the covariance of the nominal robot.
        nominal: the trials compared with the nominal robot.
        perturbed: the trials compared with robots perturbed about it; None for those that failed.
    """

    trial_set: TrialSet
    nominal: Comparison
    perturbed: tuple[Comparison | None, ...]


@dataclass(frozen=True)
class _Explanation:
    """Candidates, robots perturbed about the first of them, and the unevenness relative to these."""

    judgement: Judgement
    robots: PerturbedRobots
    uneven: float


def prepare_trials(gap: NominalGap, context: Context) -> PreparedTrials:
    """Return trials whitened by the covariance of robots perturbed about the nominal one."""
    settings = context.settings
    count = settings.small_errors.robots
    robots = perturbed_robots(gap.simulator, context.seed, count, settings=settings.small_errors)
    records = [aligned.trial for aligned in gap.trials]
    predicted = predict_each([(robot, 0) for robot in robots], records, context.executor)
    trials = [
        WhitenedTrial.of(aligned, floors, [row[i] for row in predicted], settings.whitening)
        for i, (aligned, floors) in enumerate(zip(gap.trials, gap.floors, strict=True))
    ]
    nominal = [aligned.simulated for aligned in gap.trials]
    trial_set = TrialSet.of(gap.simulator, trials, nominal)
    comparison = trial_set.compare([0.0], nominal)
    if comparison is None:
        raise ValueError("the nominal prediction was checked when it was aligned")
    return PreparedTrials(trial_set, comparison, tuple(trial_set.compare([], row) for row in predicted))


def find_causes(gap: NominalGap, hypotheses: Sequence[Hypothesis], context: Context) -> Causes:
    """Fit and judge every hypothesis, and pairs of them if one effect is not enough.

    Sets of any size are searched under logged commands, which start anew in each trial, so that responses are
    smooth; and where the recordings are more probable if the robot is a little wrong in everything.

    Args:
        gap: the trials aligned with the nominal robot.
        hypotheses: the effects to try, each on its targets.
        context: simulates robots; seed and settings.

    Raises:
        GaitoptError: no robot with an effect can be simulated.
    """
    prepared, settings = prepare_trials(gap, context), context.settings
    trial_set, nominal = prepared.trial_set, prepared.nominal
    judgement = Judgement(trial_set, nominal, settings=settings)
    if gap.has_logs:
        return _explained_by_sets(judgement, gap, hypotheses, context)
    uneven = unevenness(trial_set, gap.floors, prepared.perturbed, settings.verdict)
    before = judgement.none.left(trial_set)
    if before <= settings.verdict.no_gap and uneven <= settings.verdict.uneven:
        nothing = np.empty((0, len(trial_set.row_blocks)))
        return Causes(judgement, Verdict("no_gap"), None, nothing, uneven, context.seed)
    first = _fitted_alone(judgement, hypotheses, context)
    tolerant = with_tolerances(first, context) if falls_short(first) else None
    if tolerant is not None and _likelier(tolerant, log_evidence(first, 2), 2):
        return _explained_by_several(tolerant, judgement, gap, hypotheses, context)
    finish(first.fits, context.runner, settings.fit)
    first = replace(first)  # the one before keeps the candidates of its unfinished fits
    wide = _fitted_to_whole_trials(judgement, first, context)
    short = falls_short(wide)
    found = _explained(wide.refine_covariance(context), gap, trial_set, context)
    if falls_short(found.judgement):
        # By the first covariance: effects that do not explain the gap must not decide how it is whitened.
        found = _explained_by_two(wide, gap, trial_set, context) or found
    concluded = _concluded(found, gap, before <= settings.verdict.faint_gap, context)
    if short and concluded.verdict in ("partly_explained", "unexplained"):
        whole = with_tolerances(wide, context)
        if _likelier(whole, log_evidence_of(found.judgement.first, found.judgement)):
            tolerant = tolerant or with_tolerances(first, context)
            return _explained_by_several(tolerant, judgement, gap, hypotheses, context)
    return concluded


def _fitted_alone(judgement: Judgement, hypotheses: Sequence[Hypothesis], context: Context) -> Judgement:
    """Return the trials' beginnings, or the whole trials if these tell too little, with single effects.

    Raises:
        GaitoptError: no robot with an effect can be simulated.
    """
    runner, settings = context.runner, context.settings.fit
    head = head_of(judgement.trial_set, settings)
    trial_set, nominal = head or (judgement.trial_set, judgement.nominal)
    fits = fit_all(trial_set, hypotheses, nominal, runner, settings)
    fitted = replace(judgement, trial_set=trial_set, nominal=nominal, fits=tuple(fits))
    if not fitted.singles:
        raise GaitoptError("no effect can be tried: the simulation of every robot that has one fails")
    return fitted


def _fitted_to_whole_trials(judgement: Judgement, first: Judgement, context: Context) -> Judgement:
    """Return the whole trials with fits of those single effects that may explain the beginnings.

    Where none of them explains the trials, all effects are fitted.

    Args:
        judgement: the trials.
        first: their beginnings with fits of single effects, or they themselves.
        context: simulates robots.
    """
    if first.n_rows == judgement.n_rows:
        return first
    runner, settings = context.runner, context.settings.fit
    fits = fit_leading(judgement.trial_set, judgement.nominal, first.fits, runner, settings)
    wide = replace(judgement, fits=tuple(fits))
    if wide.singles and not falls_short(wide):
        return wide
    complete(fits, runner, settings)
    return replace(judgement, fits=tuple(fits))


def _likelier(tolerant: Judgement, other: float, most: int = 1) -> bool:
    """Whether the tolerances make the recordings more probable than something else does.

    Args:
        tolerant: every candidate of one effect, by the covariance of the tolerances.
        other: logarithm of the other probability, see `log_evidence`.
        most: number of effects that may be added up.
    """
    return log_evidence(tolerant, most) > other + tolerant.settings.verdict.tolerant * tolerant.n_rows


def _explained_by_several(
    tolerant: Judgement,
    wide: Judgement,
    gap: NominalGap,
    hypotheses: Sequence[Hypothesis],
    context: Context,
) -> Causes:
    """Return the answer from sets of effects of any size on robots that are a little wrong in everything.

    Args:
        tolerant: every candidate of one effect, by the covariance of the tolerances; for the trials, or for
            their beginnings.
        wide: the whole trials.
        gap: the trials aligned with the nominal robot.
        hypotheses: the effects to try, each on its targets.
        context: simulates robots.
    """
    judgement, judged = judged_by_gait_sets(tolerant, wide, gap.floors, hypotheses, context)
    return _concluded_sets(judgement, judged, gap, hypotheses, context)


def _explained(judgement: Judgement, gap: NominalGap, trial_set: TrialSet, context: Context) -> _Explanation:
    """Return candidates with robots perturbed about the first of them."""
    robots = perturbed_about(judgement.trial_set, judgement.first, context)
    uneven = unevenness(trial_set, gap.floors, robots.comparisons, context.settings.verdict)
    return _Explanation(judgement, robots, uneven)


def _explained_by_two(
    wide: Judgement, gap: NominalGap, trial_set: TrialSet, context: Context
) -> _Explanation | None:
    """Return the candidates of two effects; None unless two are needed, significant and even enough.

    Args:
        wide: every candidate of one effect, by the first covariance.
        gap: the trials aligned with the nominal robot.
        trial_set: the trials by the first covariance.
        context: simulates robots.
    """
    settings = context.settings
    compare = context.runner.stage(FITTING_PAIRS)
    pairs = PairSearch(wide.fits, wide.nominal, compare, settings.pairs).run()
    if not pairs:
        return None
    two = replace(wide, pairs=tuple(pairs)).refine_covariance(context)
    if not pair_is_needed(two):
        return None
    found = _explained(two, gap, trial_set, context)
    even = found.uneven <= settings.verdict.uneven
    return found if is_shown(two, found.robots) and even else None


def _explained_by_sets(
    judgement: Judgement, gap: NominalGap, hypotheses: Sequence[Hypothesis], context: Context
) -> Causes:
    """Return the answer from sets of effects of any size."""
    judgement, judged = judged_by_sets(judgement, gap.floors, hypotheses, context)
    return _concluded_sets(judgement, judged, gap, hypotheses, context)


def _concluded_sets(
    judgement: Judgement,
    judged: JudgedSets,
    gap: NominalGap,
    hypotheses: Sequence[Hypothesis],
    context: Context,
) -> Causes:
    """Return the answer that sets of effects allow.

    Args:
        judgement: the trials and the sets.
        judged: the sets.
        gap: the trials aligned with the nominal robot.
        hypotheses: the effects that were tried, each on its targets.
        context: simulates robots; seed and settings.
    """
    if not judged.candidates:
        verdict = conclude_sets(judgement, judged, len(hypotheses))
        none = np.empty((0, judgement.n_rows))
        return Causes(judgement, verdict, None, none, 0.0, context.seed)
    settings = context.settings.verdict
    robots = perturbed_about(judgement.trial_set, judgement.first, context)
    verdict = conclude_sets(judgement, judged, len(hypotheses), judged.doubtful(robots.changes))
    uneven, chance, without_chance = 0.0, None, robots.comparisons  # logged commands have no cycles
    if not gap.has_logs:
        # A clock that is a little too fast makes cycles differ, too, if they are taken from it.
        without_chance = judgement.tolerant_robots or robots.comparisons
        uneven = unevenness(judgement.trial_set, gap.floors, without_chance, settings)
    if uneven > settings.uneven:
        point = [*zip(judgement.first.hypotheses, judgement.first.at, strict=True)]
        chance = fitted_chance(judgement.trial_set, gap.floors, without_chance, point, hypotheses, context)
        left = uneven if chance is None else chance.unevenness
        if left > settings.uneven:
            verdict = verdict.beside_chance(other_probability(left / settings.uneven, settings))
    draws = context.settings.evidence.gap_draws
    meter = GapMeter(judgement.trial_set, judgement.nominal, context.seed, draws)
    measured = meter.measure(judgement.first, gap.floor_m)
    angles = None if gap.floor_rad is None else meter.measure_angles(judgement.first, gap.floor_rad)
    return Causes(judgement, verdict, measured, robots.changes, uneven, context.seed, angles, chance)


def _concluded(found: _Explanation, gap: NominalGap, faint: bool, context: Context) -> Causes:
    """Return the answer that the evidence allows.

    Args:
        found: the candidates.
        gap: the trials aligned with the nominal robot.
        faint: whether the gap counts as none if no effect explains it.
        context: seed and settings.
    """
    judgement = found.judgement
    verdict = conclude(judgement, found.robots, found.uneven, faint, context.seed)
    draws = context.settings.evidence.gap_draws
    meter = GapMeter(judgement.trial_set, judgement.nominal, context.seed, draws)
    measured = meter.measure(judgement.first, gap.floor_m)
    angles = None if gap.floor_rad is None else meter.measure_angles(judgement.first, gap.floor_rad)
    return Causes(judgement, verdict, measured, found.robots.changes, found.uneven, context.seed, angles)
