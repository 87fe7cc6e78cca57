"""`gaitopt compare`: gaits over the same scenarios."""

import json
from pathlib import Path

import pytest
from commandline import Run, strictly
from helpers import STRIDER


def test_compare_is_over_the_same_scenarios(gaitopt: Run, finished: Path) -> None:
    code, out, err = gaitopt("compare", STRIDER, "stride", "square", finished, "stride", "--json")
    assert (code, err) == (0, "")
    rows = strictly(out)["rows"]
    assert [row["name"] for row in rows] == ["stride (1)", "square", finished.name, "stride (4)"]
    for row in rows:
        low, high = row["speed_ci90_m_s"]
        assert low <= row["speed_m_s"] <= high
    assert rows[3]["difference_ci90_m_s"] == [0.0, 0.0]
    assert not rows[3]["more_than_noise"]
    assert rows[1]["difference_m_s"] == pytest.approx(rows[1]["speed_m_s"] - rows[0]["speed_m_s"])
    again = gaitopt("compare", STRIDER, "stride", "square", finished, "stride", "--json", "--workers", 1)
    assert strictly(again[1])["rows"] == rows
    other = gaitopt("compare", STRIDER, "stride", "square", finished, "stride", "--json", "--seed", 2)
    assert strictly(other[1])["rows"] != rows
    text = gaitopt("compare", STRIDER, "stride", "square")[1]
    assert "more than noise" in text


def test_runs_are_called_by_their_folders(gaitopt: Run, finished: Path, tmp_path: Path) -> None:
    for folder in ("mine/run", "yours/run", "other"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "best.toml").write_text((finished / "best.toml").read_text())
    mine, yours, other = (tmp_path / folder for folder in ("mine/run", "yours/run", "other"))
    asked = ("compare", STRIDER, finished / "best.toml", other)
    rows = strictly(gaitopt(*asked, "--json")[1])["rows"]
    assert [row["name"] for row in rows] == [finished.name, "other"]
    rows = strictly(gaitopt("compare", STRIDER, mine, yours, "--json")[1])["rows"]
    assert [row["name"] for row in rows] == ["mine/run", "yours/run"]


def test_a_gait_has_one_speed_wherever_it_is_printed(gaitopt: Run, finished: Path) -> None:
    summary = json.loads((finished / "summary.json").read_text())
    (row,) = strictly(gaitopt("compare", STRIDER, finished, "--seed", 5, "--json")[1])["rows"]
    assert row["speed_m_s"] == summary["best"]["speed_m_s"]
    assert row["speed_ci90_m_s"] == summary["best"]["speed_ci90_m_s"]
    assert row["timestep_s"] == summary["verified"]["timestep_s"]
    text = gaitopt("compare", STRIDER, finished, "--seed", 5)[1]
    assert "at the reference fidelity" in text.replace("\n", " ")
    text = gaitopt("optimise", finished, "--resume", finished)[1]
    assert "at the reference fidelity" in text.replace("\n", " ")
