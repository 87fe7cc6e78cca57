"""Slopes of a set of effects over so wide a chord that jumps of the response hardly count.

Where servos stick and slip, the response jumps a little from each value of a parameter to the next. Between
near values such jumps count as slope, and the parameter then seems to be known far better than it is. So each
parameter goes aside to both sides until the loss rises clearly. What the loss rises more than these slopes
predict is its roughness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.set_fit import SetFit, SetFitter
from gaitopt.diagnose.fit.single import robot_request

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WideChords:
    """A set with slopes over wide chords.

    Attributes:
        fit: the set.
        roughness: how much more the loss rises aside of the set than the slopes predict, in the mean; at
            least 0.
    """

    fit: SetFit
    roughness: float

    @staticmethod
    def of(fitter: SetFitter, fit: SetFit) -> WideChords:
        """Return a set with slopes over wide chords; those of an effect that jumps are kept.

        A chord is wide enough where a wider one has the same slope, or the loss rises clearly.
        """
        settings, wide, ends = fitter.settings, fit, list[_End]()
        least = fitter.loss.total(fit.robot.whitened)
        errors = 1.0 / np.sqrt(np.maximum(np.diag(fitter.curvature(fit)), 1.0))  # the others stay
        narrow = [i for i, h in enumerate(fit.hypotheses) if not h.effect.jumps]
        for factor in settings.chord_errors:
            for chord in _chords(fitter, fit, narrow, factor * errors):
                rise = float(np.mean([end.loss for end in chord])) - least
                index = chord[0].index
                if rise > settings.chord_rise and factor > settings.chord_errors[0]:
                    narrow.remove(index)
                    continue
                slopes, ends = wide.slopes.copy(), [*ends, *chord]
                slopes[:, index] = (chord[1].whitened - chord[0].whitened) / (chord[1].step - chord[0].step)
                apart = np.linalg.norm(slopes[:, index] - wide.slopes[:, index])
                if apart < settings.same_slope * np.linalg.norm(slopes[:, index]):
                    narrow.remove(index)
                wide = replace(wide, slopes=slopes)
        return WideChords(wide, max(0.0, _excess(fitter, wide, ends)))


@dataclass(frozen=True)
class _End:
    """An end of a chord.

    Attributes:
        index: the parameter.
        step: how far it went aside, in its range.
        whitened: whitened residual there, shape (rows,).
        loss: loss there.
    """

    index: int
    step: float
    whitened: Array
    loss: float


def _chords(
    fitter: SetFitter, fit: SetFit, parameters: Sequence[int], widths: Array
) -> list[tuple[_End, _End]]:
    """Return the chord of each parameter, so wide to both sides; those that can be simulated."""
    low, high = fit.limits
    ends = []
    for index in parameters:
        aside = np.clip(fit.shares[index] + widths[index] * np.array([-1.0, 1.0]), low[index], high[index])
        ends += [(index, float(end - fit.shares[index])) for end in aside]
    steps = [step * np.eye(len(fit.hypotheses))[index] for index, step in ends]
    robots = fitter.simulate([robot_request(fitter.stepped(fit, step).point) for step in steps])
    found = [
        None if robot is None else _End(index, step, robot.whitened, fitter.loss.total(robot.whitened))
        for (index, step), robot in zip(ends, robots, strict=True)
    ]
    pairs = zip(found[::2], found[1::2], strict=True)
    return [(one, two) for one, two in pairs if one and two and two.step > one.step]


def _excess(fitter: SetFitter, fit: SetFit, ends: Sequence[_End]) -> float:
    """Return how much more the loss is at some ends than the slopes of a set predict, in the mean."""
    predicted = [fit.robot.whitened + fit.slopes[:, end.index] * end.step for end in ends]
    excess = [end.loss - fitter.loss.total(rows) for end, rows in zip(ends, predicted, strict=True)]
    return float(np.mean(excess)) if excess else 0.0
