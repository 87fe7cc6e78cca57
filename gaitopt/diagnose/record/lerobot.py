"""LeRobot data sets: a folder with ``meta/info.json`` and tables of episodes in Parquet files.

The layouts of versions 2 and 3 are read: ``data/chunk-000/episode_000000.parquet`` holds one episode, and
``data/chunk-000/file-000.parquet`` several. In a row, ``action`` is what was commanded, and
``observation.state`` what was measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from gaitopt.core.errors import GaitoptError, found
from gaitopt.core.files import found_inside, inside, read_json
from gaitopt.core.validation import Name, validated
from gaitopt.diagnose.record.defect import counted
from gaitopt.diagnose.record.log import Log
from gaitopt.diagnose.record.parquet import Columns, read_parquet
from gaitopt.diagnose.record.tables import LARGEST, MOST_CELLS
from gaitopt.diagnose.record.trial import Series

INFO = "meta/info.json"

_COMMANDED, _MEASURED = "action", "observation.state"
_CLOCK, _EPISODE = "timestamp", "episode_index"
_MOST_FILES = 10_000


def _listed(value: object) -> object:
    """Return names as a list: they are one, or lists by kind, or names with their places."""
    names: list[object] = []
    for name in value if isinstance(value, (list, dict)) else ():
        inner = value[name] if isinstance(value, dict) else None
        names += inner if isinstance(inner, list) else [name]
    if value is not None and not (names and all(isinstance(name, str) for name in names)):
        raise ValueError(f"found {found(value)}; allowed: a list of names")
    return names


def _two_or_three(version: str) -> str:
    if version.removeprefix("v").partition(".")[0] not in ("2", "3"):
        raise ValueError(f"found {found(version)}; allowed: a data set of version 2 or 3")
    return version


class _Feature(BaseModel):
    """What a column holds: the names of its numbers; none where it has none."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    names: Annotated[list[Name], BeforeValidator(_listed)] = []

    def named(self, count: int, source: str) -> list[str]:
        """Return a name for each of some numbers: their places where they have none."""
        names = list(self.names) or [str(place) for place in range(count)]
        if len(names) != count:
            raise GaitoptError(
                f"{source}: found {len(names)} for {counted(count, 'number')}; allowed: one each"
            )
        return names


class _Features(BaseModel):
    """The two columns that are read."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    action: _Feature
    state: _Feature = Field(alias=_MEASURED)


class _Info(BaseModel):
    """The content of ``meta/info.json``, as far as it is used."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    codebase_version: Annotated[str, AfterValidator(_two_or_three)]
    features: _Features


def is_lerobot(folder: Path) -> bool:
    """Return whether a folder is such a data set.

    Raises:
        GaitoptError: its ``meta/info.json`` is a link out of it.
    """
    return folder.is_dir() and found_inside(folder, INFO) is not None


def read_lerobot(folder: Path) -> list[Log]:
    """Return the episodes of a data set in their order.

    Raises:
        GaitoptError: pyarrow is missing, or a file is missing, broken, too large or a link out of the folder.
    """
    source = folder / INFO
    features = validated(_Info, read_json(source), source).features
    parts = {_COMMANDED: features.action, _MEASURED: features.state}
    paths, logs = _files(folder), dict[int, Log]()
    tables = read_parquet(paths, (_CLOCK, _EPISODE, *parts), MOST_CELLS)
    for path, rows in zip(paths, tables, strict=True):
        _check(path, rows)
        names = [
            f"{part}.{name}"
            for part, feature in parts.items()
            for name in feature.named(rows[part].shape[1], f"{source}: features.{part}.names")
        ]
        for episode in np.unique(rows[_EPISODE]).astype(int).tolist():
            if episode in logs:
                raise GaitoptError(f"{path}: episode {episode} is in {logs[episode].path}, too")
            logs[episode] = _log(folder, path, rows, episode, names)
    return [logs[episode] for episode in sorted(logs)]


def _files(folder: Path) -> list[Path]:
    """Return the Parquet files of a data set."""
    files = sorted(folder.glob("data/chunk-*/*.parquet"))
    if not files or len(files) > _MOST_FILES:
        found_there = f"{len(files)} files data/chunk-*/*.parquet"
        raise GaitoptError(f"{folder}: found {found_there}; allowed: 1 to {_MOST_FILES}")
    for path in files:
        if inside(folder, str(path.relative_to(folder))) is None:
            raise GaitoptError(f"{path}: found a link out of its folder; allowed: a file inside it")
    return files


def _check(path: Path, rows: Columns) -> None:
    """Check that clock and episode are one number a row, and that no number is infinite or too large."""
    for name, numbers in rows.items():
        alone = name in (_CLOCK, _EPISODE)
        if alone and numbers.shape[1] != 1:
            raise GaitoptError(f"{path}: {name}: found {numbers.shape[1]} numbers in a row; allowed: one")
        wrong = ~(np.abs(numbers) <= LARGEST) if alone else np.abs(numbers) > LARGEST
        if wrong.any():
            row = int(wrong.any(axis=1).argmax())
            what = found(float(numbers[row][wrong[row]][0]))
            raise GaitoptError(f"{path}: row {row + 1}, {name}: found {what}; allowed: at most {LARGEST:g}")


def _log(folder: Path, path: Path, rows: Columns, episode: int, names: Sequence[str]) -> Log:
    """Return one episode."""
    own = np.flatnonzero(rows[_EPISODE][:, 0] == episode)
    numbers = np.concatenate([rows[_COMMANDED][own], rows[_MEASURED][own]], axis=1)

    def column(name: str) -> Series:
        series: Series = numbers[:, names.index(name)]
        return series

    name = f"{folder.resolve().name}-{episode:03d}"
    return Log(path, name, _CLOCK, rows[_CLOCK][own, 0], own + 1, names, column)
