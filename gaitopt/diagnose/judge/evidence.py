"""Evidence: the probabilities of the candidates and a p-value, from held-out losses.

A candidate's score is the tempered likelihood of its held-out whitened residual, because no model of a robot
is correct down to its floor. So squares count in multiples of the best candidate's, and `temper` of them
count as one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.fit.settings import RESPONSE, ResponseSettings
from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.settings import EVIDENCE, EvidenceSettings

Array = NDArray[np.float64]


def scores(
    trial_set: TrialSet,
    candidates: Sequence[Candidate],
    settings: EvidenceSettings = EVIDENCE,
    response: ResponseSettings = RESPONSE,
) -> Array:
    """Return the logarithm of each candidate's posterior weight, up to a constant, shape (candidates,).

    A difference no larger than `jump_share` of the jumps near the best candidate is no evidence: robots
    simulated at other places near it would have changed it as much.
    """
    best = min(candidates, key=lambda candidate: candidate.total_loss)
    priors = np.array(
        [settings.prior_weight * _log_prior(one, settings) + one.log_target_share for one in candidates]
    )
    by_trial = np.array([trial_set.by_trial(one.heldout_loss) for one in candidates])
    weights: Array = -0.5 * by_trial @ (1.0 / tempers(trial_set, best, settings, response)) + priors
    return weights


def tempers(
    trial_set: TrialSet, best: Candidate, settings: EvidenceSettings, response: ResponseSettings
) -> Array:
    """Return how many whitened squares of each trial count as one, shape (trials,).

    Args:
        trial_set: the trials.
        best: the best candidate.
        settings: the temper, and the share of the jumps near it.
        response: how these jumps are measured.
    """
    temper = settings.temper * max(1.0, best.total_loss / trial_set.rows_per_block.sum())
    tempered: Array = temper + settings.jump_share * best.loss_jumps(trial_set, response)
    return tempered


def _log_prior(candidate: Candidate, settings: EvidenceSettings) -> float:
    """Return the logarithm of a candidate's prior with the tails of Student's t.

    It was never measured how rare a large deviation is.
    """
    freedom = settings.prior_freedom
    return sum(
        -0.5 * (freedom + 1.0) * math.log1p(-2.0 * max(log_prior, -1e9) / freedom)
        for log_prior in candidate.log_priors
    )


def probabilities(weights: Array) -> Array:
    """Return the probabilities that belong to logarithms of weights, summing to 1."""
    shares = np.exp(weights - weights.max())
    normal: Array = shares / shares.sum()
    return normal


def averaged(weights: Array, luck: float, seed: int, settings: EvidenceSettings = EVIDENCE) -> Array:
    """Return logarithms of weights whose probabilities are averaged over errors of all weights.

    Args:
        weights: logarithms of weights, shape (candidates,).
        luck: standard deviation of their errors.
        seed: seed of the errors.
        settings: number of draws.
    """
    errors = generator(seed, Stream.LUCK).standard_normal((len(weights), settings.luck_draws))
    drawn = weights[:, None] + luck * errors
    logarithms: Array = logsumexp(drawn - logsumexp(drawn, axis=0), axis=1) - math.log(settings.luck_draws)
    return logarithms


def by_effect(candidates: Sequence[Candidate], chances: Array) -> dict[str, float]:
    """Return the probability of each effect over its targets, the most probable first."""
    totals: dict[str, float] = {}
    for candidate, chance in zip(candidates, chances.tolist(), strict=True):
        totals[candidate.names[0]] = totals.get(candidate.names[0], 0.0) + chance
    return dict(sorted(totals.items(), key=lambda item: -item[1]))


def answer_set(chances: Mapping[str, float], settings: EvidenceSettings = EVIDENCE) -> list[str]:
    """Return the effects that the data cannot rule out, the most probable first."""
    first = max(chances.values())
    chosen, total = [], 0.0
    for name, chance in chances.items():
        if total < settings.set_share or chance >= settings.in_set * first:
            chosen.append(name)
            total += chance
    return chosen


def p_value(
    trial_set: TrialSet,
    nominal: Comparison,
    candidates: Sequence[Candidate],
    best: Candidate,
    trials: NDArray[np.bool_],
    seed: int,
    settings: EvidenceSettings = EVIDENCE,
    response: ResponseSettings = RESPONSE,
) -> float:
    """Return how often some effect would gain as much as the best one on "no effect" by chance alone.

    A parametric bootstrap: residuals of a correct model are drawn from the covariance. Their squares are
    tempered as in `scores`, so that a gait on which the loss jumps from robot to robot proves little. Each
    draw is explained as far as the change with any simulated robot can explain it. So the best of many
    hypotheses is compared with the best of equally many.

    Args:
        trial_set: the trials.
        nominal: the trials compared with the nominal robot.
        candidates: candidates of one effect.
        best: the candidate that is blamed.
        trials: the trials that can show it, shape (trials,).
        seed: seed of the draws.
        settings: the temper, and the number of draws.
        response: how the jumps near the best candidate are measured.
    """
    fits = [candidate.alone for candidate in candidates if candidate.alone]
    robots = [one for fit in fits for one in fit.comparisons]
    temper = tempers(trial_set, best, settings, response)
    share = trials / temper
    units = np.sqrt(share)[trial_set.row_trials]
    changes = np.stack([(one.whitened - nominal.whitened) * units for one in robots])
    sizes = np.linalg.norm(changes, axis=1)
    moved = sizes > 1e-9
    if not moved.any():
        return 1.0
    saved = trial_set.by_trial(trial_set.losses(nominal.whitened) - best.heldout_loss)
    sizes, directions = sizes[moved], changes[moved] / sizes[moved][:, None]
    rng = generator(seed, Stream.CHANCE_GAIN)
    drawn = rng.standard_normal((settings.chance_draws, changes.shape[1]))
    along = np.maximum(drawn @ directions.T, 0.0)
    reached = np.minimum(along, sizes)
    gains = (reached * (2.0 * along - reached)).max(axis=1)
    return float((1 + np.sum(gains >= saved @ share)) / (1 + settings.chance_draws))
