"""What is predicted of gaits: the speed over robots, and what no effect explains beside it."""

import math
import sys
from concurrent.futures import Executor
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from walks import recorded

from gaitopt.diagnose.judge.ensemble import Ensemble
from gaitopt.diagnose.judge.small_errors import perturbed_scenarios
from gaitopt.diagnose.predictions import Prediction, PredictionSettings, leftover_travel, predictions, widened
from gaitopt.diagnose.words import expectation
from gaitopt.effects.active import EffectValue
from gaitopt.gait.drive import Drive
from gaitopt.optimise.evaluator import Outcome, assess_all
from gaitopt.optimise.executors import open_executor
from gaitopt.optimise.robots import Expected
from gaitopt.problem.problem import Problem
from gaitopt.robot.signals import is_position
from gaitopt.simulation.metrics import SPEED
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import NOMINAL
from gaitopt.simulation.setup import RobotSetup
from gaitopt.simulation.tolerances import NO_ERRORS

ROBOTS = 14
"""Robots that are a little wrong in everything; recordings tell nothing of them."""


def causes(
    problem: Problem, drives: list[Drive], slope: float, *, forward: bool = True, left: float | None = None
) -> Any:
    """What was found, with trials that are left with a slope, m/s, along forward or across it.

    With `left`, a mean whitened square, the robot is a little wrong in everything.
    """
    trials, marker = [], []
    for drive in drives:
        trial = recorded()
        axis = "xyz"[int(np.argmax(np.abs(problem.roles.axes[0])))] if forward else "z"
        series = trial.signals["marker.x"]
        name = f"marker.{axis}"
        trial = SimpleNamespace(
            drive=drive,
            time=trial.time,
            signals={name: series},
            used={name: np.ones(len(series), dtype=bool)},
        )
        trials.append(SimpleNamespace(aligned=SimpleNamespace(trial=trial)))
        marker.append(slope * (trial.time - trial.time.mean()))
    first = SimpleNamespace(marker=np.concatenate(marker), angles=np.empty(0), left=lambda trial_set: left)
    simulator = Simulator.build(problem)
    trial_set = SimpleNamespace(problem=problem, trials=trials, simulator=simulator)
    judgement = SimpleNamespace(tolerant=left is not None)
    blind = Ensemble(np.zeros((ROBOTS, 1)), np.zeros(1), tuple(range(ROBOTS)))
    return SimpleNamespace(
        best=first,
        none=first,
        trial_set=trial_set,
        judgement=judgement,
        other_probability=0.1,
        ensemble=blind if judgement.tolerant else None,
        seed=1,
    )


def test_what_is_left_is_an_error_of_the_travel_per_cycle(strider: Problem) -> None:
    gait = strider.baselines["stride"]
    two = [gait.with_period(2.0), gait.with_period(1.0)]
    left = leftover_travel(causes(strider, two, 1e-3))
    assert left == pytest.approx(2.920 * math.sqrt((2e-3**2 + 1e-3**2) / 2.0), rel=1e-3)
    repeats = leftover_travel(causes(strider, [*two, *two], 1e-3))
    assert repeats == pytest.approx(left)  # repeats of a gait tell nothing of other gaits


def test_what_the_tolerances_allow_is_no_part_of_what_is_left(strider: Problem) -> None:
    gaits = [strider.baselines["stride"]]
    usual, allowed, half = (leftover_travel(causes(strider, gaits, 1e-3, left=n)) for n in (None, 0.9, 4.0))
    assert allowed == pytest.approx(0.1 * usual)  # as probable as another cause
    assert half == pytest.approx(usual * np.sqrt(0.75))


def test_the_tolerances_widen_what_is_expected(strider: Problem) -> None:
    """The middle 90 % of robots that differ in their start pose alone are less far apart."""
    stride = strider.baselines["stride"]
    found = causes(strider, [stride], 0.0, left=0.5)
    made = perturbed_scenarios(found.trial_set.simulator, 1, ROBOTS)
    poses = [replace(one, errors=NO_ERRORS) for one in made]
    posed = RobotSetup.of(strider, poses, strider.simulation.working)
    with open_executor("serial", 1) as pool:
        walks = assess_all([(posed, stride, index) for index in range(ROBOTS)], pool)
        row = predictions(found, [()] * ROBOTS, pool, 1)[0]
    low, high = np.quantile([walk.metrics[SPEED.name] for walk in walks], (0.05, 0.95))
    assert row.speed is not None
    assert row.speed.ci90[1] - row.speed.ci90[0] > 2.0 * (high - low)


def test_without_forward_motion_nothing_is_left(strider: Problem) -> None:
    assert leftover_travel(causes(strider, [strider.baselines["stride"]], 1e-3, forward=False)) == 0.0


def test_an_interval_holds_both_errors() -> None:
    wide = widened(Expected(10.0, (7.0, 12.0)), 4.0)
    assert wide.mean == 10.0
    assert wide.ci90 == pytest.approx((5.0, 10.0 + math.sqrt(20.0)))


