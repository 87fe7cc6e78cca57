"""Commands that are rounded, and commands that arrive late by chance."""

import math
from typing import Any

import numpy as np
import pytest
import rigs
from helpers import same_bits
from numpy.typing import NDArray

from gaitopt.effects.library import timing
from gaitopt.gait.drive import Commands
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]
Effects = dict[str, dict[str, Any]]
STEP = 1e-3


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """Two damped wheels on two servos without torque limit to speak of."""
    mjcf = rigs.twins(joint='damping="0.02"', servo='kp="2" forcerange="-50 50"')
    return rigs.build(tmp_path_factory.mktemp("twins") / "rig", mjcf, {"marker": "wheel"}, servos=rigs.TWO)


def arriving(problem: Problem, sent: Commands, effects: Effects, step_s: float = STEP) -> Commands:
    fidelity = Fidelity(timestep_s=step_s, integrator="implicitfast")
    simulator = Simulator.build(problem.with_effects(effects), fidelity=fidelity)
    return simulator.effects.commands(sent, simulator.models[0])


def rounded(step: float, target: str = "turn") -> Effects:
    return {"servo_resolution": {"step_rad": step, "target": target}}


def jitter(sd: float, target: str = "turn") -> Effects:
    return {"command_jitter": {"sd_s": sd, "target": target}}


def staircase(every_s: float) -> Commands:
    """Both servos are sent one rad more every so often, from time 0 on."""
    return lambda t: np.tile((np.floor(t / every_s + 1e-6).clip(-1.0)[:, None] + 1.0), 2)


def delays(problem: Problem, sd: float, every_s: float, count: int, step_s: float = STEP) -> Array:
    """How late each command of a staircase arrives, s; a change within a step shows as a part of it."""
    late = arriving(problem, staircase(every_s), jitter(sd), step_s)
    time = step_s * np.arange(round((count + 2) * every_s / step_s))
    got = late(time)[:, 0]
    waited = [step_s * np.sum(np.clip(n - got, 0.0, 1.0)) for n in range(1, count + 1)]
    sent_at: Array = every_s * np.arange(count)
    return np.array(waited) - sent_at


# --- resolution ---------------------------------------------------------------------------------


def test_a_command_is_rounded_to_a_multiple_of_the_step(problem: Problem) -> None:
    def sent(time: Array) -> Array:
        return np.stack([time - 0.5, time - 0.5], axis=1)

    time = np.linspace(0.0, 1.0, 1001)
    got = arriving(problem, sent, rounded(0.03))(time)
    assert got[:, 0] / 0.03 == pytest.approx(np.round(got[:, 0] / 0.03), abs=1e-9)
    assert np.abs(got[:, 0] - sent(time)[:, 0]).max() <= 0.015 + 1e-12
    assert np.array_equal(got[:, 1], sent(time)[:, 1]), "the other servo's is not"


def test_a_servo_rests_on_its_grid(problem: Problem) -> None:
    path = rigs.hold(problem, 0.217, 1.5, **rounded(0.05))
    assert path["joint.wheel"][-1] == pytest.approx(0.2, abs=1e-4)
    assert path["joint.idler"][-1] == pytest.approx(0.217, abs=1e-4)
    assert path["target.turn"][-1] == 0.217


# --- jitter -------------------------------------------------------------------------------------


@pytest.mark.parametrize("sd", [0.002, 0.02])
def test_each_command_waits_by_its_own_time_of_the_stated_spread(problem: Problem, sd: float) -> None:
    waited = delays(problem, sd, 0.2, 1000)
    assert np.std(waited) == pytest.approx(sd, rel=0.05)
    assert np.mean(waited) == pytest.approx(math.sqrt(3.0) * sd, rel=0.05)
    assert waited.min() == pytest.approx(0.0, abs=0.02 * sd)
    assert waited.max() <= math.sqrt(12.0) * sd + 1e-9
    one, next_one = waited[:-1], waited[1:]
    assert abs(np.corrcoef(one, next_one)[0, 1]) < 0.1, "independent of the one before"


def test_delays_scale_with_their_spread_and_need_no_whole_steps(problem: Problem) -> None:
    small, large = (delays(problem, sd, 0.1, 50) for sd in (0.0003, 0.003))
    assert 10.0 * small == pytest.approx(large, abs=1e-6)


def test_delays_do_not_depend_on_the_step(problem: Problem) -> None:
    coarse, fine = (delays(problem, 0.004, 0.1, 20, step_s) for step_s in (1e-3, 0.25e-3))
    assert fine == pytest.approx(coarse, abs=1e-6)


def test_no_command_overtakes_the_one_before(problem: Problem) -> None:
    late = arriving(problem, staircase(0.02), jitter(0.05))
    got = late(STEP * np.arange(2000))[:, 0]
    assert (np.diff(got) >= 0.0).all()
    assert (np.diff(got) > 1.5).any(), "some arrive with the one before"


