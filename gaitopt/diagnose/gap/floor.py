"""The floor: the gap that a correct model would have.

Four things keep a correct model from fitting exactly: the noise of the recording; a robot that differs from
cycle to cycle or from run to run; a start pose that is known to a few milliradians; and the simulator's
timestep. Each is measured, from the data or by simulations at the fidelity of the diagnosis. They add in
squares.

Commands without a period have no cycles, but repeats. Where a drive has none, the repeats of other drives
tell how repeatable the robot is: they differ as if each motion came late by chance. So the spread of repeats
is divided by the RMS speed of their motion. The median of these times over the drives, times its own RMS
speed, is the spread to expect of the drive without repeats. The sensor is the same in all recordings, and the
quietest of them show its noise: in quick ones the motion looks like noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace

import numpy as np

from gaitopt.core.statistics import uniform_sd
from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.gap.align import Aligned, align
from gaitopt.diagnose.gap.predict import predict_each
from gaitopt.diagnose.gap.settings import DEFAULT, FloorSettings
from gaitopt.diagnose.record.cycles import Cycles, cycle_means, steady, steady_from
from gaitopt.diagnose.record.noise import noise_of
from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.problem.records import Fidelity
from gaitopt.robot.signals import is_position, joint_signal
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import NOMINAL, Scenario


@dataclass(frozen=True)
class Floor:
    """Why one signal of one trial cannot be predicted exactly: RMS of each part, m or rad.

    Attributes:
        noise: of the measurement, from the record or as the data set says.
        spread: of the cycles about their mean, in the record; includes the noise. None where the drive has no
            period.
        start_pose: change of the prediction with the start pose.
        numerics: error of the prediction by its timestep; see `FloorSettings.halved`.
        clock: change of the prediction by the error of time stamps that had been rounded.
        repeats: of trials of one drive about their mean; None where there is one trial.
        others: the same as the repeats of other drives suggest; None where there are own repeats or no
            others, or where the drive has a period.
    """

    noise: float
    spread: float | None
    start_pose: float
    numerics: float
    clock: float = 0.0
    repeats: float | None = None
    others: float | None = None

    @property
    def total(self) -> float:
        """The floor, RMS, m or rad.

        The difference from run to run is that of the repeats where there are any. Otherwise it is that from
        cycle to cycle, and that by the start pose.
        """
        within = self.noise if self.spread is None else max(self.noise, self.spread)
        repeats = self.others if self.repeats is None else self.repeats
        run = math.hypot(within, self.start_pose) if repeats is None else max(within, repeats)
        return math.hypot(run, self.numerics, self.clock)

    def to_dict(self) -> dict[str, float | None]:
        """Return the parts for a JSON file."""
        parts = asdict(self)
        if self.others is None:
            del parts["others"]
        return parts


Floors = Mapping[str, Floor]
"""Floor of each signal of a trial."""


def marker_floor(floors: Floors) -> float:
    """Return the floor of the marker's distance, over the measured axes, m."""
    return math.sqrt(sum(floor.total**2 for name, floor in floors.items() if is_position(name)))


def floors_off(aligned: Aligned, floors: Floors) -> dict[str, float]:
    """Return the gap of the marker and of each angle, in floors."""
    pairs = {n: (aligned.rms(n), floor.total) for n, floor in floors.items() if not is_position(n)}
    if any(map(is_position, floors)):
        pairs = {"marker": (aligned.marker_rms, marker_floor(floors))} | pairs
    return {name: gap / floor if floor > 0.0 else math.inf for name, (gap, floor) in pairs.items()}


def above_floor(aligned: Aligned, floors: Floors) -> bool:
    """Whether the gap of the marker or of any angle is above its floor."""
    return max(floors_off(aligned, floors).values()) > 1.0


