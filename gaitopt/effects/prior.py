"""How plausible a value of an effect's parameter is before anything is measured."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Prior:
    """How plausible a value is before anything is measured.

    Attributes:
        kind: ``normal``; ``half-normal``, from 0 up; ``log-normal``, whose logarithm is normal.
        centre: mean, or median of a log-normal, in multiples of the effect's `reference`.
        spread: standard deviation in multiples of the reference; of the logarithm for a log-normal.
        source: where that comes from.
    """

    kind: Literal["normal", "half-normal", "log-normal"]
    centre: float
    spread: float
    source: str

    def log_density(self, value: float, reference: float = 1.0) -> float:
        """Return the logarithm of the density at `value`, up to a constant; -inf outside."""
        if self.kind == "log-normal":
            if not 0.0 < value < math.inf:
                return -math.inf
            distance = math.log(value / (self.centre * reference)) / self.spread
        else:
            if self.kind == "half-normal" and value < 0.0:
                return -math.inf
            distance = (value / reference - self.centre) / self.spread
        return -0.5 * distance**2

    def __str__(self) -> str:
        return f"{self.kind}, {self.centre:g}, {self.spread:g}"
