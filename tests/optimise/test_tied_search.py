"""A search with ties: gaits obey them first, and are freed later."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from helpers import STRIDER, edited, problem_folder
from searching import run, summary

from gaitopt.cli.app import main
from gaitopt.core.errors import GaitoptError
from gaitopt.gait.gait import Gait
from gaitopt.optimise.run import Request
from gaitopt.problem.problem import Problem, load_problem


def tied_strider(folder: Path, **more: object) -> Problem:
    """The strider whose legs move alike, half a cycle apart."""

    def tie(content: dict[str, Any]) -> None:
        content["gait"] |= {"ties": {"front": {"like": "rear", "shift": 0.5}}, **more}

    return load_problem(problem_folder(folder, STRIDER, tie))


def obeys(gait: Gait) -> bool:
    rear, front = gait.channels["rear"], gait.channels["front"]
    same = all(
        abs(getattr(rear, key) - getattr(front, key)) < 1e-9
        for key in ("duty", "amplitude_deg", "offset_deg", "smoothing")
    )
    return same and abs((front.phase - rear.phase) % 1.0 - 0.5) < 1e-9


def test_a_search_is_tied_first_and_freed_later(tmp_path: Path) -> None:
    problem = tied_strider(tmp_path / "bot")
    found = run(problem, tmp_path / "evaluations.csv", Request(seed=1, budget=40))
    tied = [obeys(entry.gait) for entry in found.entries]
    assert len(tied) == 40
    assert all(tied[:30])
    assert not any(tied[30:])
    assert {entry.method for entry in found.entries[:4]} == {"ties"}


def test_a_search_that_is_never_freed_obeys_the_ties_to_its_end(tmp_path: Path) -> None:
    problem = tied_strider(tmp_path / "bot", freed_share=0.0)
    for method in ("default", "nelder-mead"):
        found = run(problem, tmp_path / f"{method}.csv", Request(seed=1, budget=30, method=method))
        assert len(found.entries) == 30
        assert all(obeys(entry.gait) for entry in found.entries)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_tied_search_whatever_the_workers(tmp_path: Path) -> None:
    problem = tied_strider(tmp_path / "bot")
    one = run(problem, tmp_path / "one.csv", Request(seed=3, budget=30), workers=1)
    two = run(problem, tmp_path / "two.csv", Request(seed=3, budget=30), workers=2)
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "two.csv").read_bytes()
    assert summary(problem, one) == summary(problem, two)
    again = run(problem, tmp_path / "one.csv", Request(seed=3, budget=30))
    assert summary(problem, again) == summary(problem, one)


@pytest.mark.slow
def test_a_run_folder_keeps_the_ties_and_goes_on(tmp_path: Path) -> None:
    tied_strider(tmp_path / "bot")
    words = ["optimise", str(tmp_path / "bot"), "--budget", "12", "--quiet", "--out", str(tmp_path / "run")]
    assert main(words) == 0
    assert load_problem(tmp_path / "run").tied_spaces[0].name == "ties"
    before = (tmp_path / "run" / "evaluations.csv").read_bytes()
    assert main([*words[:2], "--resume", str(tmp_path / "run")]) == 0
    assert (tmp_path / "run" / "evaluations.csv").read_bytes() == before


def test_a_wrong_tie_is_one_line_of_the_problem_file(tmp_path: Path) -> None:
    tied_strider(tmp_path / "bot")
    edited(tmp_path / "bot" / "problem.toml", 'like = "rear"', 'like = "reer"')
    with pytest.raises(GaitoptError, match=r"gait.ties.front.like: unknown channel 'reer'.*nearest: 'rear'"):
        load_problem(tmp_path / "bot")


def test_a_front_is_searched_within_the_ties(tmp_path: Path) -> None:
    problem = tied_strider(tmp_path / "bot", freed_share=0.0)
    found = run(problem, tmp_path / "evaluations.csv", Request(seed=1, budget=40, pareto=True))
    assert len(found.entries) == 40
    assert any(entry.method == "pareto" for entry in found.entries)
    assert all(obeys(entry.gait) for entry in found.entries)
