"""The gait space: every point is a gait inside the bounds, and phases are a circle."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gaitopt.gait.gait import Gait
from gaitopt.gait.space import GaitSpace
from gaitopt.problem.problem import Problem

Point = NDArray[np.float64]
ROBOTS = ["arcfold", "strider"]


def points(dimension: int, low: float | None = None, high: float | None = None) -> st.SearchStrategy[Point]:
    """Points of real numbers."""
    number = st.floats(low, high, allow_nan=False, allow_infinity=False)
    return st.lists(number, min_size=dimension, max_size=dimension).map(np.array)


def dimension(space: GaitSpace) -> int:
    """Number of coordinates."""
    return len(space.variables)


def phase_apart(one: float, other: float) -> float:
    """Distance of two phases on the circle."""
    return abs((one - other + 0.5) % 1.0 - 0.5)


@pytest.fixture(scope="module", params=ROBOTS)
def problem(request: pytest.FixtureRequest) -> Problem:
    return request.getfixturevalue(request.param)


@given(st.data())
def test_every_point_is_a_gait_inside_the_bounds(problem: Problem, data: st.DataObject) -> None:
    space = problem.space
    point = data.draw(points(dimension(space)))
    gait = space.decode(point)
    assert space.period_s[0] <= gait.period_s <= space.period_s[1]
    for name, bounds in space.channels.items():
        channel = gait.channels[name]
        assert bounds.duty[0] <= channel.duty <= bounds.duty[1]
        assert bounds.amplitude_deg[0] <= channel.amplitude_deg <= bounds.amplitude_deg[1]
        assert bounds.smoothing[0] <= channel.smoothing <= bounds.smoothing[1]
        low, high = channel.extremes_deg
        assert bounds.range_deg[0] - 1e-9 <= low <= high <= bounds.range_deg[1] + 1e-9
    assert problem.check_gait(gait, "decoded") == gait


@given(st.data())
def test_wrapping_leads_into_the_unit_box(problem: Problem, data: st.DataObject) -> None:
    space = problem.space
    for point in (data.draw(points(dimension(space))), np.full(dimension(space), -1e-20)):
        wrapped = space.wrap(point)
        assert ((wrapped >= 0.0) & (wrapped <= 1.0)).all()
        assert (wrapped[space.circular] < 1.0).all()
        assert np.array_equal(space.wrap(wrapped), wrapped)


@given(st.data())
def test_encoding_undoes_decoding(problem: Problem, data: st.DataObject) -> None:
    space = problem.space
    point = data.draw(points(dimension(space), 0.01, 0.99))
    np.testing.assert_allclose(space.encode(space.decode(point)), point, rtol=0, atol=1e-9)


@given(st.data())
def test_decoding_undoes_encoding(problem: Problem, data: st.DataObject) -> None:
    space = problem.space
    gait = space.decode(data.draw(points(dimension(space), 0.0, 1.0)))
    back = space.decode(space.encode(gait))
    assert back.period_s == pytest.approx(gait.period_s, rel=1e-12)
    for name, channel in gait.channels.items():
        other = back.channels[name]
        assert phase_apart(other.phase, channel.phase) < 1e-12
        for key in ("duty", "amplitude_deg", "offset_deg", "smoothing"):
            assert getattr(other, key) == pytest.approx(getattr(channel, key), abs=1e-9)


def test_the_baselines_are_points(problem: Problem) -> None:
    for gait in problem.baselines.values():
        back = problem.space.decode(problem.space.encode(gait))
        shift = next(iter(gait.channels.values())).phase
        t = np.linspace(0.0, gait.period_s, 997)
        inside = problem.space.period_s[0] <= gait.period_s <= problem.space.period_s[1]
        assert inside
        np.testing.assert_allclose(
            back.targets(t * back.period_s / gait.period_s),
            gait.targets(t - shift * gait.period_s),
            rtol=0,
            atol=1e-9,
        )


@given(st.data(), st.integers(-3, 3))
def test_phases_are_circular(problem: Problem, data: st.DataObject, turns: int) -> None:
    """A whole turn of any phase changes nothing; with binary fractions to the last bit."""
    space = problem.space
    grid = st.integers(0, 2**20 - 1).map(lambda n: n / 2**20)
    point = np.array(data.draw(st.lists(grid, min_size=dimension(space), max_size=dimension(space))))
    turned = point + turns * space.circular
    assert space.decode(turned) == space.decode(point)


def test_only_phases_are_circular(problem: Problem) -> None:
    names = [variable.name for variable in problem.space.variables if variable.circular]
    assert names == [f"{name}.phase" for name in problem.channel_names[1:]]
    assert problem.space.circular.sum() == len(names)


@given(st.data(), st.floats(-3.0, 3.0))
def test_a_common_phase_shift_is_invisible(problem: Problem, data: st.DataObject, shift: float) -> None:
    """It only shifts time."""
    space = problem.space
    point = data.draw(points(dimension(space), 0.01, 0.99))
    gait = space.decode(point)
    shifted = Gait(
        gait.period_s,
        {n: c.model_copy(update={"phase": c.phase + shift}) for n, c in gait.channels.items()},
    )
    one, other = space.encode(gait), space.encode(shifted)
    circular = space.circular
    np.testing.assert_allclose(other[~circular], one[~circular], rtol=0, atol=1e-12)
    assert all(phase_apart(a, b) < 1e-12 for a, b in zip(one[circular], other[circular], strict=True))


def test_the_order_of_a_gaits_channels_is_invisible(problem: Problem) -> None:
    space = problem.space
    gait = space.decode(np.linspace(0.1, 0.9, dimension(space)))
    for channel in gait.channels.values():
        assert channel.phase != 0.0 or channel is next(iter(gait.channels.values()))
    reordered = Gait(gait.period_s, dict(reversed(gait.channels.items())))
    assert np.array_equal(space.encode(reordered), space.encode(gait))


def test_the_period_is_even_in_its_logarithm(arcfold: Problem) -> None:
    """The centre of the box is the geometric mean of the periods."""
    middle = arcfold.space.decode(np.full(dimension(arcfold.space), 0.5))
    assert middle.period_s == pytest.approx(math.sqrt(math.prod(arcfold.space.period_s)))


def test_what_lies_outside_moves_to_the_bounds(arcfold: Problem) -> None:
    gait = arcfold.baselines["square-4s"].with_period(1e3)
    moved = arcfold.space.decode(arcfold.space.encode(gait)).period_s
    assert moved == pytest.approx(arcfold.space.period_s[1], rel=1e-12)


def test_arcfolds_space_is_the_contracts(arcfold: Problem) -> None:
    assert arcfold.space.period_s == (0.25, 5.0)
    for bounds in arcfold.space.channels.values():
        assert bounds.duty == (0.1, 0.9)
        assert max(map(abs, bounds.amplitude_deg)) == 90.0
        assert bounds.smoothing[0] == 0.0
