"""Dry friction of servos: what it holds, what it takes from motion, and that its parts add up."""

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rigs
from helpers import same_bits

from gaitopt.effects import EFFECTS
from gaitopt.effects.library.servo_friction import STRIBECK_RAD_S
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.model import nominal_parts
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

INERTIA = 1e-3
TORQUE = 0.1
"""Torque of a saturated servo, N m."""

Effects = dict[str, dict[str, Any]]


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> rigs.Make:
    """Makes two wheels on two servos that saturate at `limit`."""
    numbers = itertools.count()

    def make(limit: float = TORQUE, inertia: float = INERTIA, load: float = 0.0, joint: str = "") -> Problem:
        folder: Path = tmp_path_factory.mktemp("twins") / str(next(numbers))
        mjcf = rigs.twins(inertia, load, joint, f'kp="20" forcerange="-{limit} {limit}"')
        return rigs.build(folder, mjcf, {"marker": "wheel"}, servos=rigs.TWO)

    return make


def friction(torque: float, target: str = "turn") -> Effects:
    return {"servo_friction": {"torque_n_m": torque, "target": target}}


def load_friction(share: float, target: str = "turn") -> Effects:
    return {"servo_friction_load": {"share": share, "target": target}}


def stiction(torque: float, target: str = "turn") -> Effects:
    return {"servo_stiction": {"torque_n_m": torque, "target": target}}


def pushed(problem: Problem, effects: Effects, seconds: float = 0.3, sign: float = 1.0) -> Trajectory:
    """What a servo does that pushes with all its torque."""
    return rigs.hold(problem, sign * 1e3, seconds, **effects)


def break_away(problem: Problem, effects: Effects, slope: float) -> float:
    """The torque at which a servo begins to move, whose command moves slowly, rad/s: some ms too late."""
    simulator = Simulator.build(problem.with_effects(effects))
    time = simulator.clock(0.6)
    path = simulator.play(time, np.tile(slope * time[:, None], 2))
    return float(path["torque.turn"][np.argmax(abs(path["rate.turn"]) > 1e-3)])


def acceleration(path: Trajectory, begin: float = 0.2) -> float:
    late = path.time >= begin
    return float(np.polyfit(path.time[late], path["rate.turn"][late], 1)[0])


# --- constant -----------------------------------------------------------------------------------


@pytest.mark.parametrize("inertia", [1e-5, 1e-3, 0.05])
@pytest.mark.parametrize("effect", [friction, stiction])
def test_friction_holds_half_its_torque_without_creep(twins: rigs.Make, inertia: float, effect: Any) -> None:
    path = pushed(twins(0.5 * TORQUE, inertia), effect(TORQUE))
    assert abs(path["rate.turn"]).max() < 1e-3
    assert abs(path["torque.turn"][-1]) == pytest.approx(0.5 * TORQUE)
    assert path["rate.other"][-1] == pytest.approx(0.5 * TORQUE / inertia * 0.3, rel=1e-2)


@pytest.mark.parametrize("inertia", [1e-5, 1e-3, 0.05])
def test_friction_takes_its_torque_from_motion(twins: rigs.Make, inertia: float) -> None:
    path = pushed(twins(inertia=inertia), friction(0.3 * TORQUE), 0.1)
    assert acceleration(path, 0.01) == pytest.approx(0.7 * TORQUE / inertia, rel=1e-3)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_servo_breaks_away_above_its_friction_alone(twins: rigs.Make, sign: float) -> None:
    for torque, moves in ((1.01, False), (0.99, True)):
        path = pushed(twins(), friction(torque * TORQUE), sign=sign)
        assert (sign * path["joint.wheel"][-1] > 1e-3) == moves


def test_friction_brakes_an_unpowered_servo_at_a_constant_rate(twins: rigs.Make) -> None:
    """It turns freely when its power is cut at 0.05 s."""
    log = LoggedCommands.of(rigs.TWO, [0.0, 0.05], [[1.5, 0.0], [math.nan, 0.0]])
    path = Simulator.build(twins().with_effects(friction(0.02))).run(log, duration=0.12)
    late = path.time >= 0.0505
    rate = np.polyfit(path.time[late], path["rate.turn"][late], 1)[0]
    assert rate == pytest.approx(-0.02 / INERTIA, rel=1e-3)


