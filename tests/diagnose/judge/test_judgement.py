"""The covariance from perturbed robots of the leaders: what it overlooks, and whom it lets win."""

from typing import cast

import numpy as np
import pytest
from toyfits import toy_comparison, toy_fit, toy_trials

from gaitopt.diagnose.fit.residual import WhitenedTrial
from gaitopt.diagnose.fit.runner import Runner
from gaitopt.diagnose.fit.settings import FitSettings
from gaitopt.diagnose.fit.trials import TrialSet
from gaitopt.diagnose.judge import evidence
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.diagnose.judge.perturbed import PerturbedRobots
from gaitopt.diagnose.judge.settings import DiagnosisSettings
from gaitopt.diagnose.judge.verdict import falls_short
from gaitopt.optimise.executors import SerialExecutor

ROWS = 60
UNFINISHED = DiagnosisSettings(fit=FitSettings(finish_rounds=0, finish_rounds_measurement=0))
"""Simulates nothing more, since there is nothing to simulate with."""


class WhiteTrial:
    """A trial of white rows: its covariance is that of the perturbed robots and nothing else."""

    n_rows = ROWS

    def whitening_update(self, changes: np.ndarray) -> np.ndarray:
        covariance = np.eye(ROWS) + changes.T @ changes / len(changes)
        update: np.ndarray = np.linalg.inv(np.linalg.cholesky(covariance))
        return update


def test_a_candidate_that_imitates_what_nobody_knows_does_not_win() -> None:
    """The cause is ruled out by its twin until perturbed robots show what nobody knows of them."""
    rng = np.random.default_rng(3)
    cause, unknown = 6.0 * rng.standard_normal(ROWS), 8.0 * rng.standard_normal(ROWS)
    measured = cause + 0.8 * unknown + rng.standard_normal(ROWS)
    trial = cast(WhitenedTrial, WhiteTrial())
    trials = toy_trials(ROWS, 6, (trial,), ("one", "two"))
    nominal, at = toy_comparison([0.0], measured), (0.0, 0.5, 1.0)
    changes = {"cause": cause, "twin": cause + unknown, "idle": rng.standard_normal(ROWS)}
    fits = tuple(
        toy_fit(trials, measured, lambda a, change=change: a * change, at, name)
        for name, change in changes.items()
    )
    drawn = []

    def perturb(trial_set: TrialSet, candidate: Candidate, context: Context) -> PerturbedRobots:
        drawn.append(candidate.label)
        return PerturbedRobots((), np.outer(rng.standard_normal(8), unknown))

    judgement = Judgement(trials, nominal, fits, settings=UNFINISHED)
    assert named(judgement) == {"twin"}
    context = Context(Runner(SerialExecutor()), 1, UNFINISHED)
    assert named(judgement.refine_covariance(context, perturb)) == {"twin", "cause"}
    assert drawn[0] == "twin"
    assert "cause" in drawn
    assert "idle" not in drawn


def named(judgement: Judgement) -> set[str]:
    ranking = judgement.ranking
    return set(evidence.answer_set(evidence.by_effect(ranking.candidates, ranking.probabilities)))


@pytest.mark.parametrize(("does", "short"), [(0.6, False), (1.0, True), (1.3, True)])
def test_two_effects_are_tried_where_the_best_would_go_on_beyond_its_range(does: float, short: bool) -> None:
    """Even if it leaves no more there than a right one does."""
    trial_set, rng = toy_trials(ROWS, 6, trials=2), np.random.default_rng(5)
    direction, noise = rng.standard_normal((2, ROWS))
    measured = does * direction + 0.5 * noise
    fit = toy_fit(trial_set, measured, lambda a: a * direction, (0.0, 0.3, 0.6, 1.0))
    judgement = Judgement(trial_set, toy_comparison([], measured), (fit,))
    (best,) = judgement.singles
    assert best.left(trial_set) < 1.2
    assert falls_short(judgement) == short


def test_two_effects_are_tried_where_the_best_leaves_more_than_a_right_one() -> None:
    trial_set, rng = toy_trials(ROWS, 6, trials=2), np.random.default_rng(5)
    direction, noise = rng.standard_normal((2, ROWS))
    measured = 0.5 * direction + 1.5 * noise
    fit = toy_fit(trial_set, measured, lambda a: a * direction, (0.0, 0.3, 0.6, 1.0))
    assert not fit.hypothesis.at_bound(fit.best())
    assert falls_short(Judgement(trial_set, toy_comparison([], measured), (fit,)))
