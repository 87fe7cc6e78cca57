"""Ctrl-C, delayed where it would be lost, or would change a result instead of ending the program."""

from __future__ import annotations

import _thread
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_RETRY_S = 0.01
"""Time after which a Ctrl-C that came within an import is tried again, s."""


@contextmanager
def interrupts_between_imports() -> Iterator[None]:
    """Delay Ctrl-C until no module is being imported.

    Within an import it can become an ImportError ("initialization failed") or be lost.
    A program that ignores Ctrl-C, or has its own handler, keeps that.
    """
    ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not ours or threading.current_thread() is not threading.main_thread():
        yield
        return
    retry: threading.Timer | None = None

    def act(number: int, frame: FrameType | None) -> None:
        nonlocal retry
        if not _importing(frame):
            retry = None
            raise KeyboardInterrupt
        retry = threading.Timer(_RETRY_S, _interrupt_main)
        retry.daemon = True
        retry.start()

    signal.signal(signal.SIGINT, act)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if retry is not None:
            retry.cancel()
    if retry is not None:
        raise KeyboardInterrupt


def _interrupt_main() -> None:
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, signal.SIGINT)  # this also wakes it where it sleeps or waits
    else:
        _thread.interrupt_main()


def _importing(frame: FrameType | None) -> bool:
    while frame is not None and frame.f_code.co_filename != "<frozen importlib._bootstrap>":
        frame = frame.f_back
    return frame is not None


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Delay Ctrl-C until the block ends: for native code that would treat it as a failure."""
    if threading.current_thread() is not threading.main_thread():
        yield  # Ctrl-C reaches only the main thread
        return
    pressed = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal pressed
        pressed = True

    previous = signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous or signal.SIG_DFL)
    if pressed:
        signal.raise_signal(signal.SIGINT)
