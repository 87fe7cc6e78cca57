"""Robots simulated by any executor: the same bits, little data sent, and nothing lost."""

import pickle
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from planting import dataset, recording_of, rollout

from gaitopt.core.progress import Progress
from gaitopt.diagnose.diagnosis import DiagnosisRequest, diagnose
from gaitopt.diagnose.fit.cache import SimulationCache
from gaitopt.diagnose.fit.settings import FitSettings
from gaitopt.diagnose.judge.settings import (
    CovarianceSettings,
    DiagnosisSettings,
    PrecisionSettings,
    SmallErrorSettings,
    VerdictSettings,
)
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.optimise.executors import EXECUTORS, SerialExecutor, open_executor
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator

AMONG = ("ground_slope", "camera_tilt")
BRIEF = DiagnosisSettings(
    fit=FitSettings(screened=(0.5, 1.0), rounds=(2, 1), finish_rounds=1, finish_rounds_measurement=2),
    small_errors=SmallErrorSettings(robots=2),
    precision=PrecisionSettings(robots=2),
    covariance=CovarianceSettings(estimates=1),
    verdict=VerdictSettings(no_gap=0.0),
)
"""Few robots; the result does not matter."""


@pytest.fixture(scope="module")
def folder(arcfold: Problem, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short walk uphill."""
    walk = rollout(arcfold, "square-1s", 6.0, {"ground_slope": {"angle_rad": 0.06}})
    return dataset(tmp_path_factory.mktemp("data"), {"walk": ("square-1s", recording_of(walk))})


def found(arcfold: Problem, folder: Path, executor: Any, **more: Any) -> dict[str, Any]:
    simulator = Simulator.build(arcfold)
    data = load_dataset(folder, arcfold, [name for name in simulator.signals if name])
    request = DiagnosisRequest(1, AMONG, next_gait=False)
    answer = diagnose(simulator, data, request, executor, settings=BRIEF, **more)
    return answer.to_dict()


@pytest.mark.slow
def test_every_executor_gives_the_same_bits(arcfold: Problem, folder: Path) -> None:
    """With a recording that begins at an unknown time, whose offset is fitted for each robot."""
    answers = []
    for kind in EXECUTORS:
        with open_executor(kind, 2) as executor:
            answers.append(found(arcfold, folder, executor))
    assert {row["name"] for row in answers[0]["effects"]} == {*AMONG}
    assert answers[1:] == answers[:1] * (len(EXECUTORS) - 1)


class Weighing(SerialExecutor):
    """Runs each call on its pickled copy, and keeps the sizes of call and answer, bytes."""

    def __init__(self) -> None:
        self.sent: list[int] = []
        self.answered: list[int] = []

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        call = pickle.dumps((function, args, kwargs))
        function, args, kwargs = pickle.loads(call)
        future = super().submit(function, *args, **kwargs)
        self.sent.append(len(call))
        self.answered.append(len(pickle.dumps(future.result())))
        return future


@pytest.mark.slow
def test_little_travels_and_an_interrupted_diagnosis_recalls_it(
    arcfold: Problem, folder: Path, tmp_path: Path
) -> None:
    """No call carries the trials' matrices; what is cached is not simulated again."""
    steps: list[Progress] = []
    cache, weighing = SimulationCache(tmp_path / "cache"), Weighing()
    first = found(arcfold, folder, weighing, cache=cache, on_progress=steps.append)
    assert max(weighing.sent) < 200_000
    assert max(weighing.answered) < 5_000_000
    fits = [step for step in steps if step.stage == "fitting effects"]
    assert fits[-1].done == fits[-1].total
    again = Weighing()
    assert found(arcfold, folder, again, cache=cache) == first
    assert len(weighing.sent) - len(again.sent) == cache.count
