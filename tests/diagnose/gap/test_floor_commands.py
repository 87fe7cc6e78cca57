"""Floors of trials of logged commands: repeats first, then what the repeats of other commands suggest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import rigs

from gaitopt.diagnose.gap.align import align
from gaitopt.diagnose.gap.floor import Floor, Floors, measure_floors, rms_speed
from gaitopt.diagnose.gap.predict import predict
from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator

FRAME_S = 0.02
COUNT_RAD = 0.0015
LATE_S = 0.008
SIGNAL = "joint.elbow"


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """An arm on one servo, without gravity: it starts where it is told."""
    return rigs.build(tmp_path_factory.mktemp("rig") / "arm", rigs.arm(gravity=0.0), {"marker": "tip"})


def logged(rows: np.ndarray, start: float | None = 0.0) -> LoggedCommands:
    """Commands at 50 Hz of the arm's servo, rad."""
    drive = LoggedCommands.of(("turn",), FRAME_S * np.arange(len(rows)), rows)
    at = None if start is None else {"elbow": start}
    return drive.recorded(drive.duration_s, FRAME_S, at)


def slow() -> LoggedCommands:
    """A slow ramp."""
    return logged(np.linspace(0.0, 0.3, 100))


def middle() -> LoggedCommands:
    """Steps of 0.3 rad."""
    return logged(0.3 * (np.arange(100) // 25 % 2))


def quick() -> LoggedCommands:
    """A random telegraph."""
    signs = np.sign(np.random.default_rng(5).standard_normal(20))
    return logged(0.8 * np.repeat(signs, 5))


def recorded(arm: Problem, drive: LoggedCommands, late: Sequence[float]) -> list[Trial]:
    """Recordings by an encoder of 0.0015 rad a count; each came late by its own time, s."""
    path = Simulator.build(arm).run(drive)
    time = FRAME_S * np.arange(round(drive.duration_s / FRAME_S))
    trials = []
    for number, by in enumerate(late):
        angle = COUNT_RAD * np.round(np.interp(time - by, path.time, path[SIGNAL]) / COUNT_RAD)
        trial = Trial.of(f"{drive.key[:4]}-{number}", drive, time, {SIGNAL: angle})
        trials.append(replace(trial, starts_at_s=0.0))
    return trials


def floors_of(arm: Problem, trials: Sequence[Trial]) -> list[Floors]:
    """The floors of some trials."""
    robot = Simulator.build(arm)
    with ThreadPoolExecutor(1) as executor:
        predictions = predict(robot, trials, executor)
        aligned = [align(*pair) for pair in zip(trials, predictions, strict=True)]
        return measure_floors(robot, aligned, executor, 1)


def test_repeats_of_a_log_measure_its_floor(arm: Problem) -> None:
    trials = recorded(arm, middle(), [-LATE_S, 0.0, LATE_S])
    for trial, floors in zip(trials, floors_of(arm, trials), strict=True):
        floor = floors[SIGNAL]
        assert floor.repeats == pytest.approx(LATE_S * rms_speed(trial, SIGNAL), rel=0.35)
        assert floor.others is None
        assert floor.total == pytest.approx(floor.repeats, rel=0.2)


def test_levels_of_repeats_that_differ_are_in_the_floor(arm: Problem) -> None:
    one, other = recorded(arm, middle(), [0.0, 0.0])
    raised = replace(other, signals={SIGNAL: other.signals[SIGNAL] + 0.02})
    for floors in floors_of(arm, [one, raised]):
        assert floors[SIGNAL].repeats == pytest.approx(0.02 / math.sqrt(2.0), rel=0.01)


def test_commands_without_repeats_get_their_floor_from_those_of_others(arm: Problem) -> None:
    late = [-LATE_S, 0.0, LATE_S]
    known = [*recorded(arm, slow(), late), *recorded(arm, middle(), late)]
    (alone,) = recorded(arm, quick(), [0.0])
    floor = floors_of(arm, [*known, alone])[-1][SIGNAL]
    assert floor.repeats is None
    # Three repeats of it would differ by about the same.
    measured = floors_of(arm, recorded(arm, quick(), late))[0][SIGNAL].repeats
    assert measured is not None
    assert floor.others is not None
    assert floor.others == pytest.approx(measured, rel=0.5)
    assert floor.total >= floor.others


def test_without_any_repeats_noise_and_start_are_the_floor(arm: Problem) -> None:
    (alone,) = recorded(arm, slow(), [0.0])
    (floors,) = floors_of(arm, [alone])
    assert (floors[SIGNAL].repeats, floors[SIGNAL].others) == (None, None)
    assert floors[SIGNAL].total < 2.0 * COUNT_RAD


def test_the_noise_of_a_sensor_is_that_of_its_quietest_recordings(arm: Problem) -> None:
    trials = [trial for drive in (slow(), middle(), quick()) for trial in recorded(arm, drive, [0.0])]
    noises = {floors[SIGNAL].noise for floors in floors_of(arm, trials)}
    assert len(noises) == 1
    assert noises.pop() < COUNT_RAD
    (lone,) = floors_of(arm, trials[-1:])  # in a quick recording alone, the motion looks like noise
    assert lone[SIGNAL].noise > 2.0 * COUNT_RAD


def test_a_measured_start_is_known_to_the_sensors_noise(arm: Problem) -> None:
    (trial,) = recorded(arm, slow(), [0.0])
    unmeasured = replace(trial, drive=logged(slow().rows[:, 0], start=None))
    (measured,), (assumed,) = floors_of(arm, [trial]), floors_of(arm, [unmeasured])
    ratio = measured[SIGNAL].start_pose / assumed[SIGNAL].start_pose
    spread = arm.file.tolerances.start_pose_rad
    assert ratio == pytest.approx(measured[SIGNAL].noise / spread, rel=0.2)


def test_parts_that_do_not_apply_are_left_out() -> None:
    floor = Floor(1.0, None, 3.0, 4.0, others=5.0)
    assert floor.total == pytest.approx(math.sqrt(25.0 + 16.0))
    assert floor.to_dict()["others"] == 5.0
    assert "others" not in Floor(1.0, 2.0, 3.0, 4.0).to_dict()
