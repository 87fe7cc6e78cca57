"""A search that several test files compare with."""

import pytest
from searching import BUDGET, run, summary

from gaitopt.optimise.run import Request
from gaitopt.problem.problem import Problem


@pytest.fixture(scope="session")
def whole(strider: Problem, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """Journal and summary of an uninterrupted run."""
    path = tmp_path_factory.mktemp("whole") / "evaluations.csv"
    optimised = run(strider, path, Request(seed=3, budget=BUDGET))
    return path.read_text(), summary(strider, optimised)
