"""Core-seconds that one parameter set of each effect costs a diagnosis.

    python tests/studies/effects_speed.py --out results/effects

For one parameter set, a fit builds the robot with the effect, lets it come to rest, and simulates the four
baselines for 12 s each at the working fidelity, on one core. CPU time of the process, the median of several
repeats over all effects. The goal is less than one core-second.

Cost: about 5 min of one core (estimated).
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import time
from pathlib import Path

import mujoco
import numpy as np

from gaitopt.effects import EFFECTS
from gaitopt.problem.model import nominal_parts
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.rollout import Simulator

TRIAL_S = 12.0


def parameter_set(problem: Problem) -> tuple[float, float]:
    """Return the CPU time of building the robot and of its four trials, s."""
    began = time.process_time()
    simulator = Simulator.build(problem)
    built = time.process_time()
    for gait in problem.baselines.values():
        simulator.observe(simulator.run(gait, duration=TRIAL_S))
    return built - began, time.process_time() - built


def problems() -> dict[str, Problem]:
    """Return the nominal robot, and one with each effect at a plausible value."""
    nominal = load_problem("arcfold")
    parts = nominal_parts(nominal)
    found = {"none": nominal}
    for name, effect in EFFECTS.items():
        low, high = effect.bounds(parts)
        value = math.sqrt(low * high) if effect.scale == "log" else low + 0.3 * (high - low)
        if value == effect.neutral_value(parts):
            value *= 1.1
        table: dict[str, float | str] = {effect.parameter: value}
        if effect.target == "one":
            table["target"] = nominal.channel_names[0]
        found[name] = nominal.with_effects({name: table})
    return found


def main() -> None:
    """Run the benchmark and write its table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    asked = problems()
    costs: dict[str, list[tuple[float, float]]] = {name: [] for name in asked}
    for turn in range(options.turns):
        for name, problem in asked.items():
            costs[name].append(parameter_set(problem))
        print(f"turn {turn + 1} of {options.turns} done", flush=True)
    medians = {name: np.median(rows, axis=0) for name, rows in costs.items()}
    table = {
        name: {
            "build_s": round(float(b), 3),
            "trials_s": round(float(t), 3),
            "core_s": round(float(b + t), 3),
        }
        for name, (b, t) in medians.items()
    }
    slowest = max(table, key=lambda name: table[name]["core_s"])
    result = {
        "command": f"python tests/studies/effects_speed.py --turns {options.turns} --out results/effects",
        "what": "CPU seconds of one parameter set: build, settle, four baselines of 12 s at working fidelity",
        "goal_core_s": 1.0,
        "slowest": {"name": slowest} | table[slowest],
        "effects": table,
        "mujoco": mujoco.__version__,
        "python": platform.python_version(),
        "machine": platform.machine(),
    }
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "speed.json").write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps(result["slowest"]))


if __name__ == "__main__":
    main()
