"""The long fuzz: thousands of broken and hostile inputs, each of which must end in success or one clear line.

The cases are those of ``tests/fuzzing``. They run in a separate process, with a limit on memory and on the
time of each case. So a crash of the interpreter or a hang inside a library is a figure in the table, and does
not end the study.

    python tests/studies/fuzz.py --cases 12000 --whole 40 --seed 1 --out results/fuzz
    python tests/studies/fuzz.py --seed 1 --only "MJCF, text:373"

Cost: 8 min of one core.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import fuzzing

MEMORY = 6 << 30
"""Address space of the process that runs the cases, bytes."""

ROWS = 2_000_000
"""Rows of the large file that is imported."""

GRACE_S = 10.0
"""How much longer than its limit a case may take before its process is killed."""

ENDS = ("done", "stated", "usage")


def main() -> None:
    """Run the cases and write ``fuzz.json`` and ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "--cases", type=int, default=12000, help="brief ones; 0 keeps those of an earlier run"
    )
    parser.add_argument("--whole", type=int, default=0, help="whole runs of each kind; 0 likewise")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", metavar="KIND:NUMBER", help="run one case and show how it ends")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    if options.only:
        kind, _, number = options.only.rpartition(":")
        show(options.seed, kind, int(number))
        return
    began = time.monotonic()
    rows = list(run(options.seed, [*cases(options.cases), *whole_runs(options.whole)]))
    before = earlier(options.out)
    report = tabulated(rows, before) | ({"rows": before["rows"]} if "rows" in before else large())
    report |= {"seed": options.seed, "limit_s": fuzzing.LIMIT_S, "whole_limit_s": fuzzing.WHOLE_LIMIT_S}
    minutes = (time.monotonic() - began) / 60.0
    asked = {"cases": options.cases, "whole": options.whole}
    made = {k: f"`--{k} {n} --seed {options.seed}` in {minutes:.1f} minutes" for k, n in asked.items() if n}
    report["made"] = before.get("made", {}) | made
    text = page(report)
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "fuzz.json").write_text(json.dumps(report, indent=1) + "\n")
        (options.out / "README.md").write_text(text)
    print(text)
    sys.exit(1 if report["wrong"] else 0)


