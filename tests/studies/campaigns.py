"""Campaigns on sealed robots: how fast is the gait that each method recommends after some films?

A case is a robot by other numerics, of which everything is a little wrong by the problem's tolerances. One to
three effects are large, and its grip differs from step to step. One case in twelve has a cause outside the
library. A third of the cases are such that the nominal winner reaches less than 60 % of its nominal speed.
Speeds are true ones, without a camera, over several start poses, as a share of the fastest gait without a
violated limit that any method, a step of the campaign, or a search on the true robot has found. With
``--filmed``, a campaign sees its robot through the films of a synthetic phone, which are tracked and told as
a user does it.

    python tests/studies/campaigns.py --cases 24 --seed 4 --work WORK --out results/campaigns
    python tests/studies/campaigns.py --cases 4 --seed 5 --filmed --work WORK --out results/campaigns/filmed

WORK keeps what a study that was ended needs to go on.

Cost: about 25 min of two slow cores for a case of ArcFold with five films, of which 20 are the campaign's.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from filmed_walkers import tracked
from kept import read_kept, version, write_kept
from sealed_walkers import Walker

from gaitopt.blind.disturbances import OUTSIDE, disturbed
from gaitopt.blind.settings import DEFAULT as BLIND
from gaitopt.campaign.course import most_drift
from gaitopt.campaign.records import Proposal
from gaitopt.campaign.rivals import Tried, bayesian_optimisation, best_of, trial_and_error
from gaitopt.campaign.robots import prior_robots
from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import write_text
from gaitopt.effects.active import as_tables
from gaitopt.gait.gait import Gait
from gaitopt.jobs.campaign import Campaign
from gaitopt.jobs.executor import opened
from gaitopt.optimise.solvers.cma_es import CmaEs
from gaitopt.optimise.solvers.solution import Box
from gaitopt.optimise.solvers.solver import Minimisation
from gaitopt.problem.model import carrying, nominal_parts
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.report.figures.style import COLOURS, finish, single_panel
from gaitopt.report.page import png
from gaitopt.robot.warnings import silence_warnings
from gaitopt.runs.run_folder import RunFolder
from gaitopt.simulation.metrics import SPEED, measure
from gaitopt.simulation.objective import evaluate
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario
from gaitopt.simulation.tolerances import draw_errors

SLOW = 0.6
"""A robot is hard if the nominal winner reaches less than this share of its nominal speed."""

STUCK = 0.15
"""No robot is drawn with which the nominal winner reaches less: it can hardly move, whatever is tried."""

DRAWS = 100
"""Robots drawn at most until one is hard, or is not, as the case wants it."""

POSES = 4
"""Start poses over which a true speed is the mean."""

SHOWN = (1, 2, 3, 5)
"""Films after which a campaign is scored."""


@dataclass
class SealedRobot(Walker):
    """A robot with a cause outside the library, if any.

    Attributes:
        outside: its name; empty for none.
        figures: what was drawn for it.
    """

    outside: str = ""
    figures: dict[str, float] | None = None

    def robot(self, scenario: Scenario) -> Simulator:
        """Return the robot in truth."""
        robot = super().robot(scenario)
        return disturbed(robot, OUTSIDE[self.outside], self.figures or {}) if self.outside else robot

    def truly(self, gait: Gait) -> tuple[float, bool]:
        """Return the true speed of a gait, m/s, and whether it keeps every limit."""
        rows, statuses = [], []
        for seed in range(POSES):
            robot = self.robot(replace(self.scenario, pose_seed=10_000 + seed))
            path = robot.run(gait)
            rows.append(measure(self.problem, gait, path, Robot.of(robot.models[0])))
            statuses.append(path.status)
        judged = evaluate(self.problem, rows, statuses)
        speed = judged.metrics[SPEED.name]
        return (speed if np.isfinite(speed) else 0.0), judged.constraints_met


def drawn(problem: Problem, seed: int, index: int, outside: bool) -> SealedRobot:
    """Draw a robot."""
    rng = np.random.default_rng([seed, index])
    count = int(rng.integers(1, 4))
    effects = as_tables(prior_robots(problem, 1, (count, count), int(rng.integers(2**31)))[0])
    effects |= {"grip_variation": {"relative_sd": float(rng.uniform(0.02, 0.06))}}
    parts, tolerances = nominal_parts(problem), problem.file.tolerances
    errors = draw_errors(parts, tolerances, rng)
    robot = SealedRobot(
        problem,
        {} if outside else effects,
        Scenario(errors, start_pose_rad=tolerances.start_pose_rad),
        BLIND.fidelities[1:][int(rng.integers(2))],
        noise_m=float(rng.uniform(*BLIND.marker_noise_m)),
        impratio=float(rng.choice(BLIND.impratios)),
    )
    if outside:
        name = str(rng.choice(sorted(OUTSIDE)))
        plain = robot.robot(robot.scenario)
        robot = replace(robot, outside=name, figures=OUTSIDE[name].draw(rng, 0.7, plain))
    return robot


def case(
    index: int, options: argparse.Namespace, problem: Problem, winner: Gait, pool: Executor
) -> dict[str, Any]:
    """Run a case, and return its row."""
    hard, outside = index % 3 == 0, index % 12 == 5
    nominal_m_s = max(nominal_speed(problem, winner), 1e-6)
    for draw in range(DRAWS):
        robot = drawn(problem, options.seed, 1000 * index + draw, outside)
        share = robot.truly(winner)[0] / nominal_m_s
        if STUCK < share < SLOW if hard else share >= (STUCK if outside else SLOW):
            break
    folder = options.work / "campaigns" / f"{index:02d}"
    if not folder.exists():  # the first step knows nothing of the robot: it is that of all cases
        begun = folder.with_suffix(".begun")
        shutil.rmtree(begun, ignore_errors=True)
        shutil.copytree(options.work / "nominal", begun).rename(folder)
    campaign = Campaign(folder, executor=pool)
    films = folder.with_name(f"{index:02d}-films") if options.filmed else None
    recommended, refused, before, began = [], 0, campaign._folder.tellings, time.monotonic()
    for count in range(1, options.films + 1):
        refused += told(campaign, robot, count, films)
        recommended.append(recommended_after(campaign, count))
    took = time.monotonic() - began

    def film(gait: Gait) -> Tried:
        return Tried.of(gait, robot(gait), problem)

    searched = tried_by_the_nominal_search(folder / "steps" / "00" / "nominal")
    space, starts, limit = problem.space, list(problem.baselines.values()), most_drift(problem)
    methods = {
        "Bayesian optimisation, 5 films": bayesian_optimisation(space, starts, film, 5, index, limit),
        "Bayesian optimisation, 25 films": bayesian_optimisation(space, starts, film, 25, index, limit),
        "intelligent trial and error, 5 films": trial_and_error(space, searched, film, 5, limit),
    }
    gaits = {f"campaign, {n} film{'s' * (n > 1)}": recommended[min(n, len(recommended)) - 1] for n in SHOWN}
    gaits |= {"the nominal winner": winner}
    gaits |= {name: best_of(tried, limit).gait for name, tried in methods.items()}
    true = dict(zip(gaits, pool.map(robot.truly, gaits.values()), strict=True))
    best = searched_truly(robot, list(gaits.values()), options.truth, index, pool)
    fastest = max([best, *(speed for speed, met in true.values() if met)])
    return {
        "case": index,
        "seed": options.seed,
        "hard": share < SLOW,
        "outside": robot.outside,
        "effects": sorted(robot.effects),
        "best_m_s": fastest,
        "shares": {name: speed / fastest for name, (speed, _) in true.items()},
        "limits_kept": {name: met for name, (_, met) in true.items()},
        "inside": [inside(one, campaign) for one in campaign._folder.proposals],
        "foretold": foretold(campaign, robot, pool),
        "films": campaign._folder.tellings,
        "refused": refused,
        "wall_s_a_film": None if before else took / max(1, campaign._folder.tellings),
        "made_at": version(),
        "done": campaign.status().done,
    }


def recommended_after(campaign: Campaign, films: int) -> Gait:
    """Return the best gait that was known after so many films, or after the last one."""
    step = campaign._folder.step(min(films, campaign._folder.tellings))
    assert step is not None
    return step.candidates[step.best].gait


def told(campaign: Campaign, robot: SealedRobot, count: int, films: Path | None) -> int:
    """Let a campaign have so many films in all, unless it is done; return how many were refused at first.

    Args:
        campaign: the campaign.
        robot: its robot.
        count: films in all.
        films: where synthetic films are kept; None for what the robot's own camera measures.
    """
    if films is None:
        campaign.run(robot, count)
        return 0
    refused = 0
    while campaign._folder.tellings < count and not campaign.next().done:
        dataset = tracked(campaign, robot, films)
        try:
            campaign.tell(dataset)
        except GaitoptError as error:
            refused += 1
            print(error)
            campaign.tell(dataset, trust=True)
    return refused


def nominal_speed(problem: Problem, gait: Gait) -> float:
    """Return the speed of a gait on the nominal robot, m/s."""
    robot = Simulator.build(problem)
    return measure(problem, gait, robot.run(gait), Robot.of(robot.models[0]))[SPEED.name]


def tried_by_the_nominal_search(run: Path) -> list[Tried]:
    """Return every gait that the nominal search tried and that keeps the limits, with its speed."""
    opened_run = RunFolder.reopen(run)
    journal = opened_run.folder.open_journal(opened_run.problem)
    entries = [one for one in journal.entries if one.evaluation.status == "ok"]
    kept = [one for one in entries if one.evaluation.constraints_met] or entries
    return [Tried(one.gait, one.evaluation.metrics[SPEED.name]) for one in kept]


def searched_truly(
    robot: SealedRobot, starts: Sequence[Gait], budget: int, seed: int, pool: Executor
) -> float:
    """Return the true speed of the best gait without a violated limit that a search on the robot finds."""
    space, best = robot.problem.space, 0.0

    def costs(points: np.ndarray) -> np.ndarray:
        nonlocal best
        found = []
        for speed, met in pool.map(robot.truly, [space.decode(point) for point in points]):
            best = max(best, speed) if met else best
            found.append(-speed if met else 0.0)
        return np.array(found)

    first = np.array([space.encode(gait) for gait in starts])
    x0 = first[costs(first).argmin()]
    rng = np.random.default_rng([9, seed])
    CmaEs().minimise(Minimisation(costs, Box(space.circular), x0, 0.1, max(1, budget), rng))
    return best


def inside(one: Proposal, campaign: Campaign) -> bool | None:
    """Return whether the measured speed of a film lies in the interval predicted; None without a film."""
    rows = {film.film: film for film in campaign.status().films}
    measured = rows[one.film].measured_m_s
    low, high = one.predicted_speed_m_s.ci90
    return None if measured is None else bool(low <= measured <= high)


def foretold(campaign: Campaign, robot: SealedRobot, pool: Executor) -> list[dict[str, Any]]:
    """Return what each step after a film expected of the gaits that it had found, and what is true."""
    steps = [(number, campaign._folder.step(number)) for number in range(1, campaign._folder.tellings + 1)]
    found = [
        (number, one)
        for number, step in steps
        for one in (step.candidates if step else ())
        if one.film is None and one.name not in robot.problem.baselines
    ]
    true = pool.map(robot.truly, [one.gait for _, one in found])
    return [
        {
            "step": number,
            "name": one.name,
            "predicted_m_s": one.predicted_m_s.to_dict(),
            "true_m_s": speed,
            "keeps_limits": one.keeps_limits,
            "limits_kept": met,
        }
        for (number, one), (speed, met) in zip(found, true, strict=True)
    ]


def shares_of(row: dict[str, Any]) -> dict[str, float]:
    """Return the true speed of what each method recommends, over the fastest that is known of the robot.

    Gaits that a step of the campaign had found and nobody filmed are known, too.
    """
    found = [one["true_m_s"] for one in row["foretold"] if one["limits_kept"]]
    more = max([row["best_m_s"], *found]) / row["best_m_s"]
    return {name: share / more for name, share in row["shares"].items()}


def page(rows: Sequence[dict[str, Any]], cases: int) -> str:
    """Return the table of the study."""
    names, every = list(rows[0]["shares"]), [shares_of(row) for row in rows]
    lines = [
        "# Campaigns on sealed robots",
        "",
        f"{len(rows)} of {cases} robots; see `tests/studies/campaigns.py`. True speeds over the best known.",
        "",
        "| recommended by | mean | worst | on hard robots | limits kept |",
        "|---|---|---|---|---|",
    ]
    for name in names:
        shares = np.array([one[name] for one in every])
        hard = np.array([one[name] for one, row in zip(every, rows, strict=True) if row["hard"]])
        kept = np.mean([row["limits_kept"][name] for row in rows])
        on_hard = f"{hard.mean():.0%}" if len(hard) else "–"
        lines.append(f"| {name} | {shares.mean():.0%} | {shares.min():.0%} | {on_hard} | {kept:.0%} |")
    said = [one for row in rows for one in row["inside"] if one is not None]
    lines += [
        "",
        f"Measured speeds inside their predicted 90 % interval: {np.mean(said):.0%} of {len(said)}.",
        *told_of_found([one for row in rows for one in row["foretold"]]),
    ]
    return "\n".join(lines) + "\n"


def told_of_found(found: Sequence[dict[str, Any]]) -> list[str]:
    """Return how well the gaits were foretold that steps after a film had found."""
    if not found:
        return []
    within = [
        one["predicted_m_s"]["ci90"][0] <= one["true_m_s"] <= one["predicted_m_s"]["ci90"][1] for one in found
    ]
    means = [one["predicted_m_s"]["mean"] for one in found]
    bias = np.sum([one["true_m_s"] for one in found]) / np.sum(means)
    said, kept = (np.mean([one[key] for one in found]) for key in ("keeps_limits", "limits_kept"))
    return [
        "",
        f"Of {len(found)} gaits that a step had found and nobody filmed, {np.mean(within):.0%} have their",
        f"true speed inside the interval. Together they make {bias:.0%} of what was predicted. {kept:.0%}",
        f"keep the limits, where {said:.0%} were expected to.",
    ]


def write_plot(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Draw the share of each method, a dot for each robot."""
    names = list(rows[0]["shares"])
    figure, axes = single_panel(4.0)
    for row in rows:
        own = shares_of(row)
        shares = [own[name] for name in names]
        axes.plot(shares, range(len(names)), ".", color=COLOURS[int(row["hard"])], alpha=0.6)
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    finish(axes, "true speed over the best known", "", legend=False)
    path.write_bytes(png(figure))


def main() -> None:
    """Run the cases that are missing, and write the table and the plot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--cases", type=int, default=24)
    parser.add_argument("--seed", type=int, default=4)
    parser.add_argument("--problem", default="arcfold")
    parser.add_argument("--films", type=int, default=5)
    parser.add_argument("--budget", type=int, default=400)
    parser.add_argument("--truth", type=int, default=100, help="gaits of the search on the true robot")
    parser.add_argument("--filmed", action="store_true", help="through films of a synthetic phone")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--work", type=Path, required=True, help="where campaigns are kept")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    silence_warnings()
    problem = carrying(load_problem(options.problem))
    path = options.out / "cases.jsonl"
    rows = read_kept(path, options.seed)
    with opened("processes", options.workers) as pool:
        shared = Campaign.new(
            problem, options.work / "nominal", budget=options.budget, seed=options.seed, executor=pool
        )
        winner = shared.nominal_winner
        for index in range(options.cases):
            if index not in {row["case"] for row in rows}:
                rows.append(case(index, options, problem, winner, pool))
                write_kept(path, rows)
                write_text(options.out / "campaigns.md", page(rows, options.cases))
                write_plot(options.out / "shares.png", rows)
    print(page(rows, options.cases))


if __name__ == "__main__":
    main()
