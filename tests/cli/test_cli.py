"""The command line: answers, JSON, exit codes, one line for every stated problem."""

import json
import math
import shutil
import tomllib
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from helpers import STRIDER, edited, problem_folder

from gaitopt.cli import app as cli
from gaitopt.gait.gait import read_gait, write_gait
from gaitopt.optimise.executors import open_executor
from gaitopt.optimise.run import Request
from gaitopt.optimise.study import Study
from gaitopt.problem.model import build_model, nominal_mjcf
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.report import search as search_page
from gaitopt.runs.run_folder import RunFolder

Run = Callable[..., tuple[int, str, str]]

COMMANDS = ["optimise", "simulate", "sweep", "compare", "check", "model", "command"]
RUN_FILES = {
    *("best.toml", "summary.json", "evaluations.csv", "problem.toml", "model.xml", "report.html"),
    *("figures", "run.toml"),
}


@pytest.fixture
def gaitopt(capfd: pytest.CaptureFixture[str]) -> Run:
    """Run a command; return its exit code, standard output and standard error."""

    def run(*arguments: object) -> tuple[int, str, str]:
        capfd.readouterr()
        code = cli.main([str(argument) for argument in arguments])
        return code, *capfd.readouterr()

    return run


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a finished run of the strider."""
    folder = tmp_path_factory.mktemp("finished") / "run"
    code = cli.main(
        ["optimise", str(STRIDER), "--budget", "12", "--seed", "5", "--out", str(folder), "--quiet"]
    )
    assert code == 0
    return folder


def strictly(text: str) -> Any:
    """Parse JSON that knows neither NaN nor infinity."""
    return json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))


def without_clock(folder: Path) -> dict[str, Any]:
    """A run's summary without the one figure that is a clock's."""
    content = strictly((folder / "summary.json").read_text())
    assert content.pop("wall_s") > 0.0
    return content


# --- optimise ---------------------------------------------------------------------------------


def test_optimise_leaves_the_contracts_folder(gaitopt: Run, quick_folder: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    code, out, err = gaitopt("optimise", quick_folder, "--budget", 4, "--seed", 2, "--out", folder, "--json")
    assert (code, err) == (0, "")
    assert {path.name for path in folder.iterdir()} == RUN_FILES
    assert not [path for path in folder.rglob("*") if path.name.startswith(".")]
    summary = strictly(out)
    assert summary == strictly((folder / "summary.json").read_text())
    problem = load_problem(quick_folder)
    assert (summary["problem"], summary["seed"], summary["evaluations"]) == ("arcfold", 2, 4)
    assert summary["simulated_s"] > 0.0
    assert summary["wall_s"] > 0.0
    names = [(row["name"], row["period_s"]) for row in summary["baselines"]]
    assert names == [("square-4s", 4.0), ("square-2s", 2.0), ("square-1s", 1.0), ("square-0.5s", 0.5)]
    for row in [*summary["baselines"], summary["best"]]:
        assert row["stride_m"] == pytest.approx(row["speed_m_s"] * row["period_s"])
        assert isinstance(row["constraints_met"], bool)
    low, high = summary["best"]["speed_ci90_m_s"]
    assert low <= summary["best"]["speed_m_s"] <= high
    reference = problem.simulation.reference
    assert summary["verified"] == {
        "timestep_s": reference.timestep_s,
        "integrator": reference.integrator,
        "scenarios": 2,
        "speed_m_s": summary["best"]["speed_m_s"],
    }
    fastest = max(row["speed_m_s"] for row in summary["baselines"])
    ratio = summary["best"]["speed_m_s"] / fastest if fastest > 0.0 else None
    assert summary["ratio_to_best_baseline"] == (ratio if ratio is None else pytest.approx(ratio))
    assert "warm_start" in summary
    assert len((folder / "evaluations.csv").read_text().splitlines()) == 1 + 4


def test_best_toml_is_a_gait_file_and_nothing_else(finished: Path, strider: Problem) -> None:
    gait = read_gait(finished / "best.toml")
    assert strider.check_gait(gait, "best") == gait
    assert gait.period_s == strictly((finished / "summary.json").read_text())["best"]["period_s"]


def test_the_report_is_one_self_contained_page(finished: Path) -> None:
    page = (finished / "report.html").read_text()
    assert "stride" in page
    assert f"Period {read_gait(finished / 'best.toml').period_s:.3g}" in page
    assert page.count("data:image/png;base64,") == len(list((finished / "figures").iterdir())) == 6
    assert "http://" not in page
    assert "https://" not in page


def test_the_answer_is_short_and_says_where_the_report_is(gaitopt: Run, tmp_path: Path) -> None:
    code, out, err = gaitopt("optimise", STRIDER, "--budget", 3, "--out", tmp_path / "run")
    assert code == 0
    assert "The best gait crawls at " in out
    assert f"report: {tmp_path / 'run' / 'report.html'}" in out.replace("\n", "").replace(
        "report:", "\nreport:"
    )
    assert len(out.splitlines()) < 20
    assert "3/3 gaits" in err


def test_both_spellings_and_a_default_folder(gaitopt: Run) -> None:
    for spelling, number in (("optimise", "001"), ("optimize", "002")):
        assert gaitopt(spelling, STRIDER, "--budget", 1, "--quiet")[0] == 0
        assert (Path("results") / "runs" / f"strider-{number}" / "summary.json").is_file()


def test_workers_and_executors_change_no_bit(gaitopt: Run, finished: Path, tmp_path: Path) -> None:
    for options in (("--workers", 1), ("--workers", 3), ("--executor", "serial")):
        folder = tmp_path / "-".join(map(str, options))
        code, _, _ = gaitopt(
            "optimise", STRIDER, "--budget", 12, "--seed", 5, "--out", folder, "--json", *options
        )
        assert code == 0
        for name in ("evaluations.csv", "best.toml", "model.xml", "problem.toml"):
            assert (folder / name).read_bytes() == (finished / name).read_bytes(), name
        assert without_clock(folder) == without_clock(finished)


# --- resume -----------------------------------------------------------------------------------


def interrupt_after(monkeypatch: pytest.MonkeyPatch, batches: int) -> None:
    """Press Ctrl-C when that many batches are done."""
    original, done = Study._assess, []

    def assess(self: Study, method: str, *arguments: Any) -> Any:
        if len(done) == batches:
            raise KeyboardInterrupt
        done.append(method)
        return original(self, method, *arguments)

    monkeypatch.setattr(Study, "_assess", assess)


@pytest.mark.parametrize("batches", [1, 3])
def test_an_interrupted_run_is_resumed_to_the_same_bits(
    gaitopt: Run, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batches: int
) -> None:
    folder = tmp_path / "run"
    with monkeypatch.context() as patch:
        interrupt_after(patch, batches)
        code, out, err = gaitopt("optimise", STRIDER, "--budget", 12, "--seed", 5, "--out", folder, "--quiet")
    assert (code, out) == (130, "")
    assert f"gaitopt optimise {folder} --resume {folder}" in err
    assert not (folder / "summary.json").exists()
    assert not (folder / ".lock").exists()
    code, out, err = gaitopt("optimise", folder, "--resume", folder, "--json")
    assert (code, err) == (0, "")
    for name in ("evaluations.csv", "best.toml", "model.xml", "problem.toml"):
        assert (folder / name).read_bytes() == (finished / name).read_bytes(), name
    assert without_clock(folder) == without_clock(finished)
    assert {path.name for path in folder.iterdir()} == RUN_FILES


def test_a_run_interrupted_before_its_first_gait_leaves_nothing(
    gaitopt: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupt_after(monkeypatch, 0)
    code, _, err = gaitopt("optimise", STRIDER, "--budget", 12, "--out", tmp_path / "run", "--quiet")
    assert (code, err) == (130, "gaitopt: interrupted\n")
    assert not (tmp_path / "run").exists()


def test_resuming_a_finished_run_prints_its_result(gaitopt: Run, finished: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in finished.rglob("*") if path.is_file()}
    code, out, err = gaitopt("optimise", STRIDER, "--resume", finished, "--json")
    assert (code, err) == (0, "")
    assert strictly(out) == strictly((finished / "summary.json").read_text())
    code, out, _ = gaitopt("optimise", STRIDER, "--resume", finished)
    assert code == 0
    assert "The best gait crawls at " in out
    assert {path: path.stat().st_mtime_ns for path in finished.rglob("*") if path.is_file()} == before


def test_a_run_stopped_while_it_wrote_its_report_is_not_finished(
    gaitopt: Run, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Resuming it gives the report, too."""

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    folder = tmp_path / "run"
    with monkeypatch.context() as patch:
        patch.setattr(search_page, "write_report", interrupted)
        assert gaitopt("optimise", STRIDER, "--budget", 12, "--seed", 5, "--out", folder, "--quiet")[0] == 130
    assert gaitopt("optimise", STRIDER, "--resume", folder, "--quiet")[0] == 0
    assert {path.name for path in folder.iterdir()} == RUN_FILES
    assert without_clock(folder) == without_clock(finished)


