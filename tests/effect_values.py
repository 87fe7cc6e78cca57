"""Values of effects that the tests share."""

import math

import pytest

from gaitopt.effects import EFFECTS, Effect
from gaitopt.effects.parts import Parts

ELSEWHERE = ("servo_back_emf",)
"""Effects that do not apply to ArcFold, whose joints have damping."""

HERE = [effect for name, effect in EFFECTS.items() if name not in ELSEWHERE]
"""Every effect that applies to ArcFold."""

ALL = [pytest.param(effect, id=effect.name) for effect in HERE]
"""The same, as a parameter of a test."""


def asked(effect: Effect, value: float) -> dict[str, dict[str, float | str]]:
    """What a problem file says to switch an effect on."""
    values: dict[str, float | str] = {effect.parameter: value}
    return {effect.name: values | ({"target": "mid_act"} if effect.target == "one" else {})}


def strong(effect: Effect, nominal: Parts) -> float:
    """A plausible value, well away from the neutral one."""
    low, high = effect.bounds(nominal)
    neutral = effect.neutral_value(nominal)
    if effect.scale == "lin":
        return high if neutral < high else low
    return low if neutral > math.sqrt(low * high) else math.sqrt(high * neutral)
