"""`gaitopt diagnose` and `gaitopt import` from the command line to their files."""

import json
import os
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from helpers import edited
from planting import dataset, recording_of, rollout

from gaitopt.cli.app import main
from gaitopt.core.errors import GaitoptError
from gaitopt.core.progress import Progress
from gaitopt.diagnose import correction
from gaitopt.diagnose.correction import CorrectionSettings
from gaitopt.jobs import diagnose as jobs
from gaitopt.jobs.diagnose import diagnose
from gaitopt.jobs.outputs import Stopped
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.runs.folder import held
from gaitopt.runs.posterior import with_posterior
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario

HARDWARE = Path(
    os.environ.get("GAITOPT_HARDWARE_DATA", Path(__file__).parents[3] / "shared/data/arcfold-hardware")
)


@pytest.fixture(scope="module")
def trials(arcfold: Problem, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two short trials that are quick to diagnose."""
    simulator = Simulator.build(arcfold, (Scenario(start_pose_rad=0.002, pose_seed=3),))
    columns = recording_of(simulator.run(arcfold.baselines["square-1s"], duration=4.0))
    return dataset(tmp_path_factory.mktemp("data") / "trials", {"fast": ("square-1s", columns)})


@pytest.fixture
def copied(trials: Path, tmp_path: Path) -> Path:
    """The same trials in a folder that a test may change."""
    folder = tmp_path / "trials"
    folder.mkdir()
    for path in trials.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    return folder


@pytest.mark.slow
def test_a_run_folder_with_everything_in_it(
    trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["diagnose", "arcfold", str(trials), "--out", str(out), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads((out / "diagnosis.json").read_text())
    assert printed["verdict"] == "no_gap"
    assert (printed["causes"], printed["ambiguous_with"], printed["effects"]) == ([], [], [])
    assert printed["next_experiment"] is None
    assert [row["gait"] for row in printed["predictions"]] == list(load_problem("arcfold").baselines)
    speed = next(row for row in printed["predictions"] if row["filmed"])["speed_m_s"]
    low, high = speed["ci90"]
    assert low < speed["mean"] < high
    assert len(with_posterior(load_problem("arcfold"), out).robots) >= 64
    assert not (out / "corrected.toml").exists()
    assert set(printed["gap"]) == {
        "heldout_before_m",
        "heldout_after_m",
        "floor_m",
        "shrinkage",
        "shrinkage_ci90",
    }
    assert all({"signal", "trial", "component", "share"} <= set(row) for row in printed["where"])
    assert load_problem(out).name == "arcfold"
    assert sorted(path.name for path in (out / "figures").iterdir()) == [
        "components.png",
        "map.png",
        "measured.png",
        "way.png",
    ]
    page = (out / "report.html").read_text()
    assert "No significant gap" in page
    assert "What to expect" in page
    assert page.count('class="plot"') == 4


@pytest.mark.slow
def test_in_words_and_the_same_every_time(
    trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for number, workers in enumerate(("1", "2")):
        out = tmp_path / f"out{number}"
        arguments = ["diagnose", "arcfold", str(trials), "--out", str(out), "--workers", workers]
        assert main(arguments) == 0
    said = capsys.readouterr().out
    assert "No significant gap" in said
    assert "- fast: gap of" in said
    first, second = ((tmp_path / f"out{i}" / "diagnosis.json").read_bytes() for i in range(2))
    assert first == second


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("dataset.toml", "x_m", "w_m", "unknown column"),
        ("dataset.toml", "marker.x", "marker.w", "unknown signal"),
        ("dataset.toml", "square-1s", "square-9s", "unknown gait"),
        ("dataset.toml", "square-1s", "square-4s", "fewer than two cycles"),
        ("fast.csv", "t_s,x_m", "t_s,x_feet", "x_feet"),
    ],
)
def test_bad_data_is_one_line_and_leaves_nothing(
    copied: Path,
    in_a_folder_of_its_own: Path,
    capsys: pytest.CaptureFixture[str],
    file: str,
    old: str,
    new: str,
    said: str,
) -> None:
    edited(copied / file, old, new)
    if new == "t_s,x_feet":
        edited(copied / "dataset.toml", '"x_m"', '"x_feet"')
    assert main(["diagnose", "arcfold", str(copied)]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert said in captured.err
    assert len(captured.err.splitlines()) == 1
    assert list(in_a_folder_of_its_own.iterdir()) == []


def test_a_recording_of_nothing_but_outliers_is_one_line(
    copied: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = (copied / "fast.csv").read_text().splitlines()
    cells = [line.split(",") for line in lines]
    for row in cells[31:]:
        row[1:] = [""] * (len(row) - 1)
    (copied / "fast.csv").write_text("\n".join(",".join(row) for row in cells))
    assert main(["diagnose", "arcfold", str(copied), "--out", str(tmp_path / "out")]) == 1
    assert "fewer than two cycles are left" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_folder_that_holds_something_is_refused_at_once(
    trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    assert main(["diagnose", "arcfold", str(trials), "--out", str(tmp_path)]) == 1
    assert "is not empty" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.slow
def test_another_robot(strider: Problem, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    simulator = Simulator.build(strider, (Scenario(start_pose_rad=0.002, pose_seed=3),))
    trajectory = simulator.run(strider.baselines["stride"], duration=4.0)
    columns = recording_of(trajectory, signals=("marker.y", "marker.z"))
    folder = dataset(tmp_path / "trials", {"walk": ("stride", columns)})
    out = tmp_path / "out"
    assert main(["diagnose", str(strider.source), str(folder), "--out", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "no_gap"


@pytest.mark.slow
def test_import_then_diagnose(arcfold: Problem, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trajectory = Simulator.build(arcfold).run(arcfold.baselines["square-1s"], duration=4.0)
    time = np.arange(0.0, 4.0, 0.04)
    x, z = (np.interp(time, trajectory.time, trajectory[f"marker.{axis}"]) for axis in "xz")
    rows = [f"{t:.3f}\t{a:.6f}\t{b:.6f}" for t, a, b in zip(time, x, z, strict=True)]
    (tmp_path / "walk.txt").write_text("\n".join(["mass_A", "t\tx\ty", *rows]))
    folder = tmp_path / "trials"
    arguments = ["import", str(tmp_path / "walk.txt"), "--gait", "square-1s", "--out", str(folder)]
    assert main([*arguments, "--sync-at", "0", "--json"]) == 0
    imported = json.loads(capsys.readouterr().out)
    assert imported["trials"] == [{"name": "walk", "program": "Tracker", "signals": ["marker.x", "marker.z"]}]
    assert main(["diagnose", "arcfold", str(folder), "--out", str(tmp_path / "out")]) == 0
    assert "No significant gap" in capsys.readouterr().out
    assert main(arguments) == 1
    assert "is not empty; allowed: a new or an empty folder" in capsys.readouterr().err


def test_import_refuses_a_frame_rate_of_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["import", "walk.csv", "--gait", "g", "--out", str(tmp_path / "out"), "--fps", "0"]
    assert main(arguments) == 1
    assert "--fps: found 0" in capsys.readouterr().err


@pytest.fixture
def brief(monkeypatch: pytest.MonkeyPatch) -> None:
    """No search for gaits of the corrected robot, which takes seconds."""
    monkeypatch.setattr(correction, "DEFAULT", CorrectionSettings(periods_s=(), gaits=0))


@pytest.mark.slow
@pytest.mark.skipif(not HARDWARE.is_dir(), reason=f"no real trials in {HARDWARE} (GAITOPT_HARDWARE_DATA)")
def test_the_real_trials(arcfold: Problem, tmp_path: Path, brief: None) -> None:
    trials = {}
    for name in ("4s", "1s"):
        table = np.genfromtxt(HARDWARE / f"gait-{name}.csv", delimiter=",", names=True)
        trials[name] = (f"square-{name}", {"t_s": table["t_s"], "x_m": table["x_m"]})
    folder, out = dataset(tmp_path / "trials", trials), tmp_path / "out"
    diagnose(arcfold, folder, effects=["ground_slope"], next_gait=False, out=out)
    found = json.loads((out / "diagnosis.json").read_text())
    assert {(row["trial"], row["name"]) for row in found["defects"]} >= {
        ("4s", "marker_outliers"),
        ("1s", "clock_rounding"),
    }
    slow = next(row for row in found["trials"] if row["name"] == "4s")
    assert slow["offset_fitted"]
    assert slow["offset_s"] == pytest.approx(2.0, abs=0.1)  # half a period, as the first rise shows
    assert slow["signals"][0]["travel_measured"] == pytest.approx(0.037, abs=0.001)
    assert found["gap"]["heldout_before_m"] > found["gap"]["floor_m"] > 0.0
    assert any("0.1 s" in sentence for sentence in found["explanation"])


@pytest.fixture(scope="module")
def sloped(arcfold: Problem, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short trial on a slope: a gap that takes fits to explain."""
    columns = recording_of(rollout(arcfold, "square-2s", 5.0, {"ground_slope": {"angle_rad": 0.08}}))
    return dataset(tmp_path_factory.mktemp("data") / "sloped", {"slow": ("square-2s", columns)})


@pytest.mark.slow
def test_an_interrupted_diagnosis_goes_on_to_the_same_bits(
    arcfold: Problem, sloped: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], brief: None
) -> None:
    asked = partial(diagnose, arcfold, sloped, effects=["ground_slope", "camera_tilt"], next_gait=False)
    whole, halted = tmp_path / "whole", tmp_path / "halted"
    first, second = asked(out=whole).explanation[:2]
    assert not list(whole.glob("simulated-*"))
    robots = with_posterior(arcfold, whole).robots
    assert len(robots) >= 64
    slopes = [robot[0].value for robot in robots if robot and robot[0].name == "ground_slope"]
    estimate = next(
        row["parameters"]["angle_rad"]
        for row in json.loads((whole / "diagnosis.json").read_text())["effects"]
        if row["name"] == "ground_slope"
    )
    low, high = estimate["ci90"]
    inside = sum(low <= slope <= high for slope in slopes)
    assert 0.8 * len(slopes) < inside < len(slopes)
    assert "Expected speeds in mm/s" in " ".join(asked(resume=whole).explanation)
    assert (whole / "corrected.toml").read_text().startswith("# Corrected by ground_slope")
    assert first.startswith("ground_slope (all)")
    assert "cosine" not in first
    assert second.startswith("camera_tilt (all)")
    same = r"it and ground_slope look the same in these data \(likeness"
    likeness = rf"({same}|likeness to ground_slope in these data:)"
    assert re.search(rf"; {likeness} [01]\.\d\d of 1", second)

    def interrupt(progress: Progress) -> None:
        if progress.done == 20:  # the tilt of a camera is done without a robot
            raise KeyboardInterrupt

    with pytest.raises(Stopped) as stopped:
        asked(out=halted, workers=1, on_progress=interrupt)
    assert stopped.value.folder == halted
    assert int(stopped.value.done.removesuffix(" robots")) >= 4
    assert not (halted / "diagnosis.json").exists()
    with pytest.raises(GaitoptError, match="nothing was simulated there with this problem"):
        asked(resume=halted, seed=2)
    asked(resume=halted)
    assert (halted / "diagnosis.json").read_bytes() == (whole / "diagnosis.json").read_bytes()
    assert {p.name for p in halted.iterdir()} == {p.name for p in whole.iterdir()}
    assert main(["diagnose", "arcfold", str(sloped), "--resume", str(halted), "--json"]) == 0
    assert capsys.readouterr().out == (whole / "diagnosis.json").read_text()


