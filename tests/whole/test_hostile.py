"""Hostile and broken files, one by one: what the fuzz found, extremes, what strangers' files may not do."""

import ast
import errno
import json
import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import tomli_w
from helpers import STRIDER, edited, problem_folder

import gaitopt
from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import inside, read_json, read_toml, write_text
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.diagnose.record.importers import Options, import_file, import_files
from gaitopt.diagnose.words import answer
from gaitopt.gait.calibration import Calibration
from gaitopt.gait.gait import Channel, Gait, read_gait, write_gait
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.journal import Entry, Journal
from gaitopt.optimise.run import Request
from gaitopt.problem.model import build_model, carrying, model_assets
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.report.page import Page, Section, Table
from gaitopt.runs.results import RunFolder
from gaitopt.simulation.rollout import NOMINAL
from gaitopt.simulation.setup import RobotSetup

PACKAGE = Path(gaitopt.__file__).parent
CUBE = b"v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\nv 0 0 0.01\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def refused(call: Callable[[], object]) -> str:
    """What the error says: a line."""
    with pytest.raises(GaitoptError) as caught:
        call()
    text = str(caught.value)
    assert text.isprintable()
    assert len(text) < 3000
    return text


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str]:
    """Run a command in this process; return its exit code and what it said on standard error."""
    capsys.readouterr()
    code = cli.main([str(argument) for argument in arguments])
    err = capsys.readouterr().err
    assert err.count("\n") == (code != 0)
    return code, err


def with_element(folder: Path, element: str, where: str = "</worldbody>") -> Problem:
    problem_folder(folder, STRIDER)
    edited(folder / "strider.xml", where, where + element)
    return load_problem(folder)


# --- what the fuzz found ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = " + 3000 * "[" + 3000 * "]", "not TOML: nested too deep"),
        ("a = " + 3000 * "{a=", "not TOML: nested too deep"),
        ("a = " + 5000 * "9", "not TOML: Exceeds the limit"),
        ("a = 0x" + 5000 * "f", "period_s: missing"),
        ("period_s = 0x" + 5000 * "f", "period_s: found "),
        ('period_s = "' + 100_000 * "x" + '"', "period_s: found 'xxx"),
        ("period_s = " + 50 * "[" + 50 * "]", "period_s: found [[["),
        ('"' + 100_000 * "k" + '" = 1', "period_s: missing"),
    ],
)
def test_a_deep_or_endless_toml_file_is_one_short_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "gait.toml"
    path.write_text(text)
    assert said in refused(lambda: read_gait(path))


@pytest.mark.parametrize("text", ["", "{", 3000 * "[", '{"a":' * 3000, 5000 * "9", "nan nan"])
def test_a_broken_json_file_is_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "answer.json"
    path.write_text(text)
    assert "answer.json: not JSON: " in refused(lambda: read_json(path))


@pytest.mark.parametrize("tiny", [5e-324, 1e-310, 2.3e-308])
def test_a_ramp_shorter_than_any_number_is_a_square_wave(tiny: float) -> None:
    """It overflowed, and NumPy warned on standard error."""
    waves = [
        Gait(1.0, {"servo": Channel(duty=0.5, phase=0.1, amplitude_deg=9.0, smoothing=smoothing)})
        for smoothing in (tiny, 0.0)
    ]
    time = np.linspace(-2.0, 2.0, 1001)
    assert np.array_equal(waves[0].targets(time), waves[1].targets(time))


def test_an_axis_beyond_the_square_root_of_floats_is_refused(tmp_path: Path) -> None:
    folder = problem_folder(
        tmp_path / "robot", STRIDER, lambda c: c["roles"].update(forward=[0.0, 1e300, 0.0])
    )
    assert "roles.forward.1: found 1e+300; allowed: " in refused(lambda: load_problem(folder))


@pytest.mark.parametrize(
    ("key", "value"),
    [("working", {"timestep_s": 1e-9, "integrator": "Euler"}), ("horizon", {"transient_s": 1e308})],
)
def test_a_simulation_without_end_is_refused(tmp_path: Path, key: str, value: dict) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER, lambda c: c["simulation"].update({key: value}))
    assert f"simulation.{key}." in refused(lambda: load_problem(folder))


