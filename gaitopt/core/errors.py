"""Errors that a user can act on: one line each, with what was found and what is allowed."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable

from gaitopt.core.text import plain


class _Short(reprlib.Repr):
    """Values as a message quotes them. Python refuses to print integers of more than 4300 digits."""

    def repr_int(self, x: int, level: int) -> str:
        return super().repr_int(x, level) if x.bit_length() < 10_000 else "a number of thousands of digits"


_SHORT = _Short()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 200


class GaitoptError(Exception):
    """A problem that the user can act on. Its text is one line, and the command line exits with 1.

    The text may quote names from files. Characters that are not printable, and could move a terminal's
    cursor, are escaped.
    """

    def __init__(self, message: str):
        super().__init__(plain(" ".join(str(message).split())))


class MachineError(GaitoptError):
    """The machine failed, not the input: a full disk, a locked folder, a lost worker.

    The same command may succeed later, so nothing may be concluded from it.
    """


def found(value: object) -> str:
    """Return a value as a message quotes it: shortened, however long or deep it is."""
    return _SHORT.repr(value)


def nearest(name: object, options: Iterable[str]) -> str:
    """Return `` (nearest: 'x')`` for the option closest to `name`, or an empty string."""
    close = difflib.get_close_matches(str(name), [str(option) for option in options], n=1, cutoff=0.5)
    return f" (nearest: {close[0]!r})" if close else ""


def bad_value(
    source: object, key: str, value: object, allowed: str, options: Iterable[str] = ()
) -> GaitoptError:
    """Return the error for a value in a file: file, key, what was found, what is allowed."""
    return GaitoptError(f"{source}: {key}: found {found(value)}; allowed: {allowed}{nearest(value, options)}")


def unknown_name(source: object, what: str, name: object, options: Iterable[str]) -> GaitoptError:
    """Return the error for a name that does not exist: it lists those that do, and the nearest."""
    options = list(options)
    listed = ", ".join(options) if options else "none"
    return GaitoptError(
        f"{source}: unknown {what} {found(str(name))}; known: {listed}{nearest(name, options)}"
    )
