"""Scores diagnoses of sealed cases of logged commands: causes, targets, sizes, intervals, false causes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sealed_cases import Kind

from gaitopt.blind.answers import FittedParameter
from gaitopt.blind.scoring import Estimate, rate

TWINS = ("command_latency", "channel_timing", "clock_offset")
"""On a bench of one servo, these are the same: one is named, and the others in ``ambiguous_with``, or not."""


@dataclass(frozen=True)
class Planted:
    """One planted effect, and what the diagnosis says of it.

    Attributes:
        name, target: the effect.
        value: what was planted.
        gap: what it changes beside the others, in floors.
        named: whether it is among the causes.
        in_set: whether it is among the causes or ``ambiguous_with``.
        on_target: whether the most probable set has it on this target.
        fitted: its size and interval where it has; None elsewhere.
        error: error of the size, as a share of what was planted; None without `fitted`.
    """

    name: str
    target: str
    value: float
    gap: float
    named: bool
    in_set: bool
    on_target: bool
    fitted: FittedParameter | None
    error: float | None

    @property
    def covered(self) -> bool:
        """Whether the interval has the true value."""
        return self.fitted is not None and self.fitted.covers(self.value)


@dataclass(frozen=True)
class Scored:
    """One case and its diagnosis.

    Attributes:
        case, kind: its name and kind.
        size: small, middle or large, of a single.
        planted: what was planted.
        verdict, causes, ambiguous_with: as in ``diagnosis.json``.
        false: causes that were not planted.
        wall_s: time of the diagnosis.
    """

    case: str
    kind: str
    planted: Sequence[Planted]
    verdict: str
    causes: Sequence[str]
    ambiguous_with: Sequence[str]
    false: Sequence[str]
    wall_s: float

    @property
    def all_named(self) -> bool:
        """Whether every planted effect is among the causes."""
        return all(one.named for one in self.planted)

    @property
    def right(self) -> bool:
        """Whether the causes are the planted effects and no others, each on its target."""
        return self.all_named and not self.false and all(one.on_target for one in self.planted)


def scored(row: Mapping[str, Any], kinds: Mapping[str, Kind]) -> Scored:
    """Return a case of the record, scored.

    Args:
        row: the case's row: `truth`, and `found` as `kept` returns it.
        kinds: the effects of its rig.
    """
    truth, found = row["truth"], row["found"]
    causes, also = found["causes"], found["ambiguous_with"]
    names = [one["name"] for one in truth["effects"]]
    missed_twin = any(n in TWINS and n not in causes for n in names)
    false = [n for n in causes if n not in names and not (missed_twin and n in TWINS)]
    planted = [_planted(one, truth, found, kinds) for one in truth["effects"]]
    return Scored(row["case"], truth["kind"], planted, found["verdict"], causes, also, false, row["wall_s"])


def _planted(
    one: Mapping[str, Any], truth: Mapping[str, Any], found: Mapping[str, Any], kinds: Mapping[str, Kind]
) -> Planted:
    name, target = one["name"], one["target"]
    ((parameter, value),) = one["parameters"].items()
    first = found["explanations"][0]["effects"] if found["explanations"] else []
    targets = (target, "all") if name in TWINS else (target,)
    row = next((r for r in first if r["name"] == name and r["target"] in (*targets, "none")), None)
    fitted = FittedParameter.model_validate(row["parameters"][parameter]) if row else None
    twin = name in TWINS and any(n in TWINS for n in found["causes"])
    named = name in found["causes"] or twin
    error = None
    if fitted is not None and fitted.value is not None:
        neutral = kinds[name].neutral
        error = abs(fitted.value - value) / abs(value - neutral if math.isfinite(neutral) else value)
    gap = truth["gaps_over_floor"][f"{name}.{target}"]
    in_set = named or name in found["ambiguous_with"]
    return Planted(name, target, value, gap, named, in_set, twin or row is not None, fitted, error)


KEPT = ("verdict", "causes", "ambiguous_with", "other_probability", "misfit_trials", "gap_angles", "defects")


def kept(content: Mapping[str, Any], truth: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts of a diagnosis that a record keeps."""
    names = {*(one["name"] for one in truth["effects"]), *content["causes"], *content["ambiguous_with"]}
    return {key: content[key] for key in KEPT} | {
        "explanations": content["explanations"][:3],
        "effects": [row for row in content["effects"] if row["name"] in names],
    }


