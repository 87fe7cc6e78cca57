"""Attacks with a problem's folder: its model, its parameters and the files that commands read and write."""

import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest
from helpers import STRIDER, edited, problem_folder
from hostility import CUBE, make_device, refused, run, with_element, within

from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.problem.draft import make_problem
from gaitopt.problem.mjcf import checked_text
from gaitopt.problem.model import build_model, nominal_mjcf
from gaitopt.problem.problem import load_problem

HOSTILE_ATTRIBUTES = [
    'x="1"/><include file="{elsewhere}"/><geom a',
    "x='1'/><include file='{elsewhere}'/><geom a",
    "x><include file",
    "a b",
    "a=",
    "a\tb",
    "",
    "1a",
    "{{x}}a",
    "ä",
    "a\u2028b",
    "a/b",
    "xmlns:x",
]


def with_path(folder: Path, path: str) -> Path:
    """STRIDER, with a parameter that is written to a path of its MJCF."""
    values = {"value": 1.0, "unit": "1", "origin": "assumed", "sets": [path]}
    return problem_folder(folder, STRIDER, lambda c: c["parameters"].update(attack=values))


@pytest.mark.parametrize("attribute", HOSTILE_ATTRIBUTES)
def test_an_attribute_name_is_no_markup(tmp_path: Path, attribute: str) -> None:
    elsewhere = tmp_path / "elsewhere.xml"
    elsewhere.write_text('<mujocoinclude><site name="stolen"/></mujocoinclude>')
    folder = with_path(tmp_path / "robot", f".//geom/@{attribute.format(elsewhere=elsewhere)}")
    said = refused(lambda: nominal_mjcf(load_problem(folder)))
    assert "sets: path: found" in said


@pytest.mark.parametrize(
    "path", [".//body//*//*//*//*/@name", ".//*" + 30 * "//*" + "/@name", "worldbody" + 5000 * "/.." + "/@a"]
)
def test_a_path_that_finds_things_without_end_is_one_line(tmp_path: Path, path: str) -> None:
    folder = with_path(tmp_path / "robot", path)
    nested = 150 * '<body name="b"><geom size="1"/>' + 150 * "</body>"
    edited(folder / "strider.xml", "</worldbody>", nested + "</worldbody>")
    with within(20):
        assert "attack.sets: path: found" in refused(lambda: nominal_mjcf(load_problem(folder)))


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("asset/mesh/@file", "/etc/passwd"),
        ("asset/mesh/@file", "../secret.obj"),
        ("compiler/@meshdir", "/etc"),
        ("compiler/@strippath", "true"),
        ("size/@nkey", "2000000000"),
        ("worldbody/@a", "\x00"),
    ],
)
def test_what_a_parameter_writes_is_checked_too(tmp_path: Path, path: str, text: str) -> None:
    element = '<compiler meshdir="."/><size nkey="1"/><asset><mesh name="m" file="m.obj"/></asset>'
    folder = with_element(tmp_path / "robot", element).source.parent
    (folder / "m.obj").write_bytes(CUBE)
    assert build_model(load_problem(folder)).nmesh == 1
    values = {"value": 1.0, "unit": "1", "origin": "assumed", "sets": {path: text}}
    problem = problem_folder(tmp_path / "edited", folder, lambda c: c["parameters"].update(attack=values))
    (tmp_path / "secret.obj").write_text("v 0 0 0")
    refused(lambda: nominal_mjcf(load_problem(problem)))


@pytest.mark.parametrize(
    "text",
    [
        '<mujoco><include file="x"/></mujoco>',
        '<mujoco><asset><mesh file="/etc/passwd"/></asset></mujoco>',
        '<mujoco><asset><hfield file="x"/></asset></mujoco>',
        "<mujoco>" + 300 * "<body>" + 300 * "</body>" + "</mujoco>",
    ],
)
def test_what_mujoco_compiles_is_checked_as_a_whole(tmp_path: Path, text: str) -> None:
    """It does not matter what edited it before."""
    refused(lambda: checked_text(ET.fromstring(text), tmp_path / "m.xml", {}))
    root = ET.fromstring("<mujoco><worldbody/></mujoco>")
    root[0].set('a="1"/><include file="/x"/><b c', "1")
    assert "<include>" in refused(lambda: checked_text(root, tmp_path / "m.xml", {}))


