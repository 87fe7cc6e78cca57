"""Coverage-guided fuzzing of every parser: no bytes end a reader otherwise than in a value or one line.

Atheris instruments gaitopt, so that libFuzzer keeps the inputs that reach new code and changes these further.
Each reader runs in a process of its own, from one good file as its seed.

    pip install atheris
    python tests/studies/fuzz_coverage.py --seconds 20 --seed 1 --out results/fuzz
    python tests/studies/fuzz_coverage.py --only gait --seconds 600 --seed 2

Cost: the seconds asked for, for each of 9 readers, on one core.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))


def main() -> None:
    """Fuzz each reader and write ``coverage.json`` and ``coverage.md``."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=int, default=20, help="of each reader")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", metavar="READER")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--within", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.within is not None:
        fuzz(options.only, options.within, options.seconds, options.seed)
        return
    names = SEEDS if options.only is None else [options.only]
    rows = [fuzzed(name, options.seconds, options.seed) for name in names]
    text = page(rows, options.seconds, options.seed)
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "coverage.json").write_text(json.dumps(rows, indent=1) + "\n")
        (options.out / "coverage.md").write_text(text)
    print(text)
    sys.exit(1 if any(row["wrong"] for row in rows) else 0)


SEEDS = ("gait", "table", "problem", "MJCF", "import", "journal", "summary", "diagnosis", "calibration")
"""The readers."""


def fuzzed(name: str, seconds: int, seed: int) -> dict[str, Any]:
    """Fuzz one reader in a process of its own, and return what libFuzzer and the reader say."""
    with tempfile.TemporaryDirectory() as folder:
        options = ["--only", name, "--seconds", str(seconds), "--seed", str(seed), "--within", folder]
        done = subprocess.run([sys.executable, __file__, *options], capture_output=True, check=False)
        said = done.stderr.decode(errors="replace")
        found = Path(folder) / "wrong.jsonl"
        wrong = [json.loads(line) for line in found.read_text().splitlines()] if found.exists() else []
    states = re.findall(r"cov: (\d+) ft: (\d+) corp: (\d+)/", said)
    units = re.findall(r"number_of_executed_units: (\d+)", said)
    if not states or not units:
        wrong.append({"error": f"exit {done.returncode}: {said[-500:]}", "input": ""})
        return {"reader": name, "inputs": 0, "covered": [0, 0], "kept": 0, "wrong": wrong}
    covered = [int(states[0][0]), int(states[-1][0])]
    return {
        "reader": name,
        "inputs": int(units[-1]),
        "covered": covered,
        "kept": int(states[-1][2]),
        "wrong": wrong,
    }


def fuzz(name: str, folder: Path, seconds: int, seed: int) -> None:
    """Fuzz one reader in this process, which libFuzzer ends."""
    import atheris

    with atheris.instrument_imports(include=["gaitopt"]):
        read, good = reader(name, folder)
    from gaitopt.core.errors import GaitoptError

    known: set[str] = set()

    def one(data: bytes) -> None:
        try:
            read(data)
        except GaitoptError as error:
            if "\n" in str(error):
                note(data, f"not one line: {error}")
        except Exception as error:
            frames = [
                frame for frame in traceback.extract_tb(error.__traceback__) if "gaitopt" in frame.filename
            ]
            where = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "?"
            note(data, f"{type(error).__name__} at {where}: {str(error)[:200]}")

    def note(data: bytes, what: str) -> None:
        place = what.partition(": ")[0]
        if place not in known:
            known.add(place)
            with (folder / "wrong.jsonl").open("a") as file:
                file.write(json.dumps({"error": what, "input": data.hex()[:4000]}) + "\n")

    corpus = folder / "corpus"
    corpus.mkdir()
    (corpus / "good").write_bytes(good)
    flags = [f"-max_total_time={seconds}", f"-seed={seed}", "-print_final_stats=1", "-rss_limit_mb=4096"]
    atheris.Setup([sys.argv[0], *flags, "-max_len=8192", "-timeout=60", str(corpus)], one)
    atheris.Fuzz()


