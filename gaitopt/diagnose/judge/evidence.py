"""Evidence: what each candidate predicts of trials that its fit did not see, and what may be concluded.

Each candidate is judged by how well the others predict one gait (some cycles, where there is one gait): by
how much more it leaves with that gait than without. So a parameter is held to what the others show of it, as
far as they do; trials that do not show an effect say nothing against it. Its score is the likelihood of the
whitened residual of what was left out, tempered: a model of a robot is never right to its floor, so squares
count in multiples of what the best candidate leaves, `TEMPER` times.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.fit import response
from gaitopt.diagnose.fit.fitting import Comparison, Fit, TrialSet
from gaitopt.diagnose.fit.pairs import PairFit
from gaitopt.robot.signals import is_marker

Array = NDArray[np.float64]

TEMPER = 3.0
"""Whitened squares that count as one: what is left of a right model is alike from bin to bin."""

LUCK = 0.5
"""Share of the jumps of the loss near the best candidate that is added to it, trial by trial: a fast gait, on
which it jumps, takes nothing from what a slow one shows."""

PRIOR_WEIGHT = 0.3
"""Weight of the prior of a fitted parameter: bounds and priors are guesses too."""

_FREEDOM = 3.0
"""Degrees of freedom of the priors' tails."""

IN_SET = 0.05
"""A candidate belongs to the answer if it is at least this probable, relative to the first."""

SET_SHARE = 0.97
"""And the answer's candidates are this probable together."""

_BOOTSTRAPS = 400
_DRAWS = 999


@dataclass(frozen=True)
class Candidate:
    """A fitted explanation, and what it foretold.

    Attributes:
        fits: the effects' fits; none for "no effect".
        at: their coordinates, fitted to all trials.
        seen: loss of each block, fitted to all, shape (blocks,).
        heldout_loss: what each block adds to the least loss of those of the other folds, shape (blocks,).
        whitened: residual fitted to all trials, shape (rows,).
        marker: marker's residual of each sample by the fit that did not see it, m.
        log_prior: of the parameters.
        pair: the pair's fit, where there are two effects.
    """

    fits: tuple[Fit, ...]
    at: tuple[float, ...]
    seen: Array
    heldout_loss: Array
    whitened: Array
    marker: Array
    log_prior: float
    pair: PairFit | None = None

    @property
    def evidence(self) -> float:
        """Loss by which candidates of as many parameters are ranked."""
        return float(self.heldout_loss.sum())

    @property
    def names(self) -> list[str]:
        """The effects."""
        return [fit.hypothesis.effect.name for fit in self.fits]

    @property
    def label(self) -> str:
        """The effects with their targets."""
        return " + ".join(fit.hypothesis.name for fit in self.fits) or "none"

    @property
    def effect_values(self) -> dict[str, Mapping[str, float | str]]:
        """What a problem file says of the effects."""
        pairs = zip(self.fits, self.at, strict=True)
        return {fit.hypothesis.effect.name: fit.hypothesis.values(at) for fit, at in pairs}


def nothing(trial_set: TrialSet, nominal: Comparison) -> Candidate:
    """Return the candidate without any effect."""
    losses = trial_set.losses(nominal.whitened, nominal.whitened)
    return Candidate((), (), losses, losses, nominal.whitened, nominal.marker, 0.0)


def single(fit: Fit) -> Candidate:
    """Return the candidate of one effect."""
    trial_set, at = fit.trial_set, fit.best()
    apart = _unseen(trial_set, lambda weights: fit.between("marker", weights))
    prior = _heavy(fit.hypothesis.log_prior(at))
    heldout_loss = _added(trial_set, fit.curve.losses)
    return Candidate((fit,), (at,), fit.loss(), heldout_loss, fit.between("whitened"), apart, prior)


def double(pair: PairFit) -> Candidate:
    """Return the candidate of two effects."""
    trial_set = pair.fits[0].trial_set
    point = pair.best()
    apart = _unseen(trial_set, lambda weights: pair.best(weights).marker)
    at = tuple(point.at.tolist())
    prior = sum(_heavy(f.hypothesis.log_prior(a)) for f, a in zip(pair.fits, at, strict=True))
    seen = trial_set.losses(point.whitened, point.whitened)
    heldout_loss = _added(
        trial_set, np.stack([trial_set.losses(p.whitened, p.whitened) for p in pair.comparisons], axis=1)
    )
    return Candidate(pair.fits, at, seen, heldout_loss, point.whitened, apart, prior, pair)


