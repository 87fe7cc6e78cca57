"""A diagnosis: from data set and simulator to where the gap lies and what is known of its cause."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gaitopt.core.errors import GaitoptError
from gaitopt.core.progress import OnProgress, Progress, numbered, silent
from gaitopt.core.threads import on_one_thread
from gaitopt.diagnose.fit.cache import SimulationCache
from gaitopt.diagnose.fit.hypotheses import Hypothesis, hypotheses
from gaitopt.diagnose.fit.runner import Runner
from gaitopt.diagnose.gap.align import align, pooled_angle_rms, pooled_marker_rms
from gaitopt.diagnose.gap.floor import marker_floor, measure_floors
from gaitopt.diagnose.gap.leftover import top_speeds
from gaitopt.diagnose.gap.misfits import misfits
from gaitopt.diagnose.gap.predict import predict
from gaitopt.diagnose.gap.settings import GapSettings
from gaitopt.diagnose.gap.where import GapShare, gap_shares
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.causes import Causes
from gaitopt.diagnose.judge.command_experiment import Alternative, CommandExperiment, propose_commands
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.experiment import Experiment, propose
from gaitopt.diagnose.judge.find_causes import NominalGap, find_causes
from gaitopt.diagnose.judge.gap import Gap, shrinkage
from gaitopt.diagnose.judge.posterior import draw_robots
from gaitopt.diagnose.judge.settings import DEFAULT, DiagnosisSettings
from gaitopt.diagnose.predictions import Prediction, predictions
from gaitopt.diagnose.record.cleaning import clean
from gaitopt.diagnose.record.dataset import DataSet
from gaitopt.diagnose.stages import FLOOR, NEXT, PREDICTING, stages
from gaitopt.diagnose.trial_gap import TrialGap, trial_gap
from gaitopt.effects import EFFECTS
from gaitopt.effects.active import EffectValues
from gaitopt.problem.records import Fidelity
from gaitopt.robot.signals import is_position
from gaitopt.simulation.rollout import Simulator


@dataclass(frozen=True)
class DiagnosisRequest:
    """The request for a diagnosis.

    Attributes:
        seed: seed of all randomness.
        effects: names of the effects to try; None for all that apply.
        next_gait: whether to look for the gait to measure next.
    """

    seed: int = 1
    effects: Collection[str] | None = None
    next_gait: bool = True


@dataclass(frozen=True)
class GapOfTrial:
    """The marker's or the angles' gap in one trial, held out, nominal and with the cause that was found."""

    trial: str
    gap: Gap

    def to_dict(self) -> dict[str, object]:
        """Return a row of ``gap_by_trial`` in ``diagnosis.json``."""
        return {"trial": self.trial} | self.gap.to_dict()

    def to_dict_in_rad(self) -> dict[str, object]:
        """Return a row of ``gap_angles_by_trial`` in ``diagnosis.json``."""
        return {"trial": self.trial} | self.gap.to_dict_in_rad()


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
        robots: robots drawn from the posterior; none where nothing was fitted.
        predictions: what is expected of each baseline and of each gait or log of the data set.
        tried: names of the effects that were tried; none where nothing was fitted.
    """

    problem: str
    source: str
    seed: int
    fidelity: Fidelity
    trials: tuple[TrialGap, ...]
    found: Causes | None = None
    experiment: Experiment | CommandExperiment | None = None
    robots: tuple[EffectValues, ...] = ()
    predictions: tuple[Prediction, ...] = ()
    tried: tuple[str, ...] = ()

    @property
    def defective(self) -> list[str]:
        """Defects of the record that make a significant gap by themselves."""
        blamed = {defect.name for trial in self.fitting for defect in trial.blamed}
        return [name for name in EFFECTS if name in blamed]

    @cached_property
    def fitting(self) -> tuple[TrialGap, ...]:
        """The trials to which effects are fitted: without misfits, where these are at most half of them."""
        kept = tuple(trial for trial in self.trials if not trial.is_misfit)
        return kept if 2 * len(kept) >= len(self.trials) else self.trials

    @property
    def misfit_trials(self) -> dict[str, float]:
        """Trials that do not fit the others: how many times as much as the median trial each leaves."""
        fitting = {trial.name for trial in self.fitting}
        left = {trial.name: trial.unlike for trial in self.trials} if len(fitting) < len(self.trials) else {}
        median = float(np.median([left[name] for name in left if name in fitting] or [1.0]))
        odd = {name: one / max(median, 1e-3) for name, one in left.items() if name not in fitting}
        return odd | (self.found.misfit_trials if self.found else {})

    @property
    def causes(self) -> list[str]:
        """Effects and defects of the record that are blamed."""
        return [*(self.found.causes if self.found else []), *self.defective]

    @cached_property
    def correction(self) -> Candidate | None:
        """The explanation that corrects the robot, whatever the verdict; None where none does.

        It is the most probable one if effects are blamed, else the most probable of those that predict
        held-out data better than the nominal robot does. None does if every gap is within its floor.
        """
        found = self.found
        if found is None or self.within_floor:
            return None
        if found.causes:
            return found.best
        return next((one for one in found.candidates if one.rms_left < found.none.rms_left), None)

    @property
    def correction_or_best(self) -> Candidate | None:
        """The correction, or the most probable explanation where nothing corrects the robot."""
        return self.correction or (self.found.best if self.found else None)

    def gap_with(self, candidate: Candidate) -> Gap:
        """Return the held-out gap before and after a candidate, m; of the angles, rad, without a marker."""
        found = self.found
        if found is None:
            return self.gap
        if self.measures_positions or self.gap_angles is None:
            return found.meter.measure(candidate, self.gap.floor)
        return found.meter.measure_angles(candidate, self.gap_angles.floor)

    @property
    def significant(self) -> bool:
        """Whether any trial has a gap that its floor does not explain."""
        return any(trial.significant for trial in self.fitting)

    @property
    def within_floor(self) -> bool:
        """Whether the robot has no gap, not even one as its small errors may make it."""
        return (self.found is None or self.found.verdict == "no_gap") and not self.significant

    @property
    def verdict(self) -> str:
        """The answer."""
        if self.found is not None and self.found.verdict != "no_gap":
            return self.found.verdict
        if self.found is None and self.significant:
            return "unexplained"
        return "explained" if self.defective else "no_gap"

    @property
    def gap(self) -> Gap:
        """RMS marker error over all trials, m: nominal, and held out with the cause that was found."""
        if self.found is None or self.found.gap is None:
            return self.located_gap
        return self.found.gap

    @cached_property
    def gap_by_trial(self) -> list[GapOfTrial]:
        """The same of each trial; none where nothing was fitted."""
        rows = []
        for index, trial in enumerate(self.fitting):
            gap = self.found.gap_of_trial(index, marker_floor(trial.floors)) if self.found else None
            if trial.has_log and not any(map(is_position, trial.floors)):
                continue
            if gap is not None:
                rows.append(GapOfTrial(trial.name, gap))
        return rows

    @property
    def located_gap(self) -> Gap:
        """RMS marker error over all trials, without fitting: after is before, except for defects blamed."""
        after = pooled_marker_rms([trial.aligned for trial in self.fitting])
        samples = [len(trial.aligned.time) for trial in self.fitting]
        removed = [sum(d.error_m**2 for d in trial.blamed) for trial in self.fitting]
        before = math.sqrt(after**2 + _mean(removed, samples))
        floor = math.sqrt(_mean([marker_floor(trial.floors) ** 2 for trial in self.fitting], samples))
        known = shrinkage(before, after, floor)
        end = math.nan if known is None else known
        return Gap(before, after, floor, (end, end))

    @property
    def gap_angles(self) -> Gap | None:
        """RMS error of all angles over all trials, rad; None where no angle was measured."""
        fitted = self.found.gap_angles if self.found else None
        return fitted or self.located_gap_angles

    @property
    def located_gap_angles(self) -> Gap | None:
        """The same without fitting: after is before."""
        angles = [(trial, name) for trial in self.fitting for name in trial.floors if not is_position(name)]
        samples = [int(np.isfinite(trial.aligned.residual[name]).sum()) for trial, name in angles]
        if not sum(samples):
            return None
        gap = pooled_angle_rms([trial.aligned for trial in self.fitting])
        floor = math.sqrt(_mean([trial.floors[name].total ** 2 for trial, name in angles], samples))
        known = shrinkage(gap, gap, floor)
        end = math.nan if known is None else known
        return Gap(gap, gap, floor, (end, end))

    @cached_property
    def gap_angles_by_trial(self) -> list[GapOfTrial]:
        """The same of each trial of logged commands; none where nothing was fitted."""
        found = self.found
        if found is None or found.gap_angles is None or found.best is None:
            return []
        rows = []
        for index, trial in enumerate(self.fitting):
            angles = [floor.total**2 for name, floor in trial.floors.items() if not is_position(name)]
            if angles and trial.has_log:
                gap = found.meter.measure_angles(found.best, math.sqrt(float(np.mean(angles))), index)
                rows.append(GapOfTrial(trial.name, gap))
        return rows

    @property
    def has_logs(self) -> bool:
        """Whether the commands of any trial have no period."""
        return any(trial.has_log for trial in self.trials)

    @property
    def measures_positions(self) -> bool:
        """Whether the marker or another site was measured; otherwise the gap is one of angles alone."""
        return any(is_position(name) for trial in self.trials for name in trial.floors)

    @property
    def where(self) -> list[GapShare]:
        """Components of the gap, the largest share first; of trials that can blame something."""
        return gap_shares([trial for trial in self.fitting if trial.counts])

    def to_dict(self) -> dict[str, object]:
        """Return the content of ``diagnosis.json``."""
        return {
            "problem": self.problem,
            "dataset": self.source,
            "seed": self.seed,
            "fidelity": self.fidelity.model_dump(),
            "verdict": self.verdict,
            "causes": self.causes,
            "ambiguous_with": list(self.found.ambiguous_with) if self.found else [],
            "other_probability": self.found.other_probability if self.found else None,
            "p_value": self.found.p_value if self.found else None,
            "unevenness": self.found.unevenness if self.found else None,
            "chance": self.found.chance.to_dict() if self.found and self.found.chance else None,
            "tried": list(self.tried),
            "effects": [row.to_dict() for row in self.found.effects] if self.found else [],
            "explanations": self.found.explanations if self.found else [],
            "misfit_trials": self.misfit_trials,
            "where": [share.to_dict() for share in self.where],
            "gap": self.gap.to_dict(),
            "gap_angles": self.gap_angles.to_dict_in_rad() if self.gap_angles else None,
            "gap_by_trial": [gap.to_dict() for gap in self.gap_by_trial],
            "gap_angles_by_trial": [gap.to_dict_in_rad() for gap in self.gap_angles_by_trial],
            "predictions": [prediction.to_dict() for prediction in self.predictions],
            "next_experiment": self.experiment.to_dict() if self.experiment else None,
            "trials": [trial.to_dict() for trial in self.trials],
            "defects": [defect.to_dict() for trial in self.trials for defect in trial.defects],
        }


