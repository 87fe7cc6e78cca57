"""What to measure next: the gait that would leave the least probability on wrong candidates.

T-optimality (Atkinson and Fedorov, 1975) asks for the gait on which two candidates differ most. With more
candidates, the two most similar ones may be similar on every gait, and a gait chosen for these says nothing
about the others. So each candidate in turn is taken as the truth, weighted by its probability. The score is
the probability that the others would still have after a recording. A pair that no gait separates then counts
the same on all gaits. A hand-tuned wave that does nearly as well is preferred: a user has a player for it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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

_PERIODS = 7
"""Periods at which the wave of a hand-tuned gait is tried, from the shortest to the longest one allowed."""

_SAME_PERIOD = 0.1
"""Logarithm of the ratio of two periods below which a recording tells the same."""


@dataclass(frozen=True)
class Experiment:
    """A gait that would separate candidates.

    Attributes:
        gait: the gait.
        separates: the effects of each candidate.
        separation: RMS difference of the most probable candidate from the others, in floors.
        before: the same on the best gait measured so far.
        worth_m_s: how much faster the best of the gaits that were tried is expected to be if it is chosen
            after the recording, m/s; None where no way forward is measured.
        wave_of: the hand-tuned gait whose wave it is, at another period; None for another wave.
        inseparable: pairs of candidates that differ by less than a floor on every gait that was tried.
    """

    gait: Gait
    separates: list[str]
    separation: float
    before: float
    worth_m_s: float | None
    wave_of: str | None
    inseparable: list[list[str]]

    def to_dict(self) -> dict[str, Any]:
        """Return ``next_experiment`` of a diagnosis."""
        return {
            "gait": self.gait.to_dict(),
            "separates": self.separates,
            "expected_separation": self.separation,
            "separation_so_far": self.before,
            "worth_m_s": self.worth_m_s,
            "wave_of": self.wave_of,
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
    waves = hand_tuned_waves(simulator.problem, measured)
    tuned: list[GaitScore[Gait]] = scorer.score([gait for gait, _ in waves])
    scores = tuned + _searched(scorer, simulator.problem, tuned, context.seed)
    if not scores:
        return None
    leading = sorted(scores, key=_wrong)[: settings.finalists]
    finalists = {score.gait.key: score.gait for score in (*leading, *sorted(tuned, key=_wrong)[:1])}
    wave_of = {gait.key: name for gait, name in waves}
    chosen = preferred(final.score([*finalists.values()]) or scores, wave_of, settings)
    known = scorer.score(list(measured))
    return Experiment(
        replace(chosen.gait, name="next"),
        contest.distinct,
        chosen.separation,
        max((score.separation for score in known), default=0.0),
        chosen.worth_among([*scores, *known]),
        wave_of.get(chosen.gait.key),
        _inseparable(contest.names, [*scores, *known]),
    )


def hand_tuned_waves(problem: Problem, measured: Sequence[Drive]) -> list[tuple[Gait, str]]:
    """Return the hand-tuned gaits, also at other periods, that were not measured: each with one of its wave.

    Args:
        problem: the problem.
        measured: the drives of the trials so far.
    """
    low, high = problem.space.period_s
    periods = [float(f"{period:.2g}") for period in np.geomspace(low, high, _PERIODS)]
    found = [(gait, name) for name, gait in problem.baselines.items()]
    found += [
        (replace(gait, period_s=at), name) for name, gait in problem.baselines.items() for at in periods
    ]
    seen = [drive for drive in measured if isinstance(drive, Gait)]
    new: list[tuple[Gait, str]] = []
    for gait, name in found:
        if low <= gait.period_s <= high and not any(_alike(gait, one) for one in seen):
            seen.append(gait)
            new.append((gait, name))
    return new


def _alike(one: Gait, other: Gait) -> bool:
    near = abs(np.log(one.period_s / other.period_s)) < _SAME_PERIOD
    return bool(near) and dict(one.channels) == dict(other.channels)


def preferred(
    scores: Sequence[GaitScore[Gait]], wave_of: Mapping[str, str], settings: ExperimentSettings
) -> GaitScore[Gait]:
    """Return the best gait, or a hand-tuned wave that leaves hardly more doubt."""
    best = min(scores, key=_wrong)
    enough = best.wrong + settings.hand_tuned_doubt
    tuned = [score for score in scores if score.gait.key in wave_of and score.wrong <= enough]
    return min(tuned, key=_wrong, default=best)


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
    scorer: GaitScorer, problem: Problem, tuned: Sequence[GaitScore[Gait]], seed: int
) -> list[GaitScore[Gait]]:
    """Return the scores of random gaits, and of gaits near the best of them and of hand-tuned ones."""
    settings = scorer.settings
    space, rng = problem.space, generator(seed, Stream.EXPERIMENT_CANDIDATES)
    points = list(rng.random((settings.random, len(space.variables))))
    scores = scorer.score([space.decode(point) for point in points])
    for step in settings.steps if scores or tuned else ():
        best = space.encode(min([*tuned, *scores], key=_wrong).gait)
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
