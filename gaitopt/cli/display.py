"""Tables and sentences on standard output, in which names from files are only names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from gaitopt.cli.lines import say
from gaitopt.core.quantities import figure
from gaitopt.core.text import plain
from gaitopt.simulation.labels import label_of, shown

if TYPE_CHECKING:
    from gaitopt.effects.rows import EffectRow
    from gaitopt.jobs.simulate import Rollout
    from gaitopt.optimise.compare import ComparedGait
    from gaitopt.optimise.robots import OverRobots
    from gaitopt.optimise.sweep import SweptPoint
    from gaitopt.runs.listing import ListedRun
    from gaitopt.runs.summary import Summary


def plain_console(stderr: bool = False) -> Console:
    """Return a console of Rich that reads no markup and no emoji codes in texts, and colours nothing."""
    return Console(stderr=stderr, markup=False, emoji=False, highlight=False)


def print_report(folder: Path | None) -> None:
    """Print where the page of a run is, if there is one."""
    if folder is not None:
        say(f"report: {folder / 'report.html'}")


def print_summary(summary: Summary) -> None:
    """Print the best gait of a search, with the baselines."""
    rows = []
    for row in [summary.best, *summary.baselines]:
        met = "met" if row.constraints_met else "violated"
        low, speed, high = (
            f"{1e3 * value:.1f}" if isfinite(value) else "-"  # a gait that fails has no speed
            for value in (row.speed_ci90_m_s[0], row.speed_m_s, row.speed_ci90_m_s[1])
        )
        rows.append([row.name, figure(row.period_s), speed, f"{low} to {high}", met])
    print_table(["gait", "period [s]", "speed [mm/s]", "90 % interval", "constraints"], rows)


def print_margins(summary: Summary) -> None:
    """Print how far the best gait stays from each limit, and what its owner must know."""
    from gaitopt.report.tables import MARGIN_HEAD, margin_rows
    from gaitopt.report.words import warning_lines

    if summary.best.margins:
        print_table([*MARGIN_HEAD], margin_rows(summary.best))
    for line in warning_lines(summary):
        say(line)


def print_rows(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print rows with names under the labels of their keys."""
    keys = [key for key in rows[0] if not key.startswith("scenario_")]
    keys.sort(key=lambda key: key != "name")
    print_table([label_of(key) for key in keys], [[shown(key, row[key]) for key in keys] for row in rows])


def print_over_robots(rollout: Rollout, over: OverRobots) -> None:
    """Print the metrics of a gait on the nominal robot, and what to expect of them over a posterior."""
    rows = []
    for key, value in rollout.metrics.items():
        expected = over.metrics[key]
        low, high = (shown(key, end) for end in expected.ci90)
        rows.append([label_of(key), shown(key, value), shown(key, expected.mean), f"{low} to {high}"])
    head = [rollout.gait.name, "nominal robot", f"mean of {over.robots}\nrobots", "90 % of them"]
    print_table(head, rows)
    if rollout.trajectory.status != "ok":
        say(f"nominal robot: {rollout.trajectory.status}")
    if over.failed:
        say(f"{over.failed} of {over.robots} robots of the posterior failed; they are left out.")


def speed_over_robots(row: SweptPoint) -> dict[str, object]:
    """Return what a table shows of a value's robots of a posterior: their speed, where they have one."""
    over = row.over_robots
    if over is None:
        return {}
    speed = over.metrics.get("speed_m_s")
    figures: dict[str, object] = {"posterior": f"{over.robots} robots, {over.failed} failed"}
    if speed is not None:
        low, high = (f"{1e3 * end:.2f}" for end in speed.ci90)
        figures["their speed [mm/s]"] = f"{1e3 * speed.mean:.2f} ({low} to {high})"
    return figures


