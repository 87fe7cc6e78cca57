"""The fidelity ladder: a rung that ranks gaits as the working fidelity does is used, another one refused."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from helpers import STRIDER

from gaitopt.cli import app as cli
from gaitopt.gait.gait import Gait
from gaitopt.optimise import ladder
from gaitopt.optimise import settings as search_settings
from gaitopt.optimise.evaluator import Evaluated, Evaluator, Outcome
from gaitopt.optimise.executors import SerialExecutor, open_executor
from gaitopt.optimise.journal import WORKING, Journal, at_rung, ranked
from gaitopt.optimise.ladder import LadderSettings
from gaitopt.optimise.quasi_random import quasi_random
from gaitopt.optimise.recorder import Recorder
from gaitopt.optimise.run import Optimised, Request, optimise
from gaitopt.optimise.selection import finalists
from gaitopt.optimise.settings import SearchSettings
from gaitopt.optimise.study import LOWER, Study, StudySettings
from gaitopt.problem.problem import Problem
from gaitopt.runs.summary import Summary
from gaitopt.simulation.metrics import metric_names
from gaitopt.simulation.objective import Evaluation
from gaitopt.simulation.scenario import NOMINAL
from gaitopt.simulation.setup import RobotSetup

BUDGET = 60


@dataclass(frozen=True)
class Known(Evaluator):
    """Judges gaits by their periods, in reverse order with a longer step, a shorter horizon, or never."""

    longer: int = 1
    shorter: int = 1

    def __call__(self, gaits: Sequence[Gait]) -> list[Evaluated]:
        problem = self.setup.problem
        sign = self.longer if self.setup.fidelity != problem.simulation.working else 1
        sign *= self.shorter if problem.simulation.horizon.measured_s < 0.6 else 1
        outcomes = [Outcome({}, "ok", 2.0)]
        return [Evaluated(Evaluation(sign * g.period_s, {}, {}, "ok"), outcomes) for g in gaits]


def gaits_of(problem: Problem) -> list[Gait]:
    return [problem.space.decode(point) for point in quasi_random(problem.space, 8, 1)]


def setting_of(problem: Problem) -> RobotSetup:
    return RobotSetup.of(problem, (NOMINAL,), problem.simulation.working)


@pytest.mark.parametrize(
    ("longer", "shorter", "used", "timestep_s", "measured_s"),
    [
        (1, 1, [True, True], 4e-3, 0.3),
        (-1, 1, [False, True], 2e-3, 0.3),
        (1, -1, [True, False], 4e-3, 0.6),
        (-1, -1, [False, False], 2e-3, 0.6),
        (0, 0, [False, False], 2e-3, 0.6),
    ],
)
def test_the_search_descends_as_far_as_ranks_hold(
    strider: Problem, longer: int, shorter: int, used: list[bool], timestep_s: float, measured_s: float
) -> None:
    evaluator = Known(setting_of(strider), SerialExecutor(), longer=longer, shorter=shorter)
    gaits = gaits_of(strider)
    descent = ladder.descend(evaluator, gaits, np.array([gait.period_s for gait in gaits]))
    lowest, rungs = descent.evaluator, descent.rungs
    assert [rung.used for rung in rungs] == used
    assert [rung.name for rung in rungs] == ["longer timestep", "shorter horizon"]
    assert all(rung.simulated_s == 16.0 for rung in rungs)
    assert rungs[0].rank_correlation == pytest.approx(longer)
    setting = lowest.setup
    assert setting.fidelity.timestep_s == timestep_s
    assert setting.problem.simulation.horizon.measured_s == measured_s
    assert (lowest is evaluator) == (not any(used))
    assert setting.scenarios == evaluator.setup.scenarios


def test_a_rung_is_half_as_dear_and_all_else_the_same(strider: Problem) -> None:
    setting = setting_of(strider)
    lower = ladder.shorter(ladder.coarser(setting, 2.0), 2.0)
    assert lower.fidelity.integrator == setting.fidelity.integrator
    horizon = lower.problem.simulation.horizon
    assert (horizon.transient_s, horizon.measured_s) == (0.15, 0.3)
    assert (horizon.transient_cycles, horizon.measured_cycles) == (1, 1)
    assert lower.problem.baselines == setting.problem.baselines
    assert lower.problem.objective == setting.problem.objective
    assert (
        len({setting.key, lower.key, ladder.coarser(setting, 2.0).key, ladder.shorter(setting, 2.0).key}) == 4
    )


# --- in a search ------------------------------------------------------------------------------


def laddered(trusted: float) -> SearchSettings:
    """Settings with which small searches measure rungs, too."""
    return SearchSettings(study=StudySettings(ladder=LadderSettings(from_gaits=20, trusted=trusted)))


TRUSTING = laddered(trusted=-1.0)
"""Use every rung, without a check of its ranking."""


def searched(
    problem: Problem, path: Path, workers: int = 1, settings: SearchSettings = TRUSTING
) -> Optimised:
    with open_executor("threads", workers) as executor:
        request = Request(seed=2, budget=BUDGET)
        return optimise(problem, request, Journal(path, problem), executor, settings=settings)


def test_what_leads_on_a_lower_rung_is_judged_again(strider: Problem, tmp_path: Path) -> None:
    optimised = searched(strider, tmp_path / "evaluations.csv")
    entries = optimised.entries
    assert len(entries) == BUDGET
    runs = [(method, rung) for method, rung in dict.fromkeys((e.method, e.rung) for e in entries)]
    assert runs == [
        ("quasi-random", WORKING),
        ("cma-es", WORKING),
        ("cma-es", LOWER),
        ("nelder-mead", WORKING),
    ]
    lower = at_rung(entries, LOWER)
    again = [e for e in at_rung(entries) if e.index > lower[-1].index and e.method == "cma-es"]
    leaders = sorted(lower, key=lambda e: (e.evaluation.cost, e.index))[:5]
    assert [e.point.tolist() for e in again] == [e.point.tolist() for e in leaders]
    assert [e.evaluation.cost for e in again] != [e.evaluation.cost for e in leaders]
    spent = sum(e.simulated_s for e in entries) + sum(rung.simulated_s for rung in optimised.rungs)
    assert optimised.simulated_s > spent
    said = Summary.of(strider, optimised).fidelity_ladder
    assert [(rung.timestep_s, rung.measured_s, rung.used) for rung in said] == [
        (4e-3, 0.6, True),
        (4e-3, 0.3, True),
    ]


def test_only_gaits_of_the_working_fidelity_can_win(strider: Problem, tmp_path: Path) -> None:
    """Although a lower rung gives all gaits better costs."""
    path = tmp_path / "evaluations.csv"
    searched(strider, path)
    entries = Journal(path, strider).entries
    flattered = [
        replace(
            entry, evaluation=replace(entry.evaluation, cost=entry.evaluation.cost - (entry.rung == LOWER))
        )
        for entry in entries
    ]
    Journal(tmp_path / "flattered.csv", strider).append(flattered)
    journal = Journal(tmp_path / "flattered.csv", strider)
    assert ranked(journal.entries)[0].rung == LOWER
    recorder = Recorder(journal, strider.space, BUDGET)
    recorder.entries = list(journal.entries)
    assert recorder.best.rung == WORKING
    working = [entry.gait for entry in at_rung(journal.entries)]
    assert all(one.gait in working for one in finalists(journal.entries, [], BUDGET, strider.space).leaders)


@dataclass(frozen=True)
class Turning(Evaluator):
    """Judges gaits by their periods; a longer step ranks them in reverse order after some populations."""

    reversed_after: int = 0
    lower: list[int] = field(default_factory=list)

    def __call__(self, gaits: Sequence[Gait]) -> list[Evaluated]:
        sign = 1
        if self.setup.fidelity != self.setup.problem.simulation.working:
            self.lower.append(len(gaits))
            sign = 1 if len(self.lower) <= self.reversed_after else -1
        metrics = dict.fromkeys(metric_names(self.setup.problem), 0.0)
        kept = dict.fromkeys(self.setup.problem.objective.constraints, 0.0)
        costs = [sign * gait.period_s for gait in gaits]
        return [Evaluated(Evaluation(cost, metrics, kept, "ok"), [Outcome({}, "ok", 2.0)]) for cost in costs]


@pytest.mark.parametrize("reversed_after", [4, 1000])
def test_a_rung_that_ranks_later_gaits_differently_is_left(
    strider: Problem, tmp_path: Path, reversed_after: int
) -> None:
    settings = StudySettings(ladder=LadderSettings(from_gaits=20, every=3))
    evaluator = Turning(setting_of(strider), SerialExecutor(), reversed_after=reversed_after)
    study = Study(evaluator, Journal(tmp_path / "evaluations.csv", strider), 120, 1, settings=settings)
    study.run(laddered=True)
    again = [rung for rung in study.rungs if rung.after]
    assert all(rung.name == "longer timestep, shorter horizon" for rung in again)
    populations = [e for e in study.entries if e.method == "cma-es"]
    measured = [e.rung for e in populations if e.index in {rung.after for rung in again}]
    assert measured == [WORKING] * len(again)
    if reversed_after == 1000:
        assert len(again) > 1
        assert all(rung.used and rung.rank_correlation == pytest.approx(1.0) for rung in again)
        return
    (left,) = again
    assert not left.used
    assert left.rank_correlation == pytest.approx(-1.0)
    assert {e.rung for e in populations if e.index > left.after} == {WORKING}
    assert LOWER in {e.rung for e in populations if e.index < left.after}


@pytest.mark.slow
@pytest.mark.parametrize("rows", [3, 6, 11, 20, 29, 46, 51, 55])
def test_a_laddered_search_is_resumed_to_the_same_bits(strider: Problem, tmp_path: Path, rows: int) -> None:
    whole, path = tmp_path / "whole.csv", tmp_path / "evaluations.csv"
    expected = Summary.of(strider, searched(strider, whole)).to_dict()
    path.write_text("".join(whole.read_text().splitlines(keepends=True)[: 1 + rows]))
    found = Summary.of(strider, searched(strider, path, workers=2)).to_dict()
    assert path.read_text() == whole.read_text()
    assert expected | {"wall_s": 0.0} == found | {"wall_s": 0.0}


def test_a_refused_ladder_changes_nothing_but_what_is_said(strider: Problem, tmp_path: Path) -> None:
    """Over one scenario: over several, the first population does not race."""
    one, other = tmp_path / "one.csv", tmp_path / "other.csv"
    assert searched(strider, one, settings=SearchSettings()).rungs == []
    rungs = searched(strider, other, settings=laddered(trusted=1.1)).rungs
    assert [rung.used for rung in rungs] == [False, False]
    assert rungs[1].timestep_s == strider.simulation.working.timestep_s
    assert one.read_text() == other.read_text()


def test_a_front_is_made_of_gaits_of_one_rung(strider: Problem, tmp_path: Path) -> None:
    request = Request(seed=2, budget=2 * BUDGET, pareto=True)
    path = tmp_path / "evaluations.csv"
    optimised = optimise(strider, request, Journal(path, strider), SerialExecutor(), settings=TRUSTING)
    assert {entry.rung for entry in optimised.entries} == {WORKING}
    assert optimised.rungs == []


@pytest.mark.slow
def test_the_report_says_how_low_the_search_went(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search_settings, "DEFAULT", TRUSTING)
    folder = tmp_path / "run"
    arguments = ["--budget", str(BUDGET), "--seed", "2", "--out", str(folder), "--quiet"]
    assert cli.main(["optimise", str(STRIDER), *arguments]) == 0
    page = (folder / "report.html").read_text().replace("\N{NO-BREAK SPACE}", " ")
    for lower in ("longer timestep (0.004 s steps, 0.6 s", "shorter horizon (0.004 s steps, 0.3 s"):
        assert f"{lower} measured): rank correlation " in page
    assert page.count(", used") == 2
