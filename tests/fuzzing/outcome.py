"""How a case ended, and what must hold of it: success or one clear line, and no harm to any file."""

from __future__ import annotations

import contextlib
import io
import re
import signal
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from unittest import mock

from helpers import brief_studies

from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError

LIMIT_S = 20.0
"""A case that takes longer counts as hanging; on a free core a case takes 0.01 s."""

WHOLE_LIMIT_S = 300.0
"""The same for a complete run of a command, with its figures and its page."""

PROGRESS = re.compile(r".* …|search: \d+/\d+ gaits, .*")
"""A line of progress on standard error: a stage that begins, or what a search has done."""


@dataclass(frozen=True)
class Case:
    """One attempt: a command line, or a reader called directly, with files in `folder`.

    Attributes:
        arguments: the command line.
        call: the reader called instead.
        may_change: files and folders that it may change however it ends.
        rewrites: those that it may change where it succeeds, as a search that is resumed does.
        limit_s: its longest time, s.
    """

    arguments: list[str] = field(default_factory=list)
    call: Callable[[], object] | None = None
    may_change: tuple[str, ...] = ()
    rewrites: tuple[str, ...] = ()
    limit_s: float = LIMIT_S

    @property
    def brief(self) -> bool:
        """Whether it is a complete run; its studies have few samples."""
        return self.limit_s > LIMIT_S


@dataclass(frozen=True)
class Outcome:
    """How a case ended: ``done``, ``stated``, ``usage``, or what is wrong, with the words of the line."""

    ended: str
    words: str = ""

    @property
    def wrong(self) -> bool:
        return self.ended not in ("done", "stated", "usage")


class TooLongError(BaseException):
    """The limit on a case's time; no command may catch it."""


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    def stop(number: int, frame: FrameType | None) -> None:
        raise TooLongError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def attempt(case: Case, folder: Path) -> Outcome:
    """Run a case in its folder, which is the working directory, and return how it ended."""
    before = contents(folder)
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", newline="\n")
    err = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="backslashreplace", newline="\n")
    try:
        with (
            brief_run() if case.brief else contextlib.nullcontext(),
            limited(case.limit_s),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("always")  # a warning on standard error would be a second line
            code = cli.main(case.arguments) if case.call is None else called(case.call)
    except TooLongError:
        return Outcome("hang")
    except BaseException:
        return Outcome("traceback", traceback.format_exc())
    err.flush()
    said = err.buffer.getvalue().decode()  # type: ignore[attr-defined]
    lines = said.removesuffix("\n").split("\n") if said else []
    if code not in (0, 1, 2):
        return Outcome(f"exit {code}", said)
    lines = [line for line in lines if not PROGRESS.fullmatch(line)]
    if len(lines) != (code != 0) or not all(line.startswith("gaitopt: ") and line.strip() for line in lines):
        return Outcome("not one line", said)
    may_change = case.may_change if code else (*case.may_change, *case.rewrites)
    wrong = wrong_files(before, contents(folder), code, may_change)
    if wrong:
        return Outcome("files", wrong)
    return Outcome(("done", "stated", "usage")[code], said.strip())


@contextlib.contextmanager
def brief_run() -> Iterator[None]:
    with contextlib.ExitStack() as stack:
        for module, name, value in brief_studies():
            stack.enter_context(mock.patch.object(module, name, value))
        yield


def called(call: Callable[[], object]) -> int:
    """Call a reader as the command line would."""
    try:
        call()
    except GaitoptError as problem:
        print(f"gaitopt: {problem}", file=sys.stderr)
        return 1
    return 0


def contents(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def wrong_files(
    before: dict[str, bytes], after: dict[str, bytes], code: int, may_change: tuple[str, ...]
) -> str:
    """Return which forbidden change a command made to files, or nothing."""
    for name, data in before.items():
        if name.split("/")[0] not in may_change and after.get(name) != data:
            return f"{name} was {'changed' if name in after else 'removed'}"
        if code and name.startswith("out") and after.get(name) != data:
            return f"{name} was overwritten by a command that failed"
    new = [name for name in after if name not in before]
    half = [name for name in new if re.search(r"(^|/)\.[^/]+\.[a-z0-9_]{8}(\.|$|/)", name)]
    if half:
        return f"{half[0]} is half-written"
    if code and [name for name in new if name.split("/")[0] not in may_change]:
        return f"{new[0]} was left by a command that failed"
    return ""
