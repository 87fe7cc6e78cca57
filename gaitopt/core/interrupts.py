"""Ctrl-C and SIGTERM, delayed where they would be lost, or would be a failure instead of the end."""

from __future__ import annotations

import _thread
import math
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


class Terminated(KeyboardInterrupt):
    """SIGTERM asked the program to end. It ends as after Ctrl-C, with another exit code."""


_RAISED: dict[int, type[KeyboardInterrupt]] = {signal.SIGINT: KeyboardInterrupt, signal.SIGTERM: Terminated}
"""What a signal raises."""

_USUAL: dict[int, Any] = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
"""How Python handles these signals by itself."""

_SAME_S = 1.0
"""A signal that comes again within this time is the same one, s.

`timeout` sends SIGTERM to a command and then to its whole group. The second would end what the first began,
such as saying where a run can be resumed.
"""

_RETRY_S = 0.01
"""Time after which a signal that came within an import is tried again, s."""


def was_terminated(stop: KeyboardInterrupt) -> bool:
    """Return whether SIGTERM, and not Ctrl-C, ended a job."""
    return isinstance(stop.__cause__ or stop, Terminated)


@contextmanager
def interrupts_between_imports() -> Iterator[None]:
    """Raise KeyboardInterrupt at Ctrl-C and `Terminated` at SIGTERM, but only while no module is imported.

    Within an import, an exception can become an ImportError ("initialization failed") or be lost.
    Each counts once within `_SAME_S`. A program that ignores one of these signals, or has its own handler,
    keeps that.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ours = [number for number, usual in _USUAL.items() if signal.getsignal(number) == usual]
    retries: dict[int, threading.Timer] = {}
    raised_at: dict[int, float] = {}

    def act(number: int, frame: FrameType | None) -> None:
        retries.pop(number, None)
        now = time.monotonic()
        if now - raised_at.get(number, -math.inf) < _SAME_S:
            return
        if not _importing(frame):
            raised_at[number] = now
            raise _RAISED[number]
        retries[number] = threading.Timer(_RETRY_S, _signal_main, (number,))
        retries[number].daemon = True
        retries[number].start()

    for number in ours:
        signal.signal(number, act)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, _USUAL[number])
        for retry in retries.values():
            retry.cancel()
    for number in retries:
        raise _RAISED[number]


def _signal_main(number: int) -> None:
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, number)  # this also wakes it if it sleeps or waits
    else:
        _thread.interrupt_main(signal.Signals(number))


def _importing(frame: FrameType | None) -> bool:
    while frame is not None and frame.f_code.co_filename != "<frozen importlib._bootstrap>":
        frame = frame.f_back
    return frame is not None


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Delay Ctrl-C and SIGTERM until the block ends: for native code that would treat them as a failure.

    A signal without a handler of Python is left alone.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # signals reach only the main thread
        return
    pressed: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        pressed.append(number)

    previous = {number: handler for number in _RAISED if callable(handler := signal.getsignal(number))}
    for number in previous:
        signal.signal(number, note)
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
    if pressed:
        signal.raise_signal(pressed[0])


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Delay Ctrl-C and SIGTERM until the block ends, also in processes that it starts.

    A terminal sends Ctrl-C to them, too, and one in which Python begins would end with a trace of its own.
    Windows cannot delay it there.
    """
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _RAISED)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
