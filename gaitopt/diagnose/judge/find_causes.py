"""The search for the cause of a gap: all hypotheses fitted and judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.fit.heads import head_of
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.residual import WhitenedTrial
from gaitopt.diagnose.fit.schedule import complete, finish, fit_all, fit_leading
from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.gap.floor import Floors, above_floor
from gaitopt.diagnose.gap.predict import predict_each
from gaitopt.diagnose.judge.causes import Causes
from gaitopt.diagnose.judge.chance import fitted_chance
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.covariance import with_tolerances
from gaitopt.diagnose.judge.gait_sets import GaitSets
from gaitopt.diagnose.judge.gap import Gap, GapMeter
from gaitopt.diagnose.judge.judged_sets import JudgedSets
from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.diagnose.judge.perturbed import perturbed_about
from gaitopt.diagnose.judge.set_causes import judged_by_sets
from gaitopt.diagnose.judge.set_verdict import by_own_covariance, conclude_sets, predicts
from gaitopt.diagnose.judge.small_errors import perturbed_robots
from gaitopt.diagnose.judge.unevenness import unevenness
from gaitopt.diagnose.judge.verdict import (
    Verdict,
    conclude,
    falls_short,
    other_probability,
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

    @property
    def above_floor(self) -> NDArray[np.bool_]:
        """Whether a gap of each trial is above its floor, so that the trial can show a cause; shape
        (trials,)."""
        return np.array([above_floor(*pair) for pair in zip(self.trials, self.floors, strict=True)])


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
    """Fit and judge every hypothesis alone, and sets of them where none alone explains an exactly made robot.

    Under logged commands sets are searched at once: each trial starts anew, so that responses are smooth.

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
        sets = judged_by_sets(judgement, gap.floors, hypotheses, context)
        return _concluded_sets(*sets, gap, hypotheses, context)
    uneven = unevenness(trial_set, gap.floors, prepared.perturbed, settings.verdict)
    before = trial_set.mean_squares(nominal.whitened)
    within = np.all(before[gap.above_floor] <= settings.verdict.no_gap)
    if within and uneven <= settings.verdict.uneven:
        nothing = np.empty((0, len(trial_set.row_blocks)))
        return Causes(judgement, Verdict("no_gap"), None, nothing, uneven, context.seed)
    first, wide = _fitted_alone(judgement, hypotheses, context)
    if falls_short(wide):
        return _explained_by_gait_sets(first, judgement, gap, hypotheses, context)
    faint = bool(before.max() <= settings.verdict.faint_gap)
    return _concluded(wide.refine_covariance(context), gap, trial_set, faint, context)


def _fitted_alone(
    judgement: Judgement, hypotheses: Sequence[Hypothesis], context: Context
) -> tuple[Judgement, Judgement]:
    """Return what a search for sets begins with, and what one effect alone explains best.

    Both have fits of single effects. The first ones are of the trials' beginnings where the gap is clear
    there. The second ones are of whole trials, unless no effect alone explains the beginnings. Where the gap
    is faint, these tell only which effects are worth whole trials. If none of those explains the trials,
    every effect is tried there.

    Raises:
        GaitoptError: no robot with an effect can be simulated.
    """
    head = head_of(judgement.trial_set, context.settings.fit)
    if head is not None:
        begun = replace(judgement, trial_set=head.trial_set, nominal=head.nominal)
        first = _fitted(begun, hypotheses, context)
        wide = first if falls_short(first) else _fitted_to_whole_trials(judgement, first, context)
        if not falls_short(wide):
            return first, wide
        if head.clear:
            return _completed(first, context), wide
    whole = _fitted(judgement, hypotheses, context)
    whole = _completed(whole, context) if falls_short(whole) else whole
    return whole, whole


def _fitted(judgement: Judgement, hypotheses: Sequence[Hypothesis], context: Context) -> Judgement:
    """Return a judgement with fits of single effects."""
    runner, settings = context.runner, context.settings.fit
    fits = fit_all(judgement.trial_set, hypotheses, judgement.nominal, runner, settings)
    finish(fits, runner, settings)
    fitted = replace(judgement, fits=tuple(fits))
    if not fitted.singles:
        raise GaitoptError("no effect can be tried: the simulation of every robot that has one fails")
    return fitted


