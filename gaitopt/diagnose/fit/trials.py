"""The trials of a data set together: whitened rows, blocks of rows, and the folds that are held out in turn.

A block is a cycle of a trial, or a part of a trial without cycles. Losses are kept by block, so that a gait
can be left out and cycles resampled without another simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from gaitopt.diagnose.fit.products import RowBlocks
from gaitopt.diagnose.fit.residual import WhitenedTrial
from gaitopt.diagnose.gap.predict import Run, runs_of
from gaitopt.problem.problem import Problem
from gaitopt.robot.signals import is_position
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_FOLDS = 4
"""Folds of blocks, where there is one trial only."""


@dataclass(frozen=True)
class Comparison:
    """All trials compared with one robot.

    Attributes:
        at: coordinates of the robot's parameters, shape (number of effects,).
        whitened: whitened residual of all trials, shape (rows,).
        marker: residual of each sample of the marker, m, shape (samples,).
        angles: residual of each sample of the angles, rad, shape (samples,).
    """

    at: Array
    whitened: Array
    marker: Array
    angles: Array


@dataclass(frozen=True)
class TrialSet:
    """The trials of a data set, ready to be compared with robots.

    Attributes:
        simulator: the nominal robot.
        trials: the trials.
        nominal: nominal trajectories of the trials.
        row_blocks: block of each row, from 0, shape (rows,).
        block_trials: trial of each block, shape (blocks,).
        sample_trials: trial of each sample of the marker, shape (samples,).
        sample_blocks: block of each sample of the marker, shape (samples,).
        angle_blocks: block of each sample of the angles, shape (samples,).
        folds: blocks of each fold that is held out in turn.
        updates: whitening update of each trial for a later covariance; empty for the first one.
        label: what the names of its comparisons in a cache begin with: others have another first covariance.
    """

    simulator: Simulator
    trials: tuple[WhitenedTrial, ...]
    nominal: tuple[Trajectory, ...]
    row_blocks: Indices
    block_trials: Indices
    sample_trials: Indices
    sample_blocks: Indices
    angle_blocks: Indices
    folds: tuple[Indices, ...]
    updates: tuple[Array, ...] = ()
    label: str = ""

    @staticmethod
    def of(simulator: Simulator, trials: Sequence[WhitenedTrial], nominal: Sequence[Trajectory]) -> TrialSet:
        """Return the trials with their blocks and folds.

        A fold is a gait; with one gait it is a trial; with one trial it is a part of the cycles.
        """
        row_blocks: list[Indices] = []
        block_trials: list[int] = []
        sample_trials: list[int] = []
        sample_blocks: list[int] = []
        angle_blocks: list[int] = []
        first = 0
        for index, one in enumerate(trials):
            present, numbers = np.unique(one.bins.blocks, return_inverse=True)
            row_blocks.append(first + numbers)
            block_trials += [index] * len(present)
            for name, rows in one.bins.rows.items():
                blocks = (first + numbers[rows]).tolist()
                if is_position(name):
                    sample_trials += [index] * len(rows)
                    sample_blocks += blocks
                else:
                    angle_blocks += blocks
            first += len(present)
        of_blocks = np.array(block_trials)
        return TrialSet(
            simulator,
            tuple(trials),
            tuple(nominal),
            np.concatenate(row_blocks),
            of_blocks,
            np.array(sample_trials, dtype=np.intp),
            np.array(sample_blocks, dtype=np.intp),
            np.array(angle_blocks, dtype=np.intp),
            _folds(trials, of_blocks),
        )

    @property
    def problem(self) -> Problem:
        """The nominal problem."""
        return self.simulator.problem

    @cached_property
    def runs(self) -> dict[str, Run]:
        """What a robot has to do to be compared with them, by the drive's key."""
        return runs_of([one.aligned.trial for one in self.trials], [one.latest_s for one in self.trials])

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return len(self.block_trials)

    @property
    def n_trials(self) -> int:
        """Number of trials."""
        return int(self.block_trials[-1]) + 1

    @cached_property
    def rows(self) -> RowBlocks:
        """The block of each row, and the trial of each block."""
        return RowBlocks(self.row_blocks, self.block_trials)

    @cached_property
    def rows_per_block(self) -> Array:
        """Number of rows of each block, shape (blocks,)."""
        counts: Array = np.bincount(self.row_blocks, minlength=self.n_blocks).astype(float)
        return counts

    @cached_property
    def row_trials(self) -> Indices:
        """Trial of each row, from 0, shape (rows,)."""
        trials: Indices = self.block_trials[self.row_blocks]
        return trials

    @cached_property
    def motions(self) -> Array:
        """Mean square of the whitened motion of each trial about its mean, shape (trials,)."""
        return np.array([one.motion for one in self.trials])

    @cached_property
    def per_error(self) -> Array:
        """Mean whitened square of a smooth error of 1 rad in each trial, shape (trials,)."""
        return np.array([one.per_error for one in self.trials])

    @property
    def fold_weights(self) -> list[tuple[Indices, Array]]:
        """Each fold with the weights of the blocks that its fit may use, shape (blocks,)."""
        pairs = []
        for fold in self.folds:
            weights = np.ones(self.n_blocks)
            weights[fold] = 0.0
            pairs.append((fold, weights))
        return pairs

    def products(self, one: Array, other: Array) -> Array:
        """Return the inner product of two whitened residuals, block by block, shape (blocks,)."""
        return self.rows.sums(one * other)

    def losses(self, whitened: Array) -> Array:
        """Return the loss of each block: the sum of its squared whitened residuals, shape (blocks,)."""
        return self.products(whitened, whitened)

    def by_trial(self, of_blocks: Array) -> Array:
        """Return the sum of a value of each block over each trial, shape (trials,)."""
        return self.rows.by_trial(of_blocks)

    def mean_squares(self, whitened: Array) -> Array:
        """Return the mean whitened square of each trial, shape (trials,)."""
        means: Array = self.by_trial(self.losses(whitened)) / self.by_trial(self.rows_per_block)
        return means

    def compare(self, at: Sequence[float], trajectories: Sequence[Trajectory]) -> Comparison | None:
        """Return the trials compared with predictions, whitened by the first covariance; None where one
        failed.

        Args:
            at: coordinates to keep with the result.
            trajectories: prediction of each trial.
        """
        found = []
        for one, trajectory in zip(self.trials, trajectories, strict=True):
            residuals = one.compare(trajectory)
            if residuals is None or not np.isfinite(residuals.whitened).all():
                return None
            found.append(residuals)
        return Comparison(
            np.array(at, dtype=float),
            np.concatenate([one.whitened for one in found]),
            np.concatenate([one.marker for one in found]),
            np.concatenate([one.angles for one in found]),
        )

    @property
    def initial(self) -> TrialSet:
        """The trials with their first covariance."""
        return replace(self, updates=())

    def head(self, seconds: float) -> TrialSet:
        """Return the beginnings of the trials, each as long as this or as one block, s."""
        heads = TrialSet.of(self.simulator, [one.head(seconds) for one in self.trials], self.nominal)
        sizes = [one.n_rows for one in heads.trials]
        updates = tuple(update[:n, :n] for update, n in zip(self.updates, sizes, strict=False))
        return replace(heads, updates=updates, label=f"{self.label}head of {seconds} s ")

    def with_covariance_of(self, changes: Array) -> TrialSet:
        """Return the trials with the covariance from some perturbed robots.

        Args:
            changes: changes with these robots, whitened by the first covariance, shape (robots, rows).
        """
        parts = zip(self.trials, np.split(changes, self._ends, axis=1), strict=True)
        return replace(self, updates=tuple(trial.whitening_update(part) for trial, part in parts))

    def with_errors_along(self, columns: Sequence[Array], label: str) -> TrialSet:
        """Return the trials with a first covariance that has further errors.

        Args:
            columns: for each trial, responses whose sizes are unknown with a standard deviation of 1, m and
                rad, shape (rows of the trial, k).
            label: a name for this covariance.
        """
        pairs = zip(self.trials, columns, strict=True)
        trials = tuple(trial.with_errors_along(own) for trial, own in pairs)
        return replace(self, trials=trials, updates=(), label=f"{label} ")

    def whiten(self, index: int, rows: Array) -> Array:
        """Return rows of one trial, or columns of rows, whitened."""
        whitened: Array = self.trials[index].whitener @ rows
        return self.updates[index] @ whitened if self.updates else whitened

    def rewhiten_rows(self, rows: Array, before: TrialSet) -> Array:
        """Return rows, or columns of rows, that the same trials have whitened by another covariance."""
        parts = self.split(rows)
        if before.updates:
            undone = zip(before.updates, parts, strict=True)
            parts = [solve_triangular(update, part, lower=True) for update, part in undone]
        if self.updates:
            parts = [update @ part for update, part in zip(self.updates, parts, strict=True)]
        return np.concatenate(parts)

    def rewhiten(self, comparison: Comparison, before: TrialSet) -> Comparison:
        """Return a comparison that the same trials have whitened by another covariance."""
        return replace(comparison, whitened=self.rewhiten_rows(comparison.whitened, before))

    def split(self, rows: Array) -> list[Array]:
        """Return rows of all trials, or columns of rows, trial by trial."""
        return np.split(rows, self._ends)

    @property
    def _ends(self) -> Array:
        ends: Array = np.cumsum([trial.n_rows for trial in self.trials])[:-1]
        return ends


def _folds(trials: Sequence[WhitenedTrial], block_trials: Indices) -> tuple[Indices, ...]:
    keys = [one.aligned.trial.drive.key for one in trials]
    groups = keys if len(set(keys)) > 1 else [str(i) for i in range(len(trials))]
    names = np.array(groups)[block_trials]
    if len(set(groups)) > 1:
        return tuple(np.flatnonzero(names == name) for name in dict.fromkeys(groups))
    parts = np.array_split(np.arange(len(block_trials)), min(_FOLDS, len(block_trials)))
    return tuple(part for part in parts if len(part))
