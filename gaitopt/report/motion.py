"""The parts of a page that show the robot itself: the player, and the figure of the way from above."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from gaitopt.core.text import one_line
from gaitopt.gait.drive import Drive
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.report.figures.way import Way, from_above
from gaitopt.report.film.section import FilmPart
from gaitopt.report.film.take import Take
from gaitopt.report.page import Picture, Section, rendered
from gaitopt.report.words import fidelity_text
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario
from gaitopt.simulation.setup import RobotSetup, prepared

_DRAWS = 8
"""Rollouts in scenarios that a way shows at most."""

_HOW = (
    "Drag to turn it, pinch or use + and − to zoom. One step is one recorded pose. A shape that touches is "
    "yellow, and so is its print on the ground."
)


def shown_takes(
    simulator: Simulator, drives: Mapping[str, Drive], trajectories: Mapping[str, Trajectory]
) -> list[Take]:
    """Return what a player shows of rollouts with poses, by name; those that failed are left out."""
    axes, model = simulator.problem.roles.axes, simulator.models[0]
    return [
        Take(model, one, axes, name, drives[name].period_s, drives[name].block_s, math.nan)
        for name, one in trajectories.items()
        if one.poses is not None and one.status == "ok"
    ]


def player_part(title: str, caption: str, takes: Sequence[Take], beside: bool = True) -> FilmPart:
    """Return the section of a player; a note where it cannot be made.

    Args:
        title: title of the section.
        caption: what to see in it.
        takes: the motions; the first two are shown first.
        beside: whether two motions are shown at once at first.
    """
    from gaitopt.report.player.player import embedded_player

    if not takes:
        return FilmPart()
    try:
        player = embedded_player(takes, beside=beside)
    except Exception as error:
        return FilmPart(notes=(f"No robot in 3-D: {one_line(error)}",))
    body = rendered("player.html", title=title, caption=f"{caption} {_HOW}", player=player)
    section = Section(title, body=body, styles=["player.css"], scripts=["player-scene.js", "player.js"])
    return FilmPart(sections=(section,))


def working_text(problem: Problem) -> str:
    """Return in words how finely the motions on a page are simulated."""
    working = problem.simulation.working
    return f"{fidelity_text(working.timestep_s, working.integrator)}, the working fidelity"


def ways_of(
    problem: Problem,
    gaits: Mapping[str, Gait],
    trajectories: Mapping[str, Trajectory],
    scenarios: Sequence[Scenario],
) -> list[Way]:
    """Return the way of each gait that went well, with rollouts in some scenarios.

    Args:
        problem: the robot.
        gaits: the gaits, by name.
        trajectories: their rollouts on the nominal robot, by name.
        scenarios: scenarios of the problem; some are simulated here.
    """
    going = {name: gaits[name] for name, one in trajectories.items() if one.status == "ok"}
    chosen = tuple(scenarios[: max(2, _DRAWS // max(1, len(going) // 2))])
    setup = RobotSetup.of(problem, chosen, problem.simulation.working)
    pairs = [(name, index) for name in going for index in range(len(chosen))]

    def walked(pair: tuple[str, int]) -> Trajectory:
        name, index = pair
        robot, nominal = prepared(setup, index), trajectories[name]
        return robot.simulator.run(going[name], robot.scenario, duration=float(nominal.time[-1]))

    with ThreadPoolExecutor() as pool:
        drawn = dict(zip(pairs, pool.map(walked, pairs), strict=True))
    return [
        Way(
            name,
            trajectories[name],
            [one for (of, _), one in drawn.items() if of == name and one.status == "ok"],
        )
        for name in going
    ]


def way_picture(
    ways: Sequence[Way], problem: Problem, best: str | None = None, gaits: bool = True
) -> dict[str, Picture]:
    """Return the figure of the way from above, under its name; nothing where no way is known.

    Args:
        ways: the ways.
        problem: the robot.
        best: the name of the gait to highlight.
        gaits: whether they are of gaits on the nominal robot, rather than of several robots.
    """
    if not ways:
        return {}
    caption = "The marker's way, seen from above, with one scale along and across. "
    if gaits:
        caption += f"Simulated {working_text(problem)}. "
    draws = max(len(way.draws) for way in ways)
    if draws:
        robots = "robots of a posterior" if problem.robots else "scenarios"
        caption += f"Thick: on the nominal robot. Thin: the same gait in {draws} {robots}. "
    caption += "Arrows show where the trunk points. "
    if any(way.measured is not None for way in ways):
        caption += "Dotted: as measured, from the same start. "
    caption += "A straight gait stays on the dotted line." if gaits else ""
    draw = partial(from_above, ways, problem.roles, best=best)
    return {"way": Picture("The way from above", draw, caption.strip())}