def test_a_place_at_the_end_of_floats_never_reaches_mujoco(tmp_path: Path) -> None:
    """The process aborted on this input once in the long fuzz, and not when it was tried again."""
    problem = with_element(tmp_path / "robot", '<body pos="1e300 0 0"/>', "<worldbody>")
    assert "body pos: found '1e300 0 0'; allowed: at most 1e+10" in refused(lambda: build_model(problem))


def test_an_xpath_of_a_thousand_steps_is_one_line(tmp_path: Path) -> None:
    def lengthen(content: dict) -> None:
        content["parameters"]["mass"]["sets"] = [".//" + 3000 * "geom/../" + "geom/@mass"]

    folder = problem_folder(tmp_path / "robot", STRIDER, lengthen)
    assert "parameters.mass.sets: path: found '" in refused(lambda: build_model(load_problem(folder)))


def test_a_slew_beyond_any_servo_is_the_longest_pulse() -> None:
    """It overflowed; a table holds no larger number."""
    assert Calibration().pulse_per_frame_us(1e308, 0.02) == 65535
    assert Calibration(us_per_deg=1e308).pulse_per_frame_us(1e308, 0.02) == 65535


def test_a_deeplabcut_head_of_uneven_rows_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    path.write_text("scorer,net,net\nbodyparts,nose,nose\ncoords,x,y,likelihood\n0,1,2,0.9\n")
    assert "3 cells of bodyparts over 4 of coords" in refused(lambda: import_file(path, Options(fps=25.0)))


@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("", "1 time stamps are missing"),
        ("1e300", "found '1e300'"),
        ("inf", "found 'inf'"),
    ],
)
def test_a_time_stamp_that_no_clock_gives_is_one_line(tmp_path: Path, cell: str, said: str | None) -> None:
    path = tmp_path / "walk.csv"
    path.write_text("\n".join(["t_s,x_m", *(f"{0.1 * i},{i}" for i in range(30)), f"{cell},1"]) + "\n")
    assert (said or "") in refused(lambda: import_file(path, Options()))


@pytest.mark.parametrize(
    "options",
    [
        Options(fps=5e-324),
        Options(fps=float("nan")),
        Options(scale_m_per_px=1e308),
        Options(sync_at_s=np.nan),
    ],
)
def test_an_option_that_no_camera_has_is_one_line(tmp_path: Path, options: Options) -> None:
    assert "gait import: --" in refused(lambda: import_file(tmp_path / "walk.csv", options)).replace(
        "opt", ""
    )


def test_a_file_whose_name_is_no_text_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "walk\udcff.csv"
    path.write_text("t_s,x_m\n" + "\n".join(f"{0.1 * i},{i}" for i in range(30)))
    out = tmp_path / "out"
    assert "no Unicode text" in refused(lambda: import_files([path], ["stride"], out, Options()))
    assert not out.exists()


def test_a_gait_called_as_the_data_set_itself_is_not_overwritten(tmp_path: Path) -> None:
    walk, gait = tmp_path / "walk.csv", tmp_path / "dataset.toml"
    walk.write_text("t_s,x_m\n" + "\n".join(f"{0.1 * i},{i}" for i in range(30)))
    gait.write_text("mine")
    said = refused(lambda: import_files([walk], [str(gait)], tmp_path / "out", Options()))
    assert "a data set has a file of this name" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("existed", [True, False])
@pytest.mark.parametrize("why", ["name", "disk"])
def test_what_cannot_become_a_problem_leaves_nothing_behind(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    why: str,
    existed: bool,
) -> None:
    """Once all is copied, over a name that no problem may have, or in a copy, when the disk is full."""
    mjcf, out = problem_folder(tmp_path / "robot", STRIDER) / "strider.xml", tmp_path / "out"
    if why == "name":
        edited(mjcf, 'site name="nose"', 'site name="no&#x202e;se"')
        said = "roles.marker: found 'no\\u202ese'; allowed: a name without control characters"
    else:
        said = "cannot be written: No space left on device"

        def full(source: Path, target: Path) -> None:
            target.write_bytes(source.read_bytes()[:100])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        monkeypatch.setattr(shutil, "copyfile", full)
    if existed:
        out.mkdir()
    code, err = run(capsys, "new", "bot", "--mjcf", mjcf, "--out", out)
    assert code == 1
    assert said in err
    assert out.exists() is existed
    assert not (existed and list(out.iterdir()))


