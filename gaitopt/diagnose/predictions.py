"""Predictions with intervals: the speed of baselines and filmed gaits, or the error of each signal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from gaitopt.core.statistics import spread90
from gaitopt.core.streams import Stream, generator
from gaitopt.diagnose.fit.residual import by_signal
from gaitopt.diagnose.judge.candidates import Candidate
from gaitopt.diagnose.judge.causes import Causes
from gaitopt.diagnose.judge.small_errors import (
    is_finer,
    is_finer_tolerant,
    perturbed_scenarios,
    tolerant_scenarios,
)
from gaitopt.diagnose.record.trial import Trial
from gaitopt.effects.active import EffectValues
from gaitopt.gait.drive import Drive
from gaitopt.gait.gait import Gait
from gaitopt.optimise.evaluator import assess_all
from gaitopt.optimise.robots import Expected
from gaitopt.optimise.verification import evenly
from gaitopt.robot.signals import MARKER
from gaitopt.simulation.metrics import SPEED
from gaitopt.simulation.scenario import NOMINAL, Scenario
from gaitopt.simulation.setup import RobotSetup

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PredictionSettings:
    """How predictions are made.

    Attributes:
        robots: robots of the posterior that each gait is simulated on; of fewer than 19 the interval would be
            too narrow (`spread90`),
        tolerant: their number where they are a little wrong in everything.
        stretches: parts of a recording that are resampled for the interval of its error.
        draws: number of resamplings.
    """

    robots: int = 20
    tolerant: int = 48
    stretches: int = 8
    draws: int = 200


@dataclass(frozen=True)
class Prediction:
    """What is expected of one gait, or log of commands.

    Attributes:
        gait: its name.
        filmed: whether the data set has it.
        speed: forward speed of the robot, m/s; None for problems without travel, and for logs. Its interval
            holds what is not known of the robot, with the start pose, the timestep and small errors or, where
            these count, the tolerances, and what no effect explains. Its width to a side is the root of the
            sum of two squares, of the robots' and of the left-over. Where tolerances count, the recordings
            narrow the interval (`Ensemble`). The left-over is an error of the travel per cycle, by the
            evidence of held-out gaits, by Student's t. With one gait only, it is that of held-out cycles,
            which says little about other gaits.
        nominal_m_s: the speed of the nominal robot, m/s; None without `speed`.
        failed: robots whose simulation failed; they are left out.
        rms: RMS error of each signal, m or rad, to be expected where the same is recorded again. It is what
            the fit to the other recordings left of this one, and its interval is over resampled parts of it.
            Empty where there is a speed.
    """

    gait: str
    filmed: bool
    speed: Expected | None = None
    nominal_m_s: float | None = None
    failed: int = 0
    rms: Mapping[str, Expected] = field(default_factory=dict)

    def to_dict(self) -> dict[str, object]:
        """Return a row of ``predictions`` in ``diagnosis.json``."""
        row: dict[str, object] = {"gait": self.gait, "filmed": self.filmed}
        if self.speed is None:
            return row | {"rms": {name: one.to_dict() for name, one in self.rms.items()}}
        row |= {"speed_m_s": self.speed.to_dict(), "nominal_m_s": self.nominal_m_s}
        return row | ({"failed": self.failed} if self.failed else {})


def predictions(
    found: Causes,
    robots: Sequence[EffectValues],
    executor: Executor,
    seed: int,
    settings: PredictionSettings = PredictionSettings(),
    *,
    misfits: Sequence[Trial] = (),
) -> tuple[Prediction, ...]:
    """Return what is expected of each baseline and of each gait or log of the data set.

    Args:
        found: what may have caused the gap.
        robots: robots drawn from the posterior.
        executor: where robots are simulated.
        seed: seed of start poses and resamplings.
        settings: how many robots.
        misfits: trials of the data set that fit no other, and told nothing.
    """
    problem = found.trial_set.problem
    trials = [one.aligned.trial for one in found.trial_set.trials]
    walked = problem.roles.marker is not None
    gaits = dict(problem.baselines) if walked else {}
    filmed: dict[str, Drive] = {trial.drive.key: trial.drive for trial in trials}
    filmed |= {one.drive.key: one.drive for one in misfits if walked and isinstance(one.drive, Gait)}
    if walked:
        known = {gait.key for gait in gaits.values()}
        own = [one for one in filmed.values() if isinstance(one, Gait) and one.key not in known]
        gaits |= {_free_name(gait.name, gaits): gait for gait in own}
    rows = _speeds(found, gaits, frozenset(filmed), robots, executor, seed, settings)
    logs = {key: drive.name for key, drive in filmed.items() if not (walked and isinstance(drive, Gait))}
    return (*rows, *_errors(found, logs, seed, settings))


def _free_name(name: str, taken: Mapping[str, Gait]) -> str:
    """Return a name that no other gait has."""
    number = 2
    free = name
    while free in taken:
        free, number = f"{name} ({number})", number + 1
    return free


def _speeds(
    found: Causes,
    gaits: Mapping[str, Gait],
    filmed: frozenset[str],
    robots: Sequence[EffectValues],
    executor: Executor,
    seed: int,
    settings: PredictionSettings,
) -> list[Prediction]:
    """Return the speed of each gait over some of the robots, each with small errors and a start pose.

    Some have half the timestep: what contacts do depends on it.
    """
    if not gaits:
        return []
    problem, fidelity = found.trial_set.problem, found.trial_set.simulator.fidelity
    walks, ensemble = _walks(found, seed, settings), found.ensemble
    pairs = zip(walks, evenly(robots, len(walks)), strict=False)
    walks = [_Walk(NOMINAL), *(replace(one, begun=replace(one.begun, effects=robot)) for one, robot in pairs)]
    scenarios = [one.begun for one in walks]
    setup, finer = (RobotSetup.of(problem, scenarios, one) for one in (fidelity, fidelity.scaled(0.5)))
    setups = [finer if one.finer else setup for one in walks]
    work = [(own, gait, index) for gait in gaits.values() for index, own in enumerate(setups)]
    done = iter(assess_all(work, executor))
    left_over = leftover_travel(found)
    rows = []
    for name, gait in gaits.items():
        nominal, *others = [next(done) for _ in setups]
        values = np.array([outcome.metrics[SPEED.name] for outcome in others])
        failed = sum(outcome.status != "ok" for outcome in others)
        learnt = None if ensemble is None else ensemble.first(len(values)).learnt(values, seed)
        speed = widened(learnt or Expected.of(values.tolist()), left_over / gait.period_s)
        rows.append(Prediction(name, gait.key in filmed, speed, nominal.metrics[SPEED.name], failed))
    return rows


@dataclass(frozen=True)
class _Walk:
    """How a robot's walk begins, with its small errors, and whether it has half the timestep."""

    begun: Scenario
    finer: bool = False