def _fitted_to_whole_trials(judgement: Judgement, first: Judgement, context: Context) -> Judgement:
    """Return the whole trials with fits of those single effects that may explain their beginnings.

    Args:
        judgement: the trials.
        first: their beginnings with fits of single effects.
        context: simulates robots.
    """
    runner, settings = context.runner, context.settings.fit
    fits = fit_leading(judgement.trial_set, judgement.nominal, first.fits, runner, settings)
    return replace(judgement, fits=tuple(fits))


def _completed(judgement: Judgement, context: Context) -> Judgement:
    """Return a judgement with effects that promise little alone, too: they may act beside others."""
    complete(judgement.fits, context.runner, context.settings.fit)
    return replace(judgement, fits=judgement.fits)  # so that what was derived from the fits is forgotten


def _explained_by_gait_sets(
    first: Judgement, wide: Judgement, gap: NominalGap, hypotheses: Sequence[Hypothesis], context: Context
) -> Causes:
    """Return the answer from few effects on an exactly made robot, or from any on one that is a little wrong.

    The cycles of an exactly made robot are even: where they are not, only the second way is open.

    Args:
        first: the trials, or their beginnings, with fits of single effects.
        wide: the whole trials.
        gap: the trials aligned with the nominal robot.
        hypotheses: the effects to try, each on its targets.
        context: simulates robots.
    """
    search = GaitSets(first, wide, gap.floors, hypotheses, context)
    exact = search.exactly()
    found = None if exact is None else _concluded_sets(*exact, gap, hypotheses, context)
    if found is not None and found.unevenness <= context.settings.verdict.uneven:
        return found
    return _concluded_sets(*search.with_tolerances(), gap, hypotheses, context)


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
    any_effect = bool(judged.candidates)
    first = judgement.first if any_effect else judgement.none
    robots = perturbed_about(judgement.trial_set, first, context)
    # Scores over the luck of almost equal robots say which effects of gaits are at work.
    doubtful = judged.doubtful(robots.changes) if any_effect and gap.has_logs else ()
    meter = judgement.meter(context.seed)
    marker, angles = _gaps(judgement, gap, meter) if any_effect else (None, None)
    closes = gap.has_logs and angles is not None and angles.closed
    verdict = conclude_sets(judgement, judged, len(hypotheses), doubtful, closes)
    if any_effect and not gap.has_logs and not predicts(judgement, judged, meter, gap.floors):
        verdict = verdict.without_causes()
    if verdict.kind == "no_gap" and judgement.tolerant:
        verdict = by_own_covariance(verdict, judgement, judged, with_tolerances(judgement, context))
    uneven, chance, limit = 0.0, None, context.settings.verdict.uneven  # logged commands have no cycles
    if not gap.has_logs:
        # A clock that is a little too fast makes cycles differ, too, if they are taken from it.
        usual = (judgement.tolerant_robots or robots).comparisons
        uneven = unevenness(judgement.trial_set, gap.floors, usual, context.settings.verdict)
        if uneven > limit and judgement.tolerant:
            point = [*zip(first.hypotheses, first.at, strict=True)]
            chance = fitted_chance(judgement.trial_set, gap.floors, usual, point, hypotheses, context)
    left = uneven if chance is None else chance.left_of(uneven)
    if left > limit:
        verdict = verdict.beside_chance(other_probability(left / limit, context.settings.verdict))
    return Causes(judgement, verdict, marker, robots.changes, uneven, context.seed, angles, chance)


def _gaps(judgement: Judgement, gap: NominalGap, meter: GapMeter) -> tuple[Gap, Gap | None]:
    """Return the gap with the first candidate, and that of the angles; None where none was measured."""
    angles = None if gap.floor_rad is None else meter.measure_angles(judgement.first, gap.floor_rad)
    return meter.measure(judgement.first, gap.floor_m), angles


def _concluded(
    judgement: Judgement, gap: NominalGap, trial_set: TrialSet, faint: bool, context: Context
) -> Causes:
    """Return the answer that single effects allow.

    Args:
        judgement: the whole trials and the effects, by the covariance about the leading ones.
        gap: the trials aligned with the nominal robot.
        trial_set: the trials by the first covariance.
        faint: whether the gap counts as none if no effect explains it.
        context: simulates robots; seed and settings.
    """
    robots = perturbed_about(judgement.trial_set, judgement.first, context)
    uneven = unevenness(trial_set, gap.floors, robots.comparisons, context.settings.verdict)
    verdict = conclude(judgement, robots, gap.above_floor, uneven, faint, context.seed)
    measured, angles = _gaps(judgement, gap, judgement.meter(context.seed))
    return Causes(judgement, verdict, measured, robots.changes, uneven, context.seed, angles)
