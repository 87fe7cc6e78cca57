"""The lag of a servo behind its command: its exponential response, by both mechanisms."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
import rigs
from helpers import same_bits
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.effects import EFFECTS
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.model import nominal_parts
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

LAG = EFFECTS["servo_lag"]
DAMPED = 'damping="0.02"'
FILTERED = 'kp="2" forcerange="-5 5" timeconst="0.05"'
PLAIN = 'kp="2" forcerange="-5 5"'


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> rigs.Make:
    """Makes two wheels on two servos."""
    numbers = itertools.count()

    def make(servo: str = PLAIN, joint: str = DAMPED) -> Problem:
        folder: Path = tmp_path_factory.mktemp("twins") / str(next(numbers))
        mjcf = rigs.twins(joint=joint, servo=servo)
        return rigs.build(folder, mjcf, {"marker": "wheel"}, servos=rigs.TWO)

    return make


def lagging(problem: Problem, time_constant: float, target: str = "turn", step_s: float = 1e-3) -> Simulator:
    effects = {"servo_lag": {"time_constant_s": time_constant, "target": target}}
    return Simulator.build(
        problem.with_effects(effects), fidelity=Fidelity(timestep_s=step_s, integrator="implicitfast")
    )


def jump(simulator: Simulator, seconds: float = 0.4) -> Trajectory:
    """The response of both servos to a jump of 0.5 rad at 0.05 s."""
    time = simulator.clock(seconds)
    return simulator.play(time, np.tile(0.5 * (time > 0.0495)[:, None], 2))


def test_a_jump_is_followed_exponentially(twins: rigs.Make) -> None:
    """Each step gets the mean of 1 - exp(-t / T) over it."""
    for step_s, lag in ((1e-3, 0.08), (2e-3, 0.08), (1e-3, 0.0004)):
        simulator = lagging(twins(), lag, step_s=step_s)
        sent = simulator.effects.commands(
            lambda t: np.tile((t > -1e-9)[:, None] * 1.0, 2), simulator.models[0]
        )
        begin = step_s * np.arange(100)
        arriving = sent(begin)
        mean = 1.0 - lag / step_s * (np.exp(-begin / lag) - np.exp(-(begin + step_s) / lag))
        assert arriving[:, 0] == pytest.approx(mean, abs=1e-12)
        assert np.array_equal(arriving[:, 1], np.ones(100)), "the other servo has no lag"


def test_a_servo_lags_alike_by_its_command_and_by_mujoco_s_filter(twins: rigs.Make) -> None:
    """They differ by half a step: MuJoCo's filter gives the angle at the end of a step, not its mean."""
    for lag in (0.02, 0.12):
        by_command, by_filter = jump(lagging(twins(), lag)), jump(lagging(twins(FILTERED), lag))
        angles = by_command["joint.wheel"]
        later = np.interp(by_command.time - 0.5e-3, by_filter.time, by_filter["joint.wheel"])
        assert later == pytest.approx(angles, abs=2e-4)
        assert np.ptp(angles) > 0.4
        assert not np.allclose(angles, by_command["joint.idler"], atol=1e-2)


def test_a_filter_without_time_constant_does_not_lag(twins: rigs.Make) -> None:
    none = jump(lagging(twins(FILTERED), 0.0, "all"))
    plain = jump(Simulator.build(twins()))
    for joint in ("joint.wheel", "joint.idler"):
        assert none[joint] == pytest.approx(plain[joint], abs=1e-12)


def test_the_neutral_lag_is_that_of_the_nominal_servo(twins: rigs.Make) -> None:
    for servo, nominal in ((PLAIN, 0.0), (FILTERED, 0.05)):
        problem = twins(servo)
        assert LAG.neutral_value(nominal_parts(problem)) == nominal
        simulator = lagging(problem, nominal, "all")
        assert not simulator.effects.active
        assert same_bits(jump(simulator), jump(Simulator.build(problem)))


def test_filters_of_different_lag_keep_their_proportion(twins: rigs.Make, tmp_path: Path) -> None:
    mjcf = rigs.twins(joint=DAMPED, servo=FILTERED).replace("0.05", "0.02", 1)
    problem = rigs.build(tmp_path / "unequal", mjcf, {"marker": "wheel"}, servos=rigs.TWO)
    model = lagging(problem, 0.1, "all").models[0]
    assert model.actuator_dynprm[:, 0] == pytest.approx([0.04, 0.1])


def test_half_the_step_changes_a_lagging_motion_little(twins: rigs.Make) -> None:
    for servo in (PLAIN, FILTERED):
        coarse, fine = (jump(lagging(twins(servo), 0.05, step_s=step)) for step in (1e-3, 0.5e-3))
        assert fine["joint.wheel"] == pytest.approx(coarse["joint.wheel"], abs=4e-3)


@pytest.mark.parametrize("servo", [PLAIN, FILTERED])
def test_the_lagging_angle_stays_while_the_servo_is_unpowered(twins: rigs.Make, servo: str) -> None:
    off = math.nan
    rows = [[0.5, 0.5], [off, 0.5], [0.5, 0.5]]
    log = LoggedCommands.of(rigs.TWO, [0.0, 0.03, 0.3], rows).recorded(0.6, 0.02, {"wheel": 0.0})
    simulator = lagging(twins(servo, 'damping="0.2"'), 0.06)
    path = simulator.run(log)
    assert not path["torque.turn"][31:300].any()
    kp, lagged = 2.0, 0.5 * (1.0 - math.exp(-0.03 / 0.06))
    restored = path["torque.turn"][301] / kp + path["position.turn"][301]
    assert restored == pytest.approx(lagged, abs=0.01), "it goes on where it was"
    assert path["joint.idler"] == pytest.approx(Simulator.build(simulator.problem).run(log)["joint.idler"])


def test_a_servo_that_gets_power_later_starts_at_its_first_command(twins: rigs.Make) -> None:
    simulator = lagging(twins(), 0.05)

    def begun(time: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where((time < 0.0095)[:, None], math.nan, 0.3)

    arriving = simulator.effects.commands(lambda t: np.tile(begun(t), 2), simulator.models[0])
    angles = arriving(1e-3 * np.arange(20))[:, 0]
    assert np.isnan(angles[:10]).all()
    assert np.array_equal(angles[10:], np.full(10, 0.3))


def test_another_kind_of_dynamics_has_no_such_lag(twins: rigs.Make, tmp_path: Path) -> None:
    mjcf = rigs.twins().replace("position", "general").replace(
        'kp="2"', 'dyntype="integrator" gainprm="2" biastype="affine" biasprm="0 -2"'
    )  # fmt: skip
    problem = rigs.build(tmp_path / "integrators", mjcf, {"marker": "wheel"}, servos=rigs.TWO)
    with pytest.raises(GaitoptError, match=r"servo_lag: not applicable: .* other than a first-order lag"):
        lagging(problem, 0.05)