def _walks(found: Causes, seed: int, settings: PredictionSettings) -> list[_Walk]:
    """Return how the robots walk: those whose recordings are known, or others that are made exactly."""
    simulator = found.trial_set.simulator
    if found.ensemble is None:
        made = perturbed_scenarios(simulator, seed, settings.robots)
        return [_Walk(one, is_finer(index)) for index, one in enumerate(made)]
    numbers = found.ensemble.numbers[: settings.tolerant]
    drawn = tolerant_scenarios(simulator, found.seed, numbers[-1] + 1)
    poses = generator(seed, Stream.ENSEMBLE_POSES).integers(2**31, size=len(numbers)).tolist()
    pairs = zip(numbers, poses, strict=True)  # a robot begins each walk anew
    return [_Walk(replace(drawn[n], pose_seed=pose), is_finer_tolerant(n)) for n, pose in pairs]


def widened(expected: Expected, half: float) -> Expected:
    """Return a figure whose interval holds another error as well.

    Args:
        expected: the figure.
        half: half the width of the 90 % interval of the other error, in its unit.
    """
    mean, (low, high) = expected.mean, expected.ci90
    return Expected(mean, (mean - math.hypot(mean - low, half), mean + math.hypot(high - mean, half)))


def leftover_travel(found: Causes) -> float:
    """Return half the width of the 90 % interval of the error of the travel per cycle, m.

    It is the forward slope of what the first explanation leaves of each recording of a gait that its fit did
    not see, times the period: an error of how far a foot holds or slips is one of each step, not of each
    second. The root of the mean square over gaits is widened by Student's t, with as many degrees of freedom
    as there are gaits. It is 0 where forward motion was not measured; nothing then tells what is left. What
    the tolerances of the robot allow is no part of it: the robots that are simulated have such errors.
    """
    errors: dict[str, list[float]] = {}
    for trial, residual in _left(found):
        if isinstance(trial.drive, Gait):
            slope = _forward_slope(found, trial, residual)
            if slope is not None:
                errors.setdefault(trial.drive.key, []).append(slope * trial.drive.period_s)
    if not errors:
        return 0.0
    squares = [float(np.mean(np.square(own))) for own in errors.values()]
    return _unexplained(found) * float(stats.t.ppf(0.95, len(squares))) * math.sqrt(float(np.mean(squares)))


