"""Pages as a browser shows them: nothing leaves the window, all is legible, figures can be explored."""

import base64
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import Tab, browser_tab, needs_browser
from helpers import STRIDER
from matplotlib.figure import Figure
from page_audit import faults_of

from gaitopt.cli import app as cli
from gaitopt.report.figures.style import (
    COLOURS,
    finish,
    legend_below,
    name_rows,
    plain_ticks,
    single_panel,
    stacked_panels,
)
from gaitopt.report.page import Page, Picture, Section, Table, save_figures

pytestmark = needs_browser

CURVE = "[...document.querySelector('.wide').querySelectorAll('[data-series=\"0\"] path')]"
"""The first curve of the first figure, in each of its panels."""


def lines() -> Figure:
    figure, (above, below) = stacked_panels(2, 4.0)
    time = np.linspace(0.0, 10.0, 101)
    above.plot(time, 3.0 * time, color=COLOURS[0], label="rising")
    above.plot(time, 30.0 - time, "--", color=COLOURS[5], label="falling $x$")
    below.plot(time, 2.0 * time, color=COLOURS[0], label="_rising")
    finish(above, "", "way [mm]", legend=False)
    finish(below, "time [s]", "way [mm]", legend=False)
    legend_below(figure, above, 3)
    return figure


def rows() -> Figure:
    figure, axes = single_panel(2.5)
    for index, colour in enumerate(COLOURS):
        axes.plot(10.0**index, index, "o", color=colour, label=f"kind {index}")
    axes.set_xscale("log")
    plain_ticks(axes.xaxis)
    name_rows(axes, range(len(COLOURS)), [f"row <{index}>" for index in range(len(COLOURS))])
    finish(axes, "error [1]", "", legend=False)
    legend_below(figure, axes, 3)
    return figure


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page")
    long = "a-name-without-any-place-to-break-it-" * 6
    table = Table(["gait", "speed [mm/s]", *(f"metric {n}" for n in range(12))], [], words=(2,))
    cells = ["some words that may wrap", *["1.25 to 2.5"] * 11]
    entries = [[name, speed, *cells] for name, speed in (("a", "-3"), ("b", "20"), ("c", "9.5"), (long, "–"))]
    sections = [
        *save_figures(
            folder, {"lines": Picture("Lines", lines, "Two lines."), "rows": Picture("Rows", rows, "Dots.")}
        ),
        Section("Speeds", table=Table(table.head, entries, note="What to know.", words=(2,))),
        Section("Details", sentences=["A folded sentence."], folded=True),
        Section("What next", commands=[f"gaitopt simulate {long}", "gaitopt demo"]),
    ]
    result = Page(
        title=long, answer=f"It is {long}.", asked={"Robot": long}, tiles=[("3 mm/s", "speed")],
        notes=["Note."], sections=sections,
    )  # fmt: skip
    path = folder / "report.html"
    path.write_text(result.html())
    return path


@pytest.fixture(scope="module")
def tab() -> Iterator[Tab]:
    with browser_tab() as one:
        yield one


def test_a_page_is_legible_at_every_width_in_both_themes(page: Path) -> None:
    assert faults_of(page) == []


def test_a_page_needs_nothing_but_its_file(page: Path) -> None:
    assert "default-src &#39;none&#39;" in page.read_text()


def test_a_figure_tells_the_value_under_the_pointer(page: Path, tab: Tab) -> None:
    tab.opened(page)
    assert point_at(tab, "rising", 0.5) == ["rising", "way [mm]: 15", "time [s]: 5"]


def test_a_curve_goes_off_and_on(page: Path, tab: Tab) -> None:
    tab.opened(page)
    shown = f"{CURVE}.map(path => path.getClientRects().length > 0)"
    press = "document.querySelector('.tools button[aria-pressed]').click()"
    assert tab.value(shown) == [True, True]
    tab.value(press)
    assert tab.value(shown) == [False, False]
    tab.value(press)
    assert tab.value(shown) == [True, True]