def print_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print rows of texts under a head of one or more lines; the first column holds names.

    A table that is wider than the terminal is turned, if it fits then: a line for each column, and as many
    rows side by side as there is place for.
    """
    console = plain_console()
    turned = _turned([" ".join(title.split("\n")) for title in head], rows, console.width)
    for titles, lines in [(head, rows)] if _width(head, rows) <= console.width or not turned else turned:
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
        for index, title in enumerate(titles):
            table.add_column(_cell(*title.split("\n")), justify="right" if index else "left")
        for line in lines:
            table.add_row(*map(_cell, line))
        console.print(table)


_Titled = tuple[Sequence[str], Sequence[Sequence[str]]]
"""A table: its head and its rows."""


def _turned(head: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> list[_Titled]:
    """Return a table with its rows as columns, as several tables if need be; none where one is too wide."""
    tables: list[_Titled] = []
    side_by_side: list[Sequence[str]] = []
    for row in rows:
        wider = [*side_by_side, row]
        if side_by_side and _width(*_columns(head, wider)) > width:
            tables.append(_columns(head, side_by_side))
            wider = [row]
        side_by_side = wider
    tables.append(_columns(head, side_by_side))
    return tables if all(_width(*table) <= width for table in tables) else []


def _columns(head: Sequence[str], rows: Sequence[Sequence[str]]) -> _Titled:
    """Return rows as columns; the first cell of each is its title."""
    names, *lines = zip(head, *rows, strict=True)
    return ("", *names[1:]), lines


def _width(head: Sequence[str], rows: Sequence[Sequence[str]]) -> int:
    """Return how wide a table is where no cell is broken: an edge, and three spaces between columns."""
    columns = zip(
        [title.split("\n") for title in head], *([[cell] for cell in row] for row in rows), strict=True
    )
    widest = [max(cell_len(plain(line)) for lines in column for line in lines) for column in columns]
    return sum(widest) + 3 * len(widest) - 1


def _cell(*lines: object) -> Text:
    """Return a cell of a table."""
    return Text("\n".join(map(plain, lines)))


def print_comparison(rows: Sequence[ComparedGait]) -> None:
    """Print what `compare` found: each figure with half of its 90 % interval."""
    head = ["gait", "period\n[s]", "speed\n[mm/s]", "difference\n[mm/s]", "ratio", "more than\nnoise"]
    texts = []
    for index, row in enumerate(rows):
        speed = _plus_minus(1e3 * row.speed_m_s, row.speed_ci90_m_s, 1e3)
        apart = _plus_minus(1e3 * row.difference_m_s, row.difference_ci90_m_s, 1e3, "+.2f")
        ratio = _plus_minus(row.ratio, row.ratio_ci90, 1.0)
        against = [apart, ratio, shown("", row.more_than_noise)] if index else [""] * 3
        texts.append([row.name, shown("period_s", row.period_s), speed, *against])
    print_table(head, texts)
    say("± is half of the 90 % interval; differences and ratios are paired, scenario by scenario.")
    if rows[0].robots:
        say(f"Each scenario has its own robot of the posterior; intervals hold 90 % of the {rows[0].robots}.")


def _plus_minus(value: float | None, ends: Sequence[float] | None, scale: float, form: str = ".2f") -> str:
    if value is None or ends is None:
        return "–"
    return f"{value:{form}}\u00a0±\u00a0{0.5 * scale * (ends[1] - ends[0]):.2f}"


def print_effects(rows: Sequence[EffectRow]) -> None:
    """Print the library of effects, one after another: their figures do not fit side by side."""
    for row in rows:
        if row.applies is not False:
            say(f"{row.name}: {row.meaning}")
            say(f"    {_effect_figures(row)}")
    idle: dict[str, list[str]] = {}
    for row in rows:
        if row.applies is False:
            idle.setdefault(row.why_not or "", []).append(row.name)
    if idle:
        reasons = "; ".join(f"{', '.join(names)} ({why})" for why, names in idle.items())
        say(f"These do not apply: {reasons}")


def _effect_figures(row: EffectRow) -> str:
    unit = f" ({row.unit})" if row.unit else ""
    low, high = row.bounds
    times = f" times {row.bounds_times}" if row.bounds_times else ""
    target = f"; target: {row.target}" if row.target else ""
    neutral = f"{row.neutral:.4g}" if isinstance(row.neutral, float) else row.neutral
    return f"{row.parameter}{unit}: neutral {neutral}, plausible {low:.3g} to {high:.3g}{times}{target}"


def print_runs(runs: Sequence[ListedRun]) -> None:
    """Print run folders, the latest last."""
    if not runs:
        say("no runs here or in results/runs; gaitopt runs DIR looks elsewhere")
        return
    rows = []
    for run in runs:
        best = None if run.summary is None else run.summary.best
        speed = "-" if best is None or not isfinite(best.speed_m_s) else f"{1e3 * best.speed_m_s:.1f}"
        rows.append([str(run.folder), run.problem, speed, f"{run.changed:%Y-%m-%d %H:%M}", run.state])
    print_table(["run", "problem", "speed [mm/s]", "date", "state"], rows)
    for run in runs:
        if run.note:
            say(f"{run.folder}: {run.note}")
