"""What to film next: what a film tells is weighed against walking with what is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gaitopt.campaign.belief import Belief, Filmed, assumed_m_s
from gaitopt.campaign.check import film_of
from gaitopt.campaign.course import chances
from gaitopt.campaign.records import LEARN, WALK, Candidate, FilmRow, Speed, Step
from gaitopt.campaign.robots import Walked
from gaitopt.campaign.settings import CampaignSettings
from gaitopt.campaign.speeds import Measured
from gaitopt.core.threads import on_one_thread
from gaitopt.gait.gait import Gait
from gaitopt.gait.space import GaitSpace
from gaitopt.optimise.solvers.surrogate import embedded


@dataclass(frozen=True)
class Known:
    """What the choice depends on.

    Attributes:
        space: the gait space.
        gaits: the candidates by name.
        films: the gaits that were proposed, by the number of their film.
        walked: the candidates on the posterior's robots.
        rows: what each film says.
        measured: the speeds of the films; None before any.
        drifts: sideways over forward travel of the films, by their number; those where it was measured.
        most_drift: largest drift allowed; infinite where there is no limit on it.
        causes, answer, notes: what the diagnosis says.
        seed: seed of the draws.
    """

    space: GaitSpace
    gaits: Mapping[str, Gait]
    films: Mapping[int, Gait]
    walked: Walked
    rows: Sequence[FilmRow]
    measured: Measured | None
    drifts: Mapping[int, float]
    most_drift: float
    causes: Sequence[str]
    answer: str
    notes: Sequence[str]
    seed: int


@on_one_thread
def choose(known: Known, recordings: int, settings: CampaignSettings) -> Step:
    """Return the next film, the best gait, and what is still to gain.

    The best gait is the one of highest worth: its expected speed times the probability that it keeps the
    limits that a film shows. Before any film, it is the next one. Afterwards the next one is that whose film
    is worth most, in mm/s of that worth. Only gaits are filmed that break no limit that guards the robot. A
    campaign is done when no film is worth more than the repeatability, and the best gait itself was filmed.

    Args:
        known: what it depends on.
        recordings: how many recordings were told.
        settings: see `CampaignSettings`.
    """
    gaits, measured = list(known.gaits.values()), known.measured
    numbers = [film_of(known.space, gait, known.films) for gait in gaits]
    points = embedded(np.array([known.space.encode(gait) for gait in gaits]), known.space.circular)
    counts, noise = (measured.counts, measured.repeatability_m_s) if measured else ({}, 0.0)
    filmed = _filmed(numbers, measured.means if measured else {}, counts, noise)
    drifts = _filmed(numbers, known.drifts, counts, settings.belief.drift_repeatability)
    assumed = assumed_m_s(known.walked.speeds, settings.belief)
    belief = Belief.of(known.walked.speeds, points, filmed, assumed, settings.belief)
    keeps = chances(known.walked, belief.weights, points, drifts, known.most_drift, settings.belief)
    breaks = known.walked.harms.mean(axis=0)
    safe = _safe(breaks, settings.most_breaking)
    worth = [belief.film_is_worth(index, noise, safe, keeps) for index in range(len(gaits))]
    values = belief.worth(keeps)
    best = max(safe, key=lambda index: (values[index], -index))
    most = max(safe, key=lambda index: (worth[index], -index))
    unseen = measured is None or numbers[best] not in measured.means
    done = not unseen and worth[most] <= noise
    chosen = best if measured is None or done or (unseen and worth[most] <= noise) else most
    candidates = [
        Candidate(
            name=name,
            period_s=gait.period_s,
            channels=dict(gait.channels),
            film=numbers[index],
            breaks=float(breaks[index]),
            safe=index in safe,
            keeps_limits=float(keeps[index]),
            predicted_m_s=Speed.of(belief.expected(index, noise)),
            film_is_worth_m_s=worth[index],
        )
        for index, (name, gait) in enumerate(known.gaits.items())
    ]
    gain = belief.still_to_gain(best, safe, keeps, known.seed, settings.belief.draws)
    return Step(
        recordings=recordings,
        films=tuple(known.rows),
        causes=tuple(known.causes),
        answer=known.answer,
        notes=(*known.notes, *_risky(breaks, safe, settings.most_breaking)),
        candidates=tuple(candidates),
        next=chosen,
        best=best,
        purpose=WALK if chosen == best and measured is not None else LEARN,
        film_is_worth_m_s=worth[chosen],
        repeatability_m_s=None if measured is None else noise,
        discrepancy_m_s=belief.size_m_s,
        still_to_gain_m_s=Speed.of(gain),
        done=done,
    )


def _filmed(
    numbers: Sequence[int | None], means: Mapping[int, float], counts: Mapping[int, int], noise: float
) -> Filmed:
    """Return what films measured of the candidates.

    Args:
        numbers: number of the film of each candidate.
        means: mean of the films of each number.
        counts: films of each number.
        noise: standard deviation of one film.
    """
    shown = [
        (index, number) for index, number in enumerate(numbers) if number is not None and number in means
    ]
    return Filmed(
        np.array([index for index, _ in shown], dtype=int),
        np.array([means[number] for _, number in shown], dtype=float),
        np.array([noise**2 / counts[number] for _, number in shown], dtype=float),
    )


def _safe(breaks: np.ndarray, most: float) -> list[int]:
    """Return the gaits that break limits on few robots; where there are none, those that do on the fewest."""
    limit = max(most, float(breaks.min()))
    return np.flatnonzero(breaks <= limit + 1e-9).tolist()


def _risky(breaks: np.ndarray, safe: Sequence[int], most: float) -> list[str]:
    """Return that no gait is safe, where none is."""
    least = float(breaks[list(safe)].min())
    if least <= most + 1e-9:
        return []
    return [f"Every gait is expected to break a limit on some robots; this one does so on {least:.0%}."]