@pytest.mark.parametrize(
    "option", [("--budget", 3), ("--seed", 1), ("--method", "cma-es"), ("--out", "x"), ("--no-warm-start",)]
)
def test_resume_takes_everything_from_the_folder(
    gaitopt: Run, finished: Path, option: Sequence[object]
) -> None:
    code, out, err = gaitopt("optimise", STRIDER, "--resume", finished, *option)
    assert (code, out) == (1, "")
    name = str(option[0]).replace("--no-", "--")
    assert err == f"gaitopt: {name}: not with --resume, which takes it from {finished}\n"


def test_a_run_of_another_version_is_refused_unless_it_is_finished(
    gaitopt: Run, finished: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    shutil.copytree(finished, folder)
    made = tomllib.loads((folder / "run.toml").read_text())
    for name in ("gaitopt", "mujoco", "numpy"):
        assert made[name] == version(name)
        (folder / "run.toml").write_text(tomli_w.dumps(made | {name: "0.0.1"}))
        assert gaitopt("optimise", folder, "--resume", folder, "--json")[0] == 0
        (folder / "summary.json").rename(tmp_path / "summary.json")
        code, out, err = gaitopt("optimise", folder, "--resume", folder)
        said = f"{name}: found '0.0.1'; allowed: {version(name)}, the version here, to go on"
        assert (code, out, err) == (1, "", f"gaitopt: {folder / 'run.toml'}: {said}\n")
        (tmp_path / "summary.json").rename(folder / "summary.json")


def test_resume_with_a_changed_parameter_is_refused(gaitopt: Run, finished: Path) -> None:
    code, _, err = gaitopt("optimise", STRIDER, "--resume", finished, "--set", "mass=1")
    assert (code, err) == (1, f"gaitopt: --set: not with --resume, which takes it from {finished}\n")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("budget = 12", 'budget = "many"', "budget"),
        ("budget = 12", "", "run.toml: budget: missing; it is required"),
        ("seed = 5", "seed = 5.5", "seed"),
        ("budget = 12", "budget = ", "run.toml: not TOML"),
    ],
)
def test_a_spoiled_request_is_one_line(
    gaitopt: Run, finished: Path, tmp_path: Path, old: str, new: str, message: str
) -> None:
    for name in ("run.toml", "problem.toml", "model.xml"):
        (tmp_path / name).write_bytes((finished / name).read_bytes())
    edited(tmp_path / "run.toml", old, new)
    code, out, err = gaitopt("optimise", STRIDER, "--resume", tmp_path)
    assert (code, out) == (1, "")
    assert err.count("\n") == 1
    assert message in err


