"""Jobs without a run folder: what they return is what the commands print or write."""

import json
from pathlib import Path

import numpy as np
import pytest
from helpers import STRIDER

from gaitopt import command, draft_problem, film, list_effects, model, simulate
from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.problem.problem import Problem, load_problem

Printed = pytest.CaptureFixture[str]


def test_a_simulation_is_the_row_and_the_series_of_the_command(strider: Problem, capsys: Printed) -> None:
    assert cli.main(["simulate", str(STRIDER), "square", "--json", "--csv", "a.csv"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    rollout = simulate(strider, strider.baselines["square"], csv="b.csv")
    assert rollout.metrics["speed_m_s"] == row["speed_m_s"]
    assert list(rollout.to_dict()) == list(row)
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()
    assert rollout.takes == ()


def test_a_command_table_is_that_of_the_command(strider: Problem, capsys: Printed) -> None:
    table = command(strider, "square", dt=0.1, duration=0.35)
    np.testing.assert_array_equal(table.time, np.arange(4) * 0.1)
    assert list(table.targets) == list(strider.channel_names)
    arguments = ["command", str(STRIDER), "square", "--dt", "0.1", "--duration", "0.35", "--out", "c.csv"]
    assert cli.main(arguments) == 0
    assert Path("c.csv").read_text() == table.to_csv()


def test_a_model_is_that_of_the_command(strider: Problem, capsys: Printed) -> None:
    assert cli.main(["model", str(STRIDER), "--out", "a.xml"]) == 0
    assert model(strider, "b.xml") == Path("a.xml").read_text() == Path("b.xml").read_text()


def test_effects_are_those_of_the_command(strider: Problem, capsys: Printed) -> None:
    assert cli.main(["effects", str(STRIDER), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row.name for row in list_effects(strider)] == [row["name"] for row in rows]
    assert [row.name for row in list_effects()] == [row["name"] for row in rows]


def test_a_draft_is_a_problem(capsys: Printed) -> None:
    made = draft_problem("mine", STRIDER / "strider.xml")
    assert made.folder == Path("mine")
    assert load_problem(made.folder).channel_names == [c.name for c in made.draft.channels]


def test_a_film_is_refused_before_anything_is_simulated(strider: Problem) -> None:
    with pytest.raises(GaitoptError, match="no film format"):
        film(strider, ["square"], "walk.txt")
    with pytest.raises(GaitoptError, match="--seconds: found 0; allowed: a positive number"):
        film(strider, ["square"], "walk.mp4", seconds=0.0)
