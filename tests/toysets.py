"""Sets of effects without a simulator: each effect adds a known response to white rows of several trials."""

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.products import RowBlocks
from gaitopt.diagnose.fit.robust import RobustLoss
from gaitopt.diagnose.fit.runner import RobotRequest
from gaitopt.diagnose.fit.set_fit import SetFitter
from gaitopt.diagnose.fit.set_search import SetSearch
from gaitopt.diagnose.fit.settings import SETS, SetSettings
from gaitopt.diagnose.fit.trials import Comparison
from gaitopt.effects.parts import ALL
from gaitopt.effects.prior import Prior

Array = NDArray[np.float64]
Response = Callable[[float], Array]


def toy_hypothesis(name: str, rough: bool = False, unusual: float = 0.0) -> Hypothesis:
    """An effect from 0 to 1 that a problem file may set to any value from 0."""
    effect: Any = SimpleNamespace(
        name=name,
        target="none",
        rough=rough,
        jumps=False,
        unusual=unusual,
        scale="lin",
        parameter="size",
        changes_robot=True,
        prior_on=lambda nominal: (Prior("normal", 0.0, 1.0, "made up"), 1.0),
        allows=lambda value: value >= 0.0,
    )
    nominal: Any = SimpleNamespace(channels=("servo",))
    return Hypothesis(effect, ALL, 0.0, 1.0, 0.0, nominal)


class ToyBench:
    """Rows of several trials, to which effects add their responses."""

    def __init__(self, responses: dict[str, Response], measured: Array, trials: int):
        self.responses, self.measured = responses, measured
        self.rows = RowBlocks(np.repeat(np.arange(trials), len(measured) // trials), np.arange(trials))
        self.simulated = 0
        self.rough: frozenset[str] = frozenset()
        self.unusual: dict[str, float] = {}

    @property
    def hypotheses(self) -> list[Hypothesis]:
        return [
            toy_hypothesis(name, name in self.rough, self.unusual.get(name, 0.0)) for name in self.responses
        ]

    def compared(self, request: RobotRequest) -> Comparison:
        """The rows compared with a robot that has some effects."""
        self.simulated += 1
        sizes = {name: float(values["size"]) for name, values in request.effects.items()}
        left = self.measured - sum(self.responses[name](size) for name, size in sizes.items())
        return Comparison(np.array(request.at), left, np.empty(0), left)

    def simulate(self, requests: Sequence[RobotRequest]) -> list[Comparison | None]:
        return [self.compared(request) for request in requests]

    def fitter(self, settings: SetSettings = SETS) -> SetFitter:
        trials = self.rows.trials[self.rows.of_rows]
        none = np.ones(len(self.rows.trials))
        loss = RobustLoss(trials, settings.freedom, settings.temper, settings.most_rows, none, none)
        return SetFitter(loss, self.simulate, self.rows, settings)

    @property
    def nominal(self) -> Comparison:
        return Comparison(np.empty(0), self.measured, np.empty(0), self.measured)

    def search(self, settings: SetSettings = SETS) -> SetSearch:
        fitter = self.fitter(settings)
        return SetSearch(fitter, self.hypotheses, self.nominal, settings, fitter)


def curved(rng: np.random.Generator, rows: int, size: float) -> Response:
    """A response that grows with the value and bends."""
    first, second = size * rng.standard_normal(rows), 0.3 * size * rng.standard_normal(rows)
    return lambda value: value * first + value**2 * second


def late(rng: np.random.Generator, rows: int, size: float, begins_at: float = 0.15) -> Response:
    """A response that begins late, as that of a limit does."""
    direction = size * rng.standard_normal(rows)
    return lambda value: max(0.0, value - begins_at) * direction
