"""The page of a diagnosis: which effect, before and after, where the gap lies, and what to measure next."""

from __future__ import annotations

import math
import shlex
from functools import partial
from pathlib import Path

from gaitopt.core.quantities import figure
from gaitopt.diagnose.correction import Correction
from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.judge.command_experiment import CommandExperiment
from gaitopt.diagnose.next_words import what_it_tells
from gaitopt.diagnose.shown_gap import shown_gap
from gaitopt.diagnose.trial_gap import TrialGap
from gaitopt.diagnose.words import answer, explanation, how_far
from gaitopt.effects import EFFECTS
from gaitopt.problem.problem import Problem
from gaitopt.report import diagnosis_tables as tables
from gaitopt.report.diagnosis_motion import motion_parts
from gaitopt.report.diagnosis_of_logs import gaits_of, log_sections, logs_text
from gaitopt.report.diagnosis_of_logs import shrinkage as shrinkage_of_logs
from gaitopt.report.figures import diagnosis as diagnosis_plots
from gaitopt.report.figures import gait as gait_plots
from gaitopt.report.next_commands import next_commands_sections
from gaitopt.report.page import Page, Picture, Section, Table, folded, save_figures
from gaitopt.report.tables import gait_table
from gaitopt.report.words import robot_text
from gaitopt.runs.diagnosis_folder import CORRECTED_FILE
from gaitopt.runs.folder import PAGE_FILE, write_into

_VERDICTS = {
    "no_gap": "no gap",
    "explained": "explained",
    "ambiguous": "ambiguous",
    "partly_explained": "partly explained",
    "unexplained": "unexplained",
}


def write_page(
    folder: Path,
    problem: Problem,
    diagnosis: Diagnosis,
    correction: Correction | None = None,
    full: bool = False,
) -> None:
    """Write ``report.html`` and ``figures/`` of a diagnosis.

    Args:
        folder: its run folder.
        problem: the nominal problem.
        diagnosis: the diagnosis.
        correction: the robot with the most probable explanation, blamed or not; None without one.
        full: add the part that takes longer: a film of the robot with the measured marker.
    """
    motion = motion_parts(folder, problem, diagnosis, correction, full)
    page = Page(
        title=f"{problem.name}: measured against simulated",
        answer=answer(diagnosis),
        asked=_asked(problem, diagnosis),
        tiles=_tiles(diagnosis),
        notes=motion.notes,
        sections=[
            *_with_table(_title_of_effects(diagnosis), tables.effects(diagnosis)),
            *_with_table("How far the gap shrinks", tables.shrinkage(diagnosis)),
            *_with_table("How far the gap of the angles shrinks", shrinkage_of_logs(diagnosis)),
            *save_figures(folder, _cause_pictures(diagnosis)),
            *motion.sections,
            *save_figures(folder, dict(motion.pictures)),
            *save_figures(folder, _trial_pictures(diagnosis, correction)),
            *save_figures(folder, _gap_pictures(diagnosis)),
            *log_sections(folder, diagnosis, correction),
            *_with_table("Largest parts of the gap", tables.largest_parts(diagnosis)),
            *_expected(diagnosis),
            *_corrected(folder, diagnosis),
            *_with_table("Gaits on the corrected robot", tables.walked(correction)),
            *_next_sections(folder, diagnosis),
            folded(Section("Trial by trial, in words", sentences=explanation(diagnosis))),
            *map(folded, _with_table("Each signal", tables.signals(diagnosis))),
            *map(folded, _with_table("Each signal of logged commands", tables.signals_of_logs(diagnosis))),
            folded(Section("The floor", table=tables.floors(diagnosis))),
            *_tried(diagnosis),
        ],
    )
    write_into(folder, PAGE_FILE, page.html())


def _with_table(title: str, table: Table | None) -> list[Section]:
    """Return a section with a table; none where there is no table."""
    return [] if table is None else [Section(title, table=table)]


