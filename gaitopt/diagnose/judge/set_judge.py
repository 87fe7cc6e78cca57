"""Sets of effects judged: each by what it predicts of the commands that its fit did not see.

The fit without a fold is one Gauss–Newton step away from the fit to all trials. The slopes of the whitened
residual predict what it leaves of that fold, so that no fold costs a simulation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

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
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]


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