def test_baselines_and_filmed_gaits_are_predicted_over_the_robots(strider: Problem) -> None:
    other = strider.baselines["stride"].with_period(0.7)
    found = causes(strider, [strider.baselines["stride"], other], 0.0)
    robots = [(EffectValue("servo_gain", "all", gain),) for gain in (0.5, 0.7, 0.9, 1.2)]
    with open_executor("threads", 2) as executor:
        rows = predictions(found, robots, executor, 1, PredictionSettings(robots=4))
        nominal = predictions(found, [()] * 4, executor, 1, PredictionSettings(robots=4))
    assert [(row.gait, row.filmed) for row in rows] == [
        ("stride", True),
        ("square", False),
        ("stride (2)" if other.name == "stride" else other.name, True),
    ]
    for row, plain in zip(rows, nominal, strict=True):
        assert row.speed is not None
        assert plain.speed is not None
        low, high = row.speed.ci90
        assert low < row.speed.mean < high
        assert row.nominal_m_s == plain.nominal_m_s
        assert row.speed.mean != plain.speed.mean
        content = row.to_dict()
        assert content["speed_m_s"] == {"mean": row.speed.mean, "ci90": [low, high]}


@pytest.mark.parametrize("left", [None, 0.5])
def test_robots_are_simulated_as_they_differ_from_a_correct_model(
    strider: Problem, left: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With small errors of masses and hinges or of everything, and some with half the timestep."""
    done: list[tuple[RobotSetup, Drive, int]] = []

    def assess(work: list[tuple[RobotSetup, Drive, int]], executor: Executor) -> list[Outcome]:
        done.extend(work)
        return assess_all(work, executor)

    monkeypatch.setattr(sys.modules[Prediction.__module__], "assess_all", assess)
    found = causes(strider, [strider.baselines["stride"]], 0.0, left=left)
    with open_executor("threads", 2) as pool:
        predictions(found, [()] * ROBOTS, pool, 1, PredictionSettings(robots=ROBOTS))
    (nominal, _, first), *others = done[: ROBOTS + 1]
    step_s = strider.simulation.working.timestep_s
    assert nominal.scenarios[first] == NOMINAL
    assert nominal.fidelity.timestep_s == step_s
    errors = [setup.scenarios[index].errors for setup, _, index in others]
    assert len({one.mass for one in errors}) == ROBOTS
    assert {bool(one.friction) for one in errors} == {left is not None}
    finer = [setup.fidelity.timestep_s == 0.5 * step_s for setup, _, _ in others]
    assert finer == [index % 2 == 1 if left is None else index % 4 == 1 for index in range(ROBOTS)]


def test_the_gait_of_a_misfit_is_predicted_by_the_others(strider: Problem) -> None:
    stride, square = strider.baselines["stride"], strider.baselines["square"].with_period(0.9)
    found = causes(strider, [stride], 0.0)
    slipped: Any = SimpleNamespace(drive=square)
    with open_executor("serial", None) as executor:
        rows = predictions(found, [()], executor, 1, PredictionSettings(robots=1), misfits=[slipped])
    assert [(row.gait, row.filmed) for row in rows][-1] == (
        "square (2)" if square.name == "square" else square.name,
        True,
    )
    assert rows[-1].speed is not None


def test_a_log_has_the_error_that_is_left_of_it(strider: Problem) -> None:
    drive: Any = SimpleNamespace(key="log", name="log", period_s=None)
    found = causes(strider, [drive], 2e-3)
    with open_executor("serial", None) as executor:
        *_, row = predictions(found, [()], executor, 1, PredictionSettings(robots=1))
    ((name, one),) = row.rms.items()
    assert is_position(name)
    assert one.mean == pytest.approx(float(np.sqrt(np.mean(np.square(found.best.marker)))))
    assert one.ci90[0] < one.mean < one.ci90[1]
    assert (row.gait, row.filmed, row.speed) == ("log", True, None)


def test_predictions_are_said_in_one_sentence() -> None:
    rows: Any = [
        Prediction("fast", True, Expected(0.03, (0.025, 0.0345)), 0.02),
        Prediction("slow", False, Expected(0.008, (0.007, 0.009)), 0.008),
    ]
    said = expectation(SimpleNamespace(predictions=rows))  # type: ignore[arg-type]
    assert said == [
        "Expected speeds in mm/s, with 90 % intervals: fast 30.0 (25.0 to 34.5), slow 8.0 (7.0 to 9.0) "
        "(not filmed)."
    ]
    logs: Any = [Prediction(f"log {i}", True, rms={"joint.a": Expected(0.01 * i, (0, 1))}) for i in (1, 2)]
    (text,) = expectation(SimpleNamespace(predictions=logs))  # type: ignore[arg-type]
    assert text.startswith("Expected RMS error where the same is recorded again: joint.a 0.01 rad")
    assert expectation(SimpleNamespace(predictions=())) == []  # type: ignore[arg-type]
