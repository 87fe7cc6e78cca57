"""Every command of the README, the page of commands and the tutorials, in order, at full budget.

    python tests/studies/walk.py [--budget N] [--out DIR]

Run by hand, with the `gaitopt` that is on the path; two cores take about half an hour. The commands run in a
new folder, on the robots as they are bundled, and `walk.csv` there has the time of each one. The tests run
the same commands with small budgets.

Cost: half an hour of two cores.
"""

import argparse
import csv
import re
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "whole"))
from test_docs import ROOT, commands_in, film_of_a_robot, readme


def walk(commands: list[str], folder: Path, budget: int | None) -> list[tuple[str, float]]:
    """Run commands in a folder, one after another, until one fails.

    Args:
        commands: shell lines.
        folder: where they run.
        budget: gaits of each search; None for the budget in the line.

    Returns:
        Each command with the seconds it took.
    """
    folder.mkdir(exist_ok=True)
    took = []
    for command in commands:
        if budget is not None and re.match(r"gaitopt optimise(?!.*--resume)", command):
            command = re.sub(r"\s--budget \d+", "", command) + f" --budget {budget}"
        began = time.monotonic()
        subprocess.run(["bash", "-euc", command], check=True, cwd=folder)
        took.append((command, time.monotonic() - began))
        print(f"== {took[-1][1]:.0f} s: {command}", flush=True)
    return took


def main() -> None:
    """Run the commands of all pages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--budget", type=int, metavar="N", help="gaits of each search (default: as written)")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", default=Path("results/runs/walk"), help="a new folder"
    )
    options = parser.parse_args()
    out = options.out.resolve()
    out.mkdir(parents=True)  # refuses a folder that was used
    film_of_a_robot(out / "walk.txt")
    took = walk(["cp ../walk.txt .", *readme()], out / "readme", options.budget)
    for page in ("tutorial", "your-robot", "film-and-diagnose", "one-servo"):
        folder = out / page
        folder.mkdir()
        commands = list(commands_in((ROOT / "docs" / f"{page}.md").read_text(), folder))
        took += walk(commands, folder, options.budget)
    with (out / "walk.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("command", "seconds"), *((c, f"{s:.1f}") for c, s in took)])


if __name__ == "__main__":
    main()
