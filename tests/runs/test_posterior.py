"""Robots of a posterior in a file: what is read, what is written, and files that are wrong."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posteriors import diagnosed

from gaitopt.core.errors import GaitoptError
from gaitopt.effects.active import EffectValue, EffectValues
from gaitopt.problem.problem import Problem
from gaitopt.runs.posterior import posterior_csv, read_robots, with_posterior

HEAD = "servo_gain.all,servo_trim.rear,contact_compliance.none\n"

VALUES = st.floats(0.01, 100.0)


def read(problem: Problem, text: str) -> tuple[EffectValues, ...]:
    path = Path("posterior.csv")
    path.write_text(text)
    return read_robots(path, problem)


def test_an_effect_is_not_at_work_where_its_cell_is_blank_or_neutral(strider: Problem) -> None:
    robots = read(strider, f"{HEAD}0.9,,\n,0.02,1.0\n,,\n1,0,2.5\n")
    assert robots == (
        (EffectValue("servo_gain", "all", 0.9),),
        (EffectValue("servo_trim", "rear", 0.02),),
        (),
        (EffectValue("contact_compliance", "all", 2.5),),
    )


def test_neutral_values_on_all_servos_leave_one_servo_its_own(strider: Problem) -> None:
    robots = read(strider, "servo_gain.all,servo_gain.rear,servo_gain.front\n1.0,0.8,\n1,0.9,1.1\n0.7,1,1\n")
    assert [[(one.target, one.value) for one in robot] for robot in robots] == [
        [("rear", 0.8)],
        [("rear", 0.9), ("front", 1.1)],
        [("all", 0.7)],
    ]
    both = strider.as_robot(robots[1])
    assert [(one.target, one.value) for one in both.effects] == [("rear", 0.9), ("front", 1.1)]


@given(st.lists(st.tuples(VALUES, st.none() | VALUES), min_size=1, max_size=9))
def test_robots_that_are_written_are_read_with_the_same_bits(
    strider: Problem, scratch: Path, drawn: list[tuple[float, float | None]]
) -> None:
    robots = tuple(
        (EffectValue("servo_gain", "rear", gain),)
        + (() if damping is None else (EffectValue("servo_damping", "all", damping),))
        for gain, damping in drawn
        if gain != 1.0 and damping != 1.0
    )
    if robots:
        path = scratch / "posterior.csv"
        path.write_text(posterior_csv(robots))
        assert [set(robot) for robot in read_robots(path, strider)] == [set(robot) for robot in robots]


def test_robots_without_any_effect_are_robots(strider: Problem) -> None:
    assert read(strider, posterior_csv([()] * 3)) == ((), (), ())
    one = EffectValue("servo_gain", "all", 0.5)
    assert read(strider, posterior_csv([(), (one,), ()])) == ((), (one,), ())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "posterior.csv: found no columns; allowed: 1 to 10000 robots"),
        (HEAD, "posterior.csv: found 0; allowed: 1 to 10000 robots"),
        ("servo_gain\n1\n", "column: found 'servo_gain'; allowed: NAME.TARGET"),
        ("servo_gian.all\n0.9\n", "unknown effect in column 'servo_gian'; .*nearest: 'servo_gain'"),
        ("servo_gain.middle\n0.9\n", "column servo_gain: unknown target 'middle'; known: all, rear, front"),
        ("channel_timing.all\n0.9\n", "column channel_timing: unknown target 'all'; known: rear, front"),
        ("contact_compliance.rear\n0.9\n", "unknown target 'rear'; known: none, all"),
        ("servo_gain.all,servo_gain.all\n1,1\n", "column 'servo_gain.all' appears twice"),
        (f"{HEAD}0.9,,\n-0.9,,\n", r"line 3: effects.servo_gain: scale: found -0.9; allowed: above 0"),
        (f"{HEAD}much,,\n", r"line 2: servo_gain.all: found 'much'; allowed: a number, or nothing"),
        (f"{HEAD}nan,,\n", r"line 2: effects.servo_gain: scale: found nan"),
        (f"{HEAD}0.9,,,7\n", "line 2: found 4 cells; allowed: 3"),
        ("servo_gain.all,servo_gain.rear\n0.9,0.8\n", "target: found 'all, rear'; allowed: each"),
        ("hinge_friction.all\n0.1\n", "column hinge_friction.all: not applicable: .*no roles.hinges"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_one_line(strider: Problem, text: str, message: str) -> None:
    with pytest.raises(GaitoptError, match=message) as error:
        read(strider, text)
    assert "\n" not in str(error.value)


def test_what_was_found_may_not_be_switched_on_already(strider: Problem) -> None:
    corrected = strider.with_effects({"servo_gain": {"scale": 0.9}})
    with pytest.raises(GaitoptError, match=r"column servo_gain.all: .*problem.toml has this effect already"):
        read(corrected, f"{HEAD}0.9,,\n")


def test_a_folder_that_is_no_finished_diagnosis_is_said(strider: Problem) -> None:
    with pytest.raises(GaitoptError, match=r"--posterior: dg: not the folder of a finished diagnosis"):
        with_posterior(strider, Path("dg"))
    folder = diagnosed(Path("dg"))
    assert len(with_posterior(strider, folder).robots) == 16
    (folder / "posterior.csv").unlink()
    with pytest.raises(GaitoptError, match=r"--posterior: dg: no posterior.csv; diagnose again"):
        with_posterior(strider, folder)


def test_an_infinite_neutral_value_is_none(strider: Problem) -> None:
    assert read(strider, f"servo_speed_limit.all\n{math.inf}\n5\n") == (
        (),
        (EffectValue("servo_speed_limit", "all", 5.0),),
    )
