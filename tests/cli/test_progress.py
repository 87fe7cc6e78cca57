"""What a person sees on the terminal while a job runs."""

from pathlib import Path

import pytest
from pictures import needs_opengl
from searching import run

from gaitopt.cli.progress import _time_left, display
from gaitopt.core.progress import Progress
from gaitopt.jobs.optimise import optimise
from gaitopt.optimise.recorder import SEARCH, SearchProgress
from gaitopt.optimise.run import Request
from gaitopt.problem.problem import Problem


def test_time_left_is_at_the_pace_since_the_search_began_or_resumed() -> None:
    assert _time_left(SearchProgress(SEARCH, 30, 90), 10, 5.0) == ", about 15 s left"
    assert _time_left(SearchProgress(SEARCH, 10, 90), 10, 5.0) == ""
    assert _time_left(SearchProgress(SEARCH, 90, 90), 10, 5.0) == ""


@needs_opengl
@pytest.mark.slow
def test_a_search_numbers_its_stages_and_counts_what_is_left(strider: Problem, tmp_path: Path) -> None:
    steps: list[Progress] = []
    optimise(strider, budget=3, full=True, out=tmp_path / "run", workers=1, on_progress=steps.append)
    stages = list(dict.fromkeys(step.stage for step in steps))
    numbers = [next(step.number for step in steps if step.stage == stage) for stage in stages]
    assert numbers == sorted(numbers)
    assert min(numbers) == 1
    assert {step.stages for step in steps} == {max(numbers)}
    for name in ("search", "selection", "verification", "sensitivities", "film"):
        counted = [step for step in steps if step.stage == name]
        assert len({step.total for step in counted}) == 1
        assert [step.done for step in counted] == sorted(step.done for step in counted)
        assert counted[-1].done == counted[-1].total
    assert stages[-1] == "page"


def test_the_best_on_a_lower_rung_is_shown_as_such(
    strider: Problem, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    entries = run(strider, tmp_path / "evaluations.csv", Request(seed=1, budget=2)).entries
    with display(quiet=False) as show:
        show(Progress(SEARCH, 0, 9, "gaits", 3, 8))
        show(SearchProgress(SEARCH, 9, 9, "gaits", 3, 8, "cma-es", entries[0], entries[1], 12.0))
    first, last = capsys.readouterr().err.splitlines()
    speeds = [f"{1e3 * entry.evaluation.metrics['speed_m_s']:.1f} mm/s" for entry in entries]
    assert first == "3/8 search …"
    assert f"9/9 gaits, cma-es, best {speeds[0]} ({speeds[1]} at a lower fidelity)" in last
