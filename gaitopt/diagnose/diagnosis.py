"""A diagnosis: data set and simulator in, where the gap lies and what is known of its cause out."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.fit.cache import SimulationCache
from gaitopt.diagnose.fit.fitting import Note
from gaitopt.diagnose.fit.hypotheses import Hypothesis, hypotheses
from gaitopt.diagnose.gap.align import Aligned, align, pooled_marker_rms
from gaitopt.diagnose.gap.floor import Floors, marker_floor, measure_floors
from gaitopt.diagnose.gap.mismatches import mismatches
from gaitopt.diagnose.gap.predict import predict
from gaitopt.diagnose.gap.where import COMPONENTS, GapShare, Split, gap_shares, split
from gaitopt.diagnose.judge.causes import Causes, find_causes
from gaitopt.diagnose.judge.evidence import Gap
from gaitopt.diagnose.judge.experiment import Experiment, propose
from gaitopt.diagnose.record.cleaning import Cleaned, clean
from gaitopt.diagnose.record.cycles import steady_from
from gaitopt.diagnose.record.dataset import DataSet
from gaitopt.diagnose.record.defect import Defect
from gaitopt.effects import EFFECTS
from gaitopt.robot.signals import is_marker, unit_of
from gaitopt.simulation.rollout import Simulator

SIGNIFICANT = 2.0
"""A gap of so many floors is significant: what remains of a right model is below it in 95 of 100 cases."""

DEFECT_COMPONENTS = {"marker_outliers": "noise", "frozen_frames": "noise", "clock_rounding": "timing"}
"""Component of the gap that a defect of the record belongs to."""


@dataclass(frozen=True)
class TrialGap:
    """One trial beside the nominal prediction.

    Attributes:
        cleaned: the trial as recorded and as used, with the record's own defects.
        aligned: the cleaned trial beside the nominal prediction.
        floors: floor of each signal.
        splits: the gap of each signal by component, the defects' share with it.
        mismatches: defects seen only beside the prediction.
    """

    cleaned: Cleaned
    aligned: Aligned
    floors: Floors
    splits: Mapping[str, Split]
    mismatches: tuple[Defect, ...]

    @property
    def name(self) -> str:
        """Name of the trial."""
        return self.aligned.trial.name

    @property
    def defects(self) -> tuple[Defect, ...]:
        """Everything wrong with the record."""
        return self.cleaned.defects + self.mismatches

    @property
    def ratios(self) -> dict[str, float]:
        """Gap over floor, of the marker and of each angle."""
        pairs = {n: (self.aligned.rms(n), f.total) for n, f in self.floors.items() if not is_marker(n)}
        if any(map(is_marker, self.floors)):
            pairs = {"marker": (self.aligned.marker_rms, marker_floor(self.floors))} | pairs
        return {name: gap / floor if floor > 0.0 else math.inf for name, (gap, floor) in pairs.items()}

    @property
    def counts(self) -> bool:
        """Whether the trial can blame anything: a gap, cleaned or as recorded, above the floor."""
        return max(self.ratios.values()) > 1.0 or bool(self.blamed)

    @property
    def significant(self) -> bool:
        """Whether a gap is left, once defects are masked, that the floor does not explain."""
        return max(self.ratios.values()) > SIGNIFICANT

    @property
    def blamed(self) -> list[Defect]:
        """Defects whose error alone exceeds the marker's floor."""
        floor = marker_floor(self.floors)
        causes = [d for d in self.cleaned.defects if d.name in EFFECTS and EFFECTS[d.name].found_in_record]
        return [defect for defect in causes if defect.error_m > floor]


