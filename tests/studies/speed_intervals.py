"""How often the interval of a speed over robots holds that of a robot of other numerics, with known effects.

    python tests/studies/speed_intervals.py --out results/blind

Each robot has one effect of a random size. Its speed in a fast gait is predicted with that effect: by robots
that differ in their start pose alone, and by robots as a diagnosis draws them. The true robot has another
integrator, timestep and cone stiffness, a start pose of its own, and errors of masses and hinges. What a
diagnosis does not know of the effect, and what no effect explains, are no part of these intervals.

Cost: about 15 minutes of one core, on a slow machine.
"""

from __future__ import annotations

import argparse
import copy
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from gaitopt.blind.settings import DEFAULT
from gaitopt.core.files import write_text
from gaitopt.core.statistics import spread90
from gaitopt.diagnose.fit.hypotheses import Hypothesis, hypotheses
from gaitopt.diagnose.judge.small_errors import is_finer, perturbed_scenarios, with_small_errors
from gaitopt.diagnose.predictions import PredictionSettings
from gaitopt.effects.active import EffectValue
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import assess_all
from gaitopt.optimise.executors import open_executor
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.simulation.metrics import SPEED, measure
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario
from gaitopt.simulation.setup import RobotSetup
from gaitopt.simulation.tolerances import NO_ERRORS

Array = NDArray[np.float64]
Interval = tuple[float, float]

GAITS = ("square-1s", "square-0.5s")
BEFORE = 16
"""Robots of a prediction formerly."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--robots", type=int, default=40)
    parser.add_argument("--seed", type=int, default=4)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    problem, rng = load_problem("arcfold"), np.random.default_rng(options.seed)
    nominal = Simulator.build(problem)
    parts, channels = nominal.effects.nominal, problem.channel_names
    known = [h for h in hypotheses(parts, channels, offset_known=True) if h.effect.changes_robot]
    held: dict[str, list[bool]] = {}
    widths: dict[str, list[float]] = {}
    with open_executor("threads", None) as executor:
        for _ in range(options.robots):
            effect = _drawn(known, rng)
            for gait in (problem.baselines[name] for name in GAITS):
                true = _true_speed(problem, effect, gait, rng)
                for way, (low, high) in _intervals(nominal, effect, gait, executor, rng):
                    held.setdefault(way, []).append(low <= true <= high)
                    widths.setdefault(way, []).append(high - low)
    text = _table(held, widths)
    write_text(options.out / "speed-intervals.md", text)
    print(text)


def _drawn(known: list[Hypothesis], rng: np.random.Generator) -> EffectValue:
    """Return one effect of a random size: each effect is as likely as the others, whatever its targets."""
    names = sorted({h.effect.name for h in known})
    name = names[int(rng.integers(len(names)))]
    targets = [h for h in known if h.effect.name == name]
    chosen = targets[int(rng.integers(len(targets)))]
    return EffectValue(name, chosen.target, chosen.value(float(rng.uniform(chosen.low, chosen.high))))


def _true_speed(problem: Problem, effect: EffectValue, gait: Gait, rng: np.random.Generator) -> float:
    """Return the speed of a robot of other numerics, m/s."""
    fidelity = DEFAULT.fidelities[int(rng.integers(len(DEFAULT.fidelities)))]
    pose = Scenario(start_pose_rad=problem.file.tolerances.start_pose_rad, pose_seed=int(rng.integers(2**31)))
    robot = Simulator.build(problem.as_robot((effect,)), (pose,), fidelity)
    model = with_small_errors(copy.copy(robot.models[0]), robot, rng)
    model.opt.impratio = float(rng.choice(DEFAULT.impratios))
    mujoco.mj_setConst(model, mujoco.MjData(model))
    robot = robot.with_model(model)
    return measure(problem, gait, robot.run(gait), Robot.of(model))[SPEED.name]


def _intervals(
    nominal: Simulator, effect: EffectValue, gait: Gait, executor: Executor, rng: np.random.Generator
) -> Iterator[tuple[str, Interval]]:
    """Yield the interval of a speed by each way to make it, m/s."""
    problem, fidelity = nominal.problem, nominal.fidelity
    made = perturbed_scenarios(nominal, int(rng.integers(2**31)), PredictionSettings().robots)
    drawn = [replace(one, effects=(effect,)) for one in made]
    posed = [replace(one, errors=NO_ERRORS) for one in drawn]
    plain = RobotSetup.of(problem, posed, fidelity)
    usual, finer = (RobotSetup.of(problem, drawn, one) for one in (fidelity, fidelity.scaled(0.5)))

    def speeds(setup: Callable[[int], RobotSetup]) -> Array:
        work = [(setup(index), gait, index) for index in range(len(drawn))]
        return np.array([one.metrics[SPEED.name] for one in assess_all(work, executor)])

    posed_speeds = speeds(lambda index: plain)
    low, high = np.nanquantile(posed_speeds[:BEFORE], (0.05, 0.95))
    yield f"{BEFORE} start poses, quantiles between the outermost", (float(low), float(high))
    yield f"{len(drawn)} start poses", spread90(posed_speeds)
    yield (
        f"{len(drawn)} start poses, small errors, two timesteps",
        spread90(speeds(lambda index: finer if is_finer(index) else usual)),
    )


def _table(held: dict[str, list[bool]], widths: dict[str, list[float]]) -> str:
    rows = [
        "| robots that are simulated | true speeds inside the 90 % interval | its median width, mm/s |",
        "|---|---|---|",
    ]
    for way, inside in held.items():
        between = binomtest(sum(inside), len(inside)).proportion_ci(0.9, method="wilson")
        found = f"{np.mean(inside):.0%} ({between.low:.0%} to {between.high:.0%}, {len(inside)} speeds)"
        rows.append(f"| {way} | {found} | {1e3 * float(np.median(widths[way])):.1f} |")
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    main()
