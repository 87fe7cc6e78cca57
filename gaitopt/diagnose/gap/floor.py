"""The floor: the gap that a correct model would have.

Four things keep a correct model from fitting exactly: the noise of the recording; a robot that differs from
cycle to cycle or from run to run; a start pose that is known to a few milliradians; and the simulator's
timestep. Each is measured, from the data or by simulations at the fidelity of the diagnosis. They add in
squares.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.gap.align import Aligned, align
from gaitopt.diagnose.gap.predict import predict_each
from gaitopt.diagnose.gap.settings import DEFAULT, FloorSettings
from gaitopt.diagnose.record.cycles import Cycles, cycle_means, steady, steady_from
from gaitopt.diagnose.record.noise import noise_of
from gaitopt.diagnose.record.trial import Series, Trial
from gaitopt.problem.records import Fidelity
from gaitopt.robot.signals import is_position
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
    """

    noise: float
    spread: float | None
    start_pose: float
    numerics: float
    clock: float = 0.0
    repeats: float | None = None

    @property
    def total(self) -> float:
        """The floor, RMS, m or rad.

        The difference from run to run is that of the repeats where there are any. Otherwise it is that from
        cycle to cycle, and that by the start pose.
        """
        within = self.noise if self.spread is None else max(self.noise, self.spread)
        run = math.hypot(within, self.start_pose) if self.repeats is None else max(within, self.repeats)
        return math.hypot(run, self.numerics, self.clock)


Floors = Mapping[str, Floor]
"""Floor of each signal of a trial."""


def marker_floor(floors: Floors) -> float:
    """Return the floor of the marker's distance, over the measured axes, m."""
    return math.sqrt(sum(floor.total**2 for name, floor in floors.items() if is_position(name)))


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
    halved = working.model_copy(update={"timestep_s": 0.5 * working.timestep_s})
    poses = Simulator.build(simulator.problem, _start_poses(simulator, seed, settings), working)
    robots = [(_nominal_at(simulator, halved), 0), *((poses, i) for i in range(settings.start_poses))]
    finer, *perturbed = predict_each(robots, [aligned.trial for aligned in trials], executor)
    horizon = simulator.problem.simulation.horizon
    floors: list[Floors] = []
    for index, aligned in enumerate(trials):
        halving = _change(aligned, [finer[index]])
        start_pose = _change(aligned, [row[index] for row in perturbed])
        repeats = _repeats(aligned, trials)
        transient = steady_from(horizon, aligned.trial.drive)
        floors.append(
            {
                name: Floor(
                    _noise(aligned.trial, name),
                    cycle_spread(aligned, name, transient),
                    start_pose[name],
                    settings.halved * halving[name],
                    _clock(aligned, name),
                    repeats.get(name),
                )
                for name in aligned.trial.signals
            }
        )
    return floors


def _nominal_at(simulator: Simulator, fidelity: Fidelity) -> Simulator:
    """Return the nominal robot at another fidelity."""
    return replace(simulator, scenarios=(NOMINAL,), models=simulator.models[:1]).at(fidelity)


def _start_poses(simulator: Simulator, seed: int, settings: FloorSettings) -> tuple[Scenario, ...]:
    """Return scenarios with a start pose each, of the size that the problem's scenarios have."""
    size = simulator.problem.file.scenarios.start_pose_rad
    seeds = generator(seed, Stream.FLOOR_START_POSES).integers(2**31, size=settings.start_poses)
    return tuple(Scenario(start_pose_rad=size, pose_seed=int(number)) for number in seeds)


def _noise(trial: Trial, name: str) -> float:
    """Return the standard deviation of a signal's noise, m or rad."""
    if trial.noise_m is not None and is_position(name):
        return trial.noise_m
    return noise_of(trial.signals[name][trial.used[name]])


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
    """Return the standard deviation of each signal over the trials of one drive, at this trial's times."""
    key = aligned.trial.drive.key
    family = [other for other in trials if other.trial.drive.key == key]
    spreads = {}
    for name in aligned.trial.signals:
        rows = [_residual_at(other, name, aligned.time) for other in family if name in other.residual]
        if len(rows) < 2:
            continue
        together = np.where(aligned.trial.used[name], np.stack(rows), np.nan)
        together = together[:, np.isfinite(together).all(axis=0)]
        if together.shape[1]:
            together = together - together.mean(axis=1, keepdims=True)
            spreads[name] = float(np.sqrt(together.var(axis=0, ddof=1).mean()))
    return spreads


def _residual_at(aligned: Aligned, name: str, time: Series) -> Series:
    """Return a residual at other gait times, m or rad; NaN outside its recording."""
    keep = np.isfinite(aligned.residual[name])
    own, residual = aligned.time[keep], aligned.residual[name][keep]
    moved: Series = np.interp(time, own, residual, left=np.nan, right=np.nan)
    return moved
