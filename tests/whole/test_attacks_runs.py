"""Attacks with a run folder that a stranger sent: links out of it, second names, and pipes."""

import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import STRIDER
from hostility import contents, run

from gaitopt.core.own_files import check_folder
from gaitopt.diagnose.fit.cache import SimulationCache

LINKED = [
    *(".lock", "evaluations.csv", "run.toml", "problem.toml", "model.xml", "summary.json", "best.toml"),
    *("report.html", "pareto.csv", ".best.abcd1234.toml", "figures/speeds.png", "pareto/front-1.toml"),
]


@pytest.mark.parametrize("state", ["finished", "unfinished"])
@pytest.mark.parametrize("kind", ["link", "hard link", "dangling link", "pipe"])
@pytest.mark.parametrize("name", LINKED)
def test_a_file_of_a_run_is_its_own(
    name: str, kind: str, state: str, victim: Path, request: pytest.FixtureRequest, capsys: Any
) -> None:
    folder: Path = request.getfixturevalue(state)
    path, before = folder / name, contents(victim)
    path.parent.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    if kind == "link":
        path.symlink_to(victim / "notes.txt")
    elif kind == "dangling link":
        path.symlink_to(victim / "new.txt")
    elif kind == "hard link":
        path.hardlink_to(victim / "notes.txt")
    else:
        os.mkfifo(path)
    code, err = run(capsys, "optimise", folder, "--resume", folder, "--quiet")
    assert code == 1
    assert name in err
    assert contents(victim) == before


@pytest.mark.parametrize("name", ["figures", "pareto", "assets", "simulated-0123456789abcdef"])
@pytest.mark.parametrize("state", ["finished", "unfinished"])
def test_a_folder_of_a_run_is_its_own(
    name: str, state: str, victim: Path, request: pytest.FixtureRequest, capsys: Any
) -> None:
    folder: Path = request.getfixturevalue(state)
    before = contents(victim)
    if (folder / name).exists():
        shutil.rmtree(folder / name)
    (folder / name).symlink_to(victim, target_is_directory=True)
    code, err = run(capsys, "optimise", folder, "--resume", folder, "--quiet")
    assert (code, "found a link; allowed in this folder: plain files with one name" in err) == (1, True)
    assert contents(victim) == before


@pytest.mark.parametrize(
    "name", [".lock", "simulated-0123456789abcdef", "figures", "diagnosis.json", "report.html"]
)
def test_a_diagnosis_that_is_refused_touches_nothing(
    name: str, victim: Path, tmp_path: Path, capsys: Any
) -> None:
    folder, before = tmp_path / "diagnosis", contents(victim)
    folder.mkdir()
    (folder / name).symlink_to(victim if name.startswith(("sim", "fig")) else victim / "notes.txt")
    (tmp_path / "walk.csv").write_text("t_s,x_m\n" + "".join(f"{0.05 * i:.2f},0.1\n" for i in range(60)))
    (tmp_path / "dataset.toml").write_text(
        '[[trial]]\nname = "one"\ngait = "stride"\nfile = "walk.csv"\n[trial.signals]\n"marker.y" = "x_m"\n'
    )
    code, err = run(capsys, "diagnose", STRIDER, tmp_path, "--resume", folder, "--quiet")
    assert (code, "found a link" in err) == (1, True)
    assert contents(victim) == before


def test_an_empty_folder_with_a_linked_lock_is_not_taken(victim: Path, tmp_path: Path, capsys: Any) -> None:
    """A new run takes a folder that holds no more than a lock and the first files of a killed run."""
    folder, before = tmp_path / "new", contents(victim)
    folder.mkdir()
    (folder / ".lock").symlink_to(victim / "notes.txt")
    commands = {
        "found a link": ("optimise", STRIDER, "--budget", 2),
        "is not empty": ("compare", STRIDER, "stride", "square"),
    }
    for said, command in commands.items():
        code, err = run(capsys, *command, "--out", folder)
        assert (code, said in err) == (1, True), err
    assert contents(victim) == before


def test_a_run_folder_may_be_named_by_a_link(finished: Path, tmp_path: Path, capsys: Any) -> None:
    """The user has named it."""
    (tmp_path / "link").symlink_to(finished)
    assert run(capsys, "optimise", STRIDER, "--resume", tmp_path / "link", "--quiet") == (0, "")


def test_the_cache_follows_no_link_and_waits_for_no_pipe(victim: Path, tmp_path: Path) -> None:
    before, cache = contents(victim), SimulationCache(tmp_path / "simulated-0123456789abcdef")
    cache.write("one", {"whitened": np.ones(3)})
    path = next(cache.folder.iterdir())
    data = path.read_bytes()
    elsewhere = tmp_path / "elsewhere.npz"
    elsewhere.write_bytes(data)
    for make in (
        lambda: path.symlink_to(elsewhere),
        lambda: path.hardlink_to(elsewhere),
        lambda: os.mkfifo(path),
    ):
        path.unlink()
        make()
        assert cache.read("one") is None
    path.unlink()
    for spoiled in (
        b"",
        data[:-40],
        b"\x80\x04.",
        data.replace(b"<f8", b"|O8"),
        data.replace(b"(3,)", b"(9,)"),
    ):
        path.write_bytes(spoiled)
        assert cache.read("one") is None
    np.savez_compressed(path, whitened=np.zeros(10_000_000))
    assert cache.read("one") is None
    shutil.rmtree(cache.folder)
    cache.folder.symlink_to(victim, target_is_directory=True)
    with pytest.raises(Exception, match="found a link"):
        cache.write("one", {"whitened": np.ones(3)})
    cache.clear()
    assert contents(victim) == before


def test_a_folder_without_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gaitopt.core.own_files._MOST_ENTRIES", 10)
    for index in range(11):
        (tmp_path / str(index)).touch()
    with pytest.raises(Exception, match="found more than 10 entries"):
        check_folder(tmp_path)
