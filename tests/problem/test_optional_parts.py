"""A problem of joints alone: no gait space, no objective, no marker, no pads."""

import json
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import STRIDER, problem_folder

from gaitopt.cli.app import main
from gaitopt.core.errors import GaitoptError
from gaitopt.gait.gait import Gait, write_gait
from gaitopt.optimise.compare import compare
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.plan.plan import Planner
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.robot import Robot
from gaitopt.simulation.check import check
from gaitopt.simulation.metrics import METRICS, measure
from gaitopt.simulation.objective import check_objective, evaluate
from gaitopt.simulation.rollout import Simulator


def strip(content: dict[str, Any]) -> None:
    """Remove everything but the joints from a problem."""
    del content["gait"], content["objective"], content["baselines"]
    content["roles"] = {}
    for channel in content["channels"].values():
        del channel["amplitude_deg"]


@pytest.fixture(scope="module")
def bare_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The strider without its optional parts."""
    return problem_folder(tmp_path_factory.mktemp("bare") / "bare", STRIDER, strip)


@pytest.fixture(scope="module")
def bare(bare_folder: Path) -> Problem:
    return load_problem(bare_folder)


@pytest.fixture(scope="module")
def stride(strider: Problem, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The strider's gait in a file of its own."""
    path = tmp_path_factory.mktemp("gait") / "stride.toml"
    write_gait(path, strider.baselines["stride"])
    return path


