"""What a diagnosis writes into its run folder: its JSON, the problem and model it used, and one HTML page."""

from __future__ import annotations

from pathlib import Path

from gaitopt.core.json import to_json
from gaitopt.diagnose.correction import Correction
from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.judge.experiment import Experiment
from gaitopt.diagnose.words import answer, explanation, how_far
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import Problem
from gaitopt.report.diagnosis import write_page
from gaitopt.report.page import after_results
from gaitopt.runs.diagnosis_folder import CORRECTED_FILE, DIAGNOSIS_FILE, NEXT_FILE
from gaitopt.runs.folder import MODEL_FILE, POSTERIOR_FILE, write_into, write_problem
from gaitopt.runs.posterior import posterior_csv


def write_diagnosis(
    folder: Path,
    problem: Problem,
    diagnosis: Diagnosis,
    correction: Correction | None = None,
    full: bool = False,
) -> None:
    """Write the run folder of a diagnosis; ``diagnosis.json`` is the last of the results, before the page.

    Args:
        folder: the folder.
        problem: the nominal problem.
        diagnosis: the diagnosis.
        correction: the corrected robot; None where nothing was fitted.
        full: add a film to the page.

    Raises:
        GaitoptError: a file cannot be written; where that is the page, the line says that the results are.
    """
    content = diagnosis.to_dict() | {"answer": answer(diagnosis), "explanation": explanation(diagnosis)}
    content["corrected"] = [row.to_dict() for row in correction.walked] if correction else []
    write_problem(folder, problem, nominal_mjcf(problem))
    if diagnosis.robots:
        write_into(folder, POSTERIOR_FILE, posterior_csv(diagnosis.robots))
    if correction and diagnosis.correction:
        text = f"# {how_far(diagnosis)}\n{correction.problem.to_toml(MODEL_FILE)}"
        write_into(folder, CORRECTED_FILE, text)
    if isinstance(diagnosis.experiment, Experiment):
        gait = diagnosis.experiment.gait
        write_into(folder, NEXT_FILE, gait.to_toml())
    write_into(folder, DIAGNOSIS_FILE, to_json(content))
    with after_results(folder, DIAGNOSIS_FILE, "the same command with --resume and this folder"):
        write_page(folder, problem, diagnosis, correction, full)
