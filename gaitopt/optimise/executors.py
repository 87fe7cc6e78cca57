"""Where rollouts run: any `concurrent.futures.Executor`, and those that ``--executor`` can name."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

from gaitopt.core.errors import GaitoptError, nearest
from gaitopt.optimise.cluster import DaskExecutor
from gaitopt.optimise.handshake import DASK
from gaitopt.optimise.processes import ProcessExecutor

EXECUTORS = ("threads", "processes", "serial")
"""Executors on this machine."""


class SerialExecutor(Executor):
    """Runs each call at once, in the caller's thread."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run `function` and return its result as a finished future."""
        future: Future[Any] = Future()
        try:
            future.set_result(function(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def open_executor(name: str = "threads", workers: int | None = None) -> Executor:
    """Return an executor; use it as a context manager.

    Args:
        name: one of `EXECUTORS`, or ``dask://HOST:PORT``. Threads share one compiled model: MuJoCo
            releases the interpreter.
        workers: how many rollouts run at once; as many as there are usable cores by default.

    Raises:
        GaitoptError: there is no executor of this name, or `workers` is below one.
    """
    if workers is not None and workers < 1:
        raise GaitoptError(f"--workers: found {workers}; allowed: 1 or more")
    if name.startswith(DASK):
        if workers is not None:
            raise GaitoptError(f"--workers: found {workers}; {DASK} works with the workers it has")
        return DaskExecutor(name.removeprefix(DASK))
    workers = workers or usable_cores()
    if name == "serial":
        return SerialExecutor()
    if name == "threads":
        return ThreadPoolExecutor(workers)
    if name == "processes":
        return ProcessExecutor(workers)
    allowed = f"{', '.join(EXECUTORS)} or {DASK}HOST:PORT{nearest(name, EXECUTORS)}"
    raise GaitoptError(f"--executor: found {name!r}; allowed: {allowed}")


@contextmanager
def working(executor: Executor) -> Iterator[Executor]:
    """Shut an executor down at the end, and at once where an error or Ctrl-C ends the work."""
    try:
        yield executor
    except BaseException:
        executor.shutdown(wait=True, cancel_futures=True)
        raise
    executor.shutdown()


def usable_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
