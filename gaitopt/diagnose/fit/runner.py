"""Robots simulated for a set of trials: the only heavy work of a fit.

An executor is given values: a problem and the values of its effects, or a simulator, and what is to be run.
It returns only the measured signals. The trials are compared with them in the calling process, which also
reads and writes the cache. So threads, processes and remote workers give the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, Future, as_completed
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.progress import OnProgress, Progress, silent
from gaitopt.diagnose.fit.cache import SimulationCache
from gaitopt.diagnose.fit.trials import Comparison, TrialSet
from gaitopt.diagnose.gap.predict import Run, predict_runs
from gaitopt.diagnose.record.trial import Trial
from gaitopt.effects.active import Values
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.robot.signals import is_position
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

Predictions = list[Trajectory] | None
"""Prediction of each run, only its measured signals; None where the robot cannot be built."""


@dataclass(frozen=True)
class RobotRequest:
    """A robot to compare with the trials: the nominal one with some effects.

    Attributes:
        effects: values of the effects by name, as a problem file gives them.
        at: coordinates to keep with the result.
        measurement_only: whether the effects change only the measurement, so that nothing is simulated.
    """

    effects: Mapping[str, Values]
    at: tuple[float, ...]
    measurement_only: bool = False

    @property
    def name(self) -> str:
        """Name of the result in the cache: equal for equal robots."""
        return repr(sorted((effect, sorted(values.items())) for effect, values in self.effects.items()))


FITTING, FINISHING = "fitting effects", "finishing the best fits"
FITTING_SETS = "fitting sets of effects"
"""Names of stages."""


@dataclass(frozen=True)
class Runner:
    """Compares trials with robots.

    Attributes:
        executor: where robots are simulated.
        on_progress: called after each robot of a stage.
        cache: results of earlier runs, to which new ones are added; None to keep nothing.
    """

    executor: Executor
    on_progress: OnProgress = silent
    cache: SimulationCache | None = None

    def stage(self, name: str, most: int | None = None) -> Stage:
        """Return a stage of the work that counts its robots, of which there are at most so many."""
        return Stage(self, name, most)

    def compare(
        self,
        trial_set: TrialSet,
        requests: Sequence[RobotRequest],
        on_done: Callable[[], None] = lambda: None,
    ) -> list[Comparison | None]:
        """Return the trials compared with robots that have effects.

        Args:
            trial_set: the trials.
            requests: the robots.
            on_done: called after each robot.

        Returns:
            One comparison for each request, in order; None for a robot that cannot be simulated.
        """
        problem = carrying(trial_set.problem)
        runs, signals = _work_of(trial_set)
        batch = _Batch(self, trial_set, len(requests), on_done)
        for index, request in enumerate(requests):
            if not request.measurement_only and not batch.recall(index, request.name, request.at):
                call = (problem, request.effects, trial_set.simulator.fidelity, runs, signals)
                future = self.executor.submit(predict_with_effects, *call)
                batch.wait_for(index, request.name, request.at, future)
        found = batch.results()
        for index, request in enumerate(requests):
            if request.measurement_only:
                batch.put(index, _with_measurement_effects(trial_set, request))
        return found

    def compare_robots(self, trial_set: TrialSet, robots: Mapping[str, Simulator]) -> list[Comparison | None]:
        """Return the trials compared with robots by their names."""
        runs, signals = _work_of(trial_set)
        batch = _Batch(self, trial_set, len(robots), lambda: None)
        for index, (name, robot) in enumerate(robots.items()):
            if not batch.recall(index, name, ()):
                future = self.executor.submit(predict_with_robot, robot, runs, signals)
                batch.wait_for(index, name, (), future)
        return batch.results()


class Stage:
    """A named part of the work: compares trials with robots, and reports how many are done.

    Where the largest possible number of robots is known, the number still to come only shrinks; elsewhere
    it is not told.
    """

    def __init__(self, runner: Runner, name: str, most: int | None = None):
        self._runner, self._name, self._total = runner, name, most
        self._done = 0
        self._report()

    def spare(self, count: int) -> None:
        """Take away robots that are not needed."""
        if self._total is not None and count:
            self._total -= count
            self._report()

    def __call__(self, trial_set: TrialSet, requests: Sequence[RobotRequest]) -> list[Comparison | None]:
        """Return the trials compared with robots, as `Runner.compare` does."""
        return self._runner.compare(trial_set, requests, self._one)

    def _one(self) -> None:
        self._done += 1
        self._report()

    def _report(self) -> None:
        self._runner.on_progress(Progress(self._name, self._done, self._total, "robots"))


@dataclass(frozen=True)
class _Pending:
    """A robot that is being simulated: its place among the results, its name, coordinates."""

    index: int
    name: str
    at: tuple[float, ...]


class _Batch:
    """Comparisons in the order of their requests, each made when its predictions are ready."""

    def __init__(self, runner: Runner, trial_set: TrialSet, count: int, on_done: Callable[[], None]):
        self._runner, self._trial_set, self._on_done = runner, trial_set, on_done
        self._found: list[Comparison | None] = [None] * count
        self._pending: dict[Future[Predictions], _Pending] = {}

    def put(self, index: int, comparison: Comparison | None) -> None:
        """Add a comparison that is whitened by the first covariance."""
        if comparison is not None:
            comparison = self._trial_set.rewhiten(comparison, self._trial_set.initial)
        self._found[index] = comparison
        self._on_done()

    def recall(self, index: int, name: str, at: tuple[float, ...]) -> bool:
        """Add a comparison from the cache; return whether the cache has it."""
        cache = self._runner.cache
        known = None if cache is None else cache.read(self._kept(name))
        if known is None or not _fits(known, self._trial_set):
            return False
        coordinates = np.array(at, dtype=float)
        self.put(index, Comparison(coordinates, known["whitened"], known["apart"], known["angles"]))
        return True

    def wait_for(self, index: int, name: str, at: tuple[float, ...], future: Future[Predictions]) -> None:
        """Add the comparison with a robot when its predictions are ready."""
        self._pending[future] = _Pending(index, name, at)
        if future.done():
            self._take(future)

    def results(self) -> list[Comparison | None]:
        """Wait for all robots, and return the comparisons in order."""
        for future in as_completed(list(self._pending)):
            self._take(future)
        return self._found

    def _take(self, future: Future[Predictions]) -> None:
        """Compare the trials with a robot's predictions, and keep the comparison in the cache."""
        pending, predictions = self._pending.pop(future), future.result()
        trial_set, cache, comparison = self._trial_set, self._runner.cache, None
        if predictions is not None:
            trials = [one.aligned.trial for one in trial_set.trials]
            comparison = trial_set.compare(pending.at, _for_trials(predictions, trial_set.runs, trials))
        if comparison is not None and cache is not None:
            arrays = (comparison.whitened, comparison.marker, comparison.angles)
            cache.write(
                self._kept(pending.name), dict(zip(("whitened", "apart", "angles"), arrays, strict=True))
            )
        self.put(pending.index, comparison)

    def _kept(self, name: str) -> str:
        """Return the name in the cache of the comparison with a robot."""
        return self._trial_set.label + name


