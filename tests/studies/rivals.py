"""What a search costs until it is near the best gait: gaitopt compared with other optimisers.

    pip install '.[benchmark]'
    python tests/studies/rivals.py --out results/rivals

Three problems, each a black box over the unit box, the same for every method: ArcFold (one nominal scenario,
the file's horizon of 2 + 4 s, the largest timestep that still ranks well), the planar model of ArcFold,
integrated in time, and the tests' strider. Every method gets the same budget of gaits and the same seeds.
Each run is one line of ``runs.jsonl``, written when it ends; a second call continues. Runs go seed by seed,
so that a study that is stopped compares all methods on the same seeds.

Gaits and simulated seconds are counted. The time of a plan counts as the seconds that the same core would
have simulated in it. The computing time of an optimiser itself is not counted.

Cost: 75 min of one core, and as much again for the optimisers themselves.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from kept import read_kept
from numpy.typing import NDArray
from scipy import optimize
from scipy.stats import qmc
from searches import Recording, judged, planned, search

from gaitopt.optimise.evaluator import Evaluated, Evaluator, Outcome
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.solvers.cma_es import CmaEs
from gaitopt.optimise.stages import DEFAULT_METHOD, Method
from gaitopt.plan.plan import Planner
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.metrics import metric_names
from gaitopt.simulation.objective import Evaluation
from gaitopt.simulation.scenario import NOMINAL
from gaitopt.simulation.setup import RobotSetup

ROBOTS = Path(__file__).resolve().parents[1] / "robots"

COARSEST = {"timestep_s": 2e-3}
"""It ranks ArcFold's gaits like 5e-4 s (Spearman 0.95); 4e-3 s does not (0.67): results/profile."""

PLANAR_WIDTH = 0.03
"""Friction width of the planar black box, m/s."""

CASES = {"arcfold": 400, "planar": 800, "strider": 800}
"""Gaits that a run may evaluate, by case."""

SEEDS = 15

Point = NDArray[np.float64]


class SpentError(Exception):
    """The budget of gaits is spent."""


class PlanarEvaluator:
    """Speed of the planar model's periodic motion, used like an `Evaluator`."""

    def __init__(self, problem: Problem):
        self.setup = RobotSetup.of(problem, (NOMINAL,), problem.simulation.working)
        self._planner = Planner(problem)
        names = metric_names(problem)
        self._unknown = dict.fromkeys(names, math.nan)

    def __call__(self, gaits: list[Any]) -> list[Evaluated]:
        """Return evaluation and outcome of each gait."""
        return [self._judged(gait) for gait in gaits]

    def _judged(self, gait: Any) -> Evaluated:
        planner = self._planner
        speed = float(planner.model.speed(planner.vector(gait), PLANAR_WIDTH))
        metrics = self._unknown | {"speed_m_s": speed}
        cycles = planner.model.settling_cycles(gait.period_s) + 1
        outcomes = [Outcome(metrics, "ok", cycles * gait.period_s)]
        return Evaluated(Evaluation(-speed, metrics, {}, "ok"), outcomes)


@dataclass
class BlackBox:
    """Costs of points of the unit box, counted.

    Attributes:
        evaluator: what judges a gait.
        budget: gaits allowed.
        costs: cost of each gait so far.
        simulated_s: simulated seconds of each.
    """

    evaluator: Any
    budget: int

    def __post_init__(self) -> None:
        self.costs: list[float] = []
        self.simulated_s: list[float] = []
        self.space = self.evaluator.setup.problem.space
        self.dimension = len(self.space.variables)

    def __call__(self, point: Any) -> float:
        """Return the cost of a point, shape (d,).

        Raises:
            SpentError: the budget was spent before.
        """
        if len(self.costs) >= self.budget:
            raise SpentError
        one, *_ = self.evaluator([self.space.decode(np.asarray(point, float))])
        self.costs.append(one.evaluation.cost)
        self.simulated_s.append(one.simulated_s)
        return float(one.evaluation.cost)


def evaluator_of(case: str) -> Any:
    """Return the evaluator of a case."""
    if case == "planar":
        return PlanarEvaluator(load_problem("arcfold"))
    problem = load_problem("arcfold" if case == "arcfold" else ROBOTS / case)
    fidelity = problem.simulation.working
    if case == "arcfold":
        fidelity = fidelity.model_copy(update=COARSEST)
    return Evaluator(RobotSetup.of(problem, (NOMINAL,), fidelity), SerialExecutor())


# --- other optimisers -------------------------------------------------------------------------


