"""Texts from files and from users, made safe to show."""

from __future__ import annotations

_NO_BREAK_SPACE = "\u00a0"


def plain(text: object) -> str:
    """Return a text in one line that a terminal can only show, not obey.

    Characters that Python calls not printable are escaped: control characters and line ends, marks of the
    writing direction and other invisible format characters (Unicode's category Cf), private and unassigned
    characters, and halves of surrogate pairs. No-break spaces stay as they are.
    """
    text = str(text)
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == _NO_BREAK_SPACE else ascii(c)[1:-1] for c in text)


def one_line(error: BaseException) -> str:
    """Return what an error says in one line; the name of its type where it says nothing."""
    return plain(" ".join(str(error).split())) or type(error).__name__


def shortened(text: str, most: int) -> str:
    """Return a text of at most `most` characters: the middle of a longer one is left out."""
    if len(text) <= most:
        return text
    end = (most - 1) // 2
    return f"{text[: most - 1 - end]}…{text[-end:]}"
