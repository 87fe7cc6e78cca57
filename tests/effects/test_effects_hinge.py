"""Each hinge effect in a case with a known answer: two flaps on springs, left and right."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
import rigs

from gaitopt.core.errors import GaitoptError
from gaitopt.problem.problem import Problem
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

LOAD = 0.02 * 9.81 * 0.1
"""Torque of gravity on a level flap, N m."""

STIFFNESS = 0.2
ROLES = {"marker": "left", "hinges": ["left", "right"]}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> rigs.Make:
    """Makes a problem of an MJCF."""
    numbers = itertools.count()

    def make(mjcf: str, settle: bool = True, **roles: object) -> Problem:
        folder: Path = tmp_path_factory.mktemp("hinge") / str(next(numbers))
        return rigs.build(folder, mjcf, ROLES | roles, settle)

    return make


def sagged(trajectory: Trajectory, side: str = "left") -> tuple[float, float]:
    """Return by how much a flap hangs, rad, and the torque of gravity there, N m."""
    angle = float(trajectory[f"joint.{side}"][-1])
    return -angle, LOAD * math.cos(angle)


def test_a_stiffness_carries_the_load_at_its_angle(rig: rigs.Make) -> None:
    for scale in (0.5, 3.0):
        angle, torque = sagged(rigs.hold(rig(rigs.flaps()), 0.0, 2.0, hinge_stiffness={"scale": scale}))
        assert STIFFNESS * scale * angle == pytest.approx(torque, rel=1e-5)


def test_a_cubic_stiffness_adds_to_the_linear_one(rig: rigs.Make) -> None:
    for cubic in (-1.0, 20.0):
        effect = {"cubic_n_m_rad3": cubic}
        angle, torque = sagged(rigs.hold(rig(rigs.flaps()), 0.0, 3.0, hinge_nonlinearity=effect))
        assert STIFFNESS * angle + cubic * angle**3 == pytest.approx(torque, rel=1e-5)


def test_damping_sets_how_fast_a_flap_returns(rig: rigs.Make) -> None:
    """Without inertia q = q0 exp(-k t / b); the flap's time constant I / b is 1/50 of k / b and less."""
    problem = rig(rigs.flaps(gravity=0.0, damping=0.1, qpos="0.3 0.3 0"), settle=False)
    for scale in (1.0, 3.0):
        back = rigs.hold(problem, 0.0, 1.0, hinge_damping={"scale": scale})["joint.left"]
        rate = math.log(back[200] / back[800]) / 0.6
        assert rate == pytest.approx(STIFFNESS / (0.1 * scale), rel=1e-2)


def test_dry_friction_above_the_load_holds_still(rig: rigs.Make) -> None:
    problem = rig(rigs.flaps(qpos="0 0 0"), settle=False)
    held = rigs.hold(problem, 0.0, 5.0, hinge_friction={"torque_n_m": 1.5 * LOAD})["joint.left"]
    assert np.abs(held).max() < 1e-4, "it creeps by no more than 1e-5 rad/s"


def test_dry_friction_below_the_load_takes_its_share_of_it(rig: rigs.Make) -> None:
    """A flap that sinks slowly stops where spring and friction hold it."""
    problem = rig(rigs.flaps(damping=0.3, qpos="0 0 0"), settle=False)
    friction = 0.4 * LOAD
    angle, torque = sagged(rigs.hold(problem, 0.0, 12.0, hinge_friction={"torque_n_m": friction}))
    assert STIFFNESS * angle == pytest.approx(torque - friction, rel=5e-3)


def test_a_yielding_hinge_gives_way_until_it_carries_its_yield_torque(rig: rigs.Make) -> None:
    problem = rig(rigs.flaps(damping=0.02, qpos="0 0 0"), settle=False)
    limit = 0.6 * LOAD
    _, torque = sagged(rigs.hold(problem, 0.0, 20.0, hinge_hysteresis={"yield_n_m": limit}))
    assert torque == pytest.approx(limit, rel=2e-3)


def test_a_yielding_hinge_loses_the_area_of_its_loop(rig: rigs.Make) -> None:
    """An ideal elasto-plastic spring driven to +-A loses 4 T (A - T / k) per cycle."""
    driven = """
<mujoco><option gravity="0 0 0"/><worldbody><body name="left" pos="0 0 1">
<joint name="left" type="hinge" axis="0 1 0" stiffness="0.2" damping="1e-4" armature="1e-3"/>
<inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/><site name="left"/></body></worldbody>
<actuator><position name="turn" joint="left" kp="50" kv="0.5"/></actuator></mujoco>"""
    problem = rig(driven, hinges=["left"])
    simulator = Simulator.build(problem.with_effects({"hinge_hysteresis": {"yield_n_m": 0.05}}))
    time = simulator.clock(8.0)
    swung = simulator.play(time, np.sin(2.0 * np.pi * 0.25 * time)[:, None])
    cycle = slice(4000, 8001)
    angle, torque = swung["joint.left"][cycle], swung["torque.turn"][cycle]
    lost = float(np.sum(0.5 * (torque[1:] + torque[:-1]) * np.diff(angle)))
    reach = float(np.abs(angle).max())
    viscous = math.pi * 1e-4 * 2.0 * math.pi * 0.25 * reach**2
    assert lost - viscous == pytest.approx(4.0 * 0.05 * (reach - 0.05 / 0.2), rel=5e-3)


def test_asymmetry_keeps_the_mean_and_sets_the_ratio(rig: rigs.Make) -> None:
    hung = rigs.hold(rig(rigs.flaps()), 0.0, 2.0, hinge_asymmetry={"ratio": 2.0})
    left, right = (torque / angle for angle, torque in (sagged(hung, side) for side in ("left", "right")))
    assert left / right == pytest.approx(2.0, rel=1e-4)
    assert 0.5 * (left + right) == pytest.approx(STIFFNESS, rel=1e-4)


def test_left_is_left_of_forward(rig: rigs.Make) -> None:
    hung = rigs.hold(rig(rigs.flaps(), forward=[-1, 0, 0]), 0.0, 2.0, hinge_asymmetry={"ratio": 2.0})
    (left, _), (right, _) = sagged(hung, "left"), sagged(hung, "right")
    assert left > 1.5 * right, "the left flap is on the right, seen along -x, and the softer one"


def test_asymmetry_needs_hinges_on_both_sides(rig: rigs.Make) -> None:
    problem = rig(rigs.flaps(), hinges=["left"]).with_effects({"hinge_asymmetry": {"ratio": 2.0}})
    with pytest.raises(GaitoptError, match=r"hinge_asymmetry: not applicable: .* both sides"):
        Simulator.build(problem)
