"""Sealed cases of logged commands, by other numerics: made, diagnosed and scored, case by case, resumable.

    python tests/studies/sealed_bench.py bench --seed 911 --work /tmp/sealed --out results/servo-bench
    python tests/studies/sealed_bench.py hand --seed 914 --work /tmp/hand --out results/servo-bench/hand

`bench` is a servo on a bench (`other_servo`), `hand` is ArcFold held in the hand (`other_hand`). Every servo
effect is planted alone in three sizes, then three effects at once, drawn by chance, and none. The diagnosis
sees the logged commands and the angles alone. OUT/sealed-RIG.jsonl has one line for each finished case;
nothing else is needed to continue on another machine.

Cost: 35 to 70 s a case of `bench` on two cores, 1 to 5 min of `hand`; so one to two hours, and three to five.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import zlib
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from kept import read_kept, version, write_kept
from sealed_cases import SIZES, Plan, Rig, make, write_case
from sealed_rigs import Bench, Hand
from sealed_score import Scored, failures, groups, kept, scored, summary, table

from gaitopt.blind.sealed import truth_path
from gaitopt.core.files import write_text
from gaitopt.core.json import to_json
from gaitopt.core.progress import silent
from gaitopt.diagnose.diagnosis import DiagnosisRequest
from gaitopt.jobs.diagnose import Question
from gaitopt.optimise.executors import open_executor
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import load_problem

REQUEST = DiagnosisRequest(seed=1, next_gait=False)

SEVERAL = 30
NONE = 20


def rig_of(name: str) -> Rig:
    """Return a rig by its name."""
    return Bench() if name == "bench" else Hand(nominal_mjcf(load_problem("arcfold-held")))


def plans(rig: Rig, several: int = SEVERAL, none: int = NONE) -> list[Plan]:
    """Return the cases to make: mixed, so that a study that was stopped has all kinds."""
    singles = [
        Plan(f"{name}-{label}", "single", name, size)
        for size, label in enumerate(SIZES)
        for name in sorted(rig.kinds)
    ]
    mixed = [Plan(f"several-{i:02d}", "several") for i in range(several)]
    mixed += [Plan(f"none-{i:02d}", "none") for i in range(none)]
    every = sorted([*_spread(singles), *_spread(mixed)], key=lambda pair: pair[0])
    return [plan for _, plan in every]


def _spread(rows: list[Plan]) -> list[tuple[float, Plan]]:
    """Return plans with their place from 0 to 1: kinds take turns."""
    place = {"single": 0.0, "several": 0.1, "none": 0.2}
    counts: dict[str, int] = {}
    total = {kind: sum(row.kind == kind for row in rows) for kind in place}
    found = []
    for row in rows:
        index = counts.get(row.kind, 0)
        counts[row.kind] = index + 1
        found.append(((index + place[row.kind]) / total[row.kind], row))
    return found


def made(rig: Rig, plan: Plan, work: Path, seed: int) -> dict[str, Any] | None:
    """Return the truth of a case, which is made where it is missing; None where it cannot be."""
    path = truth_path(work, plan.name)
    if not path.exists():
        rng = np.random.default_rng([seed, zlib.crc32(plan.name.encode())])
        case = make(rig, plan, rng)
        if case is None:
            return None
        write_case(work, rig, plan, case)
    truth: dict[str, Any] = json.loads(path.read_text())
    return truth


def run_case(rig: Rig, plan: Plan, work: Path, seed: int, executor: Executor) -> dict[str, Any]:
    """Make and diagnose one case; return its row."""
    head: dict[str, Any] = {"case": plan.name, "seed": seed, "version": version()}
    truth = made(rig, plan, work, seed)
    if truth is None:
        print(f"{plan.name}: cannot be clear", flush=True)
        return head | {"unreachable": plan.effect or plan.kind}
    question = Question.of(load_problem(rig.problem), work / plan.name, REQUEST)
    begun, spent = time.monotonic(), time.process_time()
    with tempfile.TemporaryDirectory() as memory:
        content = question.answered(executor, silent, question.cache(Path(memory))).to_dict()
    took = {
        "wall_s": round(time.monotonic() - begun, 1),
        "cpu_s": round(time.process_time() - spent, 1),
    }
    content = json.loads(to_json(content))
    row = head | {"truth": truth, "found": kept(content, truth)} | took
    print(line(scored(row, rig.kinds)), flush=True)
    return row


def line(case: Scored) -> str:
    """Return a case in a line."""
    planted = ", ".join(f"{p.name}.{p.target} {p.value:g}" for p in case.planted) or "nothing"
    sizes = ", ".join(
        f"{p.fitted.value:.4g}{'' if p.covered else ' (outside)'}"
        for p in case.planted
        if p.fitted and p.fitted.value is not None
    )
    also = f" or {', '.join(case.ambiguous_with)}" if case.ambiguous_with else ""
    mark = "right" if case.right else "WRONG"
    named = ", ".join(case.causes) or "nothing"
    return f"{mark} {case.case}: {planted}: {case.verdict}: {named}{also} [{sizes}] {case.wall_s:.0f} s"


def write_record(out: Path, rig_name: str, rig: Rig, rows: list[dict[str, Any]], seed: int) -> None:
    """Write the figures and the page of all finished cases."""
    known = [row for row in rows if "truth" in row]
    cases = [scored(row, rig.kinds) for row in known]
    figures = {title: summary(some) for title, some in groups(cases).items()}
    record = {
        "seed": seed,
        "versions": sorted({row["version"] for row in rows}),
        "unreachable": sorted({row["unreachable"] for row in rows if "unreachable" in row}),
        "figures": figures,
    }
    write_text(out / f"sealed-{rig_name}.json", to_json(record))
    wrong = failures(cases)
    lines = [*table(cases), "", "### Failures, one by one", "", *(wrong or ["None."])]
    write_text(out / f"sealed-{rig_name}.md", "\n".join(lines) + "\n")
    print("\n".join(lines))


def main() -> None:
    """Make, diagnose and score what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("rig", choices=("bench", "hand"))
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--work", type=Path, required=True, help="where data sets and their truth are kept")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--several", type=int, default=SEVERAL, help="cases with three effects")
    parser.add_argument("--none", type=int, default=NONE, help="cases without any")
    parser.add_argument("--only", nargs="+", default=[], help="only cases whose names begin so")
    parser.add_argument("--until", type=float, default=1e9, help="begin no case after so many seconds")
    parser.add_argument("--make", action="store_true", help="make data sets, and diagnose none")
    options = parser.parse_args()
    rig, path = rig_of(options.rig), options.out / f"sealed-{options.rig}.jsonl"
    done = {row["case"]: row for row in read_kept(path, options.seed)}
    wanted = [
        plan
        for plan in plans(rig, options.several, options.none)
        if not options.only or plan.name.startswith(tuple(options.only))
    ]
    began = time.monotonic()
    with open_executor("processes", None) as executor:
        for plan in wanted:
            if time.monotonic() - began > options.until:
                break
            if options.make:
                print(
                    plan.name,
                    "made" if made(rig, plan, options.work, options.seed) else "cannot be clear",
                    flush=True,
                )
            elif plan.name not in done:
                done[plan.name] = run_case(rig, plan, options.work, options.seed, executor)
                write_kept(path, list(done.values()))
    if done:
        write_record(options.out, options.rig, rig, list(done.values()), options.seed)


if __name__ == "__main__":
    main()