def test_zoom_keeps_values_and_panels_that_share_an_axis(page: Path, tab: Tab) -> None:
    tab.opened(page)
    paths = f"{CURVE}.map(path => path.getAttribute('d'))"
    before = tab.value(paths)
    tab.value("document.querySelector('.tools button').click()")
    after = tab.value(paths)
    assert all(old != new for old, new in zip(before, after, strict=True))
    assert point_at(tab, "rising", 0.5) == ["rising", "way [mm]: 15", "time [s]: 5"]
    tab.value("document.querySelectorAll('.tools button')[2].click()")
    np.testing.assert_allclose(coordinates(tab.value(paths)), coordinates(before), atol=0.02)


def test_a_table_sorts_by_number_and_by_name(page: Path, tab: Tab) -> None:
    tab.opened(page)
    column = "[...document.querySelectorAll('tbody tr')].map(row => row.cells[1].textContent)"
    press = "document.querySelectorAll('thead button')[1].click()"
    tab.value(press)
    assert tab.value(column) == ["−3", "9.5", "20", "–"]
    tab.value(press)
    assert tab.value(column) == ["20", "9.5", "−3", "–"]
    assert tab.value("document.querySelector('[aria-sort]').ariaSort") == "descending"


def test_a_command_is_copied_whole(page: Path, tab: Tab) -> None:
    tab.opened(page)
    tab.value("navigator.clipboard.writeText = async (text) => { window.copied = text; }")
    tab.value("document.querySelectorAll('.command button')[1].click()")
    assert tab.value("window.copied") == "gaitopt demo"


def test_the_theme_follows_the_system_until_the_reader_chooses(page: Path, tab: Tab) -> None:
    ground = "getComputedStyle(document.body).backgroundColor"
    tab.opened(page, prefers_color_scheme="dark")
    tab.value("localStorage.clear()")
    tab.opened(page, prefers_color_scheme="light")
    light = tab.value(ground)
    tab.opened(page, prefers_color_scheme="dark")
    dark = tab.value(ground)
    assert light != dark
    tab.value("document.querySelector('.theme').click()")
    assert tab.value(ground) == light
    tab.value("localStorage.clear()")


def test_print_opens_what_is_folded_on_white(page: Path, tab: Tab) -> None:
    tab.opened(page, prefers_color_scheme="dark")
    tab.call("Emulation.setEmulatedMedia", media="print")
    folded = "document.querySelector('section details li').getClientRects().length"
    assert tab.value(folded) == 1
    assert tab.value("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    printed = base64.b64decode(tab.call("Page.printToPDF")["data"])
    assert printed.startswith(b"%PDF")
    tab.call("Emulation.setEmulatedMedia", media="")


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ("optimise", STRIDER, "--budget", 4, "--pareto", "--quiet"),
        ("compare", STRIDER, "stride", "square"),
        ("check", STRIDER),
        ("sweep", STRIDER, "--over", "period_s=0.4,0.5"),
    ],
    ids=lambda command: command[0],
)
def test_every_command_s_page_is_legible(tmp_path: Path, command: tuple[object, ...]) -> None:
    assert cli.main([*map(str, command), "--out", str(tmp_path / "out")]) == 0
    assert faults_of(tmp_path / "out" / "report.html") == []


def point_at(tab: Tab, series: str, share: float) -> list[str]:
    """What is written beside the pointer on a place of the first figure's first panel, on its first curve."""
    tab.value("document.querySelector('figure.plot').scrollIntoView()")
    x, y = tab.value(
        f"(() => {{ const box = {CURVE}[0].getBoundingClientRect();"
        f"return [box.left + {share} * box.width, box.bottom - {share} * box.height]; }})()"
    )
    for dx in (1.0, 0.0):
        tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + dx, y=y)
    tab.settled()
    said: list[str] = tab.value(
        "[...document.querySelectorAll('figure.plot .tip div')].map(one => one.textContent)"
    )
    return said


def coordinates(paths: list[str]) -> list[float]:
    return [float(word) for path in paths for word in path.split() if not word.isalpha()]
