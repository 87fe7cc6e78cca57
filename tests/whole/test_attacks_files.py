"""Attacks on what commands write, and on the tables and numbers that they read."""

import os
import shutil
import stat
from pathlib import Path

import pytest
from helpers import STRIDER, edited, problem_folder
from hostility import make_device, refused, run, within

from gaitopt.diagnose.record.export import ImportOptions
from gaitopt.diagnose.record.importing import import_file
from gaitopt.diagnose.record.tables import read_csv
from gaitopt.gait.gait import write_gait
from gaitopt.problem.problem import load_problem

OVER_INPUTS = {
    "the problem": ("model", "{robot}", "--out", "{robot}/problem.toml"),
    "the model": ("model", "{robot}", "--out", "{robot}/strider.xml"),
    "a problem and its servo": ("correct", "{robot}", "servo-bench", "--out", "{robot}/problem.toml"),
    "the model by another name": ("model", "{robot}", "--out", "{robot}/hard.xml"),
    "an include": ("model", "{robot}", "--out", "{robot}/part.xml"),
    "a gait": ("simulate", "{robot}", "{robot}/gait.toml", "--csv", "{robot}/gait.toml"),
    "a gait of a run": ("simulate", "{robot}", "{robot}/run", "--csv", "{robot}/run/best.toml"),
    "a gait to command": (
        *("command", "{robot}", "{robot}/gait.toml", "--dt", "1", "--duration", "2"),
        *("--out", "{robot}/../robot/gait.toml"),
    ),
    "a link to the model": ("model", "{robot}", "--out", "{robot}/link.xml"),
    "a pipe": ("simulate", "{robot}", "stride", "--csv", "{robot}/pipe"),
    "a device": ("simulate", "{robot}", "stride", "--csv", "{robot}/device"),
    "a film over a link": ("simulate", "{robot}", "stride", "--video", "{robot}/link.gif"),
    "a film over a pipe": ("simulate", "{robot}", "stride", "--video", "{robot}/pipe.gif"),
}


@pytest.mark.parametrize("attack", OVER_INPUTS)
def test_a_command_replaces_no_link_no_device_and_nothing_that_it_reads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], attack: str
) -> None:
    robot = problem_folder(tmp_path / "robot", STRIDER, lambda c: c.update(model="strider.xml"))
    edited(robot / "strider.xml", "<worldbody>", '<include file="part.xml"/><worldbody>')
    (robot / "part.xml").write_text("<mujocoinclude/>")
    (robot / "hard.xml").hardlink_to(robot / "strider.xml")
    (robot / "link.xml").symlink_to("strider.xml")
    (robot / "link.gif").symlink_to("gait.toml")
    write_gait(robot / "gait.toml", load_problem(robot).baselines["stride"])
    (robot / "run").mkdir()
    shutil.copy(robot / "gait.toml", robot / "run" / "best.toml")
    for name in ("pipe", "pipe.gif"):
        os.mkfifo(robot / name)
    if attack == "a device":
        make_device(robot / "device")
    before = {
        path: (path.lstat().st_ino, path.lstat().st_mtime_ns, path.lstat().st_mode)
        for path in sorted(robot.rglob("*"))
    }
    code, said = run(capsys, *(str(word).format(robot=robot) for word in OVER_INPUTS[attack]))
    assert code == 1
    assert "cannot be written" in said
    after = {
        path: (path.lstat().st_ino, path.lstat().st_mtime_ns, path.lstat().st_mode)
        for path in sorted(robot.rglob("*"))
    }
    assert after == before


def test_an_old_result_is_replaced_and_keeps_its_mode(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "model.xml"
    out.write_text("old")
    out.chmod(0o640)
    assert run(capsys, "model", STRIDER, "--out", out)[0] == 0
    assert out.read_text().startswith("<mujoco")
    assert stat.S_IMODE(out.stat().st_mode) == 0o640


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("1_000,0", "found '1_000'"),
        ("\u0661,0", "found"),
        ("\uff11,0", "found"),
        ("0,\u00b2", "found"),
        ("0x10,0", "found '0x10'"),
    ],
)
def test_a_table_has_plain_digits(line: str, said: str) -> None:
    Path("walk.csv").write_text(f"t_s,x_m\n{line}\n2000,0\n3000,1\n")
    for call in (
        lambda: import_file(Path("walk.csv"), ImportOptions()),
        lambda: [read_csv(Path("walk.csv")).column(name) for name in ("t_s", "x_m")],
    ):
        assert said in refused(call)


@pytest.mark.parametrize("text", ["1_0", "\u0661\u0660", "\uff11", "1e1_0"])
@pytest.mark.parametrize(
    "arguments",
    [
        ("command", STRIDER, "stride", "--dt", "{}", "--duration", "2", "--out", "o.csv"),
        ("optimise", STRIDER, "--budget", "{}"),
        ("simulate", STRIDER, "stride", "--set", "k_servo={}"),
        ("export", STRIDER, "stride", "--format", "c", "--slew", "{}", "--out", "o"),
    ],
)
def test_an_option_has_plain_digits(
    capsys: pytest.CaptureFixture[str], arguments: tuple[object, ...], text: str
) -> None:
    try:
        code, said = run(capsys, *(str(word).format(text) for word in arguments))
    except SystemExit as stop:
        code, said = int(stop.code or 0), capsys.readouterr().err
    assert code in (1, 2)
    assert text in said or ascii(text)[1:-1] in said
    assert list(Path().iterdir()) == []


ENDLESS_TABLES = {
    "columns": lambda: "t_s," + ",".join(f"x{n}_deg" for n in range(200_000)) + "\n1,2\n",
    "columns of one name": lambda: "t_s," + "x," * 200_000 + "\n1,2\n",
    "a wide head over many rows": lambda: (
        "t_s," + ",".join(f"x{n}_deg" for n in range(9_000)) + "\n1" * 200_000
    ),
    "lines": lambda: "t_s,x_m" + "\n" * 21_000_000,
    "lines of other kinds": lambda: "t_s,x_m" + "\x0b" * 21_000_000,
    "cells": lambda: "t_s,x_m\n" + "," * 21_000_000,
}


@pytest.mark.parametrize("attack", ENDLESS_TABLES)
def test_a_table_without_end_is_one_line_in_time(tmp_path: Path, attack: str) -> None:
    path = tmp_path / "walk.csv"
    path.write_text(ENDLESS_TABLES[attack]())
    with within(30):
        refused(lambda: import_file(path, ImportOptions()))
        table = read_csv(path) if attack.startswith("a wide") else None
    if table is None:
        refused(lambda: read_csv(path))
