"""How alike is what simulation gets wrong of two gaits, by how far apart these are in the gait space?

Robots that are a little wrong in everything, by the problem's tolerances, walk with some gaits and with gaits
near these. What the nominal robot gets wrong of the speed of each, and of its drift, is the discrepancy. Half
of the mean square by which it differs between two gaits, over its own mean square, is 0 where one gait tells
all of the other one, and 1 where it tells nothing (the semivariogram of geostatistics).

    python tests/studies/discrepancy.py --out results/campaigns

Cost: about 4 min of two slow cores for ArcFold, the quadruped and the snake.
"""

from __future__ import annotations

import argparse
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import pdist

from gaitopt.campaign.course import drifts_of
from gaitopt.campaign.gaussian_process import matern
from gaitopt.campaign.robots import walked
from gaitopt.campaign.settings import BELIEF
from gaitopt.core.files import write_text
from gaitopt.core.json import to_json
from gaitopt.gait.gait import Gait
from gaitopt.gait.table import read_gait_file
from gaitopt.jobs.executor import opened
from gaitopt.optimise.solvers.surrogate import embedded
from gaitopt.problem.model import carrying, nominal_parts
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.report.figures.style import COLOURS, finish, single_panel
from gaitopt.report.page import png
from gaitopt.robot.warnings import silence_warnings
from gaitopt.simulation.scenario import NOMINAL, Scenario
from gaitopt.simulation.tolerances import draw_errors

Array = NDArray[np.float64]

PROBLEMS = ("arcfold", "quadruped", "snake")
"""Each with the winner of its reference run, and at most three of its hand-tuned gaits."""

NEAR = (0.03, 0.06, 0.1, 0.15, 0.2, 0.3)
"""Distances of the gaits that are near these, two each, in a random direction."""

EDGES = (0.0, 0.05, 0.09, 0.13, 0.17, 0.25, 0.45, 0.8, 3.0)
"""Between which distances pairs of gaits are taken together."""


@dataclass(frozen=True)
class Discrepancy:
    """What simulation gets wrong.

    Attributes:
        apart: distance of each pair of gaits, shape (pairs,).
        size: root mean square of the discrepancy.
        differs: half of the square by which it differs between the two, over its mean square; mean over the
            robots, shape (pairs,).
    """

    apart: Array
    size: float
    differs: Array

    @staticmethod
    def of(wrong: Array, points: Array) -> Discrepancy:
        """Return it from what is wrong, shape (robots, gaits), of gaits at points, shape (gaits, d)."""
        first, second = np.triu_indices(wrong.shape[1], 1)
        squares = 0.5 * np.mean((wrong[:, first] - wrong[:, second]) ** 2, axis=0)
        total = float(np.mean(wrong**2))
        return Discrepancy(pdist(points), total**0.5, squares / total)

    def rows(self) -> list[dict[str, float]]:
        """Return the mean of the pairs that are about as far apart."""
        rows = []
        for low, high in pairwise(EDGES):
            chosen = (self.apart > low) & (self.apart <= high)
            if chosen.any():
                mean = {"apart": self.apart[chosen].mean(), "differs": self.differs[chosen].mean()}
                rows.append({key: float(value) for key, value in mean.items()} | {"pairs": int(chosen.sum())})
        return rows


def wrong_robot(problem: Problem, number: int) -> Scenario:
    """Return a robot that is a little wrong in everything, from a start pose of its own."""
    tolerances = problem.file.tolerances
    errors = draw_errors(nominal_parts(problem), tolerances, np.random.default_rng([77, number]))
    return Scenario(errors, start_pose_rad=tolerances.start_pose_rad, pose_seed=number)


def gaits_of(problem: Problem, results: Path) -> list[Gait]:
    """Return the winner, hand-tuned gaits, and gaits near these."""
    space, rng = problem.space, np.random.default_rng(5)
    winner = read_gait_file(results / problem.name / "best.toml")
    points = []
    for gait in [winner, *list(problem.baselines.values())[:3]]:
        at = space.encode(gait)
        points.append(at)
        for far in (*NEAR, *NEAR):
            direction = rng.standard_normal(len(at))
            points.append(np.clip(space.wrap(at + far * direction / np.linalg.norm(direction)), 0.0, 1.0))
    return [space.decode(point) for point in points]


def measured(name: str, robots: int, results: Path, pool: Executor) -> dict[str, Discrepancy]:
    """Return the discrepancies of a problem: of the speed, and of the drift."""
    problem = carrying(load_problem(name))
    gaits = gaits_of(problem, results)
    points = embedded(np.array([problem.space.encode(gait) for gait in gaits]), problem.space.circular)
    scenarios = [NOMINAL, *(wrong_robot(problem, number) for number in range(robots))]
    found = walked(problem, gaits, scenarios, pool)
    each = {"speed": found.speeds, "drift": drifts_of(found)}
    return {kind: Discrepancy.of(values[1:] - values[0], points) for kind, values in each.items()}


def expected(apart: Array) -> Array:
    """Return how much a campaign expects discrepancies to differ at some distances, shape (n,)."""
    differs: Array = 1.0 - matern(np.zeros((1, 1)), apart[:, None], BELIEF.length)[0]
    return differs


def page(found: dict[str, dict[str, Discrepancy]]) -> str:
    """Return the tables."""
    lines = [
        "# How alike the discrepancies of near gaits are",
        "",
        "See `tests/studies/discrepancy.py`. 0: one gait tells all of the other one; 1: it tells nothing.",
        "",
        "| robot | of | distance | pairs | differs | a campaign expects |",
        "|---|---|---|---|---|---|",
    ]
    for name, kinds in found.items():
        for kind, one in kinds.items():
            for row in one.rows():
                (differs,) = expected(np.array([row["apart"]]))
                figures = f"{row['apart']:.3f} | {row['pairs']} | {row['differs']:.2f} | {differs:.2f}"
                lines.append(f"| {name} | {kind} | {figures} |")
    return "\n".join(lines) + "\n"


def write_plot(path: Path, found: dict[str, dict[str, Discrepancy]]) -> None:
    """Draw how the discrepancies differ with the distance."""
    figure, axes = single_panel(4.0)
    for colour, (name, kinds) in zip(COLOURS, found.items(), strict=False):
        for (kind, one), style in zip(kinds.items(), ("o-", "s--"), strict=True):
            rows = one.rows()
            ends = [row["apart"] for row in rows], [row["differs"] for row in rows]
            axes.plot(*ends, style, color=colour, label=f"{name}, {kind}", markersize=4)
    at = np.linspace(0.0, 1.5, 200)
    axes.plot(at, expected(at), color="black", label=f"Matérn, length {BELIEF.length:g}")
    axes.set_xlim(0.0, 1.5)
    axes.set_ylim(0.0, 2.0)
    finish(axes, "distance of two gaits in the gait space", "discrepancy differs, share")
    path.write_bytes(png(figure))


def main() -> None:
    """Measure, and write the table and the plot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--robots", type=int, default=6)
    parser.add_argument("--results", type=Path, default=Path("results"), help="where the winners are")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    silence_warnings()
    with opened("processes", 2) as pool:
        found = {name: measured(name, options.robots, options.results, pool) for name in PROBLEMS}
    rows = {
        n: {k: {"size": one.size, "rows": one.rows()} for k, one in ks.items()} for n, ks in found.items()
    }
    write_text(options.out / "discrepancy.json", to_json(rows))
    write_text(options.out / "discrepancy.md", page(found))
    write_plot(options.out / "discrepancy.png", found)
    print(page(found))


if __name__ == "__main__":
    main()
