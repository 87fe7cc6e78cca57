"""Commands watched by the kernel: what they read and what they change outside of a stranger's folder."""

import os
import shutil
from pathlib import Path

import pytest
from ending import Stop, diagnosis, small_trials
from helpers import STRIDER, edited, problem_folder
from hostility import CUBE, contents
from watching import watched

from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.gait.gait import write_gait
from gaitopt.problem.model import model_assets, nominal_mjcf
from gaitopt.problem.problem import load_problem

SMALL = ("--effects", "pad_friction,ground_slope", "--quiet")
CASE = ("--cases", 1, "--kind", "none", "--gaits", "stride", "--seconds", 3, "--signals", "marker.y")

with_strace = pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not installed")


def begun(command: str, folder: Path, unfinished: Path) -> tuple[list[object], Path]:
    """A command, and the folder that it may change: what it goes on with is there."""
    if command == "optimise --resume":
        return ["optimise", unfinished, "--resume", unfinished, "--quiet"], unfinished
    if command.startswith("blind"):
        cases = folder / "cases"
        make: list[object] = ["blind", "make", STRIDER, *CASE, "--out", cases]
        if command == "blind score":
            assert watched(*make, settings=folder / "settings").code == 0
            return ["blind", "score", cases], cases
        return make, cases
    trials = small_trials(folder / "trials")
    if command == "diagnose --out":
        return ["diagnose", STRIDER, trials, *SMALL, "--out", folder / "made"], folder / "made"
    work = diagnosis(folder / "stopped", trials)
    assert work.run(Stop("fitting", 3)).marker["stage"] == "fitting"
    return ["diagnose", STRIDER, trials, *SMALL, "--resume", work.folder], work.folder


@pytest.mark.slow
@with_strace
@pytest.mark.parametrize(
    "command", ["optimise --resume", "diagnose --out", "diagnose --resume", "blind make", "blind score"]
)
def test_a_command_changes_its_own_folder_alone(command: str, unfinished: Path, tmp_path: Path) -> None:
    """Watched by strace: files opened to write, made, removed and renamed; folders made and removed."""
    words, folder = begun(command, tmp_path, unfinished)
    seen = watched(*words, settings=tmp_path / "settings")
    assert seen.code == 0, seen.err
    assert seen.changed_outside(folder, tmp_path / "settings") == set()
    assert any(path.is_relative_to(folder) for path in seen.changed)


LINKS = {
    "optimise --resume": (".lock", "best.toml", "figures"),
    "diagnose --resume": (".lock", "diagnosis.json", "figures"),
    "blind make": ("sealed", "case-000"),
    "blind score": ("diagnoses/case-000/report.html", "diagnoses/case-001"),
}


@pytest.mark.slow
@with_strace
@pytest.mark.parametrize("command", LINKS)
def test_a_resumed_run_opens_nothing_outside_its_folder_to_write(
    command: str, unfinished: Path, victim: Path, tmp_path: Path
) -> None:
    """Nor to read: with links out of it nothing that they lead to is opened."""
    words, folder = begun(command, tmp_path, unfinished)
    before = contents(victim)
    folder.mkdir(exist_ok=True)
    for name in LINKS[command]:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).unlink(missing_ok=True)
        (folder / name).symlink_to(victim / "notes.txt" if "." in name else victim)
    seen = watched(*words, settings=tmp_path / "settings")
    assert (seen.code, "found a link" in seen.err) == (1, True), seen.err
    assert seen.changed_outside(tmp_path / "settings") == set()
    assert not any(path.is_relative_to(victim) for path in seen.opened)
    assert contents(victim) == before


READ = {
    "a problem": ("simulate", "{run}", "stride"),
    "its gait": ("simulate", STRIDER, "{run}"),
    "a gait to export": ("export", STRIDER, "{run}", "--format", "c", "--out", "out"),
    "the gait of an import": ("import", "{run}/walk.csv", "--gait", "{run}", "--out", "out"),
    "a data set": ("diagnose", STRIDER, "{run}", "--quiet", "--out", "out"),
    "a measured film": ("simulate", STRIDER, "stride", "--video", "out.gif", "--measured", "{run}"),
}
ENTRIES = {
    "a problem": ("problem.toml", "model.xml", "assets", "assets/m.obj"),
    "its gait": ("best.toml",),
    "a gait to export": ("best.toml",),
    "the gait of an import": ("best.toml",),
    "a data set": ("dataset.toml", "walk.csv", "gait.toml", "log.csv"),
    "a measured film": ("dataset.toml", "walk.csv"),
}


