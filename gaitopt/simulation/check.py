"""The audit of a model: defects that make its gaits useless for a real robot."""

from __future__ import annotations

from concurrent.futures import Executor

from gaitopt.core.progress import OnProgress, Progress, silent
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.simulation.audit import settings as defaults
from gaitopt.simulation.audit.conduct import check_conduct
from gaitopt.simulation.audit.finding import DIVERGED, SEEN_FIRST, Finding
from gaitopt.simulation.audit.motion import check_motion
from gaitopt.simulation.audit.parameters import check_parameters
from gaitopt.simulation.audit.rest import check_rest
from gaitopt.simulation.audit.settings import CheckSettings
from gaitopt.simulation.audit.standing import check_ground
from gaitopt.simulation.audit.timestep import check_timestep
from gaitopt.simulation.rollout import Simulator


def check(
    problem: Problem,
    executor: Executor,
    settings: CheckSettings | None = None,
    on_progress: OnProgress = silent,
) -> list[Finding]:
    """Return every defect found, the model's first and then gait by gait.

    Chaos and drift are judged by the marker, and not at all without one; the timestep by the servos' angles
    alone, then.

    Args:
        problem: the problem; for workers on other machines, with its files (`carrying`).
        executor: where rollouts run.
        settings: limits and effort; `DEFAULT` without.
        on_progress: called as each check begins.

    Raises:
        GaitoptError: the model does not compile.
    """
    settings = settings or defaults.DEFAULT
    simulator = Simulator.build(problem)
    on_progress(Progress("rest at the start"))
    findings = [*check_ground(simulator), *check_rest(simulator, settings)]
    on_progress(Progress("inert parameters"))
    findings += check_parameters(problem, executor, settings)
    on_progress(Progress("gaits"))
    findings += check_conduct(simulator, list(problem.baselines.values()), executor, settings)
    on_progress(Progress("timestep"))
    diverged = {finding.gait for finding in findings if finding.name == DIVERGED.name}
    findings += check_timestep(problem, executor, settings, diverged)
    findings += check_motion(problem, executor, settings, diverged)
    seen_first = [kind.name for kind in SEEN_FIRST]
    return sorted(findings, key=lambda one: one.name not in seen_first)


def check_gait(problem: Problem, gait: Gait, executor: Executor) -> list[Finding]:
    """Return the defects that a gait shows on the nominal robot; the timestep is not among them.

    Args:
        problem: the problem.
        gait: the gait.
        executor: where its rollouts run.
    """
    return list(check_conduct(Simulator.build(problem), [gait], executor, defaults.DEFAULT))
