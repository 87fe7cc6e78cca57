"""Attacks with a run folder that a stranger sent: links out of it, pipes, and files that were edited."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import STRIDER, edited
from hostility import run

from gaitopt.cli import app as cli
from gaitopt.core.own_files import check_folder
from gaitopt.diagnose.fit.cache import SimulationCache
from gaitopt.optimise.journal import _digest, _line
from gaitopt.problem.problem import load_problem
from gaitopt.runs.run_folder import RunFolder

WATCHED = """
import os, sys
opened = []
CHANGES = {"os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.chmod", "os.truncate", "shutil.rmtree"}
def watch(event, arguments):
    if event == "open" and isinstance(arguments[2], int):
        path, _, flags = arguments
        if flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC) and not isinstance(path, int):
            opened.append(os.fsdecode(path))
    elif event in CHANGES:
        opened.extend(os.fsdecode(one) for one in arguments[:2] if isinstance(one, (str, bytes, os.PathLike)))
sys.addaudithook(watch)
from gaitopt.cli import app
code = app.main(sys.argv[1:])
for path in opened:
    print("OPENED", os.path.abspath(path))
sys.exit(code)
"""


@pytest.fixture(scope="session")
def finished_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of the strider."""
    folder = tmp_path_factory.mktemp("attacked") / "run"
    words = f"optimise {STRIDER} --budget 6 --seed 5 --no-warm-start --quiet --out {folder}"
    assert cli.main(words.split()) == 0
    return folder


