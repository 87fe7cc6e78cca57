"""The work of a rollout: counted at some steps, limited for all."""

from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from gaitopt.simulation.effort import WorkBudget, counters, mean_work


def counted(arrays: Mapping[str, NDArray[np.int32]]) -> None:
    """Record 100 numbers of the Jacobian and one iteration on one island in every step."""
    arrays["nJ"][:] = 100
    arrays["nisland"][:] = 1
    arrays["solver_niter"][:, :, 0] = 1


def test_the_work_of_a_step_is_that_of_the_formula() -> None:
    counts = counters(7)
    assert mean_work(counts, 3) == 300.0 + 25.0 * 3
    counted(counts)
    assert mean_work(counts, 3) == 300.0 + 25.0 * 3 + 100.0 * 2.0


@pytest.mark.parametrize(("chunk", "every"), [(500, 100), (100, 100), (50, 7), (1, 1)])
def test_what_is_counted_stands_for_all_steps(chunk: int, every: int) -> None:
    """With equal steps, a budget of 1000 ends between 1000 steps and one chunk later."""
    step = 300.0 + 200.0
    budget = WorkBudget(1000.0 * step, chunk, every, nv=0)
    steps = 0
    while not budget.exceeded:
        counts = budget.counters(chunk)
        counted(counts)
        budget.spend(counts, chunk)
        steps += chunk
    assert 1000 < steps <= 1000 + chunk


def test_a_last_short_chunk_is_counted_by_its_own_steps() -> None:
    budget = WorkBudget(99.0 * 500.0, 500, 100, nv=0)
    counts = budget.counters(100)
    assert {array.shape[1] for array in counts.values()} == {100}
    counted(counts)
    budget.spend(counts, 100)
    assert budget.exceeded
