"""The diagnosis' record on blind cases: made, diagnosed and scored, case by case, resumable.

    python tests/studies/blind_record.py development --work /tmp/blind --out /tmp/blind --seed 900
    python tests/studies/blind_record.py full --work /tmp/blind-full --out results/blind
    python tests/studies/blind_record.py pairs --work /tmp/blind-pairs --out results/blind
    python tests/studies/blind_record.py x-alone --work /tmp/blind-x --out results/blind
    python tests/studies/blind_record.py mixed --work /tmp/blind-mixed --out results/blind
    python tests/studies/blind_record.py several --work /tmp/blind-several --out results/blind
    python tests/studies/blind_record.py several-x --work /tmp/blind-several-x --out results/blind

OUT/PLAN.jsonl has one line for each finished case; nothing else is needed to continue on another machine.
Cases share the rollouts that every diagnosis begins with. So all cases but the first two cost less than a
single diagnosis. The simulations of a case are kept in the work folder. If only the conclusions of the method
have changed, remove OUT/PLAN.jsonl and run it again; this takes seconds per case. If the residuals have
changed, remove WORK/memory too.

Cost: about 4 h of two cores for `full`, 3 h for `x-alone`, 1.5 h for `pairs`, 15 h for both of `several`.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from against_truth import against_truth, worth
from kept import read_kept, version, write_kept
from shared_rollouts import shared_rollouts

from gaitopt.blind.answers import Case
from gaitopt.blind.cases import CaseRequest, kinds_of, make_case
from gaitopt.blind.disturbances import OUTSIDE
from gaitopt.blind.factory import CaseFactory, RecordingPlan
from gaitopt.blind.scoring import Score, score, sentences
from gaitopt.blind.sealed import truth_path
from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import write_text
from gaitopt.core.json import to_json
from gaitopt.diagnose.diagnosis import DiagnosisRequest, diagnose
from gaitopt.diagnose.fit.cache import SimulationCache
from gaitopt.diagnose.fit.settings import FitSettings
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.effects import EFFECTS
from gaitopt.optimise.executors import open_executor
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.rollout import Simulator

GAITS = ("square-4s", "square-2s", "square-1s")
SECONDS = 10.0

REQUEST = DiagnosisRequest(seed=1, next_gait=False)

Planned = tuple[str, str | None]
"""The kind of a case, and its effects if they are not drawn."""


@dataclass(frozen=True)
class Plan:
    """The cases of a record."""

    seed: int
    signals: tuple[str, ...] | None
    cases: tuple[Planned, ...]


def _development() -> Plan:
    return Plan(1, None, tuple((kind, None) for kind in kinds_of(40, 1)))


def _full() -> Plan:
    """Each effect three times, each disturbance five times, pairs and cases without effect at random.

    The effects drawn at random at the end stand in for those that cannot reach three floors.
    """
    names = sorted(name for name, effect in EFFECTS.items() if not effect.found_in_record)
    singles: list[Planned] = [("single", name) for name in names for _ in range(3)]
    drawn: list[Planned] = [(kind, None) for kind in ["none"] * 60 + ["pair"] * 15 + ["single"] * 12]
    return Plan(851, None, tuple(singles + _outside(5) + drawn))


def _outside(each: int) -> list[Planned]:
    return [("outside", name) for name in sorted(OUTSIDE) for _ in range(each)]


def _pairs() -> Plan:
    """Pairs, disturbances that no pair should explain, then more pairs, which narrow the interval."""
    drawn: list[Planned] = [("pair", None)] * 10
    return Plan(862, None, (*drawn, *drawn, *_outside(4), *drawn))


def _x_alone() -> Plan:
    """Forty cases of all kinds, then more cases to narrow the intervals of the goals for x alone."""
    counts = [("single", 24), ("none", 8), ("outside", 4), ("pair", 4), ("none", 52), ("single", 16)]
    return Plan(852, ("marker.x",), tuple((kind, None) for kind, count in counts for _ in range(count)))


def _mixed() -> Plan:
    """All kinds but several effects, in random order, so that any first part of them is a fair sample."""
    return Plan(885, None, tuple((kind, None) for kind in kinds_of(40, 885)))


def _several() -> Plan:
    """Robots that are a little wrong in everything, with one to four effects and misfit trials."""
    return Plan(893, None, (("several", None),) * 120)


def _several_x() -> Plan:
    """The same with x of the marker alone."""
    return Plan(884, ("marker.x",), (("several", None),) * 60)


PLANS: dict[str, Callable[[], Plan]] = {
    "development": _development,
    "full": _full,
    "pairs": _pairs,
    "x-alone": _x_alone,
    "mixed": _mixed,
    "several": _several,
    "several-x": _several_x,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("plan", choices=PLANS)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--until", type=float, default=1e9, help="begin no case after so many seconds")
    parser.add_argument("--seed", type=int, help="another seed: to develop with")
    options = parser.parse_args()
    plan, kept = PLANS[options.plan](), options.out / f"{options.plan}.jsonl"
    seed = plan.seed if options.seed is None else options.seed
    done = {row["case"]: row for row in read_kept(kept, seed)}
    began, problem = time.monotonic(), load_problem("arcfold")
    with open_executor("threads", None) as executor, shared_rollouts(longest(problem)):
        factory = CaseFactory.of(problem, RecordingPlan(GAITS, SECONDS, plan.signals), executor)
        for index, (kind, only) in enumerate(plan.cases):
            if time.monotonic() - began > options.until:
                break
            if (name := f"case-{index:03d}") not in done:
                done[name] = run_case(factory, options.work, index, kind, only, seed, executor)
                write_kept(kept, [done[each] for each in sorted(done)])
    write_record(options.out, options.plan, [done[each] for each in sorted(done)])


def longest(problem: Problem) -> dict[str, float]:
    """Return how long a diagnosis may have to simulate each gait, s."""
    gaits = [problem.baselines[name] for name in GAITS]
    return {g.key: max(SECONDS, 2.1 * g.period_s) + max(g.period_s, 0.3) for g in gaits}


def run_case(
    factory: CaseFactory,
    work: Path,
    index: int,
    kind: str,
    only: str | None,
    seed: int,
    executor: Executor,
) -> dict[str, Any]:
    """Make and diagnose one case; return its record."""
    name = f"case-{index:03d}"
    try:
        if not truth_path(work, name).exists():
            plan = RecordingPlan(list(factory.gaits), factory.seconds, factory.signals)
            make_case(factory, work, index, kind, CaseRequest([kind], seed, plan, only), executor)
    except GaitoptError as unreachable:
        print(f"{name}: {unreachable}", flush=True)
        return {"case": name, "seed": seed, "version": version(), "unreachable": only or kind}
    return diagnosed(factory.problem, work, name, seed, executor)


def diagnosed(problem: Problem, work: Path, name: str, seed: int, executor: Executor) -> dict[str, Any]:
    """Diagnose one case, and return its record.

    Args:
        problem: the nominal robot.
        work: the folder of the cases and of their sealed truth; simulations are kept there.
        name: the case.
        seed: that of the record.
        executor: where robots are simulated.
    """
    sealed, times = truth_path(work, name), work / "times" / f"{name}.json"
    simulator = Simulator.build(problem)
    dataset = load_dataset(work / name, problem, [s for s in simulator.signals if s])
    memory = SimulationCache.of(work / "memory" / name, simulator, dataset, 1)
    begun, spent = time.monotonic(), time.process_time()
    diagnosis = diagnose(simulator, dataset, REQUEST, executor, cache=memory)
    if not times.exists():  # a diagnosis from memory would be too quick
        times.parent.mkdir(parents=True, exist_ok=True)
        took = {"wall_s": time.monotonic() - begun, "cpu_s": time.process_time() - spent}
        write_text(times, json.dumps(took))
    truth = json.loads(sealed.read_text())
    beside = against_truth(diagnosis, truth, executor, REQUEST.seed)
    found = scored(truth, diagnosis.to_dict()) | beside | json.loads(times.read_text())
    row = {"case": name, "seed": seed, "version": version(), "truth": truth, "diagnosis": found}
    print(_line(row), flush=True)
    return row


SCORED = (
    "verdict",
    "causes",
    "ambiguous_with",
    "other_probability",
    "p_value",
    "unevenness",
    "misfit_trials",
    "gap",
    "defects",
)


def scored(truth: dict[str, Any], content: dict[str, Any]) -> dict[str, Any]:
    """Return the parts of a diagnosis that scoring needs: the effects that are planted, named or alike."""
    planted = [row["name"] for row in truth["effects"]]
    names = {*planted, *content["causes"], *content["ambiguous_with"]}
    effects = [r for r in content["effects"] if r["name"] in names or r["alike"] >= FitSettings.alike]
    expected = [r for r in content["predictions"] if r["gait"] in truth["speeds_m_s"]]
    return {key: content[key] for key in SCORED} | {"effects": effects, "predictions": expected}


def _line(row: dict[str, Any]) -> str:
    truth, content = row["truth"], row["diagnosis"]
    planted = " + ".join(f"{e['name']}.{e['target']}" for e in truth["effects"]) or "nothing"
    named = " + ".join(content["causes"]) or "nothing"
    others = ", ".join(content["ambiguous_with"])
    also = f" (or {others})" if others else ""
    times = f"{content['wall_s']:.0f} s, {content['cpu_s']:.0f} s of a core"
    gap = truth["gap_over_floor"]
    return f"{row['case']}: {planted}, {gap:.1f} floors: {content['verdict']}: {named}{also}; {times}"


def write_record(out: Path, plan: str, rows: list[dict[str, Any]]) -> None:
    """Write the record, each case's row, and of single effects the confusion matrix and calibration plot."""
    known = [row for row in rows if "truth" in row]
    cases = [
        Case.model_validate({"name": row["case"], "truth": row["truth"], "diagnosis": row["diagnosis"]})
        for row in known
    ]
    record = score(cases)
    print("\n".join(sentences(record)))
    similar = alike(cases)
    more = {
        "unreachable": sorted({row["unreachable"] for row in rows if "unreachable" in row}),
        "versions": sorted({row["version"] for row in rows}),
        "cost": _cost(known),
        "alike": similar,
        "worth": worth(known, cases),
    }
    figures = {key: value for key, value in record.to_dict().items() if key != "rows"}
    write_text(out / f"{plan}.json", to_json(figures | more))
    lines = [
        "| case | planted | gap, floors | verdict | blamed | not to be told from it | other |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in record.rows:
        lines.append(
            f"| {row.case[5:]} | {', '.join(row.planted) or '–'} | {row.gap_over_floor:.1f} | "
            f"{row.verdict} | {', '.join(row.causes) or '–'} | "
            f"{', '.join(row.ambiguous_with) or '–'} | {row.other_probability or 0.0:.2f} |"
        )
    parts = [*(f"- {s}" for s in sentences(record)), "", *lines, *_alike_table(similar)]
    write_text(out / f"{plan}.md", "\n".join(parts) + "\n")
    if any(case.kind == "single" for case in cases):
        _confusion(out / f"{plan}-confusion.png", cases)
        _calibration(out / f"{plan}-calibration.png", record)


def _alike_table(rows: list[dict[str, Any]]) -> list[str]:
    """Return the lines of a table of effects that are alike; none without any."""
    if not rows:
        return []
    lines = ["", "| planted | other | cases | angle, degrees | both named |", "|---|---|---|---|---|"]
    for row in rows:
        low, high = row["angle_deg"]
        angles = f"{low:.1f} to {high:.1f}"
        lines.append(f"| {row['planted']} | {row['other']} | {row['cases']} | {angles} | {row['named']} |")
    return lines


def _cost(rows: list[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Return medians and largest of wall and core seconds, by kind of case."""
    cost = {}
    for kind in dict.fromkeys(row["truth"]["kind"] for row in rows):
        of_kind = [row["diagnosis"] for row in rows if row["truth"]["kind"] == kind]
        cost[kind] = {
            f"{name}_{key}": float(number([row[key] for row in of_kind]))
            for key in ("wall_s", "cpu_s")
            for name, number in (("median", np.median), ("largest", np.max))
        }
    return cost


def alike(cases: list[Case]) -> list[dict[str, Any]]:
    """Return which effects have the planted one's signature, by the angle between the whitened changes.

    The angle is that to the first candidate's signature, so only cases count in which the planted effect is
    first.
    """
    found: dict[tuple[str, str], list[tuple[float, bool]]] = {}
    for case in cases:
        if case.kind != "single" or case.top not in case.planted:
            continue
        for row in case.diagnosis.effects:
            if row.name not in case.planted and row.alike >= FitSettings.alike:
                angle = math.degrees(math.acos(min(1.0, row.alike)))
                entry = (angle, row.name in case.answer)
                found.setdefault((case.planted[0], row.name), []).append(entry)
    rows = [
        {
            "planted": planted,
            "other": other,
            "cases": len(entries),
            "angle_deg": [min(a for a, _ in entries), max(a for a, _ in entries)],
            "named": sum(named for _, named in entries),
        }
        for (planted, other), entries in found.items()
    ]
    return sorted(rows, key=lambda row: float(np.mean(row["angle_deg"])))


def _confusion(path: Path, cases: list[Case]) -> None:
    """Draw the planted effect against the effect that was named first."""
    counts: dict[tuple[str, str], int] = {}
    for case in cases:
        if case.kind in ("single", "none"):
            pair = ((case.planted or ["nothing"])[0], case.top or "nothing")
            counts[pair] = counts.get(pair, 0) + 1
    names = sorted({name for pair in counts for name in pair})
    table = np.array([[counts.get((row, column), 0) for column in names] for row in names], dtype=float)
    share = table / np.maximum(table.sum(axis=1, keepdims=True), 1.0)
    size = 1.8 + 0.23 * len(names)
    figure, axes = plt.subplots(figsize=(size + 1.0, size), layout="constrained")
    axes.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0)
    for (row, column), count in np.ndenumerate(table):
        if count:
            colour = "white" if share[row, column] > 0.6 else "black"
            axes.text(column, row, f"{count:.0f}", ha="center", va="center", color=colour, fontsize=7)
    axes.set_xticks(range(len(names)), names, rotation=90, fontsize=7)
    axes.set_yticks(range(len(names)), names, fontsize=7)
    axes.set_xlabel("blamed first")
    axes.set_ylabel("planted")
    figure.savefig(path, dpi=150)
    plt.close(figure)


def _calibration(path: Path, record: Score) -> None:
    """Draw how often the first cause was right against the stated probability."""
    figure, axes = plt.subplots(figsize=(4.2, 4.0), layout="constrained")
    axes.plot([0.0, 1.0], [0.0, 1.0], color="0.6", linewidth=1.0, linestyle="--", label="as said")
    rows: list[dict[str, Any]] = [one.to_dict() for one in record.calibration]
    said, right = np.array([r["said"] for r in rows]), np.array([r["value"] for r in rows])
    ends = np.array([r["ci90"] for r in rows]).reshape(-1, 2)
    axes.errorbar(said, right, [right - ends[:, 0], ends[:, 1] - right], fmt="o", color="#0072B2", capsize=3)
    for row in rows:
        below = (row["said"], row["ci90"][0])
        axes.annotate(f"{row['cases']}", below, (0, -13), textcoords="offset points", ha="center")
    axes.set_xlabel("probability said of the first cause")
    axes.set_ylabel("how often it was right")
    axes.set_xlim(0.0, 1.05)
    axes.set_ylim(-0.08, 1.05)
    axes.legend(loc="lower right", frameon=False)
    figure.savefig(path, dpi=150)
    plt.close(figure)


if __name__ == "__main__":
    main()
