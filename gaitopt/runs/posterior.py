"""``posterior.csv``: robots drawn from what a diagnosis knows, one row each."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gaitopt.core.errors import GaitoptError, bad_value, found, unknown_name
from gaitopt.core.numbers import number
from gaitopt.diagnose.record.tables import read_rows
from gaitopt.effects import EFFECTS, Effect
from gaitopt.effects.active import EffectValue, EffectValues, active_effects, as_tables
from gaitopt.effects.parts import ALL, Parts
from gaitopt.problem.model import nominal_parts
from gaitopt.problem.problem import Problem
from gaitopt.runs.diagnosis_folder import DIAGNOSIS_FILE
from gaitopt.runs.folder import POSTERIOR_FILE

MOST_ROBOTS = 10_000
"""A file with more robots is refused."""

_ANY_COLUMN = ("servo_gain", ALL)
"""The blank column of a file whose robots are all nominal."""

_NO_TARGET = "none"
"""What may stand for the target of an effect that has none; `ALL` may, too."""


def posterior_csv(robots: Sequence[EffectValues]) -> str:
    """Return the file of some robots: a column ``NAME.TARGET`` for each effect; a cell is blank where a robot
    does not have it.
    """
    known = list(dict.fromkeys((one.name, one.target) for robot in robots for one in robot))
    known = known or [_ANY_COLUMN]
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([f"{name}.{target}" for name, target in known])
    for robot in robots:
        cells = {(one.name, one.target): repr(one.value) for one in robot}
        writer.writerow([cells.get(column, "") for column in known])
    return out.getvalue()


def with_posterior(problem: Problem, folder: Path) -> Problem:
    """Return a problem with the robots of a finished diagnosis.

    Args:
        problem: the problem, without the effects that the diagnosis found.
        folder: the run folder of the diagnosis.

    Raises:
        GaitoptError: it is none, or its robots are not ones of this problem; see `read_robots`.
    """
    if not (folder / DIAGNOSIS_FILE).is_file():
        raise GaitoptError(
            f"--posterior: {folder}: not the folder of a finished diagnosis (no {DIAGNOSIS_FILE})"
        )
    if not (folder / POSTERIOR_FILE).is_file():
        raise GaitoptError(
            f"--posterior: {folder}: no {POSTERIOR_FILE}; diagnose again: an earlier version wrote none"
        )
    return problem.with_robots(read_robots(folder / POSTERIOR_FILE, problem))


def read_robots(path: Path, problem: Problem) -> tuple[EffectValues, ...]:
    """Return the robots of a file, checked; a column without any number is left out.

    An effect is not at work on a robot where its cell is blank or holds its neutral value. A line without any
    cell is no robot.

    Args:
        path: the file.
        problem: the problem, without these effects.

    Raises:
        GaitoptError: an effect, a target or a value is wrong, an effect does not apply to the problem or is
            switched on there already, or there are no robots or too many.
    """
    head, *rows = read_rows(path) or [[]]
    repeated = [name for name in head if head.count(name) > 1]
    if repeated:
        raise GaitoptError(f"{path}: column {found(repeated[0])} appears twice")
    nominal = nominal_parts(problem)
    used = [any(row[i] for row in rows if i < len(row)) for i in range(len(head))]
    columns = [
        _Column.of(path, name, nominal, problem) if at_work else None
        for name, at_work in zip(head, used, strict=True)
    ]
    robots: list[EffectValues] = []
    for line, row in enumerate(rows, 2):
        if row:
            where = f"{path}: line {line}"
            robots.append(_robot(where, columns, row))
            active_effects(as_tables(robots[-1]), problem.roles, problem.channel_names, where)
    if not columns or not 1 <= len(robots) <= MOST_ROBOTS:
        count = len(robots) if columns else "no columns"
        raise GaitoptError(f"{path}: found {count}; allowed: 1 to {MOST_ROBOTS} robots, a row each")
    return tuple(robots)


@dataclass(frozen=True)
class _Column:
    """A column of the file: an effect on a target.

    Attributes:
        name: its name.
        effect: the effect.
        target: the target.
        neutral: the value that changes nothing.
    """

    name: str
    effect: Effect
    target: str
    neutral: float

    @staticmethod
    def of(path: Path, name: str, nominal: Parts, problem: Problem) -> _Column:
        """Return the column of a name.

        Raises:
            GaitoptError: its effect or its target is unknown, does not apply, or the problem has it already.
        """
        effect_name, dot, target = name.partition(".")
        if not dot:
            raise bad_value(path, "column", name, "NAME.TARGET, such as servo_gain.all")
        if effect_name not in EFFECTS:
            raise unknown_name(path, "effect in column", effect_name, EFFECTS)
        effect = EFFECTS[effect_name]
        target = _target(f"{path}: column {effect_name}", effect, target, nominal.channels)
        if effect_name in problem.file.effects:
            raise GaitoptError(
                f"{path}: column {name}: {problem.source} has this effect already; allowed: the problem that "
                "was diagnosed, without what was found"
            )
        parts = replace(nominal, target=target)
        if reason := effect.why_not(parts):
            raise GaitoptError(f"{path}: column {name}: not applicable: {reason}")
        return _Column(name, effect, target, effect.neutral_value(parts))


def _target(where: str, effect: Effect, target: str, channels: Sequence[str]) -> str:
    if effect.target == "none":
        allowed = [_NO_TARGET, ALL]
    else:
        allowed = [*([ALL] if effect.target == "any" else []), *channels]
    if target not in allowed:
        raise unknown_name(where, "target", target, allowed)
    return ALL if effect.target == "none" else target


def _robot(where: str, columns: Sequence[_Column | None], row: Sequence[str]) -> EffectValues:
    """Return the effects that are at work on the robot of a row."""
    if len(row) > len(columns):
        raise GaitoptError(f"{where}: found {len(row)} cells; allowed: {len(columns)}, as in the first line")
    values = []
    for column, cell in zip(columns, row, strict=False):
        if not cell or column is None:
            continue
        try:
            value = number(cell)
        except ValueError:
            raise bad_value(where, column.name, cell, "a number, or nothing") from None
        if value != column.neutral:
            values.append(EffectValue(column.effect.name, column.target, value))
    return tuple(values)
