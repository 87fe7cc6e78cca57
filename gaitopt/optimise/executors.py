"""Where rollouts run. The contract is the standard `concurrent.futures.Executor` and nothing more."""

from __future__ import annotations

import gc
import logging
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import get_context, parent_process, resource_tracker
from typing import Any

from gaitopt.core.errors import GaitoptError, nearest
from gaitopt.robot.warnings import silence_warnings

EXECUTORS = ("threads", "processes", "serial")

DASK = "dask://"
"""How the address of a scheduler of `dask.distributed` begins."""

_LIVES = 5
"""A call that has lost this many worker processes is taken to be what ends them."""

_ANSWER_S = 10
"""A scheduler that does not answer for this long, or has no workers, is not there."""

_LOOK_S = 1.0
"""How often it is looked whether a scheduler is still there."""


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


class ProcessExecutor(ThreadPoolExecutor):
    """Worker processes; where one dies, all are replaced and what they were working on is redone.

    Each call waits in a thread of its own for the process that works on it, and so can hand it to
    the next pool; twice as many threads as processes keep these busy.
    """

    def __init__(self, workers: int):
        resource_tracker.ensure_running()  # starting it later would let Ctrl-C through again
        super().__init__(2 * workers, initializer=_block_interrupts)
        self._workers = workers
        self._replacing = threading.Lock()
        self._pool = self._opened()

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run `function` in a worker process."""
        return super().submit(self._call, function, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the worker processes, once they have done what they have begun."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        self._pool.shutdown(wait, cancel_futures=cancel_futures)

    def _call(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Any:
        for _ in range(_LIVES):
            pool = self._pool
            try:
                return pool.submit(function, *args, **kwargs).result()
            except BrokenProcessPool:
                self._replace(pool)
        raise GaitoptError(
            f"--executor processes: {_LIVES} worker processes in a row were killed; is memory short?"
        )

    def _replace(self, broken: ProcessPoolExecutor) -> None:
        with self._replacing:
            if self._pool is broken:
                self._pool = self._opened()

    def _opened(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self._workers, get_context("spawn"), initializer=_begin_worker)


def _block_interrupts() -> None:
    """Let no Ctrl-C through to this thread, nor to the processes that it starts."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


def _begin_worker() -> None:
    """Leave Ctrl-C to the parent process, end when it ends, however it ends, and print no warnings."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    silence_warnings()
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


class DaskExecutor(Executor):
    """The workers of a `dask.distributed` scheduler, which redoes what a lost worker was working on."""

    def __init__(self, address: str):
        try:
            from distributed import Client
        except ImportError:
            raise GaitoptError(
                f"--executor: {DASK} needs dask.distributed; install gaitopt with its extra: gaitopt[cluster]"
            ) from None
        for part in ("client", "core", "utils"):  # their logs of a lost connection run to many pages
            logging.getLogger(f"distributed.{part}").setLevel(logging.CRITICAL)
        client = None
        with suppress(OSError, ValueError):  # a timeout is an OSError, a port that is no number a ValueError
            client = Client(f"tcp://{address}", timeout=_ANSWER_S, set_as_default=False)
        if client is None:
            gc.collect()  # one that found nobody ends now: amid another's start it would lock that
            raise GaitoptError(f"--executor: no dask scheduler answers at {DASK}{address}")
        self._client = client
        try:
            self._client.wait_for_workers(1, timeout=_ANSWER_S)
        except OSError:
            self._client.close()
            raise GaitoptError(f"--executor: the dask scheduler at {DASK}{address} has no workers") from None
        self._executor = self._client.get_executor()
        self._pending: set[Future[Any]] = set()
        self._over = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()
        try:
            self._client.run_on_scheduler(usable_cores)
            self._client.run(silence_warnings)
        except Exception:
            self.shutdown(wait=False)
            raise GaitoptError(
                f"--executor: the scheduler or a worker of {DASK}{address} cannot import gaitopt"
            ) from None

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run `function` on one of the cluster's workers."""
        try:
            future: Future[Any] = self._executor.submit(function, *args, **kwargs)
        except Exception:
            if self._client.status != "closed":
                raise
            raise CancelledError from None  # as is what was submitted before
        self._pending.add(future)
        future.add_done_callback(self._pending.discard)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Part from the scheduler; it and its workers go on."""
        self._over.set()
        if self._client.status != "closed":
            self._executor.shutdown(wait=wait and not cancel_futures)
        self._client.close()

    def _watch(self) -> None:
        """Cancel what a lost scheduler leaves unanswered: dask itself forgets some of it."""
        while not self._over.wait(_LOOK_S):
            if self._client.status == "closed":
                for future in self._pending.copy():
                    future.cancel()


def open_executor(name: str = "threads", workers: int | None = None) -> Executor:
    """Return an executor; use it as a context manager.

    Args:
        name: one of `EXECUTORS`, or ``dask://HOST:PORT``. Threads share one compiled model: MuJoCo
            releases the interpreter.
        workers: how many rollouts run at once; as many as there are usable cores by default.

    Raises:
        GaitoptError: there is no executor of this name, or fewer than one worker is asked for.
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
