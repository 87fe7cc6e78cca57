"""Gaits that may be worth a film: the best for all robots of the posterior, and for some of them alone."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from gaitopt.campaign.merit import merit
from gaitopt.campaign.robots import evaluator_on, judged_by_shares, own_scenarios
from gaitopt.campaign.settings import CampaignSettings
from gaitopt.core.progress import OnProgress
from gaitopt.core.streams import Stream, generator
from gaitopt.core.versions import versions_text
from gaitopt.effects.active import EffectValues
from gaitopt.gait.gait import Gait
from gaitopt.optimise.journal import Entry, Journal, succeeded
from gaitopt.optimise.selection import unlike
from gaitopt.optimise.stages import DEFAULT_METHOD
from gaitopt.optimise.study import Study
from gaitopt.optimise.verification import evenly
from gaitopt.problem.problem import Problem
from gaitopt.simulation.scenario import Scenario

ROBUST = "robust"
"""Name of the best gait for the robots together; further ones have a number behind."""


@dataclass(frozen=True)
class Search:
    """The searches of one step.

    Attributes:
        problem: the nominal problem.
        robots: robots drawn from the posterior.
        folder: where their journals are, so that a killed step continues.
        budget: gaits of all searches together, as `SearchShares` divides them.
        quantile: the speed of a gait is the one that this share of the robots does not reach; None for as
            the problem file says, by default their mean.
        seed: seed of the step.
        settings: see `CampaignSettings`.
    """

    problem: Problem
    robots: Sequence[EffectValues]
    folder: Path
    budget: int
    quantile: float | None
    seed: int
    settings: CampaignSettings

    def candidates(
        self, known: Mapping[str, Gait], executor: Executor, on_progress: OnProgress
    ) -> dict[str, Gait]:
        """Return the gaits that were found, by name; every search is warm from gaits that are known.

        Args:
            known: gaits to start from: those that were filmed, the last winners, and the baselines.
            executor: where the rollouts run.
            on_progress: called as each batch ends.
        """
        shares, starts = self.settings.search, list(known.values())
        alone: list[Entry] = []
        for number, robot in enumerate(evenly(self.robots, shares.own_robots), 1):
            stage = _stage(on_progress, f"searching a gait for robot {number} of {shares.own_robots}")
            scenario = own_scenarios(self.problem, [robot], self._drawn(number, 1), 1, errors=False)
            budget = round(shares.own * self.budget)
            own = self._searched(self.problem, scenario, budget, starts, number, executor, stage)
            alone += self._unlike(own, 1, alone)
        robust = judged_by_shares(self.problem, self.settings.most_breaking, self.quantile)
        scenarios = own_scenarios(self.problem, self.robots, self.seed, shares.robots, errors=False)
        stage = _stage(on_progress, "searching a gait for all robots")
        starts, budget = [*(one.gait for one in alone), *starts], round(shares.robust * self.budget)
        entries = self._searched(robust, scenarios, budget, starts, 0, executor, stage)
        together = self._unlike(entries, shares.kept)
        found = {f"{ROBUST}-{rank}" if rank > 1 else ROBUST: one.gait for rank, one in enumerate(together, 1)}
        return found | {f"robot-{number}": one.gait for number, one in enumerate(alone, 1)}

    def _drawn(self, *index: int) -> int:
        """Return a seed of its own for a part of a search."""
        return int(generator(self.seed, Stream.CAMPAIGN_SEARCH, *index).integers(2**31))

    def _unlike(self, entries: Sequence[Entry], count: int, before: Sequence[Entry] = ()) -> list[Entry]:
        """Return the gaits of lowest cost that did not fail: near copies of one gait tell nothing new."""
        return unlike(succeeded(entries), count, self.problem.space, before)

    def _searched(
        self,
        problem: Problem,
        scenarios: Sequence[Scenario],
        budget: int,
        starts: Sequence[Gait],
        number: int,
        executor: Executor,
        on_progress: OnProgress,
    ) -> list[Entry]:
        """Search for robots from known gaits and gaits near them, and return every evaluation.

        What is known of the robot may have changed much since a gait was found. So the batch near them counts
        as much as the gaits themselves, which come on top of the budget.
        """
        error = self.settings.belief.drift
        evaluator = evaluator_on(problem, scenarios, executor, problem.objective.search_margin)
        evaluator = replace(evaluator, judge=partial(merit, error=error))
        asked = budget, self.seed, error, [one.key for one in starts]
        key = repr((versions_text(), evaluator.setup.key, *asked))
        digest = hashlib.sha256(key.encode()).hexdigest()
        path = self.folder / f"search-{number}-{digest[:8]}.csv"  # another version begins another journal
        journal = Journal(path, problem, digest)
        seed = self._drawn(number)
        gaits = budget + len(starts)
        study = Study(evaluator, journal, max(1, gaits), seed, on_progress, self.settings.search.study)
        study.run(DEFAULT_METHOD, planned=starts)
        return study.entries


def _stage(on_progress: OnProgress, stage: str) -> OnProgress:
    return lambda step: on_progress(replace(step, stage=stage))
