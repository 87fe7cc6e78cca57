"""`gaitopt film`: a synthetic phone films the robot, and says how well it would be measured."""

import json
from pathlib import Path
from typing import Any

import pytest
from pictures import needs_opengl

from gaitopt.cli import app as cli
from gaitopt.track.film import facts_of


@pytest.mark.slow
@needs_opengl
def test_a_place_of_the_camera_is_tried(capsys: Any) -> None:
    given = ["film", "arcfold", "square-0.5s", "--camera", "0.6", "--seconds", "0.6", "--fps", "20"]
    assert cli.main([*given, "--out", "plan.mp4", "--json", "--quiet"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["frames"] == 12
    assert facts_of(Path("plan.mp4")).frames == 12
    assert content["camera"] == "still"
    errors = {row["signal"]: row.get("error_m", row.get("error_rad")) for row in content["errors"]}
    assert errors["marker.x"] < 0.5e-3
    assert {row["tag"] for row in content["tags"] if row["seen"] > 0.9} >= {0, 1, 100, 105}


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--out", "plan.avi"], "plan.avi: no film that can be made; allowed: a file that ends in .mp4"),
        (["--out", "plan.mp4", "--camera", "20"], "--camera: found 20.0; allowed: 0.1 to 10"),
        (["--out", "plan.mp4", "--fps", "1"], "--fps: found 1.0; allowed: 10 to 240"),
        (["--out", "plan.mp4", "--seconds", "100"], "--seconds: found 100.0; allowed: 0.6 to 30"),
    ],
)
def test_what_cannot_be_filmed_is_one_line(more: list[str], said: str, capsys: Any) -> None:
    assert cli.main(["film", "arcfold", "square-0.5s", *more]) == 1
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


def test_a_robot_without_tags_is_not_filmed(capsys: Any) -> None:
    assert cli.main(["film", "arcfold-published", "square-0.5s", "--out", "plan.mp4"]) == 1
    assert "no tag sits on the robot" in capsys.readouterr().err
    assert not Path("plan.mp4").exists()
