"""What ties save: the quadruped's search with ties, the same without them, and pycma from the drafted trot.

    pip install '.[benchmark]'
    python tests/studies/tied_search.py --seeds 15 --out results/tied-search

`problems/quadruped`, one nominal scenario at the working fidelity, the same budget of gaits and the same
seeds for each method. pycma searches all channels, from the trot, with the first steps of gaitopt's own
CMA-ES. Each run is one line of ``runs.jsonl``, written when it ends; a second call continues, seed by seed.
The target is 90 % of the lowest cost of any run. The expected running time is the effort of all runs of a
method over the number of them that reached it.

Cost: 2 min of one core for each seed.
"""

from __future__ import annotations

import argparse
import itertools
import json
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from kept import read_kept, version
from rivals import BlackBox, SpentError, improvements, totals
from rivals_table import expected
from searches import Recording, judged, search

from gaitopt.core.files import write_text
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.study import StudySettings
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.scenario import NOMINAL
from gaitopt.simulation.setup import RobotSetup

BUDGET = 200
SHARES = (0.8, 0.9, 0.95)

Run = dict[str, Any]


def recording(problem: Problem) -> Recording:
    """Return an evaluator with one nominal scenario that keeps the costs of gaits."""
    setup = RobotSetup.of(problem, (NOMINAL,), problem.simulation.working)
    return Recording(Evaluator(setup, SerialExecutor(), problem.objective.search_margin))


def untied(problem: Problem) -> Problem:
    """Return a problem without ties and templates."""
    assert problem.file.gait is not None
    gait = problem.file.gait.model_copy(
        update={"templates": None, "ties": None, "legs": None, "mirrored": None}
    )
    return replace(problem, file=problem.file.model_copy(update={"gait": gait}))


def tied(record: Recording, seed: int) -> None:
    """The search of gaitopt with the templates of the problem file; it is never freed."""
    starts = judged(record)
    search(record, BUDGET - len(starts), seed, starts)


def pycma(record: Recording, seed: int) -> None:
    """`cma.fmin2` over all channels from the trot, restarted with doubled populations."""
    import cma

    box = BlackBox(record, BUDGET)
    x0 = box.space.encode(record.setup.problem.baselines["trot"])
    options = {"bounds": [0.0, 1.0], "seed": seed + 1, "verbose": -9, "verb_log": 0}
    with suppress(SpentError), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cma.fmin2(box, x0, StudySettings().spread, options, restarts=9)


METHODS: dict[str, tuple[Callable[[Problem], Problem], Callable[[Recording, int], None]]] = {
    "gaitopt, tied": (lambda problem: problem, tied),
    "gaitopt, free": (untied, tied),
    "pycma, from the trot": (untied, pycma),
}


def run(method: str, seed: int) -> Run:
    """Return the record of one run."""
    change, solve = METHODS[method]
    record = recording(change(load_problem("quadruped")))
    solve(record, seed)
    record.costs, record.simulated_s = record.costs[:BUDGET], record.simulated_s[:BUDGET]
    return {
        "method": method,
        "seed": seed,
        "version": version(),
        "improvements": improvements(record.costs, record.simulated_s),
        **totals(record.costs, record.simulated_s),
    }


def table(runs: Sequence[Run]) -> list[str]:
    """Return the table of finished runs as Markdown lines, over the seeds that every method has."""
    seeds = set.intersection(*({r["seed"] for r in runs if r["method"] == m} for m in METHODS))
    runs = [r for r in runs if r["seed"] in seeds]
    best = min((r["improvements"][-1][2] for r in runs), default=np.nan)
    lines = [
        f"{len(seeds)} seeds, {BUDGET} gaits a run; lowest cost {best:.4f} (minus the speed in m/s). Each "
        "cell: runs that reached the share of it, expected simulated seconds; or the seconds that all runs "
        "spent.",
        "",
        f"| method | median end | {' | '.join(f'{share:.0%}' for share in SHARES)} |",
        "|---|---|" + "---|" * len(SHARES),
    ]
    for method in METHODS if seeds else ():
        mine = [r for r in runs if r["method"] == method]
        rows = [expected(mine, share * best) for share in SHARES]
        cells = [
            f"{row['successes']}; {row['simulated_s']:,.0f} s"
            if row["successes"]
            else f"0; none in {row['spent_s']:,.0f} s"
            for row in rows
        ]
        end = float(np.median([r["improvements"][-1][2] for r in mine]))
        lines.append(f"| {method} | {end:.4f} | {' | '.join(cells)} |")
    return lines


def main() -> None:
    """Run what is missing, and write the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=15)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "runs.jsonl"
    have = {(r["method"], r["seed"]) for r in read_kept(path)}
    for seed, method in itertools.product(range(options.seeds), METHODS):
        if (method, seed) not in have:
            record = run(method, seed)
            with path.open("a") as file:
                file.write(json.dumps(record, ensure_ascii=False) + "\n")
            print(method, seed, record["improvements"][-1], flush=True)
    write_text(options.out / "table.md", "\n".join([*table(read_kept(path)), ""]))


if __name__ == "__main__":
    main()
