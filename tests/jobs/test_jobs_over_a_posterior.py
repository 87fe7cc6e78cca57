"""Jobs on robots of a posterior: which robots are simulated, and what is said of them."""

import json
from pathlib import Path

import numpy as np
import pytest
from helpers import STRIDER, same_bits
from posteriors import WEAK, diagnosed

from gaitopt import Stopped, compare, optimise, simulate, sweep
from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.core.streams import Stream
from gaitopt.optimise.evaluator import assess
from gaitopt.optimise.recorder import Recorder
from gaitopt.optimise.run import Request
from gaitopt.optimise.verification import evenly, scenarios_of
from gaitopt.problem.problem import Problem
from gaitopt.runs.posterior import with_posterior
from gaitopt.runs.run_folder import RunFolder
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import NOMINAL, Scenario
from gaitopt.simulation.setup import RobotSetup, prepared
from gaitopt.simulation.tolerances import SmallErrors

SLIPPERY = SmallErrors(friction=(0.9,) * 3)

Printed = pytest.CaptureFixture[str]


@pytest.fixture
def over(strider: Problem) -> Problem:
    return with_posterior(strider, diagnosed(Path("dg")))


def test_a_scenario_with_a_robot_of_its_own_simulates_that_robot(over: Problem) -> None:
    gait, fidelity = over.baselines["square"], over.simulation.working
    robot = over.robots[0]
    setup = RobotSetup.of(over, [NOMINAL, Scenario(SLIPPERY, effects=robot)], fidelity)
    plain, own = prepared(setup, 0), prepared(setup, 1)
    affected = Simulator.build(over.as_robot(robot), [Scenario(SLIPPERY)], fidelity)
    assert same_bits(own.simulator.run(gait, own.scenario), affected.run(gait))
    assert same_bits(plain.simulator.run(gait, plain.scenario), Simulator.build(over).run(gait))
    assert assess(setup, gait, 0).metrics != assess(setup, gait, 1).metrics


def test_scenarios_keep_their_draws_and_take_other_robots_each(strider: Problem, over: Problem) -> None:
    streams = (Stream.SEARCH_SCENARIOS, Stream.SELECTION_SCENARIOS, Stream.VERIFICATION_SCENARIOS)
    drawn = [scenarios_of(over, 1, stream) for stream in streams]
    for stream, scenarios in zip(streams, drawn, strict=True):
        assert [one.errors for one in scenarios] == [one.errors for one in scenarios_of(strider, 1, stream)]
        assert all(one.effects in over.robots for one in scenarios)
    robots = [one.effects for scenarios in drawn for one in scenarios]
    assert len(set(robots[:16])) == min(16, len(robots))
    assert drawn == [scenarios_of(over, 1, stream) for stream in streams]
    assert drawn != [scenarios_of(over, 2, stream) for stream in streams]


def test_robots_are_taken_evenly() -> None:
    robots = list(range(10))
    assert evenly(robots, 10) == robots  # type: ignore[arg-type, comparison-overlap]
    assert evenly(robots, 4) == [0, 2, 5, 7]  # type: ignore[arg-type, comparison-overlap]


