"""The covariance from perturbed robots around the leaders, and which candidate then wins."""

from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from toyfits import toy_comparison, toy_fit, toy_trials
from toysets import toy_hypothesis

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
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.problem.tolerances import Tolerances

ROWS = 60
UNFINISHED = DiagnosisSettings(fit=FitSettings(finish_rounds=0, finish_rounds_measurement=0))
"""Simulates nothing, because there is no simulator."""


class WhiteTrial:
    """A trial of white rows: its covariance is that of the perturbed robots and nothing else."""

    n_rows = ROWS

    def whitening_update(self, changes: np.ndarray) -> np.ndarray:
        covariance = np.eye(ROWS) + changes.T @ changes / len(changes)
        update: np.ndarray = np.linalg.inv(np.linalg.cholesky(covariance))
        return update


def test_a_candidate_that_imitates_small_errors_does_not_win() -> None:
    """A similar effect beats the cause until perturbed robots show how large small errors are."""
    rng = np.random.default_rng(3)
    cause, unknown = 6.0 * rng.standard_normal(ROWS), 8.0 * rng.standard_normal(ROWS)
    measured = cause + 0.8 * unknown + rng.standard_normal(ROWS)
    trial = cast(WhitenedTrial, WhiteTrial())
    trials = toy_trials(ROWS, 6, (trial,), ("one", "two"))
    nominal, at = toy_comparison([0.0], measured), (0.0, 0.5, 1.0)
    changes = {"cause": cause, "twin": cause + unknown, "idle": rng.standard_normal(ROWS)}
    fits = tuple(
        toy_fit(trials, measured, partial(np.multiply, change), at, name) for name, change in changes.items()
    )
    drawn = []

    def perturb(trial_set: TrialSet, candidate: Candidate, context: Context) -> PerturbedRobots:
        drawn.append(candidate.label)
        return PerturbedRobots((), np.outer(rng.standard_normal(8), unknown), tuple(range(8)))

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


@pytest.mark.parametrize(
    ("offset", "tolerant", "small"),
    [
        (0.034, True, {"servo_trim"}),
        (-0.034, True, {"servo_trim"}),
        (0.036, True, set()),
        (0.034, False, set()),
    ],
)
def test_a_trim_within_two_degrees_is_a_small_error(offset: float, tolerant: bool, small: set[str]) -> None:
    """A payload never is: no tolerance allows one."""
    trial_set = SimpleNamespace(problem=SimpleNamespace(file=SimpleNamespace(tolerances=Tolerances())))
    judgement: Any = SimpleNamespace(tolerant=tolerant, trial_set=trial_set)
    hypotheses = [toy_hypothesis("servo_trim"), toy_hypothesis("payload_mass")]
    candidate: Any = SimpleNamespace(hypotheses=hypotheses, at=(offset, 1e-6))
    assert Judgement.small_errors(judgement, candidate) == small
