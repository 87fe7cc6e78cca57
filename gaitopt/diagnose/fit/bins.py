"""Bins: a trial's samples averaged over parts of a block, its signals side by side in order of time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from gaitopt.diagnose.fit.settings import WhiteningSettings
from gaitopt.diagnose.gap.align import Aligned
from gaitopt.robot.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Bins:
    """The rows of a trial: one for each signal in each bin that has samples.

    Attributes:
        rows: for each signal, the row of each sample that counts.
        sample_times: for each signal, the time of these samples on the recording's clock, s.
        counts: samples in each row, shape (n,).
        signal: signal of each row, by its number, shape (n,).
        time: gait time of the middle of each row's bin, s, shape (n,).
        blocks: block of each row, from 0, shape (n,).
        measured: mean of the measured samples of each row, m or rad, shape (n,).
    """

    rows: Mapping[str, NDArray[np.intp]]
    sample_times: Mapping[str, Array]
    counts: Array
    signal: NDArray[np.int_]
    time: Array
    blocks: NDArray[np.intp]
    measured: Array

    @staticmethod
    def of(aligned: Aligned, settings: WhiteningSettings) -> Bins:
        """Return the bins of a trial."""
        trial, block_s = aligned.trial, aligned.trial.drive.block_s
        span = float(aligned.time[-1] - aligned.time[0])
        width = max(block_s / settings.bins_per_block, trial.frame_s, span / settings.max_bins)
        bins = {name: np.floor(aligned.time[trial.used[name]] / width).astype(int) for name in trial.signals}
        keys = sorted({(int(b), i) for i, name in enumerate(bins) for b in np.unique(bins[name])})
        place = {key: row for row, key in enumerate(keys)}
        rows = {
            name: np.array([place[int(b), i] for b in bins[name]], dtype=np.intp)
            for i, name in enumerate(bins)
        }
        counts = np.sum([np.bincount(r, minlength=len(keys)) for r in rows.values()], axis=0).astype(float)
        sums = np.zeros(len(keys))
        for name, row in rows.items():
            sums = sums + np.bincount(row, trial.signals[name][trial.used[name]], len(keys))
        time = np.array([(b + 0.5) * width for b, _ in keys])
        first = int(np.floor(time[0] / block_s))
        blocks = np.floor(time / block_s).astype(np.intp) - first
        times = {name: trial.time[trial.used[name]] for name in rows}
        return Bins(rows, times, counts, np.array([i for _, i in keys]), time, blocks, sums / counts)

    def until(self, gait_time: float) -> Bins:
        """Return the rows of the bins whose middle comes before a gait time, s."""
        count = int(np.searchsorted(self.time, gait_time))
        kept = {name: int(np.searchsorted(row, count)) for name, row in self.rows.items()}
        return Bins(
            {name: row[: kept[name]] for name, row in self.rows.items()},
            {name: time[: kept[name]] for name, time in self.sample_times.items()},
            self.counts[:count],
            self.signal[:count],
            self.time[:count],
            self.blocks[:count],
            self.measured[:count],
        )

    def means(self, trajectory: Trajectory, offset: float) -> Array:
        """Return a prediction averaged over each row, m or rad, shape (n,).

        Args:
            trajectory: the prediction.
            offset: gait time at the recording's zero, s.
        """
        sums = np.zeros(len(self.counts))
        for name, row in self.rows.items():
            time = self.sample_times[name] + offset
            sums += np.bincount(row, np.interp(time, trajectory.time, trajectory[name]), len(self.counts))
        means: Array = sums / self.counts
        return means

    def averaging(self, signal: str, grid: Array, offset: float) -> csr_array:
        """Return the matrix that averages a signal over each row, as `means` does, shape (n, times).

        Args:
            signal: the signal.
            grid: gait times at which it is predicted, s, ascending, shape (times,).
            offset: gait time at the recording's zero, s.
        """
        row, time = self.rows[signal], np.clip(self.sample_times[signal] + offset, grid[0], grid[-1])
        left = np.clip(np.searchsorted(grid, time, side="right") - 1, 0, len(grid) - 2)
        share = (time - grid[left]) / (grid[left + 1] - grid[left])
        weights = np.concatenate([1.0 - share, share]) / np.tile(self.counts[row], 2)
        places = (np.tile(row, 2), np.concatenate([left, left + 1]))
        return csr_array((weights, places), shape=(len(self.counts), len(grid)))
