"""Lines for readers. Commands print only with these, so that names from files are only names."""

from __future__ import annotations

import sys

from gaitopt.core.json import to_json
from gaitopt.core.text import plain


def say(line: object) -> None:
    """Print a line; control characters in it, such as an escape sequence, are escaped."""
    print(plain(line), flush=True)


def say_aside(line: object) -> None:
    """Print a line on standard error, as `say` does: a text that is not a result."""
    print(plain(line), file=sys.stderr)


def print_json(content: object) -> None:
    """Print JSON. It is ASCII: every other character in it is escaped."""
    print(to_json(content), end="")
