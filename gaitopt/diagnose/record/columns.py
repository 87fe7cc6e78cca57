"""Columns of a log: what their names say about part, owner and unit, and which of them are taken."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from gaitopt.core.errors import GaitoptError, bad_value, found, unknown_name
from gaitopt.core.units import ANGLE, LENGTH, suffix_scale
from gaitopt.robot.signals import MARKER, joint_signal, marker_signal

COUNTS, PULSE = "counts", "us"
"""Units of columns beside those of angles and lengths: steps of an encoder, and pulse widths in µs."""

_UNITS = {*ANGLE, *LENGTH, COUNTS, PULSE}

_ANGLE = r"(?:_(?:positions?|angles?|pos))?"
_COMMANDED = re.compile(rf"(?:targets?|commands?|cmd|goal|actions?){_ANGLE}(?:[._](.+))?")
_MEASURED = re.compile(
    rf"(?:joints?|angles?|positions?|pos|measured|present|actual|state|observation\.state){_ANGLE}(?:\.(.+))?"
)
_SIGNAL = re.compile(r"marker\.[xyz]|joint\.\S.*|site\.\S.*\.(?:x|y|z|roll|pitch|yaw)")
_SIGNALS = "joint.NAME, marker.x, marker.y, marker.z, site.NAME.x, …, site.NAME.yaw"
_NO_PARTS = ',;"'
"""Characters that would end a cell of the data set's tables."""


@dataclass(frozen=True)
class Column:
    """A column of a log.

    Attributes:
        name: what the log calls it.
        unit: the unit in its name; None where it has none.
    """

    name: str
    unit: str | None


@dataclass(frozen=True)
class Chosen:
    """The columns of a log that are taken.

    Attributes:
        commands: by channel.
        signals: by signal.
    """

    commands: Mapping[str, Column]
    signals: Mapping[str, Column]


def chosen_columns(
    source: object, head: Sequence[str], commands: Mapping[str, str], signals: Mapping[str, str]
) -> Chosen:
    """Return the columns that are asked for, or those whose names say what they hold.

    Commands have names such as ``target.NAME_rad`` or ``cmd_NAME_us``, signals such as ``NAME_rad``,
    ``joint.NAME_deg``, ``x_m`` or ``site.NAME.yaw_deg``.

    Args:
        source: the log, for messages.
        head: its columns, without that of the time stamps.
        commands: column of each channel that is asked for; if there are any, no others are taken.
        signals: the same for signals.

    Raises:
        GaitoptError: a column is not there, does not say whose it is, or two are of one channel or signal.
    """
    for signal in signals:
        if not _SIGNAL.fullmatch(signal):
            raise bad_value("gaitopt import", "--signal", signal, _SIGNALS)
    asked = {*commands.values(), *signals.values()}
    left = [name for name in head if name not in asked]
    sent = _asked(source, head, commands, "--command") or _commands(left)
    seen = _asked(source, head, signals, "--signal") or _signals(source, left, bool(sent))
    nameless = [f"--command CHANNEL={column.name}" for owner, column in sent if not owner]
    nameless += [f"--signal joint.NAME={column.name}" for owner, column in seen if not owner]
    if nameless:
        raise GaitoptError(f"{source}: columns do not say whose they are; say it: {' '.join(nameless)}")
    return Chosen(_alone(source, sent, "--command"), _alone(source, seen, "--signal"))


_Owned = list[tuple[str, Column]]
"""Columns with the channel or the signal that they belong to; an empty name where they do not say it."""


def _asked(source: object, head: Sequence[str], columns: Mapping[str, str], option: str) -> _Owned:
    for owner, name in columns.items():
        if name not in head:
            raise unknown_name(f"{source}: {option} {owner}", "column", name, head)
    return [(owner, Column(name, _parts(name)[1])) for owner, name in columns.items()]


def _commands(head: Iterable[str]) -> _Owned:
    """Return the columns of commands, by their names."""
    owned = []
    for name in head:
        stem, unit = _parts(name)
        match = _COMMANDED.fullmatch(stem)
        if match and unit not in LENGTH:
            owned.append(((match[1] or "").removesuffix(".pos"), Column(name, unit)))
    return _with_units(owned)


def _signals(source: object, head: Iterable[str], commanded: bool) -> _Owned:
    """Return the columns of signals, by their names.

    Args:
        source: the log, for messages.
        head: its columns.
        commanded: whether it holds commands. Then a column ``angle_rad`` is that of an unnamed servo, and not
            that of a joint called angle.
    """
    owned, bare = [], []
    for name in head:
        stem, unit = _parts(name)
        axis = name.rpartition("_")[0].removeprefix("marker.")
        match = _MEASURED.fullmatch(stem)
        if _COMMANDED.fullmatch(stem):
            continue
        if marker_signal(name.removeprefix("marker.")) in MARKER:
            bare.append((marker_signal(name.removeprefix("marker.")), Column(name, None)))
        elif marker_signal(axis) in MARKER:
            suffix_scale(source, "column", name, LENGTH)
            owned.append((marker_signal(axis), Column(name, unit)))
        elif unit is not None and _SIGNAL.fullmatch(stem) and stem.startswith("site."):
            owned.append((stem, Column(name, unit)))
        elif match and match[1] and (unit is None or unit in (*ANGLE, COUNTS)):
            owned.append((joint_signal(match[1].removesuffix(".pos")), Column(name, unit)))
        elif match and commanded and (unit is None or unit in (*ANGLE, COUNTS)):
            owned.append(("", Column(name, unit)))
        elif unit in (*ANGLE, COUNTS):
            owned.append((joint_signal(stem), Column(name, unit)))
    return _with_units(owned) or bare


def _with_units(owned: _Owned) -> _Owned:
    """Return the columns with a unit, where there are any: what else a log says of a joint is no angle."""
    return [pair for pair in owned if pair[1].unit is not None] or owned


def _parts(name: str) -> tuple[str, str | None]:
    """Return a column's name without its unit, and the unit; None where it has none."""
    stem, _, unit = name.rpartition("_")
    return (stem, unit) if stem and unit in _UNITS else (name, None)


def _alone(source: object, owned: _Owned, option: str) -> dict[str, Column]:
    columns: dict[str, Column] = {}
    for owner, column in owned:
        if owner in columns:
            both = f"columns {found(columns[owner].name)} and {found(column.name)} are both of {found(owner)}"
            raise GaitoptError(f"{source}: {both}; choose one: {option} {owner}={column.name}")
        if owner != owner.strip() or not owner.isprintable() or any(mark in owner for mark in _NO_PARTS):
            allowed = "a name without commas, quotes and control characters"
            raise bad_value(source, option, owner, f"{allowed}; give it one: {option} NAME={column.name}")
        columns[owner] = column
    return columns
