"""Tables and sentences on standard output, in which names from files are only names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
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
    """Print rows as a table: a column each where they fit, else a line per key."""
    keys = [key for key in rows[0] if not key.startswith("scenario_")]
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    if len(keys) <= 8:
        for key in keys:
            table.add_column(_cell(label_of(key)), justify="left" if key == "name" else "right")
        for row in rows:
            table.add_row(*(_cell(shown(key, row[key])) for key in keys))
    else:
        table.add_column("")
        for row in rows:
            table.add_column(_cell(row["name"]), justify="right")
        for key in keys:
            if key != "name":
                table.add_row(_cell(label_of(key)), *(_cell(shown(key, row[key])) for row in rows))
    plain_console().print(table)


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
    """Print rows of texts under a head of one or more lines; the first column holds names."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for index, title in enumerate(head):
        table.add_column(_cell(*title.split("\n")), justify="right" if index else "left")
    for row in rows:
        table.add_row(*map(_cell, row))
    plain_console().print(table)


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
