"""Gaits side by side over the same scenarios, and one gait over a range of one parameter."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gaitopt.core.errors import GaitoptError, unknown_name
from gaitopt.core.statistics import interval90
from gaitopt.core.streams import Stream
from gaitopt.gait.gait import Channel, Gait
from gaitopt.optimise.evaluator import Evaluator
from gaitopt.optimise.verification import scenarios_of
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import NOMINAL
from gaitopt.simulation.setup import RobotSetup

Row = dict[str, Any]


def compare(problem: Problem, gaits: Sequence[Gait], seed: int, executor: Executor) -> list[Row]:
    """Return one row per gait: mean speed with interval, and its paired difference to the first gait.

    Every gait meets the same scenarios, so the difference and the ratio of two are judged scenario by
    scenario. A ratio to a gait that may not go forward at all means nothing, and is None.
    """
    scenarios = scenarios_of(problem, seed, Stream.VERIFICATION_SCENARIOS)
    evaluator = Evaluator(RobotSetup.of(problem, scenarios, problem.simulation.working), executor)
    rows: list[Row] = []
    first: np.ndarray | None = None
    for gait, (evaluation, outcomes) in zip(gaits, evaluator(gaits), strict=True):
        speeds = np.array([outcome.metrics["speed_m_s"] for outcome in outcomes])
        first = speeds if first is None else first
        low, high = interval90(speeds - first)
        ratio, ratio_ci90 = _ratio(speeds, first)
        rows.append(
            {
                "name": gait.name,
                "period_s": gait.period_s,
                "speed_ci90_m_s": list(interval90(speeds)),
                "speed_worst_m_s": float(speeds.min()),
                "difference_m_s": float((speeds - first).mean()),
                "difference_ci90_m_s": [low, high],
                "ratio": ratio,
                "ratio_ci90": ratio_ci90,
                "more_than_noise": low > 0.0 or high < 0.0,
                "constraints_met": evaluation.constraints_met,
                "violations": {n: v for n, v in evaluation.violations.items() if v > 0.0},
                "status": evaluation.status,
                "scenario_speeds_m_s": speeds.tolist(),
            }
            | evaluation.metrics
        )
    return rows


def _ratio(speeds: np.ndarray, first: np.ndarray) -> tuple[float | None, list[float] | None]:
    """Return the ratio of two means over the same scenarios with its 90 % interval.

    By the delta method: the ratio's error is the mean of (a - r b) / mean(b) over the scenarios.
    """
    if not interval90(first)[0] > 0.0:
        return None, None
    ratio = float(speeds.mean() / first.mean())
    low, high = interval90(ratio + (speeds - ratio * first) / first.mean())
    return ratio, [low, high]


@dataclass(frozen=True)
class Sweep:
    """A range of one parameter: of the gait (``period_s``, ``CHANNEL.KEY``) or of the model."""

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
            parsed = tuple(float(value) for value in values.split(","))
        except ValueError:
            parsed = ()
        if not separator or not parsed or not np.all(np.isfinite(parsed)):
            raise GaitoptError(f"--over: found {text!r}; allowed: NAME=V1,V2,… with numbers")
        return Sweep(name, parsed)

    def points(self, problem: Problem, gait: Gait) -> list[tuple[Problem, Gait]]:
        """Return the problem and gait at each value.

        Raises:
            GaitoptError: there is no such parameter, or a value is outside what it allows.
        """
        return [self._point(problem, gait, value) for value in self.values]

    def _point(self, problem: Problem, gait: Gait, value: float) -> tuple[Problem, Gait]:
        label = f"{self.name}={value:g}"
        channel, _, key = self.name.partition(".")
        if self.name in problem.file.parameters:
            return problem.with_parameters({self.name: value}), replace(gait, name=label)
        values: dict[str, Any] = gait.to_dict()
        if self.name == "period_s":
            values["period_s"] = value
        elif channel in gait.channels and key in Channel.model_fields:
            values["channels"][channel][key] = value
        else:
            known = ["period_s", *problem.file.parameters]
            known += [f"{name}.{field}" for name in gait.channels for field in Channel.model_fields]
            raise unknown_name("--over", "parameter", self.name, known)
        return problem, problem.check_gait(
            Gait.from_dict(values, f"--over {label}", label), f"--over {label}"
        )


def sweep(points: Sequence[tuple[Problem, Gait]], executor: Executor) -> list[Row]:
    """Return one row of metrics per point, on the nominal robot."""
    rows = []
    for problem, gait in points:
        setting = RobotSetup.of(problem, (NOMINAL,), problem.simulation.working)
        evaluation, outcomes = Evaluator(setting, executor)([gait])[0]
        row: Row = {"name": gait.name, "period_s": gait.period_s, "status": outcomes[0].status}
        rows.append(row | {"constraints_met": evaluation.constraints_met} | outcomes[0].metrics)
    return rows
