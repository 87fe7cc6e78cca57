"""Notes: what a user should know about a search, in one sentence each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from gaitopt.optimise.evaluator import DROPPED
from gaitopt.optimise.journal import Entry
from gaitopt.optimise.margins import Margin, at_bounds, closest
from gaitopt.optimise.verification import Convergence, Verified
from gaitopt.problem.problem import Problem
from gaitopt.simulation.audit.finding import Finding, brief
from gaitopt.simulation.labels import title_of, with_unit


def drift_notes(
    predicted: Mapping[str, float], baselines: Sequence[Verified], ratio: float
) -> tuple[str, ...]:
    """Return a note on baselines that drift sideways, which the planar model does not describe.

    Args:
        predicted: planar speed of each baseline by name, m/s.
        baselines: the baselines, verified.
        ratio: sideways over forward speed above which a baseline counts as drifting.
    """
    return tuple(
        f"{row.gait.name} drifts sideways at {row.evaluation.metrics['sideways_ratio']:.0%} of its speed, "
        f"which the planar model does not know: it predicts {1e3 * predicted[row.gait.name]:.1f} mm/s "
        f"where MuJoCo has {1e3 * row.speed:.1f}"
        for row in baselines
        if row.evaluation.metrics["sideways_ratio"] > ratio
    )


def posterior_notes(problem: Problem) -> tuple[str, ...]:
    """Return a note on the robots of a posterior, where the scenarios ran on them."""
    if not problem.robots:
        return ()
    return (
        f"robots of a posterior were used: every scenario of search and verification has its own of the "
        f"{len(problem.robots)}; plan, figures and film show the nominal robot",
    )


def convergence_notes(found: Convergence, best: Verified, problem: Problem) -> tuple[str, ...]:
    """Return a note on a winner whose speed is not that of the search: its timestep was too long for it."""
    if found.converged:
        return ()
    coarse, fine = problem.simulation.working.timestep_s, problem.simulation.reference.timestep_s
    return (
        f"the winner's speed depends on the timestep: {1e3 * found.working.speed:.1f} mm/s at the search's "
        f"{coarse:g} s, {1e3 * best.speed:.1f} mm/s at {fine:g} s; take a shorter working timestep",
    )


_STRAIGHT = 0.1
"""A robot that goes sideways by more than this share of its way forward visibly veers."""


def warnings_of(
    problem: Problem, best: Verified, found: Sequence[Margin], findings: Sequence[Finding]
) -> tuple[str, ...]:
    """Return what the owner of a robot must know of a winner before it is played, one sentence each.

    Args:
        problem: the problem.
        best: the winner, verified.
        found: its margins.
        findings: what the audit found of it.
    """
    near = [
        f"it keeps the limit on {title_of(one.constraint)} by {one.margin:.1%} only: "
        f"{with_unit(one.constraint, one.value)}, allowed: {one.allowed}"
        for one in closest(found)
    ]
    broken = [
        f"it breaks the limit on {title_of(one.constraint)} in {len(one.broken_in)} of {one.scenarios} "
        f"scenarios: {', '.join(map(str, one.broken_in))}"
        for one in found
        if one.broken_in
    ]
    bounds = [
        f"its {name} is at the {end} bound of the search: if the servos can do more, set a wider bound"
        for name, end in at_bounds(problem.space, best.gait)
    ]
    aside = best.evaluation.metrics["sideways_ratio"]
    veers = [f"it goes {aside:.2g} mm sideways for each mm forward"] if aside > _STRAIGHT else []
    messages = [finding.message for finding in brief(findings)]
    checked = [f"`gaitopt check` finds that {text}" for text in messages]
    return (*near, *broken, *bounds, *veers, *checked)


def failure_notes(entries: Sequence[Entry], baselines: Sequence[Verified] = ()) -> tuple[str, ...]:
    """Return how many gaits of the search failed in simulation and why, and which baselines failed."""
    statuses = [entry.evaluation.status for entry in entries]
    reasons = Counter(one for one in statuses if one != "ok" and not one.startswith(DROPPED))
    said = counted(reasons)
    searched = (f"{reasons.total()} of {len(entries)} gaits failed in simulation: {said}",) if said else ()
    return searched + tuple(
        f"{row.gait.name} failed in simulation: {row.evaluation.status}"
        for row in baselines
        if row.evaluation.status != "ok"
    )


def counted(reasons: Counter[str], most: int | None = None) -> str:
    """Return reasons with their counts, the most frequent first.

    Args:
        reasons: how often each occurred.
        most: how many to name at most; all by default.
    """
    return ", ".join(f"{reason} ({count})" for reason, count in reasons.most_common(most))
