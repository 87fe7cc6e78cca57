"""How does friction change the quadruped's walk, and where should it, by physics?

    python tests/studies/friction.py --out results/quadruped

`problems/quadruped`, whose MJCF says nothing of priorities, with `mu_pads` from 0.1 to 1.2: the drafted gaits
on flat ground, the trot at multiples of its period, and the walk uphill. Each row of friction.csv is the mean
over eight start poses at the working fidelity: robots are nominal, so that friction alone differs. Rows that
are there already are kept.

Cost: 10 min of one core.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from kept_table import KeptTable, Row

from gaitopt.core.statistics import half_width90
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario

MUS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.2)
POSES = 8
CASES = (
    ("trot", 1, 0.0),
    ("walk", 1, 0.0),
    ("bound", 1, 0.0),
    ("trot", 2, 0.0),
    ("trot", 4, 0.0),
    ("trot", 8, 0.0),
    ("walk", 1, 8.0),
)
"""Gait, multiple of its period, and slope of the ground, degrees uphill."""


def pushed(problem: Problem, path: Trajectory, period_s: float, weight: float) -> float:
    """Return the mean force by which pads push the robot forward in the last two cycles, over its weight.

    Other pads brake it with the same mean force, or the robot would speed up.
    """
    last = path.time > path.time[-1] - 2.0 * period_s
    forces = [path[f"load.{pad}.x"][last] for pad in problem.roles.pads]
    return float(sum(np.maximum(force, 0.0).mean() for force in forces)) / weight


def row(problem: Problem, gait: str, times: int) -> Iterator[Row]:
    """Return what a gait does on average."""
    drive = problem.baselines[gait]
    drive = drive.with_period(times * drive.period_s)
    poses = tuple(Scenario(start_pose_rad=0.005, pose_seed=seed) for seed in range(POSES))
    simulator = Simulator.build(problem, poses)
    robot = Robot.of(simulator.models[0])
    paths = [simulator.run(drive, pose) for pose in range(POSES)]
    walks = [measure(problem, drive, path, robot) for path in paths]
    push = np.mean([pushed(problem, path, drive.period_s, robot.weight) for path in paths])
    speeds = np.array([walk["speed_m_s"] for walk in walks])
    yield {
        "mm_s": f"{1e3 * speeds.mean():.2f}",
        "ci90_mm_s": f"{1e3 * half_width90(speeds):.2f}",
        "mm_a_cycle": f"{1e3 * speeds.mean() * drive.period_s:.2f}",
        "slip_mm_a_cycle": f"{1e3 * np.mean([walk['slip_m'] for walk in walks]):.2f}",
        "push_over_weight": f"{push:.3f}",
    }


def main() -> None:
    """Fill the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    table = KeptTable(out / "friction.csv", ("gait", "periods", "slope_deg", "mu"))
    for gait, times, slope in CASES:
        for mu in MUS:
            problem = load_problem("quadruped").with_parameters({"mu_pads": mu})
            if slope:
                problem = problem.with_effects({"ground_slope": {"angle_rad": float(np.deg2rad(slope))}})
            key = {"gait": gait, "periods": str(times), "slope_deg": f"{slope:g}", "mu": f"{mu:g}"}
            table.fill(key, partial(row, problem, gait, times))


if __name__ == "__main__":
    main()
