"""Which robots are simulated, and in which order, so that all effects are fitted.

Every hypothesis is screened first: at one value on each side, and at others where that one promises
something. Then the fits that can still become the best are refined in rounds, each where its loss is least.
At the end the leading fits are finished, until their best robot is close to a simulated one.
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
    """Screen every hypothesis, then fit those that have a chance, in rounds; the best are not finished.

    Where one robot on a side promises nothing, no other is simulated on that side, see `complete`.

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
    probes = [(fit, at) for fit in fits for at in fit.hypothesis.probes(settings)]
    most = sum(len(fit.unscreened()) for fit in fits) + _in_rounds(fits, settings)
    stage = runner.stage(FITTING, most)
    _simulate(probes, stage)
    promising = [fit for fit in fits if fit.promise >= settings.promising]
    others = [
        (fit, at) for fit in promising for at in fit.unscreened() if fit.promise_of(at) >= settings.promising
    ]
    stage.spare(most - len(probes) - len(others) - _in_rounds(promising, settings))
    _simulate(others, stage)
    _refine(promising, stage, settings)
    return fits


def complete(fits: Sequence[Fit], runner: Runner, settings: FitSettings = FIT) -> None:
    """Screen every hypothesis where it was not simulated, then fit those that have a chance, and finish."""
    _fit(fits, [(fit, at) for fit in fits for at in fit.unscreened()], runner, settings)
    finish(fits, runner, settings)


def fit_leading(
    trial_set: TrialSet,
    nominal: Comparison,
    heads: Sequence[Fit],
    runner: Runner,
    settings: FitSettings = FIT,
) -> list[Fit]:
    """Fit those hypotheses to whole trials that may explain their beginnings; nothing is known of the others.

    Args:
        trial_set: the trials.
        nominal: the trials compared with the nominal robot.
        heads: the fits to their beginnings.
        runner: simulates robots.
        settings: how effects are fitted.

    Returns:
        One fit for each of `heads`, in order.
    """
    fits = [Fit.of(head.hypothesis, trial_set, nominal, settings) for head in heads]
    leading = _leading(heads, settings.hopeless_head, settings.removed_head)[: settings.leading_head]
    chosen = [fits[i] for i in leading]
    _fit(chosen, [(fits[i], at) for i in leading for at in heads[i].around_best()], runner, settings)
    finish(chosen, runner, settings)
    complete([fit for fit in fits if fit.hypothesis.measurement_only and fit not in chosen], runner, settings)
    return fits


def _fit(
    fits: Sequence[Fit], first: Sequence[tuple[Fit, float]], runner: Runner, settings: FitSettings
) -> None:
    """Simulate fits at some coordinates, then those that have a chance in rounds."""
    stage = runner.stage(FITTING, len(first) + _in_rounds(fits, settings))
    _simulate(first, stage)
    _refine(fits, stage, settings)


def _in_rounds(fits: Sequence[Fit], settings: FitSettings) -> int:
    """Return how many robots `_refine` simulates at most."""
    return sum(min(most, len(fits)) for most in settings.rounds)


def _refine(fits: Sequence[Fit], stage: Stage, settings: FitSettings) -> None:
    """Simulate the fits that look best where they look best, in rounds."""
    planned = [min(most, len(fits)) for most in settings.rounds]
    for number, most in enumerate(settings.rounds):
        hopeless = settings.hopeless[min(number, len(settings.hopeless) - 1)]
        leading = [fits[i] for i in _leading(fits, hopeless)]
        wanted = [(fit, fit.next_coordinate()) for fit in leading[:most]]
        work = [(fit, at) for fit, at in wanted if at is not None]
        stage.spare(planned[number] - len(work))
        if not work:
            stage.spare(sum(planned[number + 1 :]))
            break
        _simulate(work, stage)


def _leading(fits: Sequence[Fit], hopeless: float, removed: float = 0.0) -> list[int]:
    """Return which fits have a chance, the best first.

    Args:
        fits: the fits.
        hopeless: a fit has none that leaves this many times the least loss, or what a correct model leaves,
        removed: or that removes a smaller share than this of what the best one removes of the loss.
    """
    if not fits:
        return []
    losses = [float(fit.loss().sum()) for fit in fits]
    least, nominal = min(losses), fits[0].neutral.whitened
    none = float(fits[0].trial_set.losses(nominal).sum())
    limit = min(hopeless * max(least, len(nominal)), removed * least + (1.0 - removed) * none)
    order = np.argsort(losses, kind="stable").tolist()
    best = fits[order[0]]
    return [i for i in order if losses[i] <= limit or fits[i].cosine(best) >= fits[i].settings.alike]


def finish(fits: Sequence[Fit], runner: Runner, settings: FitSettings = FIT) -> None:
    """Simulate the leading fits until their best robot is known, not interpolated between two distant robots.

    Two effects with one signature are then compared by their residuals, not by how closely each was fitted.
    Nothing is simulated where the best effect is so far from a correct model that this cannot make it one.
    """
    stage, rows = runner.stage(FINISHING), len(fits[0].neutral.whitened) if fits else 0
    for number in range(settings.finish_rounds_measurement):
        losses = [float(fit.loss().sum()) for fit in fits]
        least = min(losses, default=0.0)
        leading = [fit for fit, loss in zip(fits, losses, strict=True) if loss <= settings.leading * least]
        near = [fit for fit in leading if fit.hypothesis.measurement_only or least <= settings.near * rows]
        wanted = [(fit, _to_finish(fit, number, settings)) for fit in near]
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
