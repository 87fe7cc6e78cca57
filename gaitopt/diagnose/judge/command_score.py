"""How far alternatives are apart on commands that are played on a bench."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.gap.align import square_apart
from gaitopt.diagnose.gap.predict import Run, predict_runs
from gaitopt.diagnose.judge.command_settings import COMMANDS, CommandSettings
from gaitopt.diagnose.judge.evidence import probabilities
from gaitopt.gait.drive import Drive
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Separation:
    """How far alternatives are apart on some commands.

    Attributes:
        distances: RMS difference of each two alternatives, in floors, shape (alternatives, alternatives).
        prior: probability of each alternative before, shape (alternatives,).
        others: whether the alternative in the column is another explanation than that in the row, shape
            (alternatives, alternatives).
    """

    distances: Array
    prior: Array
    others: NDArray[np.bool_]

    @property
    def mean(self) -> float:
        """Mean distance of two explanations, in floors, weighted by their probabilities."""
        weights = np.outer(self.prior, self.prior) * self.others
        total = float(weights.sum())
        return float((weights * self.distances).sum()) / total if total > 0.0 else 0.0

    @cached_property
    def doubt(self) -> float:
        """Expected probability of a wrong explanation after a recording, a floor being one standard error."""
        log_prior = np.log(np.maximum(self.prior, 1e-300))
        after = np.array([probabilities(log_prior - 0.5 * row**2) for row in self.distances])
        return float(self.prior @ np.sum(after * self.others, axis=1))


@dataclass(frozen=True)
class CommandScorer:
    """Predicts how far alternatives are apart.

    Attributes:
        robots: the robot of each alternative.
        perturbed: robots perturbed about some alternatives, each with the alternative's index.
        prior: probability of each, shape (alternatives,).
        others: as of `Separation`.
        floors: noise of each signal that is measured, m or rad.
        executor: where robots are simulated.
        settings: floor that grows with the motion, and how much work goes together.
    """

    robots: Sequence[Simulator]
    perturbed: Sequence[tuple[int, Simulator]]
    prior: Array
    others: NDArray[np.bool_]
    floors: Mapping[str, float]
    executor: Executor
    settings: CommandSettings = COMMANDS

    def separations(self, drives: Sequence[Drive]) -> list[Separation | None]:
        """Return how far the alternatives are apart on each drive; None where one cannot be simulated.

        Args:
            drives: what is commanded.
        """
        runs = [Run(drive, drive.duration_s or 2.0 * drive.block_s) for drive in drives]
        step, every = self.settings.together, [*self.robots, *(robot for _, robot in self.perturbed)]
        parts = [runs[begin : begin + step] for begin in range(0, len(runs), step)]
        signals = tuple(self.floors)
        futures = [
            [self.executor.submit(predict_runs, robot, part, signals) for robot in every] for part in parts
        ]
        found: list[Separation | None] = []
        for row in futures:
            by_robot = [future.result() for future in row]
            found += [self._separation(paths) for paths in zip(*by_robot, strict=True)]
        return found

    def _separation(self, paths: Sequence[Trajectory]) -> Separation | None:
        if any(path.status != "ok" for path in paths):
            return None
        count = len(self.robots)
        pairs = zip(self.perturbed, paths[count:], strict=True)
        perturbed = [(paths[index], path) for (index, _), path in pairs]
        squares = np.zeros((count, count))
        for signal in self.floors:
            variance = self._variance(signal, paths[:count], perturbed)
            for i, one in enumerate(paths[:count]):
                for j, other in enumerate(paths[:i]):
                    squares[i, j] += square_apart(one, other, signal) / variance
        distances = np.sqrt((squares + squares.T) / len(self.floors))
        return Separation(distances, self.prior, self.others)

    def _variance(
        self, signal: str, paths: Sequence[Trajectory], perturbed: Sequence[tuple[Trajectory, Trajectory]]
    ) -> float:
        """Return the square of a signal's floor: noise, a share of the motion, and what small errors do."""
        settings = self.settings
        moved = np.mean([path[signal].var() for path in paths])
        unknown = np.mean([square_apart(*pair, signal) for pair in perturbed]) if perturbed else 0.0
        return float(self.floors[signal] ** 2 + settings.motion_share**2 * moved + settings.caution * unknown)
