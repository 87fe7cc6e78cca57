"""The report of a comparison of gaits over the same scenarios."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from gaitopt.core.json import to_json
from gaitopt.core.quantities import figure
from gaitopt.gait.gait import Gait
from gaitopt.optimise.compare import ComparedGait, compared_scenarios
from gaitopt.problem.problem import Problem
from gaitopt.report.figures import comparison as comparison_figures
from gaitopt.report.figures import gait as gait_figures
from gaitopt.report.motion import player_part, shown_takes, way_picture, ways_of, working_text
from gaitopt.report.page import Page, Picture, Section, Table, after_results, folded, save_figures
from gaitopt.report.rollouts import rollouts
from gaitopt.report.tables import metric_table
from gaitopt.report.words import constraints_text, fidelity_text, interval_text, scenario_rule, verdicts
from gaitopt.robot.trajectory import Trajectory
from gaitopt.runs.folder import PAGE_FILE, filled_folder, write_into
from gaitopt.simulation.rollout import Simulator


def write_comparison(
    path: Path | None, problem: Problem, gaits: Sequence[Gait], rows: Sequence[ComparedGait], seed: int
) -> Path:
    """Write the page, the figures and the rows of a comparison, and return their folder.

    Args:
        path: a new or empty folder.
        problem: the robot.
        gaits: the gaits, in the order of the rows, with names that differ.
        rows: the rows of the comparison.
        seed: seed of the scenarios.
    """
    with filled_folder(path, f"{problem.name}-compare") as folder:
        content = to_json({"rows": [row.to_dict() for row in rows]})
        write_into(folder, "compare.json", content)
        with after_results(folder, "compare.json"):
            html = _page(folder, problem, gaits, rows, seed).html()
            write_into(folder, PAGE_FILE, html)
    return folder


def _page(
    folder: Path, problem: Problem, gaits: Sequence[Gait], rows: Sequence[ComparedGait], seed: int
) -> Page:
    names, fidelity = [row.name for row in rows], problem.simulation.reference
    shown = dict(zip(names, gaits, strict=True))
    simulator = Simulator.build(problem)
    trajectories = rollouts(simulator, shown)
    caption = (
        f"The gaits on the nominal robot, {working_text(problem)}, from the start, on one clock. "
        "Choose which two are shown."
    )
    player = player_part("The robot", caption, shown_takes(simulator, shown, trajectories))
    ways = ways_of(problem, shown, trajectories, compared_scenarios(problem, seed))
    return Page(
        title=f"{problem.name}: gaits compared",
        answer=" ".join(verdicts(rows)) or f"{names[0]} alone: nothing to compare with.",
        asked={
            "Gaits": ", ".join(names),
            "Scenarios": f"{len(rows[0].scenario_speeds_m_s)} of {problem.name}, seed {seed}, the same for "
            f"each gait{_robots_text(rows)}{scenario_rule(problem.objective)}",
            "Simulated": f"{fidelity_text(fidelity.timestep_s, fidelity.integrator)}: "
            "the reference, as a search verifies",
        },
        notes=player.notes,
        sections=[
            *player.sections,
            Section("Over the same scenarios", table=_speed_table(rows)),
            *([Section(f"Against {names[0]}", table=_paired_table(rows))] if len(rows) > 1 else []),
            *save_figures(folder, _pictures(problem, rows, trajectories) | way_picture(ways, problem)),
            folded(Section("All metrics", table=metric_table(rows))),
        ],
    )


def _robots_text(rows: Sequence[ComparedGait]) -> str:
    count = rows[0].robots
    return f", each on one of {count} robots of a posterior (intervals hold 90 % of them)" if count else ""


def _pictures(
    problem: Problem, rows: Sequence[ComparedGait], trajectories: Mapping[str, Trajectory]
) -> dict[str, Picture]:
    names = [row.name for row in rows]
    pictures = {
        "speeds": Picture(
            "Speed",
            partial(comparison_figures.speeds, rows),
            "Mean forward speed of each gait over the same scenarios. As the scenarios are the same, the "
            "paired differences are more precise than these intervals.",
        )
    }
    if len(rows) > 1:
        pictures["differences"] = Picture(
            "Paired differences",
            partial(comparison_figures.differences, rows),
            f"How much faster each gait is than {names[0]}: in each scenario (dots), and the mean with its "
            "90 % interval (black). If the interval crosses 0, the difference is no more than noise.",
        )
    pictures["position"] = Picture(
        "Position over time",
        partial(gait_figures.overlay, trajectories, problem.roles),
        "Forward position of the marker on the nominal robot: the steeper the line, the faster the gait.",
    )
    return pictures


def _speed_table(rows: Sequence[ComparedGait]) -> Table:
    return Table(
        head=["gait", "period [s]", "speed [mm/s]", "90 % interval", "worst scenario", "constraints"],
        rows=[
            [
                row.name,
                figure(row.period_s),
                f"{1e3 * row.speed_m_s:.2f}",
                interval_text(row.speed_ci90_m_s, ".2f"),
                f"{1e3 * row.speed_worst_m_s:.2f}",
                constraints_text(row),
            ]
            for row in rows
        ],
        words=(5,),
    )


def _paired_table(rows: Sequence[ComparedGait]) -> Table:
    return Table(
        head=["gait", "difference [mm/s]", "90 % interval", "ratio", "90 % interval", "more than noise"],
        rows=[
            [
                row.name,
                f"{1e3 * row.difference_m_s:+.2f}",
                interval_text(row.difference_ci90_m_s, "+.2f"),
                "–" if row.ratio is None else f"{row.ratio:.2f}",
                "–" if row.ratio_ci90 is None else interval_text(row.ratio_ci90, ".2f", 1.0),
                "yes" if row.more_than_noise else "no",
            ]
            for row in rows[1:]
        ],
        note=f"To {rows[0].name}, in the same scenarios: what a scenario does to both gaits cancels.",
    )