# --- run folders are problems and gaits -------------------------------------------------------


def test_a_run_folder_is_a_problem_and_a_gait(gaitopt: Run, finished: Path) -> None:
    code, out, _ = gaitopt("simulate", finished, finished, "--json")
    assert code == 0
    assert gaitopt("simulate", STRIDER, finished, "--json") == (0, out, "")
    assert gaitopt("simulate", STRIDER, finished / "best.toml", "--json") == (0, out, "")
    assert gaitopt("simulate", finished, "square", "--json")[0] == 0


def test_an_unfinished_run_folder_is_no_gait(gaitopt: Run, tmp_path: Path) -> None:
    code, _, err = gaitopt("simulate", STRIDER, tmp_path)
    assert code == 1
    assert (
        err == f"gaitopt: {tmp_path / 'best.toml'}: no such file; {tmp_path} is not a finished run folder\n"
    )


# --- simulate, sweep, compare, check ----------------------------------------------------------


def test_simulate_prints_the_metrics(gaitopt: Run, tmp_path: Path) -> None:
    code, out, err = gaitopt("simulate", STRIDER, "square", "--json", "--csv", tmp_path / "walk.csv")
    assert (code, err) == (0, "")
    (row,) = strictly(out)["rows"]
    assert (row["name"], row["period_s"], row["status"]) == ("square", 0.4, "ok")
    assert row["command_speed_ratio"] is None  # infinite: a square wave
    lines = (tmp_path / "walk.csv").read_text().splitlines()
    assert lines[0].startswith("t_s,marker.x_m,marker.y_m,marker.z_m,")
    assert {len(line.split(",")) for line in lines} == {len(lines[0].split(","))}
    table = gaitopt("simulate", STRIDER, "square")[1]
    assert "forward speed [mm/s]" in table
    assert f"{1e3 * row['speed_m_s']:.3g}" in table


