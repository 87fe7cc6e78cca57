"""A diagnosis in words: what was found, sentence by sentence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from gaitopt.diagnose.diagnosis import Diagnosis
from gaitopt.diagnose.gap.components import LARGEST_SIZE
from gaitopt.diagnose.gap.floor import marker_floor
from gaitopt.diagnose.gap.split import Split
from gaitopt.diagnose.gap.where import by_component
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.causes import Causes
from gaitopt.diagnose.judge.unevenness import UNEVEN
from gaitopt.diagnose.next_words import what_next
from gaitopt.diagnose.shown_gap import angle, millimetres, shown_gap
from gaitopt.diagnose.trial_gap import SIGNIFICANT, TrialGap
from gaitopt.optimise.robots import Expected
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
    "others": "repeats of other commands that differ",
}


def answer(diagnosis: Diagnosis) -> str:
    """Return the verdict in one sentence."""
    gap = shown_gap(diagnosis)
    figures = f"{gap.amount(gap.gap.before)} RMS of {gap.of}, floor {gap.amount(gap.gap.floor)}"
    if diagnosis.verdict == "no_gap":
        if diagnosis.within_floor:
            return f"No significant gap: {figures}{_angles_too(diagnosis)}."
        text = f"No effect stands out from the small errors that every robot has. The gap: {figures}."
        return f"{text} {how_far(diagnosis)}".strip()
    if diagnosis.verdict == "explained" and not (diagnosis.found and diagnosis.found.causes):
        return f"The gap ({figures}) is in the recordings: {', '.join(diagnosis.causes)}."
    if diagnosis.found is not None and diagnosis.found.candidates:
        within = diagnosis.verdict == "partly_explained" and gap.gap.after <= gap.gap.floor
        kind = "uneven" if within and diagnosis.found.unevenness_left > UNEVEN else diagnosis.verdict
        kind = _doubt(diagnosis.found) if kind == "ambiguous" else kind
        kind = "hopeless" if kind == "unexplained" and diagnosis.correction is None else kind
        return f"{_VERDICTS[kind].format(*_who(diagnosis))} The gap: {gap.in_words}."
    text = f"There is a gap: {figures}{_angles_too(diagnosis)}."
    for first in diagnosis.where[:1]:  # nothing where every part of the gap is within the floor
        part = f"{first.component} of {first.signal} in trial {first.trial}"
        if diagnosis.has_logs:
            whole = by_component(diagnosis.where)[0]
            part = f"{name_of_component(whole.component)} of {whole.signal} over all trials"
            first = replace(first, share=whole.share)
        text += f" The largest part of it is {part} ({first.share:.0%})."
    return text


def _angles_too(diagnosis: Diagnosis) -> str:
    """Return the gap of the angles in words, where they were measured beside a marker under a log."""
    angles = diagnosis.gap_angles if diagnosis.measures_positions else None
    if angles is None or not diagnosis.has_logs:
        return ""
    return f"; {angle(angles.before)} RMS of the angles, floor {angle(angles.floor)}"


def name_of_component(component: str) -> str:
    """Return a component's name in words."""
    return component.replace("stick_slip", "stick and slip")


_VERDICTS = {
    "explained": "The gap is explained by {0}.",
    "uneven": "{0} {2} the gap, but the recorded cycles differ more than simulated ones.",
    "ambiguous": "These trials cannot tell which effect causes the gap: {0}, or {1}.",
    "uncertain": "The gap is explained by {0}. It is not certain that {1} {3} at work.",
    "together": "The gap is explained by {0}, but not certainly: each effect changes little.",
    "partly_explained": "{0} {2} only a part of the gap; there is another cause.",
    "unexplained": "No effect of the library explains the gap of held-out trials. The best correction: {0}.",
    "hopeless": "No effect of the library explains the gap of held-out trials, and none predicts them better "
    "than the nominal robot does. The most probable one is {0}.",
}


def _who(diagnosis: Diagnosis) -> tuple[str, str, str, str]:
    """Return the cause with its parameter, what else is named, and the verbs for the cause and for that."""
    found = diagnosis.found
    if found is None or found.best is None:
        return "", "", "", ""
    chosen = diagnosis.correction_or_best
    if chosen is not None and not found.causes:
        return with_values(chosen), "", "", ""
    verb = "explains" if len(found.best.hypotheses) == 1 else "explain"
    others = _others(found)
    if others:
        return with_values(found.best), " or ".join(others), verb, "is"
    are = "is" if len(found.ambiguous_with) == 1 else "are"
    return with_values(found.best), " and ".join(found.ambiguous_with), verb, are


def _others(found: Causes) -> list[str]:
    """Return the effects that may be at work in place of those of the first explanation."""
    own = {h.effect.name for h in found.best.hypotheses} if found.best else set()
    return [name for name in found.ambiguous_with if name not in own]


def _doubt(found: Causes) -> str:
    """Return what an ambiguous answer leaves open: other effects, some of those named, or all of them."""
    if _others(found):
        return "ambiguous"
    return "uncertain" if found.ambiguous_with else "together"


