"""Names as they are drawn into figures and films."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from matplotlib import get_data_path
from matplotlib.font_manager import get_font

from gaitopt.core.text import plain, shortened

LONGEST = 60
"""Characters of a name in a figure, at most: these leave a panel half of the figure's width."""

LONGEST_IN_LEGEND = 24
"""Characters of a name in a legend of three columns, at most."""


def font_file() -> Path:
    """Return the font of figures and films, which Matplotlib brings."""
    return Path(get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"


def drawable(name: str, most: int = LONGEST) -> str:
    """Return a name as a figure or a film shows it.

    Characters that are not printable, or that the font lacks, are escaped. The middle of a long name is left
    out. A name that begins with an underscore gets a space before it, because Matplotlib leaves such names
    out of legends.

    Args:
        name: the name.
        most: characters that it may have at most.
    """
    name = "".join(c if _has(c) else c.encode("ascii", "backslashreplace").decode() for c in plain(name))
    name = shortened(name, most)
    return f" {name}" if name.startswith("_") else name


@cache
def _has(letter: str) -> bool:
    return bool(get_font(str(font_file())).get_char_index(ord(letter)))