def test_set_changes_the_robot(gaitopt: Run) -> None:
    def speed(*options: str) -> float:
        rows = strictly(gaitopt("simulate", STRIDER, "square", "--json", *options)[1])["rows"]
        return float(rows[0]["speed_m_s"])

    nominal = speed()
    assert speed("--set", "mu_rear=1.0") == nominal
    assert speed("--set", "mu_rear=0.3") != nominal
    assert speed("--set", "mu_rear=0.3", "--set", "mass=0.04") != speed("--set", "mu_rear=0.3")


def test_a_diverged_simulation_is_an_answer(gaitopt: Run) -> None:
    """A bad candidate is data: exit 0, its status in the row, no figures."""
    exploding = ("--set", "k_servo=1e7", "--set", "torque_limit=1e12")
    code, out, err = gaitopt("simulate", STRIDER, "square", "--json", *exploding)
    assert (code, err) == (0, "")
    (row,) = strictly(out)["rows"]
    assert row["status"] == "diverged: badqacc"
    assert row["speed_m_s"] is None
    assert gaitopt("simulate", STRIDER, "square", *exploding)[0] == 0
    assert list(Path().iterdir()) == []


def test_a_robot_that_always_fails_says_so(gaitopt: Run, tmp_path: Path) -> None:
    exploding = ("--set", "k_servo=1e7", "--set", "torque_limit=1e12")
    code, out, err = gaitopt(
        "optimise", STRIDER, "--budget", 3, "--quiet", "--out", tmp_path / "run", *exploding
    )
    assert (code, out) == (1, "")
    assert err == "gaitopt: every one of 3 gaits failed in simulation: diverged: badqacc (3)\n"


@pytest.mark.parametrize(
    ("over", "names"),
    [
        ("period_s=0.5,0.25", ["period_s=0.5", "period_s=0.25"]),
        ("rear.phase=0,0.5", ["rear.phase=0", "rear.phase=0.5"]),
        ("mu_rear=0.1,0.9", ["mu_rear=0.1", "mu_rear=0.9"]),
    ],
)
def test_sweep_gives_a_row_and_a_line_per_value(
    gaitopt: Run, tmp_path: Path, over: str, names: list[str]
) -> None:
    folder = tmp_path / "sweep"
    code, out, err = gaitopt("sweep", STRIDER, "square", "--over", over, "--json", "--out", folder)
    assert (code, err) == (0, "")
    rows = strictly(out)["rows"]
    assert [row["name"] for row in rows] == names
    assert rows[0]["speed_m_s"] != rows[1]["speed_m_s"]
    assert strictly((folder / "sweep.json").read_text()) == {"rows": rows}
    assert {path.name for path in folder.iterdir()} == {"sweep.json", "overlay.png", "panels.png"}


def test_a_sweep_over_the_own_period_is_the_gait_itself(gaitopt: Run) -> None:
    rows = strictly(gaitopt("sweep", STRIDER, "--over", "period_s=0.5", "--json")[1])["rows"]
    (nominal,) = strictly(gaitopt("simulate", STRIDER, "stride", "--json")[1])["rows"]
    assert rows[0]["speed_m_s"] == nominal["speed_m_s"]
    assert [path.name for path in Path("results/runs").iterdir()] == ["strider-sweep-001"]


