"""Names as drawn in figures and films."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from matplotlib import get_data_path
from matplotlib.font_manager import get_font
from PIL import ImageFont

from gaitopt.core.text import plain, shortened

WIDEST = 36.0
"""Width of a name, at most, in units of its font's size: 5 of a figure's 6 inches at ten points."""

WIDEST_IN_LEGEND = 15.0
"""The same in a legend of three columns."""

_MOST_LETTERS = 200
"""More letters than these are always wider than `WIDEST`; a name may have many thousands."""


def drawable(name: str, widest: float = WIDEST) -> str:
    """Return a name as a figure or a film shows it.

    Characters that are not printable, or that the font lacks, are escaped. The middle of a long name is left
    out. A name that is empty or begins with an underscore gets a space before it, because Matplotlib leaves
    such names out of legends.

    Args:
        name: the name.
        widest: its width, at most, in units of the font's size.
    """
    name = shortened(plain(name), _MOST_LETTERS)
    name = "".join(c if _has(c) else c.encode("ascii", "backslashreplace").decode() for c in name)
    while font(100).getlength(name) > 100.0 * widest:
        name = shortened(name, len(name) - 1)
    return f" {name}" if not name or name.startswith("_") else name


@cache
def font(size: int) -> ImageFont.FreeTypeFont:
    """Return the font of figures and films, which Matplotlib brings, in a size in pixels."""
    return ImageFont.truetype(_file(), size)


@cache
def _has(letter: str) -> bool:
    return bool(get_font(_file()).get_char_index(ord(letter)))


def _file() -> str:
    return str(Path(get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf")
