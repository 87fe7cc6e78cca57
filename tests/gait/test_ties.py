"""Ties between channels: every point of the smaller space is a gait that obeys them, inside all bounds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitopt.gait.space import ChannelSpace, GaitSpace
from gaitopt.gait.ties import Tie, TiedSpace

WIDE = ChannelSpace((-40.0, 40.0), (0.0, 60.0), (0.1, 0.9), (0.0, 1.0))
SKEW = ChannelSpace((-20.0, 50.0), (0.0, 50.0), (0.2, 0.9), (0.1, 0.8))
FULL = GaitSpace((0.2, 2.0), {"a": WIDE, "b": SKEW, "c": WIDE, "d": WIDE})
TIES = {
    "b": Tie("a", 0.25),
    "c": Tie("b", 0.5, mirrored=True),
    "d": Tie("c", by="lag", times=-1),
}
SPACE = TiedSpace.of("ties", FULL, TIES, {"lag": (0.1, 0.4)})
points = st.lists(st.floats(-0.5, 1.5), min_size=6, max_size=6).map(np.array)


def test_twelve_servos_in_a_trot_are_a_handful_of_numbers() -> None:
    names = [f"{leg}{joint}" for leg in ("fl", "fr", "hl", "hr") for joint in ("hip", "knee", "toe")]
    full = GaitSpace((0.2, 2.0), dict.fromkeys(names, WIDE))
    phases = {"fr": 0.5, "hl": 0.5, "hr": 0.0}
    ties = {f"{leg}{joint}": Tie(f"fl{joint}", shift) for leg, shift in phases.items()
            for joint in ("hip", "knee", "toe")}  # fmt: skip
    assert len(full.variables) == 60
    assert len(TiedSpace.of("trot", full, ties, {}).variables) == 15
    assert [variable.name for variable in SPACE.variables] == [
        "period_s", "a.duty", "a.amplitude_deg", "a.offset_deg", "a.smoothing", "shifts.lag",
    ]  # fmt: skip


@given(points)
def test_every_point_is_a_gait_that_obeys_the_ties_inside_the_bounds(point: np.ndarray) -> None:
    gait = SPACE.decode(point)
    lag = 0.1 + 0.3 * float(np.clip(point[-1], 0.0, 1.0))
    time = np.linspace(0.0, gait.period_s, 97)[:-1] + 0.0013
    _, b, c, d = gait.targets(time, 0.0).T
    ahead = lambda cycles: gait.targets(time + cycles * gait.period_s, 0.0)[:, 0]  # noqa: E731
    assert np.abs(b - ahead(0.25)).max() < 1e-6  # no channel is as square as would be moved by rounding
    assert np.abs(c + ahead(0.75)).max() < 1e-6
    assert np.abs(d + ahead(0.75 - lag)).max() < 1e-6
    for name, space in FULL.channels.items():
        channel = gait.channels[name]
        low, high = channel.extremes_deg
        assert space.range_deg[0] - 1e-9 <= low <= high <= space.range_deg[1] + 1e-9
        for key in ("amplitude_deg", "duty", "smoothing"):
            bounds = getattr(space, key)
            assert bounds[0] - 1e-12 <= getattr(channel, key) <= bounds[1] + 1e-12


@given(points)
def test_points_go_to_the_full_space_and_back(point: np.ndarray) -> None:
    inside = np.clip(point, 0.0, 1.0)
    full = SPACE.lift(np.array([inside]))
    assert full.shape == (1, len(FULL.variables))
    again = SPACE.lift(SPACE.project(full))
    wrapped = np.abs((again - full + 0.5) % 1.0 - 0.5)
    assert np.where(FULL.circular, wrapped, np.abs(again - full)).max() < 1e-6


def test_what_cannot_be_tied_is_one_line() -> None:
    with pytest.raises(ValueError, match=r"ties.a: found a circle, a like b like a"):
        TiedSpace.of("ties", FULL, {"a": Tie("b"), "b": Tie("a")}, {})
    raised = ChannelSpace((50.0, 60.0), (0.0, 5.0), (0.1, 0.9), (0.0, 1.0))
    other = GaitSpace((0.2, 2.0), {"a": WIDE, "b": raised})
    with pytest.raises(ValueError, match=r"ties: range_deg of a and of what follows it have nothing in"):
        TiedSpace.of("ties", other, {"b": Tie("a")}, {})
