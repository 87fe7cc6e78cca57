"""`gaitopt correct`: a learnt servo in the problem of another robot, from a run folder to a file."""

import json
from pathlib import Path

import pytest
from bench_runs import bench_run
from commandline import Run, refused, strictly
from helpers import STRIDER, problem_folder

from gaitopt import correct_servos
from gaitopt.core.errors import GaitoptError
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.rollout import Simulator


@pytest.fixture
def bench() -> Path:
    """The run folder of a diagnosis of the servo on a bench."""
    return bench_run(Path("bench"))


def test_the_file_is_a_problem_with_the_servo(gaitopt: Run, bench: Path) -> None:
    code, out, err = gaitopt("correct", "arcfold", bench, "--out", "mine.toml")
    assert (code, err) == (0, "")
    assert "left out: servo_trim: mounting" in out
    assert out.endswith("wrote mine.toml\n")
    assert out.count("N m/rad") == 3
    written = load_problem("mine.toml")
    assert written.file.effects["servo_gain"]["scale"] == pytest.approx(12.5 / 3.0)
    assert written.file.effects["servo_stiction"] == {"torque_n_m": 0.01, "target": "all"}
    assert "servo_trim" not in written.file.effects
    assert Simulator.build(written).run(written.baselines["square-1s"], duration=0.5).status == "ok"
    assert {str(path) for path in Path().rglob("mine*")} == {"mine.toml", "mine"}
    assert [path.name for path in Path("mine").iterdir()] == ["model.xml"]


def test_json_is_the_answer_of_the_job(gaitopt: Run, bench: Path, arcfold: Problem) -> None:
    code, out, err = gaitopt("correct", "arcfold", bench, "--json", "--channel", "foot1=servo")
    assert (code, err) == (0, "")
    answer = strictly(out)
    done = correct_servos(arcfold, bench, channels={"foot1": "servo"})
    assert done.file is None
    assert answer == json.loads(json.dumps(done.to_dict())) | {"file": "arcfold-corrected.toml"}
    assert {row["channel"] for row in answer["rows"]} == {"foot1"}
    assert {row["figure"]: row["new"] for row in answer["rows"]}["stiction"] == 0.01
    assert [row["what"] for row in answer["left_out"]] == ["servo_trim"]
    assert load_problem(answer["file"]).file.effects == answer["effects"]


def test_a_file_beside_the_problem_shares_its_model(gaitopt: Run, bench: Path) -> None:
    robot = problem_folder(Path("robot"), STRIDER)
    before = {path.name for path in robot.iterdir()}
    assert gaitopt("correct", robot, bench, "--out", robot / "corrected.toml")[0] == 0
    assert {path.name for path in robot.iterdir()} == before | {"corrected.toml"}
    assert load_problem(robot / "corrected.toml").model_path == robot / "strider.xml"
    assert load_problem(robot).file.effects == {}


def test_a_robot_in_the_hand_shares_no_model_with_its_file(gaitopt: Run, bench: Path) -> None:
    held = load_problem("arcfold-held").source
    Path("held").mkdir()
    (Path("held") / "problem.toml").write_text(held.read_text())
    assert gaitopt("correct", "held", bench, "--out", "held/corrected.toml")[0] == 0
    written = load_problem("held/corrected.toml")
    assert written.model_path == Path("held/corrected/model.xml")
    assert Simulator.build(written).models[0].nv == Simulator.build(load_problem("held")).models[0].nv


def test_the_same_command_again_replaces_its_own_files_alone(gaitopt: Run, bench: Path) -> None:
    assert gaitopt("correct", "arcfold", bench)[0] == 0
    first = Path("arcfold-corrected.toml").read_bytes()
    assert gaitopt("correct", "arcfold", bench)[0] == 0
    assert Path("arcfold-corrected.toml").read_bytes() == first
    Path("other").mkdir()
    (Path("other") / "model.xml").write_text("mine")
    said = "other is not empty; allowed: a new or an empty folder"
    assert said in refused(gaitopt, "correct", "arcfold", bench, "--out", "other.toml")
    assert (Path("other") / "model.xml").read_text() == "mine"