def test_a_sweep_survives_a_value_that_diverges(gaitopt: Run, tmp_path: Path) -> None:
    exploding = ("--set", "torque_limit=1e12")
    code, out, _ = gaitopt(
        "sweep", STRIDER, "square", "--over", "k_servo=0.5,1e7", "--json", "--out", tmp_path / "s", *exploding
    )
    assert code == 0
    assert [row["status"] for row in strictly(out)["rows"]][1].startswith("diverged")


def test_compare_is_over_the_same_scenarios(gaitopt: Run, finished: Path) -> None:
    code, out, err = gaitopt("compare", STRIDER, "stride", "square", finished, "stride", "--json")
    assert (code, err) == (0, "")
    rows = strictly(out)["rows"]
    assert [row["name"] for row in rows] == ["stride", "square", "best", "stride"]
    for row in rows:
        low, high = row["speed_ci90_m_s"]
        assert low <= row["speed_m_s"] <= high
    assert rows[3]["difference_ci90_m_s"] == [0.0, 0.0]
    assert not rows[3]["more_than_noise"]
    assert rows[1]["difference_m_s"] == pytest.approx(rows[1]["speed_m_s"] - rows[0]["speed_m_s"])
    again = gaitopt("compare", STRIDER, "stride", "square", finished, "stride", "--json", "--workers", 1)
    assert strictly(again[1])["rows"] == rows
    other = gaitopt("compare", STRIDER, "stride", "square", finished, "stride", "--json", "--seed", 2)
    assert strictly(other[1])["rows"] != rows
    text = gaitopt("compare", STRIDER, "stride", "square")[1]
    assert "more than noise" in text


def findings(gaitopt: Run, problem: Path) -> list[dict[str, Any]]:
    """What the audit finds."""
    code, out, err = gaitopt("check", problem, "--json")
    assert (code, err) == (0, "")
    found = strictly(out)["findings"]
    assert all({"name", "gait", "value", "limit"} <= set(finding) for finding in found)
    return list(found)


def test_check_finds_neither_of_the_published_defects_on_arcfold(gaitopt: Run, quick_folder: Path) -> None:
    found = {finding["name"] for finding in findings(gaitopt, quick_folder)}
    assert not found & {"inert_parameter", "airtime", "self_collision", "unrest_at_start", "diverged"}


def test_check_finds_planted_defects(gaitopt: Run, tmp_path: Path) -> None:
    """No priority: the ground's friction of 1 wins. Feet so big that they touch. A start in the air."""
    folder = problem_folder(tmp_path / "robot", STRIDER)
    xml = folder / "strider.xml"
    edited(xml, ' priority="1"', "")
    edited(xml, 'contype="1" conaffinity="0"', 'contype="1" conaffinity="1"')
    edited(xml, 'size="0.005" mass', 'size="0.045" mass')
    edited(xml, '<body name="trunk" pos="0 0 0.03">', '<body name="trunk" pos="0 0 0.09">')
    edited(folder / "problem.toml", 'name = "strider"', 'name = "strider"\nstart.settle = false')
    edited(xml, "</mujoco>", '<keyframe><key name="start"/></keyframe></mujoco>')
    found = findings(gaitopt, folder)
    assert {"inert_parameter", "unrest_at_start", "self_collision"} <= {finding["name"] for finding in found}
    inert = {finding["parameter"] for finding in found if finding["name"] == "inert_parameter"}
    assert {"mu_front", "mu_trunk"} <= inert
    assert "mass" not in inert


def test_check_calls_inert_only_the_friction_of_what_never_touches(gaitopt: Run) -> None:
    found = findings(gaitopt, STRIDER)
    assert not {finding["name"] for finding in found} & {"self_collision", "unrest_at_start", "diverged"}
    inert = {finding["parameter"] for finding in found if finding["name"] == "inert_parameter"}
    assert inert <= {"mu_trunk"}


# --- model, command ---------------------------------------------------------------------------


def test_model_writes_the_nominal_mjcf(gaitopt: Run, tmp_path: Path, strider: Problem) -> None:
    code, out, err = gaitopt("model", STRIDER, "--out", tmp_path / "robot.xml", "--set", "mass=0.05")
    assert (code, out, err) == (0, f"{tmp_path / 'robot.xml'}\n", "")
    text = (tmp_path / "robot.xml").read_text()
    assert text == nominal_mjcf(strider.with_parameters({"mass": 0.05}))