def how_far(diagnosis: Diagnosis) -> str:
    """Return how far the corrected robot goes, in a sentence or two; empty where there is none."""
    candidate = diagnosis.correction
    if candidate is None:
        return ""
    shown = replace(shown_gap(diagnosis), gap=diagnosis.gap_with(candidate))
    text = f"Corrected by {with_values(candidate)}: {shown.in_words}."
    if diagnosis.verdict == "ambiguous":
        doubt = diagnosis.found is None or _doubt(diagnosis.found) == "ambiguous"
        return (
            f"{text} {'Other effects explain' if doubt else 'Fewer of these may explain'} the trials as well."
        )
    if diagnosis.verdict == "no_gap":
        return f"{text} Small errors may do the same."
    return text if diagnosis.verdict == "explained" else f"{text} This is not all that is wrong."


def with_values(candidate: Candidate) -> str:
    """Return the effects of a candidate with their parameters."""
    texts = []
    for h, at in zip(candidate.hypotheses, candidate.at, strict=True):
        value = f"{h.value(at):.4g} {h.effect.unit}".strip()
        texts.append(f"{h.name} ({h.effect.parameter} = {value})")
    return " and ".join(texts)


def _ranking(diagnosis: Diagnosis) -> list[str]:
    """Return the most probable effects, which of them act similarly, and what to measure next."""
    found = diagnosis.found
    if found is None or found.best is None:
        return []
    sentences = []
    best = found.best
    small = found.judgement.small_errors(best)
    for row in found.effects[:4]:
        estimate = row.parameter
        low, high = estimate.ci90
        text = (
            f"{row.name} ({row.target}): {row.probability:.0%} probable, {estimate.name} = "
            f"{estimate.value:.4g} ({low:.4g} to {high:.4g})"
        )
        if row.name in small:
            text += ", no more than the tolerances allow"
        if row.name not in best.names:
            text += _likeness(row.alike, best.label)
        sentences.append(f"{text}.")
    if found.judgement.sets is None and found.p_value < 1.0:
        sentences.append(
            f"If nothing were wrong, such a gain would occur in {_percent(found.p_value)} of cases."
        )
    if found.judgement.tolerant:
        sentences.append("All else is taken to be a little wrong, by the tolerances of the problem.")
    sentences.append(f"A cause outside the library is {found.other_probability:.0%} probable.")
    if found.unevenness > UNEVEN:
        sentences.append(
            f"The recorded cycles differ from one another {found.unevenness:.0f} times as much as simulated "
            f"ones: {_what_differs(found)}"
        )
    if diagnosis.experiment is not None:
        sentences.append(what_next(diagnosis.experiment))
    return sentences


def _what_differs(found: Causes) -> str:
    """Return what may make cycles differ."""
    chance = found.chance
    if chance is None:
        return "something acts in some cycles and not in others."
    low, high = chance.ci90
    text = (
        f"{chance.effect} with {chance.parameter} = {chance.value:.2g} ({low:.2g} to {high:.2g}) makes them "
        "differ as much in the mean"
    )
    if not chance.plausible:
        return f"{text}, but so large a size is implausible."
    left = chance.unevenness
    return f"{text}." if left <= UNEVEN else f"{text}, but in some signal still {left:.0f} times too little."


_SAME_LOOK = 0.9
"""From this cosine between what two causes change, data hardly tell the two apart."""


def _likeness(cosine: float, other: str) -> str:
    """Return how alike two causes look, in words."""
    if abs(cosine) < _SAME_LOOK:
        return f"; likeness to {other} in these data: {abs(cosine):.2f} of 1"
    return f"; it and {other} look the same in these data (likeness {abs(cosine):.2f} of 1)"


def expectation(diagnosis: Diagnosis) -> list[str]:
    """Return what is expected of gaits, or of logs recorded again, in a sentence; empty for nothing."""
    speeds = [
        f"{row.gait} {speed_text(row.speed)}{'' if row.filmed else ' (not filmed)'}"
        for row in diagnosis.predictions
        if row.speed is not None
    ]
    if speeds:
        return [f"Expected speeds in mm/s, with 90 % intervals: {', '.join(speeds)}."]
    left: dict[str, list[float]] = {}
    for row in diagnosis.predictions:
        for name, one in row.rms.items():
            left.setdefault(name, []).append(one.mean)
    texts = []
    for name, values in left.items():
        low, high = (
            millimetres(end) if is_position(name) else angle(end) for end in (min(values), max(values))
        )
        texts.append(f"{name} {low}" if len(values) == 1 else f"{name} {low} to {high}")
    return [f"Expected RMS error where the same is recorded again: {', '.join(texts)}."] if texts else []


def _percent(share: float) -> str:
    return "less than 0.1 %" if share < 1e-3 else f"{100.0 * share:.2g} %"


def speed_text(speed: Expected) -> str:
    """Return a speed with its interval, in mm/s."""
    low, high = speed.ci90
    return f"{1e3 * speed.mean:.1f} ({1e3 * low:.1f} to {1e3 * high:.1f})"


