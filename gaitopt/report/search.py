"""The report of a search: the best gait compared with the hand-tuned gaits, and how it was found."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

from gaitopt.core.json import to_json
from gaitopt.core.progress import OnProgress, Progress, silent
from gaitopt.core.quantities import figure
from gaitopt.core.streams import Stream
from gaitopt.gait.gait import BEST_FILE, Gait
from gaitopt.optimise.ladder import LadderSettings, Rung
from gaitopt.optimise.run import Optimised
from gaitopt.optimise.sensitivity import Sensitivity, SensitivitySettings
from gaitopt.optimise.verification import scenarios_of
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.report.figures import comparison as comparison_figures
from gaitopt.report.figures import gait as gait_figures
from gaitopt.report.figures import search as search_figures
from gaitopt.report.film.section import FilmPart, film_on_page_s, film_part
from gaitopt.report.motion import player_part, shown_takes, way_picture, ways_of, working_text
from gaitopt.report.page import Page, Picture, Section, Table, folded, save_figures
from gaitopt.report.rollouts import rollouts
from gaitopt.report.settings import PAGE
from gaitopt.report.tables import gait_table, margin_table, metric_table
from gaitopt.report.words import (
    answer_of,
    constraints_text,
    fidelity_text,
    interval_text,
    names_of,
    reach_of,
    robot_text,
    scenario_rule,
    warning_lines,
)
from gaitopt.robot.trajectory import Trajectory
from gaitopt.runs.folder import PAGE_FILE
from gaitopt.runs.run_folder import RunFolder
from gaitopt.runs.summary import Summary
from gaitopt.simulation.labels import title_of
from gaitopt.simulation.rollout import Simulator

_BEST = "best"
"""Name of the winner."""


def write_report(
    folder: RunFolder,
    problem: Problem,
    optimised: Optimised,
    full: bool = False,
    sensitive: Sequence[Sensitivity] = (),
    on_progress: OnProgress = silent,
) -> None:
    """Write ``report.html`` and ``figures/`` of a run of `optimise`, after its results.

    Args:
        folder: the run.
        problem: its problem.
        optimised: what was found.
        full: add what takes longer: a film of the winner.
        sensitive: the sensitivities of its speed, if requested.
        on_progress: called as film and page begin, and after each picture of the film.
    """
    simulator, summary = Simulator.build(problem), Summary.of(problem, optimised)
    film = _film(folder.path, simulator, optimised, summary, on_progress) if full else FilmPart()
    on_progress(Progress(PAGE))
    gaits = {_BEST: optimised.best.gait} | {_by_hand(name): gait for name, gait in problem.baselines.items()}
    trajectories = rollouts(simulator, gaits)
    player = _player(simulator, summary, gaits, trajectories)
    pictures = _pictures(simulator, optimised, summary, gaits, trajectories) | _sensitivity_pictures(
        sensitive
    )
    if sensitive:
        rows = [asdict(one) for one in sensitive]
        folder.file("sensitivity.json", to_json({"rows": rows}))
    page = Page(
        title=f"{problem.name}: optimised gait against hand-tuned gaits",
        answer=answer_of(summary),
        asked=_asked(problem, summary),
        tiles=_tiles(summary),
        notes=[
            *warning_lines(summary),
            *filter(None, [reach_of(summary)]),
            *summary.notes,
            *player.notes,
            *film.notes,
        ],
        sections=[
            *player.sections,
            *film.sections,
            *(
                [Section("Limits and margins", table=margin_table(summary.best))]
                if summary.best.margins
                else []
            ),
            Section("Optimised against hand-tuned", table=_speed_table(summary)),
            *save_figures(folder.path, pictures),
            Section("The optimised gait", table=gait_table(optimised.best.gait, BEST_FILE)),
            folded(Section("All metrics", table=metric_table([summary.best, *summary.baselines]))),
            Section("What next", commands=_next_commands(folder.path)),
        ],
    )
    folder.file(PAGE_FILE, page.html())


# --- figures ------------------------------------------------------------------------------------


def _by_hand(name: str) -> str:
    """Return what a baseline is called beside the winner."""
    return f"{name}, hand-tuned" if name == _BEST else name


def _pictures(
    simulator: Simulator,
    optimised: Optimised,
    summary: Summary,
    gaits: Mapping[str, Gait],
    trajectories: Mapping[str, Trajectory],
) -> dict[str, Picture]:
    """Return the figures that every report has, and the front if it was requested."""
    problem = simulator.problem
    scenarios = scenarios_of(problem, summary.seed, Stream.VERIFICATION_SCENARIOS)
    ways = ways_of(problem, gaits, _first_shown(summary, trajectories), scenarios)
    pictures = {
        "speeds": Picture(
            "Speed",
            partial(comparison_figures.speeds, [summary.best, *summary.baselines], best=_BEST),
            "Forward speed of the optimised gait (orange) and of each hand-tuned gait, in scenarios that "
            "the search did not use. If two intervals do not overlap, the speeds differ by more than noise.",
        ),
        "position": Picture(
            "Position over time",
            partial(gait_figures.overlay, trajectories, problem.roles, best=_BEST),
            "Forward position of the marker for each gait, on the nominal robot. The steeper the line, the "
            "faster the gait. Where a line goes back, a pad slips or the body folds.",
        ),
        "periods": Picture(
            "Each gait by itself",
            partial(gait_figures.panels, trajectories, problem.roles, best=_BEST),
            "The same with a panel for each gait, each with its own scale. A rise is a stride; a fall is "
            "slip, or the body folds. Equal steps mean that the gait repeats itself.",
        ),
    }
    pictures |= way_picture(ways, problem, best=_BEST)
    if trajectories[_BEST].status == "ok":
        pictures |= _servo_pictures(simulator, optimised, trajectories[_BEST])
    pictures["convergence"] = Picture(
        "Convergence of the search",
        partial(search_figures.convergence, optimised.entries, optimised.baselines),
        "Speed of every gait that was evaluated, by method. Stars are planned gaits, where the search "
        "started from some. Hollow marks violate a constraint. The best so far counts violations "
        "too, so it may change to a slower gait that has none. Horizontal lines are the hand-tuned gaits.",
    )
    if optimised.request.pareto:
        pictures["pareto"] = Picture(
            "Speed against cost of transport",
            partial(search_figures.front, optimised.entries, optimised.front, optimised.baselines),
            "Speed against cost of transport (energy per weight and distance). No other gait beats a gait on "
            "the front in both. pareto.csv has the numbers, and pareto/ has a gait file for each.",
        )
    return pictures


def _servo_pictures(simulator: Simulator, optimised: Optimised, trajectory: Trajectory) -> dict[str, Picture]:
    """Return the figures of what the winner's servos and pads do."""
    problem, gait, robot = simulator.problem, optimised.best.gait, Robot.of(simulator.models[0])
    return {
        "gait": Picture(
            "Gait diagram",
            partial(gait_figures.gait_diagram, problem, gait, trajectory, robot),
            "One cycle of the optimised gait. Grey: a pad holds. Orange: a loaded pad slips back, which "
            "costs travel. The bars at the bottom show which pad it is.",
        ),
        "angles": Picture(
            "Commanded and reached angles",
            partial(gait_figures.angles, problem, gait, trajectory, robot),
            "Commanded and reached angles of each servo, with its range. Shaded: its torque is at the limit. "
            "Where the reached angle falls behind there, the servo is too weak for the gait, or the gait is "
            "too fast for the servo.",
        ),
    }