def test_the_same_commands_have_the_same_delays(problem: Problem) -> None:
    """Whatever part of them is asked for, and whether another effect asks for it."""
    log = LoggedCommands.of(rigs.TWO, 0.02 * np.arange(40), np.random.default_rng(1).random((40, 2)))

    def sent(time: Array) -> Array:
        return np.where((time < -1e-9)[:, None], 0.0, log.targets(time))

    late = arriving(problem, sent, jitter(0.01))
    time = STEP * np.arange(800)
    whole = late(time)
    for begin in (1, 7, 333):
        assert late(time[begin:]) == pytest.approx(whole[begin:], abs=1e-9)
    assert late(time[400:401]) == pytest.approx(whole[400:401], abs=1e-9)
    latency: Effects = {"command_latency": {"delay_s": 0.05}}
    both = arriving(problem, sent, jitter(0.01) | latency)(time)
    assert both[50:, 0] == pytest.approx(whole[:-50, 0], abs=1e-9)
    simulator = Simulator.build(problem.with_effects(jitter(0.01)))
    assert same_bits(simulator.run(log), Simulator.build(problem.with_effects(jitter(0.01))).run(log))


def test_a_frame_s_commands_wait_together(problem: Problem) -> None:
    """Both servos change at once, or the second 1 ms after the first."""
    for apart in (0.0, 1e-3):

        def sent(time: Array, apart: float = apart) -> Array:
            return np.stack([np.floor(time / 0.1 + 1e-6), np.floor((time - apart) / 0.1 + 1e-6)], axis=1)

        got = arriving(problem, sent, jitter(0.01, "all"))(STEP * np.arange(1000))
        later = round(apart / STEP)
        assert got[later:, 1] == pytest.approx(got[: len(got) - later, 0], abs=1e-6)


def test_edges_of_a_square_wave_are_late_and_the_wave_s_height_is_kept(strider: Problem) -> None:
    gait = strider.baselines["stride"]
    effects: Effects = {"command_jitter": {"sd_s": 0.005, "target": "front"}}
    simulator = Simulator.build(strider.with_effects(effects))
    time = simulator.clock(2.0)
    got = simulator.effects.commands(gait.targets, simulator.models[0])(time)
    sent = gait.targets(time)
    assert np.array_equal(got[:, 0], sent[:, 0])
    assert not np.array_equal(got[:, 1], sent[:, 1])
    assert got[:, 1].min() >= sent[:, 1].min() - 1e-12
    assert got[:, 1].max() <= sent[:, 1].max() + 1e-12


def test_power_is_cut_and_restored_late_and_only_then(problem: Problem) -> None:
    def sent(time: Array) -> Array:
        off = (time > 0.0995) & (time < 0.1995)
        return np.tile(np.where(off, math.nan, 0.3 * (time > 0.2995))[:, None], 2)

    got = arriving(problem, sent, jitter(0.005))(STEP * np.arange(500))[:, 0]
    cut, restored = np.flatnonzero(np.diff(np.isnan(got).astype(int))) * STEP
    longest = math.sqrt(12.0) * 0.005
    assert 0.099 <= cut <= 0.1 + longest
    assert 0.199 <= restored <= 0.2 + longest
    assert (cut, restored) != (0.099, 0.199)
    assert np.array_equal(np.unique(got[~np.isnan(got)])[[0, -1]], [0.0, 0.3])


@pytest.mark.parametrize("effect", [rounded, jitter])
def test_none_of_it_changes_no_bit(problem: Problem, effect: Any) -> None:
    assert same_bits(rigs.hold(problem, 0.3, 0.2, **effect(0.0)), rigs.hold(problem, 0.3, 0.2))


# --- no power -----------------------------------------------------------------------------------

EVERY: Effects = {
    "servo_resolution": {"step_rad": 0.01},
    "command_jitter": {"sd_s": 0.003},
    "servo_travel": {"gain": 0.9},
    "servo_trim": {"offset_rad": 0.02},
    "servo_speed_limit": {"limit_rad_s": 5.0},
    "command_latency": {"delay_s": 0.0123},
    "channel_timing": {"delay_s": 0.0047, "target": "turn"},
    "servo_lag": {"time_constant_s": 0.03},
}


@pytest.mark.parametrize("name", EVERY)
def test_unpowered_stays_unpowered_and_does_not_spread(problem: Problem, name: str) -> None:
    """As long as before, though it may begin late."""

    def sent(time: Array) -> Array:
        off = (time > 0.0995) & (time < 0.1995)
        turn = np.where(off, math.nan, 0.3 * (time > 0.0495))
        return np.stack([turn, 0.3 * (time > 0.0495)], axis=1)

    got = arriving(problem, sent, {name: EVERY[name]})(STEP * np.arange(500))
    late = name in ("command_jitter", "command_latency", "channel_timing")
    off = np.isnan(got[:, 0])
    assert (np.diff(off.astype(int)) != 0).sum() == 2
    assert not np.isnan(got[:, 1]).any()
    if late:
        assert off.sum() == pytest.approx(100, abs=12)
    else:
        assert np.array_equal(off, np.isnan(sent(STEP * np.arange(500))[:, 0]))
    assert got[-1, 0] == pytest.approx(got[-1, 1], abs=1e-4), "it goes on as if nothing had been"


def test_a_part_of_a_step_never_makes_or_hides_no_power() -> None:
    before, after = np.array([0.0, math.nan, 0.0, math.nan]), np.array([1.0, 1.0, math.nan, math.nan])
    assert timing.partly(before, after, 0.25, 0.5) == pytest.approx(
        [0.125, 1.0, math.nan, math.nan], nan_ok=True
    )
