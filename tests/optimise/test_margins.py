"""How far a winner stays from its limits, from the bounds of the search, and from straight."""

from dataclasses import replace

import numpy as np
import pytest

from gaitopt.optimise.margins import at_bounds, closest, margins
from gaitopt.optimise.notes import warnings_of
from gaitopt.optimise.verification import Verified
from gaitopt.problem.objective import Constraint
from gaitopt.problem.problem import Problem
from gaitopt.simulation.audit.finding import Finding
from gaitopt.simulation.metrics import Metrics, mean_metrics
from gaitopt.simulation.objective import evaluate

AIRTIME, TILT = [0.10, 0.19, 0.30], [0.2, 0.2, 0.2]


@pytest.fixture
def limited(strider: Problem) -> Problem:
    """A problem with two limits."""
    assert strider.file.objective is not None
    limits = {"airtime": Constraint(max=0.2, scale=0.1), "tilt_rad": Constraint(max=0.8, scale=0.1)}
    objective = strider.file.objective.model_copy(update={"constraints": limits})
    return strider._with(strider.file.model_copy(update={"objective": objective}))


def verified(problem: Problem, **more: float) -> Verified:
    """A gait in three scenarios: in one of them it is too long in the air."""
    usual = {"speed_m_s": 0.1, "reached": 1.0, "sideways_ratio": 0.02} | more
    rows: list[Metrics] = [
        usual | {"airtime": air, "tilt_rad": tilt} for air, tilt in zip(AIRTIME, TILT, strict=True)
    ]
    evaluation = replace(evaluate(problem, rows, ["ok"] * 3), metrics=mean_metrics(rows))
    gait = problem.space.decode(np.full(len(problem.space.variables), 0.5))
    return Verified(gait, evaluation, np.full(3, 0.1), 1.0, tuple(rows))


def said(problem: Problem, best: Verified, *findings: Finding) -> str:
    """All warnings of a winner."""
    return " ".join(warnings_of(problem, best, margins(problem, best), findings))


def test_a_margin_is_what_the_mean_leaves_of_the_limit(limited: Problem) -> None:
    air, tilt = margins(limited, verified(limited))
    assert (air.constraint, tilt.constraint) == ("airtime", "tilt_rad")
    assert air.margin == pytest.approx((0.2 - np.mean(AIRTIME)) / 0.2)
    assert (air.worst, air.broken_in, air.scenarios, air.allowed) == (0.30, (3,), 3, "at most 20 %")
    assert tilt.margin == pytest.approx(0.75)
    assert tilt.broken_in == ()
    assert closest([air, tilt]) == [air]


def test_a_winner_in_the_middle_of_its_space_is_at_no_bound(limited: Problem) -> None:
    assert at_bounds(limited.space, verified(limited).gait) == ()


def test_the_bounds_that_a_winner_is_at_are_named(limited: Problem) -> None:
    point = np.full(len(limited.space.variables), 0.5)
    point[0] = 0.0
    found = at_bounds(limited.space, limited.space.decode(point))
    assert found == (("period_s", "lower"),)


def test_a_limit_on_every_scenario_is_held_against_the_worst(limited: Problem) -> None:
    objective = limited.objective.model_copy(update={"limits_over_scenarios": "worst"})
    strict = limited._with(limited.file.model_copy(update={"objective": objective}))
    air = margins(strict, verified(strict))[0]
    assert (air.value, air.margin) == pytest.approx((0.30, -0.5))


def test_an_amplitude_of_all_of_a_servos_travel_is_at_no_bound_of_the_search(limited: Problem) -> None:
    space = limited.space
    names = [variable.name for variable in space.variables]
    for name in names:
        if name.endswith("amplitude_deg"):
            low, high = space.channels[name.partition(".")[0]].range_deg
            point = np.full(len(names), 0.5)
            point[names.index(name)] = 1.0
            bound = space.channels[name.partition(".")[0]].amplitude_deg[1]
            expected = () if abs(bound) >= high - low else ((name, "upper"),)
            assert at_bounds(space, space.decode(point)) == expected


def test_warnings_say_what_is_close_broken_not_straight_and_found_by_the_audit(limited: Problem) -> None:
    calm = said(limited, verified(limited))
    assert "the limit on time in the air by 1.7% only: 19.7 %, allowed: at most 20 %" in calm
    assert "breaks the limit on time in the air in 1 of 3 scenarios: 3" in calm
    assert "sideways" not in calm
    finding = Finding(
        "command_not_followed", "best", 0.6, 0.95, "rear reaches 60% of its travel", servo="rear"
    )
    odd = said(limited, verified(limited, sideways_ratio=0.36), finding)
    assert "0.36 mm sideways" in odd
    assert "`gaitopt check` finds that rear reaches 60%" in odd


def test_servos_that_do_not_follow_are_one_warning(limited: Problem) -> None:
    shares = {"a": 0.9, "b": 0.5, "c": 0.7, "d": 0.8, "e": 0.94}
    late = [
        Finding("command_not_followed", "best", share, 0.95, f"{name} reaches", servo=name)
        for name, share in shares.items()
    ]
    drift = Finding("sideways_drift", "best", 0.6, 0.35, "it drifts")
    odd = said(limited, verified(limited), *late, drift)
    assert odd.count("`gaitopt check` finds that") == 2
    assert "5 servos do not reach their commanded travel: b 50%, c 70%, d 80% of it and 2 more" in odd
    assert "finds that it drifts" in odd


def test_a_gait_that_failed_has_no_margins(limited: Problem) -> None:
    failed = verified(limited)
    failed = replace(failed, evaluation=replace(failed.evaluation, status="diverged at 1 s"))
    assert margins(limited, failed) == ()
