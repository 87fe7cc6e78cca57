"""The job `model`: the nominal model as one self-contained MJCF."""

from __future__ import annotations

from pathlib import Path

from gaitopt.core.files import write_text
from gaitopt.jobs.outputs import writing
from gaitopt.problem.model import carrying, nominal_mjcf
from gaitopt.problem.problem import Problem


def model(problem: Problem, out: Path | str | None = None) -> str:
    """Return the nominal model as one MJCF, every number at full precision.

    Args:
        problem: the problem.
        out: where to write it.

    Raises:
        GaitoptError: the model does not compile, or the file cannot be written.
    """
    with writing(problem, out):
        text = nominal_mjcf(carrying(problem))
        if out is not None:
            write_text(Path(out), text)
    return text