@pytest.mark.parametrize("kind", ["link", "pipe", "link to a pipe", "device", "folder", "link to nothing"])
def test_a_model_that_nobody_names_is_a_plain_file_of_its_folder(tmp_path: Path, kind: str) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER, lambda c: c.pop("model", None))
    (folder / "strider.xml").rename(tmp_path / "elsewhere.xml")
    model = folder / "strider.xml"
    if kind == "link":
        model.symlink_to("../elsewhere.xml")
    elif kind == "pipe":
        os.mkfifo(model)
    elif kind == "link to a pipe":
        os.mkfifo(folder / "pipe")
        model.symlink_to("pipe")
    elif kind == "device":
        make_device(model)
    elif kind == "folder":
        model.mkdir()
    else:
        model.symlink_to("nothing")
    with within(20):
        assert "strider.xml" in refused(lambda: load_problem(folder))


@pytest.mark.parametrize("name", ["problem.toml", "best.toml", "dataset.toml"])
def test_a_file_found_in_a_folder_is_no_link_out_of_it(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    shutil.copytree(STRIDER, folder, dirs_exist_ok=True)
    problem = load_problem(STRIDER)
    (folder / name).unlink(missing_ok=True)
    (tmp_path / name).write_text("")
    (folder / name).symlink_to(tmp_path / name)
    calls = {
        "problem.toml": lambda: load_problem(folder),
        "best.toml": lambda: problem.find_gait(str(folder)),
        "dataset.toml": lambda: load_dataset(folder, problem, ["marker.x"]),
    }
    assert "found a link out of its folder" in refused(calls[name])


COMMANDS = {
    "a gait": ("simulate", STRIDER, "{odd}"),
    "another gait": ("simulate", STRIDER, "stride", "--video", "a.gif", "--beside", "{odd}"),
    "a gait to export": ("export", STRIDER, "{odd}", "--format", "c", "--out", "out"),
    "a gait to command": ("command", STRIDER, "{odd}", "--dt", "1", "--duration", "2", "--out", "out.csv"),
    "a problem": ("simulate", "{odd}", "stride"),
    "a model": ("new", "bot", "--mjcf", "{odd}"),
    "a recording": ("import", "{odd}", "--problem", STRIDER, "--gait", "stride", "--out", "out"),
    "the gait of a recording": ("import", "walk.csv", "--gait", "{odd}", "--out", "out"),
    "a data set": ("diagnose", STRIDER, "{odd}", "--out", "out", "--quiet"),
    "measured": ("simulate", STRIDER, "stride", "--video", "a.gif", "--measured", "{odd}"),
}


@pytest.mark.parametrize("kind", ["pipe", "device"])
@pytest.mark.parametrize("what", COMMANDS)
def test_a_pipe_or_a_device_is_one_line_for_every_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str, kind: str
) -> None:
    Path("walk.csv").write_text("t_s,x_m\n0,0\n0.1,0\n0.2,1\n")
    odd = tmp_path / "odd"
    os.mkfifo(odd) if kind == "pipe" else make_device(odd)
    arguments = [str(word).format(odd=odd) for word in COMMANDS[what]]
    with within(60):
        code, said = run(capsys, *arguments)
    assert (code, "odd" in said) == (1, True)
    assert not Path("out").exists()


