"""`gaitopt model` and `gaitopt command`: what they write."""

from pathlib import Path

import numpy as np
import pytest
from commandline import Run
from helpers import STRIDER

from gaitopt.problem.model import build_model, nominal_mjcf
from gaitopt.problem.problem import Problem


def test_model_writes_the_nominal_mjcf(gaitopt: Run, tmp_path: Path, strider: Problem) -> None:
    code, out, err = gaitopt("model", STRIDER, "--out", tmp_path / "robot.xml", "--set", "mass=0.05")
    assert (code, out, err) == (0, f"{tmp_path / 'robot.xml'}\n", "")
    text = (tmp_path / "robot.xml").read_text()
    assert text == nominal_mjcf(strider.with_parameters({"mass": 0.05}))


@pytest.mark.parametrize(
    ("dt", "duration", "rows"),
    [(0.1, 0.3, 3), (0.01, 0.4, 40), (0.02, 1.0, 50), (0.3, 1.0, 4), (1.0, 0.5, 1), (1e-3, 0.7, 700)],
)
def test_command_writes_what_is_sent(
    gaitopt: Run, tmp_path: Path, strider: Problem, dt: float, duration: float, rows: int
) -> None:
    """t_s, then a column per actuator in the model's order; rows t = 0, dt, ... < duration."""
    path = tmp_path / "command.csv"
    code, out, _ = gaitopt("command", STRIDER, "square", "--dt", dt, "--duration", duration, "--out", path)
    assert (code, out) == (0, f"{path}\n")
    header, *lines = path.read_text().splitlines()
    model = build_model(strider)
    assert header.split(",") == ["t_s", *(model.actuator(i).name for i in range(model.nu))]
    table = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    assert len(table) == rows
    assert table[:, 0] == pytest.approx(np.arange(rows) * dt, abs=1e-12)
    np.testing.assert_array_equal(table[:, 1:], strider.baselines["square"].targets(table[:, 0]))
    for line in lines:
        assert line == ",".join(repr(float(cell)) for cell in line.split(","))
