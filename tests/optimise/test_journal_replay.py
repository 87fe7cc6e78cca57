"""The same bits, if resumed at any point, with any number of workers, on any executor."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from searching import BUDGET, run, summary

from gaitopt.core.errors import GaitoptError
from gaitopt.optimise.journal import Entry, Journal
from gaitopt.optimise.run import Request
from gaitopt.problem.problem import Problem


@pytest.mark.parametrize("rows", [0, 1, 2, 3, 9, BUDGET - 2, BUDGET])
def test_a_resumed_run_ends_with_the_bits_of_a_whole_one(
    strider: Problem, tmp_path: Path, whole: tuple[str, str], rows: int
) -> None:
    """Cut anywhere: in a batch, between methods, before the first row, after the last."""
    path = tmp_path / "evaluations.csv"
    path.write_text("".join(whole[0].splitlines(keepends=True)[: 1 + rows]))
    optimised = run(strider, path, Request(seed=3, budget=BUDGET))
    assert path.read_text() == whole[0]
    assert summary(strider, optimised) == whole[1]


def test_a_resumed_run_evaluates_only_what_is_missing(
    strider: Problem, tmp_path: Path, whole: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "evaluations.csv"
    path.write_text("".join(whole[0].splitlines(keepends=True)[:11]))
    asked: list[str] = []
    original = Journal.append

    def append(self: Journal, entries: Sequence[Entry]) -> None:
        asked.extend(str(entry.index) for entry in entries)
        original(self, entries)

    monkeypatch.setattr(Journal, "append", append)
    run(strider, path, Request(seed=3, budget=BUDGET))
    assert asked == [str(i) for i in range(10, BUDGET)]


@pytest.mark.parametrize(
    ("executor", "workers"), [("serial", 1), ("threads", 2), ("threads", 3), ("processes", 2)]
)
def test_workers_and_executors_change_no_bit(
    strider: Problem, tmp_path: Path, whole: tuple[str, str], executor: str, workers: int
) -> None:
    path = tmp_path / "evaluations.csv"
    optimised = run(strider, path, Request(seed=3, budget=BUDGET), workers, executor)
    assert path.read_text() == whole[0]
    assert summary(strider, optimised) == whole[1]


def test_another_seed_is_another_search(strider: Problem, tmp_path: Path, whole: tuple[str, str]) -> None:
    run(strider, tmp_path / "evaluations.csv", Request(seed=4, budget=BUDGET))
    assert (tmp_path / "evaluations.csv").read_text() != whole[0]


@pytest.mark.parametrize("request_", [Request(seed=4, budget=BUDGET), Request(3, BUDGET, "cma-es")])
def test_a_journal_of_another_request_is_recognised(
    strider: Problem, tmp_path: Path, whole: tuple[str, str], request_: Request
) -> None:
    path = tmp_path / "evaluations.csv"
    path.write_text(whole[0])
    with pytest.raises(GaitoptError) as error:
        run(strider, path, request_)
    assert str(error.value) == (
        f"{path}: evaluation 0 is not the one that this seed, budget and method propose; "
        "the run was made by other ones or by another version"
    )
    assert path.read_text() == whole[0]
