"""Which effects of a set only make up for the error of the timestep."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from toysets import ToyBench, curved

from gaitopt.diagnose.fit.set_fit import SetFit
from gaitopt.diagnose.fit.settings import SETS
from gaitopt.diagnose.judge.judged_sets import JudgedSets
from gaitopt.diagnose.judge.set_judge import SetJudge

Array = NDArray[np.float64]

ROWS, TRIALS = 240, 8
CAUSE, MIMIC = "cause", "mimic"


@pytest.fixture(scope="module")
def bench() -> tuple[SetJudge, SetFit, Array]:
    """A judge, the set of a cause and of what stands for the error of the timestep, and that error."""
    rng = np.random.default_rng(3)
    responses = {"cause": curved(rng, ROWS, 20.0), "mimic": curved(rng, ROWS, 8.0)}
    error = responses["mimic"](0.3)
    toy = ToyBench(responses, responses["cause"](0.5) + error + rng.standard_normal(ROWS), TRIALS)
    fit = toy.search().run()[0]
    unused: Any = None
    fitter = toy.fitter()
    return SetJudge(unused, fitter.loss, fitter, SETS, unused), fit, error


def test_an_effect_that_stands_for_the_error_of_the_timestep_changes_nothing(
    bench: tuple[SetJudge, SetFit, Array],
) -> None:
    judge, fit, error = bench
    assert sorted(fit.effects) == ["cause", "mimic"]
    changes = judge.simulated_changes([fit], -error)[0]
    assert changes[MIMIC] == 0.0
    assert changes[CAUSE] > 10.0


def test_the_same_effect_counts_where_the_timestep_changes_nothing(
    bench: tuple[SetJudge, SetFit, Array],
) -> None:
    judge, fit, error = bench
    assert min(judge.simulated_changes([fit], 0.0 * error)[0].values()) > 2.0


def test_an_effect_counts_by_what_it_changes_beyond_the_timestep(
    bench: tuple[SetJudge, SetFit, Array],
) -> None:
    judge, fit, error = bench
    aside = np.random.default_rng(4).standard_normal(ROWS)
    without = judge.simulated_changes([fit], 0.0 * error)[0]
    beside = judge.simulated_changes([fit], aside)[0]
    least = judge.loss.mean_squares(aside)
    assert all(least.min() < without[name] - beside[name] < least.max() for name in without)


def test_an_effect_is_doubtful_if_its_interval_holds_its_neutral_value(
    bench: tuple[SetJudge, SetFit, Array],
) -> None:
    judge, fit, error = bench
    candidate: Any = SimpleNamespace(hypotheses=fit.hypotheses, together=fit)
    sets = JudgedSets(judge, (candidate,), np.zeros(1), 0.0, (judge.changes(fit),), 0.0 * error)
    column = fit.slopes[:, fit.effects.index(MIMIC)]
    assert sets.doubtful(0.1 * column[None]) == set()
    assert sets.doubtful(column[None]) == {MIMIC}  # a perturbed robot may do what the effect does