def reader(name: str, folder: Path) -> tuple[Callable[[bytes], object], bytes]:
    """Return what reads some bytes as a file of its kind, and a good file."""
    import fuzzing.material as material
    from helpers import STRIDER

    from gaitopt.core.files import read_toml
    from gaitopt.core.validation import validated
    from gaitopt.diagnose.record.export import ImportOptions
    from gaitopt.diagnose.record.importing import import_file
    from gaitopt.gait.calibration import Calibration
    from gaitopt.gait.gait import read_gait
    from gaitopt.gait.table import read_table
    from gaitopt.optimise.journal import Journal
    from gaitopt.problem.model import build_model
    from gaitopt.problem.problem import load_problem
    from gaitopt.runs.diagnosis_folder import read_diagnosis
    from gaitopt.runs.summary import Summary

    robot = folder / "robot"
    robot.mkdir()
    for path in STRIDER.iterdir():
        (robot / path.name).write_bytes(path.read_bytes())
    problem = load_problem(STRIDER)
    stride = problem.baselines["stride"]

    good = {
        "gait": (folder / "gait.toml", read_gait, stride.to_toml().encode()),
        "table": (folder / "table.c", read_table, material.table_text(stride, "c").encode()),
        "problem": (robot / "problem.toml", lambda _: load_problem(robot), b""),
        "MJCF": (robot / "strider.xml", lambda _: build_model(load_problem(robot)), b""),
        "import": (folder / "walk.txt", lambda path: import_file(path, ImportOptions()), IMPORTED),
        "journal": (
            folder / "evaluations.csv",
            lambda path: Journal(path, problem),
            material.finished_run()["evaluations.csv"],
        ),
        "summary": (folder / "summary.json", Summary.read, material.finished_run()["summary.json"]),
        "diagnosis": (folder / "diagnosis.json", lambda _: read_diagnosis(folder), DIAGNOSED),
        "calibration": (
            folder / "servo.toml",
            lambda path: validated(Calibration, read_toml(path), path),
            b"pin = 3\nneutral_us = 1500\nmin_us = 500\nmax_us = 2500\nus_per_deg = 11.1\ndirection = -1\n",
        ),
    }
    path, read, seed = good[name]
    seed = seed or path.read_bytes()

    def written(data: bytes) -> object:
        path.write_bytes(data)
        return read(path)

    return written, seed


IMPORTED = b"mass_A\nt\tx\ty\n" + b"".join(b"%d.%d\t0.%d\t0.1\n" % (i // 10, i % 10, i) for i in range(40))
"""An export of Tracker."""

DIAGNOSED = b'{"verdict": "no_gap", "answer": "No significant gap.", "explanation": ["walk: no gap."]}\n'
"""What is printed of a finished diagnosis."""


def page(rows: list[dict[str, Any]], seconds: int, seed: int) -> str:
    """Return the page of the figures."""
    wrong = sum(len(row["wrong"]) for row in rows)
    lines = [
        "# Coverage-guided fuzzing of the parsers",
        "",
        f"{sum(row['inputs'] for row in rows):,} inputs by libFuzzer through Atheris, {seconds} s for each "
        "reader. Each input must end in a value or in one line of gaitopt's own error. "
        f"**{wrong or 'None'} ended otherwise.**",
        "",
        f"Made by `python tests/studies/fuzz_coverage.py --seconds {seconds} --seed {seed} --out "
        "results/fuzz`. The clock decides how many inputs there are, so the counts differ from run to run.",
        "",
        "| reader | inputs | branches reached at the start | at the end | inputs kept | otherwise |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = (row["reader"], row["inputs"], *row["covered"], row["kept"], len(row["wrong"]))
        lines.append(f"| {' | '.join(map(str, cells))} |")
    lines += [f"\n- {row['reader']}: `{one['error']}`" for row in rows for one in row["wrong"]]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
