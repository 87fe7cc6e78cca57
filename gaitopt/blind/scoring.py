"""The record of diagnoses on sealed cases: how often they are right, how sure, how far the gap shrinks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np
from scipy.stats import binomtest, bootstrap

from gaitopt.blind.answers import Case

_Scored = TypeVar("_Scored")


@dataclass(frozen=True)
class ScoreSettings:
    """How diagnoses are scored.

    Attributes:
        small_gap: cases with a smaller gap, in floors, are only counted.
        confidence: of every interval.
        resamples: of a mean's bootstrap.
        bins: edges of the probabilities by which the calibration is reported.
        oracle_from: a true effect that shrinks the gap less than this says nothing about the answer's
            shrinkage.
        oracle_most: an answer counts as at most this many times as good as the true effect.
    """

    small_gap: float = 3.0
    confidence: float = 0.9
    resamples: int = 1000
    bins: tuple[float, ...] = (0.0, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)
    oracle_from: float = 0.2
    oracle_most: float = 1.5


@dataclass(frozen=True)
class Estimate:
    """A figure with its 90 % interval and the number of cases behind it; None where there are none."""

    value: float | None
    ci90: tuple[float | None, float | None]
    cases: int

    def to_dict(self) -> dict[str, object]:
        """Return the row of the record."""
        return {"value": self.value, "ci90": list(self.ci90), "cases": self.cases}


_UNKNOWN = Estimate(None, (None, None), 0)


@dataclass(frozen=True)
class CalibrationBin:
    """How often the first cause was right where its probability was in one range.

    Attributes:
        said: mean probability.
        right: how often it was right.
    """

    said: float
    right: Estimate

    def to_dict(self) -> dict[str, object]:
        """Return the row of the record."""
        return {"said": self.said} | self.right.to_dict()


@dataclass(frozen=True)
class ScoredCase:
    """One case in the record: what was planted and what was answered.

    Attributes:
        case, kind: name and kind of the case.
        planted: effects with their targets.
        gap_over_floor: gap planted, in floors.
        verdict, causes, ambiguous_with, other_probability, shrinkage: as in ``diagnosis.json``.
    """

    case: str
    kind: str
    planted: list[str]
    gap_over_floor: float
    verdict: str
    causes: list[str]
    ambiguous_with: list[str]
    other_probability: float | None
    shrinkage: float | None


@dataclass(frozen=True)
class Score:
    """The record. Shares are of cases whose gap is not small; of single ones unless said otherwise.

    Attributes:
        cases: number of cases.
        top_right: first cause right.
        truth_in_set: truth among the effects named.
        mean_set_size: number of effects named, where any is.
        missed: nothing named.
        false_cause: something named where nothing was planted.
        outside_recognised: disturbances called unexplained or partly explained.
        outside_blamed: disturbances explained by effects of the library.
        pair_both, pair_either: of pairs, both or one named.
        several_named: of several effects, those named among the ones that are visible beside the others.
        several_named_beside_errors: the same among those that are visible beside small errors, too.
        several_false: causes in a case of several effects that were not planted: mean number.
        several_absent: the same without small errors of the robot, of which the answer has the right size.
        misfits_found: trials that do not fit the others, named as such.
        misfits_found_beside_errors: the same among those that are moved visibly beside small errors.
        misfits_false: other trials of such cases that were named so.
        coverage: true parameter inside its interval, where the effect was found.
        speeds_covered: speeds of baselines that were not recorded inside their intervals; all kinds.
        parameter_error: relative error of the parameter, where the effect was found.
        shrinkage_of_oracle: shrinkage of the gap, in that of the true effect.
        calibration: probability of the first cause against how often it was right.
        small_gaps: number of cases with a small gap, which are in no figure.
        rows: the cases.
        settings: how they were scored.
    """

    cases: int
    top_right: Estimate
    truth_in_set: Estimate
    mean_set_size: Estimate
    missed: Estimate
    false_cause: Estimate
    outside_recognised: Estimate
    outside_blamed: Estimate
    pair_both: Estimate
    pair_either: Estimate
    several_named: Estimate
    several_named_beside_errors: Estimate
    several_false: Estimate
    several_absent: Estimate
    misfits_found: Estimate
    misfits_found_beside_errors: Estimate
    misfits_false: Estimate
    coverage: Estimate
    speeds_covered: Estimate
    parameter_error: Estimate
    shrinkage_of_oracle: Estimate
    calibration: tuple[CalibrationBin, ...]
    small_gaps: int
    rows: tuple[ScoredCase, ...]
    settings: ScoreSettings = ScoreSettings()

    def to_dict(self) -> dict[str, object]:
        """Return the answer of `gaitopt blind score`."""
        estimates = {key: value for key, value in vars(self).items() if isinstance(value, Estimate)}
        return {
            "cases": self.cases,
            **{key: value.to_dict() for key, value in estimates.items()},
            "calibration": [one.to_dict() for one in self.calibration],
            "small_gaps": self.small_gaps,
            "rows": [asdict(row) for row in self.rows],
        }


def score(cases: Sequence[Case], settings: ScoreSettings = ScoreSettings()) -> Score:
    """Return the record of some diagnosed cases."""
    large = [c for c in cases if c.kind == "none" or c.truth.gap_over_floor >= settings.small_gap]
    singles, none, outside, pairs, several = (
        [c for c in large if c.kind == kind] for kind in ("single", "none", "outside", "pair", "several")
    )
    visible = [(c, name) for c in several for name in c.visible(settings.small_gap)]
    clear = [(c, name) for c in several for name in c.visible_beside_errors(settings.small_gap)]
    trials = [(c, name) for c in several for name in c.truth.trials]
    odd = [(c, name) for c in several for name in c.misfits(settings.small_gap)]
    found = [c.parameter for c in singles if c.top_right]
    known = [parameter for parameter in found if parameter is not None]
    errors = [
        abs(p.fitted.value - p.true) / max(abs(p.true), 1e-12) for p in known if p.fitted.value is not None
    ]
    return Score(
        cases=len(cases),
        top_right=rate(singles, lambda c: c.top_right, settings),
        truth_in_set=rate(singles, lambda c: c.in_set, settings),
        mean_set_size=mean([float(len(c.answer)) for c in singles if c.answer], settings),
        missed=rate(singles, lambda c: not c.answer, settings),
        false_cause=rate(none, lambda c: bool(c.answer), settings),
        outside_recognised=rate(
            outside, lambda c: c.diagnosis.verdict in ("unexplained", "partly_explained"), settings
        ),
        outside_blamed=rate(outside, lambda c: c.diagnosis.verdict in ("explained", "ambiguous"), settings),
        pair_both=rate(pairs, lambda c: c.in_set, settings),
        pair_either=rate(pairs, lambda c: any(name in c.answer for name in c.planted), settings),
        several_named=rate(visible, lambda pair: pair[1] in pair[0].answer, settings),
        several_named_beside_errors=rate(clear, lambda pair: pair[1] in pair[0].answer, settings),
        several_false=mean([float(len(c.false_causes)) for c in several], settings),
        several_absent=mean([float(len(c.absent_causes)) for c in several], settings),
        misfits_found=rate([t for t in trials if _is_misfit(t)], _is_called_misfit, settings),
        misfits_found_beside_errors=rate(odd, _is_called_misfit, settings),
        misfits_false=rate([t for t in trials if not _is_misfit(t)], _is_called_misfit, settings),
        coverage=rate(known, lambda p: p.fitted.covers(p.true), settings),
        speeds_covered=rate(
            [pair for c in large for pair in c.speeds.values()],
            lambda pair: pair[1].covers(pair[0]),
            settings,
        ),
        parameter_error=mean(errors, settings),
        shrinkage_of_oracle=mean(_of_oracle(singles, settings), settings),
        calibration=tuple(_calibration(singles, settings)),
        small_gaps=len(cases) - len(large),
        rows=tuple(map(_row, cases)),
        settings=settings,
    )


def _is_misfit(trial: tuple[Case, str]) -> bool:
    case, name = trial
    return name in case.truth.misfits


def _is_called_misfit(trial: tuple[Case, str]) -> bool:
    case, name = trial
    return name in case.diagnosis.misfit_trials


def rate(
    cases: Sequence[_Scored], hit: Callable[[_Scored], bool], settings: ScoreSettings = ScoreSettings()
) -> Estimate:
    """Return a share with Wilson's interval, J. Am. Stat. Assoc. 22 (1927) 209."""
    count, hits = len(cases), sum(map(hit, cases))
    if count == 0:
        return _UNKNOWN
    interval = binomtest(hits, count).proportion_ci(settings.confidence, method="wilson")
    return Estimate(hits / count, (float(interval.low), float(interval.high)), count)


