"""Effects on the command line."""

import json
import re
from pathlib import Path
from typing import Any

import mujoco
import pytest
from effect_values import ELSEWHERE
from helpers import STRIDER, problem_folder

from gaitopt.cli.app import main
from gaitopt.effects import EFFECTS
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.verification import verify
from gaitopt.problem.problem import Problem, load_problem


def test_effects_prints_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects"]) == 0
    text = capsys.readouterr().out
    assert all(re.search(rf"^{name}: ", text, re.MULTILINE) for name in EFFECTS)
    assert main(["effects", "arcfold", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    limit = next(row for row in rows if row["name"] == "servo_torque_limit")
    assert limit["neutral"] == 0.245
    assert limit["bounds"] == pytest.approx([0.15 * 0.245, 1.5 * 0.245])
    assert [row["name"] for row in rows if not row["applies"]] == list(ELSEWHERE)


def test_effects_says_what_does_not_apply(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects", str(STRIDER)]) == 0
    assert "(the problem names no roles.hinges)" in capsys.readouterr().out
    assert main(["effects", str(STRIDER), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    hinges = {name for name in EFFECTS if name.startswith("hinge_")}
    assert {row["name"] for row in rows if not row["applies"]} == {*hinges, *ELSEWHERE}


@pytest.mark.slow
def test_optimise_works_on_a_robot_with_an_effect(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], strider: Problem
) -> None:
    def switch_on(content: dict[str, Any]) -> None:
        content["effects"] = {"servo_torque_limit": {"limit_n_m": 0.02, "target": "rear"}}

    folder, out = problem_folder(tmp_path / "weak", STRIDER, switch_on), tmp_path / "run"
    options = ["--budget", "4", "--no-warm-start", "--workers", "1", "--quiet", "--json"]
    assert main(["optimise", str(folder), *options, "--out", str(out)]) == 0
    speeds = [row["speed_m_s"] for row in json.loads(capsys.readouterr().out)["baselines"]]

    def verified(problem: Problem) -> list[float]:
        gaits = list(problem.baselines.values())
        return [row.speed for row in verify(problem, gaits, 1, SerialExecutor())]

    assert speeds == verified(load_problem(out))
    assert speeds != verified(strider)
    model = mujoco.MjModel.from_xml_path(str(out / "model.xml"))
    assert model.actuator("rear").forcerange[1] == 0.04, "the run folder's model is the nominal one"
