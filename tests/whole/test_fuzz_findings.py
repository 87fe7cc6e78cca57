"""Broken files that the fuzzing found: each ends in one line, or is read correctly."""

import errno
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import tomli_w
from helpers import STRIDER, edited, problem_folder
from hostility import refused, run, with_element

from gaitopt.cli import app as cli
from gaitopt.core.files import read_json, write_text
from gaitopt.diagnose.judge.gap import Gap
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.diagnose.record.export import ImportOptions
from gaitopt.diagnose.record.importing import import_file, import_files
from gaitopt.diagnose.words import answer
from gaitopt.gait.calibration import Calibration
from gaitopt.gait.gait import Channel, Gait, read_gait
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.journal import Entry, Journal
from gaitopt.optimise.run import Request
from gaitopt.problem.draft import make_problem
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import load_problem
from gaitopt.runs.run_folder import RunFolder
from gaitopt.simulation.scenario import NOMINAL
from gaitopt.simulation.setup import RobotSetup


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
    assert "3 cells of bodyparts over 4 of coords" in refused(
        lambda: import_file(path, ImportOptions(fps=25.0))
    )


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
    assert (said or "") in refused(lambda: import_file(path, ImportOptions()))


@pytest.mark.parametrize(
    "options",
    [
        ImportOptions(fps=5e-324),
        ImportOptions(fps=float("nan")),
        ImportOptions(scale_m_per_px=1e308),
        ImportOptions(sync_at_s=np.nan),
    ],
)
def test_an_option_that_no_camera_has_is_one_line(tmp_path: Path, options: ImportOptions) -> None:
    assert "gait import: --" in refused(lambda: import_file(tmp_path / "walk.csv", options)).replace(
        "opt", ""
    )


def test_a_file_whose_name_is_no_text_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "walk\udcff.csv"
    path.write_text("t_s,x_m\n" + "\n".join(f"{0.1 * i},{i}" for i in range(30)))
    out = tmp_path / "out"
    assert "no Unicode text" in refused(lambda: import_files([path], ["square-1s"], out, ImportOptions()))
    assert not out.exists()


GAIT = "period_s = 0.5\n[channels.a]\nduty = 0.5\nphase = 0.0\namplitude_deg = 9.0\n"


def test_a_gait_called_as_the_data_set_itself_is_not_overwritten(tmp_path: Path) -> None:
    walk, gait = tmp_path / "walk.csv", tmp_path / "dataset.toml"
    walk.write_text("t_s,x_m\n" + "\n".join(f"{0.1 * i},{i}" for i in range(30)))
    gait.write_text(GAIT)
    import_files([walk], [str(gait)], tmp_path / "out", ImportOptions())
    (copy,) = (path for path in (tmp_path / "out").glob("*.toml") if path.name != "dataset.toml")
    assert copy.name == f"{tmp_path.name}-dataset.toml"
    assert copy.read_text() == GAIT
    assert f'gait = "{copy.name}"' in (tmp_path / "out" / "dataset.toml").read_text()


def test_no_gait_takes_the_place_of_a_file_of_the_data_set(tmp_path: Path) -> None:
    """Neither of a table nor of another gait; the same gait for two recordings is one file."""
    walks, gaits = [tmp_path / "walk.csv", tmp_path / "run.csv"], []
    for walk in walks:
        walk.write_text("t_s,x_m\n" + "\n".join(f"{0.1 * i},{i}" for i in range(30)))
    for name in ("a/gait.toml", "b/gait.toml", "a/run.csv"):
        gaits.append(str(tmp_path / name))
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(f"{GAIT}# {name}\n")
    for number, (pair, names) in enumerate(
        ((gaits[:2], ["gait.toml", "b-gait.toml"]), (gaits[1:], ["gait.toml", "a-run.csv"]))
    ):
        out = tmp_path / f"out-{number}"
        import_files(walks, pair, out, ImportOptions())
        assert [(out / name).read_text() for name in names] == [Path(gait).read_text() for gait in pair]
        assert {path.name for path in out.iterdir()} == {"dataset.toml", "walk.csv", "run.csv", *names}
    import_files(walks, gaits[:1], tmp_path / "out", ImportOptions())
    assert (tmp_path / "out" / "gait.toml").read_text() == f"{GAIT}# a/gait.toml\n"


