"""The floor: measured on trials whose noise, start pose and repeats are known."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.gap.floor import Floor, marker_floor

Diagnosed = Callable[..., Diagnosis]


def test_repeats_of_a_gait_measure_its_floor(diagnosed: Diagnosed) -> None:
    diagnosis = diagnosed(repeats=2)
    for trial in diagnosis.trials:
        floor = trial.floors["marker.x"]
        # Repeats of one rollout differ by the camera's noise alone.
        assert floor.repeats == pytest.approx(5e-4, rel=0.4)
    assert all(floor.repeats is None for trial in diagnosed().trials for floor in trial.floors.values())


def test_the_floor_sees_noise_and_start_pose(diagnosed: Diagnosed) -> None:
    for trial in diagnosed().trials:
        floor = trial.floors["marker.x"]
        assert floor.noise == pytest.approx(5e-4, rel=0.5)
        assert floor.spread is not None
        assert floor.spread >= 0.5 * floor.noise
        assert floor.start_pose > 0.0
        assert floor.numerics > 0.0
        assert marker_floor(trial.floors) > floor.total


def test_floors_add_in_squares() -> None:
    assert Floor(1.0, 2.0, 3.0, 4.0).total == pytest.approx(math.sqrt(4.0 + 9.0 + 16.0))
    assert Floor(1.0, 2.0, 3.0, 4.0, repeats=5.0).total == pytest.approx(math.sqrt(25.0 + 16.0))
