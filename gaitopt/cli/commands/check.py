"""`gaitopt check`: the audit of a model."""

from __future__ import annotations

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say
from gaitopt.cli.options import add_executor, add_json, add_problem, add_report_folder, problem_of


def add_options(parser: Parser) -> None:
    """Add the options."""
    add_problem(parser)
    add_report_folder(parser)
    add_json(parser)
    add_executor(parser)


def run(options: Options) -> None:
    """Check, and print a line for each finding, then what to do about each kind."""
    from gaitopt.cli.display import print_report
    from gaitopt.cli.progress import show_checks
    from gaitopt.core.progress import silent
    from gaitopt.jobs.check import check
    from gaitopt.simulation.audit.finding import brief

    problem = problem_of(options)
    findings = check(
        problem,
        executor=options.executor,
        workers=options.workers,
        out=options.out,
        on_progress=silent if options.json else show_checks,
    )
    if options.json:
        print_json({"findings": [finding.to_dict() for finding in findings]})
        return
    if not findings:
        say(f"{problem.name}: nothing found")
    for finding in brief(findings):
        where = f" at {finding.gait}" if finding.gait else ""
        say(f"{finding.name}{where}: {finding.message}")
    for kind, remedy in {finding.name: finding.remedy for finding in findings}.items():
        say(f"to do about {kind}: {remedy}")
    print_report(options.out)


COMMAND = Command(
    name="check",
    summary="check the model for errors that would make results unreliable",
    example="gaitopt check arcfold",
    add_options=add_options,
    run=run,
)
