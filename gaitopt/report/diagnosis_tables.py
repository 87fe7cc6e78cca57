"""Tables of a diagnosis' page."""

from __future__ import annotations

import math

from gaitopt.core.quantities import figure
from gaitopt.diagnose.correction import Correction
from gaitopt.diagnose.diagnosis import Diagnosis, GapOfTrial
from gaitopt.diagnose.gap.components import LARGEST_SIZE
from gaitopt.diagnose.gap.split import COMPONENTS, Split
from gaitopt.diagnose.gap.split_commands import COMMAND_COMPONENTS
from gaitopt.diagnose.gap.where import ComponentShare, GapShare, by_component
from gaitopt.diagnose.judge.causes import EffectProbability
from gaitopt.diagnose.predictions import Prediction
from gaitopt.diagnose.words import name_of_component
from gaitopt.report.page import Table
from gaitopt.robot.signals import unit_of

_SHOWN = 8
"""Number of rows of a table of the largest values."""


def effects(diagnosis: Diagnosis) -> Table | None:
    """Return the most probable effects; None where none was fitted."""
    found = diagnosis.found
    if found is None or not found.effects:
        return None
    return Table(
        head=[
            *("effect", "probability", "parameter", "fitted", "90 % interval"),
            *("gap removed", "error left", "alike"),
        ],
        rows=[_effect_row(row) for row in found.effects[:_SHOWN]],
        note="Gap removed: share of the marker's gap above the floor that the effect removes, on trials that "
        "its fit did not see. More than 100 % is below the floor; less than 0 makes the gap larger. Error "
        "left: in the worst trial; 1 for a right model. Alike: how much the change that the effect makes "
        "looks like that of the first effect: near 1, the two causes look the same in these data.",
        mark_first=bool(diagnosis.causes),
        words=(2,),
    )


def _effect_row(row: EffectProbability) -> list[str]:
    estimate, removed = row.parameter, row.heldout_shrinkage
    return [
        row.name if row.target == "all" else f"{row.name}, {row.target}",
        probability(row.probability),
        estimate.name + (f" [{row.unit}]" if row.unit else ""),
        f"{estimate.value:.4g}",
        " to ".join(f"{end:.4g}" for end in estimate.ci90),
        "–" if removed is None else f"{100 * removed:.0f} %",
        figure(row.heldout_left),
        f"{row.alike:.2f}",
    ]


def probability(value: float) -> str:
    """Return a probability in percent."""
    return "< 0.1 %" if value < 1e-3 else f"{100 * value:.1f} %"


def shrinkage(diagnosis: Diagnosis) -> Table | None:
    """Return the gap before and after, trial by trial; None where nothing was fitted."""
    if not diagnosis.gap_by_trial:
        return None
    rows = [*diagnosis.gap_by_trial, GapOfTrial("all trials", diagnosis.gap)]
    return Table(
        head=["trial", "before, mm", "after, mm", "floor, mm", "gap removed (90 %)"],
        rows=[_shrinkage_row(row) for row in rows],
        note="RMS error of the marker with the most probable effect, on data that its fit did not see. Gap "
        "removed: share of what is above the floor. A dash: nothing is above the floor.",
    )


def _shrinkage_row(row: GapOfTrial) -> list[str]:
    gap, share = row.gap, row.gap.shrinkage
    millimetres = [figure(1e3 * value) for value in (gap.before, gap.after, gap.floor)]
    low, high = gap.ci90
    known = share is not None and math.isfinite(low) and math.isfinite(high)
    return [row.trial, *millimetres, f"{share:.0%} ({low:.0%} to {high:.0%})" if known else "–"]


def walked(correction: Correction | None) -> Table | None:
    """Return the speeds of gaits on both robots; None where none were simulated."""
    if correction is None or not correction.walked:
        return None
    return Table(
        head=["gait", "period [s]", "nominal [mm/s]", "corrected [mm/s]"],
        rows=[
            [row.name, figure(row.period_s), f"{1e3 * row.nominal_m_s:.1f}", f"{1e3 * row.corrected_m_s:.1f}"]
            for row in correction.walked
        ],
        note="Forward speed over whole cycles in the nominal scenario. The corrected robot has the most "
        "probable effect, which may not be certain. For a full search on the corrected robot: gaitopt "
        "optimise corrected.toml.",
    )


def predictions(diagnosis: Diagnosis) -> Table | None:
    """Return what is expected of each gait, or of each signal of a log; None where nothing is."""
    speeds = [row for row in diagnosis.predictions if row.speed is not None]
    if speeds:
        return Table(
            head=["gait", "filmed", "nominal [mm/s]", "expected [mm/s]", "90 % interval"],
            rows=[_prediction_row(row) for row in speeds],
            note="Forward speed over robots drawn from posterior.csv. The interval holds what is not known "
            "of the robot, its start pose, and what no effect explains, by the evidence of held-out gaits. "
            "For other gaits: gaitopt simulate PROBLEM GAIT --posterior with this folder.",
            words=(1,),
        )
    rows = [
        [f"{row.gait}: {name}", _amount(one.mean, unit_of(name)), _ends(one.ci90, unit_of(name))]
        for row in diagnosis.predictions
        for name, one in row.rms.items()
    ]
    note = "RMS error where the same is recorded again: what the fit to the other recordings leaves of it."
    return Table(head=["signal", "expected error", "90 % interval"], rows=rows, note=note) if rows else None


def _prediction_row(row: Prediction) -> list[str]:
    if row.speed is None or row.nominal_m_s is None:
        raise ValueError("the row has no speed")
    low, high = row.speed.ci90
    speeds = [f"{1e3 * value:.1f}" for value in (row.nominal_m_s, row.speed.mean, low, high)]
    return [row.gait, "yes" if row.filmed else "no", *speeds[:2], " to ".join(speeds[2:])]