@pytest.fixture
def finished(tmp_path: Path) -> Path:
    """A run folder whose run says that it is done."""
    problem, request = load_problem(STRIDER), Request(budget=1)
    folder = RunFolder.create(tmp_path / "run", problem, request)
    row = {"name": "best", "period_s": 0.5, "speed_m_s": None, "speed_ci90_m_s": [None, None]}
    row |= {"constraints_met": False, "violations": {}, "status": "diverged: badqacc"}
    summary = {"best": row, "baselines": [row | {"speed_m_s": 0.01}], "ratio_to_best_baseline": None}
    with folder:
        (folder.path / "evaluations.csv").write_text("one\ntwo\n")
        folder.file("summary.json", lambda path: write_text(path, json.dumps(summary)))
    return tmp_path / "run"


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"best": 3}', '{"best": {"name": "x"}, "baselines": []}'])
def test_a_summary_that_was_changed_is_one_line(
    finished: Path, capsys: pytest.CaptureFixture[str], text: str
) -> None:
    (finished / "summary.json").write_text(text)
    code, err = run(capsys, "optimise", finished, "--resume", finished)
    assert code == 1
    assert err.startswith(f"gaitopt: {finished / 'summary.json'}: ")


def test_a_run_whose_winner_failed_where_it_was_verified_says_so(
    finished: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["optimise", str(finished), "--resume", str(finished)]) == 0
    out = capsys.readouterr().out
    assert "The best gait of the search failed where it was verified: diverged: badqacc." in out


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"answer": 1, "explanation": []}', '{"answer": ""}'])
def test_a_diagnosis_that_was_changed_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str
) -> None:
    (tmp_path / "diagnosis.json").write_text(text)
    code, err = run(capsys, "diagnose", STRIDER, "none", "--resume", tmp_path)
    assert code == 1
    assert err.startswith(f"gaitopt: {tmp_path / 'diagnosis.json'}: not ")


@pytest.mark.parametrize("rivals", [[], ["servo_gain"]])
def test_a_diagnosis_with_a_gap_of_no_part_has_an_answer(rivals: list[str]) -> None:
    """Every part of it within the floor: the answer looked for the largest."""
    gap = {"heldout_before_m": 0.004, "heldout_after_m": 0.004, "floor_m": 0.001, "shrinkage": 0.0}
    found = SimpleNamespace(rivals=rivals, best=None, causes=[])
    said = answer(SimpleNamespace(gap=gap, verdict="unexplained", found=found, where=[], causes=[]))  # type: ignore[arg-type]
    assert "4 mm RMS of the marker" in said


def test_a_journal_with_a_coordinate_that_is_no_number_is_one_line(tmp_path: Path) -> None:
    problem, path = load_problem(STRIDER), tmp_path / "evaluations.csv"
    point = problem.space.encode(problem.baselines["stride"])
    gait = problem.space.decode(point)
    setting = RobotSetup.of(problem, (NOMINAL,), problem.simulation.working)
    evaluation, _ = Evaluator(setting, SerialExecutor())([gait])[0]
    point[3] = np.nan
    Journal(path, problem).append([Entry(0, "test", point, gait, evaluation, 1.0)])
    assert refused(lambda: Journal(path, problem)) == f"{path}: line 2: a coordinate that is no number"


def test_what_a_file_says_cannot_steer_a_terminal(tmp_path: Path) -> None:
    path = tmp_path / "\x1b[31mred\n.toml"
    path.write_text('"\\u001b[2J\\u202e" = 1\nperiod_s = "\\u0007"')
    said = refused(lambda: read_gait(path))
    assert "\\x1b[31mred" in said
    assert refused(lambda: load_problem("\x1b[2J\udcff"))


STEERING = ["\x1b[31mred", "\u202eback", "two\nlines", "\x07", "\x9b2J"]
PLAIN_NAME = "allowed: a name without control characters"


@pytest.mark.parametrize("name", STEERING)
@pytest.mark.parametrize("where", ["baselines", "channels", "parameters", "marker", "pads", "body", "hinges"])
def test_a_name_in_a_problem_cannot_steer_a_terminal(tmp_path: Path, where: str, name: str) -> None:
    def rename(content: dict) -> None:
        if where == "marker":
            content["roles"]["marker"] = name
        elif where in ("pads", "body", "hinges"):
            content["roles"][where] = [name]
        else:
            content[where][name] = content[where].pop(next(iter(content[where])))

    folder = problem_folder(tmp_path / "robot", STRIDER, rename)
    assert PLAIN_NAME in refused(lambda: load_problem(folder))