def mean(values: Sequence[float], settings: ScoreSettings = ScoreSettings()) -> Estimate:
    """Return a mean with the percentile interval of a bootstrap."""
    if not values:
        return _UNKNOWN
    if len(values) == 1:  # nothing to draw from
        return Estimate(float(values[0]), (float(values[0]), float(values[0])), 1)
    drawn = bootstrap(
        (np.array(values),),
        np.mean,
        n_resamples=settings.resamples,
        confidence_level=settings.confidence,
        method="percentile",
        rng=np.random.default_rng(0),
    )
    low, high = (float(end) for end in drawn.confidence_interval)
    return Estimate(float(np.mean(values)), (low, high), len(values))


def _of_oracle(cases: Sequence[Case], settings: ScoreSettings) -> list[float]:
    """Return how much of the shrinkage with the true effect known each answer reaches."""
    shares = []
    for case in cases:
        row, reached = case.row(case.planted[0]), case.diagnosis.gap.shrinkage
        oracle = row.heldout_shrinkage if row else None
        if oracle is not None and oracle > settings.oracle_from and reached is not None:
            shares.append(min(settings.oracle_most, reached / oracle))
    return shares


def _calibration(cases: Sequence[Case], settings: ScoreSettings) -> list[CalibrationBin]:
    """Return for bins of the top cause's probability how often it was right."""
    bins = []
    top = [(c, c.row(c.top)) for c in cases]
    known = [(c, row.probability) for c, row in top if row is not None]
    for low, high in pairwise(settings.bins):
        inside = [(c, p) for c, p in known if low <= p < high or (p >= high == 1.0)]
        if inside:
            said = float(np.mean([p for _, p in inside]))
            bins.append(
                CalibrationBin(said, rate(inside, lambda pair: pair[0].top in pair[0].planted, settings))
            )
    return bins