@pytest.fixture
def finished(finished_folder: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    shutil.copytree(finished_folder, tmp_path / "run")
    return tmp_path / "run"


@pytest.fixture
def unfinished(finished: Path) -> Path:
    """The same, as if it had been killed after three gaits."""
    for name in ("best.toml", "summary.json", "report.html"):
        (finished / name).unlink()
    shutil.rmtree(finished / "figures")
    journal = finished / "evaluations.csv"
    journal.write_bytes(b"".join(journal.read_bytes().splitlines(keepends=True)[:4]))
    return finished


@pytest.fixture
def victim(tmp_path: Path) -> Path:
    """A folder of the user, with files that a sweep of leftovers would take for its own."""
    folder = tmp_path / "victim"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    (folder / ".notes.abcd1234.txt").write_text("mine")
    return folder


def contents(folder: Path) -> dict[str, tuple[str, int]]:
    return {path.name: (path.read_text(), path.stat().st_mtime_ns) for path in folder.iterdir()}


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
    assert (code, "found a link; allowed in a run folder: plain files with one name" in err) == (1, True)
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


@pytest.mark.slow
@pytest.mark.parametrize("hostile", [False, True])
def test_a_resumed_run_opens_nothing_outside_its_folder_to_write(
    unfinished: Path, victim: Path, tmp_path: Path, hostile: bool
) -> None:
    """Watched by an audit hook: files opened to write, removed, renamed and made, folders made."""
    before = contents(victim)
    if hostile:
        (unfinished / ".lock").symlink_to(victim / "notes.txt")
        (unfinished / "figures").symlink_to(victim, target_is_directory=True)
        (unfinished / "best.toml").symlink_to(victim / "notes.txt")
    words = [sys.executable, "-c", WATCHED, "optimise", unfinished, "--resume", unfinished, "--quiet"]
    settings = os.environ | {"MPLCONFIGDIR": str(tmp_path / "settings"), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(words, capture_output=True, text=True, env=settings, cwd=tmp_path, check=False)
    assert done.returncode == hostile, done.stderr
    opened = {Path(line.split(" ", 1)[1]) for line in done.stdout.splitlines() if line.startswith("OPENED")}
    allowed = (unfinished, tmp_path / "settings", Path("/dev/null"), Path("/proc"))
    outside = {path for path in opened if not any(path.is_relative_to(one) for one in allowed)}
    assert outside == set()
    assert bool(opened) != hostile
    assert contents(victim) == before


# --- files that were edited ---------------------------------------------------------------------


def resigned(path: Path, folder: Path, change: Callable[[list[str]], object]) -> None:
    """Change the second row of a journal and give it a right digest, as who knows the code can."""
    journal = RunFolder.reopen(folder).folder.open_journal(load_problem(folder))
    lines = path.read_bytes().split(b"\n")
    before = lines[1].rpartition(b",")[2].decode()
    cells = journal._cells(journal.entries[1])
    change(cells)
    row = _line(cells)
    lines[2] = row + b"," + _digest(before, row).encode()
    path.write_bytes(b"\n".join(lines[:3]) + b"\n")


def cell(name: str, value: str) -> Callable[[Path, Path], None]:
    def change(path: Path, folder: Path) -> None:
        header = path.read_text().splitlines()[0].split(",")
        resigned(path, folder, lambda cells: cells.__setitem__(header.index(name), value))

    return change


FORGED = {
    "NaN cost": (cell("cost", "nan"), "line 3: a cost or a simulated time that is not a number"),
    "infinite cost": (cell("cost", "-inf"), "line 3: a cost or a simulated time"),
    "doubled id": (cell("evaluation", "0"), "line 3: evaluation: found 0; allowed: 1"),
    "id of 4,000 digits": (cell("evaluation", "9" * 4000), "line 3: evaluation: found"),
    "id of 9,000 digits": (cell("evaluation", "9" * 9000), "line 3: Exceeds the limit"),
    "cost of 4,000 digits": (cell("cost", "9" * 4000), "line 3: a cost or a simulated time"),
    "cell of 200,000 characters": (cell("status", "x" * 200_000), "line 3: field larger than field limit"),
    "unknown rung": (cell("rung", "cellar"), "evaluation 1 is not the one that this seed"),
    "another method": (cell("method", "pareto"), "evaluation 1 is not the one that this seed"),
    "digits of another script": (cell("cost", "\u0661"), "line 3: its numbers do not belong together"),
    "underscores": (cell("cost", "1_000.0"), "line 3: its numbers do not belong together"),
    "constraints met": (cell("constraints_met", "perhaps"), "line 3: its numbers do not belong together"),
    "another period": (cell("period_s", "7.0"), "line 3: its numbers do not belong together"),
    "NaN time": (cell("simulated_s", "nan"), "line 3: a cost or a simulated time that is not a number"),
    "too few cells": (
        lambda path, folder: resigned(path, folder, lambda cells: cells.pop()),
        " cells, not ",
    ),
}


@pytest.mark.parametrize("forged", FORGED)
def test_a_forged_row_with_a_right_digest_is_one_line(forged: str, unfinished: Path, capsys: Any) -> None:
    change, said = FORGED[forged]
    change(unfinished / "evaluations.csv", unfinished)
    before = (unfinished / "evaluations.csv").read_bytes()
    code, err = run(capsys, "optimise", unfinished, "--resume", unfinished, "--quiet")
    assert (code, said in err) == (1, True), err
    assert len(err) < 700
    assert (unfinished / "evaluations.csv").read_bytes() == before


def swapped(lines: list[bytes]) -> None:
    lines[1], lines[2] = lines[2], lines[1]


def digit(lines: list[bytes]) -> None:
    """Change one digit of a metric."""
    cells = lines[2].split(b",")
    cells[8] = cells[8].translate(bytes.maketrans(b"12345678", b"23456781"))
    lines[2] = b",".join(cells)


EDITED = {
    "one digit": digit,
    "doubled": lambda lines: lines.insert(2, lines[1]),
    "reordered": swapped,
    "removed in the middle": lambda lines: lines.pop(1),
    "NaN cost": lambda lines: lines.__setitem__(
        1, lines[1].replace(b",quasi-random,", b",quasi-random,nan,")
    ),
    "another digest": lambda lines: lines.__setitem__(3, lines[3][:-1] + b"x"),
    "no digest": lambda lines: lines.__setitem__(3, lines[3].rpartition(b",")[0]),
    "an empty line": lambda lines: lines.insert(2, b""),
    "a cell of 200,000 characters": lambda lines: lines.__setitem__(2, lines[2] + 200_000 * b"x"),
    "no UTF-8": lambda lines: lines.__setitem__(2, b"\xff" + lines[2]),
    "line ends of another system": lambda lines: lines.__setitem__(2, lines[2] + b"\r"),
}


@pytest.mark.parametrize("name", EDITED)
def test_a_row_that_was_changed_is_one_line(name: str, unfinished: Path, capsys: Any) -> None:
    path = unfinished / "evaluations.csv"
    lines = path.read_bytes().split(b"\n")
    EDITED[name](lines)
    path.write_bytes(b"\n".join(lines))
    code, err = run(capsys, "optimise", unfinished, "--resume", unfinished, "--quiet")
    assert code == 1
    assert "its digest is not that of this row after the rows before it" in err
    assert path.read_bytes() == b"\n".join(lines)


def test_rows_beyond_the_budget_are_one_line(unfinished: Path, finished_folder: Path, capsys: Any) -> None:
    """Even where a journal of a longer run is given the right digests."""
    path = unfinished / "evaluations.csv"
    edited(unfinished / "run.toml", "budget = 6", "budget = 2")
    entries = RunFolder.reopen(finished_folder).folder.open_journal(load_problem(finished_folder)).entries
    path.unlink()
    RunFolder.reopen(unfinished).folder.open_journal(load_problem(unfinished)).append(entries)
    code, err = run(capsys, "optimise", unfinished, "--resume", unfinished, "--quiet")
    assert code == 1
    assert "evaluations; allowed: 2" in err or "is not the one that this seed, budget" in err


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("problem.toml", "[simulation", "# a comment\n[simulation"),
        ("model.xml", "<mujoco", "<!-- a comment --><mujoco"),
        ("run.toml", "seed = 5", "seed = 6"),
        ("run.toml", "budget = 6", "budget = 7"),
    ],
)
def test_a_journal_belongs_to_the_files_beside_it(
    name: str, old: str, new: str, unfinished: Path, capsys: Any
) -> None:
    text = (unfinished / name).read_text()
    assert old in text
    (unfinished / name).write_text(text.replace(old, new, 1))
    code, err = run(capsys, "optimise", unfinished, "--resume", unfinished, "--quiet")
    assert (code, "line 2: its digest" in err) == (1, True)


