"""Where to find a problem file, the bundled problems, and the MJCF of a problem file."""

from __future__ import annotations

import re
from pathlib import Path

from gaitopt.core.errors import GaitoptError, bad_value, nearest
from gaitopt.core.files import found_inside, inside

PROBLEM_FILE = "problem.toml"
"""Name of the problem file in its folder."""


def bundled_problems() -> Path:
    """Return the folder of the problems that come with gaitopt, installed or in a checkout."""
    here = Path(__file__).resolve().parent.parent
    installed = here / "problems"
    return installed if installed.is_dir() else here.parent / "problems"


def bundled_names() -> list[str]:
    """Return the names of the problems that come with gaitopt."""
    return sorted(file.parent.name for file in bundled_problems().glob(f"*/{PROBLEM_FILE}"))


def problem_file(reference: str) -> Path:
    """Return the problem file of a folder, a file or a bundled name.

    A folder without a problem file does not hide a bundled problem of the same name.

    Raises:
        GaitoptError: there is no such problem, or its file is a link out of the folder.
    """
    path = Path(reference)
    found = found_inside(path, PROBLEM_FILE)
    if found is not None:
        return found
    if path.is_file():
        return path
    bundled = bundled_problems()
    if re.fullmatch(r"[A-Za-z0-9_.-]+", reference) and (bundled / reference / PROBLEM_FILE).is_file():
        return bundled / reference / PROBLEM_FILE
    if path.is_dir():
        raise GaitoptError(f"{path}: no {PROBLEM_FILE} in this folder")
    names = bundled_names()
    raise GaitoptError(
        f"{reference}: no such problem; allowed: a folder with {PROBLEM_FILE}, a problem TOML, "
        f"or one of {', '.join(names)}{nearest(reference, names)}"
    )


def model_file(problem_path: Path, name: str | None) -> Path:
    """Return the MJCF that a problem file names, or the only one in its folder.

    Raises:
        GaitoptError: it is not there, lies outside the folder, or is not the only one.
    """
    folder = problem_path.parent
    if name is not None:
        path = inside(folder, name)
        if path is None:
            raise bad_value(problem_path, "model", name, "a file inside the problem's folder")
        if not path.is_file():
            raise GaitoptError(f"{problem_path}: model: {path}: no such file")
        return path
    names = sorted(path.name for path in folder.glob("*.xml"))
    if len(names) != 1:
        raise GaitoptError(
            f"{folder}: found {len(names)} MJCF files (*.xml); allowed: exactly one, or `model`"
        )
    path = found_inside(folder, names[0])
    if path is None:
        raise GaitoptError(f"{folder / names[0]}: no plain file, or a link to none")
    return path
