"""Table and plot of `rivals.py`'s runs: expected running times to a share of the best known speed.

    python tests/studies/rivals_table.py --out results/rivals

The target is a share of the lowest cost known: of any run here, or of a longer search given with ``--known``.
The expected running time is the total effort of a method's runs divided by the number of them that reached
the target (Hansen et al., COCO).

Cost: seconds.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from rivals import CASES, METHODS

from gaitopt.core.errors import GaitoptError
from gaitopt.report.figures.style import COLOURS

TARGETS = (0.9, 0.95, 0.99)

CURVE = np.linspace(0.5, 0.99, 50)
"""Targets of the plot, as shares of the best known."""

STYLES = ("-", "--", ":", "-.")

Run = dict[str, Any]


def spent_until(run: Run, target: float) -> tuple[float, float, bool]:
    """Return gaits and simulated seconds until a cost is reached, else in total; and if it was."""
    plan = run.get("plan_simulated_s", 0.0)
    for gaits, seconds, cost in run["improvements"]:
        if cost <= target:
            return gaits, seconds + plan, True
    return run["evaluations"], run["simulated_s"] + plan, False


def expected(runs: Sequence[Run], target: float) -> dict[str, float | int | None]:
    """Return the successes, and the expected running time in gaits and in simulated seconds."""
    gaits, seconds, reached = zip(*(spent_until(run, target) for run in runs), strict=True)
    successes = sum(reached)
    return {
        "successes": successes,
        "gaits": sum(gaits) / successes if successes else None,
        "simulated_s": sum(seconds) / successes if successes else None,
        "spent_s": sum(seconds),
    }


def by_method(runs: Sequence[Run], case: str) -> dict[str, list[Run]]:
    """Return the runs of a case by method.

    Raises:
        GaitoptError: some runs have another objective than the others.
    """
    mine = [run for run in runs if run["case"] == case]
    if len({run["mark"] for run in mine}) > 1:
        raise GaitoptError(f"{case}: runs of different objectives in one file")
    methods = [method for method in METHODS if any(run["method"] == method for run in mine)]
    return {method: [run for run in mine if run["method"] == method] for method in methods}


def table(case: str, runs: dict[str, list[Run]], best: float) -> tuple[list[str], dict[str, Any]]:
    """Return a case's table as Markdown lines and as data."""
    lines = [
        f"## {case}",
        "",
        f"{CASES[case]} gaits per run; the best known is {-1e3 * best:.1f} mm/s. Each cell: number of runs "
        "that reached the target, expected gaits, expected simulated seconds (plan included). If no run "
        "reached it: the seconds that all of them spent.",
        "",
        "| method | runs | median end, mm/s | " + " | ".join(f"{share:.0%}" for share in TARGETS) + " |",
        "|---|---|---|" + "---|" * len(TARGETS),
    ]
    content: dict[str, Any] = {"best_known_cost": best, "methods": {}}
    for method, mine in runs.items():
        end = float(np.median([run["improvements"][-1][2] for run in mine]))
        rows = {str(share): expected(mine, share * best) for share in TARGETS}
        content["methods"][method] = {"runs": len(mine), "median_end_cost": end, "targets": rows}
        lines.append(
            f"| {method} | {len(mine)} | {-1e3 * end:.1f} | " + " | ".join(map(_cell, rows.values())) + " |"
        )
    return [*lines, ""], content


def _cell(row: dict[str, Any]) -> str:
    if not row["successes"]:
        return f"0; none in {row['spent_s']:,.0f} s"
    return f"{row['successes']}; {row['gaits']:,.0f}; {row['simulated_s']:,.0f} s"


def curve(runs: Sequence[Run], best: float, column: int) -> tuple[list[float], list[float]]:
    """Return the effort and the share of run-target pairs reached by then, as steps."""
    hits = [spent_until(run, share * best) for run in runs for share in CURVE]
    reached = sorted(hit[column] for hit in hits if hit[2])
    return reached, [(i + 1) / len(hits) for i in range(len(reached))]


def draw(runs: dict[str, dict[str, list[Run]]], best: dict[str, float], path: Path) -> None:
    """Draw the share of targets reached against simulated seconds and gaits, one column a case."""
    figure, grid = plt.subplots(
        2, len(runs), figsize=(3.9 * len(runs), 7.2), sharey=True, squeeze=False, layout="constrained"
    )
    for axes_of_case, case in zip(grid.T, runs, strict=True):
        labels = ((1, "simulated seconds, the plan's included"), (0, "gaits"))
        for axes, (column, label) in zip(axes_of_case, labels, strict=True):
            for method, mine in runs[case].items():
                number = METHODS.index(method)
                spent, share = curve(mine, best[case], column)
                most = max(spent_until(run, -math.inf)[column] for run in mine)
                axes.step(
                    [*spent, most],
                    [*share, share[-1] if share else 0.0],
                    where="post",
                    color=COLOURS[number % len(COLOURS)],
                    linestyle=STYLES[number // len(COLOURS)],
                    linewidth=2.4 if method.startswith("gaitopt") else 1.3,
                    label=method,
                )
            axes.set_xscale("log")
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.set_xlabel(label)
            axes.set_ylim(0.0, 1.0)
            axes.grid(color="0.88", linewidth=0.6)
        axes_of_case[0].set_title(f"{case}, {CASES[case]} gaits a run", fontsize=10)
    for axes in grid[:, 0]:
        axes.set_ylabel("share of targets reached\n(50 to 99 % of the best known)")
    handles = {h.get_label(): h for axes in grid[0] for h in axes.get_lines()}
    figure.legend(handles=list(handles.values()), loc="outside lower center", ncols=4, fontsize=9)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Write table and plot."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--known", nargs="*", default=[], metavar="CASE=COST", help="from longer searches")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    records = [json.loads(line) for line in (options.out / "runs.jsonl").read_text().splitlines()]
    known = dict(item.split("=") for item in options.known)
    runs = {case: by_method(records, case) for case in CASES}
    best = {}
    lines, content = ["# Expected running times", ""], {}
    for case, mine in runs.items():
        ends = [run["improvements"][-1][2] for rows in mine.values() for run in rows]
        best[case] = min([*ends, float(known.get(case, math.inf))])
        rows, content[case] = table(case, mine, best[case])
        lines += rows
    (options.out / "table.md").write_text("\n".join(lines))
    (options.out / "rivals.json").write_text(json.dumps(content, indent=1) + "\n")
    draw(runs, best, options.out / "rivals.png")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