def test_a_model_folder_that_is_gone_is_written_again(gaitopt: Run, bench: Path) -> None:
    assert gaitopt("correct", "arcfold", bench)[0] == 0
    (Path("arcfold-corrected") / "model.xml").unlink()
    Path("arcfold-corrected").rmdir()
    assert gaitopt("correct", "arcfold", bench)[0] == 0
    assert load_problem("arcfold-corrected.toml").model_path.is_file()


def test_what_is_read_is_not_overwritten(gaitopt: Run, bench: Path) -> None:
    robot = problem_folder(Path("robot"), STRIDER)
    for out in (robot / "problem.toml", robot / "strider.xml"):
        assert "the command reads it" in refused(gaitopt, "correct", robot, bench, "--out", out)
    said = refused(gaitopt, "correct", bench, bench / "corrected.toml", "--out", bench / "corrected.toml")
    assert "bench/corrected.toml: cannot be written: the command reads it" in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--out", "gone/mine.toml"), "gone/mine.toml: cannot be written: No such folder"),
        (("--out", "mine"), "--out: found mine; allowed: a file with a suffix, such as mine.toml"),
        (("--channel", "foot=servo"), "unknown channel 'foot'; known: mid_act, foot1, foot2 (nearest"),
    ],
)
def test_a_mistake_is_one_line(gaitopt: Run, bench: Path, arguments: tuple[str, ...], said: str) -> None:
    assert said in refused(gaitopt, "correct", "arcfold", bench, *arguments)


def test_a_channel_without_its_servo_is_wrong_usage(gaitopt: Run, bench: Path) -> None:
    code, _, err = gaitopt("correct", "arcfold", bench, "--channel", "foot1")
    assert code == 2
    assert "found 'foot1'; allowed: CHANNEL=BENCH_CHANNEL" in err


def test_a_diagnosis_without_a_correction_is_one_line(gaitopt: Run, bench: Path) -> None:
    (bench / "corrected.toml").unlink()
    said = "bench: no corrected.toml: the diagnosis found no robot that predicts better"
    assert said in refused(gaitopt, "correct", "arcfold", bench)


def test_an_unknown_effect_in_a_run_is_one_line(gaitopt: Run, bench: Path) -> None:
    path = bench / "corrected.toml"
    path.write_text(path.read_text().replace("effects.servo_gain", "effects.servo_gains"))
    said = refused(gaitopt, "correct", "arcfold", bench)
    assert "bench/corrected.toml: unknown effect in effects: 'servo_gains'" in said
    assert "(nearest: 'servo_gain')" in said


def test_nothing_is_left_of_a_file_that_cannot_be_written(
    arcfold: Problem, bench: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from gaitopt.jobs import correct

    def full(path: Path, text: str) -> None:
        raise GaitoptError(f"{path}: cannot be written: No space left on device")

    monkeypatch.setattr(correct, "write_text", full)
    with pytest.raises(GaitoptError, match="No space left"):
        correct_servos(arcfold, bench, out="mine.toml")
    assert {path.name for path in Path().iterdir()} == {"bench"}


@pytest.mark.parametrize(
    "link", ["arcfold-corrected", "arcfold-corrected/model.xml", "arcfold-corrected/assets"]
)
def test_the_folder_of_the_model_is_no_link(gaitopt: Run, bench: Path, link: str) -> None:
    """Such as one in a stranger's folder, beside a file that looks like an earlier answer."""
    victim = Path("victim")
    victim.mkdir()
    (victim / "model.xml").write_text("mine")
    Path("arcfold-corrected.toml").write_text('model = "arcfold-corrected/model.xml"\n')
    Path(link).parent.mkdir(exist_ok=True)
    Path(link).symlink_to((victim / "model.xml" if link.endswith("xml") else victim).resolve())
    assert "found a link" in refused(gaitopt, "correct", "arcfold", bench)
    assert [path.read_text() for path in victim.iterdir()] == ["mine"]
