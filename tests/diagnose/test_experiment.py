"""The next experiment: it is spent on what a gait can tell apart, and says what none can."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gaitopt.diagnose.judge import experiment
from gaitopt.diagnose.judge.experiment import GaitScore, _candidates, propose
from gaitopt.optimise.executors import open_executor
from gaitopt.problem.problem import load_problem
from gaitopt.simulation.rollout import Simulator

NAMES = ("a", "b", "b", "c")


def score(squares, chances=(0.4, 0.2, 0.1, 0.3), names=NAMES):
    squares = np.asarray(squares, dtype=float)
    return GaitScore(None, np.triu(squares, 1) + np.triu(squares, 1).T, 1, names, np.array(chances))


@given(arrays(float, (4, 4), elements=st.floats(0.0, 50.0)), st.floats(1.0, 10.0))
def test_rivals_farther_apart_leave_less_doubt(squares, factor):
    chances, names = (0.4, 0.2, 0.1, 0.3), ("a", "b", "c", "d")
    near, far = score(squares, chances, names), score(factor * squares, chances, names)
    assert 0.0 <= near.wrong <= 1.0 - np.square(chances).sum() + 1e-12
    assert far.wrong <= near.wrong + 1e-12


def test_doubt_of_two_rivals_is_that_of_bayes():
    """With a difference of d standard errors, odds of one to one become exp(d² / 2) to one."""
    of_two = score([[0.0, 4.0], [0.0, 0.0]], (0.5, 0.5), ("a", "b"))
    assert of_two.wrong == pytest.approx(1.0 / (1.0 + np.exp(2.0)))
    assert of_two.separation == pytest.approx(2.0)


def test_targets_of_one_effect_need_not_be_told_apart():
    assert score(np.zeros((2, 2)), (0.5, 0.5), ("a", "a")).wrong == 0.0


def test_a_pair_that_nothing_parts_does_not_decide():
    """Of two gaits the better one parts c from the rest, though b is as near to a as on the other."""
    poor, good = np.zeros((4, 4)), np.zeros((4, 4))
    poor[0, 1:] = (0.1, 0.1, 0.5)
    good[:3, 3] = 25.0
    assert score(good).wrong < score(poor).wrong


@pytest.fixture(scope="module")
def found():
    """A slippery robot, or a camera whose scale or whose view of the robot's size is wrong."""
    settings = [
        {"camera_scale": {"scale": 0.93}},
        {"pad_friction": {"scale": 0.5}},
        {"camera_tilt": {"angle_rad": 0.01}},
    ]
    candidates = [SimpleNamespace(names=list(each), effect_values=each) for each in settings]
    return SimpleNamespace(candidates=candidates, chances=np.array([0.5, 0.3, 0.2]))


def test_a_gait_is_proposed_that_was_not_measured(found, monkeypatch):
    for name, few in (("SECONDS", 2.0), ("_RANDOM", 1), ("_REFINED", 1)):
        monkeypatch.setattr(experiment, name, few)
    problem = load_problem("arcfold")
    simulator, measured = Simulator.build(problem), [problem.baselines["square-1s"]]
    with open_executor("threads", 2) as executor:
        one = propose(simulator, found, measured, ["marker.x"], executor, 1)
    assert one.gait.key != measured[0].key
    assert one.separates == ["camera_scale", "pad_friction", "camera_tilt"]
    assert min(one.separation, one.before) > 0.0
    assert all({*pair} < {*one.separates} for pair in one.inseparable)


def test_a_cause_that_stands_alone_is_put_to_the_test(found):
    """The runner-up counts, though nothing is left of its probability."""
    sure = SimpleNamespace(candidates=found.candidates, chances=np.array([1.0, 0.0, 0.0]))
    candidates, chances = _candidates(sure)
    assert [candidate.names for candidate in candidates] == [["camera_scale"], ["pad_friction"]]
    assert chances == pytest.approx([1.0 / 1.01, 0.01 / 1.01])


def test_one_effect_alone_needs_no_experiment(found):
    alone = SimpleNamespace(candidates=found.candidates[:1], chances=np.ones(1))
    simulator = Simulator.build(load_problem("arcfold"))
    assert propose(simulator, alone, [], ["marker.x"], None, 1) is None