def _unseen(trial_set: TrialSet, fitted: Callable[[Array | None], Array]) -> Array:
    """Return each sample's residual by the fit that did not see its fold, m.

    Args:
        trial_set: the trials.
        fitted: returns the residuals, m, of the fit to blocks so weighted, to all by default.
    """
    apart = fitted(None).copy()
    for fold, weights in trial_set.left_out:
        hidden = np.isin(trial_set.sample_blocks, fold)
        apart[hidden] = fitted(weights)[hidden]
    return apart


def _added(trial_set: TrialSet, losses: Array) -> Array:
    """Return what each block adds to the least loss of the blocks of the other folds, shape (blocks,).

    Its own loss where all fit best, and by how much the others then leave more than they need, spread over
    the rows of its fold: the predictive square of a linear model whose parameter the others have fitted.

    Args:
        trial_set: the trials.
        losses: of each block with each parameter, shape (blocks, n).
    """
    best = int(np.argmin(losses.sum(axis=0)))
    added: Array = losses[:, best].copy()
    for fold, weights in trial_set.left_out:
        others, rows = weights @ losses, trial_set.rows_per_block[fold]
        added[fold] += (others[best] - others.min()) * rows / rows.sum()
    return added


def _heavy(log_prior: float) -> float:
    """Return a prior's logarithm with the tails of Student's t: nobody has measured how rare an oddity is."""
    return -0.5 * (_FREEDOM + 1.0) * math.log1p(-2.0 * max(log_prior, -1e9) / _FREEDOM)


def left(trial_set: TrialSet, candidate: Candidate) -> float:
    """Return the mean whitened square that a candidate leaves on held-out data, of the worst trial.

    It is 1 where the candidate is right and the covariance is.
    """
    by_trial = trial_set.sums(candidate.heldout_loss) / trial_set.sums(trial_set.rows_per_block)
    return float(by_trial.max())


def scores(trial_set: TrialSet, candidates: Sequence[Candidate]) -> Array:
    """Return the logarithm of each candidate's posterior weight, up to a constant.

    A difference no larger than half of the jumps near the best candidate is no evidence. Robots simulated
    at other places near it would have changed it as much.
    """
    best = min(candidates, key=lambda candidate: candidate.evidence)
    units = TEMPER * max(1.0, best.evidence / trial_set.rows_per_block.sum()) + LUCK * _luck(trial_set, best)
    priors = np.array([PRIOR_WEIGHT * r.log_prior + sum(_share(f) for f in r.fits) for r in candidates])
    by_trial = np.array([trial_set.sums(candidate.heldout_loss) for candidate in candidates])
    weights: Array = -0.5 * by_trial @ (1.0 / units) + priors
    return weights


def _luck(trial_set: TrialSet, candidate: Candidate) -> Array:
    """Return by how much losses of near robots differ by chance, of each trial, shape (trials,)."""
    if candidate.pair is not None:
        return response.of_pair(candidate.pair).luck
    return response.of_fit(candidate.fits[0]).luck if candidate.fits else np.zeros(trial_set.n_trials)


def _share(fit: Fit) -> float:
    """Return the logarithm of a target's share of its effect's prior."""
    kind, channels = fit.hypothesis.effect.target, len(fit.trial_set.problem.channel_names)
    return {"none": 0.0, "any": -math.log(channels + 1.0), "one": -math.log(channels)}[kind]


def probabilities(weights: Array) -> Array:
    """Return what the weights are worth together, summing to 1."""
    shares = np.exp(weights - weights.max())
    normal: Array = shares / shares.sum()
    return normal


def by_effect(candidates: Sequence[Candidate], chances: Array) -> dict[str, float]:
    """Return the probability of each effect over its targets, the most probable first."""
    totals: dict[str, float] = {}
    for candidate, chance in zip(candidates, chances.tolist(), strict=True):
        totals[candidate.names[0]] = totals.get(candidate.names[0], 0.0) + chance
    return dict(sorted(totals.items(), key=lambda item: -item[1]))


def answer_set(chances: Mapping[str, float]) -> list[str]:
    """Return the effects that the data cannot rule out, the most probable first."""
    first = max(chances.values())
    chosen, total = [], 0.0
    for name, chance in chances.items():
        if total < SET_SHARE or chance >= IN_SET * first:
            chosen.append(name)
            total += chance
    return chosen


