"""LeRobot data sets: real Parquet files in the layouts of versions 2 and 3, a trial an episode."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hostility import refused, within

from gaitopt.diagnose.record import parquet
from gaitopt.diagnose.record.export import ImportOptions
from gaitopt.diagnose.record.importing import Imported, import_path
from gaitopt.diagnose.record.trial import Series

pa = pytest.importorskip("pyarrow", reason="pyarrow (the extra `lerobot`) is not installed")
pq = pytest.importorskip("pyarrow.parquet")

MOTORS = ["shoulder_pan.pos", "shoulder_lift.pos", "gripper.pos"]
COUNT = 60
FPS = 30.0
DEGREES = ImportOptions(angle_unit="deg")


def motion(episode: int) -> tuple[Series, Series]:
    """What is commanded and measured in an episode, degrees, each of shape (COUNT, motors)."""
    time = np.arange(COUNT) / FPS
    action = np.stack([30.0 * np.sin(2.0 * time + episode), 10.0 * np.cos(3.0 * time), 40.0 + time], axis=1)
    state = np.roll(action, 2, axis=0) + np.random.default_rng(episode).normal(0.0, 0.05, action.shape)
    return action.astype(np.float32).astype(float), state.astype(np.float32).astype(float)


def lists(rows: Series, fixed: bool) -> object:
    """A column of lists of numbers, of fixed size as version 3 has them, or not."""
    numbers = pa.array(rows.ravel(), pa.float32())
    if fixed:
        return pa.FixedSizeListArray.from_arrays(numbers, rows.shape[1])
    return pa.ListArray.from_arrays(np.arange(0, rows.size + 1, rows.shape[1]), numbers)


def table(episodes: Sequence[int], fixed: bool) -> dict[str, object]:
    """The columns of a Parquet file of some episodes."""
    action, state = (np.concatenate(parts) for parts in zip(*map(motion, episodes), strict=True))
    time = np.tile(np.arange(COUNT) / FPS, len(episodes))
    return {
        "action": lists(action, fixed),
        "observation.state": lists(state, fixed),
        "timestamp": pa.array(time, pa.float32()),
        "frame_index": pa.array(np.tile(np.arange(COUNT), len(episodes))),
        "episode_index": pa.array(np.repeat(episodes, COUNT)),
        "index": pa.array(np.arange(COUNT * len(episodes))),
        "task_index": pa.array(np.zeros(COUNT * len(episodes), int)),
    }


def info(folder: Path, version: str = "v3.0", names: object = MOTORS, **features: object) -> None:
    """Write what the data set says of itself."""
    (folder / "meta").mkdir(parents=True, exist_ok=True)
    part = {"dtype": "float32", "shape": [len(MOTORS)], "names": names}
    content = {
        "codebase_version": version,
        "fps": FPS,
        "robot_type": "so101_follower",
        "features": {"action": part, "observation.state": part, "timestamp": {"names": None}, **features},
    }
    (folder / "meta" / "info.json").write_text(json.dumps(content))


def write(folder: Path, file: str, columns: dict[str, object]) -> Path:
    """Write a Parquet file of the data set."""
    path = folder / "data" / "chunk-000" / file
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(columns), path)
    return path


def version_2(folder: Path) -> Path:
    """A data set with a file for each episode; names are under their kind."""
    info(folder, "v2.1", {"motors": [f"main_{name}" for name in MOTORS]})
    for episode in range(3):
        write(folder, f"episode_{episode:06d}.parquet", table([episode], fixed=False))
    return folder


def version_3(folder: Path) -> Path:
    """A data set with several episodes in a file."""
    info(folder)
    write(folder, "file-000.parquet", table([0, 1], fixed=True))
    write(folder, "file-001.parquet", table([2], fixed=True))
    return folder


def check(recordings: Sequence[Imported], joints: Sequence[str], scale: float) -> None:
    """Check that these are the three episodes."""
    assert [recording.name for recording in recordings] == [f"picking-{i:03d}" for i in range(3)]
    for episode, recording in enumerate(recordings):
        action, state = motion(episode)
        assert (recording.program, recording.channels) == ("LeRobot", list(joints))
        assert list(recording.signals) == [f"joint.{joint}" for joint in joints]
        np.testing.assert_allclose(recording.time, np.arange(COUNT) / FPS, atol=1e-6)
        assert recording.sent is not None
        sent = np.stack(list(recording.sent.columns.values()), axis=1)
        seen = np.stack(list(recording.signals.values()), axis=1)
        np.testing.assert_allclose(sent, scale * action, rtol=1e-6)
        np.testing.assert_allclose(seen, scale * state, rtol=1e-6)
        assert recording.defects == ()


@pytest.mark.parametrize(("make", "prefix"), [(version_2, "main_"), (version_3, "")])
def test_each_episode_is_a_trial(tmp_path: Path, make: Callable[[Path], Path], prefix: str) -> None:
    folder = make(tmp_path / "picking")
    joints = [prefix + name.removesuffix(".pos") for name in MOTORS]
    check(import_path(folder, DEGREES), joints, np.deg2rad(1.0))
    half = ImportOptions(angle_unit="normalised", full_scale_deg={"": 50.0})
    check(import_path(folder, half), joints, np.deg2rad(0.5))


def test_the_unit_has_to_be_said(tmp_path: Path) -> None:
    """Degrees and normalised values look alike."""
    said = refused(lambda: import_path(version_3(tmp_path / "picking"), ImportOptions()))
    assert "its unit is not known; say it: --angle-unit rad, deg, counts, normalised" in said


def test_motors_get_the_names_of_the_problem(tmp_path: Path) -> None:
    options = ImportOptions(
        angle_unit="deg",
        commands={"lift": "action.shoulder_lift.pos"},
        signals={"joint.arm": "observation.state.shoulder_lift.pos"},
    )
    first = import_path(version_3(tmp_path / "picking"), options)[0]
    assert (first.channels, list(first.signals)) == (["lift"], ["joint.arm"])
    np.testing.assert_allclose(first.signals["joint.arm"], np.deg2rad(motion(0)[1][:, 1]), rtol=1e-6)


@pytest.mark.parametrize(
    "names", [None, {"a": 0, "b": 1, "c": 2}, ["a", "b", "c"], {"axes": ["a", "b", "c"]}]
)
def test_names_in_all_their_forms(tmp_path: Path, names: object) -> None:
    folder = version_3(tmp_path / "picking")
    info(folder, names=names)
    expected = ["0", "1", "2"] if names is None else ["a", "b", "c"]
    assert import_path(folder, DEGREES)[0].channels == expected


def test_without_pyarrow_one_line_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = version_3(tmp_path / "picking")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    said = refused(lambda: import_path(folder, DEGREES))
    assert said == "LeRobot data sets need pyarrow: pip install gaitopt[lerobot]"


def spoil(folder: Path, change: Callable[[bytearray], object]) -> None:
    """Change the bytes of a Parquet file."""
    path = folder / "data" / "chunk-000" / "file-000.parquet"
    data = bytearray(path.read_bytes())
    change(data)
    path.write_bytes(data)


def link_out(folder: Path, name: str) -> None:
    """Replace a file or folder by a link to the same elsewhere."""
    elsewhere = folder.parent / "elsewhere"
    (folder / name).rename(elsewhere)
    (folder / name).symlink_to(elsewhere)


def swap(folder: Path, name: str, column: object) -> None:
    """Replace a column of the first file."""
    columns = table([0, 1], fixed=True)
    columns[name] = column
    write(folder, "file-000.parquet", columns)


def without(folder: Path, name: str) -> None:
    """Leave a column out."""
    columns = table([0, 1], fixed=True)
    del columns[name]
    write(folder, "file-000.parquet", columns)


def pipe(folder: Path) -> None:
    """Put a pipe in the place of a file."""
    (folder / "data" / "chunk-000" / "file-000.parquet").unlink()
    os.mkfifo(folder / "data" / "chunk-000" / "file-000.parquet")


def large(rows: int, numbers: int) -> dict[str, object]:
    """The columns of a small file that unfolds to many numbers."""
    zeros = pa.FixedSizeListArray.from_arrays(pa.array(np.zeros(rows * numbers, np.float32)), numbers)
    parts = {"action": zeros, "observation.state": zeros}
    return parts | {name: pa.array(np.zeros(rows)) for name in ("timestamp", "episode_index")}


ALL = 2 * COUNT
BROKEN: dict[str, tuple[Callable[[Path], object], str]] = {
    "not Parquet": (
        lambda f: spoil(f, lambda d: d.__setitem__(slice(None), b"PAR1 no PAR1")),
        "no Parquet file",
    ),
    "empty": (lambda f: spoil(f, bytearray.clear), "no Parquet file that can be read"),
    "cut": (
        lambda f: spoil(f, lambda d: d.__delitem__(slice(1000, None))),
        "no Parquet file that can be read",
    ),
    "a link": (lambda f: link_out(f, "data/chunk-000/file-000.parquet"), "found a link out of its folder"),
    "a linked folder": (lambda f: link_out(f, "data"), "found a link out of its folder"),
    "a linked info.json": (lambda f: link_out(f, "meta/info.json"), "found a link out of its folder"),
    "a pipe": (pipe, "found a pipe; allowed: a plain file"),
    "no files": (lambda f: (f / "data").rename(f / "other"), "found 0 files data/chunk-*/*.parquet"),
    "version 1": (
        lambda f: info(f, "v1.6"),
        "codebase_version: found 'v1.6'; allowed: a data set of version 2 or 3",
    ),
    "no JSON": (lambda f: (f / "meta/info.json").write_text("{"), "not JSON"),
    "no features": (
        lambda f: (f / "meta/info.json").write_text(
            '{"codebase_version": "v3.0", "features": {"action": {}}}'
        ),
        "features.observation.state: missing; it is required",
    ),
    "few names": (
        lambda f: info(f, names=["a"]),
        "features.action.names: found 1 for 3 numbers; allowed: one each",
    ),
    "no names": (lambda f: info(f, names=[1, 2, 3]), "names: found [1, 2, 3]; allowed: a list of names"),
    "names twice": (lambda f: info(f, names=["a", "a", "b"]), "are both of 'a'"),
    "no column": (lambda f: without(f, "episode_index"), "no column episode_index; found: action, "),
    "texts": (lambda f: swap(f, "action", ["x"] * ALL), "action: found string; allowed: numbers, or lists"),
    "lists of lists": (
        lambda f: swap(f, "action", [[[1.0]]] * ALL),
        "action: found list<element: list<element: d",
    ),
    "uneven lists": (
        lambda f: swap(f, "action", [[1.0]] * 9 + [[1.0, 2.0]] * (ALL - 9)),
        "lists differ in length",
    ),
    "missing lists": (
        lambda f: swap(f, "action", [None] + [[1.0] * 3] * (ALL - 1)),
        "action: 1 rows without a list",
    ),
    "infinity": (
        lambda f: swap(f, "action", [[1.0, np.inf, 0.0]] * ALL),
        "row 1, action: found inf; allowed: at most 1e+12",
    ),
    "no time": (lambda f: swap(f, "timestamp", [None] * ALL), "timestamp: found null; allowed: numbers"),
    "an episode twice": (
        lambda f: write(f, "file-002.parquet", table([1], fixed=True)),
        "file-002.parquet: episode 1 is in ",
    ),
    "no rows": (
        lambda f: write(f, "file-000.parquet", {n: c[:0] for n, c in table([0], fixed=True).items()}),  # type: ignore
        "file-000.parquet: no rows",
    ),
    "large": (
        lambda f: write(f, "file-002.parquet", large(2_600_000, 3)),
        "found 20800000 numbers; allowed: at most ",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_data_set_is_one_line(tmp_path: Path, case: str) -> None:
    folder = version_3(tmp_path / "picking")
    change, said = BROKEN[case]
    change(folder)
    with within(120):
        assert said in refused(lambda: import_path(folder, DEGREES))


def ending(path: Path, columns: Sequence[str], most: int) -> None:
    """End the process, as pyarrow does with some broken files."""
    os.kill(os.getpid(), 9)


def test_a_file_that_ends_the_reader_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = version_3(tmp_path / "picking")
    monkeypatch.setattr(parquet, "parquet_columns", ending)
    said = refused(lambda: import_path(folder, DEGREES))
    assert said == f"{folder}/data/chunk-000/file-000.parquet: no Parquet file that can be read"


def test_a_script_need_not_be_written_for_worker_processes(tmp_path: Path) -> None:
    """One without the usual last lines, whose work begins when it is imported."""
    folder, script = version_3(tmp_path / "picking"), tmp_path / "script.py"
    script.write_text(
        "import gaitopt\n"
        "from gaitopt.diagnose.record.export import ImportOptions\n"
        f"done = gaitopt.import_recordings([{str(folder)!r}], None, 'out', ImportOptions(angle_unit='deg'))\n"
        "print(len(done.recordings))\n"
    )
    done = subprocess.run([sys.executable, script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("3\n", "")


def test_a_folder_or_a_table_alone_is_no_data_set(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    said = refused(lambda: import_path(tmp_path / "empty", DEGREES))
    assert "found a folder; allowed: a file, or a LeRobot data set with meta/info.json" in said
    path = version_3(tmp_path / "picking") / "data" / "chunk-000" / "file-000.parquet"
    assert "allowed: the data set's folder" in refused(lambda: import_path(path, DEGREES))
