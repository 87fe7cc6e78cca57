"""Memory and open files of a long search: do they grow with the number of gaits?

A search of 3,000 gaits on the strider, its horizon shortened to a cycle. Every 100 gaits the resident memory
and the open file descriptors of the process are read from ``/proc``.

    python tests/studies/memory.py --budget 3000 --seed 1 --out results/memory

Cost: about 2 min of one core.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from fuzzing.runs import tiny

from gaitopt.core.files import write_text
from gaitopt.core.json import to_json
from gaitopt.core.progress import Progress
from gaitopt.jobs.optimise import optimise
from gaitopt.optimise.recorder import SearchProgress
from gaitopt.problem.problem import load_problem

EVERY = 100
"""Gaits between two readings."""

SETTLED = 500
"""Gaits after which modules, caches and threads are there: growth is counted from here."""


def main() -> None:
    """Run the search and write ``memory.json`` and ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--budget", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--executor", default="threads")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    rows: list[dict[str, float]] = []

    def note(progress: Progress) -> None:
        if isinstance(progress, SearchProgress) and progress.done >= EVERY * (len(rows) + 1):
            rows.append({"gaits": progress.done, "rss_mib": rss_mib(), "files": open_files()})

    began = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        problem = load_problem(tiny(Path(name)))
        optimise(
            problem,
            budget=options.budget,
            seed=options.seed,
            executor=options.executor,
            workers=2,
            out=Path(name) / "run",
            on_progress=note,
        )
    report = {"budget": options.budget, "seed": options.seed, "executor": options.executor}
    report |= {"seconds": time.monotonic() - began, "end_mib": rss_mib(), "end_files": open_files()}
    report |= {"peak_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, "rows": rows}
    options.out.mkdir(parents=True, exist_ok=True)
    write_text(options.out / "memory.json", to_json(report))
    write_text(options.out / "README.md", page(report))
    print(page(report))


def rss_mib() -> float:
    """Return the resident memory of this process, MiB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20


def open_files() -> int:
    """Return how many file descriptors this process has open."""
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


def page(report: dict[str, Any]) -> str:
    """Return the README of the results folder."""
    rows = report["rows"]
    settled = next(row for row in rows if row["gaits"] >= SETTLED)
    grown = rows[-1]["rss_mib"] - settled["rss_mib"]
    each = 1024 * grown / (rows[-1]["gaits"] - settled["gaits"])
    lines = [
        "# Memory and open files of a long search",
        "",
        f"A search of {report['budget']} gaits on the strider with a horizon of one cycle. From gait "
        f"{settled['gaits']} to gait {rows[-1]['gaits']} the resident memory grows by **{grown:.1f} MiB** "
        f"({each:.1f} KiB a gait; the search keeps each gait with its metrics), and the open files go from "
        f"{settled['files']} to **{rows[-1]['files']}**. With the report, the peak is "
        f"{report['peak_mib']:.0f} MiB; at the end {report['end_files']} files are open.",
        "",
        f"Made by `python tests/studies/memory.py --budget {report['budget']} --seed {report['seed']} "
        f"--executor {report['executor']} --out results/memory` in {report['seconds']:.0f} s of a busy core.",
        "",
        "| gaits | resident memory [MiB] | open files |",
        "|---|---|---|",
    ]
    shown = rows[:: max(1, len(rows) // 12)]
    if shown[-1] is not rows[-1]:
        shown = [*shown, rows[-1]]
    lines += [f"| {row['gaits']} | {row['rss_mib']:.1f} | {row['files']} |" for row in shown]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