def _sensitivity_pictures(sensitive: Sequence[Sensitivity]) -> dict[str, Picture]:
    gait = [one for one in sensitive if one.kind == "gait"]
    model = [one for one in sensitive if one.kind == "model"]
    pictures = {}
    if gait:
        pictures["sensitivity"] = Picture(
            "Sensitivity to the gait",
            partial(
                search_figures.sensitivity,
                gait,
                step := f"{100 * SensitivitySettings.gait_step:.0f} % of its range",
            ),
            _sensitivity_caption("its numbers", step, "what to set with care on the robot"),
        )
    if model:
        pictures["sensitivity-model"] = Picture(
            "Sensitivity to the model",
            partial(
                search_figures.sensitivity,
                model,
                step := f"{100 * SensitivitySettings.model_step:.0f} % of its value",
            ),
            _sensitivity_caption("the model's parameters", step, "what is worth measuring well"),
        )
    return pictures


def _sensitivity_caption(numbers: str, step: str, lesson: str) -> str:
    return (
        f"How the speed of the optimised gait changes when one of {numbers} changes by {step}. Each bar is "
        f"the mean over the same scenarios. Long bars are {lesson}. The black mark is half the difference "
        "between up and down. If its interval crosses 0, they differ by no more than noise."
    )


def _first_shown(summary: Summary, trajectories: Mapping[str, Trajectory]) -> dict[str, Trajectory]:
    """Return the rollouts of the winner and of the fastest baseline."""
    fastest = summary.fastest_baseline
    names = [_BEST] if fastest is None else [_BEST, _by_hand(fastest.name)]
    return {name: trajectories[name] for name in names}


