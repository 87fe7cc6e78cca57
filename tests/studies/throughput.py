"""Simulated seconds per wall second: the published loop, bare rollouts, the whole objective.

    python tests/studies/throughput.py --out results/throughput

(a) the published model with its published loop: Python, one `mj_step` and one command per step.
(b) the four baselines on the repaired model through `mujoco.rollout`, no sensors, buffers reused,
    output discarded, on one thread and on two.
(c) the same gaits through the whole objective, commands, sensors, metrics and cost, on one worker
    and on two.

All three run in turn, several times. Machines are noisy, so the medians of the ratios of each repeat count.

Cost: about 3 min of two cores (estimated).
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mujoco
import numpy as np
from mujoco.rollout import Rollout
from scipy import signal

from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import load_problem
from gaitopt.problem.start import START
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import NOMINAL
from gaitopt.simulation.setup import RobotSetup

COPIES = 4
"""How often each baseline is simulated in one turn of (b) and (c), so that two threads share evenly."""


def published_loop(duration: float) -> float:
    """Return simulated seconds per second of the published model and the published kind of loop."""
    model = build_model(load_problem("arcfold-published"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.keyframe(START).id)
    worm, foot, period = np.deg2rad(90), -np.deg2rad(90), 1.0
    positions = []
    began = time.perf_counter()
    while data.time < duration:
        angle = 2 * math.pi / period
        data.ctrl[0] = worm * (signal.square(angle * (data.time + period / 4), duty=0.5) + 1) / 2
        data.ctrl[1] = foot * (signal.square(angle * data.time, duty=0.5) + 1) / 2
        data.ctrl[2] = foot * (signal.square(angle * (data.time + period / 2), duty=0.5) + 1) / 2
        mujoco.mj_step(model, data)
        positions.append(data.body("end_effector").xpos[0])
    return duration / (time.perf_counter() - began)


class BareRollouts:
    """The baselines through `mujoco.rollout` only."""

    def __init__(self) -> None:
        problem = load_problem("arcfold")
        self.model = build_model(problem)
        simulator = Simulator.build(problem)
        data = mujoco.MjData(self.model)
        mujoco.mj_resetDataKeyframe(self.model, data, self.model.keyframe(START).id)
        full = mujoco.mjtState.mjSTATE_FULLPHYSICS.value
        start = np.empty(mujoco.mj_stateSize(self.model, full))
        mujoco.mj_getState(self.model, data, start, full)
        self.jobs = []
        for gait in problem.baselines.values():
            clock = simulator.clock(simulator.duration(gait))
            commands = np.tile(gait.targets(clock)[None], (COPIES, 1, 1))
            states = np.empty((COPIES, len(clock), len(start)))
            self.jobs.append((np.tile(start, (COPIES, 1)), commands, states))
        self.simulated = COPIES * sum(simulator.duration(g) for g in problem.baselines.values())

    def __call__(self, threads: int) -> float:
        """Return simulated seconds per second on some threads."""
        data = [mujoco.MjData(self.model) for _ in range(threads)]
        with Rollout(nthread=threads if threads > 1 else 0) as rollout:
            began = time.perf_counter()
            for start, commands, states in self.jobs:
                rollout.rollout(self.model, data, start, commands, state=states)
            return self.simulated / (time.perf_counter() - began)


class WholeObjective:
    """The baselines through commands, rollouts, metrics and cost."""

    def __init__(self) -> None:
        problem = load_problem("arcfold")
        self.setting = RobotSetup.of(problem, (NOMINAL,) * COPIES, problem.simulation.working)
        self.gaits = list(problem.baselines.values())
        Evaluator(self.setting, SerialExecutor())(self.gaits)  # compiles

    def __call__(self, workers: int) -> float:
        """Return simulated seconds per second on some workers."""
        with SerialExecutor() if workers == 1 else ThreadPoolExecutor(workers) as executor:
            evaluator = Evaluator(self.setting, executor)
            evaluator(self.gaits)  # each thread's own data, as in (b) before the clock starts
            began = time.perf_counter()
            judged = evaluator(self.gaits)
            wall = time.perf_counter() - began
        return sum(one.simulated_s for one in judged) / wall


def main() -> None:
    """Run the benchmark and write its table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--turns", type=int, default=7)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    bare, whole = BareRollouts(), WholeObjective()
    turns = []
    for _ in range(options.turns):
        turns.append(
            {
                "a": published_loop(0.2),
                "b1": bare(1),
                "c1": whole(1),
                "b2": bare(2),
                "c2": whole(2),
            }
        )
        print({name: round(value, 2) for name, value in turns[-1].items()}, flush=True)
    median = {name: float(np.median([turn[name] for turn in turns])) for name in turns[0]}
    ratios = {
        "c1/b1": float(np.median([turn["c1"] / turn["b1"] for turn in turns])),
        "c2/b2": float(np.median([turn["c2"] / turn["b2"] for turn in turns])),
        "c1/a": float(np.median([turn["c1"] / turn["a"] for turn in turns])),
    }
    result = {
        "simulated_s_per_s": median,
        "ratios": ratios,
        "turns": turns,
        "mujoco": mujoco.__version__,
        "python": platform.python_version(),
    }
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "throughput.json").write_text(json.dumps(result, indent=1) + "\n")
    print(json.dumps({"simulated_s_per_s": median, "ratios": ratios}, indent=1))


if __name__ == "__main__":
    main()
