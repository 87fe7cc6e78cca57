"""Synthetic films for tests: a phone whose films are quickly made, and what a film shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitopt.report.film.phone import Phone
from gaitopt.report.film.stage import Stand

Array = NDArray[np.float64]

SMALL = Phone(
    size=(960, 540), focal=760.0, fps=24.0, jitter_s=0.003, exposures=1, exposure_s=0.004, readout_s=0.0
)
"""A phone whose films are quickly made."""

CLOSE = Stand((0.12, -0.4, 0.24), (0.12, -0.06, 0.02))
"""Where it sees ArcFold's tags well."""


@dataclass(frozen=True)
class Walk:
    """A film, and what it shows.

    Attributes:
        path: the film.
        times: time stamps from the first picture, s.
        truth: the signals, m or rad.
    """

    path: Path
    times: Array
    truth: Mapping[str, Array]
