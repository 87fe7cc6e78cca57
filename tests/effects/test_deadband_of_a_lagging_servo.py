"""A dead band counts the error that the servo itself sees, through its own lag."""

import numpy as np
import pytest

from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.problem import load_problem
from gaitopt.simulation.rollout import Simulator


@pytest.mark.parametrize("lag", [0.1, 0.03])
def test_a_dead_band_of_no_width_changes_nothing(lag: float) -> None:
    problem = load_problem("servo-bench")
    log = LoggedCommands.of(("servo",), np.array([0.0, 0.3]), np.array([[0.4], [-0.2]]))
    drive = log.recorded(0.8, 0.02, {"arm": 0.0})
    lagging = {"servo_lag": {"time_constant_s": lag}}
    banded = lagging | {"servo_deadband": {"half_width_rad": 1e-9}}
    one, other = (
        Simulator.build(problem.with_effects(effects)).run(drive, duration=0.8)["joint.arm"]
        for effects in (lagging, banded)
    )
    np.testing.assert_allclose(one, other, atol=1e-7)
