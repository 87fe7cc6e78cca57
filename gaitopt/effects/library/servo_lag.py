"""The lag of a servo's controller behind its command."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.effect import Effect
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior
from gaitopt.gait.drive import Commands

_NONE = int(mujoco.mjtDyn.mjDYN_NONE)
_FILTERS = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))


def _filtered(parts: Parts) -> list[int]:
    """Return the target servos that MuJoCo filters, whatever their time constant."""
    return [i for i in parts.servos if int(parts.model.actuator_dyntype[i]) in _FILTERS]


def _time_constant(parts: Parts) -> float:
    """Return the largest time constant of the target servos, s; 0 where MuJoCo filters none."""
    return float(parts.model.actuator_dynprm[_filtered(parts), 0].max(initial=0.0))


def _other_dynamics(parts: Parts) -> str | None:
    if any(int(parts.model.actuator_dyntype[i]) not in (_NONE, *_FILTERS) for i in parts.servos):
        return "an actuator has dynamics other than a first-order lag"
    return None


def _set_time_constant(parts: Parts, lag: float, nominal: float) -> None:
    """Set the time constant of MuJoCo's filters; servos of different lag keep their proportion.

    The filter is integrated exactly, and its force uses the state at the end of a step. With MuJoCo's other
    choice, the state at the beginning, a time constant of 0 would be a delay of a step.
    """
    model, servos = parts.model, _filtered(parts)
    model.actuator_dyntype[servos] = int(mujoco.mjtDyn.mjDYN_FILTEREXACT)
    model.actuator_actearly[servos] = 1
    if nominal > 0.0:
        model.actuator_dynprm[servos, 0] *= lag / nominal
    else:
        model.actuator_dynprm[servos, 0] = lag


def _filter_commands(sent: Commands, lag: float, parts: Parts) -> Commands:
    """Return the commands through a first-order lag, from the angle held before.

    This is for servos without a filter of MuJoCo's own. A command that is held for a step has an exact
    response, of which each step gets the mean.
    """
    if _filtered(parts):
        return sent
    step_s, servos = parts.step_s, parts.servos

    def followed(time: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = sent(time).copy()
        before = sent(time[:1] - step_s)[0]
        for i in servos:
            rows[:, i] = list(_lagging(before[i], rows[:, i].tolist(), lag / step_s))
        return rows

    return followed


def _lagging(at: float, angles: Sequence[float], lag: float) -> Iterator[float]:
    """Yield the mean of the lagging angle over each step, rad; NaN where asked, and it holds meanwhile.

    Args:
        at: the angle before, rad; NaN where there is none: the first angle is then met at once.
        angles: the angle asked for in each step, rad.
        lag: time constant, steps.
    """
    kept = math.exp(-1.0 / lag)
    mean = lag * (1.0 - kept)
    for asked in angles:
        if math.isnan(asked):
            yield asked
            continue
        behind = 0.0 if math.isnan(at) else at - asked
        yield asked + mean * behind
        at = asked + kept * behind


SERVO_LAG = Effect(
    name="servo_lag",
    summary="first-order lag of the commanded angle inside the servo",
    parameter="time_constant_s",
    unit="s",
    neutral=_time_constant,
    low=0.0,
    high=0.15,
    scale="lin",
    prior=Prior(
        "half-normal",
        0.0,
        0.04,
        "pulse stretchers of analogue servos and input filters of digital ones last one to three frames of "
        "10 to 20 ms; first-order lags identified on hobby servos are 20 to 100 ms",
    ),
    allowed=(0.0, 10.0),
    target="any",
    missing=_other_dynamics,
    model=_set_time_constant,
    commands=_filter_commands,
)