@pytest.mark.parametrize("name", STEERING)
@pytest.mark.parametrize("where", ["name", "gait", "file", "time", "signal", "column"])
def test_a_name_in_a_data_set_cannot_steer_a_terminal(tmp_path: Path, where: str, name: str) -> None:
    (tmp_path / "walk.csv").write_text("t_s,x_m\n" + "\n".join(f"{0.1 * i},{i}" for i in range(60)))
    entry: dict = {"name": "a", "gait": "stride", "file": "walk.csv", "signals": {"marker.x": "x_m"}}
    (tmp_path / "dataset.toml").write_text(tomli_w.dumps({"trial": [entry]}))
    known = ["marker.x", name]
    assert load_dataset(tmp_path, load_problem(STRIDER), known).trials[0].name == "a"
    entry |= {"signal": {"signals": {name: "x_m"}}, "column": {"signals": {"marker.x": name}}}.get(
        where, {where: name}
    )
    (tmp_path / "dataset.toml").write_text(tomli_w.dumps({"trial": [entry]}))
    assert PLAIN_NAME in refused(lambda: load_dataset(tmp_path, load_problem(STRIDER), known))


@pytest.mark.parametrize("name", STEERING)
def test_a_trial_is_not_named_after_a_file_that_steers_a_terminal(tmp_path: Path, name: str) -> None:
    walk, out = tmp_path / f"{name}.csv", tmp_path / "out"
    walk.write_text("t_s,x_m\n" + "\n".join(f"{0.1 * i},{i}" for i in range(60)))
    assert PLAIN_NAME in refused(lambda: import_files([walk], ["stride"], out, Options()))
    assert not out.exists()


def test_what_a_terminal_cannot_show_is_escaped(tmp_path: Path) -> None:
    """Standard output that knows ASCII alone, and a name that is no text at all."""
    code = "from gaitopt.cli import main; raise SystemExit(main())"
    environment = os.environ | {"PYTHONIOENCODING": "ascii"}
    done = subprocess.run(
        [sys.executable, "-c", code, "model", str(STRIDER), "--out", str(tmp_path / "ü\udcff.xml")],
        capture_output=True,
        env=environment,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"\\xfc" in done.stdout


# --- extremes ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["a b", "naïve 机器人", "quo'te\"s", "new\nline", "-rf", "*?[x]", "{}", "%s", "é" * 60]
)
def test_folders_of_any_name_work(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    folder = problem_folder(tmp_path / name, STRIDER)
    write_gait(folder / f"{name}.toml", load_problem(folder).baselines["stride"])
    out = folder / f"{name}.csv"
    arguments = ("command", folder, folder / f"{name}.toml", "--dt", 0.1, "--duration", 1, "--out", out)
    assert run(capsys, *arguments) == (0, "")
    assert len(out.read_text().splitlines()) == 11


@pytest.mark.parametrize(
    "change", [lambda t: t.replace("\n", "\r\n"), lambda t: "\ufeff" + t, lambda t: t + "\n\n"]
)
def test_the_text_files_of_other_systems_are_read(tmp_path: Path, change: Callable[[str], str]) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER)
    for name in ("problem.toml", "strider.xml"):
        (folder / name).write_bytes(change((folder / name).read_text()).encode())
    assert load_problem(folder).file == load_problem(STRIDER).file
    assert build_model(load_problem(folder)).nu == 2


@pytest.mark.parametrize("content", [b"", b"\n", b"\x00", b"\xff\xfe", b"t_s", b"x" * 100_000])
@pytest.mark.parametrize("command", ["gait", "problem", "mjcf", "import", "dataset"])
def test_empty_and_one_line_files_are_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes, command: str
) -> None:
    path = tmp_path / "file"
    path.write_bytes(content)
    if command == "mjcf":
        problem_folder(tmp_path / "robot", STRIDER)
        (tmp_path / "robot" / "strider.xml").write_bytes(content)
    if command == "dataset":
        with pytest.raises(GaitoptError):
            load_dataset(path, load_problem(STRIDER), ["marker.x"])
        return
    arguments = {
        "gait": ("command", STRIDER, path, "--dt", 0.1, "--duration", 1, "--out", tmp_path / "out"),
        "problem": ("model", path, "--out", tmp_path / "out"),
        "mjcf": ("model", tmp_path / "robot", "--out", tmp_path / "out"),
        "import": ("import", path, "--gait", "stride", "--out", tmp_path / "out"),
    }[command]
    assert run(capsys, *arguments)[0] == 1
    assert not (tmp_path / "out").exists()


