"""The speed that films show, and how repeatable it is."""

import numpy as np
import pytest

from gaitopt.campaign.speeds import FilmedSpeed, Measured, confirmed, filmed_drifts, filmed_speed
from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.gait import Channel, Gait
from gaitopt.robot.roles import Roles

GAIT = Gait(0.5, {"leg": Channel(duty=0.5, phase=0.0, amplitude_deg=10.0)})


def film(speed: float, seconds: float = 4.25, slow_s: float = 0.0, noise: float = 0.0) -> Trial:
    """A robot that walks forward in strokes, after some time at rest."""
    time = np.arange(0.0, seconds, 0.02)
    walked = np.maximum(time - slow_s, 0.0)
    strokes = 0.003 * np.sin(2.0 * np.pi * time / 0.5)
    rng = np.random.default_rng(1)
    marker = 1.0 + speed * walked + strokes + noise * rng.standard_normal(len(time))
    return Trial.of("film", GAIT, time, {"marker.x": marker})


def test_strokes_do_not_count() -> None:
    shown = filmed_speed(film(0.04), Roles(marker="nose"))
    assert shown.mean_m_s == pytest.approx(0.04, rel=1e-6)
    assert shown.cycles == 7


def test_the_first_cycle_does_not_count() -> None:
    assert filmed_speed(film(0.04, slow_s=0.4), Roles(marker="nose")).mean_m_s == pytest.approx(0.04)


def test_noise_shows_as_spread() -> None:
    shown = filmed_speed(film(0.04, noise=5e-4), Roles(marker="nose"))
    assert abs(shown.mean_m_s - 0.04) < 5.0 * shown.error_m_s
    assert 0.0 < shown.error_m_s < 2e-3


def test_forward_is_the_direction_of_the_problem() -> None:
    with pytest.raises(GaitoptError, match=r"no marker\.y"):
        filmed_speed(film(0.04), Roles(marker="nose", forward=(0.0, 1.0, 0.0)))


def one(speed: float) -> FilmedSpeed:
    return FilmedSpeed(speed, 1e-3, 5)


def test_repeats_show_the_repeatability() -> None:
    alone = Measured.of([(1, one(0.04))], 0.0)
    assert alone.repeatability_m_s == pytest.approx(1e-3)
    wide = Measured.of([(1, one(0.04)), (1, one(0.06)), (2, one(0.02))], 0.0)
    assert wide.means == {1: pytest.approx(0.05), 2: pytest.approx(0.02)}
    assert wide.repeatability_m_s == pytest.approx(np.sqrt((1e-6 + 2e-4) / 2.0))
    assert Measured.of([(1, one(0.5))], 0.01).repeatability_m_s == pytest.approx(0.005)


def test_a_speed_that_fits_nothing_counts_once_it_is_confirmed() -> None:
    films = [(1, "a", one(0.04)), (2, "b", one(0.01)), (2, "c", one(0.05))]
    assert [number for number, _ in confirmed(films, ["b"], 0.15)] == [1, 2]
    films.append((2, "d", one(0.0105)))
    assert len(confirmed(films, ["b", "d"], 0.15)) == 4


def test_a_drift_is_sideways_over_forward_travel_and_unknown_without_its_signal() -> None:
    straight = film(0.04)
    right = Trial.of("right", GAIT, straight.time, {**straight.signals, "marker.y": -0.008 * straight.time})
    roles, forward = Roles(marker="nose"), {1: 0.04, 2: 0.04}
    shown = filmed_drifts([(1, straight), (2, right), (3, right)], forward, roles)
    assert shown == {2: pytest.approx(-0.2)}