@pytest.mark.parametrize(
    ("dt", "duration", "rows"),
    [(0.1, 0.3, 3), (0.01, 0.4, 40), (0.02, 1.0, 50), (0.3, 1.0, 4), (1.0, 0.5, 1), (1e-3, 0.7, 700)],
)
def test_command_writes_what_is_sent(
    gaitopt: Run, tmp_path: Path, strider: Problem, dt: float, duration: float, rows: int
) -> None:
    """t_s, then a column per actuator in the model's order; rows t = 0, dt, ... < duration."""
    path = tmp_path / "command.csv"
    code, out, _ = gaitopt("command", STRIDER, "square", "--dt", dt, "--duration", duration, "--out", path)
    assert (code, out) == (0, f"{path}\n")
    header, *lines = path.read_text().splitlines()
    model = build_model(strider)
    assert header.split(",") == ["t_s", *(model.actuator(i).name for i in range(model.nu))]
    table = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    assert len(table) == rows
    assert table[:, 0] == pytest.approx(np.arange(rows) * dt, abs=1e-12)
    np.testing.assert_array_equal(table[:, 1:], strider.baselines["square"].targets(table[:, 0]))
    for line in lines:
        assert line == ",".join(repr(float(cell)) for cell in line.split(","))


# --- exit codes and JSON ----------------------------------------------------------------------


@pytest.mark.parametrize("command", COMMANDS)
def test_help_shows_an_example(gaitopt: Run, command: str) -> None:
    code, out, err = gaitopt(command, "--help")
    assert (code, err) == (0, "")
    assert f"example: gaitopt {command} " in out


def test_help_and_version(gaitopt: Run) -> None:
    code, out, _ = gaitopt("--help")
    assert code == 0
    assert all(command in out for command in COMMANDS)
    code, out, _ = gaitopt("--version")
    assert code == 0
    assert out.startswith("gaitopt ")


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["optimse", "arcfold"],
        ["optimise"],
        ["optimise", "arcfold", "--budget", "many"],
        ["simulate", "arcfold"],
        ["simulate", "arcfold", "square-1s", "--set", "mass"],
        ["simulate", "arcfold", "square-1s", "--set", "mass=heavy"],
        ["sweep", "arcfold"],
        ["model", "arcfold"],
        ["command", "arcfold", "square-1s"],
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(gaitopt: Run, arguments: list[str]) -> None:
    code, out, err = gaitopt(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("gaitopt: ")
    assert err.count("\n") == 1
    assert "--help" in err
    assert list(Path().iterdir()) == []


# --- bad input gets one line ------------------------------------------------------------------


def refused(gaitopt: Run, *arguments: object) -> str:
    """The one line that a command ends with; nothing half-written is left here or beside it."""
    before = {path for path in Path().resolve().parent.rglob("*") if "finished" not in path.parts}
    code, out, err = gaitopt(*arguments)
    assert code == 1
    assert out == ""
    assert err.startswith("gaitopt: ")
    assert err.count("\n") == 1, err
    after = {path for path in Path().resolve().parent.rglob("*") if "finished" not in path.parts}
    assert after == before
    return err.removeprefix("gaitopt: ").rstrip("\n")


def gait_file(strider: Problem, old: str, new: str) -> Path:
    """A gait file of the strider with a mistake."""
    write_gait(Path("gait.toml"), strider.baselines["square"])
    return edited(Path("gait.toml"), old, new)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("channels.rear", "channels.raer", "gait.toml: unknown channel 'raer'; known: rear, front (nearest: 'rear')"),  # noqa: E501
        ("duty = 0.4", "duty = 1.4", "gait.toml: channels.rear.duty: found 1.4; allowed: less than or equal to 1"),  # noqa: E501
        ("period_s = 0.4", "period_s = -0.4", "gait.toml: period_s: found -0.4; allowed: greater than or equal to 0.001"),  # noqa: E501
        ("duty = 0.4", "duty = nan", "gait.toml: channels.rear.duty: found nan; allowed: "),
        (
            "amplitude_deg = 30.0",
            "amplitude_deg = 300.0",
            "gait.toml: channels.rear: found 'targets from -15 to 285 degrees'; "
            "allowed: the servo's -45 to 45",
        ),
        ("period_s = 0.4", "period_s = ", "gait.toml: not TOML: "),
    ],
)  # fmt: skip
def test_a_bad_gait_file(gaitopt: Run, strider: Problem, old: str, new: str, message: str) -> None:
    path = gait_file(strider, old, new)
    for command in (
        ("simulate", STRIDER, path),
        ("compare", STRIDER, "square", path),
        ("sweep", STRIDER, path, "--over", "period_s=1"),
        ("command", STRIDER, path, "--dt", 0.01, "--duration", 1, "--out", "command.csv"),
    ):
        assert refused(gaitopt, *command).startswith(message)


