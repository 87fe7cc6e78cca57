"""The objective: named terms, named constraints, all reported."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitopt.errors import GaitoptError
from gaitopt.metrics import METRICS, Metrics
from gaitopt.objective import FAILED_COST, check_objective, evaluate
from gaitopt.problem import Objective, Problem


def aiming(problem: Problem, **objective: object) -> Problem:
    """The problem with another objective."""
    file = problem.file.model_copy(update={"objective": Objective.model_validate(objective)})
    return Problem.from_file(file, problem.source, problem.model_path)


def row(problem: Problem, **values: float) -> Metrics:
    """Metrics that are 0 unless said otherwise."""
    names = [*METRICS, *(f"reached.{name}" for name in problem.channel_names)]
    return dict.fromkeys(names, 0.0) | values


def test_the_cost_is_the_weighted_sum_of_mean_metrics(strider: Problem) -> None:
    problem = aiming(strider, terms={"speed_m_s": -2.0, "power_w": 0.5})
    rows = [row(problem, speed_m_s=0.1, power_w=1.0), row(problem, speed_m_s=0.3, power_w=3.0)]
    evaluation = evaluate(problem, rows, ["ok", "ok"])
    assert evaluation.cost == pytest.approx(-2.0 * 0.2 + 0.5 * 2.0)
    assert evaluation.metrics["speed_m_s"] == pytest.approx(0.2)
    assert evaluation.constraints_met
    assert evaluation.violations == {}


@given(st.floats(-1.0, 3.0))
def test_a_violation_is_counted_in_its_scale(strider: Problem, value: float) -> None:
    limits = {"tilt_rad": {"min": 0.5, "max": 1.0, "scale": 0.25}}
    problem = aiming(strider, terms={"speed_m_s": -1.0}, constraints=limits, penalty=3.0)
    evaluation = evaluate(problem, [row(problem, tilt_rad=value)], ["ok"])
    violation = max(0.0, value - 1.0, 0.5 - value) / 0.25
    assert evaluation.violations == {"tilt_rad": pytest.approx(violation)}
    assert evaluation.cost == pytest.approx(3.0 * violation)
    assert evaluation.constraints_met == (0.5 <= value <= 1.0)


def test_constraints_hold_for_the_mean_over_scenarios(strider: Problem) -> None:
    problem = aiming(strider, terms={"speed_m_s": -1.0}, constraints={"airtime": {"max": 0.1}})
    rows = [row(problem, airtime=0.0), row(problem, airtime=0.15)]
    assert evaluate(problem, rows, ["ok", "ok"]).constraints_met
    assert not evaluate(problem, rows[1:], ["ok"]).constraints_met


def test_every_constraint_is_reported(strider: Problem) -> None:
    limits = {"airtime": {"max": 0.1, "scale": 0.1}, "tilt_rad": {"max": 0.1, "scale": 0.1}}
    problem = aiming(strider, terms={"speed_m_s": -1.0}, constraints=limits)
    evaluation = evaluate(problem, [row(problem, airtime=0.2)], ["ok"])
    assert evaluation.violations == pytest.approx({"airtime": 1.0, "tilt_rad": 0.0})


def test_a_failure_costs_more_than_anything(strider: Problem) -> None:
    rows = [row(strider), dict.fromkeys(row(strider), math.nan)]
    evaluation = evaluate(strider, rows, ["ok", "diverged: badqacc"])
    assert evaluation.cost == FAILED_COST
    assert evaluation.status == "diverged: badqacc"
    assert not evaluation.constraints_met
    worst = evaluate(strider, [row(strider, speed_m_s=-10.0, airtime=1.0, tilt_rad=math.pi)], ["ok"])
    assert worst.cost < FAILED_COST


@pytest.mark.parametrize("value", [math.inf, math.nan])
def test_what_is_not_a_number_never_wins(strider: Problem, value: float) -> None:
    as_term = aiming(strider, terms={"cost_of_transport": 1.0})
    assert evaluate(as_term, [row(as_term, cost_of_transport=value)], ["ok"]).cost == FAILED_COST
    limit = aiming(strider, terms={"speed_m_s": -1.0}, constraints={"cost_of_transport": {"max": 5.0}})
    evaluation = evaluate(limit, [row(limit, cost_of_transport=value)], ["ok"])
    assert not evaluation.constraints_met
    assert 0.0 < evaluation.cost < math.inf


@pytest.mark.parametrize("key", ["terms", "constraints"])
def test_an_unknown_metric_is_one_line(strider: Problem, key: str) -> None:
    objective = {"terms": {"speed_m_s": -1.0}} | {
        key: {"sped_m_s": -1.0} if key == "terms" else {"sped_m_s": {"max": 1.0}}
    }
    problem = aiming(strider, **objective)
    with pytest.raises(GaitoptError) as error:
        check_objective(problem)
    message = str(error.value)
    assert message.startswith(
        f"{strider.source}: objective.{key}: unknown metric 'sped_m_s'; known: speed_m_s,"
    )
    assert message.endswith("(nearest: 'speed_m_s')")


def test_the_reach_of_one_channel_is_a_metric(strider: Problem) -> None:
    check_objective(aiming(strider, terms={"reached.rear": -1.0}))
    with pytest.raises(GaitoptError, match=r"unknown metric 'reached\.raer'.*nearest: 'reached\.rear'"):
        check_objective(aiming(strider, terms={"reached.raer": -1.0}))


def test_the_bundled_objectives_are_made_of_metrics(arcfold: Problem) -> None:
    check_objective(arcfold)


def test_a_margin_tightens_every_limit_for_the_search_alone(arcfold: Problem) -> None:
    limits = {"airtime": {"max": 0.5}, "speed_m_s": {"min": 0.1}}
    problem = aiming(arcfold, terms={"speed_m_s": -1.0}, constraints=limits)
    rows = [row(problem, airtime=0.45, speed_m_s=0.11)]
    assert evaluate(problem, rows, ["ok"]).constraints_met
    tightened = evaluate(problem, rows, ["ok"], margin=0.2).violations
    assert tightened == pytest.approx({"airtime": 0.05, "speed_m_s": 0.01})
