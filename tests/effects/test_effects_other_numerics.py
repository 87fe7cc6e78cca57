"""Servo effects mean the same to a simulator that has neither MuJoCo nor effects.

What is left is MuJoCo's dry friction, which is soft where a motion turns: 2e-3 rad after a drop. Dead band
and free play are left out until they agree.
"""

from __future__ import annotations

import numpy as np
import pytest
from other_servo import ROW_S, STEP_S, Log, Servo, angles, planted

from gaitopt.effects import EFFECTS
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.rollout import Simulator

REST = np.zeros(10)
LOGS = {
    "step up": Log(np.concatenate([REST, np.full(30, 1.5)])),
    "step down": Log(np.concatenate([REST, np.full(30, -1.7)])),
    "small steps": Log(np.concatenate([REST, np.repeat([0.1, -0.1, 0.1], 12)])),
    "ramp": Log(np.concatenate([REST, np.linspace(0.0, -0.8, 60)])),
    "drop": Log(np.concatenate([np.full(10, -0.9), np.full(40, np.nan)]), held=-0.9, start=-0.9),
}
VALUES = {
    "servo_torque_limit": 1.4,
    "servo_speed_limit": 3.0,
    "servo_gain": 0.6,
    "servo_damping": 0.5,
    "servo_inertia": 0.015,
    "servo_travel": 0.9,
    "servo_trim": 0.05,
    "servo_friction": 0.3,
    "servo_friction_load": 0.2,
    "servo_stiction": 0.3,
    "servo_lag": 0.05,
    "servo_resolution": 0.03,
    "servo_back_emf": 0.3,
    "command_latency": 0.033,
    "ground_slope": 0.08,
}

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def bench() -> Problem:
    """The bundled bench, with short steps."""
    problem = load_problem("servo-bench")
    fidelity = problem.simulation.working.model_copy(update={"timestep_s": 2e-4})
    simulation = problem.simulation.model_copy(update={"working": fidelity})
    return problem._with(problem.file.model_copy(update={"simulation": simulation}))


def difference(problem: Problem, servo: Servo) -> dict[str, float]:
    """Return the largest difference of the angle in each log, rad."""
    found = {}
    simulator = Simulator.build(problem)
    for (name, log), angle in zip(
        LOGS.items(), angles([servo] * len(LOGS), list(LOGS.values())), strict=True
    ):
        time = ROW_S * np.arange(len(log.rows))
        drive = LoggedCommands.of(["servo"], time, log.rows[:, None], name)
        path = simulator.run(drive.recorded(time[-1] + ROW_S, ROW_S, {"arm": angle[0]}))
        found[name] = float(np.abs(np.interp(time, path.time, path["joint.arm"]) - angle).max())
    return found


def test_other_numerics_converge() -> None:
    logs = list(LOGS.values())
    usual, half = (angles([Servo()] * len(logs), logs, step) for step in (STEP_S, STEP_S / 2.0))
    assert max(np.abs(a - b).max() for a, b in zip(usual, half, strict=True)) < 2e-4


def test_the_nominal_bench_moves_the_same(bench: Problem) -> None:
    assert max(difference(bench, Servo()).values()) < 2.5e-3


@pytest.mark.parametrize("name", VALUES)
def test_an_effect_moves_the_bench_the_same(bench: Problem, name: str) -> None:
    with_effect = bench.with_effects({name: {EFFECTS[name].parameter: VALUES[name]}})
    assert max(difference(with_effect, planted(Servo(), {name: VALUES[name]})).values()) < 3e-3