@pytest.fixture
def sent(tmp_path: Path) -> Path:
    """A folder that is a problem, a run, and a data set of a trial with a gait and one with commands."""
    folder = problem_folder(tmp_path / "sent", STRIDER)
    (folder / "strider.xml").rename(folder / "model.xml")
    mesh = '<asset><mesh name="m" file="assets/m.obj"/></asset>'
    edited(folder / "model.xml", "</worldbody>", "</worldbody>" + mesh)
    (folder / "assets").mkdir()
    (folder / "assets" / "m.obj").write_bytes(CUBE)
    gait = load_problem(STRIDER).baselines["stride"]
    for name in ("best.toml", "gait.toml"):
        write_gait(folder / name, gait)
    times = [0.05 * index for index in range(60)]
    (folder / "walk.csv").write_text("t_s,y_m\n" + "".join(f"{time:.2f},{time / 9}\n" for time in times))
    (folder / "log.csv").write_text("t_s,rear_deg,front_deg\n0,0,0\n1,10,10\n2.9,0,0\n")
    (folder / "dataset.toml").write_text(
        "".join(
            f'[[trial]]\nname = "{name}"\n{drive}\nfile = "walk.csv"\nsignals = {{"marker.y" = "y_m"}}\n'
            for name, drive in (("a", 'gait = "gait.toml"'), ("b", 'commands = "log.csv"'))
        )
    )
    return folder


def read(what: str, folder: Path) -> object:
    """What a folder says."""
    problem = load_problem(STRIDER)
    if what == "a problem":
        return nominal_mjcf(load_problem(folder)), model_assets(load_problem(folder))
    if what == "its gait":
        return problem.find_gait(str(folder)).to_dict()
    return repr(load_dataset(folder, problem, ["marker.y"]).trials)


@pytest.mark.slow
@with_strace
@pytest.mark.parametrize(("what", "name"), [(what, name) for what in ENTRIES for name in ENTRIES[what]])
def test_a_link_out_of_a_folder_is_not_read(what: str, name: str, sent: Path, tmp_path: Path) -> None:
    """Watched by strace: what it leads to is not opened, and nothing is written."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (sent / name).rename(elsewhere / Path(name).name)
    (sent / "step").symlink_to(elsewhere / Path(name).name)  # out of it in two steps
    (sent / name).symlink_to(os.path.relpath(sent / "step", (sent / name).parent))
    words = [str(word).format(run=sent) for word in READ[what]]
    seen = watched(*words, settings=tmp_path / "settings")
    assert (seen.code, seen.err.count("\n")) == (1, 1), seen.err
    assert Path(name).name in seen.err
    assert not any(path.is_relative_to(elsewhere) for path in seen.opened)
    assert seen.changed_outside(tmp_path / "settings", Path("out")) == set()
    assert not Path("out").exists()


@pytest.mark.parametrize("kind", ["link inside", "hard link"])
@pytest.mark.parametrize("what", ["a problem", "its gait", "a data set"])
def test_a_link_inside_a_folder_and_a_second_name_are_read(
    what: str, kind: str, sent: Path, tmp_path: Path
) -> None:
    """Reading changes nothing, and nothing tells a second name of a file from its first."""
    before = read(what, sent)
    place = sent / "kept" if kind == "link inside" else tmp_path / "elsewhere"
    place.mkdir()
    for name in ENTRIES[what]:
        if kind == "hard link" and (sent / name).is_file():
            (place / Path(name).name).hardlink_to(sent / name)
        elif kind == "link inside" and name != "assets/m.obj":
            (sent / name).rename(place / name)
            (sent / name).symlink_to(Path("kept") / name)
    assert read(what, sent) == before


@with_strace
def test_the_watch_sees_what_is_read_and_written(sent: Path, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(sent)
    words = ("simulate", tmp_path / "link", "stride", "--csv", tmp_path / "link" / "out.csv")
    seen = watched(*words, settings=tmp_path / "settings")
    assert seen.code == 0, seen.err
    assert {sent / "model.xml", sent / "problem.toml", sent / "assets" / "m.obj"} <= seen.opened
    assert sent / "out.csv" in seen.changed_outside(tmp_path / "settings")
    assert seen.changed_outside(sent, tmp_path / "settings") == set()
