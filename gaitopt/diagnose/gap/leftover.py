"""What the fitted components leave of a gap under commands without a period, divided by time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.gap.settings import CommandSplitSettings
from gaitopt.diagnose.record.trial import Flags, Series
from gaitopt.gait.drive import Drive
from gaitopt.robot.signals import is_position
from gaitopt.robot.trajectory import Trajectory

TopSpeeds = Mapping[str, tuple[float, float]]
"""Largest speed of each signal in some trials, measured and simulated, m/s or rad/s."""


def top_speeds(trials: Sequence[Aligned]) -> TopSpeeds:
    """Return the largest speed of each signal in some trials, measured and simulated, m/s or rad/s.

    Args:
        trials: the trials aligned with their predictions.
    """
    found: dict[str, tuple[float, float]] = {}
    for aligned in trials:
        for name in aligned.trial.signals:
            before = found.get(name, (0.0, 0.0))
            measured, simulated = (float(np.abs(v).max(initial=0.0)) for v in _velocities(aligned, name))
            found[name] = max(before[0], measured), max(before[1], simulated)
    return found


def _velocities(aligned: Aligned, signal: str) -> tuple[Series, Series]:
    """Return the velocity of a signal at the samples that count, measured and simulated, shape (n,).

    Each is taken over two frames.
    """
    counts = np.isfinite(aligned.residual[signal])
    time, frame = aligned.time[counts], aligned.trial.frame_s
    curves = aligned.trial.signals[signal][counts], aligned.predicted[signal][counts]
    measured, simulated = (
        (np.interp(time + frame, time, curve) - np.interp(time - frame, time, curve)) / (2.0 * frame)
        for curve in curves
    )
    return measured, simulated


def shares_by_time(
    aligned: Aligned, signal: str, residual: Series, limit: Flags, settings: CommandSplitSettings
) -> dict[str, float]:
    """Return the share of what is left that belongs to each component; the shares add up to 1 or are all 0.

    Args:
        aligned: the trial aligned with its prediction.
        signal: the signal.
        residual: what is left at each sample that counts, m or rad, shape (n,).
        limit: which of them are at the limit of the motion, shape (n,); see `at_limit`.
        settings: see `CommandSplitSettings`.
    """
    counts = np.isfinite(aligned.residual[signal])
    commanded = _Commanded.of(aligned, aligned.time[counts])
    after = commanded.soon_after_jump(settings.settle_s) & ~limit
    rest = ~limit & ~after
    slow = _smooth(residual, commanded.frame_s, settings)
    fast = residual - slow
    is_smooth = commanded.is_smooth(fast, settings)
    squares = {
        "saturation": float((residual[limit] ** 2).sum()),
        "overshoot": float((residual[after] ** 2).sum()),
    }
    parts = {
        "drift": float((slow[rest] ** 2).sum()),
        "stick_slip": float((fast[rest & is_smooth] ** 2).sum()),
        "overshoot": float((fast[rest & ~is_smooth] ** 2).sum()),
    }
    # Slow and fast part overlap a little, so both are scaled by the same factor.
    scale = float((residual[rest] ** 2).sum()) / (sum(parts.values()) or 1.0)
    for name, square in parts.items():
        squares[name] = squares.get(name, 0.0) + scale * square
    total = sum(squares.values()) or 1.0
    return {name: square / total for name, square in squares.items()}


@dataclass(frozen=True)
class _Commanded:
    """The commands of a trial at its samples.

    Attributes:
        time: gait time of each sample, s, shape (n,).
        frame_s: time between two samples, s.
        targets: rad, shape (n, nu); NaN where a servo is unpowered.
        jumps: gait times at which a command jumps, s, shape (jumps,).
    """

    time: Series
    frame_s: float
    targets: Series
    jumps: Series

    @staticmethod
    def of(aligned: Aligned, time: Series) -> _Commanded:
        """Return the commands at some gait times of a trial."""
        drive, frame = aligned.trial.drive, aligned.trial.frame_s
        clock = np.arange(time[0] - 1.0, time[-1] + 0.5 * frame, frame)
        found = clock[jumps(drive.targets(clock))]
        if starts_with_jump(drive, aligned.simulated):
            found = np.sort(np.append(found, 0.0))
        return _Commanded(time, frame, drive.targets(time), found)

    def soon_after_jump(self, within_s: float) -> Flags:
        """Return which samples come within a time after a jump, shape (n,)."""
        last = np.searchsorted(self.jumps, self.time, side="right") - 1
        before = np.concatenate([self.jumps, [-np.inf]])[last]
        soon: Flags = self.time - before <= within_s
        return soon

    def is_smooth(self, fast: Series, settings: CommandSplitSettings) -> Flags:
        """Return where no command moves as fast as the fast part of a residual does, shape (n,)."""
        smooth = np.ones(len(fast), dtype=bool)
        scale = _local_rms(fast, self.frame_s, settings)
        for column in np.nan_to_num(self.targets).T:
            quick = column - _smooth(column, self.frame_s, settings)
            smooth &= _local_rms(quick, self.frame_s, settings) <= scale
        return smooth


def jumps(targets: Series) -> Flags:
    """Return where a command jumps: far beyond what is usual between the rows around, shape (n,).

    Power that is cut or comes back is a jump too.

    Args:
        targets: commands at even times, rad, shape (n, nu); NaN where a servo is unpowered.
    """
    found = np.zeros(len(targets), dtype=bool)
    for column in targets.T:
        powered = np.isfinite(column)
        step = np.abs(np.diff(np.nan_to_num(column), prepend=np.nan_to_num(column[:1])))
        around = np.stack([np.roll(step, shift) for shift in (-3, -2, -1, 1, 2, 3)])
        found |= step > np.maximum(3.0 * np.median(around, axis=0), 1e-9)
        found |= powered != np.concatenate([powered[:1], powered[:-1]])
    return found


def starts_with_jump(drive: Drive, simulated: Trajectory) -> bool:
    """Return whether a drive's first command is far from where a servo starts.

    Args:
        drive: the commands.
        simulated: a simulation of them, from gait time 0 on.
    """
    targets = drive.targets(simulated.time)
    for index, channel in enumerate(simulated.named("target")):
        position = simulated.signals.get(f"position.{channel}")
        if position is not None and np.isfinite(targets[0, index]):
            start = float(position[0])
            reach = float(np.nanmax(np.abs(targets[:, index] - start)))
            if abs(float(targets[0, index]) - start) > 0.1 * reach:
                return True
    return False


def at_limit(
    aligned: Aligned, signal: str, speeds: tuple[float, float], settings: CommandSplitSettings
) -> Flags:
    """Return where the measured or the simulated motion is at its limit, of the samples that count.

    There the command is further away than the motion comes in `settings.ahead_s` at its top speed. Or the
    motion is nearly as quick as in any trial, and the command is further ahead than it comes in that time.
    A trial whose command is never clearly quicker than the motion can be has no such samples.

    Args:
        aligned: the trial aligned with its prediction.
        signal: the signal.
        speeds: its largest measured and simulated speed in all trials, m/s or rad/s.
        settings: see `CommandSplitSettings`.
    """
    counts = np.isfinite(aligned.residual[signal])
    channel = channel_of(aligned.simulated, signal)
    found = np.zeros(int(counts.sum()), dtype=bool)
    if channel is None:
        return found
    target = aligned.trial.drive.targets(aligned.time[counts])[:, channel]
    asked = _farthest(aligned, signal, channel, settings.ahead_s)
    curves = aligned.trial.signals[signal][counts], aligned.predicted[signal][counts]
    for curve, velocity, top in zip(curves, _velocities(aligned, signal), speeds, strict=True):
        if top == 0.0 or asked < settings.asked * top * settings.ahead_s:
            continue
        speed, ahead = np.abs(velocity), (target - curve) * np.sign(velocity)
        quick = (speed > 0.0) & (speed >= settings.near_top * top)
        found |= quick & (ahead >= settings.ahead_s * speed)
        found |= np.abs(target - curve) >= settings.ahead_s * top
    return found


def _farthest(aligned: Aligned, signal: str, channel: int, within_s: float) -> float:
    """Return how far a command goes within a time, its start from the joint's start included, rad."""
    drive, frame = aligned.trial.drive, aligned.trial.frame_s
    clock = np.arange(0.0, aligned.time[-1] + 0.5 * frame, frame)
    rows = max(1, round(within_s / frame))
    start = np.full(rows, aligned.simulated[signal][0])
    column = np.concatenate([start, drive.targets(clock)[:, channel]])
    moved = np.abs(column[rows:] - column[:-rows])
    return float(np.nan_to_num(moved).max(initial=0.0))


