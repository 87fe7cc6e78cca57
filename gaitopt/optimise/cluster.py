"""A cluster: the workers of a `dask.distributed` scheduler."""

from __future__ import annotations

import gc
import logging
import threading
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor, Future
from contextlib import suppress
from typing import Any

from gaitopt.core.errors import GaitoptError
from gaitopt.robot.warnings import silence_warnings

DASK = "dask://"
"""How the address of a scheduler begins."""

_LOOK_S = 1.0
"""Seconds between two checks whether the scheduler is still there."""


class DaskExecutor(Executor):
    """The workers of a scheduler, which repeats the unfinished calls of a lost worker.

    Args:
        address: host and port of the scheduler.
        answer_s: seconds within which the scheduler must answer, and must have a worker.

    Raises:
        GaitoptError: dask is not installed, nothing answers, or there is no worker that can import gaitopt.
    """

    def __init__(self, address: str, answer_s: float = 10.0):
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
            client = Client(f"tcp://{address}", timeout=answer_s, set_as_default=False)
        if client is None:
            gc.collect()  # ends the client now; if it ended during another one's start, that would hang
            raise GaitoptError(f"--executor: no dask scheduler answers at {DASK}{address}")
        self._client = client
        try:
            self._client.wait_for_workers(1, timeout=answer_s)
        except OSError:
            self._client.close()
            raise GaitoptError(f"--executor: the dask scheduler at {DASK}{address} has no workers") from None
        self._executor = self._client.get_executor()
        self._pending: set[Future[Any]] = set()
        self._over = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()
        try:
            self._client.run_on_scheduler(silence_warnings)
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
        """Disconnect from the scheduler; it and its workers go on."""
        self._over.set()
        if self._client.status != "closed":
            self._executor.shutdown(wait=wait and not cancel_futures)
        self._client.close()

    def _watch(self) -> None:
        """Cancel the calls that a lost scheduler leaves unanswered; dask itself forgets some of them."""
        while not self._over.wait(_LOOK_S):
            if self._client.status == "closed":
                for future in self._pending.copy():
                    future.cancel()
