"""What the planar warm start is worth: evaluations and simulated seconds to a good gait, warm and cold.

    python tests/studies/warm_start.py --out results/warm-start

Both searches run the default method on `problems/arcfold`, one nominal scenario, working fidelity. The target
is a share of the best cost known for the problem (the best of every run here and of the long searches given
with `--known`). The expected running time is the total effort divided by the number of successes (Hansen et
al., COCO). The time of the plan counts as the seconds that the same core would have simulated in it. Each run
is stored when it ends, and a second call continues.

Cost: about 10 min of two cores (estimated from its simulated seconds).
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from searches import judged, planned, search

from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.executors import open_executor
from gaitopt.problem.problem import load_problem
from gaitopt.report.figures.style import COLOURS
from gaitopt.simulation.scenario import NOMINAL
from gaitopt.simulation.setup import RobotSetup

TARGETS = (0.8, 0.9, 0.95)


def run(seed: int, warm: bool, budget: int) -> dict[str, object]:
    """Return the costs and simulated seconds of one search, in order, and the plan's wall seconds."""
    problem = load_problem("arcfold")
    setting = RobotSetup.of(problem, (NOMINAL,), problem.simulation.working)
    began = time.process_time()
    elites = planned(problem, seed) if warm else ()
    plan_s = time.process_time() - began if warm else 0.0
    with open_executor("threads") as executor:
        evaluator = Evaluator(setting, executor)
        starts = judged(evaluator)
        began = time.process_time()
        study = search(evaluator, budget, seed, starts, elites)
        search_s = time.process_time() - began
    simulated = [entry.simulated_s for entry in study.entries]
    return {
        "seed": seed,
        "warm": warm,
        "costs": [entry.evaluation.cost for entry in study.entries],
        "simulated_s": simulated,
        "plan_s": plan_s,
        "simulated_s_per_cpu_s": sum(simulated) / search_s,
    }


def spent_until(record: dict[str, object], target: float) -> tuple[float, float, bool]:
    """Return evaluations and simulated seconds (plan included) until the cost is reached."""
    costs, simulated = np.array(record["costs"]), np.array(record["simulated_s"])
    charged = float(record["plan_s"]) * float(record["simulated_s_per_cpu_s"])  # type: ignore[arg-type]
    hits = np.flatnonzero(costs <= target)
    count = int(hits[0]) + 1 if len(hits) else len(costs)
    return count, charged + float(simulated[:count].sum()), len(hits) > 0


def expected_running_time(records: list[dict[str, object]], target: float) -> dict[str, float | None]:
    """Return the total effort divided by the number of successes."""
    spent = [spent_until(record, target) for record in records]
    successes = sum(success for *_, success in spent)
    evaluations, seconds = (sum(row[i] for row in spent) for i in (0, 1))
    return {
        "runs": len(records),
        "successes": successes,
        "evaluations": evaluations / successes if successes else None,
        "simulated_s": seconds / successes if successes else None,
    }


def main() -> None:
    """Run what is missing, then write table and plot."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=15)
    parser.add_argument("--budget", type=int, default=400)
    parser.add_argument("--known", type=float, help="lowest cost known from longer searches")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    runs = options.out / "runs"
    runs.mkdir(parents=True, exist_ok=True)
    records = []
    for seed in range(options.seeds):
        for warm in (True, False):
            path = runs / f"{'warm' if warm else 'cold'}-{seed}.json"
            if not path.exists():
                path.write_text(json.dumps(run(seed, warm, options.budget)))
                print(path, flush=True)
            records.append(json.loads(path.read_text()))
    best = min([min(record["costs"]) for record in records] + ([options.known] if options.known else []))
    table = {"best_known_cost": best, "targets": {}}
    for share in TARGETS:
        row = {
            name: expected_running_time([r for r in records if r["warm"] is warm], share * best)
            for name, warm in (("warm", True), ("cold", False))
        }
        table["targets"][str(share)] = row
    (options.out / "warm-start.json").write_text(json.dumps(table, indent=1) + "\n")
    print(json.dumps(table, indent=1))
    figure, axes = plt.subplots(figsize=(7.0, 4.2), layout="constrained")
    for index, (name, warm) in enumerate((("warm", True), ("cold", False))):
        leaders = np.array([np.minimum.accumulate(r["costs"]) for r in records if r["warm"] is warm])
        low, middle, high = np.quantile(-1e3 * leaders, (0.1, 0.5, 0.9), axis=0)
        number = np.arange(1, leaders.shape[1] + 1)
        axes.plot(number, middle, "-" if warm else "--", color=COLOURS[index], label=f"{name}, median")
        axes.fill_between(number, low, high, color=COLOURS[index], alpha=0.2, label=f"{name}, 10 to 90 %")
    axes.axhline(-1e3 * 0.9 * best, color="0.4", linewidth=1.0, linestyle=":", label="90 % of the best known")
    axes.set_xlabel("gaits evaluated")
    axes.set_ylabel("best so far, speed less penalties [mm/s]")
    axes.set_ylim(-20.0, -1.1e3 * best)
    axes.legend(fontsize=8)
    axes.grid(color="0.85", linewidth=0.6)
    figure.savefig(options.out / "warm-start.png", dpi=110)


if __name__ == "__main__":
    main()
