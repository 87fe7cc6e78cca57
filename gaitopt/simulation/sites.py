"""Signals of sites: position and angles in the problem's axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gaitopt.problem.instruments import SITE_POSITION, SITE_TURN
from gaitopt.robot.rotation import roll_pitch_yaw, rotation_matrices
from gaitopt.robot.signals import AXES, kind_of, site_signals

Array = NDArray[np.float64]


def with_sites(signals: Mapping[str, Array], sites: Sequence[str], axes: Array) -> dict[str, Array]:
    """Return signals in which those of some sites are given in the problem's axes.

    ``site.NAME.x|y|z`` is the position along forward, left and up, m. ``site.NAME.roll|pitch|yaw`` are the
    angles by which the site is turned against these axes, rad, without jumps: first by roll about forward,
    then by pitch about left, then by yaw about up. Where pitch passes a right angle, the other two jump.

    Args:
        signals: signals, with the raw ones of the sites.
        sites: the sites.
        axes: forward, left and up as the rows of a rotation, shape (3, 3).
    """
    found = {n: s for n, s in signals.items() if kind_of(n) not in (SITE_POSITION, SITE_TURN)}
    for site in sites:
        position = axes @ np.stack([signals[f"{SITE_POSITION}.{site}.{axis}"] for axis in AXES])
        turns = axes @ rotation_matrices(*(signals[f"{SITE_TURN}.{site}.{part}"] for part in "wxyz"))
        angles = np.unwrap(roll_pitch_yaw(turns))
        found |= dict(zip(site_signals(site), [*position, *angles], strict=True))
    return found
