"""Robots with effects that a search has simulated, so that it simulates none twice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from gaitopt.diagnose.fit.runner import RobotRequest
from gaitopt.diagnose.fit.set_fit import SetFit
from gaitopt.diagnose.fit.single import robot_request
from gaitopt.diagnose.fit.trials import Comparison
from gaitopt.diagnose.judge.judgement import Judgement


@dataclass
class Simulated:
    """Robots with effects, as they were simulated, compared with the trials by the first covariance.

    Attributes:
        robots: the comparisons by the names of their requests; None for a robot that cannot be simulated.
        requests: the requests by their names.
    """

    robots: dict[str, Comparison | None] = field(default_factory=dict)
    requests: dict[str, RobotRequest] = field(default_factory=dict)

    def add(self, requests: Sequence[RobotRequest], robots: Sequence[Comparison | None]) -> None:
        """Add robots with their requests."""
        for request, robot in zip(requests, robots, strict=True):
            self.robots[request.name], self.requests[request.name] = robot, request

    def add_fits(self, judgement: Judgement) -> None:
        """Add the robots with single effects that were fitted, by the first covariance."""
        trial_set = judgement.trial_set
        for fit in judgement.fits:
            robots = {float(one.at[0]): one for one in fit.comparisons}
            robots.pop(fit.hypothesis.neutral, None)  # the nominal one
            requests = {at: request for at in robots if (request := fit.request(at)).name not in self.robots}
            initial = trial_set.initial
            self.add([*requests.values()], [initial.rewhiten(robots[at], trial_set) for at in requests])

    def with_effects_of(self, fit: SetFit) -> list[Comparison]:
        """Return the robots that have the effects of a set, on the same targets and no others."""
        wanted = _targets(robot_request(fit.point))
        named = [name for name, request in self.requests.items() if _targets(request) == wanted]
        return [robot for name in named if (robot := self.robots[name]) is not None]


def _targets(request: RobotRequest) -> dict[str, object]:
    return {name: values.get("target") for name, values in request.effects.items()}