def cases(count: int) -> Iterator[tuple[str, int]]:
    """Yield kind and number of each case, the kinds in proportion to their share."""
    brief = {kind: share for kind, (share, _) in fuzzing.KINDS.items() if kind not in fuzzing.WHOLE}
    for kind, share in brief.items():
        for number in range(-(-count * share // sum(brief.values()))):
            yield kind, number


def whole_runs(count: int) -> Iterator[tuple[str, int]]:
    """Yield kind and number of each complete run of a command."""
    for kind in fuzzing.WHOLE:
        for number in range(count):
            yield kind, number


def earlier(folder: Path | None) -> dict[str, Any]:
    """Return the report of an earlier run; kinds that are not run again are kept."""
    path = folder / "fuzz.json" if folder else None
    return json.loads(path.read_text()) if path and path.is_file() else {}


def show(seed: int, kind: str, number: int) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.chdir(folder)
        case = fuzzing.make(seed, kind, number, folder)
        print(case.arguments, fuzzing.attempt(case, folder))


def run(seed: int, waiting: list[tuple[str, int]]) -> Iterator[dict[str, Any]]:
    """Yield how each case ended; a process that died or hung is replaced by another."""
    context = multiprocessing.get_context("spawn")
    while waiting:
        mine, theirs = context.Pipe()
        process = context.Process(target=work, args=(theirs, seed, waiting), daemon=True)
        process.start()
        theirs.close()
        for row in answers(mine, process):
            yield row | dict(zip(("kind", "number"), waiting.pop(0), strict=True))
            if len(waiting) % 500 == 0:
                print(f"{len(waiting)} to go", file=sys.stderr, flush=True)
        process.kill()
        process.join()


def answers(pipe: Connection, process: multiprocessing.process.BaseProcess) -> Iterator[dict[str, Any]]:
    """Yield the answers of a process until it ends, and the reason if it did not finish its work."""
    patience = fuzzing.WHOLE_LIMIT_S + 120.0  # imports, and the run that later cases break
    while True:
        if not pipe.poll(patience):
            yield {"ended": "hang", "words": "killed", "seconds": patience}
            return
        try:
            row = pipe.recv()
        except EOFError:
            process.join(GRACE_S)
            yield {"ended": "crash", "words": f"exit {process.exitcode}", "seconds": 0.0}
            return
        if row is None:
            return
        yield row
        patience = fuzzing.WHOLE_LIMIT_S + GRACE_S


def work(pipe: Connection, seed: int, waiting: list[tuple[str, int]]) -> None:
    """Run cases one after another, each in an empty folder."""
    fuzzing.finished_run()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    root = Path(tempfile.mkdtemp())
    try:
        for kind, number in waiting:
            folder = root / "case"
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            os.chdir(folder)
            case = fuzzing.make(seed, kind, number, folder)
            began = time.monotonic()
            outcome = fuzzing.attempt(case, folder)
            seconds = time.monotonic() - began
            pipe.send({"ended": outcome.ended, "words": outcome.words[-600:], "seconds": seconds})
        pipe.send(None)
    finally:
        shutil.rmtree(root, ignore_errors=True)


def large() -> dict[str, Any]:
    """Return the cost of an import of two million rows."""
    with tempfile.TemporaryDirectory() as name:
        path, out = Path(name) / "walk.csv", Path(name) / "out"
        with path.open("w") as file:
            file.write("t_s,x_m,z_m\n")
            for i in range(ROWS):
                file.write(f"{0.001 * i:.3f},{1e-5 * i + 1e-3 * (i % 7):.5f},{2e-3 * (i % 3)}\n")
        code = "from gaitopt.cli import main; raise SystemExit(main())"
        began = time.monotonic()
        command = [sys.executable, "-c", code, "import", str(path), "--gait", "square-1s", "--out", str(out)]
        done = subprocess.run(command, capture_output=True, check=False)
        peak_kb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
        seconds = time.monotonic() - began
    return {"rows": {"rows": ROWS, "exit": done.returncode, "seconds": seconds, "peak_gb": peak_kb / 1e6}}


def tabulated(rows: list[dict[str, Any]], before: dict[str, Any]) -> dict[str, Any]:
    """Return the table by kind, and every case with a forbidden end."""
    kinds = {}
    for kind in fuzzing.KINDS:
        mine = [row for row in rows if row["kind"] == kind]
        if not mine and kind in before.get("kinds", {}):
            kinds[kind] = before["kinds"][kind]
            continue
        ended = Counter(row["ended"] if row["ended"] in ENDS else "wrong" for row in mine)
        seconds = [row["seconds"] for row in mine]
        kinds[kind] = {
            "cases": len(mine),
            **{end: ended[end] for end in (*ENDS, "wrong")},
            "messages": len(
                {row["words"].partition(": found")[0] for row in mine if row["ended"] == "stated"}
            ),
            "total_s": sum(seconds),
            "longest_s": max(seconds, default=0.0),
        }
    run = {row["kind"] for row in rows}
    wrong = [row for row in before.get("wrong", []) if row["kind"] not in run]
    wrong += [row for row in rows if row["ended"] not in ENDS]
    return {"cases": sum(row["cases"] for row in kinds.values()), "kinds": kinds, "wrong": wrong}


def page(report: dict[str, Any]) -> str:
    """Return the README of the results folder."""
    wrong = len(report["wrong"])
    verdict = "none ended otherwise" if not wrong else f"{wrong} ended otherwise"
    lines = [
        "# Fuzzing",
        "",
        f"{report['cases']} generated inputs, broken or hostile: files of every kind that gaitopt reads, "
        "most with one to four errors, command lines, and complete runs of commands on such files, with few "
        "starts and samples.",
        "",
        "Each case must succeed, or end with exactly one line on standard error and exit code 1 or 2, "
        f"within {report['limit_s']:g} s (complete runs: {report['whole_limit_s']:g} s). It must leave no "
        "half-written file and change no input. It may change a file of the user only if it succeeds. "
        f"**{verdict.capitalize()}.**",
        "",
        "Made by `python tests/studies/fuzz.py --out results/fuzz` with "
        f"{' and with '.join(report['made'].values())} on a busy core. The changelog lists what earlier runs "
        "found; each finding has a test in `tests/whole/`.",
        "",
        "| input | cases | success | one line, exit 1 | one line, exit 2 | otherwise | total [s] "
        "| longest [s] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for kind, row in report["kinds"].items():
        counts = " | ".join(str(row[key]) for key in ("cases", *ENDS, "wrong"))
        lines.append(f"| {kind} | {counts} | {row['total_s']:.0f} | {row['longest_s']:.1f} |")
    rows = report["rows"]
    lines += [
        "",
        f"A plain CSV file of {rows['rows']:,} rows is imported in {rows['seconds']:.0f} s with at most "
        f"{rows['peak_gb']:.1f} GB of memory, exit code {rows['exit']}.",
    ]
    for row in report["wrong"]:
        lines += ["", f"- `{row['kind']}:{row['number']}`: {row['ended']}: `{row['words'].strip()[-200:]!r}`"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
