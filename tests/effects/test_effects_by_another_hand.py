"""Effects do to the walking ArcFold what they do in code of another hand, which shares nothing with them."""

import math

import numpy as np
import pytest
from other_walk import ROW_S, Errors, square, walk

from gaitopt import Problem
from gaitopt.effects.active import Values
from gaitopt.problem.model import nominal_mjcf
from gaitopt.robot.signals import MARKER
from gaitopt.simulation.rollout import Simulator

GAIT, PERIOD_S, SECONDS = "square-2s", 2.0, 5.0

EFFECTS: dict[str, Values] = {
    "servo_torque_limit": {"limit_n_m": 0.08},
    "servo_travel": {"gain": 0.8},
    "servo_trim": {"offset_rad": 0.15, "target": "foot1"},
    "servo_speed_limit": {"limit_rad_s": 2.0},
    "channel_timing": {"delay_s": 0.1, "target": "mid_act"},
    "command_latency": {"delay_s": 0.1},
    "servo_damping": {"scale": 2.0},
    "servo_backlash": {"half_width_rad": 0.1, "target": "foot2"},
    "servo_friction": {"torque_n_m": 0.08},
    "servo_friction_load": {"share": 0.5},
    "servo_sag": {"share_lost": 0.6},
    "servo_deadband": {"half_width_rad": 0.08},
    "ground_slope": {"angle_rad": 0.08},
    "payload_mass": {"mass_kg": 0.05},
    "com_offset": {"offset_m": 0.015},
    "geometry_scale": {"scale": 1.1},
    "tether_drag": {"force_n": 0.15},
    "pad_friction": {"scale": 0.5},
    "body_friction": {"scale": 2.5},
    "pad_imbalance": {"ratio": 0.4},
    "contact_compliance": {"scale": 3.0},
    "friction_anisotropy": {"ratio": 0.4},
    "friction_direction": {"ratio": 0.4},
}


def way(problem: Problem, effects: dict[str, Values]) -> np.ndarray:
    """The marker's way from its start, m, by the simulator."""
    path = Simulator.build(problem.with_effects(effects)).run(problem.baselines[GAIT], 0, SECONDS)
    marker = np.stack([path[name] for name in MARKER], axis=1)
    return marker - marker[0]


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """RMS distance, m."""
    return math.sqrt(float(np.mean(np.sum((one - other) ** 2, axis=1))))


def test_the_gait_is_the_same(arcfold: Problem) -> None:
    rows = square(PERIOD_S, SECONDS)
    np.testing.assert_allclose(rows, arcfold.baselines[GAIT].targets(np.arange(len(rows)) * ROW_S))


@pytest.mark.slow
def test_the_nominal_robot_walks_alike(arcfold: Problem) -> None:
    other = walk(nominal_mjcf(arcfold), {}, Errors(), square(PERIOD_S, SECONDS)).marker
    assert apart(other - other[0], way(arcfold, {})) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_does_the_same_by_another_hand(name: str, arcfold: Problem) -> None:
    """Each moves the robot by 3 mm or more. Most agree to a tenth of that, a stick-slip effect to a third."""
    values = EFFECTS[name]
    value = next(one for one in values.values() if isinstance(one, float))
    planted = {(name, str(values.get("target", "all"))): value}
    other = walk(nominal_mjcf(arcfold), planted, Errors(), square(PERIOD_S, SECONDS)).marker
    own, nominal = way(arcfold, {name: values}), way(arcfold, {})
    assert apart(own, nominal) > 3e-3
    assert apart(other - other[0], own) < 0.4 * apart(own, nominal)
