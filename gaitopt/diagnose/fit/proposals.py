"""Where to try an effect that changes commands in jumps, such as rounding, found without a simulation.

Rounded to one step, commands differ from those rounded to a step a little larger by as much as from those
not rounded at all. So the fit has a narrow minimum, between others, and a few values that are tried do not
meet it. But what rounding changes of the commands is known exactly, and a joint follows a small change of a
command nearly as a first-order lag does. The residual that this leaves says which values are worth a
simulation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.robust import RobustLoss
from gaitopt.diagnose.fit.set_fit import SetFit
from gaitopt.diagnose.fit.settings import PROPOSALS, ProposalSettings
from gaitopt.diagnose.fit.trials import TrialSet
from gaitopt.gait.drive import Drive
from gaitopt.robot.signals import joint_signal

Array = NDArray[np.float64]
SmallArray = NDArray[np.float32]


@dataclass(frozen=True)
class Proposals:
    """Proposes values of effects that change commands in jumps.

    Attributes:
        trial_set: the trials.
        loss: the loss of a whitened residual.
        settings: the values and lags that are compared.
    """

    trial_set: TrialSet
    loss: RobustLoss
    settings: ProposalSettings = PROPOSALS
    _moves: dict[str, _Moves] = field(default_factory=dict, repr=False, compare=False)

    def shares(self, fit: SetFit, hypothesis: Hypothesis) -> list[float]:
        """Return the most promising places of an effect beside a set, as shares of its range, best first.

        Args:
            fit: the set.
            hypothesis: an effect from its neutral lower bound up, whose response jumps.
        """
        tried = self._tried
        order = np.argsort(self._least_losses(fit, hypothesis), kind="stable")
        chosen: list[float] = []
        for share in tried[order].tolist():
            if all(abs(np.log(share / other)) > self.settings.apart for other in chosen):
                chosen.append(share)
        return chosen[: self.settings.most]

    @cached_property
    def _tried(self) -> Array:
        return np.geomspace(self.settings.least, 1.0, self.settings.values)

    def _least_losses(self, fit: SetFit, hypothesis: Hypothesis) -> Array:
        """Return the loss that is left if joints follow each value with the best lag, shape (values,)."""
        if hypothesis.name not in self._moves:  # the same beside every set
            values = [hypothesis.value(hypothesis.coordinate_at(share)) for share in self._tried.tolist()]
            self._moves[hypothesis.name] = _moves(self.trial_set, hypothesis, values, self.settings.lags_s)
        squares = self._moves[hypothesis.name].left_of(self.trial_set.split(fit.robot.whitened))
        losses = np.array([self.loss.of_squares(one).sum() for one in squares])
        least: Array = losses.reshape(len(self._tried), -1).min(axis=1)
        return least


@dataclass(frozen=True)
class _Moves:
    """How far joints move the rows of each trial with each value and lag, lags in turn within values.

    Attributes:
        rows: for each trial, whitened, shape (values x lags, rows of the trial).
        squares: sums of their squares, shape (values x lags, trials).
    """

    rows: tuple[SmallArray, ...]
    squares: Array

    def left_of(self, residuals: Sequence[Array]) -> Array:
        """Return the sums of squares that the moves leave of residuals, shape (values x lags, trials).

        Args:
            residuals: whitened residual of each trial, each of shape (rows of the trial,).
        """
        both = [rows @ one.astype(np.float32) for rows, one in zip(self.rows, residuals, strict=True)]
        own = [one @ one for one in residuals]
        return np.maximum(np.array(own) - 2.0 * np.array(both, dtype=float).T + self.squares, 0.0)


def _moves(
    trial_set: TrialSet, hypothesis: Hypothesis, values: Sequence[float], lags_s: Sequence[float]
) -> _Moves:
    changes: dict[str, tuple[Array, Mapping[str, Array]]] = {}
    columns = []
    for one in trial_set.trials:
        drive = one.aligned.trial.drive
        if drive.key not in changes:
            changes[drive.key] = _changes(drive, hypothesis, values, _longest(trial_set, drive))
        time, by_signal = changes[drive.key]
        moved = np.zeros((one.n_rows, len(values), len(lags_s)))
        for signal in by_signal.keys() & one.bins.rows.keys():
            averaging = one.bins.averaging(signal, time, one.aligned.offset_s)
            for index, lag_s in enumerate(lags_s):
                moved[:, :, index] += averaging @ _followed(by_signal[signal], lag_s).T
        columns.append(one.whitener @ moved.reshape(one.n_rows, -1))
    parts = trial_set.split(trial_set.rewhiten_rows(np.concatenate(columns), trial_set.initial))
    squares = np.array([np.square(part).sum(axis=0) for part in parts]).T
    return _Moves(tuple(part.T.astype(np.float32) for part in parts), squares)


def _longest(trial_set: TrialSet, drive: Drive) -> float:
    """Return when the longest trial of a drive ends, gait time, s."""
    trials = [one.aligned for one in trial_set.trials]
    return max(float(one.time[-1]) for one in trials if one.trial.drive.key == drive.key)


def _changes(
    drive: Drive, hypothesis: Hypothesis, values: Sequence[float], end_s: float
) -> tuple[Array, Mapping[str, Array]]:
    """Return times, s, and what each value changes then of the command of each joint, by its signal.

    The changes are in rad, shape (values, times).
    """
    effect, parts = hypothesis.effect, replace(hypothesis.nominal, target=hypothesis.target)
    if effect.commands is None:
        raise ValueError(f"{effect.name} does not change commands")
    time = np.arange(0.0, end_s + _STEP_S, _STEP_S)
    sent = drive.targets(time)
    rounded = [effect.commands(lambda _: sent, value, parts)(time) for value in values]
    change = np.nan_to_num(np.array(rounded) - sent)  # an unpowered servo is not commanded
    joints = zip(parts.servos, parts.servo_joints, strict=True)
    return time, {
        joint_signal(parts.model.joint(joint).name): change[:, :, servo]
        for servo, joint in joints
        if joint >= 0
    }


_STEP_S = 5e-3
"""Step at which changes of commands are followed, s."""


def _followed(change: Array, lag_s: float) -> Array:
    """Return how joints follow changes with a lag, at rest under the first command, shape (values, times)."""
    share = -np.expm1(-_STEP_S / lag_s)
    followed: Array = lfilter([share], [1.0, share - 1.0], change, zi=(1.0 - share) * change[:, :1])[0]
    return followed
