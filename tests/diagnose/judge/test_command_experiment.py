"""The next commands: chosen for what they set apart, safe to play, and the same on every executor."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rigs
import tomli_w

from gaitopt.core.errors import GaitoptError
from gaitopt.core.json import to_json
from gaitopt.diagnose.judge.command_experiment import (
    Alternative,
    CommandExperiment,
    propose_commands,
)
from gaitopt.diagnose.judge.command_score import Separation
from gaitopt.diagnose.judge.command_search import travel_of
from gaitopt.diagnose.judge.command_settings import CommandSettings
from gaitopt.diagnose.record.commands import read_commands
from gaitopt.effects.active import Values
from gaitopt.gait.logged import LoggedCommands
from gaitopt.optimise.executors import SerialExecutor, open_executor, working
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.rollout import Simulator

FLOORS = {"joint.elbow": 0.004}
BRIEF = CommandSettings(shares=(0.06, 0.9), factors=(0.5,), finalists=1, leaders=1, robots=1, runners_up=3)
ALL: Values = {"target": "all"}

NONE = Alternative("none", 0.5, {})
WEAK = Alternative("torque limit", 0.5, {"servo_torque_limit": {"limit_n_m": 0.2, **ALL}})
DEAD = Alternative("dead band", 0.5, {"servo_deadband": {"half_width_rad": 0.02, **ALL}})
LATE = Alternative("latency", 0.4, {"command_latency": {"delay_s": 0.04}})
TIMED = Alternative("timing", 0.3, {"channel_timing": {"delay_s": 0.04, "target": "turn"}})


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """An arm on one calibrated servo."""
    folder = tmp_path_factory.mktemp("bench") / "rig"
    rigs.build(folder, rigs.arm(), {})
    path = folder / "problem.toml"
    content = tomllib.loads(path.read_text())
    del content["gait"], content["objective"], content["baselines"]
    content["channels"]["turn"] = {"range_deg": [-90.0, 90.0], "servo": {"neutral_us": 1500}}
    path.write_text(tomli_w.dumps(content))
    return load_problem(folder)


@pytest.fixture(scope="module")
def simulator(bench: Problem) -> Simulator:
    """The nominal arm."""
    return Simulator.build(bench)


def proposed(
    simulator: Simulator,
    alternatives: Sequence[Alternative],
    measured: Sequence[LoggedCommands] = (),
    floors: Mapping[str, float] = FLOORS,
    settings: CommandSettings = BRIEF,
    seed: int = 1,
) -> CommandExperiment:
    """The commands for some alternatives."""
    found = propose_commands(simulator, alternatives, measured, floors, SerialExecutor(), seed, settings)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def found(simulator: Simulator) -> CommandExperiment:
    """The commands that set a weak servo apart from the nominal one."""
    return proposed(simulator, [NONE, WEAK])


def test_the_distance_is_weighted_by_the_probabilities() -> None:
    distances = np.array([[0.0, 4.0, 1.0], [4.0, 0.0, 2.0], [1.0, 2.0, 0.0]])
    different = ~np.eye(3, dtype=bool)
    apart = Separation(distances, np.array([0.5, 0.3, 0.2]), different)
    assert apart.mean == pytest.approx((0.15 * 4.0 + 0.10 * 1.0 + 0.06 * 2.0) / 0.31)
    of_two = Separation(distances[:2, :2], np.array([0.5, 0.5]), different[:2, :2])
    assert of_two.mean == 4.0
    assert of_two.doubt == pytest.approx(1.0 / (1.0 + np.exp(8.0)))


def test_a_weak_servo_is_put_to_the_test_by_a_large_command(found: CommandExperiment) -> None:
    assert abs(found.chosen.made.amplitude_rad) > 0.5
    assert found.chosen.separation.mean > 3.0
    assert found.separates == ("none", "torque limit")
    assert found.before == 0.0
    assert found.inseparable == ()


@pytest.mark.slow
def test_a_floor_that_grows_with_the_motion_favours_a_small_command(simulator: Simulator) -> None:
    """The dead band shifts the angle by as much on small steps as on large ones."""
    found = proposed(simulator, [NONE, DEAD], settings=replace(BRIEF, motion_share=0.3))
    steps = [one for one in (found.chosen, *found.runners_up) if one.made.shape.name in ("step", "ramp")]
    assert steps
    assert all(abs(one.made.amplitude_rad) < 0.2 for one in steps)


def test_measured_commands_are_not_proposed_again(simulator: Simulator, found: CommandExperiment) -> None:
    again = proposed(simulator, [NONE, WEAK], [found.played.commands])
    assert again.played.commands.commands_key != found.played.commands.commands_key
    assert again.before == pytest.approx(found.chosen.separation.mean)
    assert again.chosen.separation.mean <= found.chosen.separation.mean


def test_what_no_command_parts_is_said(simulator: Simulator) -> None:
    """With one servo, all commands late and its command late are the same."""
    found = proposed(simulator, [LATE, TIMED, WEAK])
    assert found.inseparable == (("latency", "timing"),)
    assert found.separates == ("torque limit", "latency", "timing")


def test_one_explanation_is_narrowed_by_its_robots(simulator: Simulator) -> None:
    """Strong servos differ on no command that never needs their strength."""
    drawn = [
        Alternative("torque limit", 1.0, {"servo_torque_limit": {"limit_n_m": limit, **ALL}})
        for limit in (0.18, 0.2, 0.23)
    ]
    found = proposed(simulator, drawn)
    assert found.separates == ("torque limit",)
    assert abs(found.chosen.made.amplitude_rad) > 0.5
    assert found.chosen.separation.mean > 0.0
    assert found.inseparable == ()


def test_without_draws_a_parameter_is_made_a_little_larger(simulator: Simulator) -> None:
    found = proposed(simulator, [WEAK])
    assert found.separates == ("torque limit",)
    assert abs(found.chosen.made.amplitude_rad) > 0.5
    assert found.chosen.separation.distances.shape == (2, 2)


@pytest.mark.slow
def test_what_adds_nothing_that_commands_show_is_no_alternative(simulator: Simulator) -> None:
    """A servo that is weak, and late by a microsecond."""
    late = Alternative("both", 0.3, {**WEAK.effects, "command_latency": {"delay_s": 1e-6}})
    found = proposed(simulator, [WEAK, late])
    assert found.separates == ("torque limit",)
    assert found.inseparable == ()
    with_a_rival = proposed(simulator, [WEAK, late, DEAD])
    assert with_a_rival.separates == ("torque limit", "dead band")
    assert with_a_rival.inseparable == ()


def test_what_is_most_improbable_does_not_count(simulator: Simulator) -> None:
    unlikely = replace(DEAD, probability=1e-9)
    assert proposed(simulator, [NONE, WEAK, unlikely]).separates == ("none", "torque limit")


def test_nothing_to_set_apart_needs_no_commands(simulator: Simulator) -> None:
    assert propose_commands(simulator, [NONE], [], FLOORS, SerialExecutor()) is None
    assert propose_commands(simulator, [], [], FLOORS, SerialExecutor()) is None
    assert propose_commands(simulator, [NONE, WEAK], [], {}, SerialExecutor()) is None


def test_a_floor_of_nothing_is_one_line(simulator: Simulator) -> None:
    with pytest.raises(GaitoptError, match=r"floor of joint\.elbow: found 0; allowed: a positive number"):
        proposed(simulator, [NONE, WEAK], floors={"joint.elbow": 0.0})
    with pytest.raises(GaitoptError, match="found a probability of 0 or less"):
        proposed(simulator, [NONE, Alternative("other", 0.0, {})])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_workers_change_no_bit(simulator: Simulator, kind: str) -> None:
    one = proposed(simulator, [NONE, WEAK, DEAD])
    with working(open_executor(kind, 2)) as executor:
        other = propose_commands(simulator, [NONE, WEAK, DEAD], [], FLOORS, executor, 1, BRIEF)
    assert other is not None
    assert one.to_dict() == other.to_dict()
    assert one.played.to_csv() == other.played.to_csv()


def test_the_answer_is_what_a_diagnosis_writes(found: CommandExperiment) -> None:
    written = json.loads(to_json(found.to_dict()))
    assert written["gait"] is None
    assert written["commands"] == "next.csv"
    assert written["separates"] == ["none", "torque limit"]
    assert written["expected_separation"] == found.chosen.separation.mean
    rows = [written, *written["runners_up"]]
    assert len(rows) == 4
    assert all(
        {"shape", "channel", "amplitude_deg", "expected_separation", "doubt"} <= set(row) for row in rows
    )
    doubts = [round(row["doubt"], 4) for row in rows]
    assert doubts == sorted(doubts)
    assert "range_deg" in written["remarks"][0]


def test_the_table_is_a_log_of_the_same_commands(found: CommandExperiment, bench: Problem) -> None:
    Path("next.csv").write_text(found.played.to_csv())
    read = read_commands(Path("next.csv"), bench)
    assert read.commands_key == found.played.commands.commands_key
    low, high = travel_of(bench).ranges[0]
    powered = read.rows[np.isfinite(read.rows)]
    assert low <= powered.min() <= powered.max() <= high


def test_a_calibrated_servo_moves_no_further_than_its_pulses(bench: Problem) -> None:
    """11.1 us a degree from 1500 us: 1000 us are 90.09 degrees, so the range of 90 degrees counts."""
    assert np.allclose(np.rad2deg(travel_of(bench).ranges), [[-90.0, 90.0]])
    narrow = bench.to_dict()
    narrow["channels"]["turn"]["servo"] |= {"min_us": 1000}
    changed = Problem.from_file(type(bench.file).model_validate(narrow), bench.source, bench.model_path)
    assert np.allclose(np.rad2deg(travel_of(changed).ranges), [[-500.0 / 11.1, 90.0]])
