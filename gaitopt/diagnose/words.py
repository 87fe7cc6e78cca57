"""A diagnosis in words: what was found, sentence by sentence."""

from __future__ import annotations

from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.gap.floor import marker_floor
from gaitopt.diagnose.gap.split import Split
from gaitopt.diagnose.judge.experiment import Experiment
from gaitopt.diagnose.judge.gap import Gap
from gaitopt.diagnose.judge.unevenness import UNEVEN
from gaitopt.diagnose.trial_gap import SIGNIFICANT, TrialGap
from gaitopt.robot.signals import is_position

_WORTH_SAYING = 0.15
"""Share of a signal's squared gap from which a component is put into words."""

_SAME_SIZE = 0.04
"""A stride whose size differs by less than this share counts as equally large."""

_FLOOR_PARTS = {
    "spread": "cycles that differ",
    "noise": "measurement noise",
    "start_pose": "the start pose",
    "numerics": "the timestep",
    "clock": "the rounded clock",
    "repeats": "repeats that differ",
}


def answer(diagnosis: Diagnosis) -> str:
    """Return the verdict in one sentence."""
    gap = diagnosis.gap
    figures = f"{_mm(gap.before)} RMS of the marker, floor {_mm(gap.floor)}"
    if diagnosis.verdict == "no_gap":
        return f"No significant gap: {figures}."
    if diagnosis.verdict == "explained" and not (diagnosis.found and diagnosis.found.causes):
        return f"The gap ({figures}) is in the recordings: {', '.join(diagnosis.causes)}."
    if diagnosis.found is not None and diagnosis.found.candidates:
        return f"{_VERDICTS[diagnosis.verdict].format(*_who(diagnosis))} The gap: {_before_after(gap)}."
    text = f"There is a gap: {figures}."
    for first in diagnosis.where[:1]:  # nothing where every part of the gap is within the floor
        part = f"{first.component} of {first.signal} in trial {first.trial}"
        text += f" The largest part of it is {part} ({first.share:.0%})."
    return text


_VERDICTS = {
    "explained": "The gap is explained by {0}.",
    "ambiguous": "These trials cannot tell which effect causes the gap: {0}, or {1}.",
    "partly_explained": "{0} explains only a part of the gap; there is another cause.",
    "unexplained": "No effect of the library explains the gap of held-out trials. The best of them is {0}.",
}


def _who(diagnosis: Diagnosis) -> tuple[str, str]:
    """Return the cause with its parameter, and the effects that the trials cannot separate from it."""
    found = diagnosis.found
    if found is None or found.best is None:
        return "", ""
    best = found.best
    texts = []
    for fit, at in zip(best.fits, best.at, strict=True):
        h = fit.hypothesis
        value = f"{h.value(at):.4g} {h.effect.unit}".strip()
        texts.append(f"{h.name} ({h.effect.parameter} = {value})")
    return " and ".join(texts), " or ".join(found.ambiguous_with)


def _before_after(gap: Gap) -> str:
    """Return the gap on held-out data in words."""
    before, after, floor = map(_mm, (gap.before, gap.after, gap.floor))
    share = gap.shrinkage
    shrinks = "" if share is None else f", which is {share:.0%} of what is above the floor"
    return f"{before} RMS of the marker before, {after} after on held-out trials{shrinks}; floor {floor}"


def _ranking(diagnosis: Diagnosis) -> list[str]:
    """Return the most probable effects, which of them act similarly, and what to measure next."""
    found = diagnosis.found
    if found is None or found.best is None:
        return []
    sentences = []
    best = found.best
    for row in found.effects[:4]:
        estimate = row.parameter
        low, high = estimate.ci90
        text = (
            f"{row.name} ({row.target}): {row.probability:.0%} probable, {estimate.name} = "
            f"{estimate.value:.4g} ({low:.4g} to {high:.4g})"
        )
        if row.name not in best.names:
            text += f"; its signature and that of {best.label} have a cosine of {row.alike:.2f}"
        sentences.append(f"{text}.")
    sentences.append(f"A cause outside the library is {found.other_probability:.0%} probable.")
    if found.unevenness > UNEVEN:
        sentences.append(
            f"The recorded cycles differ from one another {found.unevenness:.0f} times as much as simulated "
            "ones: something acts in some cycles and not in others."
        )
    if diagnosis.experiment is not None:
        period = diagnosis.experiment.gait.period_s
        sentences.append(f"Measure next: a gait of {period:.2f} s. {what_it_tells(diagnosis.experiment)}")
    return sentences


