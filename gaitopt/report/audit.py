"""The report of an audit: what is wrong with a model, and what to do about it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from gaitopt.core.json import to_json
from gaitopt.core.quantities import figure
from gaitopt.problem.problem import Problem
from gaitopt.report.figures import audit as audit_figures
from gaitopt.report.figures import gait as gait_figures
from gaitopt.report.page import Page, Picture, Section, Table, after_results, save_figures
from gaitopt.report.rollouts import rollouts
from gaitopt.report.words import fidelity_text, names_of
from gaitopt.runs.folder import PAGE_FILE, filled_folder, write_into
from gaitopt.simulation.audit.finding import FINDING_KINDS, Finding
from gaitopt.simulation.labels import title_of
from gaitopt.simulation.rollout import Simulator


def write_audit(path: Path | None, problem: Problem, findings: Sequence[Finding]) -> Path:
    """Write the page, the figures and the findings of an audit, and return their folder.

    Args:
        path: a new or empty folder.
        problem: the robot.
        findings: what `gaitopt.simulation.check.check` found.
    """
    with filled_folder(path, f"{problem.name}-check") as folder:
        content = to_json({"findings": [finding.to_dict() for finding in findings]})
        write_into(folder, "check.json", content)
        with after_results(folder, "check.json"):
            html = _page(folder, problem, findings).html()
            write_into(folder, PAGE_FILE, html)
    return folder


def _page(folder: Path, problem: Problem, findings: Sequence[Finding]) -> Page:
    working = problem.simulation.working
    return Page(
        title=f"{problem.name}: errors of the model that would make results unreliable",
        answer=_answer(findings, problem),
        asked={
            "Checked": "ground, stance, falls, rest at the start, inert parameters, self-collision, airtime, "
            "drift, chaos, timestep and servos that do not follow",
            "Gaits": ", ".join(problem.baselines) or "none",
            "Simulated": fidelity_text(working.timestep_s, working.integrator),
        },
        sections=[
            *([Section("What to do", table=_remedy_table(findings))] if findings else []),
            *save_figures(folder, _pictures(problem, findings)),
            *([Section("Every finding", table=_finding_table(findings))] if findings else []),
        ],
    )


def _answer(findings: Sequence[Finding], problem: Problem) -> str:
    if not findings:
        return "Nothing found: the model passes every check."
    kinds = dict.fromkeys(finding.name for finding in findings)
    gaits = list(dict.fromkeys(finding.gait for finding in findings))
    some = "" not in gaits and len(gaits) < len(problem.baselines)
    where = f", only at {' and '.join(gaits)}" if some else ""
    return (
        f"{len(findings)} finding{'s' * (len(findings) != 1)} of {len(kinds)} kind{'s' * (len(kinds) != 1)}"
        f"{where}: {names_of(kinds)}. Repair these before you trust a speed that they affect."
    )


def _pictures(problem: Problem, findings: Sequence[Finding]) -> dict[str, Picture]:
    trajectories = rollouts(Simulator.build(problem), problem.baselines)
    able = {name: one for name, one in trajectories.items() if one.status == "ok"}
    pictures = {}
    if any(finding.limit > 0.0 for finding in findings):
        pictures["findings"] = Picture(
            "How far beyond the limits",
            partial(audit_figures.findings, findings),
            "How many times each finding with a limit exceeds it: the further right, the worse. For shares "
            "that should be larger, such as the travel that a servo reaches, it is the limit over the value.",
        )
    if able:
        pictures["position"] = Picture(
            "Position over time",
            partial(gait_figures.overlay, able, problem.roles),
            "Forward position of the marker: a steady gait moves forward in equal steps.",
        )
        pictures["height"] = Picture(
            "Height over time",
            partial(gait_figures.panels, able, problem.roles, axis=2),
            "Height of the marker above its start: jumps of many millimetres are flights, not steps.",
        )
    return pictures


def _remedy_table(findings: Sequence[Finding]) -> Table:
    count = Counter(finding.name for finding in findings)
    return Table(
        head=["finding", "times", "what to do"],
        rows=[[title_of(kind), str(times), FINDING_KINDS[kind].remedy] for kind, times in count.items()],
        words=(2,),
    )


def _finding_table(findings: Sequence[Finding]) -> Table:
    return Table(
        head=["finding", "gait, servo", "over its limit", "what was seen"],
        rows=[
            [
                title_of(finding.name),
                finding.place or "–",
                f"{figure(audit_figures.beyond(finding))} times" if finding.limit > 0.0 else "–",
                finding.message,
            ]
            for finding in findings
        ],
        note="check.json has the values and the limits.",
        words=(3,),
    )
