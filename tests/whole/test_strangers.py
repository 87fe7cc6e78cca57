"""What a stranger's files may not do."""

import ast
import tomllib
from pathlib import Path

import pytest
import tomli_w
from helpers import STRIDER, problem_folder
from hostility import CUBE, refused, run, trees, with_element

from gaitopt.core.files import inside
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.gait.gait import Channel, Gait, read_gait, write_gait
from gaitopt.problem.model import build_model, carrying, model_assets
from gaitopt.problem.problem import load_problem
from gaitopt.report.page import Page, Section, Table


def test_nothing_runs_code_from_a_file() -> None:
    """No eval, exec, pickle, YAML, shell or other program anywhere; arrays are read without objects."""
    modules = {"pickle", "cPickle", "dill", "shelve", "marshal", "yaml", "subprocess", "code", "runpy", "imp"}
    calls = {
        "eval",
        "exec",
        "compile",
        "__import__",
        "breakpoint",
        "os.system",
        "os.popen",
        "execfile",
        "input",
    }
    for path, tree in trees():
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                assert not {alias.name.partition(".")[0] for alias in node.names} & modules, path
            elif isinstance(node, ast.ImportFrom):
                assert (node.module or "").partition(".")[0] not in modules, path
            elif isinstance(node, ast.Call):
                called = ast.unparse(node.func)
                assert called not in calls, f"{path}: {called}"
                assert not called.startswith(("os.exec", "os.spawn")), f"{path}: {called}"
                assert not any(k.arg == "shell" for k in node.keywords), path
                assert not any(
                    k.arg == "allow_pickle" and ast.unparse(k.value) != "False" for k in node.keywords
                ), path


@pytest.fixture
def secret(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Files outside the problem's folder: in the folder above, and in the working directory."""
    for folder in (tmp_path, tmp_path / "cwd"):
        folder.mkdir(exist_ok=True)
        (folder / "secret.obj").write_bytes(CUBE)
        (folder / "secret.xml").write_text('<mujocoinclude><site name="secret"/></mujocoinclude>')
    monkeypatch.chdir(tmp_path / "cwd")
    return tmp_path


def nested(body: str) -> str:
    return (
        f'<mujoco><asset>{body}</asset><worldbody><body name="b"><geom size="1"/></body></worldbody></mujoco>'
    )


REACHING = {
    "an absolute include": '<include file="{secret}/secret.xml"/>',
    "an include from above": '<include file="../secret.xml"/>',
    "an include through a link": '<include file="link.xml"/>',
    "a mesh from above": '<asset><mesh name="m" file="../secret.obj"/></asset>',
    "an absolute mesh": '<asset><mesh name="m" file="{secret}/secret.obj"/></asset>',
    "a mesh in the working directory": '<asset><mesh name="m" file="secret.obj"/></asset>',
    "a mesh through a link": '<asset><mesh name="m" file="link.obj"/></asset>',
    "a folder of meshes above": '<compiler meshdir=".."/><asset><mesh name="m" file="secret.obj"/></asset>',
    "a later folder of meshes": '<compiler meshdir="x"/><compiler assetdir=".."/>'
    '<asset><mesh name="m" file="secret.obj"/></asset>',
    "a side of a texture": '<asset><texture name="t" type="cube" fileleft="../secret.png"/></asset>',
    "a height field": '<asset><hfield name="h" file="../secret.png" size="1 1 1 1"/></asset>',
    "paths stripped": '<compiler strippath="true"/><asset><mesh name="m" file="no/secret.obj"/></asset>',
    "an attached model's mesh": '<asset><model name="n" file="nested.xml"/></asset>',
    "an attached model's include": '<asset><model name="n" file="including.xml"/></asset>',
    "an attached model's document type": '<asset><model name="n" file="typed.xml"/></asset>',
}


@pytest.mark.parametrize("reach", REACHING)
def test_a_model_reads_files_from_its_own_folder_alone(
    secret: Path, capsys: pytest.CaptureFixture[str], reach: str
) -> None:
    problem = with_element(secret / "robot", REACHING[reach].format(secret=secret))
    folder = secret / "robot"
    (folder / "link.xml").symlink_to(secret / "secret.xml")
    (folder / "link.obj").symlink_to(secret / "secret.obj")
    (folder / "nested.xml").write_text(nested('<mesh name="m" file="secret.obj"/>'))
    (folder / "including.xml").write_text(nested(f'<include file="{secret}/secret.xml"/>'))
    (folder / "typed.xml").write_text("<!DOCTYPE mujoco []>" + nested(""))
    said = refused(lambda: build_model(problem))
    assert "folder" in said or "allowed" in said
    for call in (carrying, model_assets):
        refused(lambda call=call: call(problem))  # type: ignore[misc]
    drafted = run(capsys, "new", "bot", "--mjcf", folder / "strider.xml", "--out", secret / "out")[0]
    if reach == "a mesh in the working directory":  # missing in the folder, and no geom shows it: left out
        assert drafted == 0
        assert not (secret / "out" / "secret.obj").exists()
        assert "secret" not in (secret / "out" / "strider.xml").read_text()
    else:
        assert drafted == 1
        assert not (secret / "out").exists()


def test_an_attached_model_without_files_is_taken(tmp_path: Path) -> None:
    problem = with_element(tmp_path / "robot", '<asset><model name="n" file="nested.xml"/></asset>')
    (tmp_path / "robot" / "nested.xml").write_text(nested(""))
    assert build_model(problem).nu == 2
    assert list(model_assets(problem)) == ["nested.xml"]


def test_meshes_and_textures_have_folders_of_their_own(tmp_path: Path) -> None:
    element = (
        '<compiler meshdir="x"/><compiler assetdir="parts/"/><asset><mesh name="m" file="c.obj"/></asset>'
    )
    problem = with_element(tmp_path / "robot", element)
    (tmp_path / "robot" / "parts").mkdir()
    (tmp_path / "robot" / "parts" / "c.obj").write_bytes(CUBE)
    assert build_model(problem).nmesh == 1
    assert list(model_assets(problem)) == ["parts/c.obj"]


@pytest.mark.parametrize(
    ("files", "said"),
    [
        (
            {"strider.xml": '<!DOCTYPE m [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]><mujoco model="&b;"/>'},
            "<!DOCTYPE>",
        ),
        (
            {"strider.xml": '<!DOCTYPE m [<!ENTITY a SYSTEM "file:///etc/passwd">]><mujoco model="&a;"/>'},
            "<!DOCTYPE>",
        ),
        (
            {"strider.xml": "<mujoco>" + 5000 * "<body>" + 5000 * "</body>" + "</mujoco>"},
            "nested more than 200 deep",
        ),
        (
            {
                "strider.xml": '<mujoco><include file="a"/><include file="a"/></mujoco>',
                "a": "<mujocoinclude/>",
            },
            "twice",
        ),
        (
            {
                "strider.xml": '<mujoco><include file="a"/></mujoco>',
                "a": '<mujoco><include file="a"/></mujoco>',
            },
            "twice",
        ),
        ({"strider.xml": '<mujoco><include file="strider.xml"/></mujoco>'}, "twice"),
    ],
)
def test_xml_that_grows_without_end_is_one_line(tmp_path: Path, files: dict[str, str], said: str) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER)
    for name, text in files.items():
        (folder / name).write_text(text)
    assert said in refused(lambda: build_model(load_problem(folder)))


