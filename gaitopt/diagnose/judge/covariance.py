"""The covariance of a correct model about a set of effects, from robots with small errors.

Small errors do more to some robots than to others, so they are those of a robot with the effects.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from gaitopt.core.streams import Stream
from gaitopt.diagnose.fit.set_fit import Point
from gaitopt.diagnose.fit.single import robot_request
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.diagnose.judge.perturbed import Draw, PerturbedRobots, compared_about
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

    def draw(centre: Simulator) -> Sequence[Simulator]:
        return tolerant_robots(centre, context.seed, count)

    robots = _drawn_about(judgement, point, "a little wrong", draw, context)
    found = _rewhitened(judgement, robots)
    return replace(found, tolerant_robots=robots) if robots.comparisons else found


def with_small_errors(judgement: Judgement, context: Context, point: Point = ()) -> Judgement:
    """Return a judgement whose covariance is that of robots which are made exactly but for small errors.

    Args:
        judgement: the trials and the fits of single effects, by any covariance.
        context: simulates robots.
        point: effects of the robot about which others are drawn, each at its coordinate.
    """
    count, errors = context.settings.small_errors.robots, context.settings.small_errors

    def draw(centre: Simulator) -> Sequence[Simulator]:
        return perturbed_robots(centre, context.seed, count, Stream.SMALL_ERRORS, errors)

    return _rewhitened(judgement, _drawn_about(judgement, point, "made exactly", draw, context))


def _drawn_about(
    judgement: Judgement, point: Point, label: str, draw: Draw, context: Context
) -> PerturbedRobots:
    effects = robot_request(point).effects
    return compared_about(judgement.trial_set.initial, effects, label, draw, context)


def _rewhitened(judgement: Judgement, robots: PerturbedRobots) -> Judgement:
    """Return a judgement by the covariance of some robots; the same one where none could be simulated."""
    if not robots.comparisons:
        return judgement
    covariance = judgement.trial_set.initial.with_covariance_of(robots.changes)
    return judgement.rewhitened(covariance)