def explanation(diagnosis: Diagnosis) -> list[str]:
    """Return what is known of each trial, and what the defects of its recording are."""
    sentences = _ranking(diagnosis) + _odd_trials(diagnosis) + expectation(diagnosis)
    for trial in diagnosis.trials:
        sentences.append(_of_log(trial) if trial.has_log else _trial(trial))
        sentences += [f"{trial.name}: {defect.name}: {defect.message}." for defect in trial.defects]
        for name, part in trial.splits.items() if trial.counts else ():
            if part.rms > trial.floors[name].total:
                sentences.append(f"{trial.name}, {name}: {_components(part)}.")
    return sentences


def _odd_trials(diagnosis: Diagnosis) -> list[str]:
    """Return which trials the first explanation does not fit, though it fits the others."""
    odd = diagnosis.found.misfit_trials if diagnosis.found else {}
    return [
        f"Trial {name} does not fit the others: {times:.1f} times as much is left of it as of the median "
        "trial. Something else happened there, such as a slip or a lost command."
        for name, times in odd.items()
    ]


def _trial(trial: TrialGap) -> str:
    ratio = max(trial.ratios.values())
    worst = max(trial.ratios, key=lambda name: trial.ratios[name])
    start = "fitted" if trial.aligned.trial.starts_at_s is None else "as the data set says"
    offset = f"the recording begins at gait time {trial.aligned.offset_s:.2f} s ({start})"
    positions = [name for name in trial.floors if is_position(name)]
    if positions:
        floor = marker_floor(trial.floors)
        gap = (
            f"gap of {millimetres(trial.aligned.marker_rms)} RMS, floor {millimetres(floor)}, most of it "
            f"{_main_part(trial, positions)}"
        )
    else:
        gap = "no marker was measured"
    if ratio <= 1.0:
        verdict = "the gap is below the floor, so this trial alone shows no cause"
    elif ratio <= SIGNIFICANT:
        verdict = f"{worst} is {ratio:.1f} times its floor, which is not significant"
    else:
        verdict = f"{worst} is {ratio:.1f} times its floor"
    return f"{trial.name}: {gap}; {verdict}; {offset}."


def _of_log(trial: TrialGap) -> str:
    """Return what is known of a trial of logged commands: of its signal that is most floors off."""
    worst = max(trial.ratios, key=lambda name: trial.ratios[name])
    if worst in trial.floors:
        signals, apart, floor, amount = [worst], trial.aligned.rms(worst), trial.floors[worst].total, angle
    else:
        signals = [name for name in trial.floors if is_position(name)]
        apart, floor, amount = trial.aligned.marker_rms, marker_floor(trial.floors), millimetres
    ratio = trial.ratios[worst]
    text = (
        f"{trial.name}: {worst} is {amount(apart)} RMS off, {ratio:.1f} times its floor of {amount(floor)}, "
        f"most of which is {_main_part(trial, signals)}"
    )
    if ratio <= SIGNIFICANT:
        text += "; this is not significant"
    if trial.aligned.trial.starts_at_s is None:
        text += f"; the recording begins {trial.aligned.offset_s:.2f} s after the log (fitted)"
    return f"{text}."


def _main_part(trial: TrialGap, signals: Sequence[str]) -> str:
    """Return what most of the floor of some signals comes from."""
    sums: dict[str, float] = {}
    for name in signals:
        for part in _FLOOR_PARTS:
            sums[part] = sums.get(part, 0.0) + (getattr(trial.floors[name], part) or 0.0) ** 2
    return _FLOOR_PARTS[max(sums, key=lambda part: sums[part])]


def _components(part: Split) -> str:
    total = part.rms**2
    ordered = sorted(part.squares.items(), key=lambda item: -item[1])
    worth = [name for name, square in ordered if square >= _WORTH_SAYING * total]
    what = _what if part.travel else _what_of_log
    texts = [
        f"{part.squares[name] / total:.0%} {name_of_component(name)}{what(part, name)}" for name in worth
    ]
    return "; ".join(texts)


def _what_of_log(part: Split, component: str) -> str:
    """Return what a component of the gap of logged commands means."""
    if component == "gain":
        if part.size >= LARGEST_SIZE:
            return " (it moves, and the simulated one hardly does)"
        return f" (it moves {part.size:.2f} times as far as simulated)"
    if component == "bias":
        off = math.sqrt(part.squares[component])
        return f" (it lies {_length(part, off)} beside the simulated one)"
    if component == "lag":
        late = "later" if part.delay_s > 0.0 else "earlier"
        return f" (it moves {1e3 * abs(part.delay_s):.0f} ms {late} than simulated)"
    return _OF_LOGS[component]


_OF_LOGS = {
    "overshoot": " (after a change of command it moves otherwise: it rings more, or less)",
    "stick_slip": " (it advances in steps where the command is smooth, or only the simulated one does)",
    "saturation": " (it differs where the motion runs at its limit)",
    "drift": " (it drifts from the simulated path)",
    "noise": " (noise of the measurement)",
}


def _what(part: Split, component: str) -> str:
    if component == "drift":
        measured, simulated = part.travel or (math.nan, math.nan)
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
    if is_position(part.signal):
        return millimetres(value)
    return f"{value:.3g} rad" if part.travel else angle(value)