def channel_of(simulated: Trajectory, signal: str) -> int | None:
    """Return the index of the channel whose servo turns a joint; None for other signals.

    Args:
        simulated: a simulation of the robot.
        signal: name of the signal.
    """
    if is_position(signal):
        return None
    positions = simulated.named("position")
    for index, channel in enumerate(simulated.named("target")):
        if channel in positions and np.array_equal(positions[channel], simulated[signal]):
            return index
    return None


def _window(count: int, frame_s: float, settings: CommandSplitSettings) -> int:
    """Return the length of the smoothing window, samples: odd, and no longer than the record."""
    longest = count - 1 + count % 2
    return min(longest, 2 * round(0.5 * settings.slow_s / frame_s) + 1)


def _smooth(series: Series, frame_s: float, settings: CommandSplitSettings) -> Series:
    """Return the slow part of a series: parabolas through the samples around, shape (n,)."""
    window = _window(len(series), frame_s, settings)
    if window < 5:
        return np.full(len(series), series.mean())
    slow: Series = savgol_filter(series, window, 2)
    return slow


def _local_rms(series: Series, frame_s: float, settings: CommandSplitSettings) -> Series:
    """Return the RMS of a series over the samples around each, shape (n,)."""
    window = _window(len(series), frame_s, settings)
    ones = np.ones(window)
    sums = np.convolve(series**2, ones, mode="same")
    rms: Series = np.sqrt(sums / np.convolve(np.ones(len(series)), ones, mode="same"))
    return rms
