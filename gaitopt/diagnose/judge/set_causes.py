"""Sets of effects under logged commands; a second search where commands act late by chance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.statistics import UNIFORM_WIDTH
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.residual import WhitenedTrial
from gaitopt.diagnose.fit.trials import TrialSet
from gaitopt.diagnose.gap.floor import Floors
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.judged_sets import JudgedSets
from gaitopt.diagnose.judge.judgement import Judgement
from gaitopt.diagnose.judge.lateness import LateChanges, Lateness, find_lateness, simulate_late_changes
from gaitopt.diagnose.judge.set_judge import RankedSets, SetJudge
from gaitopt.effects.library.jitter import COMMAND_JITTER
from gaitopt.effects.library.timing import COMMAND_LATENCY
from gaitopt.effects.parts import ALL
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]

_FIXED = 1e-3
"""Range of a coordinate that is not fitted, as a share of its value on either side."""


_DELAYS = (1.0 / 8.0, 3.0 / 8.0, 5.0 / 8.0, 7.0 / 8.0)
"""Delays that stand for a uniform distribution, as shares of its width."""


@dataclass(frozen=True)
class _LateCommands:
    """How late commands act by chance, and what a change does that is late by each of `_DELAYS`.

    Attributes:
        lateness: how late they act.
        changes: for each of these delays, what a robot does, by the key of the drive.
    """

    lateness: Lateness
    changes: Sequence[Mapping[str, LateChanges]]

    def columns(self, trial: WhitenedTrial) -> Array:
        """Return responses of a trial whose squares add up to the covariance by delays, shape (n, k)."""
        key = trial.aligned.trial.drive.key
        if any(key not in changes for changes in self.changes):
            return np.zeros((trial.n_rows, 0))
        moved = np.stack([changes[key].columns(trial) * changes[key].by_s for changes in self.changes])
        apart = (moved - moved.mean(axis=0)) / np.sqrt(len(moved))
        columns: Array = np.concatenate(list(apart), axis=1)
        return columns


def judged_by_sets(
    judgement: Judgement, floors: Sequence[Floors], hypotheses: Sequence[Hypothesis], context: Context
) -> tuple[Judgement, JudgedSets]:
    """Return a judgement with sets of effects, and the sets.

    A fit cannot find the delays of commands by chance: those of the model are others than those of the robot.
    Repeats of the same commands tell how large they are. Then all is fitted again beside such delays.

    Args:
        judgement: the trials.
        floors: floor of each signal of each trial.
        hypotheses: the effects to try, each on its targets.
        context: simulates robots; seed and settings.
    """
    judge = SetJudge.of(judgement.trial_set, context.runner, context.settings.sets)
    by_chance = [h for h in hypotheses if h.effect.name == COMMAND_JITTER.name and h.target == ALL]
    hypotheses = [h for h in hypotheses if h.effect.name != COMMAND_JITTER.name]
    ranked = judge.ranked(judge.search(hypotheses, judgement.nominal))
    late = _late_commands(judgement.trial_set, ranked, floors, context) if by_chance else None
    if late is None:
        judged = JudgedSets.of(judge, ranked)
        return replace(judgement, sets=judged), judged
    judgement = _whitened_with(judgement, late)
    jitter = _fixed(by_chance[0], late.lateness.sd_s)
    judge = SetJudge.of(judgement.trial_set, context.runner, context.settings.sets)
    ranked = judge.ranked(judge.search(hypotheses, judgement.nominal, [(jitter, late.lateness.sd_s)]))
    shifts = {COMMAND_LATENCY.name: late.lateness.delay_shift}
    judged = JudgedSets.of(judge, ranked, {jitter.name: late.lateness.ci90}, shifts)
    return replace(judgement, sets=judged), judged


def _late_commands(
    trial_set: TrialSet, ranked: RankedSets, floors: Sequence[Floors], context: Context
) -> _LateCommands | None:
    """Return how late commands act by chance; None where repeats do not show it.

    What late changes do is simulated with the nominal robot and with the best one so far, which may have
    effects in place of the delays. The one under which the repeats' differences are likelier tells.
    """
    best = ranked.candidates[0].effect_values if ranked.candidates else {}
    corrected = trial_set.problem.with_effects(best)
    robots = [trial_set.simulator, Simulator.build(corrected, fidelity=trial_set.simulator.fidelity)]
    settings, executor = context.settings.lateness, context.executor
    found = [(one, find_lateness(one, trial_set.trials, floors, executor, settings)) for one in robots]
    known = [(robot, lateness) for robot, lateness in found if lateness is not None]
    if not known:
        return None
    robot, lateness = max(known, key=lambda pair: pair[1].log_likelihood)
    width = UNIFORM_WIDTH * lateness.sd_s
    delays = [
        simulate_late_changes(robot, trial_set.trials, executor, share * width, settings) for share in _DELAYS
    ]
    return _LateCommands(lateness, delays)


def _whitened_with(judgement: Judgement, late: _LateCommands) -> Judgement:
    """Return a judgement of trials whose covariance has the delays of the robot and those of the model."""
    columns = [np.sqrt(2.0) * late.columns(one) for one in judgement.trial_set.trials]
    trial_set = judgement.trial_set.with_errors_along(columns, f"late by {late.lateness.sd_s!r} s:")
    nominal = trial_set.compare([0.0], trial_set.nominal)
    if nominal is None:
        raise ValueError("the nominal prediction was checked when it was aligned")
    return Judgement(trial_set, nominal, settings=judgement.settings)


def _fixed(hypothesis: Hypothesis, value: float) -> Hypothesis:
    """Return a hypothesis whose parameter no fit changes."""
    return replace(hypothesis, low=(1.0 - _FIXED) * value, high=(1.0 + _FIXED) * value)
