"""A cluster: the workers of a `dask.distributed` scheduler.

An address has to be trusted: a scheduler and its workers exchange pickles with this process, so whoever
answers there can run code here.
"""

from __future__ import annotations

import gc
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from gaitopt.core.errors import GaitoptError, MachineError
from gaitopt.core.text import one_line
from gaitopt.optimise.handshake import DASK, check_scheduler, no_answer
from gaitopt.robot.warnings import silence_warnings


@dataclass(frozen=True)
class ClusterSettings:
    """How long a cluster may be silent.

    Attributes:
        answer_s: a scheduler must answer, and must have a worker, within this time, s.
        look_s: time between two looks at the scheduler and its workers, s.
        no_worker_s: calls fail when there has been no worker for this time, s. A killed worker that
            something starts again is back within a few seconds.
        no_answer_s: calls fail when the scheduler has not answered for this time, s. Its machine may be
            busy or far away, so this is longer.
    """

    answer_s: float = 10.0
    look_s: float = 1.0
    no_worker_s: float = 10.0
    no_answer_s: float = 60.0


class DaskExecutor(Executor):
    """The workers of a scheduler, which repeats the unfinished calls of a lost worker.

    A call ends with a `MachineError` where the scheduler or all workers are lost, or where it is one that
    kills workers. Calls that are submitted after all workers were lost wait for a worker as long again.

    Args:
        address: host and port of the scheduler.
        settings: how long it may be silent.

    Raises:
        GaitoptError: dask is not installed, no scheduler answers, or there is no worker that can import
            gaitopt.
    """

    def __init__(self, address: str, settings: ClusterSettings | None = None):
        self._settings = settings = settings or ClusterSettings()
        self._where = f"{DASK}{address}"
        self._client = _connected(address, settings.answer_s)
        try:
            self._client.wait_for_workers(1, timeout=settings.answer_s)
        except OSError:
            self._client.close()
            raise GaitoptError(f"--executor: the dask scheduler at {self._where} has no workers") from None
        self._executor = self._client.get_executor()
        self._pending: dict[Future[Any], Future[Any]] = {}  # ours, and what dask made for it
        self._over = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()
        try:
            self._client.run_on_scheduler(silence_warnings)
            self._client.run(silence_warnings)
        except Exception:
            self.shutdown(wait=False)
            raise GaitoptError(
                f"--executor: the scheduler or a worker of {self._where} cannot import gaitopt"
            ) from None

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run `function` on one of the cluster's workers."""
        try:
            inner: Future[Any] = self._executor.submit(function, *args, **kwargs)
        except Exception:
            if self._client.status != "closed":
                raise
            raise self._lost() from None
        future: Future[Any] = Future()
        self._pending[future] = inner
        future.add_done_callback(lambda own: self._pending.pop(own, None))
        future.add_done_callback(lambda own: own.cancelled() and inner.cancel())
        inner.add_done_callback(lambda done: self._pass_on(done, future))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Disconnect from the scheduler; it and its workers go on."""
        if self._client.status != "closed":
            self._executor.shutdown(wait=wait and not cancel_futures)
        self._over.set()  # until then, calls that wait for lost workers have to fail
        self._client.close()

    def _pass_on(self, done: Future[Any], future: Future[Any]) -> None:
        """Give the result of dask's future to the one that its caller has."""
        with suppress(InvalidStateError):  # it failed or was cancelled before
            if done.cancelled():
                future.set_exception(self._lost())
                return
            error = done.exception()
            if error is None:
                future.set_result(done.result())
            elif type(error).__module__.startswith("distributed"):  # as of a call that kills workers
                future.set_exception(MachineError(f"--executor: {self._where}: {one_line(error)}"))
            else:
                future.set_exception(error)

    def _watch(self) -> None:
        """Let the calls fail that a lost scheduler, or one without workers, leaves unanswered."""
        settings = self._settings
        answered = had_worker = time.monotonic()
        while not self._over.wait(settings.look_s):
            workers = self._workers()
            now = time.monotonic()
            if workers is not None:
                answered = now
            if workers:
                had_worker = now
            if self._client.status == "closed" or now - answered >= settings.no_answer_s:
                self._fail(self._lost())
            elif workers == 0 and now - had_worker >= settings.no_worker_s:
                self._fail(
                    MachineError(
                        f"--executor: no worker is left at {self._where} since {settings.no_worker_s:.0f} s"
                    )
                )
                had_worker = now  # later calls wait as long again

    def _workers(self) -> int | None:
        """Return how many workers there are; None where the scheduler does not say."""
        client = self._client
        try:
            return len(client.sync(client.scheduler.ncores, callback_timeout=5.0 * self._settings.look_s))
        except Exception:  # of a connection that is lost or slow, in any of dask's layers
            return None

    def _fail(self, error: MachineError) -> None:
        pending = self._pending.copy()
        for future in pending:
            with suppress(InvalidStateError):
                future.set_exception(error)
        for inner in pending.values():  # which asks the scheduler, and may wait for it
            inner.cancel()

    def _lost(self) -> MachineError:
        return MachineError("--executor: the connection to its workers was lost")


def _connected(address: str, answer_s: float) -> Any:
    """Return a client of a scheduler.

    Raises:
        GaitoptError: dask is not installed, or no scheduler answers in time.
    """
    try:
        from distributed import Client
    except ImportError:
        raise GaitoptError(
            f"--executor: {DASK} needs dask.distributed; install gaitopt with its extra: gaitopt[cluster]"
        ) from None
    for part in ("client", "core", "utils"):  # their logs of a lost connection run to many pages
        logging.getLogger(f"distributed.{part}").setLevel(logging.CRITICAL)
    check_scheduler(address, answer_s)
    made: list[Any] = []

    def connect() -> None:
        with suppress(Exception):  # whatever the answer of another program leads to
            made.append(Client(f"tcp://{address}", timeout=answer_s, set_as_default=False))

    connecting = threading.Thread(target=connect, daemon=True)
    connecting.start()
    connecting.join(answer_s)  # a greeting that does not end, unlike the one just checked, would block it
    if not made:
        gc.collect()  # ends the client now; if it ended during another one's start, that would hang
        raise no_answer(address)
    return made[0]
