"""Rollouts that could end early because their gait has fallen or is too slow: what this would save.

    python tests/studies/stopping.py --out results/profile

Real searches by the default method are observed, with the race over scenarios. Every rollout is simulated to
its end, and each rule says afterwards when it would have ended it.

- *fallen*: once the first body has tilted beyond the problem's limit, anywhere or inside the measured
  cycles, where it is certainly a violation.
- *hopeless*: once some time was measured, the speed so far is below a share of the speed of the best gait
  known when the population was drawn. The gait is then judged by what was measured. The rule was wrong if the
  gait, measured to its end, is in the better half of its population, from which CMA-ES learns, or becomes the
  best gait known.

Savings are shares of the simulated seconds of the whole search.

Cost: about 10 min of one core (estimated).
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import searches
from rivals import ROBOTS
from searches import planned, setting_of

from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import Cost, Evaluated, Evaluator, Outcome, cost_of
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.journal import Entry
from gaitopt.optimise.study import Start
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator

SHARES = (0.0, 0.25, 0.5, 0.75)
"""Shares of the best speed known; slower gaits are ended."""

MEASURED = (0.1, 0.25, 0.5)
"""Shares of the measured time after which this is checked."""

CASES: dict[str, tuple[str | Path, bool, int, int]] = {
    "arcfold, from a plan": ("arcfold", True, 2, 120),
    "arcfold, cold": ("arcfold", False, 2, 120),
    "strider": (ROBOTS / "strider", False, 5, 400),
}
"""Problem, whether it is planned, searches, and gaits of each."""


@dataclass(frozen=True)
class Watched:
    """What a rollout was like before its end.

    Attributes:
        duration: simulated seconds.
        fell: first time of a tilt beyond the limit, s; inf where there is none.
        fell_measured: the same inside the measured cycles.
        looked: end of the whole cycle nearest to each share of the measured time in `MEASURED`, s.
        speeds: forward speed over the measured time up to then, m/s.
    """

    duration: float
    fell: float
    fell_measured: float
    looked: tuple[float, ...]
    speeds: tuple[float, ...]


def watched(problem: Problem, gait: Gait, path: Trajectory) -> Watched:
    """Return what a rollout was like before its end."""
    transient, measured = problem.simulation.horizon.cycles(gait.period_s)
    begin, end = transient * gait.period_s, (transient + measured) * gait.period_s
    forward, _, up = problem.roles.axes
    limit = problem.objective.constraints["tilt_rad"].max or math.inf
    w, x, y, z = (path[f"heading.{part}"] for part in "wxyz")
    third = np.c_[2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
    beyond = path.time[np.arccos(np.clip(third @ up, -1.0, 1.0)) > limit]
    late = beyond[beyond >= begin]
    cycles = [begin + max(1, round(share * measured)) * gait.period_s for share in MEASURED]
    place = sum(forward[i] * path[f"marker.{axis}"] for i, axis in enumerate("xyz"))
    at = np.interp([begin, *cycles], path.time, place)
    speeds = (at[1:] - at[0]) / (np.array(cycles) - begin)
    first = beyond[0] if len(beyond) else math.inf
    fell_measured = late[0] if len(late) else math.inf
    return Watched(end, float(first), float(fell_measured), tuple(cycles), tuple(speeds.tolist()))


@dataclass(frozen=True)
class Watching(Evaluator):
    """An evaluator that keeps the features of every rollout, by gait and scenario, and every population."""

    seen: dict[tuple[str, int], Watched] = field(default_factory=dict)
    raced: list[list[str]] = field(default_factory=list)
    built: list[Simulator] = field(default_factory=list)

    def race(self, gaits: Sequence[Gait], aim: Cost = cost_of) -> list[Evaluated]:
        """Return evaluation and outcomes of a population, and keep its gaits."""
        self.raced.append([gait.name for gait in gaits])
        return super().race(gaits, aim)

    def outcomes(self, gaits: Sequence[Gait], scenarios: Sequence[int] | None = None) -> list[list[Outcome]]:
        """Return the outcome of each gait in each scenario, and keep the features of the rollouts."""
        scenarios = range(len(self.setup.scenarios)) if scenarios is None else scenarios
        return [[self._outcome(gait, scenario) for scenario in scenarios] for gait in gaits]

    def _outcome(self, gait: Gait, scenario: int) -> Outcome:
        problem = self.setup.problem
        if not self.built:
            self.built.append(Simulator.build(problem, self.setup.scenarios, self.setup.fidelity))
        path = self.built[0].run(gait, scenario)
        self.seen[gait.name, scenario] = watched(problem, gait, path)
        metrics = measure(problem, gait, path, Robot.of(self.built[0].models[0]))
        return Outcome(metrics, path.status, self.built[0].duration(gait))


def search(problem: Problem, seed: int, budget: int, warm: bool) -> tuple[list[Entry], Watching, float]:
    """Return a search's entries, the features of its rollouts, and the best speed of the baselines."""
    evaluator = Watching(setting_of(problem, seed), SerialExecutor(), problem.objective.search_margin)
    evaluations = [one.evaluation for one in evaluator(list(problem.baselines.values()))]
    starts = [Start(gait, one) for gait, one in zip(problem.baselines.values(), evaluations, strict=True)]
    study = searches.search(evaluator, budget, seed, starts, planned(problem, seed) if warm else ())
    best = min(evaluations, key=lambda evaluation: evaluation.cost)
    return study.entries, evaluator, best.metrics["speed_m_s"]


