"""The job `optimise` from a script: interrupted, resumed, refused."""

from pathlib import Path

import pytest

from gaitopt import Stopped, optimise
from gaitopt.core.errors import GaitoptError
from gaitopt.core.json import to_json
from gaitopt.optimise.recorder import Recorder
from gaitopt.problem.problem import Problem


@pytest.mark.slow
def test_an_interrupted_search_goes_on_to_the_same_bits(
    strider: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = optimise(strider, budget=6, seed=5)
    assess, done = Recorder._assess, []

    def interrupted(self: Recorder, *arguments: object) -> object:
        if done:
            raise KeyboardInterrupt
        done.append(arguments)
        return assess(self, *arguments)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr(Recorder, "_assess", interrupted)
        with pytest.raises(Stopped, match=r"stopped after \d+ gaits, best so far .* resume='run'") as stop:
            optimise(strider, budget=6, seed=5, out="run")
    assert stop.value.folder == Path("run")
    resumed = optimise(resume="run")
    assert resumed.optimised.best.gait == whole.optimised.best.gait
    assert resumed.summary.best == whole.summary.best
    read = optimise(resume=stop.value.folder)
    assert to_json(read.summary.to_dict()) == to_json(resumed.summary.to_dict())
    with pytest.raises(GaitoptError, match="run: finished before"):
        _ = read.optimised


def test_a_search_needs_a_problem_or_a_run() -> None:
    with pytest.raises(GaitoptError, match="no problem and no run"):
        optimise()


def test_nothing_is_left_where_a_request_is_wrong(strider: Problem) -> None:
    with pytest.raises(GaitoptError, match="--budget: found 0"):
        optimise(strider, budget=0, out="run")
    assert not list(Path().iterdir())


@pytest.mark.slow
def test_a_finished_run_is_printed_again_whatever_is_left_of_it(strider: Problem) -> None:
    """Without its page and its evaluations, too; its own options may be said again, others may not."""
    whole = optimise(strider, budget=3, seed=5, warm_start=False, out="run")
    for name in ("evaluations.csv", "report.html"):
        Path("run", name).unlink()
    left = sorted(Path("run").rglob("*"))
    read = optimise(budget=3, seed=5, warm_start=False, resume="run")
    assert to_json(read.summary.to_dict()) == to_json(whole.summary.to_dict())
    assert sorted(Path("run").rglob("*")) == left
    with pytest.raises(GaitoptError, match="--pareto: not with --resume, which takes it from run"):
        optimise(pareto=True, resume="run")
    with pytest.raises(GaitoptError, match="--budget: not with --resume, which takes it from run"):
        optimise(budget=4, resume="run")
