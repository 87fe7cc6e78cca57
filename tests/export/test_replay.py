"""The exported table in simulation: each step from the gait to the servos, and what it costs."""

from concurrent.futures import Executor

import numpy as np
import pytest
from exporting import table_of
from helpers import still

from gaitopt.export.handover import Choices, prepare
from gaitopt.export.stages import command_stages, sent_pulses, sent_us
from gaitopt.problem.problem import Problem


def test_the_last_stage_is_what_the_player_sends_one_frame_late(wired: Problem) -> None:
    table = table_of(wired, wired.baselines["stride"])
    time = np.arange(0, 3000) * 1e-3
    played = command_stages(wired, table)["player"](time)
    sent = np.array(sent_pulses(table, 150))
    for frame in (0, 1, 77, 148):
        pulses = sent_us(sent[frame], 20_000)
        wanted = [
            np.deg2rad(servo.angle_deg(pulse))
            for servo, pulse in zip(table.servos.values(), pulses, strict=True)
        ]
        rows = played[20 * (frame + 1) : 20 * (frame + 2)]
        np.testing.assert_allclose(rows, np.tile(wanted, (20, 1)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(played[:20], 0.0, atol=np.deg2rad(0.06))


def test_the_stages_add_one_thing_at_a_time(wired: Problem) -> None:
    stages = command_stages(wired, table_of(wired, wired.baselines["stride"]))
    time = 2.0 + np.arange(1000) * 1e-3
    rows = {name: np.rad2deg(commands(time)) for name, commands in stages.items()}
    half_steps_deg = 0.5 * (1.0 + 20_000 / 2**14) / 11.1
    assert np.abs(rows["interpolation"] - rows["gait"]).max() < 0.5
    assert np.abs(rows["quantisation"] - rows["interpolation"]).max() <= half_steps_deg
    np.testing.assert_array_equal(rows["frame rate"], np.repeat(rows["quantisation"][::20], 20, axis=0))
    np.testing.assert_array_equal(rows["latency"][20:], rows["frame rate"][:-20])
    assert np.abs(rows["player"] - rows["latency"]).max() <= 2.0 * half_steps_deg


@pytest.mark.slow
def test_a_few_samples_lose_speed_and_interpolation_is_named(quick: Problem, serial: Executor) -> None:
    """With four samples a square wave becomes a triangle."""
    handover = prepare(quick, quick.baselines["square-1s"], Choices("c", samples=4), serial)
    warning = handover.replay.warning
    assert handover.replay.loss is not None
    assert abs(handover.replay.loss) > 0.05
    assert warning in handover.warnings
    assert set(handover.replay.causes) == {
        "interpolation",
        "quantisation",
        "frame rate",
        "latency",
        "ramp and slew clamp",
    }
    assert sum(handover.replay.causes.values()) == pytest.approx(handover.replay.loss)


@pytest.mark.slow
def test_a_slow_slew_clamp_is_named_as_the_cause(quick: Problem, serial: Executor) -> None:
    handover = prepare(quick, quick.baselines["square-1s"], Choices("c", slew="60"), serial)
    assert handover.table.slew_us == (13, 13, 13)
    assert handover.replay.loss is not None
    assert handover.replay.loss > 0.2
    assert "most of it by ramp and slew clamp (" in str(handover.replay.warning)


def test_the_servos_own_speed_is_the_clamp_that_servo_asks_for(quick: Problem, serial: Executor) -> None:
    handover = prepare(quick, quick.baselines["square-2s"], Choices("json", slew="servo"), serial)
    assert handover.table.slew_us == (133, 133, 133)


def test_a_gait_that_stands_still_has_no_loss_to_tell(wired: Problem, serial: Executor) -> None:
    played = prepare(wired, still(wired), Choices("json"), serial).replay
    assert played.ideal_m_s == pytest.approx(0.0, abs=1e-3)
    assert played.causes == {}
    assert "does not go forward" in str(played.warning) or "scatter" in str(played.warning)
