"""Simulations that fail: a status with a reason, which is counted; the study continues, or says why not."""

import functools
import json
import re
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import STRIDER, edited, problem_folder, same_bits

from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.gait.gait import Gait, write_gait
from gaitopt.optimise import evaluator
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.quasi_random import quasi_random
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.robot.trajectory import Trajectory
from gaitopt.runs.run_folder import RunFolder
from gaitopt.simulation.rollout import RolloutSettings, Simulator
from gaitopt.simulation.scenario import NOMINAL
from gaitopt.simulation.setup import RobotSetup

OPTION = '<option cone="elliptic" impratio="10"/>'
MEMORY = "mj_stackAlloc: out of memory, stack overflow at PrimalAllocate, line "


def strider_with(folder: Path, old: str, new: str) -> Problem:
    problem_folder(folder, STRIDER)
    edited(folder / "strider.xml", old, new)
    return load_problem(folder)


def granted(folder: Path, memory: str) -> Problem:
    """The strider with this much memory for contacts and solver."""
    return strider_with(folder, OPTION, f'{OPTION}<size memory="{memory}"/>')


def statuses(problem: Problem, count: int = 6) -> list[str]:
    setting = RobotSetup.of(problem, (NOMINAL,), problem.simulation.working)
    gaits = [problem.space.decode(point) for point in quasi_random(problem.space, count, 1)]
    return [one.evaluation.status for one in Evaluator(setting, SerialExecutor())(gaits)]


def here(*arguments: object) -> int:
    return cli.main([str(argument) for argument in arguments])


def test_nan_is_a_status(tmp_path: Path) -> None:
    hinge = 'name="rear_hip" type="hinge"'
    assert set(statuses(strider_with(tmp_path / "robot", hinge, f'{hinge} armature="nan"'))) == {
        "diverged: badqacc"
    }


def test_a_warning_of_mujocos_is_a_status(tmp_path: Path) -> None:
    assert set(statuses(granted(tmp_path / "robot", "2K"))) == {"diverged: contactfull, cnstrfull"}


def test_a_gait_that_exhausts_the_memory_fails_alone(tmp_path: Path) -> None:
    found = statuses(granted(tmp_path / "robot", "4900"))
    failed = [status for status in found if status != "ok"]
    assert len(failed) == 1
    assert failed[0].startswith(f"failed: {MEMORY}")


def test_a_failed_rollout_has_no_figures_and_leaves_the_next_one_alone(tmp_path: Path) -> None:
    problem = granted(tmp_path / "robot", "4900")
    gaits = [problem.space.decode(point) for point in quasi_random(problem.space, 6, 1)]
    simulator, fresh = Simulator.build(problem), Simulator.build(problem)
    runs = [simulator.run(gait) for gait in gaits]
    bad = next(i for i, run in enumerate(runs) if run.status != "ok")
    assert np.isnan(runs[bad]["marker.y"]).all()
    assert len(runs[bad].to_csv().splitlines()) == len(runs[bad].time) + 1
    assert same_bits(runs[bad + 1], fresh.run(gaits[bad + 1]))


@pytest.mark.slow
def test_a_study_goes_on_and_the_report_counts_why_gaits_failed(tmp_path: Path) -> None:
    problem, out = granted(tmp_path / "robot", "4900"), tmp_path / "out"
    arguments = ("optimise", problem.source.parent, "--budget", 12, "--seed", 3, "--out", out, "--quiet")
    assert here(*arguments) == 0
    journal = RunFolder.reopen(out).folder.open_journal(load_problem(out))
    failed = [entry.evaluation.status for entry in journal.entries if entry.evaluation.status != "ok"]
    assert failed
    note = f"{len(failed)} of 12 gaits failed in simulation: {failed[0]} ({len(failed)})"
    assert note in json.loads((out / "summary.json").read_text())["notes"]
    assert f"{len(failed)} of 12 gaits failed in simulation: failed: mj_stackAlloc" in (
        out / "report.html"
    ).read_text().replace("\N{NO-BREAK SPACE}", " ")


def test_a_study_in_which_every_gait_fails_says_so_and_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    problem = granted(tmp_path / "robot", "2K")
    assert here("optimise", problem.source.parent, "--budget", 5, "--out", tmp_path / "out", "--quiet") == 1
    assert capsys.readouterr().err == (
        "gaitopt: every one of 5 gaits failed in simulation: diverged: contactfull, cnstrfull (5)\n"
    )


