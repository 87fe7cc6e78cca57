"""Where to try an effect that changes commands in jumps, such as rounding, found without a simulation.

Rounded to one step, commands differ from those rounded to a step a little larger by as much as from those
not rounded at all. So the fit has a narrow minimum, between others, and a few values that are tried do not
meet it: a step of 0.02 rad must be known to 0.1 %. But what rounding changes of the commands is known
exactly, and joints follow small changes nearly as linear systems do: at first as a lag, later as a mixture of
lags that is learnt from the robots that were simulated. The residual that this leaves says which of thousands
of values are worth a simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose.fit.following import Following
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.robust import RobustLoss
from gaitopt.diagnose.fit.set_fit import SetFit
from gaitopt.diagnose.fit.settings import PROPOSALS, ProposalSettings
from gaitopt.diagnose.fit.trials import Comparison, TrialSet

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
    _following: dict[str, Following] = field(default_factory=dict, repr=False, compare=False)
    _mixtures: dict[str, Array] = field(default_factory=dict, repr=False, compare=False)

    def shares(self, fit: SetFit, hypothesis: Hypothesis) -> list[float]:
        """Return the most promising places of an effect beside a set, as shares of its range, best first.

        Args:
            fit: the set.
            hypothesis: an effect from its neutral lower bound up, whose response jumps.
        """
        learnt = self._mixtures.get(hypothesis.name)
        values = self.settings.values if learnt is None else self.settings.close_values
        mixtures = np.eye(len(self.settings.lags_s)) if learnt is None else learnt[None]
        shares = np.geomspace(self.settings.least, 1.0, values)
        return self._least(shares, self._losses(fit, hypothesis, shares, mixtures))

    def knows(self, hypothesis: Hypothesis) -> bool:
        """Whether it was learnt how joints follow an effect; `shares` then compares many more values."""
        return hypothesis.name in self._mixtures

    def learn(
        self, fit: SetFit, hypothesis: Hypothesis, simulated: Sequence[tuple[float, Comparison]]
    ) -> None:
        """Learn how joints follow an effect.

        Args:
            fit: a set.
            hypothesis: the effect.
            simulated: places of the effect beside the set, and the robots there; at least one.
        """
        values = self._values(hypothesis, np.array([share for share, _ in simulated]))
        moved = np.array([fit.robot.whitened - robot.whitened for _, robot in simulated])
        self._mixtures[hypothesis.name] = self._followed(hypothesis).mixture_of(values, moved)

    def _least(self, shares: Array, losses: Array) -> list[float]:
        """Return the shares with the least losses, the least first, some way apart."""
        chosen: list[float] = []
        for share in shares[np.argsort(losses, kind="stable")].tolist():
            if all(abs(np.log(share / other)) > self.settings.apart for other in chosen):
                chosen.append(share)
            if len(chosen) == self.settings.most:
                break
        return chosen

    def _losses(self, fit: SetFit, hypothesis: Hypothesis, shares: Array, mixtures: Array) -> Array:
        """Return the loss that is left if joints follow each place by its best mixture, shape (shares,).

        The other effects of the set go where their slopes then make least squares.
        """
        loss, found = self.loss, []
        weights = np.sqrt(loss.weights_of(fit.robot.whitened))[loss.row_trials]
        steps = np.linalg.pinv(fit.slopes * weights[:, None]) * weights
        for moved in self._followed(hypothesis).moved(self._values(hypothesis, shares), mixtures):
            left = fit.robot.whitened - moved
            left -= (left @ steps.T) @ fit.slopes.T
            found.append(np.min([loss.totals(each) for each in left], axis=0))
        return np.concatenate(found)

    @staticmethod
    def _values(hypothesis: Hypothesis, shares: Array) -> list[float]:
        return [hypothesis.value(hypothesis.coordinate_at(share)) for share in shares.tolist()]

    def _followed(self, hypothesis: Hypothesis) -> Following:
        if hypothesis.name not in self._following:  # the same beside every set
            self._following[hypothesis.name] = Following.of(self.trial_set, hypothesis, self.settings.lags_s)
        return self._following[hypothesis.name]