def test_a_journal_of_an_earlier_version_is_refused(unfinished: Path, capsys: Any) -> None:
    path = unfinished / "evaluations.csv"
    path.write_text("".join(line.rpartition(",")[0] + "\n" for line in path.read_text().splitlines()))
    code, err = run(capsys, "optimise", unfinished, "--resume", unfinished, "--quiet")
    assert code == 1
    assert "no column digest: the run is of an earlier version; cannot resume" in err


def test_a_finished_run_of_an_earlier_version_is_printed(finished: Path, capsys: Any) -> None:
    path = finished / "evaluations.csv"
    path.write_text("".join(line.rpartition(",")[0] + "\n" for line in path.read_text().splitlines()))
    assert run(capsys, "optimise", finished, "--resume", finished, "--quiet") == (0, "")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("seed = 5", "seed = -1", "run.toml: seed: found -1; allowed: 0 or more"),
        ("budget = 6", "budget = 0", "run.toml: budget: found 0; allowed: 1 to"),
        ("budget = 6", "budget = " + "9" * 4000, "run.toml: budget: found"),
        ("seed = 5", "seed = " + "9" * 4301, "run.toml: not TOML"),
        ('method = "default"', 'method = "deafult"', "run.toml: method: found 'deafult'; allowed: default"),
        ("seed = 5", "seed = " + "[" * 300 + "]" * 300, "run.toml: nested too deep"),
        ("seed = 5", "seed = true", "run.toml: seed: found True; allowed: int"),
    ],
)
def test_a_request_out_of_range_is_one_line(
    old: str, new: str, said: str, unfinished: Path, capsys: Any
) -> None:
    edited(unfinished / "run.toml", old, new)
    code, err = run(capsys, "optimise", unfinished, "--resume", unfinished, "--quiet")
    assert (code, said in err) == (1, True), err


def deep(levels: int) -> Any:
    value: Any = 1
    for _ in range(levels):
        value = [value]
    return value


SUMMARIES: dict[str, Callable[[dict[str, Any]], object]] = {
    "null interval": lambda c: c["best"].update(speed_ci90_m_s=None),
    "null ends": lambda c: c["best"].update(speed_ci90_m_s=[None, None]),
    "no baselines": lambda c: c.update(baselines=[]),
    "null baselines": lambda c: c.pop("baselines"),
    "null best": lambda c: c.update(best=None),
    "900 deep": lambda c: c.update(extra=deep(900)),
    "notes 90 deep": lambda c: c.update(notes=deep(90)),
    "a speed of 4,000 digits": lambda c: c["best"].update(speed_m_s=10**4000),
    "a seed of 4,000 digits": lambda c: c.update(seed=10**4000),
    "null period": lambda c: c["best"].update(period_s=None),
    "a ratio of 4,000 digits": lambda c: c.update(ratio_to_best_baseline=10**4000),
    "null speeds": lambda c: [row.update(speed_m_s=None) for row in [c["best"], *c["baselines"]]],
    "a name of control characters": lambda c: c["best"].update(name="\x1b[31mred\u202e"),
    "a list": lambda c: c.clear(),
}


@pytest.mark.parametrize("as_json", [False, True])
@pytest.mark.parametrize("name", SUMMARIES)
def test_an_edited_summary_is_printed_or_one_line(
    name: str, as_json: bool, finished: Path, capsys: Any
) -> None:
    path = finished / "summary.json"
    content = json.loads(path.read_text())
    SUMMARIES[name](content)
    path.write_text(json.dumps(content))
    capsys.readouterr()
    code = cli.main(["optimise", str(finished), "--resume", str(finished), *(["--json"] if as_json else [])])
    out, err = capsys.readouterr()
    assert code == err.count("\n")
    assert "nan" not in out.lower()
    assert "\x1b" not in out
    assert "\u202e" not in out


@pytest.mark.parametrize("as_json", [False, True])
@pytest.mark.parametrize("extra", [deep(900), 10**4000, {"a": deep(90)}])
def test_an_edited_diagnosis_is_printed_or_one_line(
    extra: Any, as_json: bool, tmp_path: Path, capsys: Any
) -> None:
    content = {"answer": "No gap.", "explanation": ["a"], "extra": extra}
    (tmp_path / "diagnosis.json").write_text(json.dumps(content))
    words = ["diagnose", str(STRIDER), "trials", "--resume", str(tmp_path)]
    code = cli.main([*words, *(["--json"] if as_json else [])])
    _, err = capsys.readouterr()
    assert code == err.count("\n")
