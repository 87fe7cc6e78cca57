"""A servo that was learnt on one robot, written into the problem of another that uses the same servo.

The whole servo is carried over: its nominal figures on the first robot with the effects learnt there. Each
becomes the effect on the other robot that gives the same figure there. What no effect can express of how a
servo loses torque with speed becomes a named parameter, which writes the attribute of the MJCF.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass

from gaitopt.core.errors import GaitoptError, unknown_name
from gaitopt.effects.active import Values
from gaitopt.effects.parts import ALL, Parts
from gaitopt.problem.model import nominal_parts
from gaitopt.problem.problem import Problem
from gaitopt.problem.servo_figures import BACK_EMF, FIGURES, check_servos
from gaitopt.problem.servo_target import LeftOut, Target

STAYS = {
    "servo_trim": "mounting: how the horn sits on its spline",
    "servo_travel": "calibration: which pulse means which angle",
    "servo_sag": "the supply",
    "channel_timing": "the program that sends the commands",
}
"""Effects that stay with the robot on which they were learnt, and what they belong to."""

_CARRIED = {term.effect for figure in FIGURES for term in figure.terms}


@dataclass(frozen=True)
class FigureChange:
    """One figure of one servo, before and after.

    Attributes:
        channel: the servo's channel.
        figure: what it is.
        unit: its unit; empty for a ratio.
        old: its value in the problem as it was; infinite for a limit that is not there.
        new: its value now.
    """

    channel: str
    figure: str
    unit: str
    old: float
    new: float

    def to_dict(self) -> dict[str, object]:
        """Return a row for JSON, in which a limit that is not there is null."""
        return asdict(self)


@dataclass(frozen=True)
class Transfer:
    """A problem with the servo of another.

    Attributes:
        problem: the problem with the servo.
        effects: effects that it got, as the file states them.
        parameters: named parameters that it got.
        rows: every figure of every servo that was changed or could have been.
        left_out: what was not carried over.
    """

    problem: Problem
    effects: Mapping[str, Values]
    parameters: Mapping[str, float]
    rows: tuple[FigureChange, ...]
    left_out: tuple[LeftOut, ...]


def carry_over(problem: Problem, bench: Problem, channels: Mapping[str, str] | None = None) -> Transfer:
    """Return a problem with a servo that was learnt on another robot.

    Args:
        problem: the problem that uses the same servo.
        bench: the robot on which it was learnt, with the effects learnt.
        channels: for each channel of `problem` with this servo the channel of `bench`; by default the
            channels of the same names, or all channels where `bench` has one.

    Raises:
        GaitoptError: a channel is unknown, it is not clear which is meant, a problem file cannot hold what
            the channels need, or nothing changes.
    """
    named = _named(problem, bench, dict(channels or {}))
    here, there = nominal_parts(problem), nominal_parts(bench)
    check_servos(problem, here, named)
    check_servos(bench, there, dict.fromkeys(named.values()))
    target = Target(problem, here, tuple(list(here.channels).index(name) for name in named))
    source = [list(there.channels).index(name) for name in named.values()]
    wanted = {figure.name: figure.of(bench, there)[source] for figure in FIGURES}
    learnt = f"{bench.name}, the servo of {', '.join(dict.fromkeys(named.values()))}"
    changes = target.changes(wanted, BACK_EMF.of(bench, there)[source], learnt)
    corrected = changes.applied(problem)
    if corrected.file == problem.file:
        raise GaitoptError(f"{bench.source}: found no servo that differs from that of {problem.source}")
    after = nominal_parts(corrected)
    target.check(corrected, after, wanted, changes)
    return Transfer(
        corrected,
        {name: values for name, values in changes.effects.items() if values is not None},
        {name: parameter.value for name, parameter in changes.parameters.items()},
        tuple(_rows((problem, here), (corrected, after), named)),
        (*_staying(bench, set(named.values())), *changes.left_out),
    )


def _named(problem: Problem, bench: Problem, asked: dict[str, str]) -> dict[str, str]:
    """Return for each channel that gets a servo the channel on which it was learnt, in the model's order."""
    for here, there in asked.items():
        if here not in problem.file.channels:
            raise unknown_name(f"--channel: {problem.source}", "channel", here, problem.channel_names)
        if there not in bench.file.channels:
            raise unknown_name(f"--channel: {bench.source}", "channel", there, bench.channel_names)
    if not asked and len(bench.channel_names) == 1:
        asked = dict.fromkeys(problem.channel_names, bench.channel_names[0])
    elif not asked and set(problem.channel_names) <= set(bench.channel_names):
        asked = {name: name for name in problem.channel_names}
    elif not asked:
        several = ", ".join(bench.channel_names)
        raise GaitoptError(
            f"{bench.source}: found channels {several}; allowed: say which is whose servo, "
            f"--channel {problem.channel_names[0]}={bench.channel_names[0]}"
        )
    return {name: asked[name] for name in problem.channel_names if name in asked}


def _staying(bench: Problem, carried: set[str]) -> Iterator[LeftOut]:
    """Yield the effects that stay with the robot on which they were learnt."""
    for active in bench.effects:
        name = active.effect.name
        if name not in _CARRIED:
            yield LeftOut(name, STAYS.get(name, "not of a servo"))
        elif active.target not in (ALL, *carried):
            yield LeftOut(name, f"it acts on {active.target}, whose servo is not carried over")


def _rows(
    before: tuple[Problem, Parts], after: tuple[Problem, Parts], named: Mapping[str, str]
) -> Iterator[FigureChange]:
    """Yield each figure that a servo has before or after."""
    for index, channel in enumerate(before[1].channels):
        for figure in FIGURES if channel in named else ():
            old, new = (float(figure.of(*robot)[index]) for robot in (before, after))
            if old != figure.none or new != figure.none:
                yield FigureChange(channel, figure.name, figure.unit, old, new)
