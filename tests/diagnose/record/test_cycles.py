"""Series cut into cycles: travel, shape and rest."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitopt.diagnose.record.cycles import PHASES, shifted, steady


@given(st.floats(-0.5, 0.5))
def test_a_shift_is_undone_by_its_opposite(cycles: float) -> None:
    shape = np.sin(2.0 * np.pi * np.arange(PHASES) / PHASES)
    np.testing.assert_allclose(shifted(shifted(shape, cycles), -cycles), shape, atol=1e-3)


def test_steady_motion_has_no_rest() -> None:
    cycle = np.arange(5)[:, None] + np.arange(PHASES)[None, :] / PHASES
    motion = steady(0.03 * cycle + np.sin(2.0 * np.pi * cycle))
    assert motion.travel == pytest.approx(0.03)
    np.testing.assert_allclose(motion.shape, np.sin(2.0 * np.pi * cycle[0]), atol=1e-12)
    np.testing.assert_allclose(motion.rest - motion.rest.mean(), 0.0, atol=1e-12)