def test_a_file_that_vanishes_while_it_is_read_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Between looking and reading: each look finds the file, each read does not."""
    folder = problem_folder(tmp_path / "robot", STRIDER)
    monkeypatch.setattr(Path, "is_file", lambda self: True)
    for name in ("strider.xml", "problem.toml"):
        (folder / name).unlink()
        code, err = run(capsys, "model", folder, "--out", tmp_path / "out.xml")
        assert (code, "no such file" in err or "found 0 MJCF files" in err) == (1, True)


def test_a_file_that_changes_while_it_is_read_is_read_as_it_was_or_refused(tmp_path: Path) -> None:
    """Files are read whole, once: a problem and what is made of it agree."""
    problem = carrying(load_problem(problem_folder(tmp_path / "robot", STRIDER)))
    before = build_model(problem).key_qpos
    (tmp_path / "robot" / "strider.xml").write_text("<mujoco/>")
    assert np.array_equal(build_model(problem).key_qpos, before)


def test_no_figure_depends_on_a_clock_that_can_jump() -> None:
    """`time.monotonic` cannot; the calendar's clock is read nowhere."""
    for path, tree in trees():
        for node in ast.walk(tree):
            called = ast.unparse(node.func) if isinstance(node, ast.Call) else ""
            assert called not in {"time.time", "datetime.now", "datetime.datetime.now", "time.localtime"}, (
                path
            )


# --- strangers' files -------------------------------------------------------------------------


@cache
def trees() -> list[tuple[str, ast.Module]]:
    paths = sorted(PACKAGE.rglob("*.py"))
    assert len(paths) > 60
    return [(str(path), ast.parse(path.read_text())) for path in paths]


def test_nothing_runs_code_from_a_file() -> None:
    """No eval, exec, pickle, YAML, shell or other program anywhere; arrays are read without objects."""
    modules = {"pickle", "cPickle", "dill", "shelve", "marshal", "yaml", "subprocess", "code", "runpy", "imp"}
    calls = {
        "eval",
        "exec",
        "compile",
        "__import__",
        "breakpoint",
        "os.system",
        "os.popen",
        "execfile",
        "input",
    }
    for path, tree in trees():
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                assert not {alias.name.partition(".")[0] for alias in node.names} & modules, path
            elif isinstance(node, ast.ImportFrom):
                assert (node.module or "").partition(".")[0] not in modules, path
            elif isinstance(node, ast.Call):
                called = ast.unparse(node.func)
                assert called not in calls, f"{path}: {called}"
                assert not called.startswith(("os.exec", "os.spawn")), f"{path}: {called}"
                assert not any(k.arg == "shell" for k in node.keywords), path
                assert not any(
                    k.arg == "allow_pickle" and ast.unparse(k.value) != "False" for k in node.keywords
                ), path


