"""The fidelity ladder: how cheaper rungs rank the neighbours of a good gait, and what a search loses on them.

    python tests/studies/ladder.py ranks --out results/profile
    python tests/studies/ladder.py searches --out results/profile
    python tests/studies/ladder.py table --out results/profile

*ranks*: neighbours of each search's start, drawn with its first standard deviation, are judged at the working
fidelity, on cheaper rungs, and at the reference. They are judged again at the working fidelity from other
start poses; this shows chance alone. *searches*: the same search with every population at the working
fidelity, and with a forced rung, without the check of its rank correlation. The best gait is selected and
verified as in `gaitopt optimise`. Each record is a line of ``ladder.jsonl``, and a second call continues.

Cost: 12 min of one core.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import searches
from kept import read_kept
from numpy.typing import NDArray
from rivals import ROBOTS
from scipy.stats import spearmanr
from searches import evaluator_of, judged, winner_of

from gaitopt.gait.gait import Gait
from gaitopt.optimise import ladder
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.journal import WORKING
from gaitopt.optimise.quasi_random import quasi_random
from gaitopt.optimise.stages import FirstBatch
from gaitopt.optimise.study import StudySettings
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.setup import RobotSetup

NEIGHBOURS = 16

CASES: dict[str, tuple[str | Path, bool, int, int]] = {
    "arcfold": ("arcfold", True, 6, 150),
    "strider": (ROBOTS / "strider", False, 15, 400),
}
"""Problem, whether it is planned, seeds, and gaits of a search."""

RUNGS: dict[str, Callable[[RobotSetup, float], RobotSetup]] = {
    "longer timestep": ladder.coarser,
    "shorter horizon": ladder.shorter,
    "both": lambda setup, factor: ladder.shorter(ladder.coarser(setup, factor), factor),
}

Floats = NDArray[np.float64]


@cache
def planned(case: str, seed: int) -> tuple[Gait, ...]:
    """Return the gaits of a plan, the same for every search of a seed."""
    return searches.planned(problem_of(case), seed)


def problem_of(case: str) -> Problem:
    """Return the problem of a case."""
    return load_problem(CASES[case][0])


def costs(evaluator: Evaluator, gaits: list[Gait]) -> Floats:
    """Return the costs of gaits in every scenario, shape (n,)."""
    return np.array([one.evaluation.cost for one in evaluator(gaits)])


def ranks(case: str, seed: int) -> dict[str, Any]:
    """Return how rungs rank the neighbours of a search's start, and processor seconds of each."""
    problem, warm = problem_of(case), CASES[case][1]
    evaluator = evaluator_of(problem, seed)
    points = [problem.space.encode(gait) for gait in planned(case, seed)] if warm else _first(problem, seed)
    start = points[int(costs(evaluator, [problem.space.decode(point) for point in points]).argmin())]
    spread = StudySettings.planned_spread if warm else StudySettings.spread
    moved = start + spread * np.random.default_rng([seed, 99]).standard_normal((NEIGHBOURS, len(start)))
    moved = np.where(problem.space.circular, moved, moved.clip(0.0, 1.0))
    gaits = [problem.space.decode(point) for point in moved]
    setting = evaluator.setup
    chance = tuple(replace(s, pose_seed=s.pose_seed + 12345) for s in setting.scenarios)
    settings = {name: lower(setting, ladder.LadderSettings.factor) for name, lower in RUNGS.items()}
    settings["other start poses"] = RobotSetup.of(problem, chance, setting.fidelity)
    settings["reference"] = RobotSetup.of(problem, setting.scenarios, problem.simulation.reference)
    settings["working"] = setting
    found, cpu_s = {}, {}
    for name, one in settings.items():
        began = time.process_time()
        found[name] = costs(replace(evaluator, setup=one), gaits)
        cpu_s[name] = round(time.process_time() - began, 3)

    def against(name: str) -> dict[str, float]:
        return {rung: float(spearmanr(found[name], found[rung]).statistic) for rung in found if rung != name}

    return {"working": against("working"), "reference": against("reference"), "cpu_s": cpu_s}


def _first(problem: Problem, seed: int) -> list[Floats]:
    batch = quasi_random(problem.space, FirstBatch.most, seed)
    return [*(problem.space.encode(gait) for gait in problem.baselines.values()), *batch]


def forced(rung: str | None) -> StudySettings:
    """Settings with which every search uses a rung, without the check."""
    steps = (ladder.Step(rung, RUNGS[rung]),) if rung else ()
    from_gaits = 0 if rung else sys.maxsize
    return StudySettings(ladder=ladder.LadderSettings(from_gaits, trusted=-1.0, steps=steps))


