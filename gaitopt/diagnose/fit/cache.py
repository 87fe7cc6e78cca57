"""The cache of a diagnosis: its simulations, on disk, so that an interrupted one can continue."""

from __future__ import annotations

import hashlib
import io
import shutil
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import read_bytes, write_with
from gaitopt.core.own_files import check_own, make_own_folder
from gaitopt.core.versions import versions_text
from gaitopt.diagnose.record.dataset import DataSet
from gaitopt.problem.model import carrying, content_of
from gaitopt.simulation.rollout import Simulator

_PREFIX = "simulated-"
"""How the name of a cache begins."""

_UNREADABLE = (
    *(GaitoptError, OSError, ValueError, EOFError, KeyError, AttributeError),
    *(MemoryError, RecursionError, NotImplementedError, SyntaxError, zipfile.BadZipFile, zlib.error),
)
"""What reading a file raises that no diagnosis wrote: it is simulated again."""

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
            GaitoptError: there is a link or a file in its place, or it cannot be made.
        """
        make_own_folder(self.folder)

    @property
    def count(self) -> int:
        """Number of results."""
        return sum(1 for _ in self.folder.glob("[0-9a-f]*.npz"))

    def read(self, name: str) -> dict[str, NDArray[np.float64]] | None:
        """Return a result, or None where there is none that can be read."""
        path = self._path(name)
        try:
            return _unpacked(read_bytes(path)) if check_own(path) else None
        except _UNREADABLE:
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


def _unpacked(data: bytes) -> dict[str, NDArray[np.float64]]:
    """Return the arrays of a file that `write` has made.

    Raises:
        ValueError: a part of it is compressed, so that it may be much larger than the file, or is no vector
            of numbers. What is no archive at all raises other errors, too; see `_UNREADABLE`.
    """
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        if any(part.compress_type != zipfile.ZIP_STORED for part in archive.infolist()):
            raise ValueError("compressed")
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        unpacked = dict(arrays)
    if any(array.dtype != np.float64 or array.ndim != 1 for array in unpacked.values()):
        raise ValueError("no vector of numbers")
    return unpacked
