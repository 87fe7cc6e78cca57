"""How well a recording of a gait is expected to separate the candidates."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.streams import seeded
from gaitopt.diagnose.gap.align import square_apart
from gaitopt.diagnose.gap.predict import Run, predict_runs
from gaitopt.diagnose.judge.evidence import probabilities
from gaitopt.diagnose.judge.settings import EXPERIMENT, ExperimentSettings
from gaitopt.gait.drive import Drive
from gaitopt.robot.signals import is_position
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]
D = TypeVar("D", bound=Drive)

_DRAWS = 200
"""Outcomes of a recording that are tried for what it is worth, for each candidate."""

FORWARD = "marker.x"
"""Signal that grows as the robot goes forward."""


@dataclass(frozen=True)
class GaitScore(Generic[D]):
    """How well a recording of a gait, or of another drive, is expected to separate the candidates.

    Attributes:
        gait: the gait.
        squares: squared difference of each two candidates, in floors, summed over the signals, shape
            (candidates, candidates).
        n_signals: number of signals.
        names: effects of each candidate.
        prior: probability of each candidate before the recording, shape (candidates,).
        speeds: speed forward of each candidate, m/s, shape (candidates,); None where none is measured.
    """

    gait: D
    squares: Array
    n_signals: int
    names: tuple[str, ...]
    prior: Array
    speeds: Array | None = None

    @property
    def differences(self) -> Array:
        """RMS difference of each two candidates, in floors, shape (candidates, candidates)."""
        root: Array = np.sqrt(self.squares / self.n_signals)
        return root

    @property
    def separation(self) -> float:
        """RMS difference of the first from those with other effects, in floors, weighted by probability."""
        others = self._others[0] * self.prior
        return float(np.sqrt(others @ self.squares[0] / others.sum() / self.n_signals))

    @cached_property
    def wrong(self) -> float:
        """Expected probability of wrong effects after the recording, a floor being one standard error."""
        after = np.array([probabilities(np.log(self.prior) - 0.5 * row) for row in self.squares])
        return float(self.prior @ np.sum(after * self._others, axis=1))

    def worth_among(self, scores: Sequence[GaitScore[Any]]) -> float | None:
        """Return how much faster the best gait is expected to be, if it is chosen after the recording, m/s.

        It is the value of information (Raiffa and Schlaifer, 1961): the expected speed of the gait that is
        the fastest by what is known after the recording, less that of the gait that is the fastest now.

        Args:
            scores: the gaits to choose among.
        """
        known = [score.speeds for score in scores if score.speeds is not None]
        if not known:
            return None
        speeds = np.array(known)
        now = float(np.max(speeds @ self.prior))
        places = _places(self.squares)
        errors = seeded(0).standard_normal((_DRAWS, places.shape[1]))
        best = [
            np.max(speeds @ probabilities(np.log(self.prior) - 0.5 * np.sum((seen - places) ** 2, axis=1)))
            for place in places
            for seen in place + errors
        ]
        later = float(self.prior @ np.reshape(best, (len(places), _DRAWS)).mean(axis=1))
        return max(0.0, later - now)

    @property
    def _others(self) -> Array:
        """1 for each candidate, in columns, that has other effects than the one in the row; else 0."""
        names = np.array(self.names)
        other: Array = (names[:, None] != names[None, :]).astype(float)
        return other


@dataclass(frozen=True)
class GaitScorer:
    """Predicts how well recordings of gaits would separate the candidates.

    Attributes:
        robots: the robot of each candidate.
        perturbed: robots perturbed about the leading candidates, each with its candidate's index. Robots
            perturbed about the nominal one would promise more of fast gaits than the diagnosis then finds.
        names: effects of each candidate.
        prior: probability of each candidate, shape (candidates,).
        signals: what is measured.
        executor: where gaits are simulated.
        settings: length and noise of a recording.
    """

    robots: Sequence[Simulator]
    perturbed: Sequence[tuple[int, Simulator]]
    names: tuple[str, ...]
    prior: Array
    signals: tuple[str, ...]
    executor: Executor
    settings: ExperimentSettings = EXPERIMENT

    def score(self, gaits: Sequence[D]) -> list[GaitScore[D]]:
        """Return the score of each gait; gaits that fail on one of the robots are left out."""
        every = [*self.robots, *(robot for _, robot in self.perturbed)]
        futures = [
            [self.executor.submit(predict_runs, robot, [self._run(gait)], self.signals) for robot in every]
            for gait in gaits
        ]
        scores = []
        for gait, row in zip(gaits, futures, strict=True):
            paths = [path for future in row for path in future.result()]
            if all(path.status == "ok" for path in paths):
                scores.append(self._score(gait, paths))
        return scores

    def _run(self, drive: Drive) -> Run:
        return Run(drive, max(self.settings.seconds, 2.0 * drive.block_s))

    def _score(self, gait: D, paths: Sequence[Trajectory]) -> GaitScore[D]:
        count, settings = len(self.robots), self.settings
        candidates = paths[:count]
        pairs = zip(self.perturbed, paths[count:], strict=True)
        perturbed = [(candidates[index], path) for (index, _), path in pairs]
        squares = np.zeros((count, count))
        for signal in self.signals:
            noise = settings.noise_m if is_position(signal) else settings.angle_noise_rad
            unknown = np.mean([square_apart(centre, path, signal) for centre, path in perturbed])
            floor = noise**2 + settings.caution * unknown
            for i, one in enumerate(candidates):
                for j, other in enumerate(candidates[:i]):
                    squares[i, j] += square_apart(one, other, signal) / floor
        speeds = np.array([_speed(path) for path in candidates]) if FORWARD in self.signals else None
        return GaitScore(gait, squares + squares.T, len(self.signals), self.names, self.prior, speeds)


def _places(squares: Array) -> Array:
    """Return points with given squared distances (classical scaling, Torgerson, 1952), shape (n, n)."""
    centring = np.eye(len(squares)) - 1.0 / len(squares)
    sizes, axes = np.linalg.eigh(-0.5 * centring @ squares @ centring)
    places: Array = axes * np.sqrt(np.maximum(sizes, 0.0))
    return places


def _speed(path: Trajectory) -> float:
    """Return the mean speed along x over the second half of a recording, m/s."""
    half = len(path.time) // 2
    return float((path[FORWARD][-1] - path[FORWARD][half]) / (path.time[-1] - path.time[half]))