@pytest.mark.parametrize("period_s", [1e9, 1e300])
def test_a_gait_too_slow_to_simulate(gaitopt: Run, strider: Problem, period_s: float) -> None:
    path = gait_file(strider, "period_s = 0.4", f"period_s = {period_s!r}")
    assert "period_s" in refused(gaitopt, "simulate", STRIDER, path)


@pytest.mark.parametrize("command", ["optimise", "check", "model"])
@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("problem.toml", 'marker = "nose"', 'marker = "noes"', "unknown site in roles.marker: 'noes'"),
        ("strider.xml", 'name="front" joint', 'name="fornt" joint', "channels.front: "),
        ("strider.xml", "</worldbody>", "", "broken XML: "),
        ("problem.toml", "duty = 0.4", "duty = 4", "found 4; allowed: "),
        ("problem.toml", "value = 0.5", "value = nan", "found nan; allowed: a finite number"),
    ],
)
def test_a_bad_problem(gaitopt: Run, command: str, name: str, old: str, new: str, message: str) -> None:
    folder = problem_folder(Path("robot"), STRIDER)
    edited(folder / name, old, new)
    options = {"optimise": ("--out", "run", "--budget", 2), "model": ("--out", "m.xml")}.get(command, ())
    assert message in refused(gaitopt, command, folder, *options)


def test_an_unknown_metric_in_the_objective(gaitopt: Run) -> None:
    folder = problem_folder(Path("robot"), STRIDER)
    edited(folder / "problem.toml", "speed_m_s = -1.0", "sped_m_s = -1.0")
    for command in (("optimise", folder, "--budget", 2, "--out", "run"), ("compare", folder, "square")):
        assert "unknown metric 'sped_m_s'" in refused(gaitopt, *command)


