"""A figure inside a page: SVG in the page's own colours, with what a script needs to read its curves.

A figure is drawn twice, for a wide and for a narrow window. Texts stay texts. Colours become variables of
the page's style sheet, so that a dark page has light curves. A group with ``data-series`` belongs to an entry
of the legend.
"""

from __future__ import annotations

import io
import re
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from markupsafe import Markup
from matplotlib import pyplot as plt
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.container import Container
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.ticker import FixedLocator

from gaitopt.core.text import plain
from gaitopt.report.figures.style import COLOURS, narrow

_SVG = "{http://www.w3.org/2000/svg}"
_HREF = "{http://www.w3.org/1999/xlink}href"
_COLOUR = re.compile(r"#[0-9a-f]{6}\b")
_LONG_NUMBER = re.compile(r"-?\d+\.\d{3,}")
_NO_AREA = "#1f77b4"
"""What Matplotlib fills the caps of error bars with, which are lines."""

_POINTS_PER_INCH = 72.0


@dataclass(frozen=True)
class Drawing:
    """A figure as a page shows it.

    Attributes:
        wide: SVG for a wide window and for print.
        narrow: SVG for a narrow window.
        text: what it shows, in words, for readers who do not see it.
    """

    wide: Markup
    narrow: Markup
    text: str


def drawing(name: str, figure: Figure, draw: Callable[[], Figure]) -> Drawing:
    """Return a figure as a page shows it.

    Args:
        name: name of the figure, different from all others of the page.
        figure: the figure, for a wide window.
        draw: draws it again, for a narrow one.
    """
    wide = _svg(f"{name}-w", figure)
    return Drawing(wide, _narrow_svg(f"{name}-n", draw), described(figure))


def _narrow_svg(name: str, draw: Callable[[], Figure]) -> Markup:
    """Return a figure for a narrow window: as for a wide one where its names leave no room for the curves."""
    with narrow():
        small = draw()
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "constrained_layout not applied")
        try:
            return _svg(name, small)
        except UserWarning:
            plt.close(small)
    return _svg(name, draw())


def described(figure: Figure) -> str:
    """Return what a drawn figure shows in words: its axes with their ranges, its rows and its curves."""
    panels = [axes for axes in figure.axes if axes.axison]
    texts = list(dict.fromkeys(filter(None, map(_panel_in_words, panels))))
    shown = f"; {len(texts) - 4} more panels" if len(texts) > 5 else ""
    curves = list(_labels(figure))
    entries = f" Shown: {', '.join(name.strip() for name in curves)}." if curves else ""
    return plain(f"A figure of {'; '.join(texts[: 4 if shown else 5])}{shown}.{entries}".replace("−", "-"))


def _panel_in_words(axes: Axes) -> str:
    title = axes.get_title(loc="left") or axes.get_title()
    names = _rows(axes)
    rows = f"rows {', '.join(names[:12])}{' and more' if len(names) > 12 else ''}" if names else ""
    x = _range_in_words(axes.get_xlabel() or _shared_label(axes), axes.get_xlim())
    y = rows or _range_in_words(axes.get_ylabel(), axes.get_ylim())
    return (f"{title}: " if title else "") + " against ".join(filter(None, (y, x)))


def _range_in_words(label: str, ends: tuple[float, float]) -> str:
    return f"{label} from {ends[0]:.3g} to {ends[1]:.3g}" if label else ""


def _shared_label(axes: Axes) -> str:
    """Return the label of the x axis of the panel below that shares it."""
    siblings = axes.get_shared_x_axes().get_siblings(axes)
    return next((one.get_xlabel() for one in siblings if one.get_xlabel()), "")


def _rows(axes: Axes) -> list[str]:
    """Return the names of the rows of a panel that has such; else nothing."""
    if not isinstance(axes.yaxis.get_major_locator(), FixedLocator):
        return []
    return [label.get_text() for label in axes.get_yticklabels()]


# --- SVG ----------------------------------------------------------------------------------------


def _svg(name: str, figure: Figure) -> Markup:
    """Return a figure as an element of HTML, and close the figure."""
    figure.set_dpi(_POINTS_PER_INCH)
    figure.draw_without_rendering()
    _mark_series(figure)
    panels = {f"panel-{number}": axes for number, axes in enumerate(figure.axes)}
    for gid, axes in panels.items():
        axes.set_gid(gid)
    buffer = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    plt.close(figure)  # of figures that pyplot keeps
    root = ElementTree.fromstring(buffer.getvalue())
    height = figure.get_figheight() * _POINTS_PER_INCH
    known = {gid: _panel(axes, number, height) for number, (gid, axes) in enumerate(panels.items())}
    _clean(root, name, known)
    for key in ("width", "height", "version"):
        root.attrib.pop(key, None)
    root.attrib |= {"aria-hidden": "true", "focusable": "false"}
    return Markup(ElementTree.tostring(root, encoding="unicode"))