@dataclass(frozen=True)
class Diagnosis:
    """What is known of the gap between a data set and the simulator.

    Attributes:
        problem: name of the problem.
        source: the data set's file.
        seed: seed of the start poses of the floor.
        fidelity: timestep and integrator used.
        trials: the trials in the data set's order.
        found: what may have caused the gap; None where no effect was tried.
        experiment: what to measure next; None where there is nothing to tell apart.
    """

    problem: str
    source: str
    seed: int
    fidelity: Mapping[str, Any]
    trials: tuple[TrialGap, ...]
    found: Causes | None = None
    experiment: Experiment | None = None

    @property
    def defective(self) -> list[str]:
        """Defects of the record that make a significant gap by themselves."""
        blamed = {defect.name for trial in self.trials for defect in trial.blamed}
        return [name for name in EFFECTS if name in blamed]

    @property
    def causes(self) -> list[str]:
        """Effects and defects of the record that are blamed."""
        return [*(self.found.causes if self.found else []), *self.defective]

    @property
    def significant(self) -> bool:
        """Whether any trial has a gap that its floor does not explain."""
        return any(trial.significant for trial in self.trials)

    @property
    def verdict(self) -> str:
        """The answer."""
        if self.found is not None and self.found.verdict != "no_gap":
            return self.found.verdict
        if self.found is None and self.significant:
            return "unexplained"
        return "explained" if self.defective else "no_gap"

    @property
    def gap(self) -> dict[str, Any]:
        """RMS marker error over all trials, m: nominal, and held out with the cause that was found."""
        located = self.located_gap
        if self.found is None or self.found.gap is None:
            return located
        return _gap_row(self.found.gap)

    @cached_property
    def gap_by_trial(self) -> list[dict[str, Any]]:
        """The same of each trial; none where nothing was fitted."""
        rows = []
        for index, trial in enumerate(self.trials):
            gap = self.found.gap_of_trial(index, marker_floor(trial.floors)) if self.found else None
            if gap is not None:
                rows.append({"trial": trial.name} | _gap_row(gap))
        return rows

    @property
    def located_gap(self) -> dict[str, Any]:
        """RMS marker error over all trials, without fitting: after is before, but for defects blamed."""
        after = pooled_marker_rms([trial.aligned for trial in self.trials])
        samples = [len(trial.aligned.time) for trial in self.trials]
        removed = [sum(d.error_m**2 for d in trial.blamed) for trial in self.trials]
        before = math.sqrt(after**2 + _mean(removed, samples))
        floor = math.sqrt(_mean([marker_floor(trial.floors) ** 2 for trial in self.trials], samples))
        shrinkage = (before - after) / (before - floor) if before > floor else None
        return {
            "heldout_before_m": before,
            "heldout_after_m": after,
            "floor_m": floor,
            "shrinkage": shrinkage,
            "shrinkage_ci90": [shrinkage, shrinkage],
        }

    @property
    def where(self) -> list[GapShare]:
        """Components of the gap, the largest share first; of trials that can blame something."""
        return gap_shares((trial.name, trial.splits, trial.floors) for trial in self.trials if trial.counts)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of ``diagnosis.json``."""
        return {
            "problem": self.problem,
            "dataset": self.source,
            "seed": self.seed,
            "fidelity": dict(self.fidelity),
            "verdict": self.verdict,
            "causes": self.causes,
            "ambiguous_with": list(self.found.ambiguous_with) if self.found else [],
            "other_probability": self.found.other_probability if self.found else None,
            "p_value": self.found.p_value if self.found else None,
            "unevenness": self.found.uneven if self.found else None,
            "effects": self.found.effects if self.found else [],
            "where": [share.to_dict() for share in self.where],
            "gap": self.gap,
            "gap_by_trial": self.gap_by_trial,
            "next_experiment": self.experiment.to_dict() if self.experiment else None,
            "trials": [_trial_row(trial) for trial in self.trials],
            "defects": [defect.to_dict() for trial in self.trials for defect in trial.defects],
        }


def diagnose(
    simulator: Simulator,
    dataset: DataSet,
    executor: Executor,
    seed: int,
    note: Note = lambda what, done, most: None,
    next_gait: bool = True,
    among: Collection[str] | None = None,
    memory: SimulationCache | None = None,
) -> Diagnosis:
    """Return where the gap lies, what causes it and what to measure next.

    Args:
        simulator: the nominal robot, its scenario 0, at the fidelity to use.
        dataset: the data set.
        executor: where rollouts run.
        seed: seed of all randomness.
        note: called as it goes.
        next_gait: whether to look for the next experiment.
        among: effects to try; None for all that apply.
        memory: keeps what is simulated, and has what was; None to keep nothing.

    Raises:
        GaitoptError: a trial has fewer than two cycles left, the simulation of its gait fails, or none of the
            effects asked for can be tried.
    """
    rivals = _rivals(simulator, dataset, among)
    note("measuring the floor", 0, 0)
    located = locate(simulator, dataset, executor, seed)
    parts = [trial.aligned for trial in located.trials], [trial.floors for trial in located.trials]
    floor = located.located_gap["floor_m"]
    found = find_causes(simulator, *parts, floor, executor, seed, note, rivals, memory)
    if found.verdict == "no_gap" or not next_gait:
        return replace(located, found=found)
    note("looking for the next gait", found.robots, 0)
    drives = {trial.aligned.trial.drive.name: trial.aligned.trial.drive for trial in located.trials}
    signals = list(dict.fromkeys(name for trial in located.trials for name in trial.floors))
    experiment = propose(simulator, found, list(drives.values()), signals, executor, seed)
    return replace(located, found=found, experiment=experiment)


def _rivals(simulator: Simulator, dataset: DataSet, among: Collection[str] | None) -> list[Hypothesis]:
    known = any(trial.starts_at_s is not None for trial in dataset.trials)
    active = [one.effect.name for one in simulator.effects.active]
    rivals = hypotheses(simulator.effects.nominal, simulator.problem.channel_names, known, active)
    chosen = [rival for rival in rivals if among is None or rival.effect.name in among]
    if not chosen:
        raise GaitoptError("no effect can be tried: none of those asked for applies to this robot")
    return chosen


def locate(simulator: Simulator, dataset: DataSet, executor: Executor, seed: int) -> Diagnosis:
    """Return where the gap between a data set and the nominal robot lies.

    Args:
        simulator: the nominal robot, its scenario 0, at the fidelity to use.
        dataset: the data set.
        executor: where rollouts run.
        seed: seed of all randomness.

    Raises:
        GaitoptError: a trial has fewer than two cycles left, or the simulation of its gait fails.
    """
    cleaned = [clean(trial) for trial in dataset.trials]
    trials = [entry.trial for entry in cleaned]
    predictions = predict(simulator, trials, executor)
    aligned = [align(trial, simulated) for trial, simulated in zip(trials, predictions, strict=True)]
    floors = measure_floors(simulator, aligned, executor, seed)
    gaps = [_trial_gap(simulator, *parts) for parts in zip(cleaned, aligned, floors, strict=True)]
    fidelity = simulator.fidelity.model_dump()
    return Diagnosis(simulator.problem.name, str(dataset.source), seed, fidelity, tuple(gaps))


def _trial_gap(simulator: Simulator, cleaned: Cleaned, aligned: Aligned, floors: Floors) -> TrialGap:
    transient = steady_from(simulator.problem.simulation.horizon, aligned.trial.drive)
    splits = {}
    for name in aligned.trial.signals:
        extra = dict.fromkeys(COMPONENTS, 0.0)
        for defect in cleaned.defects:
            if defect.name in DEFECT_COMPONENTS:
                extra[DEFECT_COMPONENTS[defect.name]] += defect.errors_m.get(name, 0.0) ** 2
        splits[name] = split(aligned, name, transient, extra)
    return TrialGap(cleaned, aligned, floors, splits, tuple(mismatches(aligned, transient)))


def _gap_row(gap: Gap) -> dict[str, Any]:
    return {
        "heldout_before_m": gap.before,
        "heldout_after_m": gap.after,
        "floor_m": gap.floor,
        "shrinkage": gap.shrinkage,
        "shrinkage_ci90": list(gap.ci90),
    }


def _trial_row(trial: TrialGap) -> dict[str, Any]:
    aligned = trial.aligned
    return {
        "name": trial.name,
        "gait": aligned.trial.drive.name,
        "period_s": aligned.trial.drive.period_s,
        "offset_s": aligned.offset_s,
        "offset_fitted": aligned.trial.starts_at_s is None,
        "marker_gap_m": aligned.marker_rms,
        "marker_floor_m": marker_floor(trial.floors),
        "gap_over_floor": trial.ratios,
        "significant": trial.significant,
        "counts": trial.counts,
        "signals": [
            {
                "signal": name,
                "unit": unit_of(name),
                "gap": aligned.rms(name),
                "floor": floor.total,
                "floor_parts": asdict(floor),
                "travel_measured": (trial.splits[name].travel or (None, None))[0],
                "travel_simulated": (trial.splits[name].travel or (None, None))[1],
                "size_ratio": trial.splits[name].size,
                "delay_s": trial.splits[name].delay_s,
                "by_phase": trial.splits[name].by_phase.tolist(),
            }
            for name, floor in trial.floors.items()
        ],
    }


def _mean(values: Sequence[float], weights: Sequence[int]) -> float:
    return sum(v * w for v, w in zip(values, weights, strict=True)) / sum(weights)
