"""What a diagnosis is worth beside the sealed truth: the gap it closes, and the speeds it predicts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np

from gaitopt.blind.answers import Case
from gaitopt.blind.scoring import mean
from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.fit.runner import RobotRequest, Runner
from gaitopt.diagnose.judge.causes import Causes
from gaitopt.diagnose.predictions import PredictionSettings, predictions
from gaitopt.effects import EFFECTS
from gaitopt.effects.active import Values

_SHOWN = 0.9
"""Where the true effects leave more than this share of the gap, how much of that was closed says nothing."""

_MOST = 1.5
"""A diagnosis counts as at most this many times as good as the true effects."""


def against_truth(
    diagnosis: Diagnosis, truth: dict[str, Any], executor: Executor, seed: int
) -> dict[str, Any]:
    """Return what the robot with the true effects leaves of the recordings, and speeds before the diagnosis.

    Args:
        diagnosis: the diagnosis.
        truth: the sealed truth.
        executor: where robots are simulated.
        seed: the diagnosis' seed.

    Returns:
        ``left``: RMS error of the marker, m, of the nominal robot, of the corrected robot on held-out data,
        and of the nominal robot with the true effects. ``before``: the speed expected of each gait without
        any effect. Both are empty where nothing was fitted, and in cases of other kinds than several effects.
    """
    found = diagnosis.found
    if found is None or truth["kind"] != "several":
        return {"left": {}, "before": {}}
    return {"left": _left(diagnosis, found, truth, executor), "before": _before(found, executor, seed)}


def _left(diagnosis: Diagnosis, found: Causes, truth: dict[str, Any], executor: Executor) -> dict[str, float]:
    effects = {row["name"]: _values(row) for row in truth["effects"]}
    (known,) = Runner(executor).compare(found.trial_set, [RobotRequest(effects, ())])
    if known is None:
        return {}
    best = diagnosis.correction or found.none
    true = math.sqrt(float(np.mean(known.marker**2)))
    return {"nominal_m": found.none.rms_left, "corrected_m": best.rms_left, "true_m": true}


def _values(row: dict[str, Any]) -> Values:
    targeted = {} if EFFECTS[row["name"]].target == "none" else {"target": row["target"]}
    values: Values = {**row["parameters"], **targeted}
    return values


def _before(found: Causes, executor: Executor, seed: int) -> dict[str, Any]:
    """Return the predictions by no effect and no recording, but for what the nominal robot leaves of them."""
    judgement, robots = replace(found.judgement, fits=(), sets=None), found.judgement.tolerant_robots
    if robots is not None:  # robots that change nothing of the recordings tell nothing
        unlearnt = replace(robots, changes=np.zeros_like(robots.changes))
        judgement = replace(judgement, tolerant_robots=unlearnt)
    nothing = replace(found, judgement=judgement)
    none: list[tuple[()]] = [()] * PredictionSettings.tolerant
    rows = predictions(nothing, none, executor, seed)
    return {row.gait: row.speed.to_dict() for row in rows if row.speed and not row.filmed}


def worth(rows: Sequence[dict[str, Any]], cases: Sequence[Case]) -> dict[str, Any]:
    """Return the means over cases of several effects: the gap closed, in that of the truth; and intervals.

    Args:
        rows: the record's rows, with what `against_truth` returned.
        cases: the same cases.
    """
    closed, narrower, shift = [], [], []
    for one, case in zip(rows, cases, strict=True):
        if case.kind != "several":
            continue
        row = one["diagnosis"]
        left = row.get("left")
        if left and left["true_m"] < _SHOWN * left["nominal_m"]:
            share = (left["nominal_m"] - left["corrected_m"]) / (left["nominal_m"] - left["true_m"])
            closed.append(min(_MOST, share))
        for gait, (true, now) in case.speeds.items():
            if was := row.get("before", {}).get(gait):
                narrower.append(_width(now.ci90) / _width(was["ci90"]))
                shift.append(abs(float(now.mean or 0.0) - true) / abs(was["mean"] - true))
    return {
        "closed_of_truth": mean(closed).to_dict() | {"median": _median(closed)},
        "interval_of_before": mean(narrower).to_dict() | {"median": _median(narrower)},
        "error_of_before": {"median": _median(shift), "cases": len(shift)},
    }


def _width(ends: Sequence[float | None]) -> float:
    low, high = ends
    return float(high or 0.0) - float(low or 0.0)


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None
