"""What is sent to the servos: framed, held before the start, and by any drive."""

import numpy as np
import pytest
from drives import wandering

from gaitopt.problem.problem import Problem
from gaitopt.problem.start import start_targets
from gaitopt.simulation.commands import drive_commands, row_commands, servo_commands
from gaitopt.simulation.scenario import NOMINAL, Scenario
from gaitopt.simulation.tolerances import SmallErrors


def test_framed_commands_are_held_for_a_frame_and_come_one_frame_late(quick: Problem) -> None:
    gait = quick.baselines["square-1s"].with_period(0.9871)
    frame_s = quick.file.servo.frame_s
    time = np.arange(2000.0) * 1e-3
    sent = servo_commands(quick, gait, time, framed=True)
    frame = np.round(time * 1e6).astype(int) // round(frame_s * 1e6)
    assert frame.max() > 50
    assert (sent[frame == 0] == start_targets(quick)).all()
    for number in range(1, frame.max() + 1):
        in_frame = sent[frame == number]
        assert (in_frame == in_frame[0]).all()
        assert in_frame[0] == pytest.approx(gait.targets([(number - 1) * frame_s])[0], abs=1e-12)
    unframed = servo_commands(quick, gait, time)
    np.testing.assert_array_equal(unframed, gait.targets(time))
    assert (unframed != sent).any()


def test_before_the_first_frame_the_start_is_held(strider: Problem) -> None:
    held = strider.file.start.model_copy(update={"ctrl_deg": {"rear": 7.0}})
    problem = Problem.from_file(
        strider.file.model_copy(update={"start": held}), strider.source, strider.model_path
    )
    sent = servo_commands(problem, problem.baselines["square"], np.array([0.0, 0.0199, 0.02]), framed=True)
    assert sent[:2] == pytest.approx(np.deg2rad([[7.0, 0.0], [7.0, 0.0]]))
    assert sent[2] == pytest.approx(problem.baselines["square"].targets([0.0])[0])


def test_before_the_start_any_drive_is_held_and_then_has_each_servos_zero(strider: Problem) -> None:
    drive, time = wandering(2, 1.0), np.array([-0.5, -1e-12, 0.0, 0.3])
    sent = drive_commands(strider, drive, Scenario(SmallErrors(servo_trim_rad=(0.1, -0.2))), 1e-3)(time)
    plain = drive_commands(strider, drive, NOMINAL, 1e-3)(time)
    np.testing.assert_array_equal(sent, plain + np.array([0.1, -0.2]))
    np.testing.assert_array_equal(plain[0], start_targets(strider))
    np.testing.assert_array_equal(plain[1:], drive.targets(time[1:]))


def test_frames_hold_any_drive(strider: Problem) -> None:
    drive, frame_s = wandering(2, 1.0), strider.file.servo.frame_s
    time = np.array([0.0, 1.0, 1.5, 2.0, 7.3]) * frame_s
    sent = servo_commands(strider, drive, time, framed=True)
    np.testing.assert_array_equal(sent[0], start_targets(strider))
    expected = drive.targets(np.array([0.0, 0.0, 1.0, 6.0]) * frame_s)
    np.testing.assert_allclose(sent[1:], expected, atol=1e-12)


def test_rows_are_held_for_a_step_and_at_both_ends(strider: Problem) -> None:
    time = np.arange(4.0) * 1e-3
    rows = np.arange(8.0).reshape(4, 2)
    sent = row_commands(strider, time, rows, 1e-3)
    assert sent(time) is rows
    found = sent(np.array([-2e-3, 0.0, 2.1e-3, 9e-3]))
    np.testing.assert_array_equal(found, [start_targets(strider), rows[0], rows[2], rows[3]])
