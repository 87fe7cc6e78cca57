"""The index page of runs: all of them in a table, and the searches of each robot side by side."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from urllib.parse import quote

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import rankdata

from gaitopt.core.errors import GaitoptError
from gaitopt.core.statistics import explained_by_groups
from gaitopt.problem.problem import load_problem
from gaitopt.report.drawing import drawing
from gaitopt.report.figures import runs as run_figures
from gaitopt.report.page import Page, Section, Table
from gaitopt.report.words import interval_text
from gaitopt.runs.evaluations import read_evaluations
from gaitopt.runs.folder import JOURNAL_FILE
from gaitopt.runs.listing import ListedRun

_MOST_CURVES = 7
"""Most searches in a figure: as many as there are colours."""

_FEWEST_GAITS = 40
"""Fewest gaits of a search for the importance of its parameters."""

_GROUPS = 8
"""Groups of equal numbers of gaits, from the smallest to the largest value of a parameter."""


@dataclass(frozen=True)
class _Searched:
    """A finished search as figures need it.

    Attributes:
        run: the run.
        names: the coordinates of its gaits.
        best: its best gait, as a point of the unit box, shape (d,).
        shares: how much of the ranking of its gaits each coordinate explains, shape (d,); None for too few
            gaits.
    """

    run: ListedRun
    names: tuple[str, ...]
    best: NDArray[np.float64]
    shares: NDArray[np.float64] | None


def index_page(runs: Sequence[ListedRun], place: Path) -> str:
    """Return the page of some runs.

    Args:
        runs: the runs.
        place: the folder that the page will be in; links lead from there to the pages of the runs.
    """
    fastest_first = sorted(runs, key=lambda run: -_speed(run))
    finished = [run for run in fastest_first if run.summary is not None]
    searched, notes = _searched(finished)
    groups: dict[tuple[str, tuple[str, ...]], list[_Searched]] = {}
    for one in searched:
        groups.setdefault((one.run.problem, one.names), []).append(one)
    return Page(
        title="Runs",
        answer=_answer(finished, len(runs)),
        asked={"Runs": f"{len(runs)}, of which {len(finished)} are finished searches"},
        notes=notes,
        sections=[
            Section("All runs", table=_table(fastest_first, place)),
            *(part for number, group in enumerate(groups.values()) for part in _figures(number, group)),
        ],
        has_figures=False,
    ).html()


def _speed(run: ListedRun) -> float:
    return -np.inf if run.summary is None else float(np.nan_to_num(run.summary.best.speed_m_s, nan=-np.inf))


def _answer(finished: Sequence[ListedRun], count: int) -> str:
    if not finished:
        return f"{count} runs, none of which is a finished search."
    problems = {run.problem: run for run in reversed(finished)}
    texts = [f"{run.problem}: {1e3 * _speed(run):.1f} mm/s ({run.folder})" for run in problems.values()]
    return f"The fastest gait found of each robot: {'; '.join(reversed(texts))}."


def _table(runs: Sequence[ListedRun], place: Path) -> Table:
    return Table(
        head=[
            "run",
            "command",
            "problem",
            "speed [mm/s]",
            "90 % interval",
            "limits",
            "gaits",
            "seed",
            "date",
            "state",
        ],
        rows=[
            [str(run.folder), run.kind, run.problem, *figures_of(run), date_of(run), run.state]
            for run in runs
        ],
        note="Speeds are those of each run: means over its scenarios at its reference fidelity.",
        words=(1, 2, 5, 8, 9),
        links=[_link(run.page, place) for run in runs],
    )


def figures_of(run: ListedRun) -> list[str]:
    """Return a run's speed, its interval, whether limits are kept, its gaits and its seed, as texts."""
    if run.summary is None:
        return ["–"] * 5
    best = run.summary.best
    kept = "kept" if best.constraints_met else "broken"
    speed = f"{1e3 * best.speed_m_s:.1f}" if np.isfinite(best.speed_m_s) else "–"
    interval = interval_text(best.speed_ci90_m_s, ".1f")
    return [speed, interval, kept, str(run.summary.evaluations), str(run.summary.seed)]


def date_of(run: ListedRun) -> str:
    """Return when a run's last result was written, to the minute."""
    return f"{run.changed:%Y-%m-%d %H:%M}"


def _link(page: Path | None, place: Path) -> str:
    return "" if page is None else quote(os.path.relpath(page.resolve(), place.resolve()))


def _searched(finished: Sequence[ListedRun]) -> tuple[list[_Searched], list[str]]:
    """Return the searches whose gaits can be read, and notes about the others."""
    searched, notes = [], []
    for run in finished:
        try:
            problem = load_problem(run.folder)
            names = tuple(variable.name for variable in problem.space.variables)
            best = problem.space.encode(problem.find_gait(str(run.folder), in_range=False))
            searched.append(_Searched(run, names, best, _shares(run.folder, names)))
        except GaitoptError as error:
            notes.append(f"{run.folder}: not in the figures: {error}")
    return searched, notes


def _shares(folder: Path, names: Sequence[str]) -> NDArray[np.float64] | None:
    """Return how much of the ranking of a search's gaits each coordinate explains; None for too few gaits."""
    if not (folder / JOURNAL_FILE).exists():  # committed records leave it out
        return None
    done = read_evaluations(folder)
    if done.working.sum() < _FEWEST_GAITS:
        return None
    if missing := set(names) - set(done.points):
        raise GaitoptError(f"{folder}: no coordinate {min(missing)} in its journal")
    ranks = rankdata(done.cost[done.working])
    return np.array([explained_by_groups(done.points[name][done.working], ranks, _GROUPS) for name in names])


def _figures(number: int, group: Sequence[_Searched]) -> list[Section]:
    """Return the figures of the searches of one robot."""
    shown, names = group[:_MOST_CURVES], group[0].names
    problem = group[0].run.problem
    left_out = f" The {_MOST_CURVES} fastest of {len(group)} runs." if len(group) > _MOST_CURVES else ""
    points = {str(one.run.folder): one.best for one in shown}
    sections = [
        _section(
            f"gaits-{number}",
            f"{problem}: the best gaits side by side",
            partial(run_figures.best_gaits, names, points),
            "Each line is the best gait of a run, from its period to its last parameter. Where lines are "
            f"close together, the searches agree.{left_out}",
        )
    ]
    shares = {str(one.run.folder): one.shares for one in shown if one.shares is not None}
    if shares:
        sections.append(
            _section(
                f"importance-{number}",
                f"{problem}: what mattered",
                partial(run_figures.importance, names, shares),
                "How much of the ranking of all gaits at the working fidelity each parameter explains by "
                "itself. A search looks where gaits are good: a parameter that it settled early shows less."
                f"{left_out}",
            )
        )
    return sections


def _section(name: str, title: str, draw: Callable[[], Figure], caption: str) -> Section:
    return Section(title, drawing=drawing(name, draw(), draw), caption=caption)
