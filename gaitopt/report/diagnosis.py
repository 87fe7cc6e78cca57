"""The page of a diagnosis: which effect, before and after, where the gap lies, and what to measure next."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import write_text
from gaitopt.core.quantities import figure
from gaitopt.diagnose.correction import Walked
from gaitopt.diagnose.diagnosis import Diagnosis, TrialGap
from gaitopt.diagnose.gap.align import Aligned, align
from gaitopt.diagnose.gap.predict import predict
from gaitopt.diagnose.gap.where import COMPONENTS
from gaitopt.diagnose.words import answer, explanation, what_it_tells
from gaitopt.problem.problem import Problem
from gaitopt.report.figures import diagnosis as diagnosis_plots
from gaitopt.report.figures import gait as gait_plots
from gaitopt.report.film.section import FilmPart, film_on_page_s, film_part
from gaitopt.report.page import Page, Picture, Section, Table, folded, save_figures
from gaitopt.report.tables import gait_table
from gaitopt.report.words import robot_text
from gaitopt.robot.signals import unit_of
from gaitopt.runs.folder import write_into
from gaitopt.simulation.rollout import Simulator

_SHOWN_EFFECTS = 8

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
    corrected: Problem | None,
    walked: Sequence[Walked],
    executor: Executor | None,
    full: bool = False,
) -> None:
    """Write ``report.html`` and ``figures/`` of a diagnosis.

    Args:
        folder: its run folder.
        problem: the nominal problem.
        diagnosis: the diagnosis.
        corrected: the problem with the most probable effect switched on, blamed or not; None without one.
        walked: gaits of the nominal and of the corrected robot.
        executor: where trials of the corrected robot are simulated; None to leave them out.
        full: add what takes longer: a film of the robot beside the measured marker.
    """
    content = diagnosis.to_dict()
    after = _after(corrected, diagnosis, executor) if corrected and executor else None
    film = _film(folder, problem, corrected, diagnosis) if full else FilmPart()
    page = Page(
        title=f"{problem.name}: measured against simulated",
        answer=answer(diagnosis),
        asked=_asked(problem, diagnosis),
        tiles=_tiles(content),
        notes=film.notes,
        sections=[
            *([Section("Which effect", table=_effects_table(content))] if content["effects"] else []),
            *(
                [Section("How far the gap shrinks", table=_shrinkage_table(content))]
                if content["gap_by_trial"]
                else []
            ),
            *save_figures(folder, _cause_pictures(diagnosis)),
            *film.sections,
            *save_figures(folder, _trial_pictures(diagnosis, after)),
            *save_figures(folder, _gap_pictures(diagnosis)),
            *([Section("Largest parts of the gap", table=_where_table(content))] if content["where"] else []),
            *([Section("Gaits on the corrected robot", table=_walked_table(walked))] if walked else []),
            *_next_sections(folder, diagnosis),
            folded(Section("Trial by trial, in words", sentences=explanation(diagnosis))),
            folded(Section("Each signal", table=_signal_table(diagnosis))),
            folded(Section("The floor", table=_floor_table(diagnosis))),
        ],
    )
    write_into(folder, "report.html", lambda file: write_text(file, page.html()))


def _after(corrected: Problem, diagnosis: Diagnosis, executor: Executor) -> list[Aligned] | None:
    """Return the trials beside the corrected robot; None where it cannot be simulated."""
    trials = [gap.aligned.trial for gap in diagnosis.trials]
    try:
        predictions = predict(Simulator.build(corrected), trials, executor)
        return [align(trial, simulated) for trial, simulated in zip(trials, predictions, strict=True)]
    except GaitoptError:
        return None


def _asked(problem: Problem, diagnosis: Diagnosis) -> dict[str, str]:
    return {
        "Robot": robot_text(problem),
        "Data set": diagnosis.source,
        "Trials": ", ".join(map(_trial, diagnosis.trials)),
        "Simulated": f"at {figure(diagnosis.fidelity['timestep_s'])} s, {diagnosis.fidelity['integrator']}, "
        f"seed {diagnosis.seed}",
    }


def _trial(gap: TrialGap) -> str:
    gait, time = gap.aligned.trial.drive.name, gap.aligned.time
    of = "" if gait == gap.name else f"{gait}, "
    return f"{gap.name} ({of}{figure(float(time[-1] - time[0]))} s)"


def _tiles(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    gap = content["gap"]
    causes = " and ".join(content["causes"]) or "no cause found"
    before, after, floor = (figure(1e3 * gap[f"{k}_m"]) for k in ("heldout_before", "heldout_after", "floor"))
    tiles = [
        (_VERDICTS[content["verdict"]], causes if content["verdict"] != "no_gap" else "within the floor")
    ]
    if content["effects"]:
        first = content["effects"][0]
        tiles.append((_probability(first["probability"]), f"probability of {first['name']}"))
        tiles.append((f"{before} → {after} mm", f"gap on held-out data; floor {floor} mm"))
        tiles.append((_probability(content["other_probability"]), "probability of something else"))
    else:
        tiles.append((f"{before} mm", f"gap of the marker; floor {floor} mm"))
    return tiles


# --- figures ------------------------------------------------------------------------------------


def _cause_pictures(diagnosis: Diagnosis) -> dict[str, Picture]:
    found = diagnosis.found
    if found is None or found.best is None:
        return {}
    pictures = {
        "ranking": Picture(
            "Ranking of the effects",
            diagnosis_plots.ranking(found),
            "What each effect, fitted, leaves of the trials that its fit did not see; shorter is better, and "
            "1 is what a right model leaves. Error bars: 90 % interval of the difference to the first. An "
            "effect whose bar is as short as the first one's cannot be told from it.",
        ),
        "profile": Picture(
            "Profile of the winner's parameter",
            diagnosis_plots.profile(found),
            "The error along the winner's parameter, all else fitted. A sharp valley means that the data pin "
            "the parameter down; a flat one that they hardly do. Shaded: its 90 % interval.",
        ),
    }
    if len(found.trial_set.sample_trials):
        pictures["corrected"] = Picture(
            "The gap before and after",
            diagnosis_plots.held_out(diagnosis, found),
            "RMS error of the marker in each trial, on data that the fit did not see: nominal, and with the "
            "most probable effect. The floor is what noise, start pose and timestep leave of a right model.",
        )
    return pictures


def _trial_pictures(diagnosis: Diagnosis, after: Sequence[Aligned] | None) -> dict[str, Picture]:
    best = diagnosis.found.best if diagnosis.found else None
    pictures = {}
    for index, trial in enumerate(diagnosis.trials):
        beside = after[index] if after else None
        name = "measured" if index == 0 else f"measured-{index + 1}"
        with_it = f" and with {best.label} (orange)" if beside and best else ""
        said = (
            f"Measured (dots) and simulated: nominal (grey, dashed){with_it}, on the gait's clock, moved to "
            "one origin. A right model's line runs through the dots. Crosses are samples that do not count; "
            "the words below say why."
        )
        pictures[name] = Picture(
            f"Trial {trial.name}",
            diagnosis_plots.measured_and_simulated(trial, beside),
            said if index == 0 else f"The same of trial {trial.name}.",
        )
    return pictures


def _gap_pictures(diagnosis: Diagnosis) -> dict[str, Picture]:
    return {
        "components": Picture(
            "What the gap is made of",
            diagnosis_plots.components(diagnosis),
            "The gap of each signal and trial in multiples of its floor, and its components. A bar that ends "
            "left of the dashed line is no gap.",
        ),
        "map": Picture(
            "Where in the cycle",
            diagnosis_plots.gap_map(diagnosis),
            "Where in the cycle the gap lies, drift removed, in multiples of the floor: bright cells are the "
            "moments to look at, in that signal of that trial.",
        ),
    }


def _film(folder: Path, problem: Problem, corrected: Problem | None, diagnosis: Diagnosis) -> FilmPart:
    """Film the trial with the largest gap beside the measured marker."""
    from gaitopt.report.film.film import write_film
    from gaitopt.report.film.take import take_beside

    trial = max(diagnosis.trials, key=_worst).aligned.trial
    robots = {"nominal": problem} | ({"corrected": corrected} if corrected else {})
    length = film_on_page_s(trial.drive.block_s)
    caption = (
        f"Trial {trial.name}: the robot as simulated, nominal"
        + (" and corrected" if corrected else "")
        + ", beside the measured marker. Marker and ghost start together; what they drift apart is the gap."
    )

    def write(path: Path) -> None:
        takes = [
            take_beside(Simulator.build(robot), trial, length).named(f"{trial.drive.name}, {name}")
            for name, robot in robots.items()
        ]
        begin = max(0.0, *(float(shown.ghost.time[0]) for shown in takes if shown.ghost))
        write_film(path, takes, begin, begin + length)

    return film_part(folder, "film", "Measured beside simulated, filmed", caption, write)


def _worst(trial: TrialGap) -> float:
    return trial.ratios.get("marker", 0.0)


def _next_sections(folder: Path, diagnosis: Diagnosis) -> list[Section]:
    experiment = diagnosis.experiment
    if experiment is None:
        return []
    picture = Picture(
        "What to measure next",
        gait_plots.commanded(experiment.gait),
        f"One cycle of the gait that leaves the least doubt. {what_it_tells(experiment)} Film it, add the "
        "trial to the data set, and diagnose again.",
    )
    commands = [f"gaitopt export {folder} {folder}/next.toml --format micropython --out player"]
    return [
        *save_figures(folder, {"next": picture}),
        Section("The next gait", table=gait_table(experiment.gait, "next.toml"), commands=commands),
    ]


# --- tables -------------------------------------------------------------------------------------


def _effects_table(content: Mapping[str, Any]) -> Table:
    return Table(
        head=[
            *("effect", "probability", "parameter", "fitted", "90 % interval"),
            *("gap removed", "error left", "alike"),
        ],
        rows=[_effect_row(row) for row in content["effects"][:_SHOWN_EFFECTS]],
        note="Gap removed: how much of the marker's gap above the floor goes, on trials that the fit did not "
        "see (more than 100 % is below the floor, less than 0 makes it worse). Error left: in the worst "
        "trial; 1 for a right model. Alike: cosine between what the effect changes and what the answer's "
        "does; near 1 these trials can hardly tell them apart.",
        mark_first=bool(content["causes"]),
        words=(2,),
    )


def _effect_row(row: Mapping[str, Any]) -> list[str]:
    parameter, found = next(iter(row["parameters"].items()))
    shrinkage = row["heldout_shrinkage"]
    return [
        row["name"] if row["target"] == "all" else f"{row['name']}, {row['target']}",
        _probability(row["probability"]),
        parameter + (f" [{row['unit']}]" if row["unit"] else ""),
        f"{found['value']:.4g}",
        " to ".join(f"{end:.4g}" for end in found["ci90"]),
        "–" if shrinkage is None else f"{100 * shrinkage:.0f} %",
        figure(row["heldout_left"]),
        f"{row['alike']:.2f}",
    ]


def _probability(value: float) -> str:
    return "< 0.1 %" if value < 1e-3 else f"{100 * value:.1f} %"


def _shrinkage_table(content: Mapping[str, Any]) -> Table:
    rows = []
    for row in [*content["gap_by_trial"], {"trial": "all trials"} | content["gap"]]:
        share, ends = row["shrinkage"], row["shrinkage_ci90"]
        millimetres = [figure(1e3 * row[f"{key}_m"]) for key in ("heldout_before", "heldout_after", "floor")]
        known = share is not None and all(math.isfinite(end) for end in ends)
        removed = f"{share:.0%} ({ends[0]:.0%} to {ends[1]:.0%})" if known else "–"
        rows.append([row["trial"], *millimetres, removed])
    return Table(
        head=["trial", "before, mm", "after, mm", "floor, mm", "gap removed (90 %)"],
        rows=rows,
        note="RMS error of the marker on data that the fit did not see, with the most probable effect. "
        "Removed: share of what is above the floor; a dash where nothing is.",
    )


def _walked_table(walked: Sequence[Walked]) -> Table:
    return Table(
        head=["gait", "period [s]", "nominal [mm/s]", "corrected [mm/s]"],
        rows=[
            [
                row.name,
                figure(row.period_s),
                *(f"{1e3 * v:.1f}" for v in (row.nominal_m_s, row.corrected_m_s)),
            ]
            for row in walked
        ],
        note="Forward speed over whole cycles, nominal scenario; corrected by the most probable effect, "
        "which may not be sure. For a full search on the corrected robot: gaitopt optimise corrected.toml.",
    )


def _where_table(content: Mapping[str, Any]) -> Table:
    return Table(
        head=["signal", "component", "share of the whole", "RMS", "floors"],
        rows=[
            [
                f"{row['trial']}: {row['signal']}",
                row["component"],
                f"{100 * row['share']:.0f} %",
                _amount(row["gap"], row["unit"]),
                "–" if row["floors"] is None else f"{row['floors']:.1f}",
            ]
            for row in content["where"][:_SHOWN_EFFECTS]
        ],
        note="Drift: travel per cycle that the stride's size does not explain. Stride: size and shape of the "
        "motion inside a cycle, with the travel that goes with its size. Timing: the same motion later or "
        "earlier. Transient: before the steady motion. Noise: what differs from cycle to cycle. Shares are "
        "of the squared gap in floors, of the trials that count.",
        words=(1,),
    )


def _signal_table(diagnosis: Diagnosis) -> Table:
    rows = []
    for trial in diagnosis.trials:
        for name, part in trial.splits.items():
            travels = (
                [_amount(travel, unit_of(name)) for travel in part.travel] if part.travel else ["–", "–"]
            )
            shares = [f"{100 * part.squares[c] / (part.rms**2 or 1.0):.0f} %" for c in COMPONENTS]
            rows.append(
                [
                    f"{trial.name}: {name}",
                    *travels,
                    f"{part.size:.2f}",
                    f"{1e3 * part.delay_s:+.0f} ms",
                    *shares,
                ]
            )
    return Table(
        head=["signal", "travel a cycle", "simulated", "size in a cycle", "delay", *COMPONENTS], rows=rows
    )


def _floor_table(diagnosis: Diagnosis) -> Table:
    rows = []
    for trial in diagnosis.trials:
        for name, floor in trial.floors.items():
            parts = (floor.noise, floor.spread, floor.repeats, floor.start_pose, floor.numerics, floor.clock)
            amounts = (trial.aligned.rms(name), floor.total, *parts)
            cells = ("–" if amount is None else _amount(amount, unit_of(name)) for amount in amounts)
            rows.append([f"{trial.name}: {name}", *cells])
    return Table(
        head=["signal", "gap", "floor", "noise", "cycles", "repeats", "start pose", "timestep", "clock"],
        rows=rows,
        note="RMS. Noise, spread of the cycles and repeats from the data; start pose, timestep and what "
        "rounded time stamps leave open from the simulator at the fidelity used.",
    )


def _amount(value: float, unit: str) -> str:
    """Return a length in mm or an angle in degrees; what rounds to nothing is 0."""
    scaled, shown = (1e3 * value, " mm") if unit == "m" else (math.degrees(value), "°")
    return f"{figure(scaled) if abs(scaled) >= 5e-3 else '0'}{shown}"
