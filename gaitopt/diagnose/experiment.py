"""What to measure next: the gait on which the surviving rivals differ most, in floors (T-optimality)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gaitopt.diagnose.align import square_apart
from gaitopt.diagnose.evidence import Rival
from gaitopt.diagnose.nuisances import nuisance_robots
from gaitopt.diagnose.predict import gait_key
from gaitopt.gait import Gait
from gaitopt.problem import Problem
from gaitopt.rollout import Simulator
from gaitopt.trajectory import Trajectory

SECONDS = 6.0
"""Length of the proposed recording; at least two cycles."""

_RANDOM = 8
_REFINED = 4
_STEPS = (0.12, 0.08)
"""Sizes of the steps from the best gait so far, measured or not, in units of the box."""

_NOISE_M = 1e-3
_ANGLE_NOISE_RAD = 3e-3
_NUISANCES = 2


@dataclass(frozen=True)
class Experiment:
    """A gait that would tell rivals apart.

    Attributes:
        gait: the gait.
        separates: the rivals' effects.
        separation: RMS difference of the two most alike of them, in floors.
        before: the same of the best gait measured so far.
    """

    gait: Gait
    separates: list[str]
    separation: float
    before: float

    def to_dict(self) -> dict[str, Any]:
        """Return ``next_experiment`` of a diagnosis."""
        return {
            "gait": self.gait.to_dict(),
            "separates": self.separates,
            "expected_separation": self.separation,
            "separation_so_far": self.before,
        }


def propose(
    problem: Problem,
    simulator: Simulator,
    rivals: Sequence[Rival],
    measured: Sequence[Gait],
    signals: Sequence[str],
    executor: Executor,
    seed: int,
) -> Experiment | None:
    """Return the gait, none of those measured, on which the rivals differ most; None for less than two.

    Args:
        problem: the nominal problem, whose gait space is searched.
        simulator: its robot.
        rivals: fitted rivals.
        measured: gaits that were measured already.
        signals: what a recording measures.
        executor: where gaits are simulated.
        seed: seed of the gaits drawn.
    """
    if len(rivals) < 2:
        return None
    robots = [Simulator.build(problem.with_effects(r.settings)) for r in rivals]
    nuisances = nuisance_robots(simulator, seed, _NUISANCES)
    rng = np.random.default_rng([seed, 25])
    judge = _Judge(simulator, robots, nuisances, tuple(signals), executor)
    space, size = problem.space, len(problem.space.variables)
    keys = {gait_key(gait) for gait in measured}
    points = [space.encode(gait) for gait in problem.baselines.values() if gait_key(gait) not in keys]
    points += list(rng.random((_RANDOM, size)))
    known = judge(list(measured))
    found = list(zip(judge([space.decode(p) for p in points]), points, strict=True))
    for step in _STEPS:
        again = list(zip(known, [space.encode(gait) for gait in measured], strict=True))
        _, best = max([*found, *again], key=lambda entry: entry[0])
        near = [space.wrap(best + step * rng.standard_normal(size)) for _ in range(_REFINED)]
        found += list(zip(judge([space.decode(p) for p in near]), near, strict=True))
    value, point = max(found, key=lambda entry: entry[0])
    gait = replace(space.decode(point), name="next")
    return Experiment(gait, [" + ".join(r.names) for r in rivals], value, max(known))


@dataclass(frozen=True)
class _Judge:
    nominal: Simulator
    robots: Sequence[Simulator]
    nuisances: Sequence[Simulator]
    signals: tuple[str, ...]
    executor: Executor

    def __call__(self, gaits: Sequence[Gait]) -> list[float]:
        """Return by how many floors the two most alike rivals differ on each gait."""
        every = [self.nominal, *self.nuisances, *self.robots]
        futures = [[self.executor.submit(_path, robot, gait) for robot in every] for gait in gaits]
        return [self._separation([future.result() for future in row]) for row in futures]

    def _separation(self, paths: Sequence[Trajectory]) -> float:
        if any(path.status != "ok" for path in paths):
            return 0.0
        nominal, others = paths[0], paths[1:]
        disturbed, rivals = others[: len(self.nuisances)], others[len(self.nuisances) :]
        least = math.inf
        floors = self._floors(nominal, disturbed)
        for i, one in enumerate(rivals):
            for other in rivals[i + 1 :]:
                squares = [(_apart(one, other, s) / floors[s]) ** 2 for s in self.signals]
                least = min(least, math.sqrt(sum(squares) / len(squares)))
        return least

    def _floors(self, nominal: Trajectory, disturbed: Sequence[Trajectory]) -> Mapping[str, float]:
        floors = {}
        for signal in self.signals:
            noise = _NOISE_M if signal.startswith("marker.") else _ANGLE_NOISE_RAD
            floors[signal] = math.hypot(noise, *(_apart(nominal, d, signal) for d in disturbed))
        return floors


def _path(robot: Simulator, gait: Gait) -> Trajectory:
    return robot.observe(robot.run(gait, 0, max(SECONDS, 2.0 * gait.period_s)))


def _apart(one: Trajectory, other: Trajectory, signal: str) -> float:
    """Return the RMS difference of a signal, m or rad."""
    return math.sqrt(square_apart(one, other, signal))
