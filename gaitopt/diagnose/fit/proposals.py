"""Where to try an effect that changes commands in jumps, such as rounding, found without a simulation.

Rounded to one step, commands differ from those rounded to a step a little larger by as much as from those
not rounded at all. So the fit has a narrow minimum, between others, and a few values that are tried do not
meet it. But what rounding changes of the commands is known exactly, and a joint follows a small change of a
command nearly as a first-order lag does. The residual that this leaves says which values are worth a
simulation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.residual import WhitenedTrial
from gaitopt.diagnose.fit.robust import RobustLoss
from gaitopt.diagnose.fit.set_fit import SetFit
from gaitopt.diagnose.fit.settings import PROPOSALS, ProposalSettings
from gaitopt.diagnose.fit.trials import TrialSet
from gaitopt.robot.signals import joint_signal
from gaitopt.robot.trajectory import Trajectory

Array = NDArray[np.float64]


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

    def shares(self, fit: SetFit, hypothesis: Hypothesis) -> list[float]:
        """Return the most promising places of an effect beside a set, as shares of its range, best first.

        Args:
            fit: the set.
            hypothesis: an effect from its neutral lower bound up, whose response jumps.
        """
        tried = self._tried
        losses = [self._least_loss(fit, hypothesis, share) for share in tried.tolist()]
        order = np.argsort(losses, kind="stable")
        chosen: list[float] = []
        for share in tried[order].tolist():
            if all(abs(np.log(share / other)) > self.settings.apart for other in chosen):
                chosen.append(share)
        return chosen[: self.settings.most]

    @cached_property
    def _tried(self) -> Array:
        return np.geomspace(self.settings.least, 1.0, self.settings.values)

    def _least_loss(self, fit: SetFit, hypothesis: Hypothesis, share: float) -> float:
        """Return the loss that is left if joints follow what the effect changes with the best of the lags."""
        value = hypothesis.value(hypothesis.coordinate_at(share))
        changes = [_change(one, hypothesis, value) for one in self.trial_set.trials]
        losses = []
        for lag_s in self.settings.lags_s:
            rows = [
                one.whitener @ _followed(one, time, change, lag_s)
                for one, (time, change) in zip(self.trial_set.trials, changes, strict=True)
            ]
            moved = self.trial_set.rewhiten_rows(np.concatenate(rows), self.trial_set.initial)
            losses.append(self.loss.total(fit.robot.whitened - moved))
        return min(losses)


def _change(one: WhitenedTrial, hypothesis: Hypothesis, value: float) -> tuple[Array, Mapping[str, Array]]:
    """Return times, s, and what an effect changes then of the command of each joint, rad, by its signal."""
    effect, parts = hypothesis.effect, replace(hypothesis.nominal, target=hypothesis.target)
    time = np.arange(0.0, float(one.aligned.time[-1]) + _STEP_S, _STEP_S)
    drive = one.aligned.trial.drive
    if effect.commands is None:
        raise ValueError(f"{effect.name} does not change commands")
    change = np.nan_to_num(effect.commands(drive.targets, value, parts)(time) - drive.targets(time))
    joints = zip(parts.servos, parts.servo_joints, strict=True)
    return time, {
        joint_signal(parts.model.joint(joint).name): change[:, servo] for servo, joint in joints if joint >= 0
    }


_STEP_S = 5e-3
"""Step at which changes of commands are followed, s."""


def _followed(one: WhitenedTrial, time: Array, change: Mapping[str, Array], lag_s: float) -> Array:
    """Return how much joints that follow changes with a lag move each row of a trial, rad, shape (rows,)."""
    share = -np.expm1(-_STEP_S / lag_s)
    still = np.zeros(len(time))
    signals = dict.fromkeys(one.bins.rows, still)
    for name in signals.keys() & change.keys():
        start = [(1.0 - share) * float(change[name][0])]  # at rest under the first command
        signals[name] = lfilter([share], [1.0, share - 1.0], change[name], zi=start)[0]
    return one.bins.means(Trajectory(time, signals), one.aligned.offset_s)
