"""The record of diagnoses on sealed cases: how often right, how sure, how far the gap shrank."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import read_json
from gaitopt.core.statistics import NORMAL_95

SMALL = 3.0
"""Cases with a smaller gap, in floors, are reported apart."""

TIED = 0.995
"""Effects whose whitened signatures have such a cosine are told apart by no likelihood."""

_BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)


@dataclass(frozen=True)
class Case:
    """One sealed case and its diagnosis."""

    name: str
    truth: Mapping[str, Any]
    diagnosis: Mapping[str, Any]

    @property
    def kind(self) -> str:
        """single, pair, none or outside."""
        return str(self.truth["kind"])

    @property
    def planted(self) -> list[str]:
        """The effects planted."""
        return [str(row["name"]) for row in self.truth["effects"]]

    @property
    def answer(self) -> list[str]:
        """Everything that the answer names."""
        return [*self.diagnosis["causes"], *self.diagnosis["ambiguous_with"]]

    @property
    def top(self) -> str | None:
        """The first cause named."""
        return next(iter(self.diagnosis["causes"]), None)

    @property
    def top_right(self) -> bool:
        """Whether the top cause is right, a tie that no data can split counting as right."""
        return self.top in self.planted or (self.in_set and self._tied())

    @property
    def in_set(self) -> bool:
        """Whether the truth is among the effects named."""
        return all(name in self.answer for name in self.planted)

    def _tied(self) -> bool:
        """Whether the planted effect has the signature of the one cause named; of two, neither is a tie."""
        row = self.row(self.planted[0])
        return len(self.diagnosis["causes"]) == 1 and row is not None and row["alike"] >= TIED

    def row(self, effect: str) -> Mapping[str, Any] | None:
        """Return what the diagnosis says of an effect."""
        return next((r for r in self.diagnosis["effects"] if r["name"] == effect), None)


def read_cases(folder: Path, diagnoses: Path) -> list[Case]:
    """Return every sealed case that has been diagnosed.

    Args:
        folder: the folder of the cases, with its ``sealed`` truth.
        diagnoses: the folder with a run folder for each case.

    Raises:
        GaitoptError: there is no sealed truth.
    """
    sealed = sorted((folder / "sealed").glob("case-*.json"))
    if not sealed:
        raise GaitoptError(f"{folder}: no sealed/case-*.json there")
    cases = []
    for path in sealed:
        found = diagnoses / path.stem / "diagnosis.json"
        if found.is_file():
            cases.append(Case(path.stem, read_json(path), read_json(found)))
    return cases


def score(cases: Sequence[Case]) -> dict[str, Any]:
    """Return the record: each figure with its 90 % interval and the number of cases behind it."""
    large = [c for c in cases if c.kind == "none" or c.truth["gap_over_floor"] >= SMALL]
    singles = [c for c in large if c.kind == "single"]
    of = {kind: [c for c in large if c.kind == kind] for kind in ("none", "outside", "pair")}
    return {
        "cases": len(cases),
        "top_right": rate(singles, lambda c: c.top_right),
        "truth_in_set": rate(singles, lambda c: c.in_set),
        "mean_set_size": mean([float(len(c.answer)) for c in singles if c.answer]),
        "missed": rate(singles, lambda c: not c.answer),
        "false_cause": rate(of["none"], lambda c: bool(c.answer)),
        "outside_recognised": rate(
            of["outside"], lambda c: c.diagnosis["verdict"] in ("unexplained", "partly_explained")
        ),
        "outside_blamed": rate(of["outside"], lambda c: c.diagnosis["verdict"] in ("explained", "ambiguous")),
        "pair_both": rate(of["pair"], lambda c: c.in_set),
        "pair_either": rate(of["pair"], lambda c: any(name in c.answer for name in c.planted)),
        "coverage": _coverage(singles),
        "parameter_error": mean(_errors(singles)),
        "shrinkage_of_oracle": mean(_of_oracle(singles)),
        "calibration": _calibration(singles),
        "small_gaps": len(cases) - len(large),
        "rows": [_row(case) for case in cases],
    }


def rate(cases: Sequence[Case], hit: Callable[[Case], bool]) -> dict[str, Any]:
    """Return a share with Wilson's 90 % interval."""
    count, hits = len(cases), sum(map(hit, cases))
    if count == 0:
        return {"value": None, "ci90": [None, None], "cases": 0}
    share, spread = hits / count, NORMAL_95**2 / count
    centre = (share + 0.5 * spread) / (1.0 + spread)
    half = NORMAL_95 * math.sqrt(share * (1.0 - share) / count + 0.25 * spread / count) / (1.0 + spread)
    # An end that is a share of 0 or 1 may miss it by rounding, which plots of the ends do not take.
    low, high = max(0.0, min(share, centre - half)), min(1.0, max(share, centre + half))
    return {"value": share, "ci90": [low, high], "cases": count}