def test_a_simulation_gives_the_robots_in_place_of_the_nominal_one(strider: Problem, capsys: Printed) -> None:
    folder = diagnosed(Path("dg"))
    plain, rollout = simulate(strider, "square"), simulate(strider, "square", posterior=folder)
    assert rollout.metrics == plain.metrics
    speeds = []
    for effects in with_posterior(strider, folder).robots:
        robot = strider.as_robot(effects)
        speeds.append(simulate(robot, "square").metrics["speed_m_s"])
    assert rollout.over_robots is not None
    speed = rollout.over_robots.metrics["speed_m_s"]
    assert speed.mean == pytest.approx(np.mean(speeds), rel=1e-12)
    assert speed.ci90 == pytest.approx(tuple(np.quantile(speeds, (0.05, 0.95), method="weibull")), rel=1e-12)
    assert cli.main(["simulate", str(STRIDER), "square", "--posterior", "dg", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["rows"][0]["speed_m_s"] == speed.mean
    assert printed["rows"][0]["nominal"]["speed_m_s"] == plain.metrics["speed_m_s"]
    assert printed["posterior"]["metrics"]["speed_m_s"] == {"mean": speed.mean, "ci90": list(speed.ci90)}
    assert (printed["posterior"]["robots"], printed["posterior"]["failed"]) == (16, 0)
    assert cli.main(["simulate", str(STRIDER), "square", "--posterior", "dg"]) == 0
    assert "mean of 16" in capsys.readouterr().out


def test_intervals_of_a_comparison_hold_the_robots(strider: Problem) -> None:
    rows = compare(strider, ["square", "stride"], posterior=diagnosed(Path("dg")))
    speeds = [np.array(row.scenario_speeds_m_s) for row in rows]
    assert [len(one) for one in speeds] == [16, 16]
    assert rows[1].speed_ci90_m_s == pytest.approx(
        tuple(np.quantile(speeds[1], (0.05, 0.95), method="weibull"))
    )
    apart = speeds[1] - speeds[0]
    assert rows[1].difference_ci90_m_s == pytest.approx(
        tuple(np.quantile(apart, (0.05, 0.95), method="weibull"))
    )
    assert rows[0].to_dict()["robots"] == 16
    assert "robots" not in compare(strider, ["square"])[0].to_dict()


def test_a_sweep_gives_the_robots_at_each_value(strider: Problem, capsys: Printed) -> None:
    folder = diagnosed(Path("dg"))
    rows = sweep(strider, "square", over="period_s=0.5,1", posterior=folder).rows
    plain = sweep(strider, "square", over="period_s=0.5,1").rows
    assert [row.metrics for row in rows] == [row.metrics for row in plain]
    assert [row.over_robots.robots for row in rows if row.over_robots] == [16, 16]
    printed, over = rows[0].to_dict(), rows[0].over_robots
    assert over is not None
    assert printed["speed_m_s"] == over.metrics["speed_m_s"].mean != plain[0].metrics["speed_m_s"]
    assert printed["nominal"]["speed_m_s"] == plain[0].metrics["speed_m_s"]
    arguments = ["sweep", str(STRIDER), "square", "--over", "period_s=0.5", "--posterior", "dg", "--out", "s"]
    assert cli.main(arguments) == 0
    assert "their speed" in capsys.readouterr().out


@pytest.mark.slow
def test_a_search_over_a_posterior_is_resumed_without_its_diagnosis(
    strider: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = diagnosed(Path("dg"))
    whole = optimise(strider, budget=6, seed=5, posterior=folder)
    assert whole.summary.robots == 16
    assert "robots of a posterior were used" in whole.summary.notes[0]
    assert whole.summary.best != optimise(strider, budget=6, seed=5).summary.best
    assess_batch, done = Recorder._assess, []

    def interrupted(self: Recorder, *arguments: object) -> object:
        if done:
            raise KeyboardInterrupt
        done.append(arguments)
        return assess_batch(self, *arguments)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr(Recorder, "_assess", interrupted)
        with pytest.raises(Stopped):
            optimise(strider, budget=6, seed=5, posterior=folder, out="run")
    for path in folder.iterdir():
        path.unlink()
    resumed = optimise(resume="run")
    assert resumed.summary.best == whole.summary.best
    assert "each on one of 16 robots of a posterior" in Path("run/report.html").read_text()
    assert json.loads(Path("run/summary.json").read_text())["robots"] == 16


def test_a_run_says_when_its_robots_were_changed(strider: Problem) -> None:
    over = with_posterior(strider, diagnosed(Path("dg")))
    with RunFolder.create(Path("run"), over, Request(budget=4)) as folder:
        folder.open_journal(over)
        folder.journal.write_text(folder.journal.read_text() + "1\n")  # so that it is kept
    path = Path("run/posterior.csv")
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))
    with pytest.raises(GaitoptError, match=r"run.toml: robots: found 16; allowed: 15, as in posterior.csv"):
        RunFolder.reopen(Path("run"))
    path.unlink()
    with pytest.raises(GaitoptError, match=r"posterior.csv"):
        RunFolder.reopen(Path("run"))


def test_a_run_without_a_posterior_says_nothing_of_robots(strider: Problem) -> None:
    with RunFolder.create(Path("run"), strider, Request(budget=4)):
        assert "robots" not in Path("run/run.toml").read_text()
        assert not Path("run/posterior.csv").exists()


@pytest.mark.slow
def test_the_posterior_is_not_chosen_again_on_resuming(strider: Problem) -> None:
    optimise(strider, budget=1, warm_start=False, out="run")
    with pytest.raises(GaitoptError, match=r"--posterior: not with --resume, which takes it from run"):
        optimise(posterior="dg", resume="run")


@pytest.mark.parametrize("command", ["simulate", "compare", "sweep", "optimise"])
def test_a_wrong_posterior_is_one_line_of_every_command(command: str, capsys: Printed) -> None:
    diagnosed(Path("dg"), WEAK.replace("servo_gain", "servo_gian"))
    more = {"sweep": ["--over", "period_s=1"], "optimise": []}.get(command, [])
    gait = [] if command == "optimise" else ["square"]
    assert cli.main([command, str(STRIDER), *gait, *more, "--posterior", "dg"]) == 1
    assert "unknown effect in column 'servo_gian'" in capsys.readouterr().err
    assert [path.name for path in Path().iterdir()] == ["dg"]