def _ends(ends: tuple[float, float], unit: str) -> str:
    return " to ".join(_amount(end, unit) for end in ends)


def largest_parts(diagnosis: Diagnosis) -> Table | None:
    """Return the largest components of the gap; None where no trial has a gap above its floor."""
    if not diagnosis.where:
        return None
    if diagnosis.has_logs:
        return _largest_components(diagnosis)
    return Table(
        head=["signal", "component", "share of the whole", "RMS", "times the floor"],
        rows=[_part_row(row) for row in diagnosis.where[:_SHOWN]],
        note="Drift: travel per cycle that the size of the stride does not explain. Stride: size and shape "
        "of the motion inside a cycle, with the travel that goes with its size. Timing: the same motion "
        "later or earlier. Transient: before the steady motion. Noise: what differs from cycle to cycle. "
        "Shares are of the squared gap, each signal's in multiples of its floor, over the trials that count.",
        words=(1,),
    )


def _largest_components(diagnosis: Diagnosis) -> Table:
    """Return the components over all trials, where commands were logged."""
    return Table(
        head=[
            "signal",
            "component",
            "share of the whole",
            "RMS",
            "largest in",
            "there",
            "times the floor there",
        ],
        rows=[_component_row(row) for row in by_component(diagnosis.where)[:_SHOWN]],
        note="Gain: the motion since the start is larger or smaller than simulated. Bias: a constant "
        "distance. Lag: the same motion later or earlier. Overshoot: soon after a change of command the "
        "motion has another shape. Stick and slip: it advances in steps where the command is smooth. "
        "Saturation: it differs where the motion runs at its limit. Drift: a slow change over the recording. "
        "Noise: of the measurement. Shares are of the squared gap, each signal's in multiples of its floor, "
        "over the trials that count. RMS: over these.",
        words=(1, 4),
    )


def _component_row(row: ComponentShare) -> list[str]:
    largest = row.largest
    return [
        row.signal,
        name_of_component(row.component),
        f"{100 * row.share:.0f} %",
        _amount(row.gap, row.unit),
        largest.trial,
        _amount(largest.gap, largest.unit),
        "–" if largest.floors is None else f"{largest.floors:.1f}",
    ]


def _part_row(row: GapShare) -> list[str]:
    return [
        f"{row.trial}: {row.signal}",
        row.component,
        f"{100 * row.share:.0f} %",
        _amount(row.gap, row.unit),
        "–" if row.floors is None else f"{row.floors:.1f}",
    ]


def signals(diagnosis: Diagnosis) -> Table | None:
    """Return how each signal of a gait differs from its prediction; None where there was no gait."""
    rows = []
    for trial in diagnosis.trials:
        for name, part in trial.splits.items():
            if part.travel is not None:
                travels = [_amount(travel, unit_of(name)) for travel in part.travel]
                rows.append([f"{trial.name}: {name}", *travels, *_size_and_delay(part), *_shares(part)])
    head = ["signal", "travel a cycle", "simulated", "size in a cycle", "delay", *COMPONENTS]
    return Table(head=head, rows=rows) if rows else None


def signals_of_logs(diagnosis: Diagnosis) -> Table | None:
    """Return how each signal of logged commands differs from its prediction; None where none were logged."""
    rows = [
        [f"{trial.name}: {name}", *_size_and_delay(part), *_shares(part)]
        for trial in diagnosis.trials
        for name, part in trial.splits.items()
        if part.travel is None
    ]
    names = map(name_of_component, COMMAND_COMPONENTS)
    return Table(head=["signal", "size", "delay", *names], rows=rows) if rows else None


def _size_and_delay(part: Split) -> list[str]:
    size = f"{part.size:.2f}" if abs(part.size) < LARGEST_SIZE else "–"
    return [size, f"{1e3 * part.delay_s:+.0f} ms"]


def _shares(part: Split) -> list[str]:
    """Return the share of each component of a signal's squared gap."""
    return [f"{100 * share:.0f} %" for share in part.shares.values()]


def floors(diagnosis: Diagnosis) -> Table:
    """Return the floor of each signal and its parts."""
    rows, logs = [], diagnosis.has_logs
    for trial in diagnosis.trials:
        for name, floor in trial.floors.items():
            repeats = (floor.repeats, floor.others) if logs else (floor.repeats,)
            parts = (floor.noise, floor.spread, *repeats, floor.start_pose, floor.numerics, floor.clock)
            amounts = (trial.aligned.rms(name), floor.total, *parts)
            cells = ("–" if amount is None else _amount(amount, unit_of(name)) for amount in amounts)
            rows.append([f"{trial.name}: {name}", *cells])
    others = ["repeats of others"] if logs else []
    return Table(
        head=[
            *("signal", "gap", "floor", "noise", "cycles", "repeats", *others),
            *("start pose", "timestep", "clock"),
        ],
        rows=rows,
        note="RMS. The data give noise, spread of the cycles and repeats. The simulator, at the fidelity "
        "used, gives start pose, timestep and the error of rounded time stamps."
        + (_OF_OTHERS if logs else ""),
    )


_OF_OTHERS = (
    " Repeats of others: what to expect of commands that were not repeated. It is the spread of the "
    "repeats of other commands, in proportion to the speed of the motion."
)


def _amount(value: float, unit: str) -> str:
    """Return a length in mm or an angle in degrees; a value that rounds to zero is 0."""
    scaled, shown = (1e3 * value, " mm") if unit == "m" else (math.degrees(value), "°")
    text = figure(scaled) if unit == "m" or abs(scaled) >= 0.01 else f"{scaled:.3f}"
    return f"{text if abs(scaled) >= 5e-3 else '0'}{shown}"
