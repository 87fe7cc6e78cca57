"""Kill -9 at random moments, then --resume: is the result that of an undisturbed run, to the last bit?

Each case starts the same run, kills its whole process group after a random share of the time that an
undisturbed run takes, and resumes it (or, where the kill left nothing to resume, starts it again).
Every third case is killed a second time while it resumes.

    python tests/studies/kill_resume.py --out results/kill-resume

Cost: about 5 min of two cores (estimated).
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

GAITOPT = [sys.executable, "-c", "from gaitopt.cli import main; raise SystemExit(main())"]
RESULTS = ("best.toml", "evaluations.csv", "model.xml", "problem.toml")


def main() -> None:
    """Run the cases and write ``kill-resume.json`` and ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--problem", default=str(Path(__file__).parents[1] / "robots" / "strider"))
    parser.add_argument("--budget", type=int, default=60)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--executor", default="threads")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        report = study(options, Path(folder))
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "kill-resume.json").write_text(json.dumps(report, indent=1) + "\n")
    (options.out / "README.md").write_text(page(report))
    print(page(report))


def study(options: argparse.Namespace, folder: Path) -> dict:
    """Return the figures of every case."""
    rest = ["--budget", str(options.budget), "--executor", options.executor, "--quiet"]
    command = ["optimise", options.problem, *rest, "--out"]
    began = time.monotonic()
    ended, _ = finish([*command, str(folder / "whole")])
    took = time.monotonic() - began
    assert ended == 0
    expected = result(folder / "whole")
    rng = np.random.default_rng(options.seed)
    cases = []
    for index in range(options.cases):
        run = folder / f"case-{index}"
        moments = [float(rng.uniform(0.0, took)), float(rng.uniform(0.0, took))][: 2 if index % 3 == 2 else 1]
        case = one([*command, str(run)], run, moments, options.executor)
        cases.append(case | {"same": result(run) == expected})
        print(f"{index + 1}/{options.cases}", cases[-1], flush=True)
    name = Path(options.problem).name
    keys = ("budget", "executor", "seed")
    return (
        {"problem": name, "undisturbed_s": took} | {k: getattr(options, k) for k in keys} | {"cases": cases}
    )


def one(command: list[str], run: Path, moments: list[float], executor: str) -> dict:
    """Kill a run at each moment, then let it end; return what was on the disk when it was killed."""
    kills = []
    for moment in moments:
        kill(again(command, run, executor), moment)
        kills.append({"after_s": moment, "gaits": rows(run), "stage": stage(run)})
    code, error = finish(again(command, run, executor))
    return {"kills": kills, "exit": code, "message": error}


def again(command: list[str], run: Path, executor: str) -> list[str]:
    if not (run / "run.toml").exists():
        return command
    return ["optimise", str(run), "--resume", str(run), "--executor", executor, "--quiet"]


def kill(arguments: list[str], moment: float) -> None:
    process = subprocess.Popen(
        [*GAITOPT, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        process.wait(moment)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def finish(arguments: list[str]) -> tuple[int, str]:
    ended = subprocess.run([*GAITOPT, *arguments], capture_output=True, text=True, check=False)
    return ended.returncode, ended.stderr.strip()


def rows(run: Path) -> int:
    path = run / "evaluations.csv"
    return max(0, path.read_bytes().count(b"\n") - 1) if path.exists() else 0


def stage(run: Path) -> str:
    """What the disk says of how far a run had come."""
    marks = (("summary.json", "finished"), ("figures", "report"), ("evaluations.csv", "search"))
    names = {path.name for path in run.iterdir()} if run.exists() else set()
    return next((name for mark, name in marks if mark in names), "before its first gait")


def result(run: Path) -> dict:
    """Everything that a run found, to the last bit; its clock's figure aside."""
    summary = json.loads((run / "summary.json").read_text())
    del summary["wall_s"]
    files = {name: (run / name).read_text() for name in RESULTS}
    return {"summary": summary, "files": files, "names": sorted(p.name for p in run.iterdir())}


def page(report: dict) -> str:
    """Return the README of the results folder."""
    cases = report["cases"]
    lines = [
        "# Kill and resume",
        "",
        f"{len(cases)} runs of `gaitopt optimise` on `{report['problem']}` ({report['budget']} gaits, "
        f"executor {report['executor']}), killed with SIGKILL at random moments of the "
        f"{report['undisturbed_s']:.1f} s that an undisturbed run takes, then resumed. "
        f"**{sum(case['same'] for case in cases)} of {len(cases)} end with the undisturbed run's bits**: "
        "journal, best gait, model, problem, every figure of the summary but `wall_s`, and the same files.",
        "",
        f"Made by `python tests/studies/kill_resume.py --budget {report['budget']} "
        f"--executor {report['executor']} --cases {len(cases)} --seed {report['seed']} "
        "--out results/kill-resume`.",
        "",
        "| case | killed after [s] | gaits on disk | stage | exit after resuming | same bits |",
        "|---|---|---|---|---|---|",
    ]
    for index, case in enumerate(cases):
        cells = [[f"{k['after_s']:.2f}", str(k["gaits"]), k["stage"]] for k in case["kills"]]
        joined = [", then ".join(column) for column in zip(*cells, strict=True)]
        same = "yes" if case["same"] else "NO"
        lines.append(f"| {index + 1} | {' | '.join(joined)} | {case['exit']} | {same} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
