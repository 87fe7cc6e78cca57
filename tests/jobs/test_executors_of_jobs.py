"""Executors reach every job, and change no bit of it."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

from gaitopt import check, compare, sweep
from gaitopt.core.errors import GaitoptError
from gaitopt.core.json import to_json
from gaitopt.jobs.executor import opened
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.problem.problem import Problem

Job = Callable[..., list[dict[str, object]]]


def compared(problem: Problem, **options: object) -> list[dict[str, object]]:
    """Rows of a comparison."""
    return [row.to_dict() for row in compare(problem, ["stride", "square"], **options)]  # type: ignore[arg-type]


def swept(problem: Problem, **options: object) -> list[dict[str, object]]:
    """Rows of a sweep over a parameter of the model."""
    return [row.to_dict() for row in sweep(problem, over="mu_rear=0.3,0.9", **options).rows]  # type: ignore[arg-type]


def checked(problem: Problem, **options: object) -> list[dict[str, object]]:
    """Rows of an audit."""
    return [finding.to_dict() for finding in check(problem, **options)]  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("job", [compared, swept, checked])
def test_the_same_bits_on_every_executor(strider: Problem, job: Job) -> None:
    rows = to_json({"rows": job(strider, executor="serial")})
    assert rows.count("\n") > 3
    for executor in ("threads", "processes"):
        assert to_json({"rows": job(strider, executor=executor, workers=2)}) == rows, executor


def test_an_executor_that_is_given_stays_open(strider: Problem) -> None:
    with ThreadPoolExecutor(2) as pool:
        first = compared(strider, executor=pool)
        assert compared(strider, executor=pool) == first == compared(strider, executor=SerialExecutor())


def test_workers_are_not_for_an_executor_that_is_given() -> None:
    with (
        pytest.raises(GaitoptError, match="--workers: found 2; an executor that is given has its own"),
        opened(SerialExecutor(), 2),
    ):
        pass


def test_an_unknown_executor_is_one_line(strider: Problem) -> None:
    with pytest.raises(GaitoptError, match=r"--executor: found 'thread'; allowed: .*nearest: 'threads'"):
        compare(strider, ["stride"], executor="thread")