def random_search(box: BlackBox, seed: int) -> None:
    """Uniform points."""
    rng = np.random.default_rng(seed)
    while True:
        box(rng.uniform(size=box.dimension))


def best_of_n(box: BlackBox, seed: int) -> None:
    """Half of the budget on scrambled Sobol points, half on Nelder–Mead from the best of them."""
    points = qmc.Sobol(box.dimension, rng=np.random.default_rng(seed)).random(box.budget // 2)
    costs = [box(point) for point in points]
    while True:  # SciPy's own first simplex; restarted when it has shrunk
        best = points[int(np.argmin(costs))]
        optimize.minimize(box, best, method="Nelder-Mead", bounds=[(0.0, 1.0)] * box.dimension)


def pycma(box: BlackBox, seed: int, x0: Point | None = None) -> None:
    """`cma.fmin2` from the middle of the box, a quarter of it wide, restarted with doubled populations."""
    import cma

    start = np.full(box.dimension, 0.5) if x0 is None else x0
    cma.fmin2(box, start, 0.25, _cma_options(seed), restarts=9)


def pycma_from_baseline(box: BlackBox, seed: int) -> None:
    """The same from the best of the hand-tuned gaits, which are counted."""
    points = [box.space.encode(gait) for gait in box.evaluator.setup.problem.baselines.values()]
    costs = [box(point) for point in points]
    pycma(box, seed, points[int(np.argmin(costs))])


def pycma_surrogate(box: BlackBox, seed: int) -> None:
    """`cma.fmin_lq_surr2`: CMA-ES on a linear-quadratic surrogate, otherwise as `pycma`; restarted."""
    import cma

    while True:
        cma.fmin_lq_surr2(box, np.full(box.dimension, 0.5), 0.25, _cma_options(seed))
        seed += 1000


def _cma_options(seed: int) -> dict[str, object]:
    return {"bounds": [0.0, 1.0], "seed": seed + 1, "verbose": -9, "verb_log": 0}


def differential_evolution(box: BlackBox, seed: int) -> None:
    """SciPy's, with populations of 5 per coordinate: with its default of 15 it would make two generations."""
    bounds = [(0.0, 1.0)] * box.dimension
    optimize.differential_evolution(
        box, bounds, popsize=5, maxiter=10**6, tol=0.0, polish=False, rng=np.random.default_rng(seed)
    )


def optuna_tpe(box: BlackBox, seed: int) -> None:
    """Optuna's default sampler."""
    import optuna

    _optuna(box, optuna.samplers.TPESampler(seed=seed))


def optuna_cma(box: BlackBox, seed: int) -> None:
    """Optuna's CMA-ES sampler with its defaults."""
    import optuna

    _optuna(box, optuna.samplers.CmaEsSampler(seed=seed))


def _optuna(box: BlackBox, sampler: Any) -> None:
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    study = optuna.create_study(sampler=sampler)
    names = [variable.name for variable in box.space.variables]
    study.optimize(lambda trial: box([trial.suggest_float(n, 0.0, 1.0) for n in names]), n_trials=box.budget)


def ngopt(box: BlackBox, seed: int) -> None:
    """Nevergrad's NGOpt, which chooses by dimension and budget; from a random point.

    From the middle of the box, every run on ArcFold is the same one to the last bit, whatever the seed.
    """
    import nevergrad
    from nevergrad.optimization import metamodel

    # nevergrad 1.0.12 makes a float of an array of one number, which NumPy 2.4 no longer does
    metamodel.float = lambda value: float(np.asarray(value).item())
    start = np.random.default_rng(seed).uniform(size=box.dimension)
    space = nevergrad.p.Array(init=start).set_bounds(0.0, 1.0)
    np.random.seed(seed)  # noqa: NPY002  its meta-models draw from here
    space.random_state.seed(seed)
    nevergrad.optimizers.NGOpt(space, budget=box.budget).minimize(box)


RIVALS: dict[str, Callable[[BlackBox, int], None]] = {
    "pycma": pycma,
    "pycma, from the best baseline": pycma_from_baseline,
    "pycma, lq surrogate": pycma_surrogate,
    "SciPy DE": differential_evolution,
    "Optuna TPE": optuna_tpe,
    "Optuna CMA-ES": optuna_cma,
    "Nevergrad NGOpt": ngopt,
    "best of N, Nelder–Mead": best_of_n,
    "random": random_search,
}


# --- gaitopt ----------------------------------------------------------------------------------


def default(record: Recorded, seed: int) -> float:
    """The default method, from a plan if the problem has one; return the plan's time, s."""
    return _study(record, seed, warm=record.plans)


def cold(record: Recorded, seed: int) -> float:
    """The same without a plan."""
    return _study(record, seed, warm=False)


def without_surrogate(record: Recorded, seed: int) -> float:
    """The default method, every candidate evaluated."""
    first, *others = DEFAULT_METHOD.stages
    plain = (replace(first, solver=CmaEs(offered=1)), *others)
    return _study(record, seed, warm=record.plans, method=replace(DEFAULT_METHOD, stages=plain))


def _study(record: Recorded, seed: int, warm: bool, method: Method = DEFAULT_METHOD) -> float:
    problem = record.setup.problem
    began = time.process_time()
    elites = planned(problem, seed) if warm else ()
    plan_s = time.process_time() - began if warm else 0.0
    starts = judged(record)
    search(record, record.budget - len(starts), seed, starts, elites, method=method)
    return plan_s


class Recorded(Recording):
    """A black box that keeps the costs of gaits.

    Attributes:
        budget: gaits of a run.
        plans: whether a plan is used: a plan of the planar black box would be its optimum.
    """

    def __init__(self, case: str):
        super().__init__(evaluator_of(case))
        self.budget, self.plans = CASES[case], case == "arcfold"


OURS = {"gaitopt": default, "gaitopt, cold": cold, "gaitopt, no surrogate": without_surrogate}


# --- runs -------------------------------------------------------------------------------------


def run_rival(case: str, method: str, seed: int) -> dict[str, Any]:
    """Return the record of one run of another optimiser."""
    box = BlackBox(evaluator_of(case), CASES[case])
    with suppress(SpentError), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # each method prints its own warnings
        RIVALS[method](box, seed)
    return {"improvements": improvements(box.costs, box.simulated_s), **totals(box.costs, box.simulated_s)}


def run_ours(case: str, method: str, seed: int) -> dict[str, Any]:
    """Return the record of one run of gaitopt, with the simulated seconds that its plan counts as."""
    record = Recorded(case)
    record(list(record.setup.problem.baselines.values()))  # compiles
    began = time.process_time()
    record(list(record.setup.problem.baselines.values()))
    speed = sum(record.simulated_s) / 2 / (time.process_time() - began)
    record.costs, record.simulated_s = [], []
    plan_s = OURS[method](record, seed)
    return {
        "improvements": improvements(record.costs, record.simulated_s),
        **totals(record.costs, record.simulated_s),
        "plan_s": round(plan_s, 2),
        "plan_simulated_s": round(plan_s * speed, 1),
    }


def improvements(costs: list[float], simulated_s: list[float]) -> list[list[float]]:
    """Return gaits and simulated seconds spent, and the cost, each time that the best so far improved."""
    rows: list[list[float]] = []
    seconds = np.cumsum(simulated_s).tolist()
    for index, (cost, spent) in enumerate(zip(costs, seconds, strict=True)):
        if not rows or cost < rows[-1][2]:
            rows.append([index + 1, round(spent, 3), cost])
    return rows


def totals(costs: list[float], simulated_s: list[float]) -> dict[str, float]:
    """Return the total effort of a run."""
    return {"evaluations": len(costs), "simulated_s": round(sum(simulated_s), 3)}


def mark(case: str) -> str:
    """Return the cost of the middle of the box to the last bit, which identifies the objective."""
    box = BlackBox(evaluator_of(case), 1)
    return repr(box(np.full(box.dimension, 0.5)))


METHODS = [*OURS, *RIVALS]


@contextmanager
def timed(record: dict[str, Any]) -> Iterator[None]:
    """Add the processor time of a run to its record."""
    began = time.process_time()
    yield
    record["cpu_s"] = round(time.process_time() - began, 2)


def main() -> None:
    """Run what is missing."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "runs.jsonl"
    done = read_kept(path)
    have = {(r["case"], r["method"], r["seed"]) for r in done}
    marks = {case: mark(case) for case in options.cases}
    for seed in range(options.seeds):
        for case, method in itertools.product(options.cases, options.methods):
            if (case, method, seed) not in have and (case == "arcfold" or method != "gaitopt, cold"):
                record: dict[str, Any] = {"case": case, "method": method, "seed": seed, "mark": marks[case]}
                with timed(record):
                    record |= (run_rival if method in RIVALS else run_ours)(case, method, seed)
                with path.open("a") as file:
                    file.write(json.dumps(record, ensure_ascii=False) + "\n")
                print(case, method, seed, record["cpu_s"], record["improvements"][-1], flush=True)


if __name__ == "__main__":
    main()