@on_one_thread
def diagnose(
    simulator: Simulator,
    dataset: DataSet,
    request: DiagnosisRequest,
    executor: Executor,
    on_progress: OnProgress = silent,
    cache: SimulationCache | None = None,
    settings: DiagnosisSettings = DEFAULT,
) -> Diagnosis:
    """Return where the gap lies, what causes it and what to measure next.

    Args:
        simulator: the nominal robot, its scenario 0, at the fidelity to use.
        dataset: the data set.
        request: seed, effects to try, and whether to look for the next gait.
        executor: where rollouts run.
        on_progress: called with the progress.
        cache: keeps what is simulated, and returns what it has; None to keep nothing.
        settings: tuning constants of all steps.

    Raises:
        GaitoptError: a trial has fewer than two cycles left, the simulation of its gait fails, or none of the
        requested effects can be tried.
    """
    tried = _hypotheses(simulator, dataset, request.effects)
    logged = any(trial.has_log for trial in dataset.trials)
    on_progress = numbered(on_progress, stages(logged, request.next_gait))
    on_progress(Progress(FLOOR))
    located = locate(simulator, dataset, executor, request.seed, settings.gap)
    parts = [trial.aligned for trial in located.fitting], [trial.floors for trial in located.fitting]
    angles = located.located_gap_angles
    gap = NominalGap(simulator, *parts, located.located_gap.floor, angles.floor if angles else None)
    context = Context(Runner(executor, on_progress, cache), request.seed, settings)
    found = find_causes(gap, tried, context)
    on_progress(Progress(PREDICTING))
    robots = draw_robots(found, request.seed)
    odd = [trial.aligned.trial for trial in located.trials if trial.is_misfit]
    expected = predictions(found, robots, executor, request.seed, misfits=odd)
    names = tuple(dict.fromkeys(one.effect.name for one in tried)) if found.candidates else ()
    located = replace(located, robots=robots, predictions=expected, tried=names)
    if found.verdict == "no_gap" or not request.next_gait:
        return replace(located, found=found)
    on_progress(Progress(NEXT))
    experiment = _next_experiment(simulator, located, found, context)
    return replace(located, found=found, experiment=experiment)


