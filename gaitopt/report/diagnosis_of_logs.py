"""The part of a diagnosis' page that is about logged commands."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from gaitopt.core.quantities import figure
from gaitopt.diagnose.correction import Correction
from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.record.defect import counted
from gaitopt.diagnose.trial_gap import TrialGap
from gaitopt.diagnose.words import has_log
from gaitopt.report.figures import logs as plots
from gaitopt.report.figures.logs import Repeats
from gaitopt.report.page import Picture, Section, folded, save_figures

_OPEN = 3
"""Logs whose figures are open; those of the others open on request."""

_DETAILED = 24
"""Logs that have a figure of their own, at most: those with the largest gap, in floors."""


def gaits_of(diagnosis: Diagnosis) -> list[TrialGap]:
    """Return the trials of gaits."""
    return [trial for trial in diagnosis.trials if not has_log(trial)]


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
        if has_log(trial):
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
    with_it = f" and with {best.label} (orange)" if best and correction and correction.trials else ""
    pictures = {}
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


def _numbered(name: str, number: int) -> str:
    return name if number == 0 else f"{name}-{number + 1}"