def _panel(axes: Axes, number: int, height: float) -> dict[str, str]:
    """Return what a script needs to turn places in a panel into values, and to zoom it."""
    box = axes.get_window_extent()
    ends = [box.x0, height - box.y0, box.x1, height - box.y1]  # SVG's y points down
    siblings = axes.get_shared_x_axes().get_siblings(axes)
    shared = min(axes.figure.axes.index(one) for one in siblings) if axes.figure else number
    still = not axes.axison or bool(axes.images) or axes.get_label() == "<colorbar>"
    return {
        "class": "still" if still else "panel",
        "data-box": " ".join(f"{end:.2f}" for end in ends),
        "data-x": _ends(axes.get_xlim(), axes.get_xscale()),
        "data-y": _ends(axes.get_ylim(), axes.get_yscale()),
        "data-names": f"{axes.get_xlabel() or _shared_label(axes)}|{axes.get_ylabel()}",
        "data-shared": str(shared),
    } | ({"data-rows": "yes"} if _rows(axes) else {})


def _ends(ends: tuple[float, float], scale: str) -> str:
    return f"{ends[0]:.7g} {ends[1]:.7g} {scale}"


def _clean(element: ElementTree.Element, name: str, panels: dict[str, dict[str, str]]) -> None:
    """Leave in an element and those below it what a page needs, with names that no other figure has."""
    element.tag = element.tag.removeprefix(_SVG)
    for child in list(element):
        if child.tag == f"{_SVG}metadata" or child.tag == f"{_SVG}style":
            element.remove(child)
        else:
            _clean(child, name, panels)
    for key in ("text", "tail"):
        if not (getattr(element, key) or "").strip():
            setattr(element, key, None)
    if _HREF in element.attrib:
        element.set("href", element.attrib.pop(_HREF))
    gid = element.get("id", "")
    if element.tag == "g":
        element.attrib.pop("id", None)
        element.attrib |= panels.get(gid, {}) | _group(gid)
    elif gid:
        element.set("id", f"{name}-{gid}")
    if element.get("transform", "").startswith("rotate(-0 "):
        del element.attrib["transform"]
    for key, value in element.attrib.items():
        element.set(key, _value(key, value, name))


def _group(gid: str) -> dict[str, str]:
    """Return what a group is, from the name that Matplotlib or `_mark_series` gave it."""
    kind, _, number = gid.partition("-")
    if kind in ("series", "entry"):
        return {f"data-{kind}": number.partition("-")[0]}
    if kind == "note":
        return {"class": "placed"}
    for begin, name in (("matplotlib.axis_", "axis"), ("xtick_", "tick x"), ("ytick_", "tick y")):
        if gid.startswith(begin):
            return {"class": name}
    return {}


def _value(key: str, value: str, name: str) -> str:
    """Return a value of an attribute: own names, the page's colours, numbers as fine as a screen."""
    if key in ("d", "points", "transform", "x", "y", "width", "height"):
        return " ".join(_LONG_NUMBER.sub(lambda found: f"{float(found[0]):.2f}", value).split())
    if key == "href":
        return value.replace("#", f"#{name}-", 1) if value.startswith("#") else value
    if key in ("style", "clip-path", "fill", "stroke"):
        value = value.replace("url(#", f"url(#{name}-")
        value = re.sub(r" ?font-family: [^;]*;", "", value)
        return _COLOUR.sub(lambda found: themed(found[0]), value)
    return value


def themed(colour: str) -> str:
    """Return a colour of a figure as the style sheet of a page has it: greys lie between ink and paper."""
    if colour in COLOURS:
        return f"var(--curve-{COLOURS.index(colour)})"
    levels = {int(colour[at : at + 2], 16) for at in (1, 3, 5)}
    if len(levels) > 1:
        return "none" if colour == _NO_AREA else colour
    share = 100.0 * (1.0 - levels.pop() / 255.0)
    if share in (0.0, 100.0):
        return "var(--ink)" if share else "var(--paper)"
    return f"color-mix(in srgb, var(--ink) {share:.0f}%, var(--paper))"


# --- curves and their entries in the legend -----------------------------------------------------


def _labels(figure: Figure) -> dict[str, int]:
    """Return the entries of the legends by number."""
    names = [text.get_text() for legend in _legends(figure) for text in legend.get_texts()]
    return {name: number for number, name in enumerate(dict.fromkeys(names))}


def _legends(figure: Figure) -> list[Legend]:
    own = [axes.get_legend() for axes in figure.axes]
    return [*figure.legends, *(one for one in own if one is not None)]


def _mark_series(figure: Figure) -> None:
    """Name everything that belongs to an entry of a legend after the number of that entry.

    What has the entry's label with an underscore before it belongs to it too; Matplotlib leaves it out of
    the legend.
    """
    numbers, count = _labels(figure), 0
    for axes in figure.axes:
        artists: list[Artist | Container] = [*axes.containers, *axes.get_children()]
        for artist in artists:
            label = _label(artist)
            number = numbers.get(label, numbers.get(label.removeprefix("_")))
            for part in _parts(artist) if number is not None else ():
                count += 1
                part.set_gid(f"series-{number}-{count}")
        for text in axes.texts:
            count += 1
            text.set_gid(text.get_gid() or f"note-{count}")
    for legend in _legends(figure):
        for text, handle in zip(legend.get_texts(), legend.legend_handles, strict=True):
            for part in (text, *(_parts(handle) if handle is not None else ())):
                count += 1
                part.set_gid(f"entry-{numbers[text.get_text()]}-{count}")


def _label(artist: Artist | Container) -> str:
    return str(artist.get_label() or "")


def _parts(artist: Artist | Container) -> Iterable[Artist]:
    """Return the artists of a container, or the artist itself."""
    if isinstance(artist, Artist):
        return [artist]
    return [part for one in artist for part in (one if isinstance(one, (tuple, list)) else [one]) if part]