def _title_of_effects(diagnosis: Diagnosis) -> str:
    return "Best candidates" if diagnosis.verdict in ("unexplained", "no_gap") else "Which effect"


def _tried(diagnosis: Diagnosis) -> list[Section]:
    """Return which effects were tried and which were not."""
    tried = diagnosis.tried
    if not tried:
        return []
    others = [name for name in EFFECTS if name not in tried]
    told = [
        f"{len(tried)} of {len(EFFECTS)} effects of the library were tried: {', '.join(tried)}.",
        f"Not tried: {', '.join(others)}. They do not apply to this robot or to these recordings, they are "
        "found in the recording itself, or they were not asked for. A cause among them cannot be found."
        if others
        else "",
    ]
    return [folded(Section("Effects that were tried", sentences=list(filter(None, told))))]


def _corrected(folder: Path, diagnosis: Diagnosis) -> list[Section]:
    """Return what to do with the corrected robot, where there is one."""
    if diagnosis.correction is None:
        return []
    run, robot = (shlex.quote(str(path)) for path in (folder, folder / CORRECTED_FILE))
    return [
        Section(
            "The corrected robot",
            sentences=[
                f"{CORRECTED_FILE} in this folder is the problem with this correction. {how_far(diagnosis)}",
                "The second command searches for a gait that is good on all robots that these trials allow.",
            ],
            commands=[
                f"gaitopt optimise {robot}",
                f"gaitopt optimise {run} --posterior {run}",
            ],
        )
    ]


def _expected(diagnosis: Diagnosis) -> list[Section]:
    """Return what to expect of gaits; folded where logs have a row for each signal."""
    sections = _with_table("What to expect", tables.predictions(diagnosis))
    return list(map(folded, sections)) if diagnosis.has_logs else sections


def _asked(problem: Problem, diagnosis: Diagnosis) -> dict[str, str]:
    return {
        "Robot": robot_text(problem),
        "Data set": diagnosis.source,
        "Trials": ", ".join([*map(_trial, gaits_of(diagnosis)), *logs_text(diagnosis)]),
        **({"Effects tried": f"{len(diagnosis.tried)} of {len(EFFECTS)}"} if diagnosis.tried else {}),
        "Simulated": f"at {figure(diagnosis.fidelity.timestep_s)} s, {diagnosis.fidelity.integrator}, "
        f"seed {diagnosis.seed}",
    }


def _first_name(diagnosis: Diagnosis) -> str:
    """Return what the first candidate is called: it is a cause only where it explains something."""
    return "best candidate" if diagnosis.verdict in ("unexplained", "no_gap") else "winner"


def _trial(gap: TrialGap) -> str:
    gait, time = gap.aligned.trial.drive.name, gap.aligned.time
    of = "" if gait == gap.name else f"{gait}, "
    return f"{gap.name} ({of}{figure(float(time[-1] - time[0]))} s)"


