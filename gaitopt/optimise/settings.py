"""Settings of a search that no option of the command line sets."""

from __future__ import annotations

from dataclasses import dataclass, field

from gaitopt.optimise.evaluator import RACED_ON
from gaitopt.optimise.study import StudySettings
from gaitopt.plan.plan import PlanSettings


@dataclass(frozen=True)
class SearchSettings:
    """How `optimise` works.

    Attributes:
        study: how the study searches.
        plan: how hard to plan; its seed is replaced by that of the run.
        raced_on: share of a population that is simulated in every scenario (see `Evaluator.race`).
        finalists: best gaits of the search among which fresh scenarios select the winner.
        correlation_gaits: random gaits over which planar and MuJoCo speeds are compared.
        drift_ratio: if a baseline's sideways speed over forward speed is above this, a note says that the
            planar model does not describe it.
    """

    study: StudySettings = field(default_factory=StudySettings)
    plan: PlanSettings = field(default_factory=PlanSettings)
    raced_on: float = RACED_ON
    finalists: int = 5
    correlation_gaits: int = 24
    drift_ratio: float = 0.5


DEFAULT = SearchSettings()
"""What `optimise` uses where no settings are given.

This is the hook for tests that drive the command line: they set it to less work.
"""
