"""The objective: named terms, named constraints, all reported."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gaitopt.core.errors import GaitoptError
from gaitopt.core.validation import validated
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.objective import Objective
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.records import ProblemFile
from gaitopt.runs.folder import write_problem
from gaitopt.simulation.metrics import Metrics, metric_names
from gaitopt.simulation.objective import FAILED_COST, check_objective, evaluate


def aiming(problem: Problem, **objective: object) -> Problem:
    """The problem with another objective."""
    file = problem.file.model_copy(update={"objective": Objective.model_validate(objective)})
    return Problem.from_file(file, problem.source, problem.model_path)


def row(problem: Problem, **values: float) -> Metrics:
    """Metrics that are 0 unless said otherwise."""
    names = metric_names(problem)
    return dict.fromkeys(names, 0.0) | values


def test_the_cost_is_the_weighted_sum_of_mean_metrics(strider: Problem) -> None:
    problem = aiming(strider, terms={"speed_m_s": -2.0, "power_w": 0.5})
    rows = [row(problem, speed_m_s=0.1, power_w=1.0), row(problem, speed_m_s=0.3, power_w=3.0)]
    evaluation = evaluate(problem, rows, ["ok", "ok"])
    assert evaluation.cost == pytest.approx(-2.0 * 0.2 + 0.5 * 2.0)
    assert evaluation.metrics["speed_m_s"] == pytest.approx(0.2)
    assert evaluation.constraints_met
    assert evaluation.violations == {}


def test_limits_may_have_a_rule_of_their_own(strider: Problem) -> None:
    aims = {"terms": {"speed_m_s": -1.0}, "constraints": {"airtime": {"max": 0.2, "scale": 0.1}}}
    rows = [row(strider, speed_m_s=0.1, airtime=0.0), row(strider, speed_m_s=0.3, airtime=0.3)]
    together = evaluate(aiming(strider, **aims), rows, ["ok"] * 2)
    each = evaluate(aiming(strider, **aims, limits_over_scenarios="worst"), rows, ["ok"] * 2)
    assert together.constraints_met
    assert each.violations["airtime"] == pytest.approx(1.0)
    assert each.cost == pytest.approx(together.cost + 1.0)


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


def test_the_worst_scenario_or_a_quantile_counts_where_the_problem_says_so(strider: Problem) -> None:
    """This holds for the cost and each limit; the reported metrics stay means."""
    limits = {"airtime": {"max": 0.1, "scale": 0.1}}
    values = [(0.5, 0.1), (0.2, 0.0), (0.4, 0.0), (0.3, 0.3), (0.1, 0.2)]
    rows = [row(strider, speed_m_s=speed, airtime=airtime) for speed, airtime in values]
    expected: dict[object, tuple[float, float]] = {
        "worst": (-0.1, 2.0),
        0.0: (-0.1, 2.0),
        0.25: (-0.2, 1.0),
        0.3: (-0.22, 0.8),
        0.5: (-0.3, 0.0),
        "mean": (-0.3, 0.2),
    }
    for rule, (cost, violation) in expected.items():
        asked = rule if isinstance(rule, str) else {"quantile": rule}
        aims = {"terms": {"speed_m_s": -1.0}, "constraints": limits, "penalty": 2.0}
        evaluation = evaluate(aiming(strider, over_scenarios=asked, **aims), rows, ["ok"] * 5)
        assert evaluation.violations == pytest.approx({"airtime": violation}, abs=1e-9), rule
        assert evaluation.cost == pytest.approx(cost + 2.0 * violation), rule
        assert evaluation.metrics["speed_m_s"] == pytest.approx(0.3)


def test_mean_is_the_default_and_changes_no_bit(strider: Problem) -> None:
    rows = [row(strider, speed_m_s=1.0 / (3.0 + i), power_w=0.1 * i) for i in range(7)]
    terms = {"speed_m_s": -1.0, "power_w": 0.3}
    default, mean = aiming(strider, terms=terms), aiming(strider, terms=terms, over_scenarios="mean")
    means = [float(np.mean([row[name] for row in rows])) for name in terms]
    expected = -1.0 * means[0] + 0.3 * means[1]
    assert evaluate(default, rows, ["ok"] * 7).cost == evaluate(mean, rows, ["ok"] * 7).cost == expected


def test_an_infinite_cost_of_one_scenario_is_a_failure_of_no_other_kind(strider: Problem) -> None:
    rows = [row(strider, cost_of_transport=value) for value in (1.0, math.inf)]
    for rule in ("worst", {"quantile": 0.25}, {"quantile": 0.5}):
        problem = aiming(strider, terms={"cost_of_transport": 1.0}, over_scenarios=rule)
        assert evaluate(problem, rows, ["ok", "ok"]).cost == FAILED_COST


@pytest.mark.parametrize("rule", ["median", {"quantile": 0.6}, {"quantile": True}, {"share": 0.1}, 0.2])
def test_a_wrong_rule_over_scenarios_is_one_line(strider: Problem, rule: object) -> None:
    content = strider.to_dict() | {"objective": {"terms": {"speed_m_s": -1.0}, "over_scenarios": rule}}
    with pytest.raises(GaitoptError) as error:
        validated(ProblemFile, content, "problem.toml")
    assert str(error.value) == (
        f"problem.toml: objective.over_scenarios: found {rule!r}; "
        'allowed: "mean", "worst" or { quantile = 0 to 0.5 }'
    )


def test_the_rule_over_scenarios_survives_a_run_folder(strider: Problem, tmp_path: Path) -> None:
    problem = aiming(strider, terms={"speed_m_s": -1.0}, over_scenarios={"quantile": 0.2})
    write_problem(tmp_path, problem, nominal_mjcf(problem))
    assert load_problem(tmp_path).file.objective == problem.objective


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
