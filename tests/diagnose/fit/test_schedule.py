"""Which robots are simulated so that every effect is fitted that may be the cause."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from toyfits import toy_comparison, toy_fit, toy_trials

from gaitopt.diagnose.fit.runner import RobotRequest
from gaitopt.diagnose.fit.schedule import complete, finish, fit_all, fit_leading
from gaitopt.diagnose.fit.trials import Comparison, TrialSet

ROWS, BLOCKS = 40, 4
RNG = np.random.default_rng(5)
CAUSE, OTHER, SMALL = RNG.standard_normal((3, ROWS))
OTHER -= CAUSE * (OTHER @ CAUSE) / (CAUSE @ CAUSE)
SMALL -= CAUSE * (SMALL @ CAUSE) / (CAUSE @ CAUSE)
MEASURED = 20.0 * 0.5 * CAUSE + 0.3 * SMALL

Response = Callable[[float], NDArray[np.float64]]
RESPONSES: dict[str, Response] = {
    "cause": lambda size: 20.0 * size * CAUSE,
    "limit": lambda size: 20.0 * max(0.0, size - 0.4) * CAUSE,
    "other": lambda size: 20.0 * size * OTHER,
    "opposite": lambda size: -20.0 * size * CAUSE,
    "small": lambda size: size * SMALL,
    "bent": lambda size: 20.0 * size**2 * CAUSE,
}


class ToyRunner:
    """Simulates robots whose effects add their responses; counts how often each effect was simulated."""

    def __init__(self, failing: Sequence[tuple[str, float]] = (), measured: NDArray[np.float64] = MEASURED):
        self.count: Counter[str] = Counter()
        self.measured = measured
        self.done, self.most, self.failing = 0, 0, failing

    def stage(self, name: str, most: int | None = None) -> "ToyRunner":
        self.done, self.most = 0, most or 0
        return self

    def spare(self, count: int) -> None:
        self.most -= count

    def __call__(self, trial_set: TrialSet, requests: Sequence[RobotRequest]) -> list[Comparison | None]:
        self.done += len(requests)
        return [self.compared(request) for request in requests]

    def compared(self, request: RobotRequest) -> Comparison | None:
        ((name, values),) = request.effects.items()
        self.count[name] += 1
        if any(name == one and request.at[0] == pytest.approx(at) for one, at in self.failing):
            return None
        return toy_comparison(request.at, self.measured - RESPONSES[name](float(values["size"])))


def fitted(runner: Any, names: Sequence[str]) -> list[Any]:
    trials = toy_trials(ROWS, BLOCKS)
    hypotheses = [toy_fit(trials, MEASURED, RESPONSES[name], (0.0,), name).hypothesis for name in names]
    return fit_all(trials, hypotheses, toy_comparison([0.0], MEASURED), runner)


def test_an_effect_that_promises_nothing_is_simulated_once() -> None:
    runner = ToyRunner()
    cause, limit, other, opposite = fitted(runner, ("cause", "limit", "other", "opposite"))
    assert runner.count["other"] == runner.count["opposite"] == 1
    assert cause.best() == pytest.approx(0.5, abs=0.01)
    assert limit.best() == pytest.approx(0.9, abs=0.01)
    assert other.loss().sum() == pytest.approx(opposite.loss().sum())


def test_an_effect_that_cannot_be_simulated_where_it_is_tried_first_is_tried_elsewhere() -> None:
    runner: Any = ToyRunner(failing=[("cause", 0.6)])
    cause, _ = fitted(runner, ("cause", "other"))
    assert cause.best() == pytest.approx(0.5, abs=0.02)


def test_progress_tells_no_more_robots_than_there_are() -> None:
    runner = ToyRunner()
    fitted(runner, ("cause", "limit", "other", "opposite"))
    assert runner.done == runner.most > 0


def test_before_sets_are_searched_effects_that_promise_little_are_simulated_too() -> None:
    runner: Any = ToyRunner()
    fits = fitted(runner, ("cause", "small"))
    assert runner.count["small"] == 1
    complete(fits, runner)
    assert runner.count["small"] >= 3
    assert not any(fit.unscreened() for fit in fits)


def test_only_effects_that_remove_much_of_the_beginnings_are_fitted_to_whole_trials() -> None:
    trials, runner = toy_trials(ROWS, BLOCKS), ToyRunner()
    heads = fitted(runner, ("cause", "other", "small"))
    runner.count.clear()
    whole: Any = runner
    fits = fit_leading(trials, toy_comparison([0.0], MEASURED), heads, whole)
    assert set(runner.count) == {"cause"}
    assert [len(fit.comparisons) for fit in fits[1:]] == [1, 1]
    assert fits[0].best() == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(("unexplained", "robots"), [(0.0, 1), (20.0, 0)])
def test_the_best_fit_is_finished_only_where_that_can_make_it_right(unexplained: float, robots: int) -> None:
    measured = MEASURED + unexplained * OTHER
    runner: Any = ToyRunner(measured=measured)
    fit = toy_fit(toy_trials(ROWS, BLOCKS), measured, RESPONSES["bent"], (0.0, 0.2, 0.6, 1.0), "bent")
    finish([fit], runner)
    assert min(1, runner.count["bent"]) == robots