def fallen(entries: Sequence[Entry], evaluator: Watching) -> dict[str, float]:
    """Return how many gaits tilt beyond the limit, and the saving of ending there."""
    rows = [rollouts(entry, evaluator) for entry in entries]
    whole = sum(one.duration for row in rows for one in row)
    saved = {
        name: sum(max(0.0, one.duration - getattr(one, name)) for row in rows for one in row) / whole
        for name in ("fell", "fell_measured")
    }
    return {
        "gaits_beyond_the_tilt_limit": float(np.mean([any(o.fell < math.inf for o in row) for row in rows])),
        "gaits_that_failed": float(
            np.mean([e.evaluation.status.startswith(("div", "fai")) for e in entries])
        ),
        "saved_at_any_time": saved["fell"],
        "saved_inside_the_measured_cycles": saved["fell_measured"],
    }


def rollouts(entry: Entry, evaluator: Watching) -> list[Watched]:
    """Return the rollouts of a gait, in the scenarios that it saw."""
    count = len(evaluator.setup.scenarios)
    keys = [(entry.gait.name, scenario) for scenario in range(count)]
    return [evaluator.seen[key] for key in keys if key in evaluator.seen]


def hopeless(
    entries: Sequence[Entry], evaluator: Watching, baseline: float, share: float, moment: int
) -> dict[str, float]:
    """Return the saving of ending slow gaits, and how often it is wrong."""
    whole = sum(one.duration for entry in entries for one in rollouts(entry, evaluator))
    saved, ended, wrong, bests, total = 0.0, 0, 0, 0, 0
    named = {entry.gait.name: entry for entry in entries}
    populations = [[named[name] for name in names] for names in evaluator.raced]
    for population in populations:
        before = entries[: population[0].index]
        leader = min(before, key=lambda entry: entry.evaluation.cost, default=None)
        known = leader.evaluation.metrics["speed_m_s"] if leader else baseline
        better = sorted(population, key=lambda entry: entry.evaluation.cost)[: len(population) // 2]
        for entry in population:
            rows = rollouts(entry, evaluator)
            total += 1
            if (
                rows[0].speeds[moment] < share * known
            ):  # the first scenario decides, and the others are not run
                saved += sum(one.duration for one in rows) - rows[0].looked[moment]
                ended += 1
                wrong += any(entry is one for one in better)
                bests += leader is not None and entry.evaluation.cost < leader.evaluation.cost
    return {
        "share": share,
        "measured": MEASURED[moment],
        "saved": saved / whole,
        "gaits_ended": ended / max(1, total),
        "wrong_of_ended": wrong / max(1, ended),
        "better_half_lost": wrong / max(1, sum(len(p) // 2 for p in populations)),
        "bests_lost": bests,
    }


def pooled(rows: Sequence[dict[str, float]]) -> dict[str, float]:
    """Return the mean of each figure over searches, and the sum of what is counted."""
    return {k: float((np.sum if k == "bests_lost" else np.mean)([row[k] for row in rows])) for k in rows[0]}


def main() -> None:
    """Observe the searches and write ``stopping.json``, case by case."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "stopping.json"
    result: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    for name in options.cases:
        reference, warm, seeds, budget = CASES[name]
        runs = [search(load_problem(reference), seed, budget, warm) for seed in range(1, seeds + 1)]
        rules = [(share, moment) for moment in range(len(MEASURED)) for share in SHARES]
        result[name] = {
            "searches": seeds,
            "gaits": budget,
            "fallen": pooled([fallen(entries, evaluator) for entries, evaluator, _ in runs]),
            "hopeless": [pooled([hopeless(*one, share, moment) for one in runs]) for share, moment in rules],
        }
        path.write_text(json.dumps(result, indent=1) + "\n")
        print(name, json.dumps(result[name], indent=1), flush=True)


if __name__ == "__main__":
    main()
