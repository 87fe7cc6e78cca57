"""What to measure next, in words."""

from __future__ import annotations

from gaitopt.diagnose.judge.command_experiment import CommandExperiment
from gaitopt.diagnose.judge.experiment import Experiment


def what_next(experiment: Experiment | CommandExperiment) -> str:
    """Return what to measure next and what it is expected to tell."""
    if isinstance(experiment, CommandExperiment):
        return f"Play next: a {experiment.chosen.words}. {what_commands_tell(experiment)}"
    period, wave = experiment.gait.period_s, experiment.wave_of
    known = f"the wave of {wave} with a period of {period:g} s"
    what = f"a gait of {period:.2f} s" if wave is None else known
    return f"Measure next: {what}. {what_it_tells(experiment)}"


def what_commands_tell(found: CommandExperiment) -> str:
    """Return what the commands are expected to tell, in a sentence or two."""
    apart = f"by {found.chosen.separation.mean:.1f} times the measurement uncertainty on average"
    so_far = f"; the best commands so far: {found.before:.1f}" if found.before else ""
    if len(found.separates) == 1:
        return f"They narrow the figures of {found.separates[0]}: they set its robots apart {apart}{so_far}."
    text = f"They set {', '.join(found.separates)} apart {apart}{so_far}."
    pairs = "; ".join(" and ".join(pair) for pair in found.inseparable)
    return text + (f" No commands tell these apart: {pairs}." if pairs else "")


def what_it_tells(experiment: Experiment) -> str:
    """Return which effects the next experiment is expected to separate, and which no gait separates."""
    first, *others = experiment.separates
    text = (
        f"On this gait, {first} and {' or '.join(others)} differ by {experiment.separation:.1f} times the "
        f"measurement uncertainty; on the gaits measured so far, by {experiment.before:.1f} times."
    )
    if experiment.worth_m_s is not None:
        worth = 1e3 * experiment.worth_m_s
        text += (
            f" The best of the gaits that were tried is expected to be {worth:.1f} mm/s faster "
            "if it is chosen after this film."
        )
    for one, other in experiment.inseparable:
        text += f" No gait that was tried separates {one} from {other}: measure another signal for that."
    return text