def search(case: str, seed: int, rung: str | None) -> dict[str, Any]:
    """Return the effort of a search, in steps of the working fidelity, and the cost of its best gait."""
    problem, (_, warm, _, budget) = problem_of(case), CASES[case]
    evaluator = evaluator_of(problem, seed)
    starts, elites = judged(evaluator), planned(case, seed) if warm else ()
    began = time.process_time()
    searched = searches.search(evaluator, budget, seed, starts, elites, laddered=True, settings=forced(rung))
    cpu_s = time.process_time() - began
    _, verified = winner_of(searched, starts)
    longer = ladder.LadderSettings.factor if rung in ("longer timestep", "both") else 1.0
    spent = sum(e.simulated_s / (1.0 if e.rung == WORKING else longer) for e in searched.entries)
    checked = sum(one.simulated_s / longer for one in searched.rungs)
    return {
        "rung": rung or "working",
        "rank_correlation": searched.rungs[0].rank_correlation if searched.rungs else None,
        "steps_s": spent + checked,
        "checked_steps_s": checked,
        "cpu_s": round(cpu_s, 2),
        "best_cost": searched.best.evaluation.cost,
        "verified_cost": verified.evaluation.cost,
        "verified_speed_m_s": verified.speed,
    }


def table(records: list[dict[str, Any]]) -> dict[str, Any]:
    """Return means over seeds, and the searches on each rung compared with those of the same seed without."""
    result: dict[str, Any] = {}
    for case in CASES:
        ranked = [r for r in records if r["case"] == case and r["kind"] == "ranks"]
        searched = [r for r in records if r["case"] == case and r["kind"] == "searches"]
        rows = {}
        for name in [*RUNGS, "other start poses", "reference"]:
            rho = [r["working"][name] for r in ranked]
            if rho:
                dear = [r["cpu_s"][name] / r["cpu_s"]["working"] for r in ranked]
                rows[name] = {"mean": np.mean(rho), "lowest": min(rho), "cpu": np.median(dear)}
        result[case] = {"starts": len(ranked), "rank_correlation": rows, "searches": {}}
        own = {r["seed"]: r for r in searched if r["rung"] == "working"}
        for rung in ["working", *RUNGS]:
            pairs = [(r, own[r["seed"]]) for r in searched if r["rung"] == rung and r["seed"] in own]
            if pairs:
                speed = 1e3 * np.array([r["verified_speed_m_s"] for r, _ in pairs])
                lost = {
                    kind: 1e3 * np.array([r[f"{kind}_cost"] - o[f"{kind}_cost"] for r, o in pairs])
                    for kind in ("best", "verified")
                }
                result[case]["searches"][rung] = {
                    "seeds": len(pairs),
                    "mean_speed_mm_s": speed.mean(),
                    "lost_mm_s": {kind: values.mean() for kind, values in lost.items()},
                    "standard_error_mm_s": {
                        kind: values.std(ddof=1) / math.sqrt(len(pairs)) for kind, values in lost.items()
                    },
                    "steps": np.mean([r["steps_s"] / o["steps_s"] for r, o in pairs]),
                    "cpu": np.mean([r["cpu_s"] / o["cpu_s"] for r, o in pairs]),
                }
    return result


def main() -> None:
    """Measure what is missing, or write the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=("ranks", "searches", "table"))
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--rungs", nargs="*", choices=RUNGS, default=list(RUNGS), help="of searches")
    parser.add_argument("--seeds", nargs="+", type=int)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "ladder.jsonl"
    done = read_kept(path)
    if options.what == "table":
        content = json.dumps(table(done), indent=1, default=float)
        (options.out / "ladder.json").write_text(content + "\n")
        print(content)
        return
    have = {(r["kind"], r["case"], r["seed"], r.get("rung")) for r in done}
    for case in options.cases:
        rungs = [None] if options.what == "ranks" else [None, *options.rungs]
        for seed in options.seeds or range(1, CASES[case][2] + 1):
            for rung in rungs:
                name = None if options.what == "ranks" else rung or "working"
                if (options.what, case, seed, name) not in have:
                    found = ranks(case, seed) if options.what == "ranks" else search(case, seed, rung)
                    record = {"kind": options.what, "case": case, "seed": seed, **found}
                    with path.open("a") as file:
                        file.write(json.dumps(record) + "\n")
                    print(record, flush=True)


if __name__ == "__main__":
    main()