def _next_experiment(
    simulator: Simulator, located: Diagnosis, found: Causes, context: Context
) -> Experiment | CommandExperiment | None:
    """Return what to measure next: a gait, or commands where commands were logged."""
    drives = {trial.aligned.trial.drive.name: trial.aligned.trial.drive for trial in located.trials}
    signals = list(dict.fromkeys(name for trial in located.trials for name in trial.floors))
    if not located.has_logs:
        return propose(simulator, found, list(drives.values()), signals, context)
    noises = {
        name: max(trial.floors[name].noise for trial in located.trials if name in trial.floors)
        for name in signals
    }
    alternatives = [
        Alternative(candidate.label, chance, candidate.effect_values)
        for candidate, chance in zip(found.candidates, found.probabilities.tolist(), strict=True)
        if chance > 0.0
    ]
    return propose_commands(
        simulator, alternatives, list(drives.values()), noises, context.executor, context.seed
    )


def _hypotheses(simulator: Simulator, dataset: DataSet, effects: Collection[str] | None) -> list[Hypothesis]:
    """Return the hypotheses: every requested effect that applies, on each of its targets."""
    known = any(trial.starts_at_s is not None for trial in dataset.trials)
    active = [one.effect.name for one in simulator.effects.active]
    one_clock = all(trial.has_log and trial.starts_at_s is not None for trial in dataset.trials)
    nominal, channels = simulator.effects.nominal, simulator.problem.channel_names
    applicable = hypotheses(nominal, channels, known, active, one_clock)
    chosen = [one for one in applicable if effects is None or one.effect.name in effects]
    if not chosen:
        raise GaitoptError("no effect can be tried: none of those asked for applies to this robot")
    return chosen


