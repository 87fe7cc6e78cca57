"""`gaitopt simulate`: metrics, parameters, gaits from run folders."""

from pathlib import Path

from commandline import Run, strictly
from helpers import STRIDER


def test_a_run_folder_is_a_problem_and_a_gait(gaitopt: Run, finished: Path) -> None:
    code, out, _ = gaitopt("simulate", finished, finished, "--json")
    assert code == 0
    assert gaitopt("simulate", STRIDER, finished, "--json") == (0, out, "")
    assert gaitopt("simulate", STRIDER, finished / "best.toml", "--json") == (0, out, "")
    assert gaitopt("simulate", finished, "square", "--json")[0] == 0


def test_an_unfinished_run_folder_is_no_gait(gaitopt: Run, tmp_path: Path) -> None:
    code, _, err = gaitopt("simulate", STRIDER, tmp_path)
    assert code == 1
    assert (
        err == f"gaitopt: {tmp_path / 'best.toml'}: no such file; {tmp_path} is not a finished run folder\n"
    )


def test_simulate_prints_the_metrics(gaitopt: Run, tmp_path: Path) -> None:
    code, out, err = gaitopt("simulate", STRIDER, "square", "--json", "--csv", tmp_path / "walk.csv")
    assert (code, err) == (0, "")
    (row,) = strictly(out)["rows"]
    assert (row["name"], row["period_s"], row["status"]) == ("square", 0.4, "ok")
    assert row["command_speed_ratio"] is None  # infinite: a square wave
    lines = (tmp_path / "walk.csv").read_text().splitlines()
    assert lines[0].startswith("t_s,marker.x_m,marker.y_m,marker.z_m,")
    assert {len(line.split(",")) for line in lines} == {len(lines[0].split(","))}
    table = gaitopt("simulate", STRIDER, "square")[1]
    assert "forward speed [mm/s]" in table
    assert f"{1e3 * row['speed_m_s']:.3g}" in table


def test_set_changes_the_robot(gaitopt: Run) -> None:
    def speed(*options: str) -> float:
        rows = strictly(gaitopt("simulate", STRIDER, "square", "--json", *options)[1])["rows"]
        return float(rows[0]["speed_m_s"])

    nominal = speed()
    assert speed("--set", "mu_rear=1.0") == nominal
    assert speed("--set", "mu_rear=0.3") != nominal
    assert speed("--set", "mu_rear=0.3", "--set", "mass=0.04") != speed("--set", "mu_rear=0.3")


def test_a_diverged_simulation_is_an_answer(gaitopt: Run) -> None:
    """A bad candidate is data: exit 0, its status in the row, no figures."""
    exploding = ("--set", "k_servo=1e7", "--set", "torque_limit=1e12")
    code, out, err = gaitopt("simulate", STRIDER, "square", "--json", *exploding)
    assert (code, err) == (0, "")
    (row,) = strictly(out)["rows"]
    assert row["status"] == "diverged: badqacc"
    assert row["speed_m_s"] is None
    assert gaitopt("simulate", STRIDER, "square", *exploding)[0] == 0
    assert list(Path().iterdir()) == []
