"""An MJCF and what it includes."""

from pathlib import Path

from helpers import STRIDER, problem_folder

from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem, load_problem


def test_includes_are_resolved_inside_the_folder(tmp_path: Path, strider: Problem) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER)
    text = (folder / "strider.xml").read_text()
    begin, end = text.index("<actuator>"), text.index("</actuator>") + len("</actuator>")
    (folder / "servos").mkdir()
    (folder / "servos" / "two.xml").write_text(f"<mujoco>{text[begin:end]}</mujoco>")
    (folder / "strider.xml").write_text(text[:begin] + '<include file="servos/two.xml"/>' + text[end:])
    included, whole = build_model(load_problem(folder)), build_model(strider)
    assert included.actuator_gainprm.tolist() == whole.actuator_gainprm.tolist()
    assert included.key_qpos.tolist() == whole.key_qpos.tolist()
