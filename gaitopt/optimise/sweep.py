"""One gait over a range of one parameter."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gaitopt.core.errors import GaitoptError, unknown_name
from gaitopt.core.numbers import number
from gaitopt.gait.gait import Channel, Gait
from gaitopt.optimise.evaluator import assess_all, judge
from gaitopt.optimise.robots import OverRobots, over_robots, robots_of
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import Metrics
from gaitopt.simulation.scenario import NOMINAL
from gaitopt.simulation.setup import RobotSetup

SWEPT = 20
"""Most robots of a posterior that each value is simulated on."""


@dataclass(frozen=True)
class SweepPoint:
    """A problem and a gait at one value of the parameter."""

    problem: Problem
    gait: Gait


@dataclass(frozen=True)
class Sweep:
    """A range of one parameter: of the gait (``period_s``, ``CHANNEL.KEY``) or of the model.

    Attributes:
        name: the parameter.
        values: its values, in the unit of the gait file or of the problem file.
    """

    name: str
    values: tuple[float, ...]

    @staticmethod
    def parse(text: str) -> Sweep:
        """Return the sweep written as ``NAME=V1,V2,…``.

        Raises:
            GaitoptError: the text is not of this form.
        """
        name, separator, values = text.partition("=")
        try:
            parsed = tuple(number(value) for value in values.split(","))
        except ValueError:
            parsed = ()
        if not separator or not parsed or not np.all(np.isfinite(parsed)):
            raise GaitoptError(f"--over: found {text!r}; allowed: NAME=V1,V2,… with numbers")
        return Sweep(name, parsed)

    def points(self, problem: Problem, gait: Gait) -> list[SweepPoint]:
        """Return the problem and gait at each value.

        Raises:
            GaitoptError: there is no such parameter, or a value is outside what it allows.
        """
        return [self._point(problem, gait, value) for value in self.values]

    def _point(self, problem: Problem, gait: Gait, value: float) -> SweepPoint:
        label = f"{self.name}={value:g}"
        channel, _, key = self.name.partition(".")
        if self.name in problem.file.parameters:
            return SweepPoint(problem.with_parameters({self.name: value}), replace(gait, name=label))
        values: dict[str, Any] = gait.to_dict()
        if self.name == "period_s":
            values["period_s"] = value
        elif channel in gait.channels and key in Channel.model_fields:
            values["channels"][channel][key] = value
        else:
            known = ["period_s", *problem.file.parameters]
            known += [f"{name}.{field}" for name in gait.channels for field in Channel.model_fields]
            raise unknown_name("--over", "parameter", self.name, known)
        changed = Gait.from_dict(values, f"--over {label}", label)
        return SweepPoint(problem, problem.check_gait(changed, f"--over {label}"))


@dataclass(frozen=True)
class SweptPoint:
    """The result of a gait at one value of the parameter, on the nominal robot.

    Attributes:
        name: the parameter and its value.
        period_s: period of the gait, s.
        status: ``ok``, or why the simulation failed.
        constraints_met: whether the simulation went well and every constraint holds.
        metrics: the metrics.
        over_robots: the same on robots of a posterior; None where none were asked for.
    """

    name: str
    period_s: float
    status: str
    constraints_met: bool
    metrics: Metrics
    over_robots: OverRobots | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the row of ``sweep.json``: the figures, then the metrics, over a posterior their means."""
        over = self.over_robots
        if over is None:
            return self.nominal
        figures = over.means | {"constraints_met": over.constraints_met}
        return self.nominal | figures | {"nominal": self.metrics, "posterior": over.to_dict()}

    @property
    def nominal(self) -> dict[str, Any]:
        """The row of the nominal robot alone."""
        row = dict(vars(self))
        del row["metrics"], row["over_robots"]
        return row | self.metrics


def sweep(points: Sequence[SweepPoint], executor: Executor) -> list[SweptPoint]:
    """Return the figures of each point, on the nominal robot, and on the robots that its problem has."""
    setups = [RobotSetup.of(p.problem, (NOMINAL,), p.problem.simulation.working) for p in points]
    work = [(setup, point.gait, 0) for setup, point in zip(setups, points, strict=True)]
    over: list[OverRobots | None] = [None] * len(points)
    if points and points[0].problem.robots:
        over = [*over_robots([(robots_of(p.problem, SWEPT), p.gait) for p in points], executor)]
    return [
        SweptPoint(
            name=point.gait.name,
            period_s=point.gait.period_s,
            status=outcome.status,
            constraints_met=judge(point.problem, [outcome]).constraints_met,
            metrics=outcome.metrics,
            over_robots=expected,
        )
        for point, outcome, expected in zip(points, assess_all(work, executor), over, strict=True)
    ]
