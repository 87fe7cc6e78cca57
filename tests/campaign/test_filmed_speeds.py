"""The speed that films show, and how repeatable it is."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitopt.campaign.speeds import FilmedSpeed, Measured, confirmed, filmed_drifts, filmed_speed
from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.gait import Channel, Gait
from gaitopt.problem.records import Horizon
from gaitopt.robot.roles import Roles

NOSE, ONE_CYCLE = Roles(marker="nose"), Horizon(transient_s=0.0, transient_cycles=1)
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
    shown = filmed_speed(film(0.04), NOSE, ONE_CYCLE)
    assert shown.mean_m_s == pytest.approx(0.04, rel=1e-6)


def test_the_first_cycle_does_not_count() -> None:
    assert filmed_speed(film(0.04, slow_s=0.4), NOSE, ONE_CYCLE).mean_m_s == pytest.approx(0.04)


def test_the_transient_of_the_problem_does_not_count() -> None:
    late = film(0.04, seconds=6.25, slow_s=1.9)
    assert filmed_speed(late, NOSE, Horizon(transient_s=2.0)).mean_m_s == pytest.approx(0.04)


def test_a_recording_that_begins_after_the_gait_leaves_out_what_is_left_of_the_transient() -> None:
    late = replace(film(0.04, seconds=6.25, slow_s=0.9), starts_at_s=1.0)
    shown = filmed_speed(late, NOSE, Horizon(transient_s=2.0))
    assert shown.mean_m_s == pytest.approx(0.04)
    assert filmed_speed(late, NOSE, Horizon(transient_s=1.0)).mean_m_s < 0.9 * shown.mean_m_s


@given(
    transient=st.floats(0.0, 20.0),
    seconds=st.floats(0.6, 9.0),
    starts=st.none() | st.floats(-3.0, 3.0),
)
def test_a_film_of_a_steady_walk_shows_its_speed_however_short_it_is(
    transient: float, seconds: float, starts: float | None
) -> None:
    """At most half of the cycles are left out."""
    steady = replace(film(0.04, seconds), starts_at_s=starts)
    if starts is not None and starts + seconds < 2.0 * GAIT.period_s:
        return
    shown = filmed_speed(steady, NOSE, Horizon(transient_s=transient))
    assert shown.mean_m_s == pytest.approx(0.04)


def test_at_least_half_of_the_cycles_count() -> None:
    """Seven of fifteen cycles are left out, though the transient has fourteen."""
    late = film(0.04, seconds=8.05, slow_s=2.0)
    assert filmed_speed(late, NOSE, Horizon(transient_s=7.0)).mean_m_s == pytest.approx(0.04)
    early = film(0.04, seconds=8.05, slow_s=5.0)
    assert filmed_speed(early, NOSE, Horizon(transient_s=7.0)).mean_m_s == pytest.approx(
        0.04 * 5.5 / 8.0, rel=0.01
    )


def test_noise_shows_as_spread() -> None:
    shown = filmed_speed(film(0.04, noise=5e-4), NOSE, ONE_CYCLE)
    assert abs(shown.mean_m_s - 0.04) < 5.0 * shown.error_m_s
    assert 0.0 < shown.error_m_s < 2e-3


def test_forward_is_the_direction_of_the_problem() -> None:
    with pytest.raises(GaitoptError, match=r"no marker\.y"):
        filmed_speed(film(0.04), Roles(marker="nose", forward=(0.0, 1.0, 0.0)), ONE_CYCLE)


def one(speed: float) -> FilmedSpeed:
    return FilmedSpeed(speed, 1e-3)


def test_repeats_show_the_repeatability() -> None:
    alone = Measured.of([(1, one(0.04))], 0.0)
    assert alone.repeatability_m_s == pytest.approx(1e-3)
    wide = Measured.of([(1, one(0.04)), (1, one(0.06)), (2, one(0.02))], 0.0)
    assert wide.means == {1: pytest.approx(0.05), 2: pytest.approx(0.02)}
    assert wide.repeatability_m_s == pytest.approx(np.sqrt((1e-6 + 2e-4) / 2.0))
    assert Measured.of([(1, one(0.5))], 0.01).repeatability_m_s == pytest.approx(0.005)


def test_a_speed_that_fits_nothing_counts_once_it_is_confirmed() -> None:
    films = [(1, "a", one(0.04)), (2, "b", one(0.01)), (2, "c", one(0.05))]
    assert confirmed(films, ["b"], 0.15) == [True, False, True]
    films.append((2, "d", one(0.0105)))
    assert confirmed(films, ["b", "d"], 0.15) == [True] * 4


def test_a_drift_is_sideways_over_forward_travel_and_unknown_without_its_signal() -> None:
    straight = film(0.04)
    right = Trial.of("right", GAIT, straight.time, {**straight.signals, "marker.y": -0.008 * straight.time})
    forward = {1: 0.04, 2: 0.04}
    shown = filmed_drifts([(1, straight), (2, right), (3, right)], forward, NOSE, ONE_CYCLE)
    assert shown == {2: pytest.approx(-0.2)}


def test_a_drift_that_was_measured_for_less_than_a_cycle_is_unknown() -> None:
    straight = film(0.04)
    aside = np.where(straight.time < 0.3, 0.0, np.nan)
    both = Trial.of("both", GAIT, straight.time, {**straight.signals, "marker.y": aside})
    both = replace(both, used={**both.used, "marker.y": np.isfinite(aside)})
    assert filmed_drifts([(1, both)], {1: 0.04}, NOSE, ONE_CYCLE) == {}


def test_the_first_samples_of_a_cycle_do_not_count_as_a_cycle() -> None:
    """The robot stops after four cycles: one sample of the fifth would be a fifth of the mean."""
    time = np.arange(0.0, 2.52, 0.02)
    stopped = Trial.of("stopped", GAIT, time, {"marker.x": 0.04 * np.minimum(time, 2.0)})
    assert filmed_speed(stopped, NOSE, ONE_CYCLE).mean_m_s == pytest.approx(0.04 * 5.0 / 6.0, rel=0.01)
