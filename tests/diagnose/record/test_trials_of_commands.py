"""Trials of logged commands: how a log is read, and the one line that says what is wrong with it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rigs
import tomli_w

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.gap.predict import runs_of
from gaitopt.diagnose.record.cleaning import clean
from gaitopt.diagnose.record.commands import read_commands
from gaitopt.diagnose.record.dataset import DataSet, load_dataset
from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.problem import Problem

KNOWN = ["joint.elbow", "joint.idle"]


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """An arm on one servo, whose channel is called ``lift``."""
    return rigs.build(tmp_path_factory.mktemp("rig") / "arm", rigs.arm(), {"marker": "tip"})


def written(folder: Path, tables: dict[str, str], **entries: dict[str, Any]) -> Path:
    """A data set of some files and trials; all measure the elbow."""
    folder.mkdir(exist_ok=True)
    for name, text in tables.items():
        (folder / name).write_text(text)
    usual = {"signals": {"joint.elbow": "angle_rad"}}
    trials = [usual | {"name": name} | entry for name, entry in entries.items()]
    (folder / "dataset.toml").write_text(tomli_w.dumps({"trial": trials}))
    return folder


def bench(*rows: str, step_s: float = 0.02) -> str:
    """A recording with its commands in the same table; each row is a target and an angle."""
    return "\n".join(["t_s,target_rad,angle_rad", *(f"{i * step_s:.4g},{row}" for i, row in enumerate(rows))])


def drive_of(trial: Trial) -> LoggedCommands:
    """The log that a trial plays."""
    assert isinstance(trial.drive, LoggedCommands)
    return trial.drive


def refused(folder: Path, problem: Problem) -> str:
    """The one line that says what is wrong with a data set."""
    with pytest.raises(GaitoptError) as caught:
        load_dataset(folder, problem, KNOWN)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def of_one_table(folder: Path, problem: Problem, *tables: str, **more: object) -> DataSet:
    """The data set of some recordings with their commands in the same table."""
    channel = problem.channel_names[0]
    entries = {
        f"t{i}": {"commands": f"t{i}.csv", "file": f"t{i}.csv", "channels": {channel: "target_rad"}, **more}
        for i in range(len(tables))
    }
    files = {f"t{i}.csv": table for i, table in enumerate(tables)}
    return load_dataset(written(folder, files, **entries), problem, KNOWN)


def test_commands_and_angles_may_share_a_table(rig: Problem, tmp_path: Path) -> None:
    (trial,) = of_one_table(tmp_path, rig, bench(*["0.5,0.0"] * 6, *["-0.5,0.4"] * 6)).trials
    drive = drive_of(trial)
    assert trial.starts_at_s == 0.0
    assert (drive.duration_s, drive.block_s) == (pytest.approx(0.24), pytest.approx(0.24))
    assert drive.targets([0.0, 0.119, 0.12]).tolist() == [[0.5], [0.5], [-0.5]]
    assert drive.start == {"elbow": 0.0}


@pytest.mark.parametrize(("unit", "cell"), [("rad", "0.5"), ("deg", "28.6478897565"), ("us", "1818")])
def test_the_suffix_of_a_column_gives_its_unit(rig: Problem, tmp_path: Path, unit: str, cell: str) -> None:
    channel = rig.channel_names[0]
    log = tmp_path / "log.csv"
    log.write_text(f"t_ms,{channel}_{unit}\n0,{cell}\n100,\n")
    drive = read_commands(log, rig)
    assert drive.time.tolist() == [0.0, 0.1]
    assert drive.rows[0, 0] == pytest.approx(0.5, abs=1e-3)
    assert math.isnan(drive.rows[1, 0])


def test_a_pulse_of_no_width_is_no_power(rig: Problem, tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text(f"t_s,{rig.channel_names[0]}_us\n0,1500\n0.1,0\n")
    assert np.array_equal(read_commands(log, rig).rows, [[0.0], [math.nan]], equal_nan=True)


def test_a_log_of_its_own_may_have_other_times(rig: Problem, tmp_path: Path) -> None:
    channel = rig.channel_names[0]
    tables = {
        "log.csv": f"t_s,{channel}_deg\n100.0,0\n100.5,20\n",
        "angles.csv": "t_ms,angle_rad\n" + "\n".join(f"{i * 20 + 100_000},{0.01 * i}" for i in range(50)),
    }
    entry = {"commands": "log.csv", "file": "angles.csv", "time": "t_ms"}
    (trial,) = load_dataset(written(tmp_path, tables, one=entry), rig, KNOWN).trials
    assert trial.starts_at_s == -100.0
    assert trial.time[0] + trial.starts_at_s == pytest.approx(0.0)
    assert drive_of(trial).duration_s == pytest.approx(1.0)
    (run,) = runs_of([trial]).values()
    assert run.duration_s == pytest.approx(0.98)


@pytest.mark.parametrize(("given", "starts"), [(None, 0.0), (-0.25, -0.25), ("unknown", None)])
def test_the_clocks_are_one_unless_the_data_set_says_otherwise(
    rig: Problem, tmp_path: Path, given: object, starts: float | None
) -> None:
    more = {} if given is None else {"starts_at_gait_time_s": given}
    (trial,) = of_one_table(tmp_path, rig, bench(*["0.5,0.0"] * 12), **more).trials
    assert trial.starts_at_s == starts


def test_a_clock_of_its_own_may_have_begun_at_any_time(rig: Problem, tmp_path: Path) -> None:
    channel = rig.channel_names[0]
    angles = "\n".join(f"{1.7e9 + 0.02 * i:.2f},0.1" for i in range(50))
    tables = {"log.csv": f"t_s,{channel}_rad\n3.0,0\n3.5,1\n", "angles.csv": f"t_s,angle_rad\n{angles}\n"}
    entry = {"commands": "log.csv", "file": "angles.csv", "starts_at_gait_time_s": "unknown"}
    (trial,) = load_dataset(written(tmp_path, tables, one=entry), rig, KNOWN).trials
    assert (trial.starts_at_s, trial.time[0]) == (None, 0.0)
    assert trial.time[-1] == pytest.approx(0.98, abs=1e-6)
    assert trial.drive.start == {"elbow": 0.1}


def test_repeats_share_a_rollout_from_their_mean_start(rig: Problem, tmp_path: Path) -> None:
    one, other = bench(*["0.5,0.010"] * 12), bench(*["0.5,0.014"] * 50)
    trials = of_one_table(tmp_path, rig, one, other).trials
    assert trials[0].drive is trials[1].drive
    drive = drive_of(trials[0])
    assert drive.start == {"elbow": pytest.approx(0.012)}
    assert drive.duration_s == pytest.approx(1.0)
    assert len(runs_of(trials)) == 1


def test_the_same_command_from_elsewhere_is_another_experiment(rig: Problem, tmp_path: Path) -> None:
    tables = [bench(*[f"0.0,{start}"] * 12) for start in (-1.0, 1.0, -1.01)]
    trials = of_one_table(tmp_path, rig, *tables).trials
    assert trials[0].drive is trials[2].drive
    assert trials[0].drive.key != trials[1].drive.key
    assert drive_of(trials[1]).start == {"elbow": 1.0}


def test_a_recording_that_begins_late_does_not_show_the_start(rig: Problem, tmp_path: Path) -> None:
    (trial,) = of_one_table(tmp_path, rig, bench(*["0.5,0.3"] * 12), starts_at_gait_time_s=2.0).trials
    assert trial.drive.start is None


def test_targets_beyond_the_servo_are_kept_and_named(rig: Problem, tmp_path: Path) -> None:
    (trial,) = of_one_table(tmp_path, rig, bench(*["9.0,0.0"] * 12)).trials
    assert trial.drive.targets([0.0]).tolist() == [[9.0]]
    (defect,) = [one for one in clean(trial).defects if one.name == "commands_beyond_range"]
    assert "from 9 to 9 rad" in defect.message
    assert defect.masked == 0


def test_what_is_wrong_is_said_in_one_line(rig: Problem, tmp_path: Path) -> None:
    channel = rig.channel_names[0]
    rows = "\n".join(f"{i * 0.02:.2f},0.1" for i in range(12))
    angles = {"angles.csv": f"t_s,angle_rad\n{rows}\n"}
    logged = {"commands": "log.csv", "file": "angles.csv"}

    def said(log: str, **more: object) -> str:
        tables = {**angles, "log.csv": log}
        return refused(written(tmp_path, tables, one={**logged, **more}), rig)

    assert f"no column of channel {channel}; allowed: {channel}_rad, {channel}_deg, {channel}_us" in said(
        "t_s,other_rad\n0,1\n"
    )
    assert "time does not rise, from 0.1 to 0.1 s" in said(f"t_s,{channel}_rad\n0.1,1\n0.1,2\n")
    assert "line 3: t_s is missing" in said(f"t_s,{channel}_rad\n0.1,1\n,2\n")
    assert f"found columns {channel}_rad and {channel}_deg; allowed: one of them" in said(
        f"t_s,{channel}_rad,{channel}_deg\n0.1,1,2\n"
    )
    assert "unknown channel 'lfit'" in said("t_s,a_rad\n0,1\n", channels={"lfit": "a_rad"})
    assert "unknown column 'b_rad'" in said("t_s,a_rad\n0,1\n", channels={channel: "b_rad"})
    assert "ends in its unit, _rad, _deg, _us" in said("t_s,a_m\n0,1\n", channels={channel: "a_m"})
    assert "unknown column 't_s'; known: when" in said(f"when,{channel}_rad\n0,1\n")
    assert "either `gait` or `commands`, not both" in said("t_s,a_rad\n0,1\n", gait="square")
    assert 'allowed: a number of seconds, or "unknown"' in said(
        "t_s,a_rad\n0,1\n", starts_at_gait_time_s="never"
    )
    assert "log.csv: no such file" in refused(written(tmp_path / "new", angles, one=logged), rig)
    short = {"angles.csv": "t_s,angle_rad\n0,0\n0.02,0\n0.04,0\n", "log.csv": f"t_s,{channel}_rad\n0,1\n"}
    assert "found 3 samples; allowed: 4 or more" in refused(
        written(tmp_path / "short", short, one=logged), rig
    )


def test_either_a_gait_or_commands(rig: Problem, tmp_path: Path) -> None:
    neither = {"file": "angles.csv"}
    assert "either `gait` or `commands`" in refused(written(tmp_path, {}, one=neither), rig)
    columns = {"file": "angles.csv", "gait": "walk", "channels": {"lift": "a_rad"}}
    assert "channels: found without `commands`" in refused(written(tmp_path, {}, one=columns), rig)
