"""Problems: changed parameters, writing, and the gaits that they find."""

import math
from pathlib import Path

import pytest
from helpers import STRIDER, still

from gaitopt.core.errors import GaitoptError
from gaitopt.gait.gait import Gait, write_gait
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem, load_problem

# --- named parameters -------------------------------------------------------------------------


def test_setting_a_parameter_changes_it_alone(strider: Problem) -> None:
    changed = strider.with_parameters({"mu_rear": 0.1 + 0.2})
    assert changed.file.parameters["mu_rear"].value == 0.1 + 0.2
    assert strider.file.parameters["mu_rear"].value == 1.0
    back = changed.with_parameters({"mu_rear": 1.0})
    assert back == strider
    assert load_problem(STRIDER, {"mu_rear": 0.1 + 0.2}) == changed
    assert strider.with_parameters({}) == strider


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"mu_raer": 1.0},
            "unknown parameter 'mu_raer'; known: k_servo, b_servo, torque_limit, mu_rear, mu_front, "
            "mu_trunk, mass (nearest: 'mu_rear')",
        ),
        ({"mu_rear": math.nan}, "parameters.mu_rear.value: found nan; allowed: a finite number"),
        ({"mu_rear": math.inf}, "parameters.mu_rear.value: found inf; allowed: a finite number"),
    ],
)
def test_a_bad_parameter_is_one_line(strider: Problem, values: dict[str, float], message: str) -> None:
    with pytest.raises(GaitoptError) as error:
        strider.with_parameters(values)
    assert str(error.value) == f"{strider.source}: {message}"


def test_a_value_that_no_robot_has_is_one_line(tmp_path: Path, strider: Problem) -> None:
    with pytest.raises(GaitoptError, match=r"strider\.xml: ") as error:
        build_model(strider.with_parameters({"mass": -1.0}))
    assert "\n" not in str(error.value)


# --- there and back ---------------------------------------------------------------------------


@pytest.mark.parametrize("robot", ["arcfold", "arcfold-published", STRIDER])
def test_a_written_problem_file_is_the_same_problem(tmp_path: Path, robot: Path | str) -> None:
    problem = load_problem(robot)
    written = tmp_path / "problem.toml"
    written.write_text(problem.to_toml("robot.xml"))
    (tmp_path / "robot.xml").write_bytes(problem.model_path.read_bytes())
    back = load_problem(written)
    assert back.file.model_copy(update={"model": problem.file.model}) == problem.file
    assert back.baselines == problem.baselines
    assert back.space == problem.space
    assert back.channel_names == problem.channel_names


# --- gaits of a problem -----------------------------------------------------------------------


def test_a_gait_is_a_baseline_a_file_or_a_run_folder(tmp_path: Path, strider: Problem) -> None:
    gait = strider.baselines["square"]
    assert strider.find_gait("square") == gait
    write_gait(tmp_path / "best.toml", gait)
    assert strider.find_gait(str(tmp_path / "best.toml")).channels == gait.channels
    assert strider.find_gait(str(tmp_path)).channels == gait.channels


def test_a_gait_takes_the_problems_order_of_channels(strider: Problem) -> None:
    gait = strider.baselines["square"]
    turned = Gait(gait.period_s, dict(reversed(gait.channels.items())), gait.name)
    assert list(strider.check_gait(turned, "turned").channels) == strider.channel_names


def test_a_gait_that_is_not_there_says_what_is(tmp_path: Path, strider: Problem) -> None:
    with pytest.raises(GaitoptError) as error:
        strider.find_gait("sqare")
    assert str(error.value) == (
        "sqare: neither a baseline nor a gait file nor an exported table nor a run folder; "
        "baselines: stride, square (nearest: 'square')"
    )
    with pytest.raises(GaitoptError, match=r"best\.toml: no such file; .* is not a finished run folder"):
        strider.find_gait(str(tmp_path))


def test_another_robots_gait_is_one_line(tmp_path: Path, strider: Problem, arcfold: Problem) -> None:
    write_gait(tmp_path / "gait.toml", still(arcfold))
    with pytest.raises(GaitoptError) as error:
        strider.find_gait(str(tmp_path / "gait.toml"))
    assert str(error.value) == (
        f"{tmp_path / 'gait.toml'}: unknown channel '{arcfold.channel_names[0]}'; known: rear, front"
    )
