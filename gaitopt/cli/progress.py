"""Progress on standard error while a job runs: a bar on a terminal, lines elsewhere."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    TextColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as Bar

from gaitopt.cli.display import plain_console
from gaitopt.cli.lines import say_aside
from gaitopt.core.progress import OnProgress, Progress, silent
from gaitopt.core.text import plain
from gaitopt.optimise.journal import Entry
from gaitopt.optimise.recorder import SearchProgress

_PLAIN_EVERY_S = 10.0
"""Seconds between lines where there is no terminal."""


def show_checks(step: Progress) -> None:
    """Print which check begins."""
    say_aside(f"checking {step.stage} …")


@contextmanager
def display(quiet: bool) -> Iterator[OnProgress]:
    """Yield the function that a job calls with its progress: it shows a bar on a terminal, or lines.

    Each stage has its number, what is done of all that there is to do, and the time left at its pace so far.
    """
    console = plain_console(stderr=True)
    if quiet:
        yield silent
    elif console.is_terminal:
        columns = (
            _words("{task.fields[stage]}"),
            BarColumn(),
            MofNCompleteColumn(),
            _words("{task.fields[unit]}"),
            TimeRemainingColumn(),
        )
        with Bar(*columns, console=console) as bar:
            yield _bar(bar)
    else:
        yield _lines()


def _bar(bar: Bar) -> OnProgress:
    task, shown = bar.add_task("", total=None, stage="", unit=""), ""

    def show(step: Progress) -> None:
        nonlocal shown
        if step.stage != shown:
            shown = step.stage
            bar.reset(task)
        unit = ", ".join(filter(None, (step.unit, _more(step))))
        bar.update(task, completed=step.done, total=step.total, stage=_heading(step), unit=plain(unit))

    return show


def _lines() -> OnProgress:
    began = last = time.monotonic()
    stage, resumed = "", 0

    def show(step: Progress) -> None:
        nonlocal began, last, stage, resumed
        now = time.monotonic()
        if step.stage != stage:
            stage, began, resumed = step.stage, now, step.done
            say_aside(f"{_heading(step)} …")
        ended = step.total is not None and step.done >= step.total
        if step.done and (now - last >= _PLAIN_EVERY_S or (ended and _more(step))):
            last = now
            counted = f"{step.done}{'' if step.total is None else f'/{step.total}'} {step.unit}"
            left = _time_left(step, resumed, now - began)
            say_aside(", ".join(filter(None, (f"{step.stage}: {counted}", _more(step)))) + left)

    return show


def _heading(step: Progress) -> str:
    """Return the name of a stage, with its number where stages are counted."""
    return plain(f"{step.number}/{step.stages} {step.stage}" if step.number else step.stage)


def _time_left(step: Progress, resumed: int, spent_s: float) -> str:
    """Return how long the rest of a stage takes at the pace so far, in words; else nothing."""
    done, left = step.done - resumed, (step.total or 0) - step.done
    return f", about {spent_s * left / done:.0f} s left" if done > 0 and left > 0 else ""


def _more(step: Progress) -> str:
    """Return what a search has found so far; nothing of other stages."""
    if not isinstance(step, SearchProgress):
        return ""
    best = f"best {_speed(step.best)}"
    if step.best_lower is not None:
        best += f" ({_speed(step.best_lower)} at a lower fidelity)"
    return f"{step.method}, {best}, {step.simulated_s:.0f} s simulated"


def _speed(entry: Entry | None) -> str:
    return "-" if entry is None else f"{1e3 * entry.evaluation.metrics['speed_m_s']:.1f} mm/s"


def _words(text: str) -> TextColumn:
    """Return a column of words, in which no markup is read."""
    return TextColumn(text, markup=False)
