"""One self-contained HTML page: an answer, and sections of tables and figures, without any network."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import jinja2
from markupsafe import Markup, escape
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from gaitopt.core.errors import GaitoptError
from gaitopt.core.text import one_line, plain
from gaitopt.report import settings as defaults
from gaitopt.report.drawing import Drawing, drawing
from gaitopt.runs.folder import write_into

_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data: blob:; "
    "media-src data: blob:; connect-src data: blob:"
)
"""What a browser may load for a page: nothing that is not in the file."""

_UNIT = r"mm/s|mm|m/s|ms|m|s|°/s|°|rad/s|rad|N m|Hz|gaits|times"


@dataclass(frozen=True)
class Table:
    """Rows of texts under a head.

    Attributes:
        head: names of the columns, with units.
        rows: the cells.
        note: what to know when reading it.
        mark_first: whether the first row is the one that matters.
        words: columns that hold words, which may wrap, rather than figures.
        links: addresses that the first cells lead to, one for each row; empty texts for none.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    mark_first: bool = False
    words: Sequence[int] = ()
    links: Sequence[str] = ()


@dataclass(frozen=True)
class Section:
    """One part of a page: a title over sentences, a table, or a picture with its caption.

    Attributes:
        title: the title.
        sentences: a list.
        table: a table.
        drawing: a figure as SVG.
        image: a picture as a data URI.
        caption: what to see in it.
        commands: lines to type.
        folded: whether it opens on request.
        body: HTML of a part with its own template, such as a player; it stands after the picture.
        styles: style sheets in ``templates/`` that the body needs; a page has each of them once.
        scripts: scripts in ``templates/`` that the body needs; likewise, at the end of the page.
    """

    title: str
    sentences: Sequence[str] = ()
    table: Table | None = None
    drawing: Drawing | None = None
    image: str = ""
    caption: str = ""
    commands: Sequence[str] = ()
    folded: bool = False
    body: Markup | None = None
    styles: Sequence[str] = ()
    scripts: Sequence[str] = ()

    @property
    def anchor(self) -> str:
        """Name that links on the page use."""
        return re.sub(r"\W+", "-", self.title.lower()).strip("-")


@dataclass(frozen=True)
class Picture:
    """A figure before it is drawn: its title, the function that draws it, and its caption."""

    title: str
    draw: Callable[[], Figure]
    caption: str


@dataclass(frozen=True)
class Page:
    """What a page says.

    Attributes:
        title: the title.
        answer: the result in a sentence or two.
        asked: the request, by keyword.
        tiles: the most important figures, each with its meaning.
        notes: what else the reader must know.
        sections: the parts in order.
        has_figures: whether ``figures/`` beside it has the figures for print.
    """

    title: str
    answer: str
    asked: Mapping[str, str]
    tiles: Sequence[tuple[str, str]] = ()
    notes: Sequence[str] = ()
    sections: Sequence[Section] = ()
    has_figures: bool = True

    def html(self) -> str:
        """Return the page."""
        made_by = f"gaitopt {version('gaitopt')} and MuJoCo {version('mujoco')}"
        return rendered(
            "page.html",
            page=self,
            anchors=_anchors(self.sections),
            made_by=made_by,
            policy=_POLICY,
            styles=_once("page.css", "plot.css", *(name for one in self.sections for name in one.styles)),
            scripts=_once("page.js", "plot.js", *(name for one in self.sections for name in one.scripts)),
        )


def rendered(template: str, **values: object) -> Markup:
    """Return a template of ``templates/`` with some values; texts among them are escaped."""
    environment = jinja2.Environment(
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        loader=jinja2.PackageLoader("gaitopt.report"),
        finalize=_shown,
    )
    environment.filters["typeset"] = typeset
    return Markup(environment.get_template(template).render(**values))


def _once(*names: str) -> list[str]:
    return list(dict.fromkeys(names))


def typeset(text: str) -> Markup:
    """Return a text as HTML with minus signs, and with figures and units, and gaits' names, on one line.

    Commands of gaitopt in backticks, as in the terminal, are set as code.
    """
    html = str(escape(plain(text)))
    html = re.sub(r"(?<![\w.)\]-])-(?=[\d∞])", "−", html)
    html = re.sub(r"(?<=\d) ?%", "\u00a0%", html)
    html = re.sub(rf"(?<=\d) (?=(?:{_UNIT})(?!\w))", "\u00a0", html)
    html = html.replace("N m", "N\u00a0m")
    html = re.sub(r"`(gaitopt [a-z]+)`", r"<code>\g<1></code>", html)
    return Markup(re.sub(r"\b[a-z]+-\d[\w.]*\w", r'<span class="whole">\g<0></span>', html))


def _anchors(sections: Sequence[Section]) -> list[str]:
    """Return the anchor of each section, a different one for each, although titles contain any names."""
    anchors: list[str] = []
    for section in sections:
        anchor = section.anchor
        while not anchor or anchor in anchors:
            anchor += "-"
        anchors.append(anchor)
    return anchors


@contextmanager
def after_results(folder: Path, results: str, again: str = "") -> Iterator[None]:
    """Write a page, after the results that it shows: where it fails, say that they are safe.

    Args:
        folder: where the results and the page are.
        results: the files of the results.
        again: how to write the page again, where that needs no new results.

    Raises:
        GaitoptError: the page could not be written.
    """
    try:
        yield
    except Exception as error:
        raise GaitoptError(
            f"{folder}: the results are safe in {results}, but their page could not be written: "
            f"{one_line(error)}" + (f"; to write it: {again}" if again else "")
        ) from error


def _shown(value: object) -> object:
    """Return a value as a page shows it: a text is always plain; HTML is what made it."""
    return plain(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def save_figures(folder: Path, pictures: Mapping[str, Picture]) -> list[Section]:
    """Write figures into ``figures/`` by name, and return a section of each.

    The section of a figure that cannot be drawn says so: the rest of the page does not depend on it.

    Raises:
        GaitoptError: a figure cannot be written.
    """
    sections = []
    for name, picture in pictures.items():
        try:
            figure = picture.draw()
            data = png(figure)
            drawn = drawing(name, figure, picture.draw)
        except Exception as error:
            sections.append(Section(picture.title, sentences=[f"Not drawn: {one_line(error)}."]))
            continue
        write_into(folder, f"figures/{name}.png", writer(data))
        sections.append(Section(picture.title, drawing=drawn, caption=picture.caption))
    return sections


def image_section(title: str, data: bytes, kind: str, caption: str) -> Section:
    """Return a section that shows an image file's content."""
    return Section(title, image=data_uri(data, f"image/{kind}"), caption=caption)


def data_uri(data: bytes, kind: str) -> str:
    """Return a file's content as an address for a page; the kind is its media type."""
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def folded(section: Section) -> Section:
    """Return a section that opens on request."""
    return replace(section, folded=True)


def png(figure: Figure) -> bytes:
    """Return a figure as a PNG file for print; the same figure gives exactly the same file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=defaults.DEFAULT.dpi, metadata={"Software": None})
    plt.close(figure)  # of figures that pyplot keeps
    return buffer.getvalue()


def writer(data: bytes) -> Callable[[Path], object]:
    """Return what writes some bytes to a path."""
    return lambda path: path.write_bytes(data)