def what_it_tells(experiment: Experiment) -> str:
    """Return which effects the next experiment is expected to separate, and which no gait separates."""
    first, *others = experiment.separates
    text = (
        f"On this gait, {first} and {' or '.join(others)} differ by {experiment.separation:.1f} floors; on "
        f"the gaits measured so far, by {experiment.before:.1f}."
    )
    for one, other in experiment.inseparable:
        text += f" No gait that was tried separates {one} from {other}: measure another signal for that."
    return text


def explanation(diagnosis: Diagnosis) -> list[str]:
    """Return what is known of each trial, and what the defects of its recording are."""
    sentences = _ranking(diagnosis)
    for trial in diagnosis.trials:
        sentences.append(_trial(trial))
        sentences += [f"{trial.name}: {defect.name}: {defect.message}." for defect in trial.defects]
        for name, part in trial.splits.items() if trial.counts else ():
            if part.rms > trial.floors[name].total:
                sentences.append(f"{trial.name}, {name}: {_components(part)}.")
    return sentences


def _trial(trial: TrialGap) -> str:
    ratio = max(trial.ratios.values())
    worst = max(trial.ratios, key=lambda name: trial.ratios[name])
    start = "fitted" if trial.aligned.trial.starts_at_s is None else "as the data set says"
    offset = f"the recording begins at gait time {trial.aligned.offset_s:.2f} s ({start})"
    if any(map(is_position, trial.floors)):
        floor = marker_floor(trial.floors)
        gap = (
            f"gap of {_mm(trial.aligned.marker_rms)} RMS, floor {_mm(floor)}, most of it {_main_part(trial)}"
        )
    else:
        gap = "no marker was measured"
    if ratio <= 1.0:
        verdict = "the gap is below the floor, so this trial is not used to find a cause"
    elif ratio <= SIGNIFICANT:
        verdict = f"{worst} is {ratio:.1f} times its floor, which is not significant"
    else:
        verdict = f"{worst} is {ratio:.1f} times its floor"
    return f"{trial.name}: {gap}; {verdict}; {offset}."


def _main_part(trial: TrialGap) -> str:
    """Return what most of the marker's floor comes from."""
    sums: dict[str, float] = {}
    for name, floor in trial.floors.items():
        if is_position(name):
            for part in _FLOOR_PARTS:
                sums[part] = sums.get(part, 0.0) + (getattr(floor, part) or 0.0) ** 2
    return _FLOOR_PARTS[max(sums, key=lambda part: sums[part])]


def _components(part: Split) -> str:
    total = part.rms**2
    ordered = sorted(part.squares.items(), key=lambda item: -item[1])
    worth = [name for name, square in ordered if square >= _WORTH_SAYING * total]
    texts = [f"{part.squares[name] / total:.0%} {name}{_what(part, name)}" for name in worth]
    return "; ".join(texts)


def _what(part: Split, component: str) -> str:
    if component == "drift":
        if part.travel is None:
            return " (it drifts from the simulated path)"
        measured, simulated = part.travel
        return (
            f" (net travel {_length(part, measured)} a cycle, simulated {_length(part, simulated)}; the size "
            f"of the stride, {part.size:.2f} times the simulated one, does not explain it)"
        )
    if component == "stride":
        if abs(part.size - 1.0) < _SAME_SIZE:
            return " (inside a cycle it moves as far as simulated, but with another shape)"
        return f" (inside a cycle it moves {part.size:.2f} times as far as simulated)"
    if component == "timing":
        late = "later" if part.delay_s > 0.0 else "earlier"
        return f" (it moves {1e3 * abs(part.delay_s):.0f} ms {late} than simulated)"
    if component == "transient":
        return " (it starts differently from the simulation)"
    return " (it differs from cycle to cycle, or samples jumped)"


def _length(part: Split, value: float) -> str:
    return _mm(value) if is_position(part.signal) else f"{value:.3g} rad"


def _mm(value: float) -> str:
    return f"{1e3 * value:.3g} mm"