def complaint(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The one line on standard error with which a command ends."""
    assert main([str(argument) for argument in arguments]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said.strip()


def test_a_problem_of_joints_alone_loads_and_reads_back(bare: Problem, tmp_path: Path) -> None:
    text = bare.to_toml("strider.xml")
    assert not {"[gait]", "[objective]", "marker"} & set(text.split())
    path = tmp_path / "problem.toml"
    path.write_text(text)
    (tmp_path / "strider.xml").write_bytes(bare.model_path.read_bytes())
    assert load_problem(tmp_path).file == bare.file.model_copy(update={"model": "strider.xml"})


def test_its_joints_move_as_those_of_the_whole_problem(bare: Problem, strider: Problem) -> None:
    gait = strider.baselines["stride"]
    one, other = Simulator.build(bare).run(gait), Simulator.build(strider).run(gait)
    assert not any(name.partition(".")[0] in ("marker", "load", "pad_speed") for name in one.signals)
    for name, series in one.signals.items():
        assert np.array_equal(series, other[name]), name


def test_metrics_of_the_marker_are_left_out_and_the_others_stay(bare: Problem, strider: Problem) -> None:
    gait = strider.baselines["stride"]
    found = []
    for problem in (bare, strider):
        simulator = Simulator.build(problem)
        found.append(measure(problem, gait, simulator.run(gait), Robot.of(simulator.models[0])))
    fewer, whole = found
    of_marker = {name for name, metric in METRICS.items() if metric.of_marker}
    assert set(whole) - set(fewer) == of_marker
    assert fewer.pop("slip_m") == 0.0  # there are no pads to slip
    assert fewer == {n: v for n, v in whole.items() if n not in {*of_marker, "slip_m"}}


def test_without_an_objective_nothing_is_asked(bare: Problem) -> None:
    check_objective(bare)
    evaluation = evaluate(bare, [{"tilt_rad": 1.0}], ["ok"])
    assert (evaluation.cost, evaluation.violations, evaluation.constraints_met) == (0.0, {}, True)


def test_model_command_simulate_and_sweep_work(
    bare_folder: Path, stride: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["model", str(bare_folder), "--out", "m.xml"]) == 0
    command = ["command", str(bare_folder), str(stride), "--dt", "0.1", "--duration", "0.3", "--out", "c.csv"]
    assert main(command) == 0
    assert Path("c.csv").read_text().startswith("t_s,rear,front\n0.0,")
    capsys.readouterr()
    assert main(["simulate", str(bare_folder), str(stride), "--csv", "s.csv", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["status"] == "ok"
    assert row["reached"] > 0.9
    assert "marker" not in Path("s.csv").read_text()
    sweep = ["sweep", str(bare_folder), str(stride), "--over", "period_s=0.4,0.5", "--out", "sw", "--json"]
    assert main(sweep) == 0
    assert len(json.loads(capsys.readouterr().out)["rows"]) == 2


def test_check_judges_what_joints_show(bare: Problem, strider: Problem) -> None:
    both = {"baselines": strider.file.baselines}
    walking = Problem.from_file(bare.file.model_copy(update=both), bare.source, bare.model_path)
    names = {finding.name for finding in check(walking, SerialExecutor())}
    assert {"airtime", "timestep_convergence"} <= names  # by contacts and by the servos' angles
    assert not names & {"chaos", "sideways_drift"}


def test_commands_say_which_part_they_need(
    bare_folder: Path, stride: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = bare_folder / "problem.toml"

    def missing(*arguments: object) -> str:
        return complaint(capsys, *arguments).removeprefix(f"gaitopt: {file}: ")

    assert missing("optimise", bare_folder) == "[gait]: missing; optimise needs it"
    assert missing("compare", bare_folder, stride) == "roles.marker: missing; compare needs it"
    export = ("export", bare_folder, stride, "--format", "c", "--out", "x")
    assert missing(*export) == "roles.marker: missing; the replay of an export needs it"
    film = ("simulate", bare_folder, stride, "--video", "x.mp4")
    assert missing(*film) == "roles.marker: missing; a film needs it"
    blind = ("blind", "make", bare_folder, "--cases", "1", "--seed", "1", "--out", "b")
    assert missing(*blind) == "roles.marker: missing; blind make needs it"
    assert missing("simulate", bare_folder, "stride").endswith("baselines: none")
    assert missing("sweep", bare_folder, "--over", "period_s=1") == "no baselines; name a gait"
    assert sorted(path.name for path in Path().iterdir()) == []


@pytest.mark.parametrize(
    ("part", "keys"), [("[objective]", ("objective",)), ("roles.marker", ("roles", "marker"))]
)
def test_optimise_names_the_first_part_missing(
    part: str, keys: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def drop(content: dict[str, Any]) -> None:
        *path, last = keys
        for key in path:
            content = content[key]
        del content[last]

    folder = problem_folder(tmp_path / "robot", STRIDER, drop)
    assert complaint(capsys, "optimise", folder).endswith(f"problem.toml: {part}: missing; optimise needs it")


def test_accessors_say_what_is_missing(bare: Problem, arcfold: Problem) -> None:
    for name, part, user in (
        ("space", "[gait]", "a search for gaits"),
        ("objective", "[objective]", "the cost of a gait"),
        ("marker", "roles.marker", "the motion of the robot"),
    ):
        with pytest.raises(GaitoptError) as error:
            getattr(bare, name)
        assert str(error.value) == f"{bare.source}: {part}: missing; {user} needs it"
    with pytest.raises(GaitoptError, match=r"problem.toml: roles.pads: missing; a test needs it"):
        bare.require("a test", "roles.pads")
    file = arcfold.file.model_copy(update={"gait": None})
    unbounded = Problem.from_file(file, arcfold.source, arcfold.model_path)
    with pytest.raises(GaitoptError, match=r"problem.toml: \[gait\]: missing; plan needs it"):
        Planner(unbounded)
    assert arcfold.require("a test", "[gait]", "[objective]", "roles.marker", "roles.pads") is None


def test_an_effect_of_the_marker_does_not_apply(bare: Problem) -> None:
    with pytest.raises(GaitoptError, match=r"camera_scale: not applicable: .* no roles\.marker"):
        bare.with_effects({"camera_scale": {"scale": 1.1}})


def angles_only(folder: Path, problem: Problem, gait: Gait, stride: Path) -> Path:
    """A data set of two trials of a robot's two hips, with a tenth of a degree of noise."""
    folder.mkdir()
    (folder / stride.name).write_bytes(stride.read_bytes())
    trajectory = Simulator.build(problem).run(gait)
    rng = np.random.default_rng(0)
    text = ""
    for trial in "ab":
        text += (
            f'[[trial]]\nname = "{trial}"\ngait = "{stride.name}"\nfile = "{trial}.csv"\n'
            "starts_at_gait_time_s = 0.0\n[trial.signals]\n"
            '"joint.rear_hip" = "rear_deg"\n"joint.front_hip" = "front_deg"\n'
        )
        rows = ["t_s,rear_deg,front_deg"]
        for i in range(0, len(trajectory.time), 20):
            angles = [np.degrees(trajectory[f"joint.{name}_hip"][i]) for name in ("rear", "front")]
            rear, front = np.array(angles) + rng.normal(0.0, 0.1, 2)
            rows.append(f"{trajectory.time[i]},{rear},{front}")
        (folder / f"{trial}.csv").write_text("\n".join(rows) + "\n")
    (folder / "dataset.toml").write_text(text)
    return folder


@pytest.mark.slow
def test_angles_alone_are_diagnosed(
    bare: Problem, bare_folder: Path, stride: Path, strider: Problem, tmp_path: Path
) -> None:
    weak = bare.with_effects({"servo_torque_limit": {"limit_n_m": 0.025}})
    dataset = angles_only(tmp_path / "data", weak, strider.baselines["stride"], stride)
    effects = "servo_torque_limit,servo_trim"
    assert main(["diagnose", str(bare_folder), str(dataset), "--effects", effects, "--out", "found"]) == 0
    found = json.loads(Path("found/diagnosis.json").read_text())
    assert found["causes"] == ["servo_torque_limit"]
    (effect,) = [e for e in found["effects"] if e["name"] == "servo_torque_limit" and e["target"] == "all"]
    assert effect["parameters"]["limit_n_m"]["value"] == pytest.approx(0.025, rel=0.02)
    assert found["next_experiment"] is None
    assert found["corrected"] == []


def test_comparing_needs_a_marker_in_the_library_too(bare: Problem, strider: Problem) -> None:
    executor: Executor = SerialExecutor()
    with pytest.raises(GaitoptError, match=r"roles.marker: missing; compare needs it"):
        compare(bare, [strider.baselines["stride"]], 1, executor)
