"""The part of a page on the commands to play next."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gaitopt.diagnose.judge.command_experiment import CommandExperiment
from gaitopt.diagnose.judge.command_score import Separation
from gaitopt.diagnose.judge.command_search import ScoredCommands
from gaitopt.diagnose.next_words import what_commands_tell
from gaitopt.gait.calibration import Calibration
from gaitopt.gait.command_shapes import SHAPES, Size, Travel, shaped
from gaitopt.gait.played_commands import PlayedCommands
from gaitopt.report.figures import gait as gait_figures
from gaitopt.report.next_commands import next_commands_sections


def scored(shape: str) -> ScoredCommands:
    """Commands of a shape that set two explanations 4.2 floors apart."""
    kind = next(one for one in SHAPES if one.name == shape)
    travel = Travel(("$arm$",), np.zeros(1), np.array([[-1.0, 1.0]]), np.array([9.0]))
    made = shaped(kind, Size(0.5, kind.times_s[0], (0,)), travel)
    assert made is not None
    apart = Separation(np.array([[0.0, 4.2], [4.2, 0.0]]), np.array([0.5, 0.5]), ~np.eye(2, dtype=bool))
    return ScoredCommands(made, PlayedCommands.of(made.commands, {"$arm$": Calibration()}), apart)


@pytest.fixture
def found() -> CommandExperiment:
    """A drop, and a step as its runner-up."""
    return CommandExperiment(
        scored("drop"), (scored("step"),), ("dead band", "stiction"), 1.5, (("a", "b"),), {"$arm$": 515.7}
    )


def test_a_page_shows_the_commands_and_the_runners_up(found: CommandExperiment) -> None:
    picture, table = next_commands_sections(Path(), found)
    assert Path("figures/next.png").is_file()
    said = "They set dead band, stiction apart by 4.2 times the measurement uncertainty on average"
    assert f"{said}; the best commands so far: 1.5." in picture.caption
    assert "No commands tell these apart: a and b." in picture.caption
    assert table.table is not None
    assert [list(row[:3]) for row in table.table.rows] == [
        ["drop", "$arm$", "28.6"],
        ["step", "$arm$", "28.6"],
    ]
    assert any("unpowered" in sentence for sentence in table.sentences)


def test_one_explanation_is_narrowed(found: CommandExperiment) -> None:
    one = replace(found, separates=("stiction",), inseparable=())
    assert what_commands_tell(one).startswith(
        "They narrow the figures of stiction: they set its robots apart by 4.2"
    )


def test_a_plot_of_commands_has_a_gap_where_the_servo_is_unpowered(found: CommandExperiment) -> None:
    axes = gait_figures.logged(found.played.commands).axes[0]
    series = np.asarray(axes.lines[0].get_ydata(), dtype=float)
    assert np.isnan(series[-1])
    assert np.nanmax(series) == pytest.approx(np.rad2deg(0.5))
    assert axes.get_xlabel() == "time [s]"
