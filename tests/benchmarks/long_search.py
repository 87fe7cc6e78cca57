"""How much better is the best gait that 20,000 evaluations find than the winner of a plain run?

    python tests/benchmarks/long_search.py --out results/long-search

One nominal scenario of ArcFold, the file's horizon, the coarsest step whose ranking holds. Half of the gaits
go to CMA-ES from the best planned elite, half to CMA-ES from the best of 1,000 quasi-random gaits; both
restart with doubled populations at random points. The winner, and those of plain runs named by ``--runs``,
are then simulated in 32 scenarios that no search has seen, at the working fidelity.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from rivals import COARSEST

from gaitopt.files import write_text
from gaitopt.gait import write_gait
from gaitopt.optimise import cma_es
from gaitopt.optimise.evaluator import Evaluator, Setting
from gaitopt.optimise.executors import open_executor
from gaitopt.optimise.solution import Box
from gaitopt.optimise.study import quasi_random
from gaitopt.plan import Planner
from gaitopt.problem import load_problem
from gaitopt.rollout import NOMINAL, draw_scenarios

FIRST = 1000
SCENARIOS = 32


def main() -> None:
    """Search, compare, and write ``long-search.json`` and the winner."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--budget", type=int, default=20_000)
    parser.add_argument("--runs", nargs="*", default=["results/arcfold"], help="run folders to compare with")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    problem = load_problem("arcfold")
    space, working = problem.space, problem.simulation.working
    box, margin = Box(space.circular), problem.file.objective.search_margin
    with open_executor("threads", None) as executor:
        fast = Setting.of(problem, (NOMINAL,), working.model_copy(update=COARSEST))
        evaluator = Evaluator(fast, executor, margin)

        def costs(points: np.ndarray) -> np.ndarray:
            return np.array([e.cost for e, _ in evaluator([space.decode(point) for point in points])])

        elites = np.array([space.encode(elite.gait) for elite in Planner(problem).plan().elites])
        drawn = quasi_random(space, FIRST, 1)
        found = {}
        for name, points, spent in (("planned", elites, 0), ("cold", drawn, FIRST)):
            start = points[costs(points).argmin()]
            rng = np.random.default_rng([20, spent])
            found[name] = cma_es.minimise(costs, box, start, 0.15, options.budget // 2 - spent, rng)
            print(name, found[name], flush=True)
        best = space.decode(min(found.values(), key=lambda solution: solution.cost).x, "long-search")
        others = [problem.find_gait(run) for run in options.runs]
        unseen = Setting.of(problem, draw_scenarios(problem, SCENARIOS, (977,)), working)
        rows = [
            {
                "gait": name,
                "cost_nominal": float(costs(np.array([space.encode(gait)]))[0]),
                "speed_m_s": judged.metrics["speed_m_s"],
                "violations": dict(judged.violations),
            }
            for name, gait, (judged, _) in zip(
                ["long search", *options.runs],
                [best, *others],
                Evaluator(unseen, executor)([best, *others]),
                strict=True,
            )
        ]
    options.out.mkdir(parents=True, exist_ok=True)
    write_gait(options.out / "best.toml", best)
    record = {"costs": {name: solution.cost for name, solution in found.items()}, "gaits": rows}
    write_text(options.out / "long-search.json", json.dumps(record, indent=1) + "\n")
    print(json.dumps(record, indent=1))


if __name__ == "__main__":
    main()
