"""A model in one file: meshes, height fields and textures are written into it."""

from __future__ import annotations

import io
import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from helpers import STRIDER, edited, problem_folder
from PIL import Image

from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.core.streams import seeded
from gaitopt.problem.model import build_model, carrying
from gaitopt.problem.problem import load_problem
from gaitopt.problem.self_contained import self_contained_mjcf

Printed = pytest.CaptureFixture[str]

WEDGE = """v 0 0 0
v 0.03 0 0
v 0 0.02 0
v 0 0 0.05
v 0.03 0.02 0.01
f 1 3 2
f 1 2 4
f 1 4 3
f 2 5 4
f 3 4 5
f 2 3 5
"""

ASSETS = """<asset>
  <mesh name="wedge" file="wedge.obj" scale="1 2 1.5" refpos="0.01 0.02 0.03" refquat="0.7 0.1 0.2 0.3"/>
  <mesh file="plain.obj"/>
  <hfield name="hills" file="hills.png" size="1 1 0.2 0.1"/>
  <texture name="skin" type="2d" file="skin.png"/><material name="skin" texture="skin"/>
</asset>"""

GEOMS = """
  <geom type="hfield" hfield="hills" pos="9 9 0" material="skin"/>
  <body name="rock" pos="0 9 1"><freejoint/>
    <geom type="mesh" mesh="wedge" pos="0.1 0 0.2" euler="10 20 30"/>
    <geom type="mesh" mesh="plain" pos="-0.1 0 0"/></body>
</worldbody>"""

SAME = (
    *("body_mass", "body_inertia", "body_ipos", "body_iquat", "geom_pos", "geom_quat", "geom_size"),
    *("mesh_vert", "hfield_data"),
)


def picture(shape: tuple[int, ...]) -> bytes:
    held = io.BytesIO()
    Image.fromarray(seeded(3).integers(0, 255, shape).astype(np.uint8)).save(held, "png")
    return held.getvalue()


@pytest.fixture
def rocky(tmp_path: Path) -> Path:
    """The strider beside a rock of meshes, and hills."""
    folder = problem_folder(tmp_path / "rocky", STRIDER)
    edited(folder / "strider.xml", "</worldbody>", f"{GEOMS}{ASSETS}")
    edited(folder / "strider.xml", "<worldbody>", '<compiler meshdir="shapes"/><worldbody>')
    (folder / "shapes").mkdir()
    for name in ("wedge", "plain"):
        (folder / "shapes" / f"{name}.obj").write_text(WEDGE)
    (folder / "shapes" / "hills.png").write_bytes(picture((6, 9)))
    (folder / "skin.png").write_bytes(picture((4, 4, 3)))
    return folder


def test_a_model_in_one_file_is_the_same_robot(rocky: Path) -> None:
    problem = carrying(load_problem(rocky))
    text = self_contained_mjcf(problem)
    assert "file=" not in text
    alone, whole = mujoco.MjModel.from_xml_string(text), build_model(problem)
    for name in SAME:
        np.testing.assert_allclose(getattr(alone, name), getattr(whole, name), atol=1e-7, err_msg=name)
    colour = np.asarray(whole.tex_data).reshape(-1, 3).mean(axis=0)
    assert np.abs(np.asarray(alone.tex_data).reshape(-1, 3) - colour).max() < 1.0


def test_the_command_says_what_it_wrote(rocky: Path, tmp_path: Path, capsys: Printed) -> None:
    out = tmp_path / "elsewhere.xml"
    assert cli.main(["model", str(rocky), "--out", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"file": str(out), "left_out": []}
    assert mujoco.MjModel.from_xml_path(str(out)).nmesh == 2


def test_effects_are_left_out_and_named(rocky: Path, tmp_path: Path, capsys: Printed) -> None:
    path = rocky / "problem.toml"
    path.write_text(path.read_text() + "\n[effects.servo_gain]\nscale = 0.8\n")
    assert cli.main(["model", str(rocky), "--out", str(tmp_path / "a.xml")]) == 0
    assert "left out: effects that act beside the model: servo_gain" in capsys.readouterr().out


def test_a_file_that_cannot_be_written_into_it_is_one_line(rocky: Path) -> None:
    edited(rocky / "strider.xml", "</asset>", '<model name="rover" file="parts/rover.xml"/></asset>')
    (rocky / "parts").mkdir()
    (rocky / "parts" / "rover.xml").write_text('<mujoco><worldbody><body name="b"/></worldbody></mujoco>')
    with pytest.raises(GaitoptError, match=r"model file: found parts/rover.xml; a model in one file"):
        self_contained_mjcf(carrying(load_problem(rocky)))


def test_a_limit_of_zero_is_refused() -> None:
    """MuJoCo takes the range 0 0 for no limit at all."""
    weak = load_problem("arcfold").with_parameters({"torque_limit": 0.0})
    with pytest.raises(GaitoptError, match=r"parameters\.torque_limit: value: found 0.0; allowed: another"):
        build_model(weak)
