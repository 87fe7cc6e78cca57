"""The run folder of a diagnosis: its JSON, the problem and model it used, and one HTML page."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from pathlib import Path

from gaitopt.core.files import write_text
from gaitopt.core.json import to_json
from gaitopt.diagnose.correction import walked_gaits
from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.words import answer, explanation
from gaitopt.gait.gait import write_gait
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import Problem
from gaitopt.report.diagnosis import write_page
from gaitopt.runs.folder import held, new_folder, write_into, write_problem

CORRECTED_FILE = "corrected.toml"
"""In a run folder: the problem with what was found switched on, where anything was."""

NEXT_FILE = "next.toml"
"""In a run folder: the gait to measure next."""


@contextmanager
def diagnosis_folder(out: Path | None, resumed: Path | None, name: str) -> Iterator[Path]:
    """Yield the run folder of a diagnosis, and keep every other run out; what stays empty goes again.

    Args:
        out: the folder; a new one by default.
        resumed: the folder of an interrupted diagnosis to go on with instead.
        name: the problem's name.

    Raises:
        GaitoptError: the folder holds something already, cannot be written, or another run works there.
    """
    folder = resumed or new_folder(out, f"{name}-diagnosis")
    try:
        with held(folder):
            yield folder
    finally:
        if resumed is None:
            with suppress(OSError):  # it holds something, or is gone
                folder.rmdir()


def write_diagnosis(
    folder: Path,
    problem: Problem,
    diagnosis: Diagnosis,
    executor: Executor | None = None,
    full: bool = False,
) -> None:
    """Write the run folder of a diagnosis; ``diagnosis.json`` comes last.

    Args:
        folder: the folder.
        problem: the nominal problem.
        diagnosis: the diagnosis.
        executor: where gaits of the corrected robot are simulated; None to leave them out.
        full: add a film to the page.

    Raises:
        GaitoptError: a file cannot be written.
    """
    found = diagnosis.found
    corrected = problem.with_effects(found.best.effect_values) if found and found.best else None
    walked = walked_gaits(problem, corrected, executor) if corrected and executor else []
    content = diagnosis.to_dict() | {"answer": answer(diagnosis), "explanation": explanation(diagnosis)}
    content["corrected"] = [row.to_dict() for row in walked]
    model = nominal_mjcf(problem)
    write_problem(folder, problem, model)
    if corrected and found and found.causes:
        text = corrected.to_toml("model.xml")
        write_into(folder, CORRECTED_FILE, lambda file: write_text(file, text))
    if diagnosis.experiment is not None:
        gait = diagnosis.experiment.gait
        write_into(folder, NEXT_FILE, lambda file: write_gait(file, gait))
    write_page(folder, problem, diagnosis, corrected, walked, executor, full)
    write_into(folder, "diagnosis.json", lambda file: write_text(file, to_json(content)))
