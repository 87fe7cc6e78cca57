"""Numbers as text: the digits 0 to 9, a point, a sign and an exponent.

Python reads more: ``1_000``, and the digits of all scripts. In a table or an option these are more likely
mistakes, and a reader may take them for another number. TOML has its own rules.
"""

from __future__ import annotations

import re

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?|[-+]?(inf|infinity|nan)", re.ASCII | re.IGNORECASE)
_WHOLE = re.compile(r"[-+]?\d{1,4000}", re.ASCII)


def number(text: str) -> float:
    """Return the number in a text; spaces around it are allowed.

    Raises:
        ValueError: the text is no number.
    """
    word = text.strip(" \t\r\n")
    if not _NUMBER.fullmatch(word):
        raise ValueError(f"not a number: {text!r}")
    return float(word)


def whole_number(text: str) -> int:
    """Return the whole number in a text; spaces around it are allowed.

    Raises:
        ValueError: the text is no whole number.
    """
    word = text.strip(" \t\r\n")
    if not _WHOLE.fullmatch(word):
        raise ValueError(f"not a whole number: {text!r}")
    return int(word)