def measure_floors(
    simulator: Simulator,
    trials: Sequence[Aligned],
    executor: Executor,
    seed: int,
    settings: FloorSettings = DEFAULT.floor,
) -> list[Floors]:
    """Return the floor of each signal of each trial.

    Args:
        simulator: the nominal robot at the diagnosis' fidelity.
        trials: the trials aligned with their nominal prediction.
        executor: where rollouts run.
        seed: seed of the start poses.
        settings: see `FloorSettings`.
    """
    working = simulator.fidelity
    halved = working.scaled(0.5)
    noises = _noises([aligned.trial for aligned in trials], settings)
    repeats = [_repeats(aligned, trials) for aligned in trials]
    others = _like_others(trials, repeats)
    by_start = _by_start(simulator, trials, noises)
    horizon = simulator.problem.simulation.horizon
    floors: list[Floors] = [{} for _ in trials]
    for size, numbers in by_start.items():
        family = [trials[number].trial for number in numbers]
        poses = Simulator.build(simulator.problem, _start_poses(size, seed, settings), working)
        robots = [(_nominal_at(simulator, halved), 0), *((poses, i) for i in range(settings.start_poses))]
        finer, *perturbed = predict_each(robots, family, executor)
        for index, number in enumerate(numbers):
            aligned = trials[number]
            halving = _change(aligned, [finer[index]])
            start_pose = _change(aligned, [row[index] for row in perturbed])
            transient = steady_from(horizon, aligned.trial.drive)
            floors[number] = {
                name: Floor(
                    noises[number][name],
                    cycle_spread(aligned, name, transient),
                    start_pose[name],
                    settings.halved * halving[name],
                    _clock(aligned, name),
                    repeats[number].get(name),
                    others[number].get(name),
                )
                for name in aligned.trial.signals
            }
    return floors


def _nominal_at(simulator: Simulator, fidelity: Fidelity) -> Simulator:
    """Return the nominal robot at another fidelity."""
    return replace(simulator, scenarios=(NOMINAL,), models=simulator.models[:1]).at(fidelity)


def _by_start(
    simulator: Simulator, trials: Sequence[Aligned], noises: Sequence[Mapping[str, float]]
) -> dict[float, list[int]]:
    """Return the numbers of the trials by how well their start pose is known, rad.

    It is known as the problem's tolerances say; one that was measured, to the noise of the sensor.
    """
    found: dict[float, list[int]] = {}
    for number, aligned in enumerate(trials):
        size = simulator.problem.file.tolerances.start_pose_rad
        start = aligned.trial.drive.start
        if start is not None:
            signals = [joint_signal(joint) for joint in start]
            size = max((noises[number][name] for name in signals if name in noises[number]), default=size)
        found.setdefault(size, []).append(number)
    return found


def _start_poses(size: float, seed: int, settings: FloorSettings) -> tuple[Scenario, ...]:
    """Return scenarios with a start pose each, with errors of a size, rad."""
    seeds = generator(seed, Stream.FLOOR_START_POSES).integers(2**31, size=settings.start_poses)
    return tuple(Scenario(start_pose_rad=size, pose_seed=int(number)) for number in seeds)


def _noises(trials: Sequence[Trial], settings: FloorSettings) -> list[dict[str, float]]:
    """Return the standard deviation of each signal's noise in each trial, m or rad.

    Of drives without a period, that of the quietest recordings of this signal is taken for all.
    """
    noises = [{name: _noise(trial, name) for name in trial.signals} for trial in trials]
    logs = [number for number, trial in enumerate(trials) if trial.has_log]
    for name in dict.fromkeys(name for number in logs for name in trials[number].signals):
        own = [number for number in logs if name in noises[number]]
        quiet = float(np.quantile([noises[n][name] for n in own], settings.quietest, method="lower"))
        for number in own:
            noises[number][name] = quiet
    return noises


def _noise(trial: Trial, name: str) -> float:
    """Return the standard deviation of a signal's noise in one recording, m or rad."""
    if trial.noise_m and is_position(name):
        return trial.noise_m
    noise = noise_of(trial.signals[name][trial.used[name]])
    return max(noise, uniform_sd(trial.steps_rad.get(name, 0.0)))


def _clock(aligned: Aligned, name: str) -> float:
    """Return the RMS change of a prediction by the trial's error in time, m or rad."""
    late = np.interp(aligned.time + aligned.trial.clock_s, aligned.simulated.time, aligned.simulated[name])
    now = np.interp(aligned.time, aligned.simulated.time, aligned.simulated[name])
    return float(np.sqrt(np.mean((late - now) ** 2)))


