"""The record on blind development cases: made, diagnosed and scored, case by case, resumable.

What was simulated for a case is kept in the work folder. So where only the conclusions have changed, removing
WORK/diagnoses and running it again takes seconds a case; where the residuals have, remove WORK/memory too.

python tests/benchmarks/blind_cases.py --cases 40 --seed 1 --work /tmp/blind --out results/diagnosis
"""

import argparse
import json
import subprocess
import time
from pathlib import Path

from gaitopt.diagnose.blind import kinds_of, make_case, maker
from gaitopt.diagnose.dataset import load_dataset
from gaitopt.diagnose.diagnosis import diagnose
from gaitopt.diagnose.memory import Memory
from gaitopt.diagnose.scoring import read_cases, score
from gaitopt.errors import GaitoptError
from gaitopt.optimise.executors import open_executor
from gaitopt.problem import load_problem
from gaitopt.results import to_json
from gaitopt.rollout import Simulator

GAITS = ("square-4s", "square-2s", "square-1s")


def version() -> str:
    """Return the code's commit, marked where the work tree differs from it."""
    command = ["git", "describe", "--always", "--dirty", "--abbrev=12"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip() or "unknown"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--gaits", default=",".join(GAITS))
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--until", type=float, default=1e9, help="begin no case after so many seconds")
    options = parser.parse_args()
    began = time.monotonic()
    problem = load_problem("arcfold")
    simulator = Simulator.build(problem)
    with open_executor("threads", None) as executor:
        made = maker(problem, options.gaits.split(","), options.seconds, None, executor)
        for index, kind in enumerate(kinds_of(options.cases, options.seed)):
            if time.monotonic() - began > options.until:
                break
            name = f"case-{index:03d}"
            result = options.work / "diagnoses" / name / "diagnosis.json"
            if result.exists():
                continue
            turn = time.monotonic()
            try:
                folder = make_case(made, options.work, index, kind, options.seed, executor)
            except GaitoptError as problem_met:
                print(f"{name}: {problem_met}", flush=True)
                continue
            dataset = load_dataset(folder, problem, [s for s in simulator.signals if s])
            begun = time.monotonic()
            memory = Memory.of(options.work / "memory" / name, simulator, dataset, 1)
            content = diagnose(simulator, dataset, executor, 1, next_gait=False, memory=memory).to_dict()
            content["version"] = version()
            content["wall_s"] = time.monotonic() - begun
            result.parent.mkdir(parents=True, exist_ok=True)
            result.write_text(to_json(content))
            row = score(read_cases(options.work, options.work / "diagnoses"))["rows"][-1]
            top = [
                (r["name"], r["target"], round(r["probability"], 3), round(r["heldout_left"], 2))
                for r in content["effects"][:4]
            ]
            print(f"{begun - turn:.0f}+{content['wall_s']:.0f} s", row, top, flush=True)
    record = score(read_cases(options.work, options.work / "diagnoses"))
    print(json.dumps({k: v for k, v in record.items() if k != "rows"}, indent=1))
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "blind.json").write_text(to_json(record))


if __name__ == "__main__":
    main()