def mean(values: Sequence[float]) -> dict[str, Any]:
    """Return a mean with a bootstrap's 90 % interval."""
    if not values:
        return {"value": None, "ci90": [None, None], "cases": 0}
    rng = np.random.default_rng(0)
    drawn = rng.choice(np.array(values), (1000, len(values))).mean(axis=1)
    low, high = np.quantile(drawn, (0.05, 0.95)).tolist()
    return {"value": float(np.mean(values)), "ci90": [low, high], "cases": len(values)}


def _parameter(case: Case) -> tuple[float, Mapping[str, Any]] | None:
    """Return the true value and the fitted one of a single case whose effect and target were found."""
    planted = case.truth["effects"][0]
    row = case.row(planted["name"])
    if row is None or row["target"] != planted["target"]:
        return None
    name, true = next(iter(planted["parameters"].items()))
    return float(true), row["parameters"][name]


def _coverage(cases: Sequence[Case]) -> dict[str, Any]:
    known = [c for c in cases if c.top_right and _parameter(c) is not None]

    def covers(case: Case) -> bool:
        found = _parameter(case)
        return found is not None and found[1]["ci90"][0] <= found[0] <= found[1]["ci90"][1]

    return rate(known, covers)


def _errors(cases: Sequence[Case]) -> list[float]:
    pairs = [_parameter(c) for c in cases if c.top_right]
    return [abs(p[1]["value"] - p[0]) / max(abs(p[0]), 1e-12) for p in pairs if p is not None]


def _of_oracle(cases: Sequence[Case]) -> list[float]:
    """Return how much of the shrinkage with the true effect known the answer reaches."""
    shares = []
    for case in cases:
        row, reached = case.row(case.planted[0]), case.diagnosis["gap"]["shrinkage"]
        if row and row["heldout_shrinkage"] and row["heldout_shrinkage"] > 0.2 and reached is not None:
            shares.append(min(1.5, reached / row["heldout_shrinkage"]))
    return shares


def _calibration(cases: Sequence[Case]) -> list[dict[str, Any]]:
    """Return for bins of the top cause's probability how often it was right."""
    rows = []
    top = [(c, c.row(c.top or "")) for c in cases]
    known = [(c, float(r["probability"])) for c, r in top if r is not None]
    for low, high in pairwise(_BINS):
        inside = [(c, p) for c, p in known if low <= p < high or (p == high == 1.0)]
        if inside:
            said = float(np.mean([p for _, p in inside]))
            rows.append({"said": said} | rate([c for c, _ in inside], lambda c: c.top in c.planted))
    return rows


def _row(case: Case) -> dict[str, Any]:
    return {
        "case": case.name,
        "kind": case.kind,
        "planted": [f"{r['name']}.{r['target']}" for r in case.truth["effects"]],
        "gap_over_floor": case.truth["gap_over_floor"],
        "verdict": case.diagnosis["verdict"],
        "causes": list(case.diagnosis["causes"]),
        "ambiguous_with": list(case.diagnosis["ambiguous_with"]),
        "other_probability": case.diagnosis["other_probability"],
        "shrinkage": case.diagnosis["gap"]["shrinkage"],
    }


_WORDS = {
    "top_right": "top cause right",
    "truth_in_set": "truth inside the set",
    "missed": "no cause named",
    "false_cause": "false cause where there is none",
    "outside_recognised": "cause outside the library recognised",
    "outside_blamed": "library blamed for a cause outside it",
    "pair_both": "both of a pair named",
    "pair_either": "one of a pair named",
    "coverage": "90 % intervals that cover",
}


def sentences(record: Mapping[str, Any]) -> list[str]:
    """Return the record in words."""
    found = [f"{record['cases']} cases, {record['small_gaps']} of them with a gap below {SMALL:g} floors"]
    for key, words in _WORDS.items():
        row = record[key]
        if row["cases"]:
            low, high = row["ci90"]
            found.append(f"{words}: {row['value']:.0%} ({low:.0%} to {high:.0%}, {row['cases']} cases)")
    for key, words in (
        ("mean_set_size", "mean size of the set"),
        ("parameter_error", "mean relative error of the parameter"),
        ("shrinkage_of_oracle", "shrinkage, of what knowing the effect reaches"),
    ):
        if record[key]["cases"]:
            low, high = record[key]["ci90"]
            found.append(f"{words}: {record[key]['value']:.2f} ({low:.2f} to {high:.2f})")
    return found
