"""The gap of one signal under commands without a period, split into eight components.

- gain: the motion since the start is larger or smaller than simulated, by one factor.
- bias: the measured angle lies beside the simulated one by a constant.
- lag: the same motion comes later or earlier.
- drift: the distance grows or falls slowly over the recording.
- saturation: the motion is slower or faster than simulated where it runs at its limit.
- overshoot: the motion soon after a change of command has another shape: it overshoots or rings.
- stick_slip: the motion advances in steps where the command is smooth.
- noise: of the measurement.

Gain, bias, lag, drift and a limit of the speed are fitted one after the other, the one that removes most of
the residual first. The mean square that each removes is its share. What they leave, apart from noise, is
divided by time. At the limit it is saturation; soon after a jump of the command it is overshoot. Elsewhere
its slow part is drift. Its fast part is stick and slip where the command is smooth, and overshoot where it is
not.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gaitopt.diagnose.gap.align import Aligned
from gaitopt.diagnose.gap.components import Pair, fit
from gaitopt.diagnose.gap.leftover import TopSpeeds, at_limit, shares_by_time, top_speeds
from gaitopt.diagnose.gap.settings import DEFAULT, CommandSplitSettings
from gaitopt.diagnose.gap.split import Split

COMMAND_COMPONENTS = ("gain", "bias", "lag", "overshoot", "stick_slip", "saturation", "drift", "noise")

_OF_DEFECTS = {"timing": "lag", "noise": "noise"}
"""Component of a drive without a period, by the component that a defect of the record names."""


def split_commands(
    aligned: Aligned,
    signal: str,
    noise: float,
    extra: Mapping[str, float],
    speeds: TopSpeeds | None = None,
    settings: CommandSplitSettings = DEFAULT.split_commands,
) -> Split:
    """Split the gap of one signal into its components; their squares add up to its mean square.

    Args:
        aligned: the trial aligned with its prediction.
        signal: the signal.
        noise: standard deviation of the signal's noise, m or rad.
        extra: mean square that defects put into the record, by the component they belong to; it is added.
        speeds: how quick the signals are in all trials of the data set; those of this trial if it is None.
        settings: see `CommandSplitSettings`.
    """
    top = (speeds or top_speeds([aligned]))[signal]
    limit = at_limit(aligned, signal, top, settings)
    fitted = fit(Pair.of(aligned, signal, limit, min(top), settings), noise, settings)
    squares = fitted.squares | {"noise": min(noise**2, fitted.pair.square)}
    left = fitted.pair.square - squares["noise"]
    for name, share in shares_by_time(aligned, signal, fitted.pair.residual, limit, settings).items():
        squares[name] = squares.get(name, 0.0) + share * left
    for name, component in _OF_DEFECTS.items():
        squares[component] = squares.get(component, 0.0) + extra.get(name, 0.0)
    ordered = {name: squares.get(name, 0.0) for name in COMMAND_COMPONENTS}
    return Split(signal, ordered, None, fitted.size, fitted.delay_s, np.empty(0))
