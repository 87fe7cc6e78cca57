"""Stated problems: every one is a single line that says what was found and what is allowed."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class GaitoptError(Exception):
    """A problem the user can act on; its text is one line, and the command line exits with 1."""

    def __init__(self, message: str):
        super().__init__(" ".join(str(message).split()))


def nearest(name: object, options: Iterable[str]) -> str:
    """Return `` (nearest: 'x')`` for the option closest to `name`, or an empty string."""
    close = difflib.get_close_matches(str(name), [str(option) for option in options], n=1, cutoff=0.5)
    return f" (nearest: {close[0]!r})" if close else ""


def bad_value(
    source: object, key: str, found: object, allowed: str, options: Iterable[str] = ()
) -> GaitoptError:
    """Return the error for a value in a file: file, key, what was found, what is allowed."""
    return GaitoptError(f"{source}: {key}: found {found!r}; allowed: {allowed}{nearest(found, options)}")


def unknown_name(source: object, what: str, name: object, options: Iterable[str]) -> GaitoptError:
    """Return the error for a name that does not exist: what exists, and the nearest of it."""
    options = list(options)
    listed = ", ".join(options) if options else "none"
    return GaitoptError(f"{source}: unknown {what} {str(name)!r}; known: {listed}{nearest(name, options)}")
