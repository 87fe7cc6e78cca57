"""Ties in a problem file: templates of legs, and one line for each wrong name."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitopt.gait.space import ChannelSpace, GaitSpace
from gaitopt.problem.ties import TEMPLATES, GaitBounds, tied_spaces

SPACE = ChannelSpace((-40.0, 40.0), (0.0, 60.0), (0.1, 0.9), (0.0, 1.0))
LEGS = {
    "front_left": ["fl_hip", "fl_knee"],
    "front_right": ["fr_hip", "fr_knee"],
    "middle_left": ["ml_hip", "ml_knee"],
    "middle_right": ["mr_hip", "mr_knee"],
    "hind_left": ["hl_hip", "hl_knee"],
    "hind_right": ["hr_hip", "hr_knee"],
}
FULL = GaitSpace((0.2, 2.0), {name: SPACE for leg in LEGS.values() for name in leg})
FOUR = {leg: names for leg, names in LEGS.items() if not leg.startswith("middle")}
QUADRUPED = GaitSpace((0.2, 2.0), {name: SPACE for leg in FOUR.values() for name in leg})


def bounds(**keys: object) -> GaitBounds:
    """The [gait] of a file."""
    return GaitBounds.model_validate({"period_s": (0.2, 2.0), **keys})


def phases(template: str, legs: dict[str, list[str]], full: GaitSpace) -> dict[str, float]:
    """The phase of each leg's first joint in a template."""
    (space,) = tied_spaces(bounds(templates=[template], legs=legs), full, {})
    gait = space.decode(0.5 + 0.0 * space.circular)
    return {leg: gait.channels[names[0]].phase for leg, names in legs.items()}


@pytest.mark.parametrize(
    ("template", "together"),
    {
        "trot": [{"front_left", "hind_right"}, {"front_right", "hind_left"}],
        "pace": [{"front_left", "hind_left"}, {"front_right", "hind_right"}],
        "bound": [{"front_left", "front_right"}, {"hind_left", "hind_right"}],
        "tripod": [{"front_left", "middle_right", "hind_left"}, {"front_right", "middle_left", "hind_right"}],
    }.items(),
)
def test_legs_of_a_template_move_in_two_groups(template: str, together: list[set[str]]) -> None:
    six = template == "tripod"
    found = phases(template, LEGS if six else FOUR, FULL if six else QUADRUPED)
    groups = {phase: {leg for leg in found if found[leg] == phase} for phase in set(found.values())}
    assert set(groups) == {0.0, 0.5}
    assert sorted(map(sorted, groups.values())) == sorted(map(sorted, together))


def test_in_a_walk_the_fore_follows_the_hind_of_its_side_a_quarter_later() -> None:
    found = phases("walk", FOUR, QUADRUPED)
    assert sorted(found.values()) == [0.0, 0.25, 0.5, 0.75]
    for side in ("left", "right"):
        assert (found[f"hind_{side}"] - found[f"front_{side}"]) % 1.0 == 0.25
    assert list(TEMPLATES["walk"]) == list(FOUR)


def test_an_undulation_is_one_wave_and_a_lag() -> None:
    full = GaitSpace((0.2, 2.0), {f"j{i}": SPACE for i in range(6)})
    (space,) = tied_spaces(bounds(templates=["undulation"], mirrored=["j3"]), full, {})
    assert [variable.name for variable in space.variables][-1] == "shifts.lag"
    assert len(space.variables) == 6
    gait = space.decode(np.array([0.5, 0.5, 0.5, 0.5, 0.5, 0.7]))
    lag = -0.5 + 0.7
    for i in (1, 2, 4, 5):
        assert (gait.channels[f"j{i}"].phase + i * lag) % 1.0 == pytest.approx(0.0, abs=1e-9)
    assert gait.channels["j3"].offset_deg == pytest.approx(
        -gait.channels["j0"].offset_deg - gait.channels["j0"].amplitude_deg
    )


@given(st.lists(st.floats(-0.5, 1.5), min_size=6, max_size=6).map(np.array))
def test_an_undulation_is_nearly_the_same_to_both_sides_of_the_start(point: np.ndarray) -> None:
    full = GaitSpace((0.2, 2.0), {f"j{i}": SPACE for i in range(6)})
    start = {f"j{i}": -5.0 if i == 3 else 5.0 for i in range(6)}
    (space,) = tied_spaces(bounds(templates=["undulation"], mirrored=["j3"]), full, start)
    for name, channel in space.decode(point).channels.items():
        low, high = channel.extremes_deg
        assert -40.0 - 1e-9 <= low <= high <= 40.0 + 1e-9
        assert abs(channel.duty - 0.5) <= 0.1 + 1e-9
        assert abs(channel.offset_deg + 0.5 * channel.amplitude_deg - start[name]) <= 4.0 + 1e-9
    assert space.free.channels["j0"].duty == pytest.approx((0.4, 0.6))
    inside = np.clip(point, 0.0, 1.0)
    again = space.project(space.lift(np.array([inside])))
    assert space.decode(again[0]).targets(np.linspace(0.0, 1.0, 9), 0.0) == pytest.approx(
        space.decode(inside).targets(np.linspace(0.0, 1.0, 9), 0.0), abs=1e-6
    )


def test_an_undulation_that_cannot_be_even_is_as_even_as_its_bounds_allow() -> None:
    aside = ChannelSpace((10.0, 40.0), (20.0, 30.0), (0.7, 0.9), (0.0, 1.0))
    full = GaitSpace((0.2, 2.0), {f"j{i}": aside for i in range(3)})
    (space,) = tied_spaces(bounds(templates=["undulation"]), full, {})
    for share in (0.0, 1.0):
        channel = space.decode(np.full(6, share)).channels["j0"]
        assert channel.duty == pytest.approx(0.7)
        assert channel.extremes_deg[0] == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"templates": ["trott"]}, "gait.templates: unknown template 'trott'; known: trot, pace"),
        ({"templates": ["trot"]}, "gait.legs.front_left: missing; the template 'trot' needs it"),
        ({"legs": {"front_lef": ["fl_hip"]}}, "gait.legs: unknown leg 'front_lef'"),
        ({"legs": {"front_left": ["fl_hp"]}}, "(nearest: 'fl_hip')"),
        ({"ties": {"fl_hipp": {"like": "fr_hip"}}}, "gait.ties: unknown channel 'fl_hipp'"),
        ({"ties": {"fl_hip": {"like": "fr_hp"}}}, "gait.ties.fl_hip.like: unknown channel 'fr_hp'"),
        ({"ties": {"fl_hip": {"like": "fr_hip", "shift": "lagg"}}, "shifts": {"lag": (0.0, 0.5)}},
         "gait.ties.fl_hip.shift: unknown shift 'lagg'; known: lag (nearest: 'lag')"),
        ({"shifts": {"lag": (0.5, 0.0)}}, "gait.shifts.lag: found [0.5, 0.0]; allowed: [low, high]"),
        ({"legs": {"front_left": ["fl_hip"], "hind_left": ["fl_hip"]}}, "gait.legs: found 'fl_hip' twice"),
        ({"templates": ["trot"], "legs": {**FOUR, "hind_left": ["hl_hip"]}}, "legs of 2 and 1 channels"),
        ({"mirrored": ["fl_hip"]}, "gait.mirrored: found without `templates`"),
        ({"ties": {"fl_hip": {"like": "fl_hip"}}}, "found a circle"),
    ],
)  # fmt: skip
def test_one_line_says_what_is_wrong(keys: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        tied_spaces(bounds(**keys), QUADRUPED, {})
    assert said in str(caught.value)