@pytest.fixture
def secret(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Files outside the problem's folder: beside it, and in the working directory."""
    for folder in (tmp_path, tmp_path / "cwd"):
        folder.mkdir(exist_ok=True)
        (folder / "secret.obj").write_bytes(CUBE)
        (folder / "secret.xml").write_text('<mujocoinclude><site name="secret"/></mujocoinclude>')
    monkeypatch.chdir(tmp_path / "cwd")
    return tmp_path


def nested(body: str) -> str:
    return (
        f'<mujoco><asset>{body}</asset><worldbody><body name="b"><geom size="1"/></body></worldbody></mujoco>'
    )


REACHING = {
    "an absolute include": '<include file="{secret}/secret.xml"/>',
    "an include from above": '<include file="../secret.xml"/>',
    "an include through a link": '<include file="link.xml"/>',
    "a mesh from above": '<asset><mesh name="m" file="../secret.obj"/></asset>',
    "an absolute mesh": '<asset><mesh name="m" file="{secret}/secret.obj"/></asset>',
    "a mesh in the working directory": '<asset><mesh name="m" file="secret.obj"/></asset>',
    "a mesh through a link": '<asset><mesh name="m" file="link.obj"/></asset>',
    "a folder of meshes above": '<compiler meshdir=".."/><asset><mesh name="m" file="secret.obj"/></asset>',
    "a later folder of meshes": '<compiler meshdir="x"/><compiler assetdir=".."/>'
    '<asset><mesh name="m" file="secret.obj"/></asset>',
    "a side of a texture": '<asset><texture name="t" type="cube" fileleft="../secret.png"/></asset>',
    "a height field": '<asset><hfield name="h" file="../secret.png" size="1 1 1 1"/></asset>',
    "paths stripped": '<compiler strippath="true"/><asset><mesh name="m" file="no/secret.obj"/></asset>',
    "an attached model's mesh": '<asset><model name="n" file="nested.xml"/></asset>',
    "an attached model's include": '<asset><model name="n" file="including.xml"/></asset>',
    "an attached model's document type": '<asset><model name="n" file="typed.xml"/></asset>',
}


@pytest.mark.parametrize("reach", REACHING)
def test_a_model_reads_files_from_its_own_folder_alone(
    secret: Path, capsys: pytest.CaptureFixture[str], reach: str
) -> None:
    problem = with_element(secret / "robot", REACHING[reach].format(secret=secret))
    folder = secret / "robot"
    (folder / "link.xml").symlink_to(secret / "secret.xml")
    (folder / "link.obj").symlink_to(secret / "secret.obj")
    (folder / "nested.xml").write_text(nested('<mesh name="m" file="secret.obj"/>'))
    (folder / "including.xml").write_text(nested(f'<include file="{secret}/secret.xml"/>'))
    (folder / "typed.xml").write_text("<!DOCTYPE mujoco []>" + nested(""))
    said = refused(lambda: build_model(problem))
    assert "folder" in said or "allowed" in said
    for call in (carrying, model_assets):
        refused(lambda call=call: call(problem))  # type: ignore[misc]
    assert run(capsys, "new", "bot", "--mjcf", folder / "strider.xml", "--out", secret / "out")[0] == 1
    assert not (secret / "out").exists()


def test_an_attached_model_without_files_is_taken(tmp_path: Path) -> None:
    problem = with_element(tmp_path / "robot", '<asset><model name="n" file="nested.xml"/></asset>')
    (tmp_path / "robot" / "nested.xml").write_text(nested(""))
    assert build_model(problem).nu == 2
    assert list(model_assets(problem)) == ["nested.xml"]


def test_meshes_and_textures_have_folders_of_their_own(tmp_path: Path) -> None:
    element = (
        '<compiler meshdir="x"/><compiler assetdir="parts/"/><asset><mesh name="m" file="c.obj"/></asset>'
    )
    problem = with_element(tmp_path / "robot", element)
    (tmp_path / "robot" / "parts").mkdir()
    (tmp_path / "robot" / "parts" / "c.obj").write_bytes(CUBE)
    assert build_model(problem).nmesh == 1
    assert list(model_assets(problem)) == ["parts/c.obj"]


@pytest.mark.parametrize(
    ("files", "said"),
    [
        (
            {"strider.xml": '<!DOCTYPE m [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]><mujoco model="&b;"/>'},
            "<!DOCTYPE>",
        ),
        (
            {"strider.xml": '<!DOCTYPE m [<!ENTITY a SYSTEM "file:///etc/passwd">]><mujoco model="&a;"/>'},
            "<!DOCTYPE>",
        ),
        (
            {"strider.xml": "<mujoco>" + 5000 * "<body>" + 5000 * "</body>" + "</mujoco>"},
            "nested more than 200 deep",
        ),
        (
            {
                "strider.xml": '<mujoco><include file="a"/><include file="a"/></mujoco>',
                "a": "<mujocoinclude/>",
            },
            "twice",
        ),
        (
            {
                "strider.xml": '<mujoco><include file="a"/></mujoco>',
                "a": '<mujoco><include file="a"/></mujoco>',
            },
            "twice",
        ),
        ({"strider.xml": '<mujoco><include file="strider.xml"/></mujoco>'}, "twice"),
    ],
)
def test_xml_that_grows_without_end_is_one_line(tmp_path: Path, files: dict[str, str], said: str) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER)
    for name, text in files.items():
        (folder / name).write_text(text)
    assert said in refused(lambda: build_model(load_problem(folder)))