def _tiles(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    found, verdict, shown = diagnosis.found, diagnosis.verdict, shown_gap(diagnosis)
    causes = " and ".join(diagnosis.causes) or "no cause found"
    scale, unit = (math.degrees(1.0), "°") if shown.in_rad else (1e3, " mm")
    values = (shown.gap.before, shown.gap.after, shown.gap.floor)
    before, after, floor = (figure(scale * value) for value in values)
    within = "within the floor" if diagnosis.within_floor else "within small errors of the robot"
    tiles = [(_VERDICTS[verdict], causes if verdict != "no_gap" else within)]
    if found and found.effects and verdict != "no_gap":
        first = found.effects[0]
        best = "the best candidate, " if not diagnosis.causes else ""
        tiles.append((tables.probability(first.probability), f"probability of {best}{first.name}"))
        tiles.append((f"{before} → {after}{unit}", f"gap on held-out data; floor {floor}{unit}"))
        tiles.append((tables.probability(found.other_probability), "probability of something else"))
    else:
        tiles.append((f"{before}{unit}", f"gap of {shown.of}; floor {floor}{unit}"))
    return tiles


# --- figures ------------------------------------------------------------------------------------


def _cause_pictures(diagnosis: Diagnosis) -> dict[str, Picture]:
    found = diagnosis.found
    if found is None or found.best is None:
        return {}
    pictures = {
        "ranking": Picture(
            "Ranking of the effects",
            partial(diagnosis_plots.ranking, found),
            "The error that each fitted effect leaves on trials that its fit did not see. Further left is "
            "better; a right model leaves 1. Lines: 90 % interval of the difference from the first effect. "
            "Where the line of another effect reaches the first dot, these trials cannot tell the two apart.",
        ),
    }
    if found.best.alone is not None:
        pictures["profile"] = Picture(
            f"Profile of the {_first_name(diagnosis)}'s parameter",
            partial(diagnosis_plots.profile, found, found.best.alone),
            "The error for each value of its parameter, with all else fitted. In a sharp valley the "
            "data determine the parameter well; in a flat one they hardly do. Shaded: its 90 % interval.",
        )
    if len(found.trial_set.sample_trials):
        pictures["corrected"] = Picture(
            "The gap before and after",
            partial(diagnosis_plots.held_out, diagnosis, found),
            "RMS error of the marker in each trial, on data that the fit did not see: for the nominal robot, "
            "and with the most probable effect. The floor is the measurement uncertainty: the error that "
            "noise, start pose and timestep leave even for a right model.",
        )
    return pictures


def _trial_pictures(diagnosis: Diagnosis, correction: Correction | None) -> dict[str, Picture]:
    best = diagnosis.correction_or_best
    pictures: dict[str, Picture] = {}
    for index, trial in enumerate(diagnosis.trials):
        if trial.has_log:
            continue
        beside = correction.trials[index] if correction and correction.trials else None
        name = f"measured-{len(pictures) + 1}" if pictures else "measured"
        with_it = f" and with {best.label} (orange)" if beside and best else ""
        said = (
            f"Measured (dots) and simulated: nominal (grey, dashed){with_it}, on the gait's clock, with the "
            "same origin. The line of a right model runs through the dots. Crosses are samples that do not "
            "count; the sentences below say why."
        )
        pictures[name] = Picture(
            f"Trial {trial.name}",
            partial(diagnosis_plots.measured_and_simulated, trial, beside),
            f"The same of trial {trial.name}." if pictures else said,
        )
    return pictures


def _gap_pictures(diagnosis: Diagnosis) -> dict[str, Picture]:
    gaits = gaits_of(diagnosis)
    if not gaits:
        return {}
    return {
        "components": Picture(
            "What the gap is made of",
            partial(diagnosis_plots.components, gaits),
            "The gap of each signal and trial in multiples of its floor, and its components. A bar that ends "
            "left of the dashed line is no gap.",
        ),
        "map": Picture(
            "Where in the cycle",
            partial(diagnosis_plots.gap_map, gaits),
            "The gap at each moment of the cycle, without drift, in multiples of the floor. Bright cells are "
            "the moments to look at, in that signal of that trial.",
        ),
    }


def _next_sections(folder: Path, diagnosis: Diagnosis) -> list[Section]:
    experiment = diagnosis.experiment
    if isinstance(experiment, CommandExperiment):
        return next_commands_sections(folder, experiment)
    if experiment is None:
        return []
    picture = Picture(
        "What to measure next",
        partial(gait_plots.commanded, experiment.gait),
        f"One cycle of the gait that separates the effects best. {what_it_tells(experiment)} Film it, add "
        "the trial to the data set, and diagnose again.",
    )
    run, gait = (shlex.quote(str(path)) for path in (folder, folder / "next.toml"))
    commands = [f"gaitopt export {run} {gait} --format micropython --out player"]
    return [
        *save_figures(folder, {"next": picture}),
        Section("The next gait", table=gait_table(experiment.gait, "next.toml"), commands=commands),
    ]