def test_a_robot_too_large_for_its_memory_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(GaitoptError, match="the robot cannot be brought to rest: mj_stackAlloc"):
        build_model(granted(tmp_path / "robot", "4K"))


def test_nothing_is_compared_or_handed_over_that_cannot_be_simulated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = granted(tmp_path / "robot", "2K").source.parent
    assert here("compare", folder, "stride", "square", "--json") == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["more_than_noise"] for row in rows] == [False, False]
    assert here("export", folder, "stride", "--format", "c", "--out", tmp_path / "player") == 1
    assert capsys.readouterr().err == "gaitopt: stride: the simulation diverged: contactfull, cnstrfull\n"
    assert not (tmp_path / "player").exists()


def findings(capsys: pytest.CaptureFixture[str], problem: Path) -> list[tuple[str, str, str]]:
    """Name, gait and message of the findings of `gaitopt check`; no figure is nan."""
    capsys.readouterr()
    assert here("check", problem, "--json", "--out", problem.parent / "check") == 0
    said = capsys.readouterr().out
    assert "nan" not in said
    return [(row["name"], row["gait"], row["message"]) for row in json.loads(said)["findings"]]


def test_a_check_says_of_what_diverges_that_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It had called every parameter inert, with a mean speed from nan to nan."""
    granted(tmp_path / "robot", "2K")
    said = "the simulation diverged: contactfull, cnstrfull"
    held = ("diverged", "", f"held at its start, {said}")
    gaits = [("diverged", gait, said) for gait in ("stride", "square")]
    assert findings(capsys, tmp_path / "robot") == [held, *gaits]


@pytest.mark.slow
def test_a_check_says_from_how_many_starts_a_gait_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails from only one of the perturbed starts, at the working timestep."""
    run = Simulator.run

    def sometimes(self: Simulator, gait: Gait, scenario: int = 0, **options: Any) -> Trajectory:
        played = run(self, gait, scenario, **options)
        return (
            replace(played, status="diverged: badqvel") if scenario == 1 and gait.name == "square" else played
        )

    monkeypatch.setattr(Simulator, "run", sometimes)
    problem_folder(tmp_path / "robot", STRIDER)
    found = [message for name, gait, message in findings(capsys, tmp_path / "robot") if name == "diverged"]
    assert len(found) == 1
    assert re.fullmatch(
        r"from perturbed starts, 1 of \d+ simulations fail at 0.002 s and 1 at half of it: diverged: badqvel",
        found[0],
    )