def _player(
    simulator: Simulator, summary: Summary, gaits: Mapping[str, Gait], trajectories: Mapping[str, Trajectory]
) -> FilmPart:
    """Return the player of all gaits, the winner and the fastest baseline first."""
    ordered = _first_shown(summary, trajectories) | dict(trajectories)
    caption = (
        f"The optimised gait and the hand-tuned gaits on the nominal robot, "
        f"{working_text(simulator.problem)}, from the start, on one clock. Choose which two are shown."
    )
    return player_part("The robot", caption, shown_takes(simulator, gaits, ordered))


def _film(
    folder: Path, simulator: Simulator, optimised: Optimised, summary: Summary, on_progress: OnProgress
) -> FilmPart:
    """Film the winner beside the fastest baseline, after the transient."""
    from gaitopt.report.film.film import write_film
    from gaitopt.report.film.take import take

    shown = [(optimised.best.gait, summary.best.speed_m_s)]
    fastest = summary.fastest_baseline
    if fastest is not None:
        shown.append((simulator.problem.baselines[fastest.name], fastest.speed_m_s))
    begin = simulator.problem.simulation.horizon.transient_s
    end = begin + film_on_page_s(max(gait.period_s for gait, _ in shown))
    scenarios = summary.verified.scenarios
    beside = " beside the fastest hand-tuned gait" if fastest is not None else ""
    caption = (
        f"The optimised gait{beside}, on the nominal robot, after the transient. The speeds are means "
        f"over {scenarios} scenarios, as in the table. The camera follows the robot; the stripes on the "
        "ground stand still."
    )

    def write(path: Path) -> None:
        takes = [
            replace(take(simulator, gait, end), speed_m_s=speed, speed_of=f"{scenarios} scenarios")
            for gait, speed in shown
        ]
        write_film(path, takes, begin, end, on_progress=on_progress)

    return film_part(folder, "walk", "Film of the gait", caption, write)


# --- what is asked and answered -----------------------------------------------------------------