def test_an_interrupted_diagnosis_says_how_to_go_on(
    trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*_: object, **__: object) -> None:
        raise Stopped("4 robots", tmp_path / "halted")

    monkeypatch.setattr(jobs, "diagnose", stopped)
    few = ["--effects", "ground_slope,camera_tilt", "--quiet"]
    assert main(["diagnose", "arcfold", str(trials), "--out", str(tmp_path / "halted"), *few]) == 130
    line = f"go on with: gaitopt diagnose arcfold {trials} --resume {tmp_path / 'halted'}"
    assert f"stopped after 4 robots; {line} --effects ground_slope,camera_tilt" in capsys.readouterr().err


@pytest.mark.parametrize("content", ["[]", "{}", '{"answer": 1, "explanation": []}'])
def test_a_changed_answer_is_one_line(
    trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str
) -> None:
    (tmp_path / "diagnosis.json").write_text(content)
    assert main(["diagnose", "arcfold", str(trials), "--resume", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"gaitopt: {tmp_path / 'diagnosis.json'}: ")
    assert said.count("\n") == 1


def test_two_diagnoses_cannot_share_a_folder(
    trials: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    with held(out):
        assert main(["diagnose", "arcfold", str(trials), "--resume", str(out)]) == 1
    assert "another run is working in this folder" in capsys.readouterr().err
