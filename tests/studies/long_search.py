"""How much better is the best gait of 20,000 evaluations than that of an ordinary run?

    python tests/studies/long_search.py --out results/long-search

One nominal scenario of ArcFold, the horizon of the problem file, the largest timestep that still ranks gaits
well. CMA-ES spends half of the gaits from the best planned gait, and half from the best of 1,000 quasi-random
gaits. Both restart with doubled populations at random points. The best gait, and those of ordinary runs named
by ``--runs``, are then simulated in 32 scenarios that no search has seen, at the working fidelity. If the
folder contains the best gait of the long search, the search is not repeated.

Cost: about 12 min of one core (estimated from its simulated seconds).
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from rivals import COARSEST

from gaitopt.core.files import write_text
from gaitopt.gait.gait import Gait, write_gait
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.executors import open_executor
from gaitopt.optimise.quasi_random import quasi_random
from gaitopt.optimise.solvers.cma_es import CmaEs
from gaitopt.optimise.solvers.solution import Box
from gaitopt.optimise.solvers.solver import Minimisation
from gaitopt.plan.plan import Planner
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.scenario import NOMINAL, draw_scenarios
from gaitopt.simulation.setup import RobotSetup

FIRST = 1000
SCENARIOS = 32


def main() -> None:
    """Search if that was not done, compare, and write ``long-search.json`` and the best gait."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--budget", type=int, default=20_000)
    parser.add_argument("--runs", nargs="*", default=["results/arcfold"], help="run folders to compare with")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    kept, winner = options.out / "long-search.json", options.out / "best.toml"
    problem = load_problem("arcfold")
    working = problem.simulation.working
    with open_executor("threads", None) as executor:
        fast = RobotSetup.of(problem, (NOMINAL,), working.model_copy(update=COARSEST))
        nominal = Evaluator(fast, executor, problem.objective.search_margin)
        if winner.exists():
            costs = json.loads(kept.read_text())["costs"]
        else:
            best, costs = search(problem, nominal, options.budget)
            write_gait(winner, best)
        gaits = [problem.find_gait(name) for name in [str(winner), *options.runs]]
        unseen = RobotSetup.of(problem, draw_scenarios(problem, SCENARIOS, (977,)), working)
        judged, first = Evaluator(unseen, executor)(gaits), nominal(gaits)
    rows = [
        {
            "gait": name,
            "cost_nominal": alone.evaluation.cost,
            "speed_m_s": one.evaluation.metrics["speed_m_s"],
            "violations": dict(one.evaluation.violations),
        }
        for name, one, alone in zip(["long search", *options.runs], judged, first, strict=True)
    ]
    content = json.dumps({"costs": costs, "gaits": rows}, indent=1)
    write_text(kept, content + "\n")
    print(content)


def search(problem: Problem, evaluator: Evaluator, budget: int) -> tuple[Gait, dict[str, float]]:
    """Return the better of a planned and a cold search, half of the budget each, and the costs of both."""
    space = problem.space
    box = Box(space.circular)

    def costs(points: np.ndarray) -> np.ndarray:
        return np.array([one.evaluation.cost for one in evaluator([space.decode(point) for point in points])])

    elites = np.array([space.encode(elite.gait) for elite in Planner(problem).plan().elites])
    drawn = quasi_random(space, FIRST, 1)
    found = {}
    for name, points, spent in (("planned", elites, 0), ("cold", drawn, FIRST)):
        start = points[costs(points).argmin()]
        rng = np.random.default_rng([20, spent])
        found[name] = CmaEs().minimise(Minimisation(costs, box, start, 0.15, budget // 2 - spent, rng))
        print(name, found[name], flush=True)
    best = space.decode(min(found.values(), key=lambda solution: solution.cost).x, "long-search")
    return best, {name: solution.cost for name, solution in found.items()}


if __name__ == "__main__":
    main()
