"""Slopes of effects over so wide a chord that jumps of the response hardly count.

Where servos stick and slip, or a foot slips in another step, the response jumps a little from each value of a
parameter to the next. Between near values such jumps count as slope, and the parameter then seems to be known
far better than it is. So each parameter goes aside to both sides until the loss rises clearly. What the loss
of a trial rises more than these slopes predict is its roughness.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.firsts import firsts
from gaitopt.diagnose.fit.set_fit import SetFit, SetFitter
from gaitopt.diagnose.fit.single import robot_request
from gaitopt.effects.effect import Effect

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WideChords:
    """Slopes of effects over wide chords.

    Attributes:
        slopes: change of the whitened residual with the coordinate of each effect, by its name with its
            target, in ranges, shape (rows,).
        excess: how much more the loss of each trial rises aside of the sets than the slopes predict, in the
            mean, shape (trials,).
    """

    slopes: Mapping[str, Array]
    excess: Array

    @property
    def roughness(self) -> Array:
        """Roughness of the loss of each trial, shape (trials,)."""
        found: Array = np.maximum(0.0, self.excess)
        return found

    def together(self) -> WideChords:
        """Return the same with each trial as rough as all are together: where trials are many and alike.

        Of few gaits the fast ones are rough and the slow ones are not. How rough all are together would then
        say little of what the slow ones tell.
        """
        return replace(self, excess=np.full_like(self.excess, self.excess.sum()))

    @staticmethod
    def of(fitter: SetFitter, fits: Sequence[SetFit], improbable: Sequence[SetFit] = ()) -> WideChords:
        """Return slopes over wide chords, of each effect in the first set that has it.

        A chord is wide enough where a wider one has the same slope, or the loss rises clearly. An effect that
        jumps has none.

        Args:
            fitter: the fitter of the sets.
            fits: the sets, which say how rough the trials are.
            improbable: sets that do not. Effects that are in these alone have a slope on their first target.
        """
        probable = firsts(_parameters(fits), lambda one: one.name)
        named = {one.effect.name for one in probable}
        others = [one for one in _parameters(improbable) if one.effect.name not in named]
        others = firsts(others, lambda one: one.effect.name)
        slopes, ends = _widened(fitter, [one for one in [*probable, *others] if not one.effect.jumps])
        return WideChords(slopes, _excess(fitter, slopes, [end for end in ends if end.parameter in probable]))

    def of_set(self, fit: SetFit) -> SetFit:
        """Return a set with these slopes; those of effects without a wide chord are its own."""
        columns = [self.slopes.get(h.name, fit.slopes[:, i]) for i, h in enumerate(fit.hypotheses)]
        return replace(fit, slopes=np.column_stack(columns)) if columns else fit


@dataclass(frozen=True, eq=False)
class _Parameter:
    """A parameter of a set.

    Attributes:
        fit: the set.
        index: which of its parameters.
    """

    fit: SetFit
    index: int

    @property
    def name(self) -> str:
        return self.fit.hypotheses[self.index].name

    @property
    def effect(self) -> Effect:
        return self.fit.hypotheses[self.index].effect

    @property
    def slope(self) -> Array:
        column: Array = self.fit.slopes[:, self.index]
        return column


@dataclass(frozen=True)
class _End:
    """An end of a chord.

    Attributes:
        parameter: the parameter that went aside.
        step: how far, in its range.
        whitened: whitened residual there, shape (rows,).
        losses: loss of each trial there, shape (trials,).
        rise: how much more they are in all than those of the set.
    """

    parameter: _Parameter
    step: float
    whitened: Array
    losses: Array
    rise: float


def _parameters(fits: Sequence[SetFit]) -> list[_Parameter]:
    return [_Parameter(fit, index) for fit in fits for index in range(len(fit.hypotheses))]


def _widened(fitter: SetFitter, narrow: Sequence[_Parameter]) -> tuple[dict[str, Array], list[_End]]:
    """Return the slope of each parameter over a chord that is wide enough, and the ends of all chords."""
    settings, ends = fitter.settings, list[_End]()
    narrow, errors = [*narrow], {one: _standard_error(fitter, one) for one in narrow}
    slopes: dict[str, Array] = {}
    for factor in settings.chord_errors:
        for below, above in _chords(fitter, [(one, factor * errors[one]) for one in narrow]):
            parameter, rise = below.parameter, 0.5 * (below.rise + above.rise)
            if rise > settings.chord_rise and factor > settings.chord_errors[0]:
                narrow.remove(parameter)
                continue
            slope = (above.whitened - below.whitened) / (above.step - below.step)
            before = slopes.get(parameter.name, parameter.slope)
            slopes[parameter.name], ends = slope, [*ends, below, above]
            if np.linalg.norm(slope - before) < settings.same_slope * np.linalg.norm(slope):
                narrow.remove(parameter)
    return slopes, ends


def _standard_error(fitter: SetFitter, parameter: _Parameter) -> float:
    """Return the standard error of a parameter by the slopes of its set, in ranges, if the others stay."""
    fit, index = parameter.fit, parameter.index
    curvature = fitter.curvature(fit, fitter.loss.weights_of(fit.robot.whitened))
    return 1.0 / math.sqrt(max(float(curvature[index, index]), 1.0))


def _chords(fitter: SetFitter, widths: Sequence[tuple[_Parameter, float]]) -> list[tuple[_End, _End]]:
    """Return the chord of each parameter, so wide to both sides; those that can be simulated."""
    ends = []
    for parameter, width in widths:
        fit, index = parameter.fit, parameter.index
        low, high = (float(limit[index]) for limit in fit.limits)
        share = float(fit.shares[index])
        ends += [(parameter, min(max(share + side * width, low), high) - share) for side in (-1.0, 1.0)]
    robots = fitter.simulate([robot_request(_aside(fitter, *end).point) for end in ends])
    found: list[_End | None] = []
    for (parameter, step), robot in zip(ends, robots, strict=True):
        if robot is None:
            found.append(None)
            continue
        losses, least = (fitter.loss.of_each(one.whitened) for one in (robot, parameter.fit.robot))
        found.append(_End(parameter, step, robot.whitened, losses, float(np.sum(losses - least))))
    pairs = zip(found[::2], found[1::2], strict=True)
    return [(one, two) for one, two in pairs if one and two and two.step > one.step]


def _aside(fitter: SetFitter, parameter: _Parameter, step: float) -> SetFit:
    """Return the set of a parameter with that parameter aside."""
    return fitter.stepped(parameter.fit, step * np.eye(len(parameter.fit.hypotheses))[parameter.index])


def _excess(fitter: SetFitter, slopes: Mapping[str, Array], ends: Sequence[_End]) -> Array:
    """Return how much more the loss of each trial is at some ends than slopes predict, shape (trials,)."""
    excess = [np.zeros(len(fitter.loss.rows))]
    for end in ends:
        predicted = end.parameter.fit.robot.whitened + slopes[end.parameter.name] * end.step
        excess.append(end.losses - fitter.loss.of_each(predicted))
    mean: Array = np.sum(excess, axis=0) / max(1, len(ends))
    return mean
