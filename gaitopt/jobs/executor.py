"""Executors of jobs: opened by name and shut down, or given and left open."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from gaitopt.core.errors import GaitoptError
from gaitopt.optimise.executors import open_executor, working


@contextmanager
def opened(executor: Executor | str = "threads", workers: int | None = None) -> Iterator[Executor]:
    """Yield an executor. One that is opened here is shut down at the end; one that is given stays open.

    Args:
        executor: ``threads``, ``processes``, ``serial``, ``dask://HOST:PORT``, or an executor. Results
            are the same to the last bit with every executor.
        workers: how many rollouts run at once; as many as there are usable cores by default.

    Raises:
        GaitoptError: there is no such executor, or `workers` does not fit it.
    """
    if isinstance(executor, str):
        with working(open_executor(executor, workers)) as own:
            yield own
        return
    _check_given(workers)
    yield executor


def check_executor(executor: Executor | str, workers: int | None) -> None:
    """Check that an executor can be opened, before anything is made or computed.

    Raises:
        GaitoptError: as of `opened`.
    """
    if isinstance(executor, str):
        open_executor(executor, workers).shutdown()
    else:
        _check_given(workers)


def _check_given(workers: int | None) -> None:
    if workers is not None:
        raise GaitoptError(f"--workers: found {workers}; an executor that is given has its own workers")
