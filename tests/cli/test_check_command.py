"""`gaitopt check`: planted defects are found, and a good robot has none."""

from pathlib import Path
from typing import Any

import pytest
from commandline import Run, strictly
from helpers import STRIDER, edited, problem_folder


def findings(gaitopt: Run, problem: Path) -> list[dict[str, Any]]:
    """What the audit finds."""
    code, out, err = gaitopt("check", problem, "--json")
    assert (code, err) == (0, "")
    found = strictly(out)["findings"]
    assert all({"name", "gait", "value", "limit"} <= set(finding) for finding in found)
    return list(found)


@pytest.mark.slow
def test_check_finds_neither_of_the_published_defects_on_arcfold(gaitopt: Run, quick_folder: Path) -> None:
    found = {finding["name"] for finding in findings(gaitopt, quick_folder)}
    assert not found & {"inert_parameter", "airtime", "self_collision", "unrest_at_start", "diverged"}


def test_check_finds_planted_defects(gaitopt: Run, tmp_path: Path) -> None:
    """Friction as MuJoCo mixes it: the ground's 1 wins. Feet so big that they touch. A start in the air."""
    folder = problem_folder(tmp_path / "robot", STRIDER)
    xml = folder / "strider.xml"
    edited(xml, ' priority="1"', "")
    edited(xml, 'contype="1" conaffinity="0"', 'contype="1" conaffinity="1"')
    edited(xml, 'size="0.005" mass', 'size="0.045" mass')
    edited(xml, '<body name="trunk" pos="0 0 0.03">', '<body name="trunk" pos="0 0 0.09">')
    edited(
        folder / "problem.toml",
        'name = "strider"',
        'name = "strider"\nfriction = "mujoco"\nstart.settle = false',
    )
    edited(xml, "</mujoco>", '<keyframe><key name="start"/></keyframe></mujoco>')
    found = findings(gaitopt, folder)
    assert {"inert_parameter", "unrest_at_start", "self_collision"} <= {finding["name"] for finding in found}
    inert = {finding["parameter"] for finding in found if finding["name"] == "inert_parameter"}
    assert {"mu_front", "mu_trunk"} <= inert
    assert "mass" not in inert


def test_check_calls_inert_only_the_friction_of_what_never_touches(gaitopt: Run) -> None:
    found = findings(gaitopt, STRIDER)
    assert not {finding["name"] for finding in found} & {"self_collision", "unrest_at_start", "diverged"}
    inert = {finding["parameter"] for finding in found if finding["name"] == "inert_parameter"}
    assert inert <= {"mu_trunk"}
