"""Candidate explanations: no effect, one or more, each with its residual on held-out data.

A candidate is judged by how well the other gaits predict each gait (other cycles, if there is one gait only):
by the loss that it adds to the least loss of the others. So a parameter must agree with the other gaits. A
trial that does not show an effect is no evidence against it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.response import Response
from gaitopt.diagnose.fit.set_fit import SetFit
from gaitopt.diagnose.fit.settings import ResponseSettings
from gaitopt.diagnose.fit.single import Fit, robot_request
from gaitopt.diagnose.fit.trials import Comparison, Indices, TrialSet
from gaitopt.effects.active import Values

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Candidate:
    """A fitted explanation, and what it predicts of held-out data.

    Attributes:
        hypotheses: the effects, each on its target; none for "no effect".
        at: their coordinates, fitted to all trials.
        fitted_loss: loss of each block, fitted to all, shape (blocks,).
        heldout_loss: what each block adds to the least loss of the other folds, shape (blocks,).
        whitened: whitened residual, fitted to all trials, shape (rows,).
        marker: residual of each sample of the marker by the fit that did not use its fold, m, shape
            (samples,).
        angles: the same of each sample of the angles, rad, shape (samples,).
        alone: the fit of the effect, where there is one that was fitted alone.
        log_priors: logarithm of the prior of each parameter, up to a constant.
        together: the fit of the set, where effects were fitted as one.
    """

    hypotheses: tuple[Hypothesis, ...]
    at: tuple[float, ...]
    fitted_loss: Array
    heldout_loss: Array
    whitened: Array
    marker: Array
    angles: Array
    alone: Fit | None = None
    log_priors: tuple[float, ...] = ()
    together: SetFit | None = None

    @staticmethod
    def without_effect(trial_set: TrialSet, nominal: Comparison) -> Candidate:
        """Return the candidate without any effect."""
        losses = trial_set.losses(nominal.whitened)
        return Candidate((), (), losses, losses, nominal.whitened, nominal.marker, nominal.angles)

    @staticmethod
    def of_fit(fit: Fit) -> Candidate:
        """Return the candidate of one effect."""
        at = fit.best()
        trial_set = fit.trial_set
        return Candidate(
            (fit.hypothesis,),
            (at,),
            fit.loss(),
            _heldout_loss(trial_set, fit.curve.losses),
            fit.at_best("whitened"),
            heldout(trial_set, trial_set.sample_blocks, lambda weights: fit.at_best("marker", weights)),
            heldout(trial_set, trial_set.angle_blocks, lambda weights: fit.at_best("angles", weights)),
            fit,
            (fit.hypothesis.log_prior(at),),
        )

    @property
    def total_loss(self) -> float:
        """Held-out loss of all blocks, by which candidates of as many parameters are ranked."""
        return float(self.heldout_loss.sum())

    @property
    def names(self) -> list[str]:
        """The effects."""
        return [one.effect.name for one in self.hypotheses]

    @property
    def label(self) -> str:
        """The effects with their targets."""
        return " + ".join(one.name for one in self.hypotheses) or "none"

    @property
    def rms_left(self) -> float:
        """What it leaves of held-out data, RMS: m, or rad where no position was measured."""
        samples = self.marker if len(self.marker) else self.angles
        return float(np.sqrt(np.mean(samples**2))) if len(samples) else 0.0

    @property
    def effect_values(self) -> Mapping[str, Values]:
        """The effects, as a problem file states them."""
        return robot_request(zip(self.hypotheses, self.at, strict=True)).effects

    @property
    def log_target_share(self) -> float:
        """Logarithm of the targets' share of their effects' prior probability."""
        return sum(one.log_target_share for one in self.hypotheses)

    def left(self, trial_set: TrialSet) -> float:
        """Return the mean whitened square that is left of held-out data, in the worst trial.

        It is 1 if the candidate and the covariance are correct.
        """
        by_trial = trial_set.by_trial(self.heldout_loss) / trial_set.by_trial(trial_set.rows_per_block)
        return float(by_trial.max())

    def loss_jumps(self, trial_set: TrialSet, settings: ResponseSettings) -> Array:
        """Return by how much the losses of near robots differ by chance, shape (trials,)."""
        if self.alone is None:
            return np.zeros(trial_set.n_trials)
        return Response.of_fit(self.alone, settings).loss_jumps

    def cosine(self, other: Candidate, nominal: Comparison) -> float:
        """Return the cosine between the whitened changes of two candidates: their signatures."""
        a, b = nominal.whitened - self.whitened, nominal.whitened - other.whitened
        size = float(np.linalg.norm(a) * np.linalg.norm(b))
        return abs(float(a @ b)) / size if size > 0.0 else 0.0


def heldout(trial_set: TrialSet, blocks: Indices, fitted: Callable[[Array | None], Array]) -> Array:
    """Return the residual of each sample by the fit that did not use its fold, m or rad, shape (samples,).

    Args:
        trial_set: the trials.
        blocks: block of each sample, shape (samples,).
        fitted: returns the residuals of the fit with given weights of the blocks; None for equal weights.
    """
    left = fitted(None).copy()
    for fold, weights in trial_set.fold_weights if len(left) else ():
        hidden = np.isin(blocks, fold)
        left[hidden] = fitted(weights)[hidden]
    return left


def _heldout_loss(trial_set: TrialSet, losses: Array) -> Array:
    """Return what each block adds to the least loss of the other folds, shape (blocks,).

    This is its own loss where all blocks fit best, plus a share of the loss that the other folds then have
    above their own best fit. That loss is spread over the rows of its fold. For a linear model it is the
    predictive square with the parameter fitted to the others.

    Args:
        trial_set: the trials.
        losses: of each block at each parameter, shape (blocks, n).
    """
    best = int(np.argmin(losses.sum(axis=0)))
    added: Array = losses[:, best].copy()
    for fold, weights in trial_set.fold_weights:
        others, rows = weights @ losses, trial_set.rows_per_block[fold]
        added[fold] += (others[best] - others.min()) * rows / rows.sum()
    return added
