"""Effects do to the walking ArcFold what they do in code of another hand, which shares nothing with them."""

import numpy as np
import pytest
from other_walk import ROW_S, apart, square
from two_hands import GAIT, PERIOD_S, SECONDS, SIZES, by_another_hand, by_simulator

from gaitopt import Problem

FAINT = {
    "servo_lag",
    "servo_gain",
    "servo_inertia",
    "servo_stiction",
    "servo_resolution",
    "hinge_stiffness",
    "hinge_nonlinearity",
    "hinge_damping",
    "hinge_friction",
    "link_inertia",
    "friction_load",
}
"""Effects that move this gait by less than 3 mm."""


def test_the_gait_is_the_same(arcfold: Problem) -> None:
    rows = square(PERIOD_S, SECONDS)
    np.testing.assert_allclose(rows, arcfold.baselines[GAIT].targets(np.arange(len(rows)) * ROW_S))


@pytest.mark.slow
def test_the_nominal_robot_walks_alike(arcfold: Problem) -> None:
    assert apart(by_another_hand(arcfold), by_simulator(arcfold)) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SIZES if name not in FAINT])
def test_an_effect_does_the_same_by_another_hand(name: str, arcfold: Problem) -> None:
    """Each moves the robot by 3 mm or more. Most agree to a tenth of that, a stick-slip effect to a third."""
    own, nominal = by_simulator(arcfold, name), by_simulator(arcfold)
    assert apart(own, nominal) > 3e-3
    assert apart(by_another_hand(arcfold, name), own) < 0.4 * apart(own, nominal)
