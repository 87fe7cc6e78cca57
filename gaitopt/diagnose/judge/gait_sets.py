"""Sets of effects for gaits: few on an exactly made robot, or any number on one that is a little wrong.

A real robot has every small error that the tolerances of its problem allow, and some large ones. Robots with
such small errors give the covariance. What it allows is no reason to name an effect, and effects are added
only while a trial leaves more. An effect is a cause if the robot without it would move visibly differently.
Where two effects explain everything, the robot is taken to be made exactly: small effects are causes, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.firsts import firsts
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.responses import SingleResponses
from gaitopt.diagnose.fit.robust import WideLoss
from gaitopt.diagnose.fit.runner import FITTING_SETS, RobotRequest
from gaitopt.diagnose.fit.set_fit import Point, SetFit
from gaitopt.diagnose.fit.set_search import SetSearch
from gaitopt.diagnose.fit.settings import SetSettings
from gaitopt.diagnose.fit.single import Fit, Residual, robot_request
from gaitopt.diagnose.fit.sums import best_sums
from gaitopt.diagnose.fit.trials import Comparison, Indices
from gaitopt.diagnose.gap.floor import Floors
from gaitopt.diagnose.judge.apart import Apart, floors_apart, squares_apart
from gaitopt.diagnose.judge.candidates import Candidate, heldout
from gaitopt.diagnose.judge.chords import WideChords
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.covariance import About, with_small_errors, with_tolerances
from gaitopt.diagnose.judge.evidence import averaged, probabilities
from gaitopt.diagnose.judge.judged_sets import JudgedSets
from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.diagnose.judge.luck import luck
from gaitopt.diagnose.judge.set_judge import SetJudge
from gaitopt.diagnose.judge.simulated import Simulated

Array = NDArray[np.float64]

_NEUTRAL = 1e-3
"""A coordinate closer to the neutral one than this, in ranges, does nothing."""


@dataclass(frozen=True)
class GaitSets:
    """A search for sets of effects that explain gaits: in the trials' beginnings first, then in whole trials.

    Attributes:
        first: the trials, or their beginnings, and the fits of single effects, by the first covariance.
        wide: the whole trials, by the same covariance.
        floors: floor of each signal of each trial.
        hypotheses: the effects to try, each on its targets.
        context: simulates robots; settings.
        begun: robots that were simulated for `first`.
        ended: robots that were simulated for whole trials.
    """

    first: Judgement
    wide: Judgement
    floors: Sequence[Floors]
    hypotheses: Sequence[Hypothesis]
    context: Context
    begun: Simulated = field(default_factory=Simulated)
    ended: Simulated = field(default_factory=Simulated)

    @property
    def begins_whole(self) -> bool:
        """Whether the search begins with whole trials."""
        return self.first.n_rows == self.wide.n_rows

    def exactly(self) -> tuple[Judgement, JudgedSets] | None:
        """Return few effects on an exactly made robot; None where these do not explain the trials."""
        settings, first = self.context.settings, self.first
        sums = best_sums(first.fits, first.nominal)
        judge, fits = self._run(first, self.hypotheses, settings.exact_sets, self.begun, sums)
        if judge.loss.mean_squares(fits[0].robot.whitened).max() > settings.verdict.exact_begin:
            return None
        judgement, judged = self._end(
            first, judge, fits, settings.exact_sets, with_small_errors, squares_apart
        )
        if not judged.candidates or judged.none >= judged.scores[0]:
            return None
        left = judged.judge.heldout_left(judgement.first)
        return (judgement, judged) if left.max() <= settings.verdict.left else None

    def with_tolerances(self) -> tuple[Judgement, JudgedSets]:
        """Return effects of any number on a robot that is a little wrong in everything."""
        tolerant = with_tolerances(self.first, self.context)
        settings, sums = self.context.settings.gait_sets, best_sums(tolerant.fits, tolerant.nominal)
        # What a sum leaves hardly says what its fit will leave. To beginnings all are soon fitted.
        first = settings if self.begins_whole else replace(settings, begun=len(sums))
        judge, fits = self._run(tolerant, self.hypotheses, first, self.begun, sums)
        apart = partial(floors_apart, floors=self.floors)
        return self._end(tolerant, judge, fits, settings, with_tolerances, apart)

    def _end(
        self,
        first: Judgement,
        judge: SetJudge,
        fits: Sequence[SetFit],
        settings: SetSettings,
        about: About,
        apart: Apart,
    ) -> tuple[Judgement, JudgedSets]:
        """Return the whole trials and the sets, by the covariance about the best set so far.

        Where the search began with beginnings, whole trials are tried with the effects that these promised.
        With tolerances, whole trials are searched from their own sums of two effects, too.

        Args:
            first: what the search began with.
            judge, fits: what it found.
            settings: how sets are searched.
            about: returns the covariance about the robot with a set.
            apart: tells how far two robots are apart.
        """
        judgement, hypotheses, known = first, self.hypotheses, self.begun
        again = bool(fits[0].hypotheses)
        if not self.begins_whole:
            known, again = self.ended, True
            judgement = _with_fits_of(self.wide, fits, first.fits, self.context)
            hypotheses = [fit.hypothesis for fit in judgement.fits if len(fit.comparisons) > 1]
        if again:
            begin = _beginnings(judge, fits, settings)
            judgement = about(judgement, self.context, fits[0].point)
            if judgement.tolerant and not self.begins_whole:  # beginnings hardly tell some sets apart
                begin += best_sums(judgement.fits, judgement.nominal)
                settings = replace(settings, begun=2 * settings.begun)
            judge, fits = self._run(judgement, hypotheses, settings, known, begin)
        judged = _judged(judge, fits, known, apart, self._averaged(judgement, judge, fits[0]))
        return replace(judgement, sets=judged), judged

    def _averaged(self, judgement: Judgement, judge: SetJudge, best: SetFit) -> Callable[[Array], Array]:
        """Return what averages the scores of sets over the luck of their fits."""
        context = self.context
        error = 0.5 * context.settings.evidence.luck * luck(judgement, judge.loss, best.point, context)
        return lambda scores: averaged(scores, error, context.seed, context.settings.evidence)

    def _run(
        self,
        judgement: Judgement,
        hypotheses: Sequence[Hypothesis],
        settings: SetSettings,
        known: Simulated,
        begin: Sequence[Point] = (),
    ) -> tuple[SetJudge, list[SetFit]]:
        """Return the sets that were fitted by one covariance, the best first, and their judge.

        Args:
            judgement: the trials and the fits of single effects.
            hypotheses: the effects to try, each on its targets.
            settings: how sets are searched.
            known: robots that were simulated; new ones are added.
            begin: sets from the best of which the search sets out.
        """
        trial_set = judgement.trial_set
        initial, stage = trial_set.initial, self.context.runner.stage(FITTING_SETS)
        known.add_fits(judgement)

        def simulate(requests: Sequence[RobotRequest]) -> list[Comparison | None]:
            fresh = {one.name: one for one in requests if one.name not in known.robots}
            known.add([*fresh.values()], stage(initial, [*fresh.values()]))
            found = [known.robots[one.name] for one in requests]
            return [
                None if robot is None else replace(trial_set.rewhiten(robot, initial), at=np.array(one.at))
                for one, robot in zip(requests, found, strict=True)
            ]

        judge = SetJudge.of(trial_set, self.context.runner, settings, WideLoss, simulate)
        responses = SingleResponses.of_fits(judgement.fits, judgement.nominal)
        fitter, nominal = judge.fitter, judgement.nominal
        search = SetSearch(fitter, hypotheses, nominal, settings, fitter, begin=begin, responses=responses)
        return judge, search.run()


def _beginnings(judge: SetJudge, fits: Sequence[SetFit], settings: SetSettings) -> list[Point]:
    """Return the leading sets; not those that only add to a better one.

    Args:
        judge: the judge of the sets.
        fits: the sets, the best first.
        settings: how many.
    """
    score = judge.fitter.score
    chosen: list[SetFit] = []
    for fit in fits:
        new = not any(one.names < fit.names for one in chosen)
        if fit.hypotheses and new and score(fit) <= score(fits[0]) + settings.begun_within:
            chosen.append(fit)
    return [fit.point for fit in chosen[: settings.begun]]


def _with_fits_of(
    wide: Judgement, fits: Sequence[SetFit], heads: Sequence[Fit], context: Context
) -> Judgement:
    """Return whole trials with each effect alone that some sets have.

    It is simulated as far as the best of these sets has it, and as it explains the beginnings best alone.

    Args:
        wide: the trials.
        fits: sets that were fitted to the trials' beginnings, the best first.
        heads: the fits of single effects to the beginnings.
        context: simulates robots; settings.
    """
    points = [(h, float(np.clip(at, h.low, h.high))) for fit in fits for h, at in fit.point]
    first = firsts(points, lambda point: point[0].name)[: context.settings.gait_sets.promising]
    best = {head.hypothesis.name: head.best() for head in heads}
    alone = {(h.name, at): (h, at) for h, one in first for at in (one, best[h.name]) if at != h.neutral}
    initial, stage = wide.trial_set.initial, context.runner.stage(FITTING_SETS)
    robots = stage(initial, [robot_request([point]) for point in alone.values()])
    own = {head.hypothesis.name: _unfitted(wide, head) for head in heads}
    for (name, at), robot in zip(alone, robots, strict=True):
        if robot is not None:
            own[name].add(at, wide.trial_set.rewhiten(robot, initial))
    return replace(wide, fits=tuple(own.values()))


def _unfitted(wide: Judgement, head: Fit) -> Fit:
    return Fit.of(head.hypothesis, wide.trial_set, wide.nominal, head.settings)


def _judged(
    judge: SetJudge,
    fits: Sequence[SetFit],
    known: Simulated,
    apart: Apart,
    average: Callable[[Array], Array],
) -> JudgedSets:
    """Return sets in order of their probability, by the loss of all trials and the price of each effect.

    Args:
        judge: the judge of the sets.
        fits: the sets, the best first.
        known: robots that were simulated.
        apart: tells how far two robots are apart.
        average: averages scores over the luck of the fits.
    """
    fits = [fit for fit in fits if not _idle(fit)]
    scores = average(-0.5 * np.array([_minus_log(judge, fit) for fit in fits]))
    order = np.argsort(-scores, kind="stable").tolist()
    none = max((float(scores[i]) for i in order if not fits[i].hypotheses), default=-math.inf)
    order = [i for i in order if fits[i].hypotheses]
    chosen, weights = [fits[i] for i in order], scores[order]
    probable = int(np.sum(probabilities(weights) >= judge.settings.probable)) if len(order) else 0
    changes = [_moves(judge, fit, apart) for fit in chosen[:probable]]
    changes += [dict.fromkeys((h.name for h in fit.hypotheses), 0.0) for fit in chosen[probable:]]
    candidates = tuple(_candidate(judge, fit, known) for fit in chosen)
    wide = WideChords.of(judge.fitter, chosen[:probable], chosen[probable:]) if chosen else None
    still = np.zeros(len(judge.loss.row_trials))
    return JudgedSets(judge, candidates, weights, none, tuple(changes), still, wide=wide)


def _idle(fit: SetFit) -> bool:
    """Whether an effect of a set ended where it does nothing: the set without it is another one."""
    neutral = np.array([h.share(h.neutral) for h in fit.hypotheses])
    return bool(np.any(np.abs(fit.shares - neutral) < _NEUTRAL))


def _candidate(judge: SetJudge, fit: SetFit, known: Simulated) -> Candidate:
    """Return a set with what it leaves of held-out gaits.

    Without a gait the fit is the best one of the robots that were simulated with these effects: slopes do not
    tell where a foot slips in another step.
    """
    trial_set, loss = judge.trial_set, judge.loss
    alike = known.with_effects_of(fit)
    robots = [fit.robot, *(trial_set.rewhiten(one, trial_set.initial) for one in alike)]
    losses = np.array([trial_set.losses(one.whitened) for one in robots])

    def best(weights: Array | None) -> Comparison:
        if weights is None:
            return fit.robot
        totals = [loss.of_squares(trial_set.by_trial(weights * one)).sum() for one in losses]
        return robots[int(np.argmin(totals))]

    def left(name: Residual, blocks: Indices) -> Array:
        return heldout(trial_set, blocks, lambda weights: np.asarray(getattr(best(weights), name)))

    return Candidate(
        fit.hypotheses,
        tuple(fit.robot.at.tolist()),
        trial_set.losses(fit.robot.whitened),
        trial_set.losses(left("whitened", trial_set.row_blocks)),
        fit.robot.whitened,
        left("marker", trial_set.sample_blocks),
        left("angles", trial_set.angle_blocks),
        log_priors=tuple(h.log_prior(at) for h, at in fit.point),
        together=fit,
    )


def _minus_log(judge: SetJudge, fit: SetFit) -> float:
    """Return minus twice the logarithm of a set's posterior weight, up to a constant."""
    return judge.fitter.score(fit) - 2.0 * sum(h.log_target_share for h in fit.hypotheses)


def _moves(judge: SetJudge, fit: SetFit, apart: Apart) -> dict[str, float]:
    """Return how far the robot without each effect of a set is from that with it."""
    points = [[one for k, one in enumerate(fit.point) if k != i] for i in range(len(fit.hypotheses))]
    robots = judge.fitter.simulate([robot_request(point) for point in points])
    return {
        h.name: math.inf if robot is None else apart(judge.trial_set, fit.robot, robot)
        for h, robot in zip(fit.hypotheses, robots, strict=True)
    }