def _unexplained(found: Causes) -> float:
    """Return the share of what is left, as a length, of other causes than tolerances."""
    if not found.judgement.tolerant:
        return 1.0
    first = found.best or found.none
    beyond = math.sqrt(max(0.0, 1.0 - 1.0 / max(1.0, first.left(found.trial_set))))
    return max(beyond, found.other_probability)


def _left(found: Causes) -> list[tuple[Trial, dict[str, Array]]]:
    """Return each trial with what the first explanation leaves of its signals, held out."""
    first: Candidate = found.best or found.none
    trials = found.trial_set.trials
    parts = by_signal(trials, first.marker, first.angles)
    return [(one.aligned.trial, part) for one, part in zip(trials, parts, strict=True)]


def _forward_slope(found: Causes, trial: Trial, residual: Mapping[str, Array]) -> float | None:
    """Return the slope of the forward residual, m/s; None where forward motion was not measured."""
    total = 0.0
    for name, share in zip(MARKER, found.trial_set.problem.roles.axes[0].tolist(), strict=True):
        if abs(share) < 1e-9:
            continue
        if name not in residual or len(residual[name]) < 2:
            return None
        time = trial.time[trial.used[name]] - trial.time[trial.used[name]].mean()
        total += share * float(time @ residual[name]) / max(float(time @ time), 1e-300)
    return total


def _errors(
    found: Causes, drives: Mapping[str, str], seed: int, settings: PredictionSettings
) -> list[Prediction]:
    """Return the RMS error to be expected of each signal of each drive, by its key and name."""
    if not drives:
        return []
    parts: dict[str, dict[str, list[Array]]] = {key: {} for key in drives}
    for trial, residual in _left(found):
        for name, samples in residual.items() if trial.drive.key in drives else ():
            stretches = np.array_split(samples**2, settings.stretches)
            own = parts[trial.drive.key].setdefault(name, [])
            own += [stretch for stretch in stretches if len(stretch)]
    rng = generator(seed, Stream.POSTERIOR_DRAWS, settings.draws)
    return [
        Prediction(name, True, rms={signal: _rms(own, rng, settings) for signal, own in parts[key].items()})
        for key, name in drives.items()
    ]


def _rms(stretches: Sequence[Array], rng: np.random.Generator, settings: PredictionSettings) -> Expected:
    """Return the root of the mean of squares, its interval over resampled stretches."""
    sums, counts = (np.array([of(one) for one in stretches], dtype=float) for of in (np.sum, len))
    drawn = rng.integers(len(sums), size=(settings.draws, len(sums)))
    roots = np.sqrt(sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1))
    return Expected(math.sqrt(float(sums.sum() / counts.sum())), spread90(roots))