def _asked(problem: Problem, summary: Summary) -> dict[str, str]:
    objective, verified = problem.objective, summary.verified
    terms = (f"{'highest' if w < 0.0 else 'lowest'} {title_of(name)}" for name, w in objective.terms.items())
    started = "from planned gaits" if summary.warm_start else "without planned gaits"
    each = f", each on one of {summary.robots} robots of a posterior" if summary.robots else ""
    return {
        "Robot": robot_text(problem),
        "Goal": f"{', '.join(terms)}{scenario_rule(objective)}",
        "Limits on": names_of(objective.constraints) or "nothing",
        "Search": f"{summary.evaluations} gaits, method {summary.method}, started {started}, seed "
        f"{summary.seed}; {summary.simulated_s:.0f} s simulated in {summary.wall_s:.0f} s",
        "Fidelity ladder": _ladder_text(summary.fidelity_ladder),
        "Verified": f"over {verified.scenarios} scenarios that the search did not use{each}, "
        f"{fidelity_text(verified.timestep_s, verified.integrator)}",
        **_timestep_text(summary),
    }


def _timestep_text(summary: Summary) -> dict[str, str]:
    """Return how much of the winner's speed is the timestep's; nothing of a run that did not look."""
    verified = summary.verified
    if verified.converged is None:
        return {}
    low, high = (1e3 * end for end in verified.change_ci90_m_s)
    return {
        "Timestep": f"in the same scenarios at {figure(verified.working_timestep_s)} s, as in the search, "
        f"the best gait has {1e3 * verified.working_speed_m_s:.1f} mm/s; the reference changes that by "
        f"{low:+.1f} to {high:+.1f} mm/s (90 % interval): "
        f"{'converged' if verified.converged else 'too coarse'}"
    }


def _ladder_text(rungs: Sequence[Rung]) -> str:
    """Return which cheaper rungs were measured, how well they rank and whether they were used."""
    texts = []
    for rung in rungs:
        ranks = f"rank correlation {rung.rank_correlation:.3f}"
        lower = f"{figure(rung.timestep_s)} s steps, {figure(rung.measured_s)} s measured"
        fate = "used" if rung.used else f"refused: below {LadderSettings.trusted}"
        again = f", again after {rung.after} gaits" if rung.after else ""
        texts.append(f"{rung.name} ({lower}){again}: {ranks}, {fate}")
    return "; ".join(texts) or "none measured; every gait was simulated at the working fidelity"


def _tiles(summary: Summary) -> list[tuple[str, str]]:
    best = summary.best
    interval = interval_text(best.speed_ci90_m_s, ".1f")
    tiles = [(f"{1e3 * best.speed_m_s:.1f} mm/s", f"forward speed, 90 % interval {interval}")]
    ratio, fastest = summary.ratio_to_best_baseline, summary.fastest_baseline
    if ratio is not None and fastest is not None:
        tiles.append((f"{ratio:.2f} times", f"the speed of {fastest.name}"))
    tiles.append((f"{figure(best.period_s)} s", f"period; stride {1e3 * best.stride_m:.1f} mm"))
    if best.constraints_met:
        tiles.append(("met", "all constraints"))
    else:
        tiles.append(("violated", names_of(best.violations)))
    return tiles


def _next_commands(folder: Path) -> list[str]:
    run = shlex.quote(str(folder))
    return [
        f"gaitopt simulate {run} {run} --video walk.mp4",
        f"gaitopt export {run} {run} --format micropython --out player",
        f"gaitopt diagnose {run} trials",
    ]


def _speed_table(summary: Summary) -> Table:
    return Table(
        head=[
            *("gait", "period [s]", "speed [mm/s]", "90 % interval", "worst scenario"),
            *("stride [mm]", "cost of transport", "constraints"),
        ],
        rows=[
            [
                row.name,
                figure(row.period_s),
                f"{1e3 * row.speed_m_s:.1f}",
                interval_text(row.speed_ci90_m_s, ".1f"),
                f"{1e3 * row.speed_worst_m_s:.1f}",
                f"{1e3 * row.stride_m:.1f}",
                f"{row.metrics['cost_of_transport']:.2f}",
                constraints_text(row),
            ]
            for row in [summary.best, *summary.baselines]
        ],
        note=f"Mean over {summary.verified.scenarios} scenarios that the search did not use.",
        mark_first=True,
        words=(7,),
    )
