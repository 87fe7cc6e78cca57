"""`gaitopt export`: its checks, its messages and its files."""

import json
from concurrent.futures import Executor
from pathlib import Path

import pytest
from helpers import STRIDER

from gaitopt.cli.app import main
from gaitopt.core.errors import GaitoptError
from gaitopt.core.folders import check_new_or_empty
from gaitopt.export.formats import FORMATS
from gaitopt.export.handover import Choices, prepare, write_folder
from gaitopt.gait.table import read_table
from gaitopt.problem.problem import Problem, load_problem


@pytest.mark.parametrize("name", list(FORMATS))
def test_every_format_is_written_and_read_back(
    wired_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    out = tmp_path / "deep" / "out"
    command = ["export", wired_folder, "stride", "--format", name, "--out", out, "--led-pin", 2, "--json"]
    assert main([str(part) for part in command]) == 0
    answer = json.loads(capsys.readouterr().out)
    written = sorted(path for path in out.rglob("*") if path.is_file())
    assert sorted(answer["files"]) == [str(path) for path in written]
    assert sorted(path.name for path in out.parent.iterdir()) == ["out"]
    problem = load_problem(wired_folder)
    table = out / FORMATS[name].table_file
    assert read_table(table).hash == answer["hash"]
    assert problem.find_gait(str(table)) == problem.baselines["stride"]
    assert answer["from_datasheet"]["rear"][0] in ("neutral_us", "bus.neutral_steps")
    assert answer["ideal_speed_m_s"] > 0.0
    assert answer["loss"] == pytest.approx(1.0 - answer["replayed_speed_m_s"] / answer["ideal_speed_m_s"])
    assert main(["simulate", str(wired_folder), str(table), "--json"]) == 0
    one = json.loads(capsys.readouterr().out)
    assert main(["simulate", str(wired_folder), "stride", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == one


def test_the_same_export_twice_is_the_same_bytes(wired: Problem, serial: Executor) -> None:
    made = [prepare(wired, wired.baselines["stride"], Choices("c"), serial).files for _ in range(2)]
    assert made[0] == made[1]


def test_what_is_said_without_json(
    wired_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["export", str(wired_folder), "square", "--format", "csv", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "rear: from the datasheet, not measured: neutral_us, min_us," in said
    assert "rear: the servo falls up to 30° and 0.049 s behind" in said
    assert "mm/s as the servos will get it: a loss of" in said
    assert str(out / "table.csv") in said


@pytest.mark.parametrize(
    ("change", "said"),
    {
        "no pin": (("--format", "arduino"), "channels.rear.servo.pin: missing; this format drives the pins"),
        "slew": (
            ("--format", "c", "--slew", "sevro"),
            "--slew: speed: found 'sevro'; allowed: off, servo, or",
        ),
        "negative slew": (
            ("--format", "c", "--slew", "-3"),
            "--slew: speed: found '-3'; allowed: off, servo",
        ),
        "samples": (("--format", "c", "--samples", "3"), "--samples: found 3; allowed: 4 to 1024"),
    }.values(),
)
def test_a_wrong_request_is_one_line_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], change: tuple[str, ...], said: str
) -> None:
    out = tmp_path / "out"
    assert main(["export", str(STRIDER), "stride", "--out", str(out), *change]) == 1
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_a_folder_in_use_is_refused_before_anything_runs(
    wired_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("keep")
    assert main(["export", str(wired_folder), "stride", "--format", "c", "--out", str(out)]) == 1
    assert (
        capsys.readouterr().err == f"gaitopt: --out: {out} is not empty; allowed: a new or an empty folder\n"
    )
    assert [path.name for path in out.iterdir()] == ["mine.txt"]
    with pytest.raises(GaitoptError, match="is a file; allowed"):
        check_new_or_empty(out / "mine.txt")


def test_a_write_that_fails_half_way_leaves_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(GaitoptError, match="cannot be written"):
        write_folder(out, {"fine.txt": "x", "a/b/c.txt": "the parent of b is not made"})
    assert list(tmp_path.iterdir()) == []
    out.mkdir()
    assert write_folder(out, {"a/b.txt": "x"}) == [out / "a" / "b.txt"]
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
