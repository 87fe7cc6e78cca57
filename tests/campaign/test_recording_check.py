"""A recording of another gait, or of a robot that stopped, is told from one of its own gait."""

from dataclasses import replace

import pytest
from sealed_walkers import Walker

from gaitopt.campaign.check import same_gait, wrong_recording
from gaitopt.diagnose.record.trial import Trial
from gaitopt.jobs.executor import opened
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator

WEAK = {"servo_gain": {"scale": 0.7, "target": "all"}}


@pytest.fixture(scope="module")
def film(arcfold: Problem) -> Trial:
    """A film of a robot with weak servos."""
    return Walker(arcfold, WEAK, seconds=4.2)(arcfold.baselines["square-1s"])


def reason(arcfold: Problem, trial: Trial) -> str | None:
    with opened("serial") as pool:
        gaits = arcfold.baselines.values()
        return wrong_recording(trial, gaits, Simulator.build(arcfold), pool)


def test_a_film_of_its_gait_is_taken_though_the_robot_is_another(arcfold: Problem, film: Trial) -> None:
    assert reason(arcfold, film) is None


def test_a_film_of_another_gait_is_named(arcfold: Problem, film: Trial) -> None:
    named = replace(film, drive=arcfold.baselines["square-2s"])
    assert "moves as square-1s does" in (reason(arcfold, named) or "")


def test_a_robot_that_stops_is_named(arcfold: Problem, film: Trial) -> None:
    stopped = {name: series.copy() for name, series in film.signals.items()}
    for series in stopped.values():
        series[film.time > 2.0] = series[film.time > 2.0][0]
    assert "stands still" in (reason(arcfold, replace(film, signals=stopped)) or "")


def test_a_gait_written_again_by_hand_is_the_same(arcfold: Problem) -> None:
    gait = arcfold.baselines["square-1s"]
    assert same_gait(arcfold.space, gait, gait.with_period(1.0 + 1e-9))
    assert not same_gait(arcfold.space, gait, gait.with_period(1.01))
