"""The gait of a recording that is imported: found, checked, and copied beside the data set."""

from __future__ import annotations

import itertools
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from gaitopt.core.errors import GaitoptError, nearest
from gaitopt.core.files import found_inside, read_bytes, write_bytes
from gaitopt.gait.gait import BEST_FILE, Gait
from gaitopt.gait.table import read_gait_file
from gaitopt.problem.lookup import bundled_names
from gaitopt.problem.problem import Problem, load_problem


@dataclass(frozen=True)
class Commanded:
    """What ``--gait`` names.

    Attributes:
        reference: as it was given.
        gait: the gait.
        file: its file; None for a name that a problem knows.
    """

    reference: str
    gait: Gait
    file: Path | None

    def beside(self, folder: Path, taken: Collection[str]) -> str:
        """Copy the gait's file into a data set's folder; return the name to refer to.

        Where another file has its name, as of several runs or films, it gets that of its folder, too, or a
        number.

        Args:
            folder: the data set.
            taken: names of the data set's own files.
        """
        if self.file is None:
            return self.reference
        data, file = read_bytes(self.file), self.file.absolute()
        numbered = (f"{file.stem}-{number}{file.suffix}" for number in itertools.count(2))
        for name in itertools.chain([file.name, f"{file.parent.name}-{file.name}"], numbered):
            copy = folder / name
            if name not in taken and (not copy.exists() or read_bytes(copy) == data):
                break
        write_bytes(copy, data)
        return name


def commanded(reference: str, problem: Problem | None) -> Commanded:
    """Return the gait that ``--gait`` names.

    It is a run folder, a gait file, an exported table, or the name of a gait of the problem; without one, of
    a bundled problem.

    Raises:
        GaitoptError: there is no such gait, or it does not fit the problem.
    """
    if problem is not None:
        gait = problem.find_gait(reference)
        return Commanded(reference, gait, None if reference in problem.baselines else _file_of(reference))
    path = _file_of(reference)
    if path is not None:
        return Commanded(reference, read_gait_file(path), path)
    known = {
        name: gait for bundled in bundled_names() for name, gait in load_problem(bundled).baselines.items()
    }
    if reference in known:
        return Commanded(reference, known[reference], None)
    raise GaitoptError(
        f"--gait: found {reference!r}; allowed: a run folder, a gait file, an exported table, a gait of a "
        f"bundled problem{nearest(reference, known)}, or a gait of another problem with --problem PROBLEM"
    )


def _file_of(reference: str) -> Path | None:
    """Return the file of a gait: the reference itself, or the best gait of a run; None for a name.

    Raises:
        GaitoptError: it is a folder, but no finished run.
    """
    path = Path(reference)
    if not path.is_dir():
        return path if path.exists() else None
    best = found_inside(path, BEST_FILE)
    if best is None:
        raise GaitoptError(f"{path / BEST_FILE}: no such file; {reference} is not a finished run folder")
    return best
