"""What a person sees in the terminal: progress on standard error, tables on standard output."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bar
from rich.table import Table

from gaitopt.effects.rows import EffectRow
from gaitopt.optimise.compare import ComparedGait
from gaitopt.optimise.study import Progress
from gaitopt.simulation.labels import label_of, shown

_PLAIN_EVERY_S = 10.0


@contextmanager
def progress_display(budget: int, quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """Yield what a search calls as it goes: a bar on a terminal, a line now and then elsewhere."""
    console = Console(stderr=True)
    if quiet:
        yield lambda progress: None
    elif console.is_terminal:
        columns = (
            TextColumn("{task.fields[method]}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("best {task.fields[best]}"),
            TextColumn("{task.fields[simulated]:.0f} s simulated"),
            TimeRemainingColumn(),
        )
        with Bar(*columns, console=console) as bar:
            task = bar.add_task("search", total=budget, method="baselines", best="-", simulated=0.0)

            def show(progress: Progress) -> None:
                done = progress.done >= progress.budget
                bar.update(
                    task,
                    completed=progress.done,
                    method="verification" if done else progress.method,
                    best=_best(progress),
                    simulated=progress.simulated_s,
                )

            yield show
    else:
        yield _plain_lines(console)


def _plain_lines(console: Console) -> Callable[[Progress], None]:
    began = time.monotonic()
    last, resumed = began - _PLAIN_EVERY_S, -1

    def show(progress: Progress) -> None:
        nonlocal last, resumed
        now = time.monotonic()
        resumed = progress.done if resumed < 0 else resumed
        if now - last >= _PLAIN_EVERY_S or progress.done >= progress.budget:
            last = now
            console.print(
                f"{progress.done}/{progress.budget} gaits, {progress.method}, best {_best(progress)}, "
                f"{progress.simulated_s:.0f} s simulated{_time_left(progress, resumed, now - began)}",
                highlight=False,
            )

    return show


def _time_left(progress: Progress, resumed: int, spent_s: float) -> str:
    """Return how long the rest of the search takes at the pace so far, in words; nothing at its ends."""
    done, left = progress.done - resumed, progress.budget - progress.done
    return f", about {spent_s * left / done:.0f} s left" if done > 0 and left > 0 else ""


def _best(progress: Progress) -> str:
    if progress.best is None:
        return "-"
    return f"{1e3 * progress.best.evaluation.metrics['speed_m_s']:.1f} mm/s"


def note(text: str) -> None:
    """Say on standard error what is being worked on."""
    print(f"checking {text} …", file=sys.stderr)


@contextmanager
def steps_display(quiet: bool) -> Iterator[Callable[[str, int, int], None]]:
    """Yield what a diagnosis calls as it goes: a bar on a terminal, a line a step elsewhere.

    It is called with what is being done, how many robots have been simulated for it and how many may be at
    most; 0 where that is not known.
    """
    console = Console(stderr=True)
    if quiet:
        yield lambda what, done, most: None
    elif console.is_terminal:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("robots"))
        with Bar(*columns, TimeElapsedColumn(), console=console) as bar:
            task = bar.add_task("", total=None)
            yield lambda what, done, most: bar.update(
                task, description=what, completed=done, total=most or None
            )
    else:
        said: set[str] = set()

        def show(what: str, done: int, most: int) -> None:
            if what not in said:
                said.add(what)
                console.print(f"{what} …", highlight=False)

        yield show


def print_rows(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print rows as a table: a column each where they fit, else a line per key."""
    keys = [key for key in rows[0] if not key.startswith("scenario_")]
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    if len(keys) <= 8:
        for key in keys:
            table.add_column(escape(label_of(key)), justify="left" if key == "name" else "right")
        for row in rows:
            table.add_row(*(shown(key, row[key]) for key in keys))
    else:
        table.add_column("")
        for row in rows:
            table.add_column(str(row["name"]), justify="right")
        for key in keys:
            if key != "name":
                table.add_row(escape(label_of(key)), *(shown(key, row[key]) for row in rows))
    Console().print(table)


def print_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print rows of texts under a head; the first column holds names."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for index, title in enumerate(head):
        table.add_column(escape(title), justify="right" if index else "left")
    for row in rows:
        table.add_row(*row)
    Console().print(table)


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
    print("± is half of the 90 % interval; differences and ratios are paired, scenario by scenario.")


def _plus_minus(value: float | None, ends: Sequence[float] | None, scale: float, form: str = ".2f") -> str:
    if value is None or ends is None:
        return "–"
    return f"{value:{form}}\u00a0±\u00a0{0.5 * scale * (ends[1] - ends[0]):.2f}"


def print_effects(rows: Sequence[EffectRow]) -> None:
    """Print the library of effects, one after another: their figures do not fit side by side."""
    for row in rows:
        print(f"{row.name}: {row.meaning}")
        print(f"    {_effect_figures(row)}")


def _effect_figures(row: EffectRow) -> str:
    if row.applies is False:
        return f"does not apply: {row.why_not}"
    unit = f" ({row.unit})" if row.unit else ""
    low, high = row.bounds
    times = f" times {row.bounds_times}" if row.bounds_times else ""
    target = f"; target: {row.target}" if row.target else ""
    neutral = f"{row.neutral:.4g}" if isinstance(row.neutral, float) else row.neutral
    return f"{row.parameter}{unit}: neutral {neutral}, plausible {low:.3g} to {high:.3g}{times}{target}"