def test_a_check_says_that_a_model_cannot_be_held(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    play = Simulator.play
    monkeypatch.setattr(Simulator, "play", lambda *a: replace(play(*a), status="diverged: badqpos"))
    problem_folder(tmp_path / "robot", STRIDER)
    found = findings(capsys, tmp_path / "robot")
    assert ("diverged", "", "held at its start, the simulation diverged: badqpos") in found
    assert "unrest_at_start" not in {name for name, _, _ in found}


def test_a_model_that_never_settles_is_taken_as_it_is_in_the_end(tmp_path: Path) -> None:
    """A pendulum without friction beside the robot; `gaitopt check` reports that it does not come to rest."""
    swinging = '<body pos="3 0 1"><joint type="hinge"/><geom size=".01" pos="0 .3 0"/></body></worldbody>'
    assert set(statuses(strider_with(tmp_path / "robot", "</worldbody>", swinging), 2)) == {"ok"}


def test_a_slow_rollout_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every limit is a count, not a time: a rollout that is a hundred times slower gives the same bits."""
    problem = load_problem(STRIDER)
    quick = statuses(problem, 3)
    assess = evaluator.assess
    slept: list[float] = []

    def slowly(*arguments: object) -> object:
        if not slept:
            time.sleep(1.0)
            slept.append(1.0)
        return assess(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(evaluator, "assess", slowly)
    assert statuses(problem, 3) == quick
    assert slept


# --- a rollout that takes a hundred times as long ---------------------------------------------

STALLED = "stalled: over 100 times the work of standing still"


def studded(folder: Path, side: int = 30) -> Path:
    """A strider with nine hundred studs under its trunk, which touch the ground in some gaits only.

    When they do, a step takes 1.1 ms instead of 6 us.
    """
    problem_folder(folder, STRIDER)
    places = [(x, y) for x in np.linspace(-0.01, 0.01, side) for y in np.linspace(-0.055, 0.055, side)]
    stud = '<geom size="0.001" pos="{:.4f} {:.4f} -0.026" mass="0" contype="1" conaffinity="0"/>'
    site = '<site name="nose"'
    edited(folder / "strider.xml", site, "".join(stud.format(x, y) for x, y in places) + site)
    return folder


@pytest.mark.slow
def test_a_rollout_a_hundred_times_slower_is_a_status_and_its_siblings_go_on(tmp_path: Path) -> None:
    problem = load_problem(studded(tmp_path / "robot"))
    found = statuses(problem, 3)
    assert found == ["ok", STALLED, "ok"]
    assert found == statuses(problem, 3)


@pytest.mark.slow
def test_what_stalls_keeps_its_last_good_values_and_leaves_the_next_one_alone(tmp_path: Path) -> None:
    problem = load_problem(studded(tmp_path / "robot"))
    gaits = [problem.space.decode(point) for point in quasi_random(problem.space, 3, 1)]
    simulator = Simulator.build(problem, settings=RolloutSettings(chunk=50))
    _, stalled, after = [simulator.run(gait) for gait in gaits]
    assert stalled.status == STALLED
    path = stalled["marker.y"]
    assert np.isfinite(path).all()
    assert (path[-40:] == path[-1]).all()
    assert len(path) == len(stalled.time)
    assert same_bits(after, Simulator.build(problem).run(gaits[2]))


@pytest.mark.slow
def test_a_robot_whose_effects_run_along_stalls_too(tmp_path: Path) -> None:
    problem = load_problem(studded(tmp_path / "robot")).with_effects({"servo_sag": {"share_lost": 0.1}})
    assert set(statuses(problem, 2)) == {"ok", STALLED}


@pytest.mark.slow
def test_a_study_counts_what_stalled_and_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    impatient = functools.partial(Simulator.build, settings=RolloutSettings(most_work=3.0))
    monkeypatch.setattr(Simulator, "build", impatient)
    folder, out = studded(tmp_path / "robot", 10), tmp_path / "out"
    arguments = ("--budget", 12, "--out", out, "--quiet", "--no-warm-start", "--workers", 1)
    assert here("optimise", folder, *arguments) == 0
    stalled = [
        entry.evaluation.status
        for entry in RunFolder.reopen(out).folder.open_journal(load_problem(out)).entries
        if entry.evaluation.status.startswith("stalled: over 3 times the work of standing still")
    ]
    assert stalled
    note = f"{len(stalled)} of 12 gaits failed in simulation: {stalled[0]} ({len(stalled)})"
    assert note in json.loads((out / "summary.json").read_text())["notes"]
    assert note in (out / "report.html").read_text().replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.slow
def test_a_sweep_says_what_stalled(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = studded(tmp_path / "robot")
    problem = load_problem(folder)
    gait = problem.space.decode(quasi_random(problem.space, 2, 1)[1])
    write_gait(tmp_path / "gait.toml", gait)
    arguments = ("--over", f"period_s={gait.period_s}", "--json", "--out", tmp_path / "out")
    assert here("sweep", folder, tmp_path / "gait.toml", *arguments) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["status"] for row in rows] == [STALLED]


@pytest.mark.parametrize("chunk", [1, 7, 5000])
def test_looking_at_the_work_changes_no_bit(chunk: int) -> None:
    problem = load_problem(STRIDER)
    usual = Simulator.build(problem).run(problem.baselines["stride"])
    simulator = Simulator.build(problem, settings=RolloutSettings(chunk=chunk))
    assert same_bits(usual, simulator.run(problem.baselines["stride"]))


@pytest.mark.parametrize("name", ["arcfold", "arcfold-published", str(STRIDER)])
def test_no_gait_of_the_robots_here_comes_near_the_limit(name: str) -> None:
    """They take 0.4 to 1.1 times the work of standing still."""
    problem = load_problem(name)
    simulator = Simulator.build(problem, settings=RolloutSettings(most_work=3.0))
    gaits = [
        *problem.baselines.values(),
        *(problem.space.decode(p) for p in quasi_random(problem.space, 2, 1)),
    ]
    assert {simulator.run(gait, duration=0.1).status for gait in gaits} == {"ok"}
