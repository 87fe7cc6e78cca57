"""The cache of a diagnosis: its simulations, on disk, so that an interrupted one can continue."""

from __future__ import annotations

import hashlib
import shutil
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import write_with
from gaitopt.core.versions import versions_text
from gaitopt.diagnose.record.dataset import DataSet
from gaitopt.problem.model import carrying, content_of
from gaitopt.simulation.rollout import Simulator

_PREFIX = "simulated-"
"""How the name of a cache begins."""

Arrays = Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True)
class SimulationCache:
    """Results by name, each in a file that is complete or absent.

    Attributes:
        folder: folder of the files; made with the first one.
    """

    folder: Path

    @staticmethod
    def of(
        folder: Path, simulator: Simulator, dataset: DataSet, seed: int, settings: object = None
    ) -> SimulationCache:
        """Return the cache, in a folder, that all diagnoses with the same simulations share.

        Args:
            folder: the run folder.
            simulator: the nominal robot.
            dataset: the trials.
            seed: seed of the perturbed robots.
            settings: tuning constants of the diagnosis, where they are not the default ones.
        """
        content = content_of(carrying(simulator.problem))
        said: tuple[object, ...] = (versions_text(), *content, simulator.fidelity, seed)
        said += () if settings is None else (settings,)
        digest = hashlib.sha256(repr(said).encode())
        for trial in dataset.trials:
            entry = (
                trial.name,
                trial.drive.key,
                trial.starts_at_s,
                trial.noise_m,
                trial.fps,
                list(trial.signals),
            )
            digest.update(repr(entry).encode())
            for series in (trial.time, *trial.signals.values()):
                digest.update(series.tobytes())
        return SimulationCache(folder / f"{_PREFIX}{digest.hexdigest()[:16]}")

    @staticmethod
    def is_in(folder: Path) -> bool:
        """Return whether a folder holds any cache."""
        return any(folder.glob(f"{_PREFIX}*"))

    @staticmethod
    def clear_in(folder: Path) -> None:
        """Remove every cache in a folder."""
        for path in folder.glob(f"{_PREFIX}*"):
            shutil.rmtree(path, ignore_errors=True)

    def keep(self) -> None:
        """Make its folder, though nothing may be in it: what is left to do there is found by it.

        Raises:
            GaitoptError: it cannot be made.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise GaitoptError(f"{self.folder}: cannot be made: {error.strerror}") from None

    @property
    def count(self) -> int:
        """Number of results."""
        return sum(1 for _ in self.folder.glob("[0-9a-f]*.npz"))

    def read(self, name: str) -> dict[str, NDArray[np.float64]] | None:
        """Return a result, or None where there is none that can be read."""
        try:
            with np.load(self._path(name)) as arrays:
                return dict(arrays)
        except (OSError, ValueError, EOFError, zipfile.BadZipFile):
            return None

    def write(self, name: str, arrays: Arrays) -> None:
        """Write a result.

        Raises:
            GaitoptError: it cannot be written.
        """
        self.keep()
        write_with(self._path(name), lambda path: np.savez(path, allow_pickle=False, **arrays))

    def clear(self) -> None:
        """Remove all results."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _path(self, name: str) -> Path:
        return self.folder / f"{hashlib.sha256(name.encode()).hexdigest()[:32]}.npz"
