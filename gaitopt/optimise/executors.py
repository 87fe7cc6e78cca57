"""Where rollouts run. The contract is the standard `concurrent.futures.Executor` and nothing more."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from typing import Any

from gaitopt.errors import GaitoptError, nearest

EXECUTORS = ("threads", "processes", "serial")


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
        name: one of `EXECUTORS`. Threads share one compiled model: MuJoCo releases the interpreter.
        workers: how many rollouts run at once; as many as there are usable cores by default.

    Raises:
        GaitoptError: there is no executor of this name, or fewer than one worker is asked for.
    """
    if workers is not None and workers < 1:
        raise GaitoptError(f"--workers: found {workers}; allowed: 1 or more")
    workers = workers or usable_cores()
    if name == "serial":
        return SerialExecutor()
    if name == "threads":
        return ThreadPoolExecutor(workers)
    if name == "processes":
        return ProcessPoolExecutor(workers, mp_context=get_context("spawn"))
    raise GaitoptError(
        f"--executor: found {name!r}; allowed: {', '.join(EXECUTORS)}{nearest(name, EXECUTORS)}"
    )


def usable_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