def test_the_gait_of_a_run_is_copied_beside_a_recording(tmp_path: Path) -> None:
    (tmp_path / "walk.csv").write_text("t_s,x_m\n" + "\n".join(f"{0.1 * i},{i}" for i in range(30)))
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "best.toml").write_text(GAIT)
    import_files([tmp_path / "walk.csv"], [str(tmp_path / "run")], tmp_path / "out", ImportOptions())
    assert (tmp_path / "out" / "best.toml").read_text() == GAIT
    assert 'gait = "best.toml"' in (tmp_path / "out" / "dataset.toml").read_text()


def test_a_model_that_names_a_problem_file_becomes_no_problem(tmp_path: Path) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER)
    element = '<asset><hfield name="h" file="problem.toml" size="1 1 1 1"/></asset>'
    edited(folder / "strider.xml", "</worldbody>", "</worldbody>" + element)
    (folder / "problem.toml").write_bytes(b"\2\0\0\0\2\0\0\0" + 16 * b"\0")
    said = refused(lambda: make_problem("bot", folder / "strider.xml", tmp_path / "out"))
    assert "it names the file problem.toml" in said
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
    """After the copy, at a name that no problem may have, or during the copy, when the disk is full."""
    mjcf, out = problem_folder(tmp_path / "robot", STRIDER) / "strider.xml", tmp_path / "out"
    if why == "name":
        edited(mjcf, 'site name="nose"', 'site name="no&#x202e;se"')
        said = "roles.marker: found 'no\\u202ese'; allowed: a name without control characters"
    else:
        said = "cannot be written: No space left on device"

        def full(target: Path, data: bytes) -> int:
            with target.open("wb") as file:
                file.write(data[:100])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        monkeypatch.setattr(Path, "write_bytes", full)
    if existed:
        out.mkdir()
    code, err = run(capsys, "new", "bot", "--mjcf", mjcf, "--out", out)
    assert code == 1
    assert said in err
    assert out.exists() is existed
    assert not (existed and list(out.iterdir()))


@pytest.fixture
def finished(tmp_path: Path) -> Path:
    """A run folder whose run is marked as done."""
    problem, request = load_problem(STRIDER), Request(budget=1)
    folder = RunFolder.create(tmp_path / "run", problem, request)
    row = {"name": "best", "period_s": 0.5, "speed_m_s": None, "speed_ci90_m_s": [None, None]}
    row |= {"constraints_met": False, "violations": {}, "status": "diverged: badqacc"}
    summary = {"best": row, "baselines": [row | {"speed_m_s": 0.01}], "ratio_to_best_baseline": None}
    with folder:
        (folder.path / "evaluations.csv").write_text("one\ntwo\n")
        folder.file("summary.json", lambda path: write_text(path, json.dumps(summary)))
        folder.file("report.html", lambda path: write_text(path, "a page"))
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


@pytest.mark.parametrize("candidates", [[], ["servo_gain"]])
def test_a_diagnosis_with_a_gap_of_no_part_has_an_answer(candidates: list[str]) -> None:
    """Every part of it is within the floor; the answer needed the largest."""
    gap = Gap(before=0.004, after=0.004, floor=0.001, ci90=(0.0, 0.0))
    found = SimpleNamespace(candidates=candidates, best=None, causes=[])
    parts = {"gap": gap, "verdict": "unexplained", "found": found, "where": [], "causes": []}
    said = answer(SimpleNamespace(**parts, measures_positions=True, gap_angles=None, correction=None))  # type: ignore[arg-type]
    assert "4 mm RMS of the marker" in said


def test_a_journal_with_a_coordinate_that_is_no_number_is_one_line(tmp_path: Path) -> None:
    problem, path = load_problem(STRIDER), tmp_path / "evaluations.csv"
    point = problem.space.encode(problem.baselines["stride"])
    gait = problem.space.decode(point)
    setting = RobotSetup.of(problem, (NOMINAL,), problem.simulation.working)
    evaluation = Evaluator(setting, SerialExecutor())([gait])[0].evaluation
    point[3] = np.nan
    Journal(path, problem).append([Entry(0, "test", point, gait, evaluation, 1.0)])
    assert refused(lambda: Journal(path, problem)) == f"{path}: line 2: a coordinate that is not a number"


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
    assert PLAIN_NAME in refused(lambda: import_files([walk], ["square-1s"], out, ImportOptions()))
    assert not out.exists()


def test_what_a_terminal_cannot_show_is_escaped(tmp_path: Path) -> None:
    """Standard output in ASCII only, and a name that is not text."""
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
