"""`gaitopt sweep`: a row for each value."""

from importlib import import_module
from pathlib import Path

import pytest
from commandline import Run, strictly
from helpers import STRIDER


@pytest.mark.parametrize(
    ("over", "names"),
    [
        ("period_s=0.5,0.25", ["period_s=0.5", "period_s=0.25"]),
        ("rear.phase=0,0.5", ["rear.phase=0", "rear.phase=0.5"]),
        ("mu_rear=0.1,0.9", ["mu_rear=0.1", "mu_rear=0.9"]),
    ],
)
def test_sweep_gives_a_row_and_a_line_per_value(
    gaitopt: Run, tmp_path: Path, over: str, names: list[str]
) -> None:
    folder = tmp_path / "sweep"
    code, out, err = gaitopt("sweep", STRIDER, "square", "--over", over, "--json", "--out", folder)
    assert (code, err) == (0, "")
    rows = strictly(out)["rows"]
    assert [row["name"] for row in rows] == names
    assert rows[0]["speed_m_s"] != rows[1]["speed_m_s"]
    assert strictly((folder / "sweep.json").read_text()) == {"rows": rows}
    assert {path.name for path in folder.iterdir()} == {"sweep.json", "report.html", "figures"}
    assert {path.name for path in (folder / "figures").iterdir()} == {
        "speeds.png",
        "overlay.png",
        "panels.png",
    }


def test_a_sweep_over_the_own_period_is_the_gait_itself(gaitopt: Run) -> None:
    rows = strictly(gaitopt("sweep", STRIDER, "--over", "period_s=0.5", "--json")[1])["rows"]
    (nominal,) = strictly(gaitopt("simulate", STRIDER, "stride", "--json")[1])["rows"]
    assert rows[0]["speed_m_s"] == nominal["speed_m_s"]
    assert [path.name for path in Path("results/runs").iterdir()] == ["strider-sweep-001"]


def test_a_sweep_survives_a_value_that_diverges(gaitopt: Run, tmp_path: Path) -> None:
    exploding = ("--set", "torque_limit=1e12")
    code, out, _ = gaitopt(
        "sweep", STRIDER, "square", "--over", "k_servo=0.5,1e7", "--json", "--out", tmp_path / "s", *exploding
    )
    assert code == 0
    assert [row["status"] for row in strictly(out)["rows"]][1].startswith("diverged")


def test_a_folder_that_is_not_empty_is_refused_before_anything_is_simulated(
    gaitopt: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.txt").write_text("mine")

    def simulated(*_: object) -> None:
        raise AssertionError("simulated")

    monkeypatch.setattr(import_module("gaitopt.optimise.sweep"), "sweep", simulated)
    code, _, err = gaitopt("sweep", STRIDER, "--over", "period_s=0.5", "--out", tmp_path)
    assert (code, err.count("\n")) == (1, 1)
    assert "is not empty" in err


@pytest.mark.parametrize("value", ["0_5", "٣", "0.5;0.7"])
def test_values_have_plain_digits(gaitopt: Run, value: str) -> None:
    code, _, err = gaitopt("sweep", STRIDER, "--over", f"period_s={value}")
    assert code == 1
    assert "allowed: NAME=V1,V2,… with numbers" in err
