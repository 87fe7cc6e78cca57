"""The covariance of a trial's bins: why even a correct model does not fit them exactly."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.bins import Bins
from gaitopt.diagnose.fit.settings import WhiteningSettings
from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.gap.floor import Floors
from gaitopt.robot.signals import is_position

Array = NDArray[np.float64]


def robot_covariance(aligned: Aligned, bins: Bins, changes: Array, settings: WhiteningSettings) -> Array:
    """Return the covariance from small errors of the robot, with a smooth remainder of similar size.

    Args:
        aligned: the trial.
        bins: its bins.
        changes: change of each row with each perturbed robot, m and rad, shape (robots, n).
        settings: size and length of the remainder.

    Returns:
        Covariance, m² and rad², shape (n, n).
    """
    time = bins.time
    covariance: Array = settings.inflation * changes.T @ changes / len(changes)
    lag = np.abs(time[:, None] - time[None, :]) / aligned.trial.drive.block_s
    smooth = np.exp(-0.5 * (lag / settings.remainder_blocks) ** 2)
    begin = min(float(time[0]), 0.0)
    elapsed = (time - begin) / max(float(time[-1]) - begin, 1e-9)
    wander = np.minimum(elapsed[:, None], elapsed[None, :])
    for index, name in enumerate(aligned.trial.signals):
        own = bins.signal == index
        block = np.ix_(own, own)
        of_signal = changes[:, own]
        if is_position(name):
            of_signal = of_signal - of_signal.mean(axis=1, keepdims=True)
        size = float(np.mean(of_signal**2))
        shape = smooth[block] + settings.remainder_wander * wander[block]
        covariance[block] += settings.remainder**2 * size * shape
    return covariance


def measurement_covariance(
    aligned: Aligned, floors: Floors, bins: Bins, nominal: Array, settings: WhiteningSettings
) -> Array:
    """Return the covariance from noise, cycles that differ, the marker's free origin and a rounded clock.

    Args:
        aligned: the trial aligned with its nominal prediction.
        floors: floor of each signal.
        bins: the trial's bins.
        nominal: nominal prediction of each row, m or rad, shape (n,).
        settings: sizes and lengths.

    Returns:
        Covariance, m² and rad², shape (n, n).
    """
    time, counts = bins.time, bins.counts
    covariance = np.zeros((len(counts), len(counts)))
    block_s = aligned.trial.drive.block_s
    within = np.exp(-np.abs(time[:, None] - time[None, :]) / block_s / settings.spread_blocks)
    for index, name in enumerate(aligned.trial.signals):
        own = bins.signal == index
        block, floor = np.ix_(own, own), floors[name]
        if floor.spread is not None:
            covariance[block] += max(0.0, floor.spread**2 - floor.noise**2) * within[block]
        if is_position(name):
            covariance[block] += settings.origin_m**2
        diagonal = np.flatnonzero(own)
        least = settings.least_marker_m if is_position(name) else settings.least_angle_rad
        covariance[diagonal, diagonal] += floor.noise**2 / counts[own] + least**2
    clock_s = aligned.trial.clock_s
    if aligned.trial.has_log:
        clock_s = math.hypot(clock_s, settings.least_clock_s)
    if clock_s > 0.0:
        late = bins.means(aligned.simulated, aligned.offset_s + clock_s)
        covariance += np.outer(late - nominal, late - nominal)
    return covariance