# --- record -----------------------------------------------------------------------------------


def summary(cases: Sequence[Scored]) -> dict[str, Any]:
    """Return the figures of some cases."""
    planted = [one for case in cases for one in case.planted]
    fitted = [one for one in planted if one.named and one.fitted is not None]
    errors = [one.error for one in fitted if one.error is not None]
    times = [case.wall_s for case in cases]
    return {
        "cases": len(cases),
        "all_named": _share(cases, lambda c: c.all_named),
        "right": _share(cases, lambda c: c.right),
        "named": _share(planted, lambda p: p.named),
        "in_set": _share(planted, lambda p: p.in_set),
        "on_target": _share([p for p in planted if p.named], lambda p: p.on_target),
        "false_cause": _share(cases, lambda c: bool(c.false)),
        "covered": _share(fitted, lambda p: p.covered),
        "size_error": {
            "median": float(np.median(errors)) if errors else None,
            "largest": max(errors, default=None),
        },
        "wall_s": {"median": float(np.median(times)), "largest": max(times)} if times else None,
    }


def _share(items: Sequence[Any], hit: Callable[[Any], bool]) -> dict[str, object]:
    found: Estimate = rate(items, hit)
    return found.to_dict() | {"hits": sum(map(hit, items))}


def groups(cases: Sequence[Scored]) -> dict[str, list[Scored]]:
    """Return cases by kind; singles by their effect, and all of them."""
    found: dict[str, list[Scored]] = {}
    singles = [case for case in cases if case.kind == "single"]
    for case in sorted(singles, key=lambda c: c.planted[0].name):
        found.setdefault(case.planted[0].name, []).append(case)
    titles = {"single": "one effect, all", "several": "three effects", "none": "no effect"}
    return found | {
        title: [case for case in cases if case.kind == kind]
        for kind, title in titles.items()
        if any(case.kind == kind for case in cases)
    }


def table(cases: Sequence[Scored]) -> list[str]:
    """Return a table with a row for each kind of case."""
    lines = [
        "| planted | cases | all causes named | effects named | false causes | intervals that cover | "
        "error of the size, median | time of a case, s |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for title, rows in groups(cases).items():
        one = summary(rows)
        nothing = title == "no effect"
        named = "–" if nothing else _of(one["all_named"])
        effects = "–" if nothing else _of(one["named"])
        error = one["size_error"]["median"]
        lines.append(
            f"| {title if ' ' in title else f'`{title}`'} | {one['cases']} | {named} | {effects} | "
            f"{_of(one['false_cause'])} | {_of(one['covered']) if one['covered']['cases'] else '–'} | "
            f"{'–' if error is None else f'{error:.1%}'} | {one['wall_s']['median']:.0f} |"
        )
    return lines


def _of(share: Mapping[str, Any]) -> str:
    return f"{share['hits']} of {share['cases']}"


def failures(cases: Iterable[Scored]) -> list[str]:
    """Return one line for each thing that went wrong."""
    lines = []
    for case in cases:
        what = [f"missed `{p.name}`" for p in case.planted if not p.named]
        what += [f"`{p.name}` on another servo" for p in case.planted if p.named and not p.on_target]
        what += [f"false `{name}`" for name in case.false]
        what += [_outside(p) for p in case.planted if p.named and p.fitted and not p.covered]
        if what:
            planted = ", ".join(f"{p.name}.{p.target} {p.value:g} ({p.gap:.0f} floors)" for p in case.planted)
            also = f" or {', '.join(case.ambiguous_with)}" if case.ambiguous_with else ""
            said = f"{case.verdict}: {', '.join(case.causes) or 'nothing'}{also}"
            lines.append(f"- *{case.case}* ({planted or 'nothing'}): {'; '.join(what)}. Said: {said}.")
    return lines


def _outside(one: Planted) -> str:
    assert one.fitted is not None
    low, high = (math.nan if end is None else end for end in one.fitted.ci90)
    value = math.nan if one.fitted.value is None else one.fitted.value
    return f"`{one.name}` {value:.4g} ({low:.4g} to {high:.4g})"
