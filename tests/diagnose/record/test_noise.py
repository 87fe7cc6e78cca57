"""The noise of a series, estimated from the series itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from walks import FPS

from gaitopt.diagnose.record.noise import noise_of


@given(st.floats(1e-5, 1e-2), st.integers(0, 100))
def test_noise_is_estimated_under_motion(noise: float, seed: int) -> None:
    time = np.arange(0.0, 20.0, 1.0 / FPS)
    series = 100.0 * noise * time + noise * np.random.default_rng(seed).standard_normal(len(time))
    assert noise_of(series) == pytest.approx(noise, rel=0.25)