def test_a_friction_is_the_total_and_unequal_ones_keep_their_proportion(tmp_path: Path) -> None:
    mjcf = rigs.twins(joint='frictionloss="0.04"').replace("0.04", "0.01", 1)
    problem = rigs.build(tmp_path / "unequal", mjcf, {"marker": "wheel"}, servos=rigs.TWO)
    assert EFFECTS["servo_friction"].neutral_value(nominal_parts(problem)) == 0.04
    doubled = Simulator.build(problem.with_effects(friction(0.08, "all"))).models[0]
    assert doubled.dof_frictionloss == pytest.approx([0.02, 0.08])
    one = Simulator.build(problem.with_effects(friction(0.03))).models[0]
    assert one.dof_frictionloss == pytest.approx([0.03, 0.04])
    none = Simulator.build(problem.with_effects(friction(0.0, "all"))).models[0]
    assert not none.dof_frictionloss.any()


def test_friction_is_the_servo_s_side_of_free_play(tmp_path: Path) -> None:
    """A hanging link swings within the play while its servo sticks."""
    mjcf = rigs.twins(joint='frictionloss="0.04"')
    problem = rigs.build(tmp_path / "loose", mjcf, {"marker": "wheel"}, servos=rigs.TWO)
    play: Effects = {"servo_backlash": {"half_width_rad": 0.02, "target": "turn"}}
    model = Simulator.build(problem.with_effects(play | friction(0.07))).models[0]
    friction_of = {model.joint(i).name: model.joint(i).frictionloss[0] for i in range(model.njnt)}
    assert friction_of == {"wheel": 0.0, "idler": 0.04, "gaitopt:rotor:wheel": pytest.approx(0.07)}


# --- in proportion to the torque ----------------------------------------------------------------


def test_friction_of_the_gear_takes_its_share_of_the_torque(twins: rigs.Make) -> None:
    for limit in (0.1, 0.4):
        path = pushed(twins(limit), load_friction(0.3), 0.1)
        assert acceleration(path, 0.01) == pytest.approx(0.7 * limit / INERTIA, rel=1e-6)


def test_a_gear_holds_more_than_its_servo_lifts(twins: rigs.Make) -> None:
    """Against a weight G, a torque T lifts if T (1 - s) > G, and lowers if T (1 + s) < G."""
    problem = twins(0.5, load=0.1, joint='damping="0.2"')
    assert break_away(problem, load_friction(0.4), +0.01) == pytest.approx(0.1 / 0.6, rel=0.02)
    assert break_away(problem, load_friction(0.4), -0.01) == pytest.approx(0.1 / 1.4, rel=0.02)


def test_an_unpowered_servo_transmits_nothing_and_turns_freely(twins: rigs.Make) -> None:
    log = LoggedCommands.of(rigs.TWO, [0.0], [[math.nan, math.nan]]).recorded(0.1, 0.02, {"wheel": 0.0})
    problem = twins(load=0.01).with_effects(load_friction(0.8))
    free = Simulator.build(problem).run(log, duration=0.1)
    assert free["joint.wheel"][-1] == pytest.approx(-0.5 * 0.01 / INERTIA * 0.1**2, rel=0.02)


@pytest.mark.parametrize("row", [100, 101])
def test_friction_of_the_gear_acts_from_the_step_in_which_a_command_jumps(twins: rigs.Make, row: int) -> None:
    """A standing wheel gets less speed in that step, too; without a jump it would be free for a loop."""
    simulator = Simulator.build(twins().with_effects(load_friction(0.3)))
    time = simulator.clock(0.12)
    path = simulator.play(time, np.where(np.arange(len(time)) >= row, 1e3, 0.0)[:, None] * [1.0, 0.0])
    speeds = path["rate.turn"][row : row + 6]
    assert speeds == pytest.approx(0.7 * TORQUE / INERTIA * 1e-3 * np.arange(6), rel=1e-6)


def test_friction_of_the_gear_is_gone_with_the_power(twins: rigs.Make) -> None:
    """A weight that the gear held falls freely from the first step, whether the loop runs then or not."""
    for row in (50, 51):
        log = LoggedCommands.of(rigs.TWO, [0.0, 1e-3 * row], [[0.0, 0.0], [math.nan, 0.0]])
        problem = twins(load=0.02).with_effects(load_friction(0.5))
        path = Simulator.build(problem).run(log.recorded(0.1, 0.02, {"wheel": 0.0}), duration=0.1)
        assert path["rate.turn"][row : row + 6] == pytest.approx(
            -0.02 / INERTIA * 1e-3 * np.arange(6), rel=1e-3, abs=1e-5
        )


# --- near standstill ----------------------------------------------------------------------------


