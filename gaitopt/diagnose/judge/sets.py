"""Sets of effects judged: each by what it predicts of the commands that its fit did not see.

The fit without a fold is one Gauss–Newton step away from the fit to all trials. The slopes of the whitened
residual predict what it leaves of that fold, so that no fold costs a simulation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.statistics import NORMAL_95
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.proposals import Proposals
from gaitopt.diagnose.fit.robust import RobustLoss
from gaitopt.diagnose.fit.runner import FITTING_SETS, Runner
from gaitopt.diagnose.fit.set_fit import Point, SetFit, SetFitter, Simulate
from gaitopt.diagnose.fit.set_search import SetSearch
from gaitopt.diagnose.fit.settings import SetSettings
from gaitopt.diagnose.fit.single import robot_request
from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.diagnose.judge.candidates import Candidate, heldout
from gaitopt.diagnose.judge.chords import WideChords
from gaitopt.diagnose.judge.evidence import probabilities
from gaitopt.diagnose.judge.precision import Interval
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]

_NONE: Mapping[str, Interval] = MappingProxyType({})


@dataclass(frozen=True)
class RankedSets:
    """Sets of effects by what they leave of held-out commands, the most probable first.

    Attributes:
        fits: the sets; the empty set is left out,
        candidates: and what they leave.
        scores: logarithm of the posterior weight of each, up to a constant, shape (sets,).
        none: the same of the empty set; minus infinity where it was not fitted.
    """

    fits: tuple[SetFit, ...]
    candidates: tuple[Candidate, ...]
    scores: Array
    none: float


@dataclass(frozen=True)
class SetJudge:
    """Judges sets of effects.

    Attributes:
        trial_set: the trials.
        loss: the robust loss.
        fitter: the fitter, for steps without a fold.
        settings: see `SetSettings`.
        runner: simulates robots.
    """

    trial_set: TrialSet
    loss: RobustLoss
    fitter: SetFitter
    settings: SetSettings
    runner: Runner

    @staticmethod
    def of(
        trial_set: TrialSet,
        runner: Runner,
        settings: SetSettings,
        kind: type[RobustLoss] = RobustLoss,
        simulate: Simulate | None = None,
    ) -> SetJudge:
        """Return the judge of some trials; robots are simulated by a runner, or by a function of it."""
        if simulate is None:
            simulate = partial(runner.stage(FITTING_SETS), trial_set)
        loss = kind(
            trial_set.row_trials,
            settings.freedom,
            settings.temper,
            settings.most_rows,
            trial_set.per_error,
            trial_set.motions,
            tuple(product(settings.errors_rad, settings.error_shares)),
        )
        return SetJudge(
            trial_set, loss, SetFitter(loss, simulate, trial_set.rows, settings), settings, runner
        )

    def search(
        self, hypotheses: Sequence[Hypothesis], nominal: Comparison, known: Point = ()
    ) -> list[SetFit]:
        """Return the sets that were fitted, the best first; the empty set is among them.

        Args:
            hypotheses: every effect on each of its targets.
            nominal: the trials compared with the nominal robot.
            known: effects that are in every other set, each at its coordinate.
        """
        settings, loss = self.settings, self.loss
        wide = replace(loss, freedom=settings.gaussian, errors=((0.0, settings.motion),))
        coarse = replace(self.fitter, loss=wide)
        proposals = Proposals(self.trial_set, loss)
        return SetSearch(self.fitter, hypotheses, nominal, settings, coarse, proposals, known).run()

    def candidate(self, fit: SetFit) -> Candidate:
        """Return a set with what it leaves of held-out commands."""
        trial_set, robot = self.trial_set, fit.robot
        samples = np.concatenate([robot.marker, robot.angles])
        steps = {None: np.zeros(len(fit.hypotheses))} | {
            tuple(weights): self._step_without(fit, weights) for _, weights in trial_set.fold_weights
        }

        def of_samples(weights: Array | None) -> Array:
            step = steps[None if weights is None else tuple(weights)]
            left: Array = samples + fit.sample_slopes @ step
            return left

        def of_rows(weights: Array | None) -> Array:
            step = steps[None if weights is None else tuple(weights)]
            left: Array = robot.whitened + fit.slopes @ step
            return left

        split = len(robot.marker)
        return Candidate(
            fit.hypotheses,
            tuple(robot.at.tolist()),
            trial_set.losses(robot.whitened),
            trial_set.losses(heldout(trial_set, trial_set.row_blocks, of_rows)),
            robot.whitened,
            heldout(trial_set, trial_set.sample_blocks, lambda weights: of_samples(weights)[:split]),
            heldout(trial_set, trial_set.angle_blocks, lambda weights: of_samples(weights)[split:]),
            log_priors=tuple(h.log_prior(at) for h, at in fit.point),
            together=fit,
        )

    def ranked(self, sets: Sequence[SetFit]) -> RankedSets:
        """Return sets by what they leave of held-out commands, the most probable first."""
        every = [self.candidate(fit) for fit in sets]
        scores = self.scores(every)
        order = [i for i in np.argsort(-scores, kind="stable").tolist() if every[i].hypotheses]
        none = [float(score) for one, score in zip(every, scores, strict=True) if not one.hypotheses]
        fits, candidates = tuple(sets[i] for i in order), tuple(every[i] for i in order)
        return RankedSets(fits, candidates, scores[order], max(none, default=-math.inf))

    def scores(self, candidates: Sequence[Candidate]) -> Array:
        """Return the logarithm of each candidate's posterior weight, up to a constant."""
        found = []
        for candidate in candidates:
            left = self.loss.of_squares(self.trial_set.by_trial(candidate.heldout_loss)).sum()
            included = sum(self.settings.inclusion + one.effect.unusual for one in candidate.hypotheses)
            prior = included - 2.0 * candidate.log_target_share
            found.append(-0.5 * (float(left) + prior))
        return np.array(found)

    def heldout_left(self, candidate: Candidate) -> Array:
        """Return the mean whitened square that is left of each trial held out, shape (trials,)."""
        left: Array = self.trial_set.by_trial(candidate.heldout_loss) / self.loss.rows
        return left

    def changes(self, fit: SetFit) -> dict[str, float]:
        """Return the mean whitened square that each effect of a set changes, in the trial where it is most.

        The slopes tell it; those of a limit or of free play tell too much of a small value.
        """
        moves = fit.shares - [h.share(h.neutral) for h in fit.hypotheses]
        squares = [self.loss.mean_squares(fit.slopes[:, i] * move) for i, move in enumerate(moves)]
        return {h.name: float(one.max()) for h, one in zip(fit.hypotheses, squares, strict=True)}

    def simulated_changes(self, fits: Sequence[SetFit], timestep: Array) -> list[dict[str, float]]:
        """Return the same from robots without each effect, beyond what the timestep changes in that trial.

        An effect that a set can do without at the reference fidelity changes nothing. What an effect of the
        first set changes there it changes in other sets, too.

        Args:
            fits: some sets.
            timestep: see `timestep_change`.
        """
        first = self._simulated_changes(fits[:1], timestep, {})
        known = {name: change for name, change in first[0].items() if change > 0.0}
        return first + self._simulated_changes(fits[1:], timestep, known)

    def _simulated_changes(
        self, fits: Sequence[SetFit], timestep: Array, known: Mapping[str, float]
    ) -> list[dict[str, float]]:
        """Return the changes by the effects of some sets; those that are known are not simulated."""
        work = [(k, h.name, i) for k, one in enumerate(fits) for i, h in enumerate(one.hypotheses)]
        work = [(k, name, i) for k, name, i in work if name not in known]
        smaller = [self.fitter.without_effect(fits[k], i) for k, _, i in work]
        robots = self.fitter.simulate([robot_request(one.point) for one in smaller])
        changes = [{h.name: known.get(h.name, 0.0) for h in one.hypotheses} for one in fits]
        least, by_timestep = [self._finer(one, timestep) for one in fits], self.loss.mean_squares(timestep)
        for (k, name, _), one, robot in zip(work, smaller, robots, strict=True):
            without = one if robot is None else self.fitter.at_robot(one, robot)
            if self._finer(without, timestep) > least[k]:
                apart = self.loss.mean_squares(without.robot.whitened - fits[k].robot.whitened)
                changes[k][name] = float(np.max(apart - by_timestep))
        return changes

    def _finer(self, fit: SetFit, timestep: Array) -> float:
        """Return the score of a set at the reference fidelity after the best step, as the slopes predict."""
        robot = replace(fit.robot, whitened=fit.robot.whitened + timestep)
        there = replace(self.fitter.at_robot(fit, robot), radius=self.settings.heldout_radius)
        return self.fitter.expected(there)[1] + self.fitter.price(fit)

    def timestep_change(self, fit: SetFit) -> Array:
        """Return what the reference fidelity changes of the whitened residual of a set, shape (rows,).

        Nothing, where the robot cannot be simulated there.
        """
        request = robot_request(fit.point)
        problem = self.trial_set.problem.with_effects(request.effects)
        robot = Simulator.build(problem, fidelity=problem.simulation.reference)
        name = f"at the reference fidelity: {request.name}"
        (fine,) = self.runner.compare_robots(self.trial_set, {name: robot})
        return np.zeros(len(fit.robot.whitened)) if fine is None else fine.whitened - fit.robot.whitened

    def _step_without(self, fit: SetFit, weights: Array) -> Array:
        """Return the step, in ranges, to the fit with other weights of the blocks."""
        wide = replace(fit, radius=self.settings.heldout_radius)
        return self.fitter.expected(wide, weights)[0]


