"""Kills, Ctrl-C and SIGTERM in every stage of a search and of a diagnosis: nothing is lost."""

import itertools
import shlex
import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from ending import Ended, Stop, Work, diagnosis, result, search, small_trials


@pytest.fixture(scope="module")
def trials(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_trials(tmp_path_factory.mktemp("data") / "trials")


Make = Callable[[Path], Work]


@pytest.fixture(scope="module", params=["search", "diagnosis"])
def make(request: pytest.FixtureRequest, trials: Path) -> Make:
    return search if request.param == "search" else lambda folder: diagnosis(folder, trials)


@pytest.fixture(scope="module")
def whole(make: Make, tmp_path_factory: pytest.TempPathFactory) -> tuple[Work, Ended]:
    """The work that nothing disturbed."""
    work = make(tmp_path_factory.mktemp("whole") / "run")
    return work, work.run()


@pytest.mark.slow
def test_every_stage_is_reached_by_an_undisturbed_run(whole: tuple[Work, Ended]) -> None:
    work, ended = whole
    assert (ended.code, ended.err) == (0, "")
    assert list(ended.ticks) == [name for name in ended.ticks if name in work.stages]
    assert set(ended.ticks) == set(work.stages)


@pytest.mark.slow
def test_a_run_killed_in_every_stage_ends_with_the_same_bits(
    whole: tuple[Work, Ended], make: Make, tmp_path: Path
) -> None:
    """One folder; the run that goes on is killed in the next stage. Each kill lands in its stage."""
    work = make(tmp_path / "run")
    for stage in work.stages:
        tick = 3 if whole[1].ticks[stage] > 6 else 1
        ended = work.run(Stop(stage, tick))
        assert ended.code == -signal.SIGKILL, (stage, ended)
        assert (ended.marker["stage"], ended.marker["tick"]) == (stage, tick)
    ended = work.run()
    assert (ended.code, ended.err) == (0, "")
    assert result(work.folder) == result(whole[0].folder)


ENDS = [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]


@pytest.mark.slow
def test_an_interrupt_in_every_stage_is_a_clean_end(
    whole: tuple[Work, Ended], make: Make, tmp_path: Path
) -> None:
    """Ctrl-C in the first stage; SIGTERM in the next stage of the run that goes on; and so on."""
    work = make(tmp_path / "a run")
    for (number, code, word), stage in zip(itertools.cycle(ENDS), work.stages, strict=False):
        ended = work.run(Stop(stage, 3 if whole[1].ticks[stage] > 6 else 1, number))
        assert (ended.code, ended.out, ended.marker.get("stage")) == (code, "", stage), ended
        *before, last = ended.err.splitlines()
        assert last == f"gaitopt: {word}", stage
        again = work.next
        if "--resume" in again:
            (line,) = before
            assert line.startswith("gaitopt: stopped after ")
            said = shlex.split(line.partition("; go on with: gaitopt ")[2])
            assert said[:2] == [str(word) for word in again[:2]], stage
            assert ("--resume", str(work.folder)) == tuple(said[said.index("--resume") :][:2]), stage
        else:
            assert not before
            assert not work.folder.exists(), stage
        assert not list(tmp_path.rglob(".*")), "something half-written or a lock is left"
    assert work.run().code == 0
    assert result(work.folder) == result(whole[0].folder)
