"""Kill -9 in every stage, then --resume: is the result that of an undisturbed run, to the last bit?

A case is one run folder. The run is killed in its first stage, at a random moment of that stage. The run that
goes on is killed in the next stage, and so on; the last one ends undisturbed. A search has twelve stages, a
diagnosis as well. Each kill must land: the process ends by SIGKILL, and its marker names the stage. See
``tests/ending.py``. A study that was ended goes on with the cases that are missing.

    python tests/studies/kill_resume.py --cases 20 --seed 1 --out results/kill-resume

Cost: about 20 s a search and 25 s a diagnosis on one busy core, so about 15 min for 20 of each.
"""

from __future__ import annotations

import argparse
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from ending import Stop, Work, diagnosis, result, search, small_trials
from kept import read_kept, version, write_kept

from gaitopt.core.json import to_json

JOBS = ("optimise", "diagnose")


def main() -> None:
    """Run the cases and write ``kill-resume.json`` and ``README.md``."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--cases", type=int, default=20, help="of each job")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--job", choices=JOBS, help="only this one")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    path = options.out / "cases.jsonl"
    with tempfile.TemporaryDirectory() as folder:
        small_trials(Path(folder) / "trials")
        for job in JOBS if options.job is None else (options.job,):
            rows = study(job, options, Path(folder), path)
    rows = read_kept(path, options.seed)
    text = page(rows, options.seed)
    (options.out / "README.md").write_text(text)
    (options.out / "kill-resume.json").write_text(to_json({"made_at": version(), "stages": tabulated(rows)}))
    print(text)


def work_of(job: str, folder: Path, trials: Path, workers: int) -> Work:
    return search(folder, workers=workers) if job == "optimise" else diagnosis(folder, trials, workers)


def study(job: str, options: argparse.Namespace, folder: Path, path: Path) -> list[dict[str, Any]]:
    """Run the cases of one job that are not done yet, and keep each."""
    rows, trials = read_kept(path, options.seed), folder / "trials"
    done = {row["case"] for row in rows if row["job"] == job}
    waiting = [case for case in range(options.cases) if case not in done]
    if not waiting:
        return rows
    whole = work_of(job, folder / f"{job}-whole", trials, 1)
    ticks = whole.run().ticks
    expected = result(whole.folder)
    for case in waiting:
        began = time.monotonic()
        work = work_of(job, folder / f"{job}-{case}", trials, 1 + case % 2)
        kills = killed(work, ticks, random.Random(f"{options.seed}/{job}/{case}"))
        ended = work.run()
        same = ended.code == 0 and not ended.err and result(work.folder) == expected
        row = {"job": job, "case": case, "seed": options.seed, "workers": 1 + case % 2, "kills": kills}
        rows.append(row | {"same": same, "seconds": time.monotonic() - began, "error": ended.err})
        write_kept(path, rows)
        print(f"{job} {case}: {'same bits' if same else 'OTHER BITS'}", file=sys.stderr, flush=True)
    return rows


def killed(work: Work, ticks: dict[str, int], rng: random.Random) -> list[dict[str, Any]]:
    """Kill a run in each of its stages, in the first half of each, and return where it happened.

    What an earlier run simulated is not simulated again, so the second half may never come.
    """
    kills = []
    for stage in work.stages:
        tick = rng.randint(1, max(1, ticks[stage] // 2))
        ended = work.run(Stop(stage, tick))
        landed = ended.code == -signal.SIGKILL and ended.marker.get("stage") == stage
        kills.append({"stage": stage, "tick": tick, "at": ended.marker.get("at"), "landed": landed})
    return kills


def tabulated(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return a row of each stage of each job: kills that landed, and cases that ended with the same bits."""
    table = []
    for job in JOBS:
        mine = [row for row in rows if row["job"] == job]
        for stage in dict.fromkeys(kill["stage"] for row in mine for kill in row["kills"]):
            kills = [(kill, row["same"]) for row in mine for kill in row["kills"] if kill["stage"] == stage]
            at = Counter("a file" if "." in str(kill["at"]) else str(kill["at"]) for kill, _ in kills)
            table.append(
                {
                    "job": job,
                    "stage": stage,
                    "cases": len(kills),
                    "landed": sum(kill["landed"] for kill, _ in kills),
                    "same": sum(same for _, same in kills),
                    "moments": len({kill["tick"] for kill, _ in kills}),
                    "at": dict(at),
                }
            )
    return table


def page(rows: list[dict[str, Any]], seed: int) -> str:
    """Return the README of the results folder."""
    table, count = tabulated(rows), Counter(row["job"] for row in rows)
    same, minutes = sum(row["same"] for row in rows), sum(row["seconds"] for row in rows) / 60.0
    lines = [
        "# Kill and resume",
        "",
        f"{count['optimise']} searches of 24 gaits and {count['diagnose']} diagnoses of one trial on the "
        "strider, each killed with SIGKILL in every one of its stages, resumed after each kill, and compared "
        f"with an undisturbed run: **{same} of {len(rows)} end with its bits** (all files; of the summary "
        "all but `wall_s`; pages and films are only compared by name). Brief studies, one worker in every "
        "second case, two in the others.",
        "",
        "A kill counts as landed if the process ended by SIGKILL and its marker names the stage. The moment "
        "is random among the first half of the stage's ticks: its call, each start of a rollout, and each "
        "moment before a written file gets its name.",
        "",
        f"Made with seed {seed} in {minutes:.1f} minutes of a busy core by "
        + " and ".join(
            f"`python tests/studies/kill_resume.py --job {job} --cases {count[job]} "
            "--out results/kill-resume`"
            for job in JOBS
        )
        + "; with more cases it adds those that are missing.",
        "",
        "| job | killed in | kills | landed | same bits at the end | different moments | at |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in table:
        at = ", ".join(f"{what} {n}" for what, n in row["at"].items())
        cells = [row[key] for key in ("job", "stage", "cases", "landed", "same", "moments")]
        lines.append(f"| {' | '.join(map(str, cells))} | {at} |")
    wrong = [row for row in rows if not row["same"]]
    lines += [""] * bool(wrong) + [f"- {row['job']} {row['case']}: {row['error'].strip()}" for row in wrong]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
