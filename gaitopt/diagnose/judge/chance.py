"""How large chance has to be so that simulated cycles differ as much as the recorded ones.

Pads that grip now more, now less, or commands that come late by chance make cycles differ. What they do to
the mean of a motion tells little about their size; how much the cycles differ tells it. So a robot with each
of them is simulated at several sizes, and the size is taken at which its cycles differ as much as the
recorded ones, in all signals of all trials together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.set_fit import Point
from gaitopt.diagnose.fit.single import robot_request
from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.diagnose.gap.floor import Floors
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.precision import Interval
from gaitopt.diagnose.judge.settings import ChanceSettings
from gaitopt.diagnose.judge.unevenness import cycle_squares
from gaitopt.effects.parts import ALL

Array = NDArray[np.float64]

OF_CHANCE = ("grip_variation", "command_jitter")
"""Effects that make cycles differ."""


@dataclass(frozen=True)
class Chance:
    """An effect that makes simulated cycles differ as much as the recorded ones.

    Attributes:
        effect: name of the effect, on all its targets.
        parameter: name of its parameter.
        value: the parameter, in its unit.
        ci90: its 90 % interval.
        unevenness: by how much the recorded cycles differ then, in differences of the simulated cycles; the
            largest of all signals.
        plausible: whether the prior allows such a size; otherwise cycles differ for another reason, too.
    """

    effect: str
    parameter: str
    value: float
    ci90: Interval
    unevenness: float
    plausible: bool = True

    def left_of(self, unevenness: float) -> float:
        """Return how uneven cycles still are beside it; an implausible size explains nothing."""
        return self.unevenness if self.plausible else unevenness

    def to_dict(self) -> dict[str, Any]:
        """Return ``chance`` of a diagnosis."""
        return {
            "name": self.effect,
            "parameters": {self.parameter: {"value": self.value, "ci90": list(self.ci90)}},
            "unevenness": self.unevenness,
            "plausible": self.plausible,
        }


def fitted_chance(
    trial_set: TrialSet,
    floors: Sequence[Floors],
    robots: Sequence[Comparison],
    point: Point,
    hypotheses: Sequence[Hypothesis],
    context: Context,
) -> Chance | None:
    """Return the effect of chance with which simulated cycles differ most like the recorded ones.

    Args:
        trial_set: the trials.
        floors: floor of each signal of each trial.
        robots: the trials compared with robots without chance, with small errors.
        point: the effects of the robot, each at its coordinate.
        hypotheses: the effects that may be at work.
        context: simulates robots; settings.

    Returns:
        None where no such effect can be at work, or none goes far enough.
    """
    settings, present = context.settings.chance, {h.effect.name for h, _ in point}
    always = cycle_squares(trial_set, floors, robots)
    if always is None or not len(always.recorded):
        return None
    found: list[tuple[float, Chance]] = []
    for hypothesis in hypotheses:
        name = hypothesis.effect.name
        if name not in OF_CHANCE or name in present or hypothesis.target != ALL:
            continue
        at = [hypothesis.coordinate_along(share) for share in settings.shares]
        tried = context.runner.compare(trial_set, [robot_request([*point, (hypothesis, one)]) for one in at])
        values, ratios = list[float](), list[Array]()
        for one, robot in zip(at, tried, strict=True):
            squares = cycle_squares(trial_set, floors, [robot])
            if squares is not None:
                values.append(hypothesis.value(one))
                ratios.append(
                    squares.recorded / (squares.simulated + always.simulated + squares.noise + 1e-12)
                )
        if len(values) > 1:
            found += fit_size(hypothesis, np.array(values), np.array(ratios), settings)
    return min(found, key=lambda one: one[0], default=(0.0, None))[1]


def fit_size(
    hypothesis: Hypothesis, values: Array, ratios: Array, settings: ChanceSettings
) -> list[tuple[float, Chance]]:
    """Return the size at which the ratios come closest to 1, and how far they then scatter.

    The logarithms of the ratios are taken to be Gaussian about 0, and linear in the logarithm of the size
    between the sizes that were simulated. Nothing is returned where that size is the least or the largest
    one.

    Args:
        hypothesis: the effect.
        values: its sizes, ascending, shape (n,).
        ratios: squares of recorded by simulated differences of the cycles, shape (n, signals).
        settings: the least scatter, and which sizes are plausible.
    """
    grid = np.geomspace(values[0], values[-1], settings.grid)
    logs = np.log(np.maximum(ratios, settings.least_ratio))
    along = np.stack([np.interp(np.log(grid), np.log(values), column) for column in logs.T], axis=1)
    squares = np.sum(along**2, axis=1)
    best, degrees = int(np.argmin(squares)), max(1, along.shape[1] - 1)
    effect, size = hypothesis.effect, float(grid[best])
    if best in (0, len(grid) - 1):
        return []
    plausible = effect.log_prior(size, hypothesis.nominal) >= settings.least_log_prior
    variance = max(float(squares[best]) / degrees, settings.least_scatter**2)
    inside = grid[squares <= squares[best] + settings.interval * variance]
    ends = (float(inside[0]), float(inside[-1]))
    left = float(np.exp(0.5 * along[best].max()))
    return [(float(squares[best]), Chance(effect.name, effect.parameter, size, ends, left, plausible))]
