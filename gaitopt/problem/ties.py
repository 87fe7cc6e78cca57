"""Ties of a problem file: written one by one, or made by the phase templates of gaits with legs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Annotated

from pydantic import Field

from gaitopt.core.errors import unknown_name
from gaitopt.core.validation import Name
from gaitopt.gait.space import GaitSpace
from gaitopt.gait.ties import Tie, TiedSpace
from gaitopt.problem.fields import FileRecord, Finite, Period

QUADRUPED = ("front_left", "front_right", "hind_left", "hind_right")
HEXAPOD = ("front_left", "front_right", "middle_left", "middle_right", "hind_left", "hind_right")

TEMPLATES: Mapping[str, Mapping[str, float]] = {
    "trot": dict(zip(QUADRUPED, (0.0, 0.5, 0.5, 0.0), strict=True)),
    "pace": dict(zip(QUADRUPED, (0.0, 0.5, 0.0, 0.5), strict=True)),
    "bound": dict(zip(QUADRUPED, (0.0, 0.0, 0.5, 0.5), strict=True)),
    "walk": dict(zip(QUADRUPED, (0.0, 0.5, 0.25, 0.75), strict=True)),
    "tripod": dict(zip(HEXAPOD, (0.0, 0.5, 0.5, 0.0, 0.0, 0.5), strict=True)),
}
"""Cycles that each leg is ahead of the first one: of quadrupeds M. Hildebrand, Science 150 (1965) 701 (walk:
in lateral sequence), of six legs D. Wilson, Annual Review of Entomology 11 (1966) 103."""

UNDULATION, SPINE, LAG = "undulation", "spine", "lag"
"""Template of a wave that runs along the body, its only leg, and the shift from joint to joint."""

NAMES = (*TEMPLATES, UNDULATION)


class TieFile(FileRecord):
    """One tie in a file.

    Attributes:
        like: the channel that this one follows.
        shift: cycles that it is ahead, or the name of a shift that the search chooses; ``-NAME`` for behind.
        mirrored: whether its angles have the other sign.
    """

    like: Name
    shift: Finite | Name = 0.0
    mirrored: bool = False


class GaitBounds(FileRecord):
    """What gaits a search may try.

    Attributes:
        period_s: the periods, s.
        templates: phases of the legs with which the search begins, some of `NAMES`; it goes on with the best.
        legs: the channels of each leg, the same joints in the same order; for an undulation, those of the
            spine from head to tail, by default all.
        mirrored: channels of legs whose angles have the other sign than those of the first leg.
        ties: ties by channel; they come before those of a template.
        shifts: bounds of shifts that ties name, cycles.
        freed_share: share of the budget for the search without ties, from the best gait with them.
    """

    period_s: tuple[Period, Period]
    templates: list[Name] | None = None
    legs: dict[Name, Annotated[list[Name], Field(min_length=1)]] | None = None
    mirrored: list[Name] | None = None
    ties: dict[Name, TieFile] | None = None
    shifts: dict[Name, tuple[Finite, Finite]] | None = None
    freed_share: Annotated[float, Field(strict=True, ge=0.0, le=0.9)] | None = None


def tied_spaces(gait: GaitBounds, full: GaitSpace, start_deg: Mapping[str, float]) -> list[TiedSpace]:
    """Return the spaces with which a search begins: one for each template, or that of the ties.

    An undulation is nearly the same to both sides of the start: otherwise it only steers.

    Args:
        gait: the file's ``[gait]``.
        full: the space of all gaits.
        start_deg: targets before the gait, deg, by channel; 0 where a channel is not named.

    Raises:
        ValueError: a name is unknown, legs differ, or ties contradict each other.
    """
    _check(gait, full)
    shifts = dict(gait.shifts or {})
    ties = {name: _tie(name, tie, shifts) for name, tie in (gait.ties or {}).items()}
    if not gait.templates:
        return [TiedSpace.of("ties", full, ties, shifts)] if ties else []
    spaces = []
    for template in gait.templates:
        if template == UNDULATION:
            spine = (gait.legs or {}).get(SPINE, list(full.channels))
            made, middles = _wave(spine, gait.mirrored or ()), {spine[0]: start_deg.get(spine[0], 0.0)}
            chosen = {LAG: (-0.5, 0.5)} | shifts
        else:
            made, middles, chosen = _phased(gait, template), {}, shifts
        spaces.append(TiedSpace.of(template, full, made | ties, chosen, middles))
    return spaces


def _check(gait: GaitBounds, full: GaitSpace) -> None:
    """Check the names."""
    channels = list(full.channels)
    known = {
        "templates": (gait.templates or [], "template", NAMES),
        "ties": (gait.ties or [], "channel", channels),
        "mirrored": (gait.mirrored or [], "channel", channels),
        "legs": (gait.legs or [], "leg", (*HEXAPOD, SPINE)),
        **{f"legs.{leg}": (names, "channel", channels) for leg, names in (gait.legs or {}).items()},
        **{f"ties.{name}.like": ([tie.like], "channel", channels) for name, tie in (gait.ties or {}).items()},
    }
    for key, (names, what, options) in known.items():
        for name in names:
            if name not in options:
                raise ValueError(str(unknown_name(f"gait.{key}", what, name, options)))
    for name, (low, high) in (gait.shifts or {}).items():
        if not low <= high <= low + 1.0:
            raise ValueError(f"gait.shifts.{name}: found {[low, high]}; allowed: [low, high], up to a cycle")
    used = [name for names in (gait.legs or {}).values() for name in names]
    twice = next((name for name in used if used.count(name) > 1), None)
    if twice is not None:
        raise ValueError(f"gait.legs: found {twice!r} twice; allowed: each channel once")
    if gait.mirrored and not gait.templates:
        raise ValueError("gait.mirrored: found without `templates`; allowed: mirrored = true in a tie")


def _tie(name: str, tie: TieFile, shifts: Mapping[str, object]) -> Tie:
    if isinstance(tie.shift, float):
        return Tie(tie.like, tie.shift, mirrored=tie.mirrored)
    by = tie.shift.removeprefix("-")
    if by not in shifts:
        raise ValueError(str(unknown_name(f"gait.ties.{name}.shift", "shift", by, shifts)))
    return Tie(tie.like, 0.0, by, -1 if tie.shift.startswith("-") else 1, tie.mirrored)


def _phased(gait: GaitBounds, template: str) -> dict[str, Tie]:
    """Return the ties of a template of legs."""
    phases = TEMPLATES[template]
    legs = gait.legs or {}
    for leg in phases:
        if leg not in legs:
            raise ValueError(f"gait.legs.{leg}: missing; the template {template!r} needs it")
    first, *others = (legs[leg] for leg in phases)
    mirrored = set(gait.mirrored or ())
    ties = {}
    for names, ahead in zip(others, list(phases.values())[1:], strict=True):
        if len(names) != len(first):
            raise ValueError(
                f"gait.legs: found legs of {len(first)} and {len(names)} channels; allowed: alike"
            )
        for leader, name in zip(first, names, strict=True):
            ties[name] = Tie(leader, ahead, mirrored=(name in mirrored) != (leader in mirrored))
    return ties


def _wave(spine: Sequence[str], mirrored: Sequence[str]) -> dict[str, Tie]:
    """Return the ties of a wave along the body: each joint moves like the one before it, a lag later."""
    return {
        name: Tie(before, 0.0, LAG, -1, (name in mirrored) != (before in mirrored))
        for before, name in pairwise(spine)
    }