def cycle_spread(aligned: Aligned, name: str, transient: float) -> float | None:
    """Return the RMS of a measured signal about its mean cycle and its mean travel, m or rad.

    The mean cycle of n cycles fits a share 1/n of the spread, and the travel the same share of the cycles'
    means. Both are corrected for. None where the drive has no period.

    Args:
        aligned: the trial aligned with a prediction.
        name: the signal.
        transient: gait time from which the motion may be steady, s.
    """
    period = aligned.trial.drive.period_s
    if period is None:
        return None
    keep = aligned.trial.used[name]
    time, series = aligned.time[keep], aligned.trial.signals[name][keep]
    cycles = Cycles.of(time, period, transient, aligned.trial.name)
    rest = steady(cycles.sampled(time, series, aligned.trial.frame_s)).rest
    means = cycle_means(rest)
    inside = rest - means[:, None]
    count = cycles.count
    variance = float(np.nanmean(inside**2)) * count / (count - 1)
    if count > 2:
        variance += float(np.nanmean(means**2)) * count / (count - 2)
    return math.sqrt(variance)


def _change(aligned: Aligned, others: Sequence[Trajectory]) -> dict[str, float]:
    """Return the RMS distance of other predictions from the nominal one, aligned to it, m or rad."""
    squares = dict.fromkeys(aligned.trial.signals, 0.0)
    for other in others:
        signals = {name: np.interp(aligned.time, other.time, other[name]) for name in squares}
        stand_in = replace(aligned.trial, signals=signals)
        apart = align(stand_in, aligned.simulated)
        for name in squares:
            squares[name] += apart.rms(name) ** 2 / len(others)
    return {name: math.sqrt(square) for name, square in squares.items()}


def _repeats(aligned: Aligned, trials: Sequence[Aligned]) -> dict[str, float]:
    """Return the standard deviation of each signal over the trials of one drive, at this trial's times.

    Where the drive has a period, or the signal's origin is free, levels that differ do not count.
    """
    key, period = aligned.trial.drive.key, aligned.trial.drive.period_s
    family = [other for other in trials if other.trial.drive.key == key]
    spreads = {}
    for name in aligned.trial.signals:
        rows = [_residual_at(other, name, aligned.time) for other in family if name in other.residual]
        if len(rows) < 2:
            continue
        together = np.where(aligned.trial.used[name], np.stack(rows), np.nan)
        together = together[:, np.isfinite(together).all(axis=0)]
        if together.shape[1]:
            if period is not None or is_position(name):
                together = together - together.mean(axis=1, keepdims=True)
            spreads[name] = float(np.sqrt(together.var(axis=0, ddof=1).mean()))
    return spreads


def _like_others(trials: Sequence[Aligned], repeats: Sequence[Mapping[str, float]]) -> list[dict[str, float]]:
    """Return the spread to expect of the repeats of each drive that has none, m or rad by signal.

    It is the RMS speed of the motion times the median, over the drives with repeats, of spread over RMS
    speed. Drives with a period have none.
    """
    expected: list[dict[str, float]] = [{} for _ in trials]
    logs = [number for number, aligned in enumerate(trials) if aligned.trial.has_log]
    for name in dict.fromkeys(name for number in logs for name in trials[number].trial.signals):
        times: dict[str, list[float]] = {}
        for number in logs:
            speed = rms_speed(trials[number].trial, name)
            if name in repeats[number] and speed > 0.0:
                key = trials[number].trial.drive.key
                times.setdefault(key, []).append(repeats[number][name] / speed)
        if times:
            late = float(np.median([np.mean(family) for family in times.values()]))
            for number in logs:
                if name in trials[number].trial.signals and name not in repeats[number]:
                    expected[number][name] = late * rms_speed(trials[number].trial, name)
    return expected


def rms_speed(trial: Trial, name: str) -> float:
    """Return the RMS speed of a signal from sample to sample, m/s or rad/s; 0 where it was not measured."""
    if name not in trial.signals:
        return 0.0
    time, series = trial.counted(name)
    elapsed = np.diff(time)
    steps = np.diff(series)[elapsed > 0.0] / elapsed[elapsed > 0.0]
    return float(np.sqrt(np.mean(steps**2))) if len(steps) else 0.0


def _residual_at(aligned: Aligned, name: str, time: Series) -> Series:
    """Return a residual at other gait times, m or rad; NaN outside its recording."""
    keep = np.isfinite(aligned.residual[name])
    own, residual = aligned.time[keep], aligned.residual[name][keep]
    moved: Series = np.interp(time, own, residual, left=np.nan, right=np.nan)
    return moved