def _fits(known: Mapping[str, NDArray[np.float64]], trial_set: TrialSet) -> bool:
    """Return whether a result from the cache may be of these trials, by its names, lengths and numbers."""
    rows = [(name, len(rows)) for one in trial_set.trials for name, rows in one.bins.rows.items()]
    angles = sum(count for name, count in rows if not is_position(name))
    lengths = {"whitened": len(trial_set.row_blocks), "apart": len(trial_set.sample_trials), "angles": angles}
    same = {name: len(array) for name, array in known.items()} == lengths
    return same and bool(np.isfinite(known["whitened"]).all())


def predict_with_effects(
    problem: Problem,
    effects: Mapping[str, Values],
    fidelity: Fidelity,
    runs: Sequence[Run],
    signals: Sequence[str],
) -> Predictions:
    """Return the predictions of a problem's robot with some effects: the unit of work."""
    try:
        robot = Simulator.build(problem.with_effects(effects), fidelity=fidelity)
        return predict_runs(robot, runs, signals)
    except GaitoptError:
        return None


def predict_with_robot(robot: Simulator, runs: Sequence[Run], signals: Sequence[str]) -> Predictions:
    """Return the predictions of a robot; None where it cannot be simulated."""
    try:
        return predict_runs(robot, runs, signals)
    except GaitoptError:
        return None


def _with_measurement_effects(trial_set: TrialSet, request: RobotRequest) -> Comparison | None:
    """Return the trials compared with the nominal robot, seen by a camera or clock with some effects."""
    try:
        problem = trial_set.problem.with_effects(request.effects)
        active = replace(trial_set.simulator.effects, active=problem.effects)
        model, rng = trial_set.simulator.models[0], np.random.default_rng(0)
        return trial_set.compare(request.at, [active.observe(t, model, rng) for t in trial_set.nominal])
    except GaitoptError:
        return None


def _work_of(trial_set: TrialSet) -> tuple[list[Run], list[str]]:
    trials = [one.aligned.trial for one in trial_set.trials]
    return list(trial_set.runs.values()), _signals(trials)


def _signals(trials: Iterable[Trial]) -> list[str]:
    return list(dict.fromkeys(name for trial in trials for name in trial.signals))


def _for_trials(
    predictions: Sequence[Trajectory], runs: Mapping[str, Run], trials: Sequence[Trial]
) -> list[Trajectory]:
    """Return the prediction of each trial, from those of the distinct runs."""
    by_key = dict(zip(runs, predictions, strict=True))
    return [by_key[trial.drive.key] for trial in trials]
