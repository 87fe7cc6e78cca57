"""A servo that was learnt on one robot, in another's problem: it moves the same, and the rest stays."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import rigs

from gaitopt.core.errors import GaitoptError
from gaitopt.effects import EFFECTS
from gaitopt.effects.active import Values
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.servo_figures import FIGURES
from gaitopt.problem.servo_transfer import STAYS, Transfer, carry_over
from gaitopt.simulation.rollout import Simulator

LEARNT: Mapping[str, Values] = {
    "servo_gain": {"scale": 0.5, "target": "all"},
    "servo_torque_limit": {"limit_n_m": 0.3, "target": "all"},
    "servo_stiction": {"torque_n_m": 0.01, "target": "all"},
    "servo_lag": {"time_constant_s": 0.03, "target": "all"},
    "servo_deadband": {"half_width_rad": 0.01, "target": "all"},
    "command_latency": {"delay_s": 0.02},
}


def rig(folder: Path, joint: str, servo: str) -> Problem:
    """Two equal wheels with gravity on servos of some figures."""
    return rigs.build(folder, rigs.twins(load=0.05, joint=joint, servo=servo), {}, servos=rigs.TWO)


def moved(problem: Problem) -> np.ndarray:
    """The angle of a wheel that is turned there and back."""
    simulator = Simulator.build(problem)
    time = simulator.clock(1.2)
    targets = np.where((time > 0.1) & (time < 0.6), 0.8, 0.0)
    trajectory = simulator.play(time, np.stack([targets, 0.5 * targets], axis=-1))
    assert trajectory.status == "ok"
    return trajectory["joint.wheel"]


def figures(transfer: Transfer, channel: str) -> dict[str, tuple[float, float]]:
    """Old and new figure of a channel, by name."""
    return {row.figure: (row.old, row.new) for row in transfer.rows if row.channel == channel}


SERVOS = {
    "damped joints": ('damping="0.02" armature="1e-4"', 'kp="2" forcerange="-0.5 0.5"'),
    "other damped joints": ('damping="0.07" armature="5e-4"', 'kp="6" forcerange="-2 2"'),
    "feedback of speed": ('armature="1e-4"', 'kp="2" kv="0.03" forcerange="-0.5 0.5"'),
    "more feedback": ('armature="2e-4"', 'kp="3" kv="0.06" forcerange="-1 1"'),
    "both": ('damping="0.01" armature="1e-4"', 'kp="3" kv="0.02"'),
}


@pytest.mark.parametrize("effects", [LEARNT, LEARNT | {"servo_damping": {"scale": 1.7, "target": "all"}}])
@pytest.mark.parametrize("here", SERVOS)
@pytest.mark.parametrize("there", SERVOS)
def test_the_other_robot_moves_as_if_it_had_the_servo(
    tmp_path: Path, there: str, here: str, effects: Mapping[str, Values]
) -> None:
    bench = rig(tmp_path / "bench", *SERVOS[there]).with_effects(effects)
    problem = rig(tmp_path / "robot", *SERVOS[here])
    expected = moved(bench)
    np.testing.assert_allclose(moved(carry_over(problem, bench).problem), expected, atol=2e-6)
    if here != there:
        assert np.abs(moved(problem) - expected).max() > 0.01


@pytest.mark.parametrize("turned", [False, True])
def test_a_lag_is_the_same_in_the_mjcf_and_as_an_effect(tmp_path: Path, turned: bool) -> None:
    """The two filters differ by less than a step of 1 ms, in which the wheel turns by 0.013 rad."""
    own = rig(tmp_path / "own", 'damping="0.02" armature="1e-4"', 'kp="2" timeconst="0.04"')
    none = rig(tmp_path / "none", *SERVOS["other damped joints"])
    problem, bench = (own, none) if turned else (none, own)
    transfer = carry_over(problem, bench)
    np.testing.assert_allclose(moved(transfer.problem), moved(bench), atol=0.012)
    assert figures(transfer, "turn")["lag"] == ((0.04, 0.0) if turned else (0.0, 0.04))


@pytest.mark.parametrize("here", SERVOS)
def test_torque_that_is_lost_with_speed_is_lost_there_too(tmp_path: Path, here: str) -> None:
    lost: Mapping[str, Values] = {"servo_back_emf": {"damping_n_m_s_rad": 0.02, "target": "all"}}
    bench = rig(tmp_path / "bench", *SERVOS["feedback of speed"]).with_effects(lost)
    transfer = carry_over(rig(tmp_path / "robot", *SERVOS[here]), bench)
    np.testing.assert_allclose(moved(transfer.problem), moved(bench), atol=2e-6)
    old, new = figures(transfer, "turn")["torque lost with speed"]
    assert old in (0.0, 0.01, 0.02, 0.07)
    assert new == pytest.approx(0.02)


def test_ratios_are_converted_to_the_other_robots_gain(arcfold: Problem) -> None:
    bench = load_problem("servo-bench").with_effects({"servo_gain": {"scale": 0.6, "target": "servo"}})
    transfer = carry_over(arcfold, bench)
    assert transfer.effects["servo_gain"] == {"scale": pytest.approx(25.0 * 0.6 / 3.0), "target": "all"}
    assert figures(transfer, "foot2")["gain"] == (3.0, pytest.approx(15.0))


def test_what_was_nominal_on_the_bench_comes_too(arcfold: Problem) -> None:
    """Lag, friction, inertia, limit and feedback of speed belong to the servo, learnt or not."""
    transfer = carry_over(arcfold, load_problem("servo-bench"))
    named = figures(transfer, "mid_act")
    assert {name: new for name, (_, new) in named.items()} == {
        "gain": pytest.approx(25.0),
        "feedback of speed": 5.0,
        "torque lost with speed": 0.0,
        "torque limit": 2.7,
        "rotor inertia": 0.005,
        "dry friction": 0.1,
        "lag": 0.1,
    }
    assert transfer.parameters == {"servo_speed_feedback": 5.0, "servo_joint_damping": 0.0}
    assert not transfer.left_out


def test_what_belongs_to_the_bench_stays_there(arcfold: Problem) -> None:
    others: Mapping[str, Values] = {
        "servo_trim": {"offset_rad": 0.1, "target": "servo"},
        "payload_mass": {"mass_kg": 0.01},
        "command_latency": {"delay_s": 0.05},
    }
    transfer = carry_over(arcfold, load_problem("servo-bench").with_effects(others))
    assert {one.what: one.reason for one in transfer.left_out} == {
        "servo_trim": "mounting: how the horn sits on its spline",
        "payload_mass": "not of a servo",
    }
    assert "servo_trim" not in transfer.problem.file.effects
    assert transfer.effects["command_latency"] == {"delay_s": 0.05}


def test_every_effect_of_servos_and_commands_is_carried_or_stays() -> None:
    carried = {term.effect for figure in FIGURES for term in figure.terms}
    known = {name for name in EFFECTS if name.startswith(("servo_", "command_", "channel_"))}
    assert carried | set(STAYS) == known
    assert not carried & set(STAYS)


def test_one_channel_alone_may_have_the_servo(arcfold: Problem) -> None:
    bench = load_problem("servo-bench").with_effects({"command_latency": {"delay_s": 0.05}})
    transfer = carry_over(arcfold, bench, {"foot1": "servo"})
    assert {row.channel for row in transfer.rows} == {"foot1"}
    assert {values["target"] for values in transfer.effects.values()} == {"foot1"}
    assert [one.what for one in transfer.left_out] == ["latency"]


def test_channels_of_the_same_names_are_the_same_servos(arcfold: Problem) -> None:
    """What was learnt of a robot in the hand goes into the robot that walks."""
    weak: Mapping[str, Values] = {"servo_torque_limit": {"limit_n_m": 0.1, "target": "foot2"}}
    transfer = carry_over(arcfold, arcfold.with_effects(weak))
    assert transfer.effects == weak
    assert figures(transfer, "foot2")["torque limit"] == (0.245, 0.1)
    assert figures(transfer, "foot1")["torque limit"] == (0.245, 0.245)


def test_effects_that_the_problem_had_are_replaced(arcfold: Problem) -> None:
    had: Mapping[str, Values] = {
        "servo_gain": {"scale": 3.0, "target": "all"},
        "servo_deadband": {"half_width_rad": 0.02, "target": "foot1"},
        "ground_slope": {"angle_rad": 0.05},
    }
    transfer = carry_over(arcfold.with_effects(had), load_problem("servo-bench"))
    effects = transfer.problem.file.effects
    assert effects["servo_gain"]["scale"] == pytest.approx(25.0 / 3.0)
    assert "servo_deadband" not in effects
    assert effects["ground_slope"] == {"angle_rad": 0.05}
    assert figures(transfer, "foot1")["dead band"] == (0.02, 0.0)


def test_a_servo_is_carried_over_once(arcfold: Problem) -> None:
    bench = load_problem("servo-bench")
    once = carry_over(arcfold, bench).problem
    with pytest.raises(GaitoptError, match="found no servo that differs"):
        carry_over(once, bench)
    stronger = bench.with_effects({"servo_torque_limit": {"limit_n_m": 3.0, "target": "all"}})
    assert carry_over(once, stronger).effects == {"servo_torque_limit": {"limit_n_m": 3.0, "target": "all"}}


def test_a_limit_that_cannot_be_lifted_is_said(tmp_path: Path, arcfold: Problem) -> None:
    bench = rig(tmp_path / "bench", 'armature="1e-4"', 'kp="2"')
    transfer = carry_over(arcfold, bench, dict.fromkeys(arcfold.channel_names, "turn"))
    (left,) = transfer.left_out
    assert left.what == "torque limit"
    assert left.reason.startswith("servo_torque_limit cannot be inf")
    assert figures(transfer, "foot1")["torque limit"] == (0.245, 0.245)


def several(arcfold: Problem) -> Problem:
    """The robot with one servo of another strength."""
    return arcfold.with_effects({"servo_gain": {"scale": 2.0, "target": "foot1"}})


@pytest.mark.parametrize(
    ("channels", "said"),
    [
        ({"foot": "servo"}, r"--channel: .*unknown channel 'foot'; known: mid_act, foot1, foot2 \(nearest"),
        ({"foot1": "arm"}, "--channel: .*unknown channel 'arm'; known: servo"),
        ({"foot1": "servo", "foot2": "servo"}, "effects.servo_gain: found 2 of 3 channels that need it"),
        ({"foot2": "servo"}, "effects.servo_gain: found one for foot1 already; allowed: none for channels"),
    ],
)
def test_what_a_problem_file_cannot_hold_is_one_line(
    arcfold: Problem, channels: dict[str, str], said: str
) -> None:
    problem = several(arcfold) if len(channels) == 1 else arcfold
    with pytest.raises(GaitoptError, match=said):
        carry_over(problem, load_problem("servo-bench"), channels)


def test_which_of_several_servos_is_meant_has_to_be_said(arcfold: Problem) -> None:
    said = "found channels mid_act, foot1, foot2; allowed: say which is whose servo, --channel servo=mid_act"
    with pytest.raises(GaitoptError, match=said):
        carry_over(load_problem("servo-bench"), arcfold)
    assert carry_over(load_problem("servo-bench"), arcfold, {"servo": "foot1"}).effects


def test_servos_with_different_gains_need_different_values(tmp_path: Path, arcfold: Problem) -> None:
    uneven = rig(tmp_path / "robot", *SERVOS["damped joints"])
    text = uneven.model_path.read_text()
    uneven.model_path.write_text(text.replace('"idler" kp="2"', '"idler" kp="4"'))
    with pytest.raises(
        GaitoptError, match=r"servo_gain: found channels that need different values .* 25, 25"
    ):
        carry_over(uneven, load_problem("servo-bench"))


def test_a_gear_is_one_line(tmp_path: Path) -> None:
    geared = rig(tmp_path / "robot", "", 'kp="2" gear="2"')
    with pytest.raises(GaitoptError, match="actuator turn: found a gear of 2; allowed: 1"):
        carry_over(geared, load_problem("servo-bench"))
