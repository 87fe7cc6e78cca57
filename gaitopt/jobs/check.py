"""The job `check`: the audit of a model."""

from __future__ import annotations

from concurrent.futures import Executor

from gaitopt.core.folders import check_new_or_empty
from gaitopt.core.progress import OnProgress, silent
from gaitopt.jobs.executor import opened
from gaitopt.jobs.outputs import Out, out_folder
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem
from gaitopt.simulation import check as checking
from gaitopt.simulation.audit.finding import Finding
from gaitopt.simulation.audit.settings import CheckSettings


def check(
    problem: Problem,
    *,
    executor: Executor | str = "threads",
    workers: int | None = None,
    out: Out = None,
    settings: CheckSettings | None = None,
    on_progress: OnProgress = silent,
) -> list[Finding]:
    """Check a model for defects that make its gaits useless for a real robot.

    Args:
        problem: the problem.
        executor: where rollouts run: ``threads``, ``processes``, ``serial``, ``dask://HOST:PORT`` or an
            executor.
        workers: rollouts at once; all cores by default.
        out: a new or an empty folder for the page; nothing is written without it.
        settings: limits and effort of the checks; by default those of the command.
        on_progress: called as each check begins.

    Returns:
        Every defect found, the model's first and then gait by gait.

    Raises:
        GaitoptError: the model does not compile, or `out` holds something.
    """
    folder = out_folder(out)
    check_new_or_empty(folder)
    problem = carrying(problem)
    with opened(executor, workers) as pool:
        findings = checking.check(problem, pool, settings, on_progress)
    if out is not None:
        from gaitopt.report.audit import write_audit

        write_audit(folder, problem, findings)
    return findings


audit = check
"""The same job by its other name."""