def test_stiction_holds_a_servo_until_it_breaks_away_and_not_in_motion(twins: rigs.Make) -> None:
    for torque, moves in ((1.01, False), (0.98, True)):
        path = pushed(twins(), stiction(torque * TORQUE))
        assert (path["joint.wheel"][-1] > 1e-3) == moves
    assert acceleration(path) == pytest.approx(TORQUE / INERTIA, rel=1e-6)


def test_stiction_falls_with_the_square_of_the_speed(twins: rigs.Make) -> None:
    """A heavy wheel that is braked from 0.15 rad/s by stiction alone."""
    log = LoggedCommands.of(rigs.TWO, [0.0, 0.1], [[1.5, 0.0], [math.nan, 0.0]])
    problem = twins(limit=0.3, inertia=0.2, joint='damping="0"')
    path = Simulator.build(problem.with_effects(stiction(0.1))).run(log, duration=0.3)
    rate = path["rate.turn"]
    braking = -np.diff(rate[110:]) / 1e-3 * 0.2
    expected = 0.1 * np.exp(-((0.5 * (rate[110:-1] + rate[111:]) / STRIBECK_RAD_S) ** 2))
    moving = rate[110:-1] > 0.02
    assert rate[110] > 0.1
    assert braking[moving] == pytest.approx(expected[moving], rel=0.02)


def test_a_slow_ramp_sticks_and_slips_with_stiction_only(twins: rigs.Make) -> None:
    problem = twins(limit=0.5, joint='damping="0.01"')
    ratios = {}
    for name, effects in {"friction": friction(0.05), "stiction": friction(0.02) | stiction(0.2)}.items():
        simulator = Simulator.build(problem.with_effects(effects))
        time = simulator.clock(1.0)
        ramp = simulator.play(time, np.tile(0.05 * time[:, None], 2))
        late = ramp.time > 0.5
        ratios[name] = float(np.mean(np.abs(ramp["rate.turn"][late]) < 1e-3))
    assert ratios["stiction"] > 0.5, "it stands for most of the time"
    assert ratios["friction"] < 0.1


# --- together -----------------------------------------------------------------------------------


def test_the_three_kinds_of_friction_add_up(twins: rigs.Make) -> None:
    """With f = 0.02, s = 0.2 and c = 0.03 N m, a servo breaks away above 0.05 / 0.8 N m."""
    effects = friction(0.02) | load_friction(0.2) | stiction(0.03)
    assert break_away(twins(), effects, 0.01) == pytest.approx(0.05 / 0.8, rel=0.02)
    path = pushed(twins(0.2), effects)
    assert acceleration(path) == pytest.approx((0.2 * 0.8 - 0.02) / INERTIA, rel=1e-6)
    assert path["rate.other"][-1] == pytest.approx(0.2 / INERTIA * 0.3, rel=1e-2)


def test_each_kind_of_friction_may_act_on_another_servo(twins: rigs.Make) -> None:
    effects = friction(0.02, "other") | load_friction(0.3) | stiction(0.15, "other")
    path = pushed(twins(), effects)
    assert acceleration(path) == pytest.approx(0.7 * TORQUE / INERTIA, rel=1e-6)
    assert path["joint.idler"][-1] < 1e-3
    assert same_bits(pushed(twins(), effects), path), "nothing is left of the run before"


@pytest.mark.parametrize("effect", [friction, load_friction, stiction])
def test_no_friction_changes_no_bit(twins: rigs.Make, effect: Any) -> None:
    problem = twins(load=0.02)
    assert same_bits(pushed(problem, effect(0.0)), pushed(problem, {}))


@pytest.mark.parametrize(
    ("effect", "most"), [(friction(0.03), 1e-3), (load_friction(0.3), 2e-3), (stiction(0.03), 4e-3)]
)
def test_half_the_step_changes_a_motion_with_friction_little(
    twins: rigs.Make, effect: Effects, most: float
) -> None:
    """Steps of 0.3 rad to and fro, with damping and a weight."""
    problem = twins(limit=0.5, load=0.05, joint='damping="0.03"').with_effects(effect)
    paths = []
    for step_s in (1e-3, 0.5e-3):
        simulator = Simulator.build(problem, fidelity=Fidelity(timestep_s=step_s, integrator="implicitfast"))
        time = simulator.clock(2.0)
        paths.append(simulator.play(time, np.tile(0.3 * (np.sin(4.0 * time - 1e-6) > 0.0)[:, None], 2)))
    coarse, fine = (path["joint.wheel"] for path in paths)
    assert np.ptp(coarse) > 0.25
    assert np.sqrt(np.mean((fine - coarse) ** 2)) < most
