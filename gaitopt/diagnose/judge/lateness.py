"""How late changes of a command act by chance, from how recordings of the same commands differ.

A command that waits for a pulse, a bus or a script acts late by a time of its own. What that does to the
motion tells a simulation in which one change of the commands is late. Repeats of the commands differ by such
responses, each multiplied by its delay, and by noise. So the standard deviation of the delays is that under
which the differences are likeliest. Friction that sticks now here, now there makes repeats differ in other
ways: they count as noise, and delays are then not more likely than none.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.statistics import UNIFORM_WIDTH
from gaitopt.diagnose.fit.residual import WhitenedTrial
from gaitopt.diagnose.gap.floor import Floors
from gaitopt.diagnose.gap.predict import Run, predict_runs, runs_of
from gaitopt.diagnose.judge.settings import LATENESS, LatenessSettings
from gaitopt.gait.logged import LoggedCommands
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Lateness:
    """How late changes of the commands act by chance.

    Attributes:
        sd_s: standard deviation of the delays, s.
        ci90: 90 % interval of that, s.
        explained: share of the differences' squares above the noise that delays explain.
        log_likelihood: logarithm of the likelihood of the differences, up to a constant: the larger, the
            better the robot that was simulated.
    """

    sd_s: float
    ci90: tuple[float, float]
    explained: float
    log_likelihood: float

    def shown(self, settings: LatenessSettings) -> bool:
        """Return whether delays explain enough of how repeats differ."""
        long = self.sd_s >= settings.long_s
        return self.explained >= (settings.long_explained if long else settings.explained)

    @property
    def delay_shift(self) -> tuple[float, float]:
        """By how much a constant delay beside these may be other than fitted, s: less and more.

        Repeats tell the standard deviation of the delays, not their mean. Those that the model draws are
        uniform, with a mean of √3 standard deviations. Those of a queue are exponential, with a mean of one.
        """
        low, high = self.ci90
        uniform = 0.5 * UNIFORM_WIDTH
        return uniform * self.sd_s - uniform * high, uniform * self.sd_s - low


@dataclass(frozen=True)
class LateChanges:
    """What a robot does under commands of which one change is late.

    Attributes:
        prompt: the prediction with all changes in time.
        late: the predictions with one change late each.
        by_s: how late it is in each, s.
    """

    prompt: Trajectory
    late: tuple[Trajectory, ...]
    by_s: tuple[float, ...]

    def columns(self, trial: WhitenedTrial) -> Array:
        """Return the change of each row of a trial per delay of each change, m/s or rad/s, shape (n, k)."""
        offset = trial.aligned.offset_s
        prompt = trial.bins.means(self.prompt, offset)
        moved = [trial.bins.means(one, offset) - prompt for one in self.late]
        return _per_second(moved, self.by_s, len(prompt))

    def samples(self, name: str, time: Array) -> Array:
        """Return the same of a signal at gait times, s, shape (n,): shape (n, k)."""
        prompt = np.interp(time, self.prompt.time, self.prompt[name])
        moved = [np.interp(time, one.time, one[name]) - prompt for one in self.late]
        return _per_second(moved, self.by_s, len(time))


def _per_second(moved: Sequence[Array], by_s: Sequence[float], rows: int) -> Array:
    columns = [one / late for one, late in zip(moved, by_s, strict=True)]
    return np.column_stack(columns) if columns else np.empty((rows, 0))


def simulate_late_changes(
    robot: Simulator,
    trials: Sequence[WhitenedTrial],
    executor: Executor,
    by_s: float = LATENESS.tried_s,
    settings: LatenessSettings = LATENESS,
) -> dict[str, LateChanges]:
    """Return what a robot does if one change of the commands is late, by the key of the drive.

    Drives with a period are left out, and those whose changes follow one another too soon: a delay of one of
    many small steps does little.

    Args:
        robot: the robot.
        trials: the trials.
        executor: where rollouts run.
        by_s: how late a change is, s.
        settings: which changes count.
    """
    records = [one.aligned.trial for one in trials]
    signals = list(dict.fromkeys(name for trial in records for name in trial.signals))
    work = {}
    for key, run in runs_of(records).items():
        if isinstance(run.drive, LoggedCommands):
            late = _late(run.drive, by_s, settings)
            runs = [run, *(Run(drive, run.duration_s) for drive, _ in late)]
            work[key] = (executor.submit(predict_runs, robot, runs, signals), late)
    found = {}
    for key, (future, late) in work.items():
        prompt, *others = future.result()
        if all(one.status == "ok" for one in (prompt, *others)):
            found[key] = LateChanges(prompt, tuple(others), tuple(seconds for _, seconds in late))
    return found


def _late(
    drive: LoggedCommands, by_s: float, settings: LatenessSettings
) -> list[tuple[LoggedCommands, float]]:
    """Return commands with one change late each, and by how much, s: at most half the time to the next."""
    changes = drive.changes
    gaps = np.diff(changes)
    if not len(gaps) or float(np.median(gaps)) < settings.shortest_s:
        return []
    rows = drive.targets(changes)
    found = []
    for number, gap in enumerate([*gaps.tolist()[1:], math.inf], start=1):
        seconds = min(by_s, 0.5 * gap)
        time = changes.copy()
        time[number] += seconds
        found.append((replace(drive, time=time, rows=rows), seconds))
    return found


@dataclass(frozen=True)
class _Differences:
    """The differences between the repeats of one drive, in units of the noise, by what delays do to them.

    Attributes:
        shares: square of each delay's response, 1/s², shape (k,); see `of`.
        squares: mean square of the differences along each of these, over the repeats, shape (k,).
        rest: mean over the repeats of the sum of squares in all other directions.
        others: number of these directions.
        repeats: repeats less one.
    """

    shares: Array
    squares: Array
    rest: float
    others: int
    repeats: int

    @staticmethod
    def of(family: Sequence[WhitenedTrial], floors: Floors, late: LateChanges) -> _Differences | None:
        """Return the differences of some repeats, split along the singular vectors of the delays' responses.

        None where they have no signal in common, or their samples do not overlap.
        """
        first = family[0].aligned
        rows, responses = [], []
        for name in first.trial.signals:
            if not all(name in one.aligned.trial.signals for one in family):
                continue
            noise = max(floors[name].noise, 1e-9)
            measured = _resampled(family, name, first.time) / noise
            known = np.isfinite(measured).all(axis=0)
            rows.append(measured[:, known])
            responses.append(late.samples(name, first.time[known]) / noise)
        if not rows:
            return None
        together, response = np.concatenate(rows, axis=1), np.concatenate(responses)
        if together.shape[1] <= response.shape[1]:
            return None
        apart = together - together.mean(axis=0)
        vectors, sizes, _ = np.linalg.svd(response, full_matrices=False)
        along = apart @ vectors
        count = len(family) - 1
        squares = np.sum(along**2, axis=0) / count
        rest = float(np.sum(apart**2)) / count - float(squares.sum())
        return _Differences(sizes**2, squares, max(rest, 0.0), len(response) - len(sizes), count)

    def log_likelihood(self, variance: float) -> float:
        """Return the logarithm of the likelihood of a variance of the delays, s², up to a constant.

        The noise may be larger than its floor: it is as large as is likeliest.
        """
        return max(self._at(variance, noise) for noise in self._noises)

    def left(self, variance: float) -> float:
        """Return the mean square per direction that the likeliest noise is of, given delays."""
        return max(self._noises, key=lambda noise: self._at(variance, noise))

    @cached_property
    def _noises(self) -> list[float]:
        total = (float(self.squares.sum()) + self.rest) / (len(self.squares) + self.others)
        noises: list[float] = np.geomspace(1.0, max(1.0, 2.0 * total), 40).tolist()
        return noises

    def _at(self, variance: float, noise: float) -> float:
        expected = noise + variance * self.shares
        along = np.sum(np.log(expected) + self.squares / expected)
        other = self.others * math.log(noise) + self.rest / noise
        return -0.5 * self.repeats * float(along + other)


def _resampled(family: Sequence[WhitenedTrial], name: str, time: Array) -> Array:
    """Return a signal of each repeat at gait times, s, shape (n,): shape (repeats, n); NaN outside."""
    rows = []
    for one in family:
        used, series = one.aligned.trial.used[name], one.aligned.trial.signals[name]
        rows.append(np.interp(time, one.aligned.time[used], series[used], left=np.nan, right=np.nan))
    return np.stack(rows)


def find_lateness(
    robot: Simulator,
    trials: Sequence[WhitenedTrial],
    floors: Sequence[Floors],
    executor: Executor,
    settings: LatenessSettings = LATENESS,
) -> Lateness | None:
    """Return how late changes of the commands act by chance; None where repeats do not show that they do.

    What one late change does is simulated anew at the delay that was found. At first delays may explain
    little: where they are much longer than the one tried, its response tells little.

    Args:
        robot: the robot.
        trials: the trials.
        floors: floor of each signal of each.
        executor: where rollouts run.
        settings: when delays count as shown.
    """
    families = _repeats(trials)
    repeated = [trials[numbers[0]] for numbers in families.values()]
    by_s, found = settings.tried_s, None
    for _ in range(settings.rounds):
        late = simulate_late_changes(robot, repeated, executor, by_s, settings)
        apart = [
            _Differences.of([trials[n] for n in families[key]], floors[families[key][0]], changes)
            for key, changes in late.items()
        ]
        found = _likeliest([one for one in apart if one is not None and len(one.shares)], settings)
        if found is None:
            return None
        by_s = max(settings.tried_s, found.sd_s)
    return found if found is not None and found.shown(settings) else None


def _repeats(trials: Sequence[WhitenedTrial]) -> dict[str, list[int]]:
    """Return the numbers of the trials of each drive that was recorded more than once, by its key.

    Trials count where it is known when the drive began.
    """
    families: dict[str, list[int]] = {}
    for number, one in enumerate(trials):
        if one.aligned.trial.starts_at_s is not None:
            families.setdefault(one.aligned.trial.drive.key, []).append(number)
    return {key: numbers for key, numbers in families.items() if len(numbers) > 1}


def _likeliest(known: Sequence[_Differences], settings: LatenessSettings) -> Lateness | None:
    """Return the likeliest delays; None where repeats are no likelier by them."""
    if not known:
        return None
    sizes = np.geomspace(settings.least_s, settings.most_s, settings.sizes)
    logs = np.array([sum(one.log_likelihood(float(size) ** 2) for one in known) for size in sizes])
    none = sum(one.log_likelihood(0.0) for one in known)
    best = int(np.argmax(logs))
    gain = float(logs[best]) - none
    before = sum((one.rest + float(one.squares.sum())) * one.repeats for one in known)
    count = sum((one.others + len(one.shares)) * one.repeats for one in known)
    variance = float(sizes[best]) ** 2
    left = sum(one.left(variance) * (one.others + len(one.shares)) * one.repeats for one in known)
    explained = (before - left) / max(before - count, 1e-12)
    if gain < settings.gain or best == 0:
        return None
    likely = sizes[logs >= logs[best] - settings.interval]
    ends = (float(likely[0]), float(likely[-1]))
    return Lateness(float(sizes[best]), ends, explained, float(logs[best]))
