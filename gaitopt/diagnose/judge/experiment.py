"""What to measure next: the gait that would leave the least probability on wrong candidates.

T-optimality (Atkinson and Fedorov, 1975) asks for the gait on which two candidates differ most. With more
candidates, the two most similar ones may be similar on every gait, and a gait chosen for these says nothing
about the others. So each candidate in turn is taken as the truth, weighted by its probability. The score is
the probability that the others would still have after a recording. A pair that no gait separates then counts
the same on all gaits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.causes import Causes
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.gait_score import GaitScore, GaitScorer
from gaitopt.diagnose.judge.settings import EXPERIMENT, ExperimentSettings
from gaitopt.diagnose.judge.small_errors import perturbed_robots
from gaitopt.gait.drive import Drive
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Experiment:
    """A gait that would separate candidates.

    Attributes:
        gait: the gait.
        separates: the effects of each candidate.
        separation: RMS difference of the most probable candidate from the others, in floors.
        before: the same on the best gait measured so far.
        inseparable: pairs of candidates that differ by less than a floor on every gait that was tried.
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


@dataclass(frozen=True)
class Contest:
    """The candidates to separate.

    Attributes:
        candidates: the candidates, the most probable first.
        prior: their probabilities, shape (candidates,).
    """

    candidates: tuple[Candidate, ...]
    prior: Array

    @staticmethod
    def of(found: Causes, settings: ExperimentSettings = EXPERIMENT) -> Contest:
        """Return the candidates that count: the first of each effect and target.

        The second candidate always counts, so that a cause without alternatives can be tested.
        """
        chances = found.probabilities
        least = settings.least_probability * chances[0]
        likely = [i for i, chance in enumerate(chances) if chance >= least][: settings.candidates]
        first = found.candidates[0].names
        other = [i for i, candidate in enumerate(found.candidates) if candidate.names != first][:1]
        chosen = sorted({*likely, *other})
        weights = np.maximum(chances[chosen], least)
        return Contest(tuple(found.candidates[i] for i in chosen), weights / weights.sum())

    @property
    def names(self) -> list[str]:
        """The effects of each candidate, without targets."""
        return [" + ".join(candidate.names) for candidate in self.candidates]

    @property
    def distinct(self) -> list[str]:
        """The effects without repetition, in order."""
        return list(dict.fromkeys(self.names))


def propose(
    simulator: Simulator,
    found: Causes,
    measured: Sequence[Drive],
    signals: Sequence[str],
    context: Context,
) -> Experiment | None:
    """Return the new gait that separates the candidates best; None if there is nothing to separate.

    Without ``[gait]`` there are no gaits to search among, and the answer is None too.

    Args:
        simulator: the nominal robot, whose problem's gaits are searched.
        found: the diagnosis so far.
        measured: the drives of the trials so far.
        signals: what a recording measures.
        context: where gaits are simulated; seed of the gaits and robots drawn; settings.
    """
    settings = context.settings.experiment
    contest = Contest.of(found, settings)
    if len(contest.distinct) < 2 or simulator.problem.file.gait is None:
        return None
    scorer, final = _scorers(simulator, contest, tuple(signals), context)
    scores = _searched(scorer, simulator.problem, measured, context.seed)
    if not scores:
        return None
    finalists = [score.gait for score in sorted(scores, key=_wrong)[: settings.finalists]]
    chosen = min(final.score(finalists) or scores, key=_wrong)
    known = scorer.score(list(measured))
    return Experiment(
        replace(chosen.gait, name="next"),
        contest.distinct,
        chosen.separation,
        max((score.separation for score in known), default=0.0),
        _inseparable(contest.names, [*scores, *known]),
    )


def _scorers(
    simulator: Simulator, contest: Contest, signals: tuple[str, ...], context: Context
) -> tuple[GaitScorer, GaitScorer]:
    """Return what scores all gaits, and what scores the finalists with other perturbed robots."""
    settings, problem = context.settings.experiment, simulator.problem
    robots = [
        Simulator.build(problem.with_effects(candidate.effect_values), fidelity=simulator.fidelity)
        for candidate in contest.candidates
    ]
    leaders = [contest.names.index(name) for name in contest.distinct][: settings.leaders]
    count, errors = settings.robots + settings.final_robots, context.settings.small_errors
    several = [
        perturbed_robots(robots[i], context.seed, count, Stream.EXPERIMENT_ROBOTS, errors) for i in leaders
    ]
    first, others = (
        [(i, robot) for i, own in zip(leaders, several, strict=True) for robot in own[part]]
        for part in (slice(settings.robots), slice(settings.robots, None))
    )
    names = tuple(contest.names)
    scorer = GaitScorer(robots, first, names, contest.prior, signals, context.executor, settings)
    return scorer, replace(scorer, perturbed=others)


def _searched(
    scorer: GaitScorer, problem: Problem, measured: Sequence[Drive], seed: int
) -> list[GaitScore[Gait]]:
    """Return the scores of baselines, random gaits, and gaits near the best of them."""
    settings = scorer.settings
    space, rng = problem.space, generator(seed, Stream.EXPERIMENT_CANDIDATES)
    keys = {drive.key for drive in measured}
    points = [space.encode(gait) for gait in problem.baselines.values() if gait.key not in keys]
    points += list(rng.random((settings.random, len(space.variables))))
    scores = scorer.score([space.decode(point) for point in points])
    for step in settings.steps if scores else ():
        best = space.encode(min(scores, key=_wrong).gait)
        near = [space.wrap(best + step * rng.standard_normal(len(best))) for _ in range(settings.refined)]
        scores += scorer.score([space.decode(point) for point in near])
    return scores


def _inseparable(names: Sequence[str], scores: Sequence[GaitScore[Any]]) -> list[list[str]]:
    """Return each two effects with targets that differ by less than a floor on every gait."""
    widest = np.max([score.differences for score in scores], axis=0)
    alike = [(names[i], names[j]) for j in range(len(names)) for i in range(j) if widest[i, j] < 1.0]
    pairs = {frozenset(pair): list(pair) for pair in alike if pair[0] != pair[1]}
    return list(pairs.values())


def _wrong(score: GaitScore[Gait]) -> float:
    return score.wrong
