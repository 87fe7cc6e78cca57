"""What to measure next: the gait that would leave the least of the probability on wrong candidates.

T-optimality (Atkinson and Fedorov, 1975) asks for the gait on which two candidates differ most. With more
candidates, the two most alike may be alike on every gait; a gait chosen for these tells nothing of the
others. So each candidate in turn is taken as the truth, weighted by its probability. What counts is how
probable the others would still be after a recording. A pair that no gait separates then weighs the same on
all gaits.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.gap.align import square_apart
from gaitopt.diagnose.judge.causes import Causes
from gaitopt.diagnose.judge.evidence import Candidate, probabilities
from gaitopt.diagnose.judge.small_errors import perturbed_robots
from gaitopt.gait.drive import Drive
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.robot.signals import is_marker
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]
D = TypeVar("D", bound=Drive)

SECONDS = 8.0
"""Length of the proposed recording; at least two cycles."""

_RANDOM = 14
_REFINED = 5
_STEPS = (0.12, 0.08)
"""Sizes of the steps from the best gait so far, in units of the box."""

_CANDIDATES = 8
_LEAST_CHANCE = 0.01
"""Rivals that count, on all their targets: so many, as probable as this relative to the first."""

_NOISE_M = 1e-3
_ANGLE_NOISE_RAD = 3e-3

_CAUTION = 2.0
"""Factor on the variance of a few robots about a candidate that is not quite right."""

_LEADERS = 3
_DRAWS = 2
_FINALISTS, _FINAL_DRAWS = 3, 3
"""Of many gaits judged by few robots the best is partly lucky: the first few are judged by others again."""


@dataclass(frozen=True)
class Experiment:
    """A gait that would tell candidates apart.

    Attributes:
        gait: the gait.
        separates: the candidates' effects.
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
    measured: Sequence[Drive],
    signals: Sequence[str],
    executor: Executor,
    seed: int,
) -> Experiment | None:
    """Return the gait, none of those measured, that tells most; None where nothing is to be told apart.

    Without ``[gait]`` there are no gaits to search among, and the answer is None too.

    Args:
        simulator: the nominal robot, whose problem's gaits are searched.
        found: the diagnosis so far.
        measured: the drives of the trials so far.
        signals: what a recording measures.
        executor: where gaits are simulated.
        seed: seed of the gaits and robots drawn.
    """
    candidates, chances = _candidates(found)
    names = [" + ".join(candidate.names) for candidate in candidates]
    if len(set(names)) < 2 or simulator.problem.file.gait is None:
        return None
    problem = simulator.problem
    robots = [
        Simulator.build(problem.with_effects(r.effect_values), fidelity=simulator.fidelity)
        for r in candidates
    ]
    leaders = [names.index(name) for name in dict.fromkeys(names)][:_LEADERS]
    several = [
        perturbed_robots(robots[i], seed, _DRAWS + _FINAL_DRAWS, Stream.EXPERIMENT_ROBOTS) for i in leaders
    ]
    drawn, others = (
        [(i, robot) for i, own in zip(leaders, several, strict=True) for robot in own[part]]
        for part in (slice(_DRAWS), slice(_DRAWS, None))
    )
    judge = GaitScorer(robots, drawn, tuple(names), chances, tuple(signals), executor)
    scores = _searched(judge, problem, measured, seed)
    if not scores:
        return None
    finalists = [score.gait for score in sorted(scores, key=_wrong)[:_FINALISTS]]
    again = replace(judge, drawn=others)(finalists)
    chosen = min(again or scores, key=_wrong)
    known = judge(list(measured))
    return Experiment(
        replace(chosen.gait, name="next"),
        list(dict.fromkeys(names)),
        chosen.separation,
        max((score.separation for score in known), default=0.0),
        _inseparable(names, [*scores, *known]),
    )


def _searched(
    judge: GaitScorer, problem: Problem, measured: Sequence[Drive], seed: int
) -> list[GaitScore[Gait]]:
    """Return what baselines, gaits drawn at random and gaits near the best of them would tell."""
    space, rng = problem.space, generator(seed, Stream.EXPERIMENT_CANDIDATES)
    keys = {drive.key for drive in measured}
    points = [space.encode(gait) for gait in problem.baselines.values() if gait.key not in keys]
    points += list(rng.random((_RANDOM, len(space.variables))))
    scores = judge([space.decode(point) for point in points])
    for step in _STEPS if scores else ():
        best = space.encode(min(scores, key=_wrong).gait)
        near = [space.wrap(best + step * rng.standard_normal(len(best))) for _ in range(_REFINED)]
        scores += judge([space.decode(point) for point in near])
    return scores


