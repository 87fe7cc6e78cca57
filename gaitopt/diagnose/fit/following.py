"""How joints follow small changes of the commanded angles, as linear systems do: by a mixture of lags.

Commands hold few different angles. So the rows of a trial are kept for 1 rad more on each of these angles.
What any value of an effect does to them is then a sum.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.residual import WhitenedTrial
from gaitopt.diagnose.fit.trials import TrialSet
from gaitopt.diagnose.gap.predict import Run, runs_of
from gaitopt.robot.signals import joint_signal

Array = NDArray[np.float64]
SmallArray = NDArray[np.float32]
Indices = NDArray[np.intp]

_STEP_S = 5e-3
"""Step at which changes of commands are followed, s."""

_AT_ONCE = 500
"""Values whose changes are in memory at once."""


@dataclass(frozen=True)
class _Held:
    """The angles that one command holds a joint at.

    Attributes:
        servo: the servo that is commanded.
        signal: signal of its joint.
        time: times, s, shape (times,).
        angles: the different angles, rad, shape (angles,).
        which: the angle at each time, shape (times,).
    """

    servo: int
    signal: str
    time: Array
    angles: Array
    which: Indices

    @staticmethod
    def of(run: Run, hypothesis: Hypothesis) -> list[_Held]:
        """Return the angles of each joint that an effect may move."""
        parts = replace(hypothesis.nominal, target=hypothesis.target)
        time = np.arange(0.0, run.duration_s + _STEP_S, _STEP_S)
        sent = np.nan_to_num(run.drive.targets(time))  # an unpowered servo is not commanded
        found = []
        for servo, joint in zip(parts.servos, parts.servo_joints, strict=True):
            if joint >= 0:
                angles, which = np.unique(sent[:, servo], return_inverse=True)
                signal = joint_signal(parts.model.joint(joint).name)
                found.append(_Held(int(servo), signal, time, angles, which))
        return found

    def followed(self, lag_s: float) -> Array:
        """Return how the joint follows 1 rad more on each angle with a lag, shape (times, angles).

        It is at rest under the first command.
        """
        more = np.eye(len(self.angles))[self.which]
        share = -np.expm1(-_STEP_S / lag_s)
        at_rest = (1.0 - share) * more[:1]
        followed: Array = lfilter([share], [1.0, share - 1.0], more, axis=0, zi=at_rest)[0]
        return followed


@dataclass(frozen=True)
class Following:
    """How the rows of some trials follow an effect that changes each commanded angle for itself.

    Attributes:
        hypothesis: the effect.
        angles: the angles that are commanded, each in a row of its own, the other servos at 0, rad, shape
            (angles, servos).
        servos: servo of each row, shape (angles,).
        trials: for each trial, the rows of its angles, and how far 1 rad more on each of them moves its
            whitened rows, by each lag, shape (lags, rows of the trial, angles of the trial).
    """

    hypothesis: Hypothesis
    angles: Array
    servos: Indices
    trials: tuple[tuple[Indices, SmallArray], ...]
    _known: dict[tuple[float, ...], SmallArray] = field(default_factory=dict, repr=False, compare=False)

    @staticmethod
    def of(trial_set: TrialSet, hypothesis: Hypothesis, lags_s: Sequence[float]) -> Following:
        """Return how trials follow with each of some lags."""
        aligned = [one.aligned for one in trial_set.trials]
        runs = runs_of([one.trial for one in aligned], [float(one.time[-1]) for one in aligned])
        held = {key: _Held.of(run, hypothesis) for key, run in runs.items()}
        every = [one for parts in held.values() for one in parts]
        servos = np.concatenate([np.full(len(one.angles), one.servo) for one in every])
        angles = np.zeros((len(servos), len(hypothesis.nominal.channels)))
        angles[np.arange(len(servos)), servos] = np.concatenate([one.angles for one in every])
        places, first = {}, 0
        for key, parts in held.items():
            count = sum(len(one.angles) for one in parts)
            places[key] = np.arange(first, first + count)
            first += count
        trials = []
        for index, one in enumerate(trial_set.trials):
            key = one.aligned.trial.drive.key
            moved = np.array([trial_set.whiten(index, _rows(one, held[key], lag_s)) for lag_s in lags_s])
            trials.append((places[key], moved.astype(np.float32)))
        return Following(hypothesis, angles, servos, tuple(trials))

    def mixture_of(self, values: Sequence[float], moved: Array) -> Array:
        """Return the one mixture of lags by which joints followed simulated values best, shape (lags,).

        Args:
            values: values of the effect.
            moved: how far each moved the rows of all trials, shape (values, rows).
        """
        lags = self.trials[0][1].shape[0]
        by_lag = np.concatenate([*self.moved(values, np.eye(lags))], axis=1).reshape(lags, -1)
        mixture: Array = np.linalg.lstsq(by_lag.T.astype(float), moved.ravel())[0]
        return mixture

    def moved(self, values: Sequence[float], mixtures: Array) -> Iterator[SmallArray]:
        """Yield how far some of the values at a time move the rows of all trials, by each mixture.

        Args:
            values: values of the effect.
            mixtures: weights of the lags, shape (mixtures, lags).

        Yields:
            Shape (mixtures, values, rows).
        """
        weights = mixtures.astype(np.float32)
        mixed = [
            (places, np.tensordot(weights, rows, axes=1).transpose(0, 2, 1)) for places, rows in self.trials
        ]
        for first in range(0, len(values), _AT_ONCE):
            changes = self._changes(tuple(values[first : first + _AT_ONCE]))
            yield np.concatenate([changes[:, places] @ rows for places, rows in mixed], axis=2)

    def _changes(self, values: tuple[float, ...]) -> SmallArray:
        """Return what each value changes of each angle, rad, shape (values, angles); the same is kept."""
        if values not in self._known:
            self._known[values] = self._changed(values)
        return self._known[values]

    def _changed(self, values: tuple[float, ...]) -> SmallArray:
        effect = self.hypothesis.effect
        parts = replace(self.hypothesis.nominal, target=self.hypothesis.target)
        if effect.commands is None:
            raise ValueError(f"{effect.name} does not change commands")
        none, rows = np.empty(0), np.arange(len(self.servos))
        changes = np.empty((len(values), len(rows)), dtype=np.float32)
        for index, value in enumerate(values):
            changed = effect.commands(lambda _: self.angles, value, parts)(none)
            changes[index] = (changed - self.angles)[rows, self.servos]
        return changes


def _rows(trial: WhitenedTrial, held: Sequence[_Held], lag_s: float) -> Array:
    """Return how far 1 rad more on each angle moves the rows of a trial, shape (rows, angles)."""
    found = []
    for one in held:
        if one.signal in trial.bins.rows:
            averaging = trial.bins.averaging(one.signal, one.time, trial.aligned.offset_s)
            found.append(averaging @ one.followed(lag_s))
        else:
            found.append(np.zeros((trial.n_rows, len(one.angles))))
    return np.concatenate(found, axis=1)
