"""Which robots are simulated, and in which order, so that all effects are fitted.

Every hypothesis is screened first. Then the fits that can still become the best are refined in rounds, each
where its loss is least. At the end the leading fits are finished, until their best robot is close to a
simulated one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.runner import FINISHING, FITTING, Runner, Stage
from gaitopt.diagnose.fit.settings import FIT, FitSettings
from gaitopt.diagnose.fit.single import Fit
from gaitopt.diagnose.fit.trials import Comparison, TrialSet


def fit_all(
    trial_set: TrialSet,
    hypotheses: Sequence[Hypothesis],
    nominal: Comparison,
    runner: Runner,
    settings: FitSettings = FIT,
) -> list[Fit]:
    """Screen every hypothesis, then fit those that have a chance, in rounds.

    Args:
        trial_set: the trials.
        hypotheses: the hypotheses.
        nominal: the trials compared with the nominal robot.
        runner: simulates robots.
        settings: how effects are fitted.

    Returns:
        One fit for each hypothesis, in order.
    """
    fits = [Fit.of(hypothesis, trial_set, nominal, settings) for hypothesis in hypotheses]
    screened = [(fit, at) for fit in fits for at in fit.hypothesis.screened(settings)]
    most = len(screened) + sum(min(most, len(fits)) for most in settings.rounds)
    stage = runner.stage(FITTING, most)
    _simulate(screened, stage)
    _refine(fits, len(nominal.whitened), stage, settings)
    finish(fits, runner, settings)
    return fits


def _refine(fits: Sequence[Fit], rows: int, stage: Stage, settings: FitSettings) -> None:
    """Simulate the fits that look best where they look best, in rounds.

    Args:
        fits: the fits.
        rows: whitened rows: the loss of a correct model.
        stage: simulates robots.
        settings: the rounds.
    """
    planned = [min(most, len(fits)) for most in settings.rounds]
    for number, most in enumerate(settings.rounds):
        losses = [float(fit.loss().sum()) for fit in fits]
        hopeless = settings.hopeless[min(number, len(settings.hopeless) - 1)]
        limit = hopeless * max(min(losses, default=0.0), rows)
        order = np.argsort(losses, kind="stable")
        leading = [
            fits[i] for i in order if losses[i] <= limit or fits[i].cosine(fits[order[0]]) >= settings.alike
        ]
        wanted = [(fit, fit.next_coordinate()) for fit in leading[:most]]
        work = [(fit, at) for fit, at in wanted if at is not None]
        stage.spare(planned[number] - len(work))
        if not work:
            stage.spare(sum(planned[number + 1 :]))
            break
        _simulate(work, stage)


def finish(fits: Sequence[Fit], runner: Runner, settings: FitSettings = FIT) -> None:
    """Simulate the leading fits until their best robot is known, not interpolated between two distant robots.

    Two effects with one signature are then compared by their residuals, not by how closely each was fitted.
    """
    stage = runner.stage(FINISHING)
    for number in range(settings.finish_rounds_measurement):
        losses = [float(fit.loss().sum()) for fit in fits]
        limit = settings.leading * min(losses)
        leading = [fit for fit, loss in zip(fits, losses, strict=True) if loss <= limit]
        wanted = [(fit, _to_finish(fit, number, settings)) for fit in leading]
        work = [(fit, at) for fit, at in wanted if at is not None]
        if not work:
            break
        _simulate(work, stage)


def _to_finish(fit: Fit, number: int, settings: FitSettings) -> float | None:
    """Return the coordinate to simulate in a round of `finish`, or None."""
    if fit.hypothesis.measurement_only:
        return fit.next_coordinate()
    return fit.unconfirmed() if number < settings.finish_rounds else None


def _simulate(work: Sequence[tuple[Fit, float]], stage: Stage) -> None:
    """Simulate fits at coordinates, and add the results to them."""
    if not work:
        return
    trial_set = work[0][0].trial_set
    comparisons = stage(trial_set, [fit.request(at) for fit, at in work])
    for (fit, at), comparison in zip(work, comparisons, strict=True):
        fit.add(at, comparison)
