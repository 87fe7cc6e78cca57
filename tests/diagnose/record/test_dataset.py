"""Data sets: what is read, in which units, and the one line that says what is wrong."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
from helpers import edited

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.record.cleaning import clean
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.gait.gait import write_gait
from gaitopt.problem.problem import Problem

KNOWN = ["marker.x", "marker.y", "marker.z", "joint.mid_left", "position.mid_act"]
HARDWARE = Path(
    os.environ.get("GAITOPT_HARDWARE_DATA", Path(__file__).parents[4] / "shared/data/arcfold-hardware")
)

ENTRY = """[[trial]]
name = "walk"
gait = "square-1s"
file = "walk.csv"
time = "t_s"
[trial.signals]
"marker.x" = "x_mm"
"joint.mid_left" = "bend_deg"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A data set of one trial of 3 s at 20 frames per second."""
    time = np.arange(0.0, 3.0, 0.05)
    rows = [f"{t:.3f},{20.0 * t:.4f},{90.0 * (t % 1.0 < 0.5):.1f}" for t in time]
    (tmp_path / "walk.csv").write_text("\n".join(["t_s,x_mm,bend_deg", *rows]) + "\n")
    (tmp_path / "dataset.toml").write_text(ENTRY)
    return tmp_path


def refused(folder: Path, problem: Problem) -> str:
    """The one line that says what is wrong with a data set."""
    with pytest.raises(GaitoptError) as caught:
        load_dataset(folder, problem, KNOWN)
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_units_come_from_the_columns_names(folder: Path, arcfold: Problem) -> None:
    (trial,) = load_dataset(folder, arcfold, KNOWN).trials
    assert trial.time[-1] == pytest.approx(2.95)
    assert trial.signals["marker.x"][-1] == pytest.approx(0.059)
    assert trial.signals["joint.mid_left"].max() == pytest.approx(math.pi / 2)
    assert trial.drive is arcfold.baselines["square-1s"]
    assert trial.starts_at_s is None
    assert all(used.all() for used in trial.used.values())


def test_milliseconds(folder: Path, arcfold: Problem) -> None:
    edited(folder / "dataset.toml", '"t_s"', '"t_ms"')
    lines = (folder / "walk.csv").read_text().replace("t_s", "t_ms").splitlines()
    scaled = [f"{1e3 * float(line.split(',')[0])},{line.partition(',')[2]}" for line in lines[1:]]
    (folder / "walk.csv").write_text("\n".join([lines[0], *scaled]))
    (trial,) = load_dataset(folder, arcfold, KNOWN).trials
    assert trial.time[-1] == pytest.approx(2.95)


def test_what_is_known_is_kept(folder: Path, arcfold: Problem) -> None:
    edited(
        folder / "dataset.toml",
        "[trial.signals]",
        "starts_at_gait_time_s = -0.5\nnoise_m = 1e-3\nfps = 20\n[trial.signals]",
    )
    (trial,) = load_dataset(folder, arcfold, KNOWN).trials
    assert (trial.starts_at_s, trial.noise_m, trial.fps) == (-0.5, 1e-3, 20.0)


def test_a_gait_file_beside_the_data_set(folder: Path, arcfold: Problem) -> None:
    write_gait(folder / "slow.toml", arcfold.baselines["square-1s"].with_period(1.25))
    edited(folder / "dataset.toml", "square-1s", "slow.toml")
    (trial,) = load_dataset(folder, arcfold, KNOWN).trials
    assert trial.drive.period_s == 1.25


def test_blank_samples_do_not_count_and_are_said(folder: Path, arcfold: Problem) -> None:
    edited(folder / "walk.csv", "0.500,10.0000,0.0", "0.500,,0.0")
    edited(folder / "walk.csv", "0.550,11.0000,0.0", "0.550,NaN,0.0")
    (trial,) = load_dataset(folder, arcfold, KNOWN).trials
    assert (~trial.used["marker.x"]).sum() == 2
    assert trial.used["joint.mid_left"].all()
    (defect,) = clean(trial).defects
    assert (defect.name, defect.masked) == ("gaps", 2)
    assert "2 time stamps with a blank sample" in defect.message


def test_several_samples_may_share_a_time_stamp(folder: Path, arcfold: Problem) -> None:
    edited(folder / "walk.csv", "0.550,11", "0.500,11")
    (trial,) = load_dataset(folder, arcfold, KNOWN).trials
    assert (np.diff(trial.time) == 0.0).sum() == 1


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("dataset.toml", '"x_mm"', '"y_mm"', "unknown column 'y_mm'; known: t_s, x_mm, bend_deg"),
        ("dataset.toml", '"t_s"', '"time_s"', "unknown column 'time_s'"),
        ("dataset.toml", '"marker.x"', '"marker.w"', "unknown signal 'marker.w'"),
        ("dataset.toml", '"marker.x"', '"position.mid_act"', "unknown signal 'position.mid_act'"),
        ("dataset.toml", "square-1s", "square-3s", "unknown gait 'square-3s'"),
        ("dataset.toml", "walk.csv", "run.csv", "no such file"),
        ("dataset.toml", "walk.csv", "../walk.csv", "allowed: a file in the data set's folder"),
        ("dataset.toml", 'name = "walk"', "", "trial.0.name: missing"),
        ("dataset.toml", "time =", "tiem =", "unknown key"),
        ("walk.csv", "0.500,", "0.400,", "line 12: time goes backward, from 0.45 to 0.4 s"),
        ("walk.csv", "0.500,", ",", "line 12: t_s is missing"),
        ("walk.csv", "10.0000", "ten", "line 12, column x_mm: found 'ten'"),
        ("walk.csv", "10.0000,0.0", "10.0000,0.0,3", "line 12: 4 cells under 3 column names"),
        ("walk.csv", "bend_deg", "t_s", "'t_s' appears twice"),
    ],
)
def test_one_line_says_what_is_wrong(
    folder: Path, arcfold: Problem, file: str, old: str, new: str, said: str
) -> None:
    edited(folder / file, old, new)
    assert said in refused(folder, arcfold)


@pytest.mark.parametrize("column", ["x_px", "x", "x_inch", "x_deg", "_m"])
def test_unknown_units(folder: Path, arcfold: Problem, column: str) -> None:
    edited(folder / "dataset.toml", "x_mm", column)
    edited(folder / "walk.csv", "x_mm", column)
    text = refused(folder, arcfold)
    assert f"found {column!r}; allowed: a column whose name ends in its unit, _m, _cm, _mm" in text


def test_fewer_than_two_cycles(folder: Path, arcfold: Problem) -> None:
    edited(folder / "dataset.toml", "square-1s", "square-2s")
    assert "fewer than two cycles of 2 s" in refused(folder, arcfold)


def test_columns_that_are_not_asked_for_may_have_one_name(folder: Path, arcfold: Problem) -> None:
    path = folder / "walk.csv"
    head, *rows = path.read_text().splitlines()
    path.write_text("\n".join([f"{head},note,note", *(f"{row},a,b" for row in rows)]))
    (trial,) = load_dataset(folder, arcfold, KNOWN).trials
    assert set(trial.signals) == {"marker.x", "joint.mid_left"}


def test_a_noise_of_zero_is_as_none(folder: Path, arcfold: Problem) -> None:
    edited(folder / "dataset.toml", 'name = "walk"', 'name = "walk"\nnoise_m = 0.0')
    (trial,) = load_dataset(folder, arcfold, KNOWN).trials
    assert trial.noise_m == 0.0


def test_two_cycles_to_the_last_frame_are_enough(folder: Path, arcfold: Problem) -> None:
    path = folder / "walk.csv"
    path.write_text("\n".join(path.read_text().splitlines()[:41]))
    (trial,) = load_dataset(folder, arcfold, KNOWN).trials
    assert trial.time[-1] == pytest.approx(1.95)


def test_no_number_at_all(folder: Path, arcfold: Problem) -> None:
    path = folder / "walk.csv"
    rows = [line.split(",") for line in path.read_text().splitlines()]
    path.write_text("\n".join(",".join([a, b if i == 0 else "nan", c]) for i, (a, b, c) in enumerate(rows)))
    assert "column x_mm: found no number; allowed: 4 or more" in refused(folder, arcfold)


def test_a_column_with_hardly_a_number(folder: Path, arcfold: Problem) -> None:
    path = folder / "walk.csv"
    rows = [line.split(",") for line in path.read_text().splitlines()]
    path.write_text("\n".join(",".join([a, b if i <= 1 else "", c]) for i, (a, b, c) in enumerate(rows)))
    assert "column x_mm: found numbers in 1 rows; allowed: 4 or more" in refused(folder, arcfold)


def test_samples_too_far_apart_may_be_milliseconds(folder: Path, arcfold: Problem) -> None:
    path = folder / "walk.csv"
    rows = [line.partition(",") for line in path.read_text().splitlines()]
    path.write_text(
        "\n".join([",".join([rows[0][0], rows[0][2]])] + [f"{50 * float(t)},{r}" for t, _, r in rows[1:]])
    )
    assert "are they milliseconds?" in refused(folder, arcfold)


def test_a_gait_file_with_an_unknown_channel(folder: Path, arcfold: Problem) -> None:
    write_gait(folder / "odd.toml", arcfold.baselines["square-1s"])
    edited(folder / "odd.toml", "channels.foot1", "channels.foot7")
    edited(folder / "dataset.toml", "square-1s", "odd.toml")
    assert "unknown channel 'foot7'" in refused(folder, arcfold)


def test_two_trials_of_one_name(folder: Path, arcfold: Problem) -> None:
    (folder / "dataset.toml").write_text(2 * ENTRY)
    assert "'walk' appears twice" in refused(folder, arcfold)


def test_no_data_set_there(tmp_path: Path, arcfold: Problem) -> None:
    assert "no dataset.toml there" in refused(tmp_path / "nowhere", arcfold)


@pytest.mark.skipif(not HARDWARE.is_dir(), reason=f"no real trials in {HARDWARE} (GAITOPT_HARDWARE_DATA)")
def test_the_real_trials_and_their_defects(tmp_path: Path, arcfold: Problem) -> None:
    text = ""
    for name in ("4s", "1s"):
        (tmp_path / f"gait-{name}.csv").symlink_to(HARDWARE / f"gait-{name}.csv")
        text += (
            f'[[trial]]\nname = "{name}"\ngait = "square-{name}"\nfile = "gait-{name}.csv"\n'
            '[trial.signals]\n"marker.x" = "x_m"\n'
        )
    (tmp_path / "dataset.toml").write_text(text)
    with pytest.raises(GaitoptError, match="a file in the data set's folder"):
        load_dataset(tmp_path, arcfold, KNOWN)
    for path in tmp_path.glob("*.csv"):
        content = path.read_bytes()
        path.unlink()
        path.write_bytes(content)
    slow, fast = (clean(trial) for trial in load_dataset(tmp_path, arcfold, KNOWN).trials)
    assert [defect.name for defect in slow.defects] == ["marker_outliers"]
    rounded = next(defect for defect in fast.defects if defect.name == "clock_rounding")
    assert rounded.parameters["grid_s"] == 0.1
    assert rounded.spans_s[0][0] == pytest.approx(10.05, abs=0.1)
