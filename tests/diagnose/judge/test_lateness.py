"""Delays of commands by chance are found and sized from how repeats differ."""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benches import Series, bench, located, write_bench

from gaitopt.diagnose.diagnosis import DiagnosisRequest
from gaitopt.diagnose.fit.runner import Runner
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.find_causes import NominalGap, prepare_trials
from gaitopt.diagnose.judge.lateness import Lateness, find_lateness
from gaitopt.diagnose.judge.posterior import draw_robots
from gaitopt.effects.library.jitter import COMMAND_JITTER
from gaitopt.gait.logged import LoggedCommands
from gaitopt.jobs.diagnose import Question
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator

REPEATS = {"step": 3, "square": 3, "telegraph": 3}


def late_by_chance(sd_s: float) -> Callable[[LoggedCommands, np.random.Generator], LoggedCommands]:
    """Each change after the first late by its own time: uniform from none, with this standard deviation."""

    def played(drive: LoggedCommands, rng: np.random.Generator) -> LoggedCommands:
        time = drive.changes
        waits = np.sqrt(12.0) * sd_s * rng.random(len(time))
        return replace(drive, time=time + np.where(time > 0.0, waits, 0.0), rows=drive.targets(time))

    return played


def lateness(problem: Problem, folder: Path) -> Lateness | None:
    """What the repeats of a data set say, by the nominal robot."""
    found = located(problem, folder)
    trials, floors = zip(*[(one.aligned, one.floors) for one in found.trials], strict=True)
    simulator = Simulator.build(problem)
    with ThreadPoolExecutor(1) as executor:
        gap = NominalGap(simulator, trials, floors, 0.0)
        ready = prepare_trials(gap, Context(Runner(executor), 1)).trial_set.trials
        return find_lateness(simulator, ready, floors, executor)


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    return bench(tmp_path_factory.mktemp("bench") / "problem")


@pytest.mark.parametrize("sd_s", [0.003, 0.01])
def test_the_spread_of_delays_is_measured(problem: Problem, tmp_path: Path, sd_s: float) -> None:
    write_bench(tmp_path / "data", problem, trials=REPEATS, played=late_by_chance(sd_s))
    found = lateness(problem, tmp_path / "data")
    assert found is not None
    assert found.ci90[0] < sd_s < found.ci90[1]
    assert found.ci90[1] < 2.0 * found.ci90[0]
    assert found.explained > 0.9


def test_delays_as_long_as_a_reversal_are_measured_though_what_they_do_does_not_add_up(
    problem: Problem, tmp_path: Path
) -> None:
    write_bench(tmp_path / "data", problem, trials=REPEATS, played=late_by_chance(0.025))
    found = lateness(problem, tmp_path / "data")
    assert found is not None
    assert found.ci90[0] < 0.025 < found.ci90[1]
    assert found.ci90[1] < 2.0 * found.ci90[0]


def test_no_delays_are_found_where_repeats_agree(problem: Problem, tmp_path: Path) -> None:
    write_bench(tmp_path / "data", problem, trials=REPEATS)
    assert lateness(problem, tmp_path / "data") is None


def test_no_delays_are_found_where_repeats_differ_in_another_way(problem: Problem, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)

    def drifting(time: Series, response: Callable[[Series], Series]) -> Series:
        wander = np.cumsum(rng.standard_normal(len(time)))
        moved: Series = response(time) + 3e-3 * wander
        return moved

    write_bench(tmp_path / "data", problem, drifting, REPEATS)
    assert lateness(problem, tmp_path / "data") is None


def test_repeats_with_other_signals_are_compared_by_those_that_they_share(
    problem: Problem, tmp_path: Path
) -> None:
    """A sensor that failed in one repeat."""
    write_bench(tmp_path / "data", problem, trials={"square": 2}, played=late_by_chance(0.01))
    file, table = tmp_path / "data" / "dataset.toml", tmp_path / "data" / "square-1.csv"
    file.write_text(file.read_text().replace('"joint.', '"site.tip.x" = "tip_x_m"\n"joint.', 1))
    lines = table.read_text().splitlines()
    table.write_text("\n".join([lines[0] + ",tip_x_m", *(line + ",0.1" for line in lines[1:])]))
    assert lateness(problem.observing(["tip"]), tmp_path / "data") is not None


def test_delays_need_repeats(problem: Problem, tmp_path: Path) -> None:
    once = dict.fromkeys(REPEATS, 1)
    write_bench(tmp_path / "data", problem, trials=once, played=late_by_chance(0.01))
    assert lateness(problem, tmp_path / "data") is None


@pytest.mark.slow
def test_a_diagnosis_names_jitter_and_not_the_latency_that_stands_in_for_it(
    problem: Problem, tmp_path: Path
) -> None:
    played = late_by_chance(0.008)
    folder = write_bench(tmp_path / "data", problem, trials=REPEATS, played=played)
    tried = [COMMAND_JITTER.name, "command_latency", "servo_gain", "servo_damping"]
    with ThreadPoolExecutor(1) as executor:
        question = Question.of(problem, folder, DiagnosisRequest(1, tried, False))
        found = question.answered(executor, lambda progress: None)
    assert found.verdict in ("explained", "partly_explained")
    assert COMMAND_JITTER.name in found.causes
    assert "command_latency" not in found.causes
    assert found.found is not None
    (row,) = [one for one in found.found.effects if one.name == COMMAND_JITTER.name]
    low, high = row.parameter.ci90
    assert low < 0.008 < high
    drawn = [one.value for robot in draw_robots(found.found, 1) for one in robot if one.name == row.name]
    assert np.quantile(drawn, (0.05, 0.95)) == pytest.approx((low, high), abs=0.3 * (high - low))


def test_the_mean_of_delays_by_chance_is_known_less_well_than_their_spread() -> None:
    lateness = Lateness(0.005, (0.004, 0.006), 1.0, 0.0)
    less, more = lateness.delay_shift
    uniform, wider, queue = math.sqrt(3.0) * 0.005, math.sqrt(3.0) * 0.006, 0.004
    assert uniform + (0.0 - less) == pytest.approx(wider)
    assert uniform - more == pytest.approx(queue)
