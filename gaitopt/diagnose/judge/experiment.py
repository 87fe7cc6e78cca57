"""What to measure next: the gait that would leave the least of the probability on wrong rivals.

T-optimality (Atkinson and Fedorov, 1975) asks for the gait on which two rivals differ most. Of several, the
two most alike may be alike on every gait, and a gait chosen for these tells nothing of the others. So each
rival in turn is taken as the truth, as often as it is probable, and what counts is how probable the others
would still be after a recording of it: a pair that no gait parts weighs the same on all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.gap.align import is_marker, square_apart
from gaitopt.diagnose.judge.causes import Causes
from gaitopt.diagnose.judge.evidence import Rival, probabilities
from gaitopt.diagnose.judge.nuisances import nuisance_robots
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]

SECONDS = 8.0
"""Length of the proposed recording; at least two cycles."""

_RANDOM = 14
_REFINED = 5
_STEPS = (0.12, 0.08)
"""Sizes of the steps from the best gait so far, in units of the box."""

_RIVALS = 8
_LEAST_CHANCE = 0.01
"""Rivals that count, on all their targets: so many, as probable as this relative to the first."""

_NOISE_M = 1e-3
_ANGLE_NOISE_RAD = 3e-3

_CAUTION = 2.0
"""The variance of so few robots, and of a rival that is not quite right, is taken to be so much larger."""

_LEADERS = 3
_DRAWS = 2
_FINALISTS, _FINAL_DRAWS = 3, 3
"""Of many gaits judged by few robots the best is partly lucky: the first few are judged by others again."""


@dataclass(frozen=True)
class Experiment:
    """A gait that would tell rivals apart.

    Attributes:
        gait: the gait.
        separates: the rivals' effects.
        separation: RMS difference of the most probable of them from the others, in floors.
        before: the same on the best gait measured so far.
        inseparable: those that differ by less than a floor on every gait that was tried, two by two.
    """

    gait: Gait
    separates: list[str]
    separation: float
    before: float
    inseparable: list[list[str]]

    def to_dict(self) -> dict[str, Any]:
        """Return ``next_experiment`` of a diagnosis."""
        return {
            "gait": self.gait.to_dict(),
            "separates": self.separates,
            "expected_separation": self.separation,
            "separation_so_far": self.before,
            "inseparable": self.inseparable,
        }


def propose(
    simulator: Simulator,
    found: Causes,
    measured: Sequence[Gait],
    signals: Sequence[str],
    executor: Executor,
    seed: int,
) -> Experiment | None:
    """Return the gait, none of those measured, that tells most; None where nothing is to be told apart.

    Args:
        simulator: the nominal robot, whose problem's gaits are searched.
        found: the diagnosis so far.
        measured: gaits that were measured already.
        signals: what a recording measures.
        executor: where gaits are simulated.
        seed: seed of the gaits and robots drawn.
    """
    rivals, chances = _rivals(found)
    names = [" + ".join(rival.names) for rival in rivals]
    if len(set(names)) < 2:
        return None
    problem = simulator.problem
    robots = [Simulator.build(problem.with_effects(r.settings), fidelity=simulator.fidelity) for r in rivals]
    leaders = [names.index(name) for name in dict.fromkeys(names)][:_LEADERS]
    several = [
        nuisance_robots(robots[i], seed, _DRAWS + _FINAL_DRAWS, Stream.EXPERIMENT_ROBOTS) for i in leaders
    ]
    drawn, others = (
        [(i, robot) for i, own in zip(leaders, several, strict=True) for robot in own[part]]
        for part in (slice(_DRAWS), slice(_DRAWS, None))
    )
    judge = _Judge(robots, drawn, tuple(names), chances, tuple(signals), executor)
    outlooks = _searched(judge, problem, measured, seed)
    if not outlooks:
        return None
    finalists = [outlook.gait for outlook in sorted(outlooks, key=_wrong)[:_FINALISTS]]
    again = replace(judge, drawn=others)(finalists)
    chosen = min(again or outlooks, key=_wrong)
    known = judge(list(measured))
    return Experiment(
        replace(chosen.gait, name="next"),
        list(dict.fromkeys(names)),
        chosen.separation,
        max((outlook.separation for outlook in known), default=0.0),
        _inseparable(names, [*outlooks, *known]),
    )


def _searched(judge: _Judge, problem: Problem, measured: Sequence[Gait], seed: int) -> list[_Outlook]:
    """Return what baselines, gaits drawn at random and gaits near the best of them would tell."""
    space, rng = problem.space, generator(seed, Stream.EXPERIMENT_CANDIDATES)
    keys = {gait.key for gait in measured}
    points = [space.encode(gait) for gait in problem.baselines.values() if gait.key not in keys]
    points += list(rng.random((_RANDOM, len(space.variables))))
    outlooks = judge([space.decode(point) for point in points])
    for step in _STEPS if outlooks else ():
        best = space.encode(min(outlooks, key=_wrong).gait)
        near = [space.wrap(best + step * rng.standard_normal(len(best))) for _ in range(_REFINED)]
        outlooks += judge([space.decode(point) for point in near])
    return outlooks


def _rivals(found: Causes) -> tuple[list[Rival], Array]:
    """Return the rivals that count, the first of each effect and target, and their probabilities.

    The runner-up counts in any case, so that a cause that stands alone can be put to the test.
    """
    chances = found.chances
    likely = [i for i, chance in enumerate(chances) if chance >= _LEAST_CHANCE * chances[0]][:_RIVALS]
    other = [i for i, rival in enumerate(found.rivals) if rival.names != found.rivals[0].names][:1]
    chosen = sorted({*likely, *other})
    weights = np.maximum(chances[chosen], _LEAST_CHANCE * chances[0])
    return [found.rivals[i] for i in chosen], weights / weights.sum()


def _inseparable(names: Sequence[str], outlooks: Sequence[_Outlook]) -> list[list[str]]:
    """Return each two effects of which some targets differ by less than a floor on every gait."""
    widest = np.max([outlook.apart for outlook in outlooks], axis=0)
    alike = [(names[i], names[j]) for j in range(len(names)) for i in range(j) if widest[i, j] < 1.0]
    pairs = {frozenset(pair): list(pair) for pair in alike if pair[0] != pair[1]}
    return list(pairs.values())


@dataclass(frozen=True)
class _Outlook:
    """What a recording of a gait is expected to tell.

    Attributes:
        gait: the gait.
        squares: squared difference of each two rivals, in floors, summed over the signals,
            shape (rivals, rivals).
        signals: how many signals.
        names: each rival's effects.
        chances: each rival's probability before it, shape (rivals,).
    """

    gait: Gait
    squares: Array
    signals: int
    names: tuple[str, ...]
    chances: Array

    @property
    def apart(self) -> Array:
        """RMS difference of each two rivals, in floors, shape (rivals, rivals)."""
        root: Array = np.sqrt(self.squares / self.signals)
        return root

    @property
    def separation(self) -> float:
        """RMS difference of the first from those with other effects, in floors, by their probability."""
        others = self._others[0] * self.chances
        return float(np.sqrt(others @ self.squares[0] / others.sum() / self.signals))

    @cached_property
    def wrong(self) -> float:
        """Expected share of the probability on wrong effects afterwards, a floor being a standard error."""
        after = np.array([probabilities(np.log(self.chances) - 0.5 * row) for row in self.squares])
        return float(self.chances @ np.sum(after * self._others, axis=1))

    @property
    def _others(self) -> Array:
        """1 for each rival, in columns, that has other effects than the one in the row."""
        names = np.array(self.names)
        other: Array = (names[:, None] != names[None, :]).astype(float)
        return other


def _wrong(outlook: _Outlook) -> float:
    return outlook.wrong


@dataclass(frozen=True)
class _Judge:
    """Foretells what gaits would tell.

    Attributes:
        robots: each rival's.
        drawn: robots that differ from one of the leading rivals' in what nobody knows, with its index. About
            the nominal robot, fast gaits promise more than the diagnosis then finds in them.
        names: each rival's effects.
        chances: each rival's probability.
        signals: what is measured.
        executor: where gaits are simulated.
    """

    robots: Sequence[Simulator]
    drawn: Sequence[tuple[int, Simulator]]
    names: tuple[str, ...]
    chances: Array
    signals: tuple[str, ...]
    executor: Executor

    def __call__(self, gaits: Sequence[Gait]) -> list[_Outlook]:
        """Return what each gait would tell; those are left out that one of the robots cannot walk."""
        every = [*self.robots, *(robot for _, robot in self.drawn)]
        futures = [[self.executor.submit(_filmed, robot, gait) for robot in every] for gait in gaits]
        outlooks = []
        for gait, row in zip(gaits, futures, strict=True):
            paths = [future.result() for future in row]
            if all(path.status == "ok" for path in paths):
                outlooks.append(self._outlook(gait, paths))
        return outlooks

    def _outlook(self, gait: Gait, paths: Sequence[Trajectory]) -> _Outlook:
        count = len(self.robots)
        rivals = paths[:count]
        drawn = [(rivals[i], path) for (i, _), path in zip(self.drawn, paths[count:], strict=True)]
        squares = np.zeros((count, count))
        for signal in self.signals:
            noise = _NOISE_M if is_marker(signal) else _ANGLE_NOISE_RAD
            unknown = np.mean([square_apart(centre, path, signal) for centre, path in drawn])
            floor = noise**2 + _CAUTION * unknown
            for i, one in enumerate(rivals):
                for j, other in enumerate(rivals[:i]):
                    squares[i, j] += square_apart(one, other, signal) / floor
        return _Outlook(gait, squares + squares.T, len(self.signals), self.names, self.chances)


def _filmed(robot: Simulator, gait: Gait) -> Trajectory:
    return robot.observe(robot.run(gait, 0, max(SECONDS, 2.0 * gait.period_s)))