@dataclass(frozen=True)
class JudgedSets:
    """Sets of effects in order of their probability.

    Attributes:
        judge: their judge.
        candidates: the sets, the most probable first; the empty set is left out.
        scores: logarithm of the posterior weight of each, up to a constant, shape (candidates,).
        none: the same of the empty set.
        changes: what each effect of a set changes, see `SetJudge.changes`; simulated for the probable sets.
        timestep: what a finer timestep changes of the whitened residual of the first set, shape (rows,).
        known: intervals of the effects that are at work as other evidence says: they are in every set.
        shifts: by how much the parameter of another effect may be less or more than its fit says.
        wide: slopes over wide chords, and how rough the loss of each trial is; None without a set.
    """

    judge: SetJudge
    candidates: tuple[Candidate, ...]
    scores: Array
    none: float
    changes: tuple[Mapping[str, float], ...]
    timestep: Array
    known: Mapping[str, Interval] = field(default_factory=dict)
    shifts: Mapping[str, Interval] = field(default_factory=dict)
    wide: WideChords | None = None

    @staticmethod
    def of(
        judge: SetJudge,
        ranked: RankedSets,
        known: Mapping[str, Interval] = _NONE,
        shifts: Mapping[str, Interval] = _NONE,
    ) -> JudgedSets:
        """Return ranked sets with what is simulated about the probable ones.

        Args:
            judge: their judge.
            ranked: the sets.
            known: intervals of the effects that other evidence shows; the empty set is then impossible.
            shifts: by how much parameters of other effects may then differ from their fit.
        """
        fits, candidates, scores = ranked.fits, ranked.candidates, ranked.scores
        none = -math.inf if known else ranked.none
        if not fits:
            return JudgedSets(
                judge, (), scores, none, (), np.zeros(len(judge.loss.row_trials)), known, shifts
            )
        probable = max(1, int(np.sum(probabilities(scores) >= judge.settings.probable)))
        timestep = judge.timestep_change(fits[0])
        changes = judge.simulated_changes(fits[:probable], timestep)
        changes += [judge.changes(fit) for fit in fits[probable:]]
        wide = WideChords.of(judge.fitter, fits[:1]).together()
        return JudgedSets(judge, candidates, scores, none, tuple(changes), timestep, known, shifts, wide)

    @property
    def scores_if_usual(self) -> Array:
        """The scores if no effect were less usual than others, shape (candidates,)."""
        unusual = [sum(one.effect.unusual for one in c.hypotheses) for c in self.candidates]
        return self.scores + 0.5 * np.array(unusual, dtype=float)

    def doubtful(self, changes: Array) -> frozenset[str]:
        """Return the effects of the first set whose intervals hold their neutral values.

        Args:
            changes: change of the whitened residual with each perturbed robot, shape (robots, rows).
        """
        first = self.candidates[0]
        pairs = zip(first.hypotheses, self.intervals(first, changes), strict=True)
        return frozenset(h.effect.name for h, (low, high) in pairs if low <= h.value(h.neutral) <= high)

    def intervals(self, candidate: Candidate, changes: Array) -> list[Interval]:
        """Return a 90 % interval of each parameter of a set, in its unit."""
        if candidate.together is None:
            raise ValueError("the candidate is no set of effects")
        found = set_intervals(candidate.together, self.covariance(candidate.together, changes))
        parts = zip(candidate.hypotheses, found, strict=True)
        return [self.known.get(h.name, self._shifted(h, interval)) for h, interval in parts]

    def other_intervals(self, candidate: Candidate, changes: Array) -> dict[str, Interval]:
        """Return the intervals of a set that do not follow from its fit alone, by the effects' names."""
        parts = zip(candidate.hypotheses, self.intervals(candidate, changes), strict=True)
        return {h.name: ends for h, ends in parts if h.name in self.known or h.effect.name in self.shifts}

    def _shifted(self, h: Hypothesis, interval: Interval) -> Interval:
        """Return the interval of a parameter that may be less or more than its fit says, in its unit."""
        if h.effect.name not in self.shifts:
            return interval
        less, more = self.shifts[h.effect.name]
        return max(interval[0] + less, h.value(h.low)), min(interval[1] + more, h.value(h.high))

    def covariance(self, fit: SetFit, changes: Array) -> Array:
        """Return the covariance of a set's parameters, in squares of their ranges, shape (k, k).

        It is the sum of three: that of the fit, and those of the shifts of the fit with perturbed robots and
        with a finer timestep. That of the fit is the larger one of what the curvature of the loss and what
        the scatter of the trials' gradients say. Where servos or feet stick and slip, the loss has many
        valleys, and a fit ends in any whose depths differ by no more than the loss is rough: r standard
        errors away the loss rises by r squared. So a rough trial tells less.

        Args:
            fit: the set.
            changes: change of the whitened residual with each perturbed robot, shape (robots, rows).
        """
        loss, fitter = self.judge.loss, self.judge.fitter
        weights = loss.weights_of(fit.robot.whitened)
        told = weights
        if self.wide is not None:
            fit, told = self.wide.of_set(fit), weights / (1.0 + self.wide.roughness)
        inverse = np.linalg.pinv(fitter.curvature(fit, told))
        alike = changes / math.sqrt(max(1, len(changes)))
        shifts = np.vstack([*alike, self.timestep]) @ (told[loss.row_trials][:, None] * fit.slopes) @ inverse
        grown = self._grown(fit, weights)
        spread: Array = inverse * np.outer(grown, grown) + shifts.T @ shifts
        return spread

    def _grown(self, fit: SetFit, weights: Array) -> Array:
        """Return how much more the fit scatters than its curvature says, at least 1, shape (k,).

        Args:
            fit: the set.
            weights: of each trial, shape (trials,).
        """
        inverse = np.linalg.pinv(self.judge.fitter.curvature(fit, weights))
        gradients = weights[:, None] * fit.rows.by_trial(fit.products.mixed)
        count, k = len(weights), len(fit.hypotheses)
        scatter = gradients.T @ gradients * count / max(1, count - k)
        sandwich = inverse @ scatter @ inverse
        grown: Array = np.sqrt(np.maximum(1.0, np.diag(sandwich) / np.maximum(np.diag(inverse), 1e-300)))
        return grown


def set_intervals(fit: SetFit, covariance: Array) -> list[Interval]:
    """Return a 90 % interval of each parameter of a set, in its unit.

    Args:
        fit: the set.
        covariance: of its parameters, in squares of their ranges, shape (k, k).
    """
    halves = NORMAL_95 * np.sqrt(np.diag(covariance))
    intervals = []
    for h, share, half in zip(fit.hypotheses, fit.shares.tolist(), halves.tolist(), strict=True):
        low, high = h.share_limits
        ends = (min(max(share + side * half, low), high) for side in (-1.0, 1.0))
        below, above = (h.value(h.coordinate_at(end)) for end in ends)
        intervals.append((below, above))
    return intervals
