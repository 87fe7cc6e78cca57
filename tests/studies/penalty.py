"""Penalties that adapt against full ones: the same searches, selected and verified as in `gaitopt optimise`.

    python tests/studies/penalty.py --out results/penalty

Each search is a line of ``penalty.jsonl``, and a second call continues. ``penalty.md`` is written from all of
them: speed and cost of each winner over fresh scenarios at the reference fidelity, and the limits it breaks.

Cost: 7 min of one core a search of ArcFold, two searches a seed.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import searches
from kept import read_kept, write_kept
from searches import evaluator_of, judged, winner_of

from gaitopt.core.files import write_text
from gaitopt.optimise.penalty import PenaltySettings
from gaitopt.optimise.run import DEFAULT_BUDGET
from gaitopt.optimise.study import StudySettings
from gaitopt.problem.problem import load_problem

KINDS = {"adaptive": PenaltySettings(), "full": PenaltySettings(first=1.0, least=1.0)}

Row = dict[str, Any]


def search(name: str, seed: int, kind: str, budget: int) -> Row:
    """Return what the winner of a search is worth."""
    began = time.process_time()
    problem = load_problem(name)
    evaluator = evaluator_of(problem, seed)
    elites = searches.planned(problem, seed) if problem.file.planar else ()
    starts, settings = judged(evaluator), StudySettings(penalty=KINDS[kind])
    study = searches.search(evaluator, budget, seed, starts, elites, laddered=True, settings=settings)
    winner, verified = winner_of(study, starts)
    broken = [limit for limit, size in verified.evaluation.violations.items() if size]
    return {
        **{"problem": name, "seed": seed, "penalty": kind, "budget": budget},
        **{"speed_m_s": verified.speed, "cost": verified.evaluation.cost, "broken": broken},
        **{"period_s": winner.gait.period_s, "found_by": winner.found_by},
        "rungs": [[rung.name, rung.after, rung.rank_correlation] for rung in study.rungs],
        "cpu_s": round(time.process_time() - began),
    }


def table(rows: list[Row]) -> Iterator[str]:
    """Return the lines of the table, a line for each problem and seed that both kinds have."""
    yield "| problem | seed | adaptive: mm/s | period, s | breaks | full: mm/s | period, s | breaks |"
    yield "|---|---|---|---|---|---|---|---|"
    found = {(row["problem"], row["seed"], row["penalty"]): row for row in rows}
    for problem, seed in sorted({key[:2] for key in found}):
        pair = [found.get((problem, seed, kind)) for kind in KINDS]
        cells = [_cells(row) for row in pair if row]
        if len(cells) == len(KINDS):
            yield f"| {problem} | {seed} | {' | '.join(cells)} |"


def _cells(row: Row) -> str:
    broken = ", ".join(row["broken"]) or "none"
    return f"{1e3 * row['speed_m_s']:.1f} | {row['period_s']:.3f} | {broken}"


def main() -> None:
    """Make the searches that are missing, and write the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--problems", nargs="+", default=["arcfold"])
    parser.add_argument("--seeds", nargs="+", type=int, default=list(range(11, 19)))
    parser.add_argument("--budget", type=int, default=DEFAULT_BUDGET)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    path = options.out / "penalty.jsonl"
    rows = read_kept(path)
    done = {(row["problem"], row["seed"], row["penalty"]) for row in rows}
    wanted = [(p, s, k) for p in options.problems for s in options.seeds for k in KINDS]
    with ProcessPoolExecutor(options.workers) as pool:
        missing = [case for case in wanted if case not in done]
        for future in as_completed([pool.submit(search, *case, options.budget) for case in missing]):
            rows.append(future.result())
            write_kept(path, rows)
    write_text(options.out / "penalty.md", "\n".join(table(rows)) + "\n")


if __name__ == "__main__":
    main()
