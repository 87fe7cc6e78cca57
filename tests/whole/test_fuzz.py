"""A small, seeded sample of the long fuzz: no input breaks a command, each ends in success or in one line."""

from pathlib import Path

import pytest
from fuzzing import KINDS, WHOLE, attempt, make
from fuzzing.material import finished_run
from fuzzing.outcome import Case

CASES = 12
WHOLE_CASES = 2
SLOW = ("run folder", "optimise, whole")


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=pytest.mark.slow) if kind in SLOW else kind for kind in KINDS]
)
def test_broken_input_ends_in_success_or_one_line(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends = set()
    for number in range(WHOLE_CASES if kind in WHOLE else CASES):
        folder = tmp_path / f"{number}"
        folder.mkdir()
        monkeypatch.chdir(folder)
        outcome = attempt(make(2026, kind, number, folder), folder)
        assert not outcome.wrong, f"{kind}:{number} ended in {outcome.ended}: {outcome.words}"
        ends.add(outcome.ended)
    assert kind in ("gait through a table and back", *WHOLE) or "stated" in ends, "nothing was broken"


def test_the_same_seed_makes_the_same_case(tmp_path: Path) -> None:
    texts = []
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        make(1, "gait file", 3, tmp_path / name)
        texts.append((tmp_path / name / "gait.toml").read_bytes())
    assert texts[0] == texts[1]


@pytest.mark.slow
def test_a_search_that_is_resumed_may_tell_its_progress(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run").mkdir()
    for name, data in finished_run().items():
        (tmp_path / "run" / name).write_bytes(data)
    (tmp_path / "run" / "summary.json").unlink()
    outcome = attempt(Case(["optimise", "run", "--resume", "run"], rewrites=("run",)), tmp_path)
    assert outcome.ended == "done", outcome.words
