"""The part of a diagnosis' page that is about logged commands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from gaitopt.core.quantities import figure
from gaitopt.diagnose.correction import Correction
from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.judge.gap import Gap
from gaitopt.diagnose.record.defect import counted
from gaitopt.diagnose.trial_gap import TrialGap
from gaitopt.report.figures import logs as plots
from gaitopt.report.figures.logs import Repeats
from gaitopt.report.page import Picture, Section, Table, folded, save_figures

_OPEN = 3
"""Logs whose figures are open; those of the others open on request."""

_DETAILED = 24
"""Logs that have a figure of their own, at most: those with the largest gap, in floors."""


def gaits_of(diagnosis: Diagnosis) -> list[TrialGap]:
    """Return the trials of gaits."""
    return [trial for trial in diagnosis.trials if not trial.has_log]


def logs_text(diagnosis: Diagnosis) -> list[str]:
    """Return how many logs there are, and how long their recordings are; nothing where there are none."""
    logs = repeats_of(diagnosis)
    spans = [float(gap.aligned.time[-1] - gap.aligned.time[0]) for one in logs for gap in one.trials]
    if not spans:
        return []
    longest = "" if len(spans) == 1 else f" to {figure(max(spans))}"
    whole, recorded = counted(len(logs), "log"), counted(len(spans), "recording")
    return [f"{recorded} of {whole} of commands ({figure(min(spans))}{longest} s)"]


def repeats_of(diagnosis: Diagnosis, correction: Correction | None = None) -> list[Repeats]:
    """Return the trials of each log of commands, in the data set's order.

    Args:
        diagnosis: the diagnosis.
        correction: the corrected robot beside the same trials.
    """
    found: dict[str, list[tuple[TrialGap, Aligned | None]]] = {}
    after = correction.trials if correction and correction.trials else [None] * len(diagnosis.trials)
    for trial, beside in zip(diagnosis.trials, after, strict=True):
        if trial.has_log:
            found.setdefault(trial.aligned.trial.drive.key, []).append((trial, beside))
    return [
        Repeats([trial for trial, _ in rows], [beside for _, beside in rows if beside is not None])
        for rows in found.values()
    ]


def log_sections(folder: Path, diagnosis: Diagnosis, correction: Correction | None) -> list[Section]:
    """Write the figures of logged commands, and return their sections; none where none were logged.

    Args:
        folder: the run folder.
        diagnosis: the diagnosis.
        correction: the corrected robot beside the same trials.
    """
    logs = repeats_of(diagnosis, correction)
    if not logs:
        return []
    signals = list(dict.fromkeys(name for repeats in logs for name in repeats.signals))
    best = diagnosis.found.best if diagnosis.found else None
    with_it = " and corrected (orange)" if best and correction and correction.trials else ""
    pictures = {}
    rows = _held_out(diagnosis, logs)
    if rows:
        pictures["corrected-angles"] = Picture(
            "The gap of the angles before and after",
            partial(plots.held_out, rows),
            "RMS error of the angles under each log, the mean of its repeats: for the nominal robot, and for "
            "one with the most probable effects that was fitted without this log. The floor is the error "
            "that a right model leaves.",
        )
    for number, signal in enumerate(signals if len(logs) > 1 else []):
        pictures[_numbered("logs", number)] = Picture(
            f"Commanded, measured and simulated: {signal}",
            partial(plots.overview, logs, signal),
            f"Under each log of commands: measured (dots, repeats over one another) and simulated, nominal "
            f"(dashed){with_it}. Grey: the command.",
        )
    pictures["components-of-logs"] = Picture(
        "What the gap is made of",
        partial(plots.components, logs),
        "The gap under each log of commands in multiples of its floor, the mean of its repeats, and its "
        "components. A bar that ends left of the dashed line is no gap.",
    )
    sections = save_figures(folder, pictures)
    order = sorted(range(len(logs)), key=lambda number: -logs[number].worst)
    said = (
        f"Above: the command (grey), measured (dots) and simulated, nominal (dashed){with_it}. Below: what "
        "is left of the measured motion. A right model stays within the floor (shaded) most of the time."
        + (" What the nominal one leaves may be outside of the panel." if with_it else "")
    )
    details = {
        _numbered("log", place): Picture(
            f"Log {logs[number].name}",
            partial(plots.responses, logs[number]),
            said if place == 0 else f"The same of log {logs[number].name}.",
        )
        for place, number in enumerate(order[:_DETAILED])
    }
    drawn = save_figures(folder, details)
    return [*sections, *drawn[:_OPEN], *map(folded, drawn[_OPEN:])]


def shrinkage(diagnosis: Diagnosis) -> Table | None:
    """Return the gap of the angles before and after, log by log; None where nothing was fitted to them."""
    rows, whole = _held_out(diagnosis, repeats_of(diagnosis)), diagnosis.gap_angles
    if not rows or whole is None:
        return None
    low, high = whole.ci90
    known = math.isfinite(low) and math.isfinite(high)
    interval = f" ({low:.0%} to {high:.0%})" if known else ""
    return Table(
        head=["log", "before, °", "after, °", "floor, °", "gap removed (90 %)"],
        rows=[
            *(_shrinkage_row(name, gap) for name, gap in rows),
            _shrinkage_row("all recordings", whole, interval),
        ],
        note="RMS error of the angles with the most probable effects, fitted without the log of the row. Gap "
        "removed: share of what is above the floor. A dash: nothing is above the floor.",
    )


def _shrinkage_row(name: str, gap: Gap, interval: str = "") -> list[str]:
    degrees = [figure(math.degrees(value)) for value in (gap.before, gap.after, gap.floor)]
    return [name, *degrees, "–" if gap.shrinkage is None else f"{gap.shrinkage:.0%}{interval}"]


def _held_out(diagnosis: Diagnosis, logs: Sequence[Repeats]) -> list[tuple[str, Gap]]:
    """Return the gap of the angles under each log, held out, as the mean of its repeats; rad."""
    known = {row.trial: row.gap for row in diagnosis.gap_angles_by_trial}
    rows = []
    for repeats in logs:
        gaps = [known[trial.name] for trial in repeats.trials if trial.name in known]
        if gaps:
            before, after, floor = (
                math.sqrt(sum(value**2 for value in values) / len(gaps))
                for values in zip(*((gap.before, gap.after, gap.floor) for gap in gaps), strict=True)
            )
            rows.append((repeats.short_name, Gap(before, after, floor, (math.nan, math.nan))))
    return rows


def _numbered(name: str, number: int) -> str:
    return name if number == 0 else f"{name}-{number + 1}"