def _candidates(found: Causes) -> tuple[list[Candidate], Array]:
    """Return the candidates that count, the first of each effect and target, and their probabilities.

    The runner-up counts in any case, so that a cause that stands alone can be put to the test.
    """
    chances = found.chances
    likely = [i for i, chance in enumerate(chances) if chance >= _LEAST_CHANCE * chances[0]][:_CANDIDATES]
    other = [
        i for i, candidate in enumerate(found.candidates) if candidate.names != found.candidates[0].names
    ][:1]
    chosen = sorted({*likely, *other})
    weights = np.maximum(chances[chosen], _LEAST_CHANCE * chances[0])
    return [found.candidates[i] for i in chosen], weights / weights.sum()


def _inseparable(names: Sequence[str], scores: Sequence[GaitScore[Any]]) -> list[list[str]]:
    """Return each two effects of which some targets differ by less than a floor on every gait."""
    widest = np.max([score.apart for score in scores], axis=0)
    alike = [(names[i], names[j]) for j in range(len(names)) for i in range(j) if widest[i, j] < 1.0]
    pairs = {frozenset(pair): list(pair) for pair in alike if pair[0] != pair[1]}
    return list(pairs.values())


@dataclass(frozen=True)
class GaitScore(Generic[D]):
    """What a recording of a gait is expected to tell.

    Attributes:
        gait: the gait.
        squares: squared difference of each two candidates, in floors, summed over the signals,
            shape (candidates, candidates).
        signals: how many signals.
        names: each candidate's effects.
        chances: each candidate's probability before it, shape (candidates,).
    """

    gait: D
    squares: Array
    signals: int
    names: tuple[str, ...]
    chances: Array

    @property
    def apart(self) -> Array:
        """RMS difference of each two candidates, in floors, shape (candidates, candidates)."""
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
        """1 for each candidate, in columns, that has other effects than the one in the row."""
        names = np.array(self.names)
        other: Array = (names[:, None] != names[None, :]).astype(float)
        return other


def _wrong(score: GaitScore[Gait]) -> float:
    return score.wrong


@dataclass(frozen=True)
class GaitScorer:
    """Foretells what gaits would tell.

    Attributes:
        robots: each candidate's.
        drawn: perturbed robots of the leading candidates, each with its candidate's index. Robots about the
            nominal one would promise more of fast gaits than the diagnosis then finds.
        names: each candidate's effects.
        chances: each candidate's probability.
        signals: what is measured.
        executor: where gaits are simulated.
    """

    robots: Sequence[Simulator]
    drawn: Sequence[tuple[int, Simulator]]
    names: tuple[str, ...]
    chances: Array
    signals: tuple[str, ...]
    executor: Executor

    def __call__(self, gaits: Sequence[D]) -> list[GaitScore[D]]:
        """Return what each gait would tell; those are left out that one of the robots cannot walk."""
        every = [*self.robots, *(robot for _, robot in self.drawn)]
        futures = [[self.executor.submit(_recorded, robot, gait) for robot in every] for gait in gaits]
        scores = []
        for gait, row in zip(gaits, futures, strict=True):
            paths = [future.result() for future in row]
            if all(path.status == "ok" for path in paths):
                scores.append(self._score(gait, paths))
        return scores

    def _score(self, gait: D, paths: Sequence[Trajectory]) -> GaitScore[D]:
        count = len(self.robots)
        candidates = paths[:count]
        drawn = [(candidates[i], path) for (i, _), path in zip(self.drawn, paths[count:], strict=True)]
        squares = np.zeros((count, count))
        for signal in self.signals:
            noise = _NOISE_M if is_marker(signal) else _ANGLE_NOISE_RAD
            unknown = np.mean([square_apart(centre, path, signal) for centre, path in drawn])
            floor = noise**2 + _CAUTION * unknown
            for i, one in enumerate(candidates):
                for j, other in enumerate(candidates[:i]):
                    squares[i, j] += square_apart(one, other, signal) / floor
        return GaitScore(gait, squares + squares.T, len(self.signals), self.names, self.chances)


def _recorded(robot: Simulator, drive: Drive) -> Trajectory:
    return robot.observe(robot.run(drive, 0, max(SECONDS, 2.0 * drive.block_s)))