def p_value(
    trial_set: TrialSet, nominal: Comparison, candidates: Sequence[Candidate], gain: float, seed: int
) -> float:
    """Return how often chance alone would let some effect gain so much on "no effect".

    A parametric bootstrap: residuals of a right model are drawn from the covariance, its squares tempered
    as in `scores`, and each draw is explained as far as the change that any simulated set made can explain
    it. So the best of many hypotheses is held against the best of as many.

    Args:
        trial_set: the trials.
        nominal: the trials beside the nominal robot.
        candidates: candidates of one effect.
        gain: the loss that the best candidate saved.
        seed: seed of the draws.
    """
    points = [point for candidate in candidates for fit in candidate.fits for point in fit.comparisons]
    changes = np.stack([point.whitened - nominal.whitened for point in points])
    sizes = np.linalg.norm(changes, axis=1)
    moved = sizes > 1e-9
    sizes, directions = sizes[moved], changes[moved] / sizes[moved][:, None]
    rng = generator(seed, Stream.CHANCE_GAIN)
    left = min(candidate.evidence for candidate in candidates) / trial_set.rows_per_block.sum()
    drawn = math.sqrt(TEMPER * max(1.0, left)) * rng.standard_normal((_DRAWS, changes.shape[1]))
    along = np.maximum(drawn @ directions.T, 0.0)
    reached = np.minimum(along, sizes)
    gains = (reached * (2.0 * along - reached)).max(axis=1)
    return float((1 + np.sum(gains >= gain)) / (1 + _DRAWS))


def better_by(trial_set: TrialSet, candidate: Candidate, other: Candidate) -> float:
    """Return by how many standard errors over the blocks `candidate` foretells more than `other`."""
    gain = other.heldout_loss - candidate.heldout_loss
    error = math.sqrt(len(gain)) * float(gain.std(ddof=1)) if len(gain) > 1 else math.inf
    return float(gain.sum()) / error if error > 0.0 else 0.0


def cosine(nominal: Comparison, one: Candidate, other: Candidate) -> float:
    """Return the cosine between what two candidates change, whitened."""
    a, b = nominal.whitened - one.whitened, nominal.whitened - other.whitened
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return abs(float(a @ b)) / size if size > 0.0 else 0.0


def resampled(groups: NDArray[np.intp], rng: np.random.Generator) -> Array:
    """Return how often each block is drawn when blocks are drawn anew within their group."""
    counts = np.zeros(len(groups))
    for group in np.unique(groups):
        own = np.flatnonzero(groups == group)
        counts += np.bincount(rng.choice(own, len(own)), minlength=len(groups))
    return counts


@dataclass(frozen=True)
class Gap:
    """The marker's gap on held-out data, m.

    Attributes:
        before, after: RMS without and with the effect.
        floor: RMS of what a right model leaves.
        ci90: interval of the shrinkage.
    """

    before: float
    after: float
    floor: float
    ci90: tuple[float, float]

    @property
    def shrinkage(self) -> float | None:
        """How much of what is above the floor has gone; None where nothing is above it."""
        return shrinkage(self.before, self.after, self.floor)


def shrinkage(before: float, after: float, floor: float) -> float | None:
    """Return (before - after) / (before - floor); None where the gap is within the floor."""
    return (before - after) / (before - floor) if before > floor else None


def gap_of(
    trial_set: TrialSet,
    nominal: Comparison,
    candidate: Candidate,
    floor: float,
    seed: int,
    trial: int | None = None,
) -> Gap:
    """Return the gap before and after a candidate, with an interval over cycles drawn anew.

    Args:
        trial_set: the trials.
        nominal: the trials beside the nominal robot.
        candidate: the candidate.
        floor: the marker's floor, m.
        seed: seed of the cycles drawn.
        trial: the trial meant; None for all together.
    """
    axes = max(1, sum(map(is_marker, trial_set.trials[0].rows)))
    count = trial_set.n_blocks
    samples = np.bincount(trial_set.sample_blocks, minlength=count) / axes
    before: Array = np.bincount(trial_set.sample_blocks, nominal.marker**2, minlength=count).astype(float)
    after: Array = np.bincount(trial_set.sample_blocks, candidate.marker**2, minlength=count).astype(float)

    meant = np.ones(count) if trial is None else (trial_set.block_trials == trial).astype(float)

    def rms(squares: Array, weights: Array) -> float:
        total = float(weights @ samples)
        return math.sqrt(float(weights @ squares) / total) if total > 0.0 else 0.0

    rng = generator(seed, Stream.GAP_BOOTSTRAP)
    drawn = []
    for _ in range(_BOOTSTRAPS):
        weights = meant * resampled(trial_set.block_trials, rng)
        share = shrinkage(rms(before, weights), rms(after, weights), floor)
        if share is not None:
            drawn.append(share)
    low, high = np.quantile(drawn, (0.05, 0.95)).tolist() if drawn else (math.nan, math.nan)
    return Gap(rms(before, meant), rms(after, meant), floor, (low, high))
