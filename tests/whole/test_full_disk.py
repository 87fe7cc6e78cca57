"""A disk that is full, and not a stand-in for it: one line, nothing lost, and it goes on with space again."""

import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ending import Stop, Work, diagnosis, fill, result, search, small_trials
from helpers import STRIDER

from gaitopt.cli import app as cli
from gaitopt.core.files import csv_text

NO_SPACE = "No space left on device"


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 32 MiB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=32m", "gaitopt-test", str(folder)]
    try:
        done = subprocess.run(mount, capture_output=True, text=True, check=False)
    except OSError as error:
        pytest.skip(f"no mount: {error}")
    if done.returncode:
        pytest.skip(f"no file system can be mounted here: {done.stderr.strip()}")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


@pytest.mark.slow
@pytest.mark.parametrize("job", ["search", "diagnosis"])
def test_a_disk_that_is_full_in_any_stage_is_one_line_and_nothing_is_lost(
    job: str, disk: Path, tmp_path: Path
) -> None:
    def work(folder: Path) -> Work:
        return search(folder) if job == "search" else diagnosis(folder, tmp_path / "trials")

    small_trials(tmp_path / "trials")
    whole, filler, filled = (
        work(tmp_path / "whole"),
        disk / "filler",
        replace(work(disk / "run"), notes=tmp_path),
    )
    ticks = whole.run().ticks
    for stage in filled.stages:
        tick = 3 if ticks[stage] > 6 else 1
        ended = filled.run(Stop(stage, tick, fill=filler))
        assert ended.marker.get("stage") == stage
        filler.unlink()
        if stage in ("last write", "clearing"):  # nothing more is written after it
            assert (ended.code, ended.err) == (0, "")
            break
        assert (ended.code, ended.out) == (1, ""), stage
        assert ended.err.startswith(f"gaitopt: {disk / 'run'}"), stage
        assert ended.err.count("\n") == 1, stage
        assert NO_SPACE in ended.err, stage
        assert "/." not in ended.err.replace("/.lock", ""), stage  # a name that the user has not seen
    assert result(filled.folder) == result(whole.folder)


@pytest.mark.parametrize(
    "words",
    [
        ["export", STRIDER, "stride", "--format", "c", "--out", "out"],
        ["import", "walk.csv", "--problem", STRIDER, "--gait", "stride", "--out", "out"],
        ["new", "bot", "--mjcf", STRIDER / "strider.xml", "--out", "out"],
        ["model", STRIDER, "--out", "out.xml"],
        ["command", STRIDER, "stride", "--dt", "0.01", "--duration", "9", "--out", "out.csv"],
        ["simulate", STRIDER, "stride", "--csv", "out.csv"],
        ["compare", STRIDER, "stride", "square", "--out", "out"],
        ["check", STRIDER, "--out", "out"],
    ],
    ids=lambda words: words[0],
)
def test_a_full_disk_ends_a_command_in_one_line_and_nothing_is_left(
    words: list[object], disk: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    time = np.arange(0.0, 2.0, 0.04)
    (tmp_path / "walk.csv").write_text(csv_text({"t_s": time, "x_m": 0.01 * time, "z_m": 0.0 * time}))
    places = {"out": disk / "out", "out.xml": disk / "out.xml", "out.csv": disk / "out.csv"}
    places["walk.csv"] = tmp_path / "walk.csv"
    arguments = [str(places.get(str(word), word)) for word in words]
    fill(disk / "filler")
    assert cli.main(arguments) == 1
    err = capsys.readouterr().err
    *said, line = err.splitlines()
    assert line.startswith("gaitopt: ")
    assert str(disk / "out") in line
    assert NO_SPACE in line
    assert "/." not in line  # a name that the user has not seen
    assert all(progress.endswith(" …") for progress in said)
    assert [path.name for path in disk.iterdir()] == ["filler"]
    (disk / "filler").unlink()
    assert cli.main(arguments) == 0
