"""The job `model`: the nominal model as one self-contained MJCF."""

from __future__ import annotations

from pathlib import Path

from gaitopt.core.files import write_text
from gaitopt.jobs.outputs import writing
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem
from gaitopt.problem.self_contained import self_contained_mjcf


def model(problem: Problem, out: Path | str | None = None) -> str:
    """Return the nominal model as one MJCF that needs no other file, every number at full precision.

    Meshes have the single precision with which MuJoCo reads them; textures become their mean colour.

    Args:
        problem: the problem.
        out: where to write it.

    Raises:
        GaitoptError: the model does not compile, it names a file that cannot be written into it, or the file
            cannot be written.
    """
    with writing(problem, out):
        text = self_contained_mjcf(carrying(problem))
        if out is not None:
            write_text(Path(out), text)
    return text
