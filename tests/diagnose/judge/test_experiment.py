"""The next experiment: it is chosen for effects that a gait can tell apart, and names those that none can."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import ArrayLike

from gaitopt.diagnose.fit.runner import Runner
from gaitopt.diagnose.judge.causes import Causes
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.experiment import Contest, hand_tuned_waves, preferred, propose
from gaitopt.diagnose.judge.gait_score import GaitScore
from gaitopt.diagnose.judge.settings import DiagnosisSettings, ExperimentSettings
from gaitopt.gait.gait import Gait
from gaitopt.optimise.executors import SerialExecutor, open_executor
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator

NAMES = ("a", "b", "b", "c")
BRIEF = DiagnosisSettings(experiment=ExperimentSettings(seconds=2.0, random=1, refined=1))


def score(
    squares: ArrayLike, chances: Sequence[float] = (0.4, 0.2, 0.1, 0.3), names: tuple[str, ...] = NAMES
) -> GaitScore[Gait]:
    upper = np.triu(np.asarray(squares, dtype=float), 1)
    return GaitScore(cast(Gait, None), upper + upper.T, 1, names, np.array(chances))


@given(arrays(float, (4, 4), elements=st.floats(0.0, 50.0)), st.floats(1.0, 10.0))
def test_candidates_farther_apart_leave_less_doubt(squares: np.ndarray, factor: float) -> None:
    chances, names = (0.4, 0.2, 0.1, 0.3), ("a", "b", "c", "d")
    near, far = score(squares, chances, names), score(factor * squares, chances, names)
    assert 0.0 <= near.wrong <= 1.0 - np.square(chances).sum() + 1e-12
    assert far.wrong <= near.wrong + 1e-12


def test_doubt_of_two_candidates_is_that_of_bayes() -> None:
    """With a difference of d standard errors, odds of one to one become exp(d² / 2) to one."""
    of_two = score([[0.0, 4.0], [0.0, 0.0]], (0.5, 0.5), ("a", "b"))
    assert of_two.wrong == pytest.approx(1.0 / (1.0 + np.exp(2.0)))
    assert of_two.separation == pytest.approx(2.0)


def test_targets_of_one_effect_need_not_be_told_apart() -> None:
    assert score(np.zeros((2, 2)), (0.5, 0.5), ("a", "a")).wrong == 0.0


def test_a_pair_that_nothing_parts_does_not_decide() -> None:
    """The better of two gaits separates c from the rest, although b is as near to a as on the other gait."""
    poor, good = np.zeros((4, 4)), np.zeros((4, 4))
    poor[0, 1:] = (0.1, 0.1, 0.5)
    good[:3, 3] = 25.0
    assert score(good).wrong < score(poor).wrong


def of_speeds(squares: float, speeds: ArrayLike) -> GaitScore[Gait]:
    apart = np.array([[0.0, squares], [squares, 0.0]])
    return GaitScore(cast(Gait, None), apart, 1, ("a", "b"), np.array([0.5, 0.5]), np.asarray(speeds))


def test_a_recording_is_worth_what_a_better_choice_gains() -> None:
    """One gait is fast on the one robot, another on the other: it pays to know which robot it is."""
    others = [of_speeds(0.0, (0.04, 0.01)), of_speeds(0.0, (0.01, 0.03))]
    assert of_speeds(1e4, (0.0, 0.0)).worth_among(others) == pytest.approx(0.5 * (0.04 + 0.03) - 0.025)
    assert of_speeds(0.0, (0.0, 0.0)).worth_among(others) == pytest.approx(0.0)
    assert 0.0 < cast(float, of_speeds(1.0, (0.0, 0.0)).worth_among(others)) < 0.01
    assert of_speeds(1e4, (0.0, 0.0)).worth_among(others[:1]) == 0.0  # there is no choice
    assert score(np.zeros((4, 4))).worth_among([score(np.zeros((4, 4)))]) is None  # no way is measured


def test_hand_tuned_waves_are_tried_at_new_periods(arcfold: Problem) -> None:
    measured = [arcfold.baselines["square-4s"], arcfold.baselines["square-1s"]]
    waves = hand_tuned_waves(arcfold, measured)
    names = [name for _, name in waves]
    assert {"square-2s", "square-0.5s"} <= set(names)
    low, high = arcfold.space.period_s
    for gait, name in waves:
        assert dict(gait.channels) == dict(arcfold.baselines[name].channels)
        assert low <= gait.period_s <= high
        assert all(abs(np.log(gait.period_s / one.period_s)) > 0.09 for one in measured)
    periods = [gait.period_s for gait, _ in waves]
    assert len(set(periods)) == len(periods) > 4


def test_a_hand_tuned_wave_that_does_as_well_is_preferred(arcfold: Problem) -> None:
    tuned, other = arcfold.baselines["square-2s"], arcfold.baselines["square-1s"]
    settings = ExperimentSettings()

    def scored(gait: Gait, squares: float) -> GaitScore[Gait]:
        apart = np.array([[0.0, squares], [squares, 0.0]])
        return GaitScore(gait, apart, 1, ("a", "b"), np.array([0.5, 0.5]))

    wave_of = {tuned.key: "square-2s"}
    both = [scored(tuned, 12.0), scored(other, 14.0)]
    assert preferred(both, wave_of, settings).gait is tuned
    assert preferred([scored(tuned, 1.0), both[1]], wave_of, settings).gait is other
    assert preferred(both, {}, settings).gait is other


def causes(probabilities: Sequence[float]) -> Causes:
    """A slippery robot, or a camera whose scale or whose view of the robot's size is wrong."""
    values = [
        {"camera_scale": {"scale": 0.93}},
        {"pad_friction": {"scale": 0.5}},
        {"camera_tilt": {"angle_rad": 0.01}},
    ]
    candidates: list[Any] = [SimpleNamespace(names=list(each), effect_values=each) for each in values]
    chosen = tuple(candidates[: len(probabilities)])
    found = SimpleNamespace(candidates=chosen, probabilities=np.array(probabilities))
    return cast(Causes, found)


@pytest.mark.slow
def test_a_gait_is_proposed_that_was_not_measured(arcfold: Problem) -> None:
    simulator, measured = Simulator.build(arcfold), [arcfold.baselines["square-1s"]]
    with open_executor("threads", 2) as executor:
        context = Context(Runner(executor), 1, BRIEF)
        one = propose(simulator, causes((0.5, 0.3, 0.2)), measured, ["marker.x"], context)
    assert one is not None
    assert one.gait.key != measured[0].key
    assert one.separates == ["camera_scale", "pad_friction", "camera_tilt"]
    assert min(one.separation, one.before) > 0.0
    assert all({*pair} < {*one.separates} for pair in one.inseparable)


def test_a_cause_that_stands_alone_is_put_to_the_test() -> None:
    """The second candidate counts, although its probability is nearly zero."""
    contest = Contest.of(causes((1.0, 0.0, 0.0)))
    assert contest.names == ["camera_scale", "pad_friction"]
    assert contest.prior == pytest.approx([1.0 / 1.01, 0.01 / 1.01])


def test_one_effect_alone_needs_no_experiment(arcfold: Problem) -> None:
    simulator, context = Simulator.build(arcfold), Context(Runner(SerialExecutor()), 1)
    assert propose(simulator, causes((1.0,)), [], ["marker.x"], context) is None
