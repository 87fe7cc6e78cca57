"""The covariance of a correct model about a set of effects, from robots with small errors.

Small errors do more to some robots than to others, so they are those of a robot with the effects.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gaitopt.core.streams import Stream
from gaitopt.diagnose.fit.set_fit import Point
from gaitopt.diagnose.fit.single import robot_request
from gaitopt.diagnose.fit.trials import Comparison
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.diagnose.judge.small_errors import perturbed_robots, tolerant_robots
from gaitopt.simulation.rollout import Simulator

About = Callable[[Judgement, Context, Point], Judgement]
"""Returns a judgement by the covariance about a robot with some effects, each at its coordinate."""


def with_tolerances(judgement: Judgement, context: Context, point: Point = ()) -> Judgement:
    """Return a judgement whose covariance holds all small errors of the problem's tolerances.

    Args:
        judgement: the trials and the fits of single effects, by any covariance.
        context: simulates robots.
        point: effects of the robot about which others are drawn, each at its coordinate.
    """
    count = context.settings.small_errors.tolerant

    def drawn(centre: Simulator) -> Sequence[Simulator]:
        return tolerant_robots(centre, context.seed, count)

    found, known = _rewhitened(judgement, context, point, "a little wrong", drawn)
    return replace(found, tolerant_robots=known)


def with_small_errors(judgement: Judgement, context: Context, point: Point = ()) -> Judgement:
    """Return a judgement whose covariance is that of robots which are made exactly but for small errors.

    Args:
        judgement: the trials and the fits of single effects, by any covariance.
        context: simulates robots.
        point: effects of the robot about which others are drawn, each at its coordinate.
    """
    count, errors = context.settings.small_errors.robots, context.settings.small_errors

    def drawn(centre: Simulator) -> Sequence[Simulator]:
        return perturbed_robots(centre, context.seed, count, Stream.SMALL_ERRORS, errors)

    found, _ = _rewhitened(judgement, context, point, "made exactly", drawn)
    return replace(found, tolerant_robots=())


def _rewhitened(
    judgement: Judgement,
    context: Context,
    point: Point,
    label: str,
    drawn: Callable[[Simulator], Sequence[Simulator]],
) -> tuple[Judgement, tuple[Comparison, ...]]:
    """Return a judgement by the covariance of drawn robots, and these; those that failed are left out."""
    initial = judgement.trial_set.initial
    request = robot_request(point)
    problem = initial.problem.with_effects(request.effects)
    centre = Simulator.build(problem, fidelity=initial.simulator.fidelity)
    named = {f"{label}, {i}: {request.name}": robot for i, robot in enumerate([centre, *drawn(centre)])}
    middle, *others = context.runner.compare_robots(initial, named)
    known = tuple(one for one in others if one is not None)
    if middle is None or not known:
        return judgement, judgement.tolerant_robots
    changes = np.array([one.whitened - middle.whitened for one in known])
    return judgement.rewhitened(initial.with_covariance_of(changes)), known