def locate(
    simulator: Simulator, dataset: DataSet, executor: Executor, seed: int, settings: GapSettings = DEFAULT.gap
) -> Diagnosis:
    """Return where the gap between a data set and the nominal robot lies.

    Args:
        simulator: the nominal robot, its scenario 0, at the fidelity to use.
        dataset: the data set.
        executor: where rollouts run.
        seed: seed of all randomness.
        settings: see `GapSettings`.

    Raises:
        GaitoptError: a trial has fewer than two cycles left, or the simulation of its gait fails.
    """
    cleaned = [clean(trial, settings.defects) for trial in dataset.trials]
    trials = [entry.trial for entry in cleaned]
    pairs = zip(trials, predict(simulator, trials, executor), strict=True)
    aligned = [align(trial, simulated, settings.align) for trial, simulated in pairs]
    floors = measure_floors(simulator, aligned, executor, seed, settings.floor)
    parts = zip(cleaned, aligned, floors, strict=True)
    speeds = top_speeds([one for one in aligned if one.trial.has_log])
    gaps = [trial_gap(simulator.problem, *part, speeds, settings) for part in parts]
    odd = misfits(aligned, settings.align, settings.misfits)
    gaps = [gap.with_mismatches(odd.get(gap.name, ())) for gap in gaps]
    return Diagnosis(simulator.problem.name, str(dataset.source), seed, simulator.fidelity, tuple(gaps))


def _mean(values: Sequence[float], weights: Sequence[int]) -> float:
    return sum(v * w for v, w in zip(values, weights, strict=True)) / sum(weights)