@pytest.mark.parametrize("name", ["..", "../x", "/etc/passwd", "a\x00b", "x/../../y", "x" * 5000, "loop"])
def test_only_files_inside_a_folder_are_inside(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "loop").symlink_to("loop")
    found = inside(folder, name)
    assert found is None or not found.exists()


def test_data_sets_and_problems_name_files_beside_them_alone(secret: Path) -> None:
    folder = problem_folder(secret / "robot", STRIDER, lambda c: c.update(model="../secret.xml"))
    assert "model: found '../secret.xml'" in refused(lambda: load_problem(folder))
    entry = {"name": "a", "gait": "stride", "file": "../secret.obj", "signals": {"marker.x": "x_m"}}
    (folder / "dataset.toml").write_text(tomli_w.dumps({"trial": [entry]}))
    said = refused(lambda: load_dataset(folder, load_problem(STRIDER), ["marker.x"]))
    assert "allowed: a file in the data set's folder" in said


HOSTILE = [
    "<script>alert(1)</script>",
    '*/ system("x") //',
    "'\"><img src=x onerror=alert(1)>",
    "{{ 7*7 }}",
    "&lt;b",
]


@pytest.mark.parametrize("name", HOSTILE)
def test_a_name_stays_a_name_in_a_page(name: str) -> None:
    page = Page(
        title=name,
        answer=name,
        asked={name: name},
        tiles=[(name, name)],
        notes=[name],
        sections=[
            Section(
                name,
                sentences=[name],
                table=Table([name], [[name]], note=name),
                caption=name,
                commands=[name],
            )
        ],
    )
    html = page.html()
    assert "<script>alert" not in html
    assert "<img src=x" not in html
    assert "49" not in html.partition("<body")[2].replace("7*7", "")


@pytest.mark.parametrize("name", [*HOSTILE, "a\nb = 1", 'a" = 1', "'''", "\\", "[x]", "", "ü\u202e"])
def test_a_name_stays_a_name_in_toml(tmp_path: Path, name: str) -> None:
    gait = Gait(1.0, {name: Channel(duty=0.5, phase=0.0, amplitude_deg=1.0)}, "gait")
    write_gait(tmp_path / "gait.toml", gait)
    assert read_gait(tmp_path / "gait.toml") == gait
    assert list(tomllib.loads(gait.to_toml())["channels"]) == [name]