BAD_OPTIONS = {
    "budget of 0": (("optimise", "--budget", 0), "--budget: found 0; allowed: 1 or more"),
    "negative seed": (("optimise", "--seed", -1), "--seed: found -1; allowed: 0 or more"),
    "no workers": (("optimise", "--workers", 0), "--workers: found 0; allowed: 1 or more"),
    "unknown method": (
        ("optimise", "--method", "cma_es"),
        "--method: found 'cma_es'; allowed: default, cma-es, nelder-mead (nearest: 'cma-es')",
    ),
    "unknown executor": (
        ("optimise", "--executor", "thread"),
        "--executor: found 'thread'; allowed: threads, processes, serial or dask://HOST:PORT "
        "(nearest: 'threads')",
    ),
    "nothing to resume": (("optimise", "--resume", "gone"), "--resume: gone: not a run folder (no run.toml)"),
    "unknown parameter": (("simulate", "square", "--set", "mu_raer=1"), "unknown parameter 'mu_raer'; known: "),  # noqa: E501
    "NaN parameter": (("simulate", "square", "--set", "mass=nan"), "parameters.mass.value: found nan; allowed: "),  # noqa: E501
    "impossible mass": (("simulate", "square", "--set", "mass=-1"), "strider.xml: "),
    "unknown gait": (("simulate", "sqare"), "sqare: neither a baseline nor a gait file nor an exported table "),  # noqa: E501
    "missing gait file": (("simulate", "gone.toml"), "gone.toml: neither a baseline nor a gait file"),
    "CSV nowhere": (("simulate", "square", "--csv", "gone/walk.csv"), "gone/walk.csv: cannot be written: No such"),  # noqa: E501
    "sweep over nothing": (("sweep", "--over", "period_s"), "--over: found 'period_s'; allowed: NAME=V1,V2,… with"),  # noqa: E501
    "sweep over a word": (("sweep", "--over", "period_s=slow"), "--over: found 'period_s=slow'; allowed: NAME="),  # noqa: E501
    "sweep over NaN": (("sweep", "--over", "period_s=1,nan"), "--over: found 'period_s=1,nan'; allowed: NAME="),  # noqa: E501
    "sweep over an unknown": (("sweep", "--over", "period=1"), "--over: unknown parameter 'period'; known: period_s,"),  # noqa: E501
    "sweep to a negative period": (
        ("sweep", "--over", "period_s=1,-1"),
        "--over period_s=-1: period_s: found -1.0; allowed: greater than or equal to 0.001",
    ),
    "sweep out of the travel": (
        ("sweep", "--over", "rear.offset_deg=80"),
        "--over rear.offset_deg=80: channels.rear: found 'targets from 80 to 120 degrees'; allowed: the servo's",  # noqa: E501
    ),
    "compare with a negative seed": (("compare", "square", "--seed", -1), "--seed: found -1; allowed: 0 or more"),  # noqa: E501
    "model nowhere": (("model", "--out", "gone/robot.xml"), "gone/robot.xml: cannot be written: No such file"),  # noqa: E501
    "dt of 0": (
        ("command", "square", "--dt", 0, "--duration", 1, "--out", "c.csv"),
        "--dt: found 0.0; allowed: a positive number of seconds",
    ),
    "endless duration": (
        ("command", "square", "--dt", 1, "--duration", "inf", "--out", "c.csv"),
        "--duration: found inf; allowed: a positive number of seconds",
    ),
    "too many rows": (
        ("command", "square", "--dt", 1e-9, "--duration", 1, "--out", "c.csv"),
        "--dt: found 1e-09; ",
    ),
    "more rows than a number can say": (
        ("command", "square", "--dt", 1e-310, "--duration", 1e10, "--out", "c.csv"),
        "--dt: found 1e-310; ",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD_OPTIONS)
def test_a_bad_option(gaitopt: Run, name: str) -> None:
    (command, *options), message = BAD_OPTIONS[name]
    assert message in refused(gaitopt, command, STRIDER, *options)


@pytest.mark.parametrize("command", ["optimise", "sweep"])
def test_an_output_folder_that_cannot_be_used(gaitopt: Run, finished: Path, command: str) -> None:
    options = ("--over", "period_s=1") if command == "sweep" else ("--budget", 2, "--quiet")

    def out(path: Path | str) -> str:
        return refused(gaitopt, command, STRIDER, *options, "--out", path)

    Path("file").write_text("")
    assert out("file") == "--out: file: cannot be made: File exists"
    assert out("file/run") == "--out: file/run: cannot be made: Not a directory"
    Path("full").mkdir()
    Path("full/thesis.tex").write_text("years of work")
    assert out("full") == "--out: full is not empty; allowed: a new or an empty folder"
    assert Path("full/thesis.tex").read_text() == "years of work"
    before = {path: path.read_bytes() for path in finished.rglob("*") if path.is_file()}
    assert out(finished) == (
        f"--out: {finished} already holds a run; choose another folder, or --resume {finished}"
    )
    assert {path: path.read_bytes() for path in finished.rglob("*") if path.is_file()} == before


def test_two_runs_into_one_folder_are_refused(gaitopt: Run, strider: Problem, tmp_path: Path) -> None:
    with RunFolder.create(tmp_path / "run", strider, Request(budget=2)):
        assert refused(gaitopt, "optimise", STRIDER, "--resume", tmp_path / "run") == (
            f"{tmp_path / 'run'}: another run is working in this folder"
        )
        assert "already holds a run" in refused(gaitopt, "optimise", STRIDER, "--out", tmp_path / "run")


def test_an_unexpected_error_is_not_hidden(gaitopt: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only stated problems become a line; a bug stays a traceback."""

    def broken(*_: object) -> None:
        raise RuntimeError("a bug")

    monkeypatch.setattr("gaitopt.problem.problem.load_problem", broken)
    with pytest.raises(RuntimeError, match="a bug"):
        gaitopt("simulate", STRIDER, "square")


def test_executors_are_those_of_the_help(gaitopt: Run) -> None:
    for name in ("threads", "processes", "serial"):
        with open_executor(name, 1) as executor:
            assert executor.submit(math.sqrt, 4.0).result() == 2.0
        assert name in gaitopt("optimise", "--help")[1]
