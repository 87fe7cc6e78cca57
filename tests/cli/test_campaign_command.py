"""`gaitopt campaign` on the command line: each action's JSON, words, and one line for what is wrong."""

import json
import shutil
from pathlib import Path

import pytest
from campaigns import brief, walker
from helpers import STRIDER
from planting import dataset

from gaitopt.cli import app as cli
from gaitopt.gait.gait import read_gait


def answered(capsys: pytest.CaptureFixture[str], *words: str) -> dict:
    """What an action prints with ``--json``."""
    capsys.readouterr()
    assert cli.main(["campaign", *words, "--json", "--executor", "serial"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_the_actions_in_turn(capsys: pytest.CaptureFixture[str]) -> None:
    with brief():
        new = answered(capsys, "new", str(STRIDER), "--out", "walk", "--budget", "8")
        assert answered(capsys, "next", "walk") == new
        before = answered(capsys, "status", "walk")
        assert [film["measured_speed_m_s"] for film in before["films"]] == [None]

        film = walker()(read_gait(Path("walk") / new["gait"]))
        columns = {"t_s": film.time, "x_m": film.signals["marker.x"], "y_m": film.signals["marker.y"]}
        dataset(Path("film-1"), {"film": ("gait.toml", columns)}, starts_at_gait_time_s=0.0)
        shutil.copy(Path("walk") / new["gait"], "film-1/gait.toml")
        told = answered(capsys, "tell", "walk", "film-1")
        assert answered(capsys, "status", "walk") == told
        assert told["films"][0]["measured_speed_m_s"] is not None
        assert isinstance(told["films"][0]["drift"], float)
        assert 0.0 <= told["best_keeps_limits"] <= 1.0
        assert told["best"].keys() == {"gait", "measured_speed_m_s", "predicted_speed_m_s"}
        assert (Path("walk") / told["best"]["gait"]).is_file()
        assert told["still_to_gain"].keys() == {"mean", "ci90"}

        assert cli.main(["campaign", "status", "walk"]) == 0
        words = capsys.readouterr().out
        assert "still to gain" in words
        assert "gaitopt campaign tell walk DATASET" in words


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["next", "nowhere"], "nowhere: not the folder of a campaign (no campaign.toml)"),
        (["new", str(STRIDER), "--out", "walk", "--budget", "0"], "--budget: found 0; allowed: 1 or more"),
        (["new", str(STRIDER), "--out", "walk", "--quantile", "0.7"], "--quantile: found 0.7; allowed: 0 to"),
        (["new", str(STRIDER), "--out", "walk", "--player", "ardiuno"], "nearest: 'arduino'"),
        (["new", "servo-bench", "--out", "walk"], "servo-bench"),
    ],
)
def test_what_is_wrong_is_one_line(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["campaign", *words]) == 1
    line = capsys.readouterr().err
    assert said in line
    assert line.count("\n") == 1
    assert not Path("walk").exists()
