"""Progress on standard error while a job runs: a bar on a terminal, lines elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as Bar

from gaitopt.cli.display import plain_console
from gaitopt.cli.lines import say_aside
from gaitopt.core.progress import OnProgress, Progress, silent
from gaitopt.core.text import plain
from gaitopt.optimise.recorder import OnSearchProgress, SearchProgress

_PLAIN_EVERY_S = 10.0
"""Seconds between lines where there is no terminal."""


def show_checks(step: Progress) -> None:
    """Print which check begins."""
    say_aside(f"checking {step.stage} …")


@contextmanager
def search_display(quiet: bool) -> Iterator[OnSearchProgress]:
    """Yield the function that a search calls with its progress."""
    console = plain_console(stderr=True)
    if quiet:
        yield silent
    elif console.is_terminal:
        columns = (
            _words("{task.fields[method]}"),
            BarColumn(),
            MofNCompleteColumn(),
            _words("best {task.fields[best]}"),
            _words("{task.fields[simulated]:.0f} s simulated"),
            TimeRemainingColumn(),
        )
        with Bar(*columns, console=console) as bar:
            task = bar.add_task("search", total=None, method="baselines", best="-", simulated=0.0)

            def show(progress: SearchProgress) -> None:
                done = progress.done >= progress.total
                bar.update(
                    task,
                    completed=progress.done,
                    total=progress.total,
                    method="verification" if done else plain(progress.stage),
                    best=_best(progress),
                    simulated=progress.simulated_s,
                )

            yield show
    else:
        yield _plain_lines()


def _plain_lines() -> OnSearchProgress:
    began = time.monotonic()
    last, resumed = began - _PLAIN_EVERY_S, -1

    def show(progress: SearchProgress) -> None:
        nonlocal last, resumed
        now = time.monotonic()
        resumed = progress.done if resumed < 0 else resumed
        if now - last >= _PLAIN_EVERY_S or progress.done >= progress.total:
            last = now
            say_aside(
                f"{progress.done}/{progress.total} gaits, {progress.stage}, best {_best(progress)}, "
                f"{progress.simulated_s:.0f} s simulated{_time_left(progress, resumed, now - began)}"
            )

    return show


def _time_left(progress: SearchProgress, resumed: int, spent_s: float) -> str:
    """Return how long the rest of the search takes at the pace so far, in words; else nothing."""
    done, left = progress.done - resumed, progress.total - progress.done
    return f", about {spent_s * left / done:.0f} s left" if done > 0 and left > 0 else ""


def _best(progress: SearchProgress) -> str:
    if progress.best is None:
        return "-"
    return f"{1e3 * progress.best.evaluation.metrics['speed_m_s']:.1f} mm/s"


def _words(text: str) -> TextColumn:
    """Return a column of words, in which no markup is read."""
    return TextColumn(text, markup=False)


def steps_display(quiet: bool) -> AbstractContextManager[OnProgress]:
    """Yield the function that a diagnosis calls with its progress, the number of simulated robots."""
    return _display(quiet, "robots", TimeElapsedColumn(), _stage_lines)


def frames_display(quiet: bool) -> AbstractContextManager[OnProgress]:
    """Yield the function that the tracking of films calls with its progress, the number of pictures."""
    return _display(quiet, "frames", TimeRemainingColumn(), _film_lines)


@contextmanager
def _display(
    quiet: bool, unit: str, clock: ProgressColumn, lines: Callable[[], OnProgress]
) -> Iterator[OnProgress]:
    """Yield the function that a job calls with its progress.

    Args:
        quiet: whether nothing is printed.
        unit: what is counted, in words.
        clock: the last column of the bar on a terminal.
        lines: makes what prints lines where there is no terminal.
    """
    console = plain_console(stderr=True)
    if quiet:
        yield silent
    elif console.is_terminal:
        columns = (_words("{task.description}"), BarColumn(), MofNCompleteColumn(), _words(unit))
        with Bar(*columns, clock, console=console) as bar:
            task = bar.add_task("", total=None)
            yield lambda step: bar.update(
                task, description=plain(step.stage), completed=step.done, total=step.total
            )
    else:
        yield lines()


def _stage_lines() -> OnProgress:
    said: set[str] = set()

    def show(step: Progress) -> None:
        if step.stage not in said:
            said.add(step.stage)
            say_aside(f"{step.stage} …")

    return show


def _film_lines() -> OnProgress:
    began = last = time.monotonic()
    stage = ""

    def show(step: Progress) -> None:
        nonlocal began, last, stage
        now = time.monotonic()
        if step.stage != stage:
            stage, began = step.stage, now
        if now - last >= _PLAIN_EVERY_S and step.total:
            last = now
            left = (now - began) * (step.total - step.done) / max(step.done, 1)
            say_aside(f"{step.stage}: {step.done}/{step.total} {step.unit}, about {left:.0f} s left")

    return show