@pytest.mark.parametrize("name", ["..", "../x", "/etc/passwd", "a\x00b", "x/../../y", "x" * 5000, "loop"])
def test_only_files_inside_a_folder_are_inside(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "loop").symlink_to("loop")
    found = inside(folder, name)
    assert found is None or not found.exists()


def test_data_sets_and_problems_name_files_beside_them_alone(secret: Path) -> None:
    folder = problem_folder(secret / "robot", STRIDER, lambda c: c.update(model="../secret.xml"))
    assert "model: found '../secret.xml'" in refused(lambda: load_problem(folder))
    entry = {"name": "a", "gait": "stride", "file": "../secret.obj", "signals": {"marker.x": "x_m"}}
    (folder / "dataset.toml").write_text(tomli_w.dumps({"trial": [entry]}))
    said = refused(lambda: load_dataset(folder, load_problem(STRIDER), ["marker.x"]))
    assert "allowed: a file in the data set's folder" in said


HOSTILE = [
    "<script>alert(1)</script>",
    '*/ system("x") //',
    "'\"><img src=x onerror=alert(1)>",
    "{{ 7*7 }}",
    "&lt;b",
]


@pytest.mark.parametrize("name", HOSTILE)
def test_a_name_stays_a_name_in_a_page(name: str) -> None:
    page = Page(
        title=name,
        answer=name,
        asked={name: name},
        tiles=[(name, name)],
        notes=[name],
        sections=[
            Section(
                name,
                sentences=[name],
                table=Table([name], [[name]], note=name),
                caption=name,
                commands=[name],
            )
        ],
    )
    html = page.html()
    assert "<script>alert" not in html
    assert "<img src=x" not in html
    assert "49" not in html.partition("<body")[2].replace("7*7", "")


@pytest.mark.parametrize("name", [*HOSTILE, "a\nb = 1", 'a" = 1', "'''", "\\", "[x]", "", "ü\u202e"])
def test_a_name_stays_a_name_in_toml(tmp_path: Path, name: str) -> None:
    gait = Gait(1.0, {name: Channel(duty=0.5, phase=0.0, amplitude_deg=1.0)}, "gait")
    write_gait(tmp_path / "gait.toml", gait)
    assert read_gait(tmp_path / "gait.toml") == gait
    assert list(tomllib.loads(gait.to_toml())["channels"]) == [name]


# --- the machine ------------------------------------------------------------------------------


def test_too_little_memory_is_one_line_and_writes_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    code = (
        "import resource\nimport gaitopt.simulation.rollout\n"
        "from pathlib import Path\nfrom gaitopt.cli import main\n"
        "used = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (used + (200 << 20), used + (200 << 20)))\n"
        "raise SystemExit(main())"
    )
    arguments = ["command", str(STRIDER), "stride", "--dt", "1e-6", "--duration", "40", "--out", str(out)]
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (1, "gaitopt: out of memory\n")
    assert not out.exists()


@pytest.mark.skipif(os.getuid() == 0, reason="the superuser writes anywhere")
def test_a_read_only_folder_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tmp_path.chmod(0o555)
    code, err = run(capsys, "model", STRIDER, "--out", tmp_path / "out.xml")
    tmp_path.chmod(0o755)
    assert code == 1
    assert "Permission denied" in err


@pytest.mark.parametrize("out", ["/proc/out.xml", "/dev/full/x", "/dev/null/x"])
def test_a_folder_that_takes_no_files_is_one_line(capsys: pytest.CaptureFixture[str], out: str) -> None:
    code, err = run(capsys, "model", STRIDER, "--out", out)
    assert code == 1
    assert err.startswith(f"gaitopt: {out}: cannot be written: ")


def test_one_core_is_enough(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = (
        "import os\nos.sched_setaffinity(0, [min(os.sched_getaffinity(0))])\n"
        "from gaitopt.cli import main\nraise SystemExit(main())"
    )
    arguments = ["compare", str(STRIDER), "stride", "square", "--json"]
    command = [sys.executable, "-c", code, *arguments]
    alone = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout
    assert cli.main([*arguments, "--workers", "3"]) == 0
    assert capsys.readouterr().out == alone


def test_read_toml_names_a_file_that_is_a_folder(tmp_path: Path) -> None:
    assert "cannot be read: Is a directory" in refused(lambda: read_toml(tmp_path))
