"""Worker processes on this machine."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context, parent_process, resource_tracker
from typing import Any

from gaitopt.core.errors import MachineError
from gaitopt.robot.warnings import silence_warnings

_LIVES = 5
"""A call that has lost this many worker processes is assumed to kill them."""


class LostWorkersError(MachineError):
    """Worker processes that died each time at the same call."""


class ProcessExecutor(ThreadPoolExecutor):
    """Worker processes. When one dies, all are replaced and their unfinished calls are repeated.

    Each call has its own thread, which waits for its process and can submit the call again to the next pool.
    Twice as many threads as processes keep the processes busy.
    """

    def __init__(self, workers: int, lives: int = _LIVES):
        """Begin without processes; the first call starts them.

        From now on, Python programs that this process starts with ``-c`` import no module from the current
        folder, which may be a stranger's: Python's own worker processes would begin with such imports.

        Args:
            workers: how many there are.
            lives: a call that has lost this many of them is not repeated: it raises `LostWorkersError`.
        """
        os.environ["PYTHONSAFEPATH"] = "1"
        resource_tracker.ensure_running()  # starting it later would let Ctrl-C through again
        super().__init__(2 * workers, initializer=_block_interrupts)
        self._workers = workers
        self._lives = lives
        self._replacing = threading.Lock()
        self._pool = self._opened()

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run `function` in a worker process."""
        return super().submit(self._call, function, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the worker processes once they have finished the calls that they have begun."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        self._pool.shutdown(wait, cancel_futures=cancel_futures)

    def _call(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Any:
        for _ in range(self._lives):
            pool = self._pool
            try:
                return pool.submit(function, *args, **kwargs).result()
            except BrokenProcessPool:
                self._replace(pool)
        raise LostWorkersError(
            f"--executor processes: {self._lives} worker processes in a row were killed; is memory short?"
        )

    def _replace(self, broken: ProcessPoolExecutor) -> None:
        with self._replacing:
            if self._pool is broken:
                self._pool = self._opened()

    def _opened(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self._workers, get_context("spawn"), initializer=_begin_worker)


def _block_interrupts() -> None:
    """Block Ctrl-C in this thread and in the processes that it starts."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


def _begin_worker() -> None:
    """Prepare a worker: it ignores Ctrl-C, ends when its parent ends, and prints no warnings of MuJoCo."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    silence_warnings()
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
