"""What a step costs, how the cost divides, and what cheaper choices lose in accuracy.

    python tests/studies/profile_step.py --out results/profile

The parts of a step are MuJoCo's own timers, read in a loop from Python, so their sum is more than the cost of
a step in a compiled rollout. Only their shares count. Choices are compared over the baselines and planned
gaits and their neighbours: rank correlation (Spearman) and error of speed and cost against 5e-4 s, and the
processor time of a step.

Cost: about 10 min of one core (estimated).
"""

from __future__ import annotations

import argparse
import copy
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Outcome, judge
from gaitopt.optimise.quasi_random import quasi_random
from gaitopt.plan.plan import Planner
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.problem.start import START
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator

PARTS = {
    "kinematics": "POS_KINEMATICS",
    "inertia": "POS_INERTIA",
    "collision": "POS_COLLISION",
    "building constraints": "POS_MAKE",
    "projecting constraints": "POS_PROJECT",
    "velocities": "VELOCITY",
    "actuation": "ACTUATION",
    "constraint solver": "CONSTRAINT",
    "integration": "ADVANCE",
}
"""Parts of a step, and MuJoCo's timers of them."""

BLIND = 0.05
"""Gaits slower than this, m/s, are of no interest: errors are those of faster gaits."""

STEPS, TURNS = 2000, 15
"""Steps of a gait that are timed, and how often."""

Edit = Callable[[mujoco.MjModel], None]


def parts(simulator: Simulator, gait: Gait) -> dict[str, float]:
    """Return microseconds per step by part, and the saving without sensors: the least of `TURNS`.

    MuJoCo's timers are clocks, so other work on the machine adds to them.
    """
    model = simulator.models[0]
    bare = _with(model, _without_sensors)
    commands = gait.targets(simulator.clock(simulator.duration(gait)))[:STEPS]
    turns, whole, without = [], [], []
    for _ in range(TURNS):
        data = mujoco.MjData(model)
        whole.append(_stepped(model, data, commands))
        without.append(_stepped(bare, mujoco.MjData(bare), commands))
        timers = [data.timer[getattr(mujoco.mjtTimer, f"mjTIMER_{key}").value] for key in PARTS.values()]
        turns.append([1e6 * timer.duration / len(commands) for timer in timers])
    least = np.min(turns, axis=0).tolist()
    return dict(zip(PARTS, least, strict=True)) | {"sensors": max(0.0, min(whole) - min(without))}


def _stepped(model: mujoco.MjModel, data: mujoco.MjData, commands: NDArray[np.float64]) -> float:
    """Step through commands and return microseconds per step."""
    mujoco.mj_resetDataKeyframe(model, data, model.keyframe(START).id)
    began = time.process_time()
    for row in commands:
        data.ctrl[:] = row
        mujoco.mj_step(model, data)
    return 1e6 * (time.process_time() - began) / len(commands)


def _without_sensors(model: mujoco.MjModel) -> None:
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR


def _dense(model: mujoco.MjModel) -> None:
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE


def _loose(model: mujoco.MjModel) -> None:
    model.opt.tolerance = 1e-5


def _few_iterations(model: mujoco.MjModel) -> None:
    model.opt.iterations = 2


def _conjugate_gradient(model: mujoco.MjModel) -> None:
    model.opt.solver = mujoco.mjtSolver.mjSOL_CG


def _one_island(model: mujoco.MjModel) -> None:
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND


def _pyramidal(model: mujoco.MjModel) -> None:
    model.opt.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL


def _nothing(model: mujoco.MjModel) -> None:
    pass


CHOICES: dict[str, tuple[float, Edit]] = {
    "5e-4 s (against which all are held)": (5e-4, _nothing),
    "1e-3 s (working)": (1e-3, _nothing),
    "2e-3 s": (2e-3, _nothing),
    "4e-3 s": (4e-3, _nothing),
    "1e-3 s, dense Jacobian": (1e-3, _dense),
    "1e-3 s, solver tolerance 1e-5": (1e-3, _loose),
    "1e-3 s, two solver iterations": (1e-3, _few_iterations),
    "1e-3 s, conjugate gradients": (1e-3, _conjugate_gradient),
    "1e-3 s, no islands": (1e-3, _one_island),
    "1e-3 s, pyramidal cone": (1e-3, _pyramidal),
}
"""One choice: a timestep and an edit of the model."""


def _with(model: mujoco.MjModel, edit: Edit) -> mujoco.MjModel:
    edited = copy.copy(model)
    edit(edited)
    return edited


def choice(
    problem: Problem, gaits: Sequence[Gait], timestep_s: float, edit: Edit
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return speed, m/s, and cost of each gait, and microseconds per step of complete rollouts."""
    fidelity = problem.simulation.working.model_copy(update={"timestep_s": timestep_s})
    simulator = Simulator.build(problem, fidelity=fidelity)
    edit(simulator.models[0])
    robot = Robot.of(simulator.models[0])
    simulator.run(gaits[0])
    rows, steps, began = [], 0, time.process_time()
    for gait in gaits:
        trajectory = simulator.run(gait)
        steps += len(simulator.clock(simulator.duration(gait)))
        metrics = measure(problem, gait, trajectory, robot)
        cost = judge(problem, [Outcome(metrics, trajectory.status, 0.0)]).cost
        rows.append((metrics["speed_m_s"], cost))
    spent = time.process_time() - began
    return *np.array(rows).T, 1e6 * spent / steps


def gaits_of(problem: Problem, neighbours: int) -> list[Gait]:
    """Return the baselines, quasi-random gaits, planned ones and their neighbours."""
    rng, space = np.random.default_rng(0), problem.space
    points = list(quasi_random(space, 24, 5))
    for elite in Planner(problem).plan().elites:
        point = space.encode(elite.gait)
        points += [point, *(point + 0.05 * rng.standard_normal(len(point)) for _ in range(neighbours))]
    return [*problem.baselines.values(), *(space.decode(point) for point in points)]


def main() -> None:
    """Measure and write the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--neighbours", type=int, default=4)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    problem = load_problem("arcfold")
    simulator = Simulator.build(problem)
    result: dict[str, Any] = {
        "parts_us": {name: parts(simulator, gait) for name, gait in problem.baselines.items()},
        "choices": {},
    }
    gaits = gaits_of(problem, options.neighbours)
    reference: NDArray[np.float64] | None = None
    for name, (timestep_s, edit) in CHOICES.items():
        speeds, costs, us = choice(problem, gaits, timestep_s, edit)
        if reference is None:
            reference, reference_costs = speeds, costs
        fast = reference > BLIND
        errors = speeds[fast] / reference[fast] - 1.0
        result["choices"][name] = {
            "us_per_step": us,
            "simulated_s_per_cpu_s": 1e6 * timestep_s / us,
            "rank_correlation_speed": float(spearmanr(speeds, reference).statistic),
            "rank_correlation_cost": float(spearmanr(costs, reference_costs).statistic),
            "median_error": float(np.median(errors)),
            "median_size_of_error": float(np.median(np.abs(errors))),
            "largest_error": float(np.abs(errors).max()),
        }
        print(name, {k: round(v, 4) for k, v in result["choices"][name].items()}, flush=True)
    result["gaits"], result["mujoco"] = len(gaits), mujoco.__version__
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "profile.json").write_text(json.dumps(result, indent=1) + "\n")
    for gait, found in result["parts_us"].items():
        print(gait, {name: round(us, 2) for name, us in found.items()})


if __name__ == "__main__":
    main()
