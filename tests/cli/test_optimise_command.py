"""`gaitopt optimise`: its folder, its answer, the same bits on every executor."""

from pathlib import Path

import pytest
from commandline import RUN_FILES, Run, strictly, without_clock
from helpers import STRIDER
from pages import words_of

from gaitopt.gait.gait import read_gait
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.labels import shown, title_of, with_unit


@pytest.mark.slow
def test_optimise_leaves_the_contracts_folder(gaitopt: Run, quick_folder: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    code, out, err = gaitopt("optimise", quick_folder, "--budget", 4, "--seed", 2, "--out", folder, "--json")
    assert (code, err) == (0, "")
    assert {path.name for path in folder.iterdir()} == RUN_FILES
    assert not [path for path in folder.rglob("*") if path.name.startswith(".")]
    summary = strictly(out)
    assert summary == strictly((folder / "summary.json").read_text())
    problem = load_problem(quick_folder)
    assert (summary["problem"], summary["seed"], summary["evaluations"]) == ("arcfold", 2, 4)
    assert summary["simulated_s"] > 0.0
    assert summary["wall_s"] > 0.0
    names = [(row["name"], row["period_s"]) for row in summary["baselines"]]
    assert names == [("square-4s", 4.0), ("square-2s", 2.0), ("square-1s", 1.0), ("square-0.5s", 0.5)]
    for row in [*summary["baselines"], summary["best"]]:
        assert row["stride_m"] == pytest.approx(row["speed_m_s"] * row["period_s"])
        assert isinstance(row["constraints_met"], bool)
    low, high = summary["best"]["speed_ci90_m_s"]
    assert low <= summary["best"]["speed_m_s"] <= high
    reference = problem.simulation.reference
    verified = summary["verified"]
    known = {
        "timestep_s": reference.timestep_s,
        "integrator": reference.integrator,
        "scenarios": 2,
        "speed_m_s": summary["best"]["speed_m_s"],
        "working_timestep_s": problem.simulation.working.timestep_s,
    }
    measured = {"working_speed_m_s", "change_ci90_m_s", "converged"}
    assert {key: value for key, value in verified.items() if key not in measured} == known
    low, high = verified["change_ci90_m_s"]
    changed = verified["speed_m_s"] - verified["working_speed_m_s"]
    assert low - 1e-12 <= changed <= high + 1e-12
    assert isinstance(verified["converged"], bool)
    fastest = max(row["speed_m_s"] for row in summary["baselines"])
    ratio = summary["best"]["speed_m_s"] / fastest if fastest > 0.0 else None
    assert summary["ratio_to_best_baseline"] == (ratio if ratio is None else pytest.approx(ratio))
    assert "warm_start" in summary
    assert len((folder / "evaluations.csv").read_text().splitlines()) == 1 + 4


def test_best_toml_is_a_gait_file_and_nothing_else(finished: Path, strider: Problem) -> None:
    gait = read_gait(finished / "best.toml")
    assert strider.check_gait(gait, "best") == gait
    assert gait.period_s == strictly((finished / "summary.json").read_text())["best"]["period_s"]


def test_the_report_is_one_self_contained_page(finished: Path) -> None:
    page = (finished / "report.html").read_text()
    assert "stride" in page
    assert f"Period {read_gait(finished / 'best.toml').period_s:.3g}" in page
    assert page.count('class="plot"') == len(list((finished / "figures").iterdir())) == 7
    assert "http://" not in page
    assert "https://" not in page


def test_the_page_says_the_numbers_of_the_summary_and_of_the_terminal(gaitopt: Run, finished: Path) -> None:
    summary = strictly((finished / "summary.json").read_text())
    rows = [summary["best"], *summary["baselines"]]
    said = words_of((finished / "report.html").read_text())
    said = " ".join(said.replace("−", "-").split())
    for row in rows:
        low, high = (f"{1e3 * end:.1f}" for end in row["speed_ci90_m_s"])
        cells = [f"{1e3 * row['speed_m_s']:.1f}", f"{low} to {high}", f"{1e3 * row['speed_worst_m_s']:.1f}"]
        period = f"{row['period_s']:.3g}"
        assert " ".join([row["name"], period, *cells, f"{1e3 * row['stride_m']:.1f}"]) in said
    for row in rows:
        for name, value in row["metrics"].items():
            assert value is None or shown(name, value) in said, name
    assert len(summary["best"]["margins"]) > 0
    for row in summary["best"]["margins"]:
        name, beyond = row["constraint"], f"{len(row['broken_in'])} of {row['scenarios']}"
        cells = [row["allowed"], with_unit(name, row["value"]), with_unit(name, row["worst"])]
        assert " ".join([title_of(name), *cells, f"{100.0 * row['margin']:.3g} %", beyond]) in said
    assert f"{summary['ratio_to_best_baseline']:.2f} times" in said
    assert f"{summary['evaluations']} gaits" in said
    code, out, err = gaitopt("optimise", finished, "--resume", finished, "--quiet")
    assert (code, err) == (0, "")
    (answer,) = (line for line in out.splitlines() if line.startswith("The best gait moves at "))
    assert answer in said.replace("\u00a0", " ")
    for text in summary["best"]["warnings"]:
        assert text in out
        assert text.replace("`", "").replace("%", " %").replace("  %", " %") in said.replace("\u00a0", " ")


@pytest.mark.slow
def test_the_answer_is_short_and_says_where_the_report_is(gaitopt: Run, tmp_path: Path) -> None:
    code, out, err = gaitopt("optimise", STRIDER, "--budget", 3, "--out", tmp_path / "run")
    assert code == 0
    assert "The best gait moves at " in out
    assert f"report: {tmp_path / 'run' / 'report.html'}" in out.replace("\n", "").replace(
        "report:", "\nreport:"
    )
    assert len(out.splitlines()) < 24
    assert "3/3 gaits" in err


@pytest.mark.slow
def test_both_spellings_and_a_default_folder(gaitopt: Run) -> None:
    for spelling, number in (("optimise", "001"), ("optimize", "002")):
        assert gaitopt(spelling, STRIDER, "--budget", 1, "--quiet")[0] == 0
        assert (Path("results") / "runs" / f"strider-{number}" / "summary.json").is_file()


@pytest.mark.slow
def test_workers_and_executors_change_no_bit(gaitopt: Run, finished: Path, tmp_path: Path) -> None:
    for options in (("--workers", 1), ("--workers", 3), ("--executor", "serial")):
        folder = tmp_path / "-".join(map(str, options))
        code, _, _ = gaitopt(
            "optimise", STRIDER, "--budget", 12, "--seed", 5, "--out", folder, "--json", *options
        )
        assert code == 0
        for name in ("evaluations.csv", "best.toml", "model.xml", "problem.toml"):
            assert (folder / name).read_bytes() == (finished / name).read_bytes(), name
        assert without_clock(folder) == without_clock(finished)


def test_a_robot_that_always_fails_says_so(gaitopt: Run, tmp_path: Path) -> None:
    exploding = ("--set", "k_servo=1e7", "--set", "torque_limit=1e12")
    code, out, err = gaitopt(
        "optimise", STRIDER, "--budget", 3, "--quiet", "--out", tmp_path / "run", *exploding
    )
    assert (code, out) == (1, "")
    assert err == "gaitopt: every one of 3 gaits failed in simulation: diverged: badqacc (3)\n"