def _row(case: Case) -> ScoredCase:
    return ScoredCase(
        case=case.name,
        kind=case.kind,
        planted=[f"{effect.name}.{effect.target}" for effect in case.truth.effects],
        gap_over_floor=case.truth.gap_over_floor,
        verdict=case.diagnosis.verdict,
        causes=list(case.diagnosis.causes),
        ambiguous_with=list(case.diagnosis.ambiguous_with),
        other_probability=case.diagnosis.other_probability,
        shrinkage=case.diagnosis.gap.shrinkage,
    )


def sentences(record: Score) -> list[str]:
    """Return the record in words."""
    small = f"{record.small_gaps} of them with a gap below {record.settings.small_gap:g} floors"
    found = [f"{record.cases} cases, {small}"]
    shares = {
        "top cause right": record.top_right,
        "truth inside the set": record.truth_in_set,
        "no cause named": record.missed,
        "false cause where there is none": record.false_cause,
        "cause outside the library recognised": record.outside_recognised,
        "library blamed for a cause outside it": record.outside_blamed,
        "both of a pair named": record.pair_both,
        "one of a pair named": record.pair_either,
        "of several effects, those named": record.several_named,
        "of those that are visible beside small errors": record.several_named_beside_errors,
        "trials that do not fit, found": record.misfits_found,
        "of those that are visible beside small errors, found": record.misfits_found_beside_errors,
        "trials that fit, called misfits": record.misfits_false,
        "90 % intervals that cover": record.coverage,
        "speeds of gaits not filmed, in their 90 % interval": record.speeds_covered,
    }
    means = {
        "mean size of the set": record.mean_set_size,
        "mean number of false causes beside several": record.several_false,
        "of them, those that are no small error of the robot either": record.several_absent,
        "mean relative error of the parameter": record.parameter_error,
        "shrinkage, of what knowing the effect reaches": record.shrinkage_of_oracle,
    }
    for words, one in shares.items():
        if one.cases:
            low, high = one.ci90
            found.append(f"{words}: {one.value:.0%} ({low:.0%} to {high:.0%}, {one.cases} cases)")
    for words, one in means.items():
        if one.cases:
            low, high = one.ci90
            found.append(f"{words}: {one.value:.2f} ({low:.2f} to {high:.2f})")
    return found
