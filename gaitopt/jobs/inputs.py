"""Arguments of jobs, checked: gaits and logs by name or path, seeds, positive numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.record.commands import read_commands
from gaitopt.gait.drive import Drive
from gaitopt.gait.gait import BEST_FILE, Gait
from gaitopt.gait.table import is_table
from gaitopt.problem.problem import Problem
from gaitopt.runs.posterior import with_posterior


def checked_seed(seed: int) -> int:
    """Return a seed.

    Raises:
        GaitoptError: it is negative.
    """
    if seed < 0:
        raise GaitoptError(f"--seed: found {seed}; allowed: 0 or more")
    return seed


def found_gait(problem: Problem, gait: Gait | str | Path, in_range: bool = True) -> Gait:
    """Return a gait of a problem.

    Args:
        problem: the problem.
        gait: a gait, or what `Problem.find_gait` finds by name or path.
        in_range: whether its targets have to be inside the servos' ranges.

    Raises:
        GaitoptError: there is no such gait, or it does not fit the problem.
    """
    if isinstance(gait, Gait):
        return problem.check_gait(gait, gait.name or "gait", in_range)
    return problem.find_gait(str(gait), in_range=in_range)


def told_apart(
    problem: Problem, gaits: Sequence[Gait], references: Sequence[Gait | str | Path]
) -> list[Gait]:
    """Return gaits with names that differ: those alike get their folder's name before theirs, or a number.

    Args:
        problem: the problem.
        gaits: the gaits.
        references: what was asked for, in the same order.
    """
    names = [gait.name for gait in gaits]
    placed = [
        f"{_folder(problem, one)}/{name}".lstrip("/") for name, one in zip(names, references, strict=True)
    ]
    names = _unlike(names, placed)
    names = _unlike(names, [f"{name} ({number})" for number, name in enumerate(names, 1)])
    return [replace(gait, name=name) for gait, name in zip(gaits, names, strict=True)]


def _folder(problem: Problem, reference: Gait | str | Path) -> str:
    """Return the name of the folder that holds a gait's file, or its run; a baseline has none."""
    if isinstance(reference, Gait) or str(reference) in problem.baselines:
        return ""
    path = Path(reference).resolve()
    return (path.parent if path.name == BEST_FILE else path).parent.name


def _unlike(names: Sequence[str], others: Sequence[str]) -> list[str]:
    """Return names, with others for those that occur more than once."""
    return [other if names.count(name) > 1 else name for name, other in zip(names, others, strict=True)]


def found_drive(problem: Problem, drive: Drive | str | Path) -> Drive:
    """Return what is commanded: a gait of a problem, or a log of commands.

    Args:
        problem: the problem.
        drive: a drive, what `Problem.find_gait` finds by name or path, or a log of commands (see
            `read_commands`).

    Raises:
        GaitoptError: there is no such gait or log, or it does not fit the problem.
    """
    if isinstance(drive, Drive) and not isinstance(drive, Gait):
        return drive
    if isinstance(drive, Gait) or str(drive) in problem.baselines:
        return found_gait(problem, drive)
    path = Path(drive)
    if path.suffix.lower() == ".csv" and path.is_file() and not is_table(path):
        return read_commands(path, problem)
    return found_gait(problem, drive)


def over_posterior(problem: Problem, posterior: Path | str | None) -> Problem:
    """Return a problem with the robots of a posterior; without them where none is named.

    Args:
        problem: the problem.
        posterior: the run folder of a finished diagnosis, which holds ``posterior.csv``.

    Raises:
        GaitoptError: the folder holds none, or one that does not fit the problem.
    """
    return problem if posterior is None else with_posterior(problem, Path(posterior))


def check_positive(option: str, value: float | None) -> None:
    """Check that a number, if it is given, is positive and finite.

    Raises:
        GaitoptError: it is not.
    """
    if value is not None and not (math.isfinite(value) and value > 0.0):
        raise GaitoptError(f"--{option}: found {value:g}; allowed: a positive number")
