"""Ways to simulate less, and the error of each: which were kept and which rejected.

    python tests/studies/shortcuts.py --out results/profile

On ArcFold at 2e-3 s, over quasi-random gaits and the neighbourhoods of planned ones, as a search sees them.
(1) End a rollout when two cycles move the robot equally: seconds saved, and the error if the last cycle's
motion is repeated, turned as the robot turns. (2) Judge a gait by a shorter window: how it ranks neighbours.
(3) Drop the worst of a neighbourhood after one scenario of three: how many of the best are lost, and the
seconds saved.

Cost: about 10 min of one core (estimated).
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rivals import COARSEST
from scipy.stats import spearmanr

from gaitopt.core.streams import Stream
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Outcome, judge
from gaitopt.optimise.quasi_random import quasi_random
from gaitopt.optimise.verification import scenarios_of
from gaitopt.plan.plan import Planner
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator

POPULATION = 12
"""Neighbours of a planned gait: as many as a population of CMA-ES."""

SPREAD = 0.05
"""Their standard deviation, in units of the box."""

TOLERANCES = (0.01, 0.02, 0.05)
WINDOWS = ((1.0, 2.0), (1.0, 3.0), (2.0, 4.0))
KEPT = (4, 6, 8)

Floats = NDArray[np.float64]


def cycles(gait: Gait, trajectory: Trajectory, count: int) -> tuple[Floats, Floats]:
    """Return forward and left travel of each cycle in the robot's own frame, m, and its turn, rad."""
    at = np.arange(count + 1) * gait.period_s
    marker = np.array([np.interp(at, trajectory.time, trajectory[f"marker.{axis}"]) for axis in "xy"]).T
    w, x, y, z = (trajectory[f"heading.{part}"] for part in "wxyz")
    yaw = np.unwrap(np.arctan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z)))
    yaw = np.interp(at, trajectory.time, yaw)
    moved = np.diff(marker, axis=0)
    cos, sin = np.cos(yaw[:-1]), np.sin(yaw[:-1])
    own = np.c_[cos * moved[:, 0] + sin * moved[:, 1], cos * moved[:, 1] - sin * moved[:, 0]]
    return own, np.diff(yaw)


def forward(own: Floats, turns: Floats, first: int) -> float:
    """Return forward travel of the cycles from `first` on, m."""
    yaw = np.concatenate([[0.0], np.cumsum(turns)[:-1]])
    moved = np.cos(yaw) * own[:, 0] - np.sin(yaw) * own[:, 1]
    return float(moved[first:].sum())


def steady(
    gaits: Sequence[Gait], trajectories: Sequence[Trajectory], problem: Problem
) -> list[dict[str, Any]]:
    """Return, by tolerance, the saving of ending at a periodic motion and the error of the speed."""
    rows = []
    for tolerance in TOLERANCES:
        whole = ended = 0.0
        errors = []
        for gait, trajectory in zip(gaits, trajectories, strict=True):
            transient, measured = problem.simulation.horizon.cycles(gait.period_s)
            count = transient + measured
            own, turns = cycles(gait, trajectory, count)
            alike = [_alike(own, turns, i, tolerance, gait.period_s) for i in range(1, count - 1)]
            stop = alike.index(True) + 2 if True in alike else count
            whole, ended = whole + count * gait.period_s, ended + stop * gait.period_s
            if stop < count:
                guess = own.copy(), turns.copy()
                guess[0][stop:], guess[1][stop:] = own[stop - 1], turns[stop - 1]
                wrong = forward(*guess, transient) - forward(own, turns, transient)
                errors.append(1e3 * wrong / (measured * gait.period_s))
        rows.append(
            {
                "tolerance": tolerance,
                "seconds_saved": 1.0 - ended / whole,
                "gaits_ended": len(errors) / len(gaits),
                "median_error_mm_s": float(np.median(np.abs(errors))),
                "largest_error_mm_s": float(np.abs(errors).max()),
            }
        )
    return rows


def _alike(own: Floats, turns: Floats, i: int, tolerance: float, period_s: float) -> bool:
    scale = max(np.abs(own[i]).max(), 0.002 * period_s)  # 2 mm/s: slower gaits are of no interest
    moved = np.linalg.norm(own[i] - own[i - 1]) < tolerance * scale
    return bool(moved and abs(turns[i] - turns[i - 1]) < 0.1 * tolerance * period_s)


def windowed(problem: Problem, window: tuple[float, float]) -> Problem:
    """Return the problem with another transient and measured time."""
    simulation = problem.file.simulation
    times = {"transient_s": window[0], "measured_s": window[1] - window[0], "measured_cycles": 1}
    horizon = simulation.horizon.model_copy(update=times)
    file = problem.file.model_copy(update={"simulation": simulation.model_copy(update={"horizon": horizon})})
    return Problem.from_file(file, problem.source, problem.model_path)


def within(groups: Sequence[Sequence[int]], one: Floats, other: Floats) -> float:
    """Return the mean of Spearman's rank correlation inside each group."""
    return float(np.mean([spearmanr(one[list(g)], other[list(g)]).statistic for g in groups]))


def main() -> None:
    """Measure and write the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    problem, rng = load_problem("arcfold"), np.random.default_rng(0)
    fidelity = problem.simulation.working.model_copy(update=COARSEST)
    points: list[Floats] = list(quasi_random(problem.space, 24, 5))
    groups = []
    for elite in Planner(problem).plan().elites:
        point = problem.space.encode(elite.gait)
        groups.append(range(len(points), len(points) + POPULATION))
        points += list(point + SPREAD * rng.standard_normal((POPULATION, len(point))))
    gaits = [problem.space.decode(point) for point in points]
    simulator = Simulator.build(problem, fidelity=fidelity)
    robot = Robot.of(simulator.models[0])
    trajectories = [simulator.run(gait) for gait in gaits]

    def costs(judged: Problem, ran: Sequence[Trajectory]) -> Floats:
        metrics = [measure(judged, gait, path, robot) for gait, path in zip(gaits, ran, strict=True)]
        return np.array(
            [judge(judged, [Outcome(m, p.status, 0.0)]).cost for m, p in zip(metrics, ran, strict=True)]
        )

    whole = costs(problem, trajectories)
    windows = {
        f"{a:g} to {b:g} s": within(groups, costs(windowed(problem, (a, b)), trajectories), whole)
        for a, b in WINDOWS
    }
    spread = Simulator.build(problem, scenarios_of(problem, 1, Stream.SEARCH_SCENARIOS), fidelity)
    single = np.array(
        [costs(problem, [spread.run(gait, s) for gait in gaits]) for s in range(len(spread.scenarios))]
    )
    mean = single.mean(axis=0)
    race = []
    for kept in KEPT:
        share = [
            np.isin(np.argsort(mean[list(g)])[:3], np.argsort(row[list(g)])[:kept]).mean()
            for g in groups
            for row in single
        ]
        saved = (1.0 - kept / POPULATION) * (1.0 - 1.0 / len(single))
        race.append(
            {"kept": kept, "of": POPULATION, "best_three_kept": float(np.mean(share)), "seconds_saved": saved}
        )
    result = {
        "gaits": len(gaits),
        "steady": steady(gaits, trajectories, problem),
        "rank_correlation_of_neighbours_by_window": windows,
        "rank_correlation_of_neighbours_by_one_scenario": float(
            np.mean([within(groups, row, mean) for row in single])
        ),
        "race": race,
    }
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "shortcuts.json").write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
