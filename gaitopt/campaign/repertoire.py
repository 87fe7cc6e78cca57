"""The repertoire of the first search: good gaits that are unlike each other, not its winner alone.

What is fastest on the nominal robot may drift on the real one, where another gait, a little slower, goes
straight. A search tries hundreds of gaits, and these are known for nothing (A. Cully et al., "Robots that can
adapt like animals", Nature 521, 2015, 503).
"""

from __future__ import annotations

from collections.abc import Sequence

from gaitopt.campaign.check import same_gait
from gaitopt.campaign.merit import merit_of_means
from gaitopt.gait.gait import Gait
from gaitopt.optimise.journal import Entry, succeeded
from gaitopt.optimise.selection import unlike
from gaitopt.problem.problem import Problem


def repertoire(
    entries: Sequence[Entry], problem: Problem, winner: Gait, count: int, error: float
) -> list[Gait]:
    """Return the best gaits of a search that are unlike each other and its winner.

    Args:
        entries: every evaluation of the search.
        problem: the problem.
        winner: the winner of the search.
        count: how many, at most.
        error: standard deviation of what a predicted drift, sideways over forward travel, is off.
    """
    good = sorted(succeeded(entries), key=lambda one: merit_of_means(problem, one.evaluation, error))
    won = [one for one in good if same_gait(problem.space, one.gait, winner)]
    return [one.gait for one in unlike(good, count, problem.space, won)]