@pytest.mark.parametrize("name", ["../robot/m.obj", "{folder}/m.obj", "sub/../m.obj", "../out/m.obj"])
def test_a_new_problem_writes_into_its_own_folder_alone(tmp_path: Path, name: str) -> None:
    """A mesh in the robot's folder, named by a path that leaves it; in a copy it would be elsewhere."""
    folder = problem_folder(tmp_path / "robot", STRIDER)
    (folder / "sub").mkdir()
    element = f'<asset><mesh name="m" file="{name.format(folder=folder)}"/></asset>'
    edited(folder / "strider.xml", "</worldbody>", "</worldbody>" + element)
    (folder / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    (tmp_path / "new").mkdir()
    refused(lambda: make_problem("bot", folder / "strider.xml", tmp_path / "new" / "out"))
    assert list((tmp_path / "new").iterdir()) == []


@pytest.mark.parametrize(
    "name", ["rear's foot", '"foot"', "foot \U0001f9b6", "a]foot", "foot/@b", "{foot}", "foot*", "äfoot'"]
)
@pytest.mark.parametrize("kind", ["rear_foot", "rear"])
def test_new_takes_any_name_that_mujoco_takes(tmp_path: Path, name: str, kind: str) -> None:
    robot = shutil.copytree(STRIDER, tmp_path / "robot")
    edited(robot / "strider.xml", f'name="{kind}"', f"name={quoteattr(name)}")
    make_problem("bot", robot / "strider.xml", tmp_path / "bot")
    problem = load_problem(tmp_path / "bot")
    assert name in (problem.roles.pads if kind == "rear_foot" else problem.channel_names)
    assert "mu_pads" in problem.file.parameters
    assert build_model(problem).nu == 2


def test_new_leaves_out_the_friction_of_a_pad_with_both_quotes(tmp_path: Path) -> None:
    robot = shutil.copytree(STRIDER, tmp_path / "robot")
    name = """rear's "foot" """.strip()
    edited(robot / "strider.xml", 'name="rear_foot"', f"name={quoteattr(name)}")
    make_problem("bot", robot / "strider.xml", tmp_path / "bot")
    problem = load_problem(tmp_path / "bot")
    assert name in problem.roles.pads
    assert "mu_pads" not in problem.file.parameters


HOSTILE_FOLDERS = {
    "an include": '<include file="{elsewhere}.xml"/>',
    "a link": '<include file="link.xml"/>',
    "a mesh": '<asset><mesh name="m" file="{elsewhere}.obj"/></asset>',
    "a mesh above": '<compiler meshdir=".."/><asset><mesh name="m" file="elsewhere.obj"/></asset>',
    "a texture": '<asset><texture name="t" type="cube" fileleft="{elsewhere}.png"/></asset>',
    "a height field": '<asset><hfield name="h" file="{elsewhere}.png" size="1 1 1 1"/></asset>',
    "a skin": '<deformable><skin name="s" file="{elsewhere}.skn"/></deformable>',
    "a soft body": '<worldbody><flexcomp name="f" type="mesh" file="{elsewhere}.obj"/></worldbody>',
    "an attached model": '<asset><model name="n" file="{elsewhere}.xml"/></asset>',
    "an attached model's include": '<asset><model name="n" file="n.xml"/></asset>',
}

WATCHED = """
import sys
opened = []
sys.addaudithook(lambda event, values: opened.append(values[0]) if event == "open" else None)
from gaitopt.cli import app
code = app.main(sys.argv[1:])
assert len(opened) > 50
print(code, [str(path) for path in opened if "elsewhere" in str(path)])
"""
"""Run a command, and print its exit code and the paths outside that Python opened."""


def hostile_problems(folder: Path) -> list[Path]:
    """Problems that name files outside in every known way."""
    made = []
    for index, element in enumerate(HOSTILE_FOLDERS.values()):
        problem = with_element(
            folder / f"p{index}", element.format(elsewhere=folder / "elsewhere")
        ).source.parent
        (problem / "link.xml").symlink_to(folder / "elsewhere.xml")
        (problem / "n.xml").write_text(f'<mujoco><include file="{folder}/elsewhere.xml"/></mujoco>')
        made.append(problem)
    written = with_path(
        folder / "written", f'.//geom/@x="1"/><include file="{folder}/elsewhere.xml"/><geom a'
    )
    unnamed = problem_folder(folder / "unnamed", STRIDER)
    (unnamed / "strider.xml").rename(folder / "elsewhere-model.xml")
    (unnamed / "strider.xml").symlink_to(folder / "elsewhere-model.xml")
    linked = problem_folder(folder / "linked", STRIDER)
    (linked / "problem.toml").rename(folder / "elsewhere-problem.toml")
    (linked / "problem.toml").symlink_to(folder / "elsewhere-problem.toml")
    return [*made, written, unnamed, linked]


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not installed")
def test_nothing_outside_the_folder_is_opened(tmp_path: Path) -> None:
    """Watched by the kernel, because MuJoCo opens files without Python, and by Python's audit hook."""
    for suffix in ("xml", "obj", "png", "skn"):
        (tmp_path / f"elsewhere.{suffix}").write_bytes(CUBE)
    problems = hostile_problems(tmp_path)
    commands: list[tuple[object, ...]] = [("simulate", problem, "stride", "--json") for problem in problems]
    commands += [("new", "bot", "--mjcf", problem / "strider.xml") for problem in problems[:3]]
    for command in commands:
        strace = ("strace", "-f", "-qq", "-e", "trace=open,openat,openat2,creat", "-o", "trace")
        done = subprocess.run(
            [*strace, sys.executable, "-c", WATCHED, *map(str, command)],
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.stdout, done.stderr.count("\n")) == ("1 []\n", 1), done.stdout + done.stderr
        opened = Path("trace").read_text()
        assert opened.count("\n") > 50
        assert "elsewhere" not in opened
