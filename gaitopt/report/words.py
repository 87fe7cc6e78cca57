"""Results in sentences, for pages and for the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from gaitopt.core.quantities import figure
from gaitopt.optimise.compare import ComparedGait
from gaitopt.problem.objective import Objective
from gaitopt.problem.problem import Problem
from gaitopt.runs.summary import GaitRow, Summary
from gaitopt.simulation.labels import title_of


def answer_of(summary: Summary) -> str:
    """Return the result of a search in one sentence."""
    best = summary.best
    speed, (low, high) = best.speed_m_s, best.speed_ci90_m_s
    if not math.isfinite(speed):
        return f"The best gait of the search failed where it was verified: {best.status}."
    text = f"The best gait moves at {1e3 * speed:.1f} mm/s"
    if math.isfinite(low) and math.isfinite(high):
        text += f" (90 % interval {1e3 * low:.1f} to {1e3 * high:.1f})"
    ratio, fastest = summary.ratio_to_best_baseline, summary.fastest_baseline
    if ratio is not None and fastest is not None:
        text += f", {ratio:.2f} times the fastest hand-tuned gait, {fastest.name}"
    met = "meets every constraint" if best.constraints_met else f"violates {names_of(best.violations)}"
    return f"{text}, and {met}."


def warning_lines(summary: Summary) -> list[str]:
    """Return what the owner of a robot must know of the winner, a sentence each."""
    return [f"Warning, of the best gait: {text}." for text in summary.best.warnings]


_NEARLY = 1.05
"""Up to this ratio, a gait does not lie beyond what was measured."""


def reach_of(summary: Summary) -> str:
    """Return in one sentence how far the winner lies from what was measured; empty where nothing was."""
    measured, best = summary.measured, summary.best
    if measured is None or not math.isfinite(best.speed_m_s):
        return ""
    beyond = [
        text
        for text in (
            _period_beyond(best.period_s, measured.period_s),
            _beyond("speed of", best.speed_m_s, measured.speed_m_s[1], "mm/s", 1e3),
            _beyond(
                "RMS torque of", best.metrics.get("rms_torque_n_m", math.nan), measured.rms_torque_n_m, "N m"
            ),
        )
        if text
    ]
    of = f"what was measured on the real robot ({', '.join(measured.gaits)})"
    if not beyond:
        return f"The winner lies within {of}: in period, speed and torque."
    return f"The winner lies beyond {of}: its {'; its '.join(beyond)}."


def _period_beyond(period_s: float, measured: tuple[float, float]) -> str:
    shortest, longest = measured
    if shortest <= _NEARLY * period_s and period_s <= _NEARLY * longest:
        return ""
    which, end = ("shortest", shortest) if period_s < shortest else ("longest", longest)
    return f"period of {figure(period_s)} s is {period_s / end:.2g} times the {which} ({figure(end)} s)"


def _beyond(what: str, found: float, largest: float, unit: str, scale: float = 1.0) -> str:
    """Return that a figure is larger than the largest; empty where it is not, or is not known."""
    if not found > _NEARLY * largest > 0.0:
        return ""
    return (
        f"{what} {scale * found:.3g} {unit} is {found / largest:.2g} times the largest "
        f"({scale * largest:.3g} {unit})"
    )


ON_NOMINAL = (
    "of the nominal robot at the working fidelity; `gaitopt compare` has the speed over scenarios, at the "
    "reference fidelity."
)
"""What a speed of one rollout is, and where the speed is that pages and searches state."""


def basis_of(summary: Summary) -> str:
    """Return in one or two sentences what the speeds of a search are means over, and how fine they are."""
    verified = summary.verified
    if not verified.scenarios or not math.isfinite(verified.timestep_s):
        return ""
    text = (
        f"Speeds are means over {verified.scenarios} scenarios that the search did not see, at the reference "
        f"fidelity ({fidelity_text(verified.timestep_s, verified.integrator).removeprefix('at ')})."
    )
    if verified.converged is None:
        return text
    coarse = f"the working timestep of {figure(verified.working_timestep_s)} s"
    same = "within what `gaitopt check` allows" if verified.converged else "too much: shorten it"
    return (
        f"{text} With {coarse} the best gait has {1e3 * verified.working_speed_m_s:.1f} mm/s there: {same}."
    )


def compared_basis(rows: Sequence[ComparedGait]) -> str:
    """Return in one sentence what the speeds of a comparison are means over, and how fine they are."""
    row = rows[0]
    return (
        f"Speeds are means over {len(row.scenario_speeds_m_s)} scenarios at the reference fidelity "
        f"({fidelity_text(row.timestep_s, row.integrator).removeprefix('at ')}): those in which a search "
        "with the same seed verifies its best gait."
    )


def verdicts(rows: Sequence[ComparedGait]) -> list[str]:
    """Return one sentence for each gait after the first: its difference, and if it is more than noise."""
    return [_verdict(row, rows[0].name) for row in rows[1:]]


def _verdict(row: ComparedGait, first: str) -> str:
    difference, ends = 1e3 * row.difference_m_s, [1e3 * end for end in row.difference_ci90_m_s]
    if not all(map(math.isfinite, (difference, *ends))):
        return f"{row.name} cannot be compared with {first}: a simulation failed."
    times = ""
    if row.ratio is not None and row.ratio_ci90 is not None:
        times = f", {row.ratio:.2f} times its speed ({interval_text(row.ratio_ci90, '.2f', 1.0)})"
    noise = "what is not known of the robot" if row.robots else "noise"
    if not row.more_than_noise:
        return (
            f"{row.name} differs from {first} by no more than {noise}: {difference:+.2f} mm/s "
            f"(90 % interval {ends[0]:+.2f} to {ends[1]:+.2f}){times}."
        )
    low, high = sorted(map(abs, ends))
    return (
        f"{row.name} is {'faster' if difference > 0.0 else 'slower'} than {first} by "
        f"{abs(difference):.2f} mm/s (90 % interval {low:.2f} to {high:.2f}){times}: more than {noise}."
    )


def robot_text(problem: Problem) -> str:
    """Return the name of a problem, with its description."""
    description = problem.file.description
    return f"{problem.name}: {description}" if description else problem.name


def fidelity_text(timestep_s: float, integrator: str) -> str:
    """Return the timestep and integrator of a fidelity in words."""
    return f"at {figure(timestep_s)} s, {integrator}"


def names_of(metrics: Iterable[str]) -> str:
    """Return the titles of some metrics."""
    return ", ".join(map(title_of, metrics))


def interval_text(ends: Sequence[float], form: str, scale: float = 1e3) -> str:
    """Return an interval, each end times a scale and in a format; m/s are shown in mm/s by default."""
    return " to ".join(format(scale * end, form) for end in ends)


def constraints_text(row: GaitRow | ComparedGait) -> str:
    """Return whether a gait meets every constraint, and which it violates."""
    return "met" if row.constraints_met else f"violated: {names_of(row.violations) or row.status}"


def scenario_rule(objective: Objective) -> str:
    """Return how costs of several scenarios are combined, if not by their mean."""
    share = objective.worse_share
    if share is None:
        return ""
    return f", by its {100 * share:.0f} % quantile over scenarios" if share else ", by its worst scenario"
