"""How tags move through the pictures of a film."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.track.room import Seen

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TagMotion:
    """How a tag moves through a picture.

    Attributes:
        speed: of its corners, pixels/s, shape (4, 2).
        sd: standard deviation of the speed of all of them, pixels/s, shape (2,).
    """

    speed: Array
    sd: Array

    @property
    def fastest(self) -> float:
        """Speed of its fastest corner, pixels/s."""
        return float(np.linalg.norm(self.speed, axis=1).max())


Sweep = Mapping[int, TagMotion]
"""How the tags in a picture move, by number."""


def sweeps_of(times: Array, frames: Sequence[Seen]) -> list[dict[int, TagMotion]]:
    """Return how the tags in each picture move, from the pictures beside it.

    An impact changes a speed at once: in a picture it may be that before or that after it. Where a tag is in
    neither picture beside, it is any that the tag has in the film, or else its own edge a picture.

    Args:
        times: time stamps of the pictures, s, shape (n,).
        frames: the corners in them.
    """
    found: list[dict[int, TagMotion]] = [{} for _ in frames]
    lonely: list[tuple[int, int]] = []
    for index, seen in enumerate(frames):
        for number, here in seen.items():
            beside = [i for i in (index - 1, index + 1) if 0 <= i < len(frames) and number in frames[i]]
            rates = [(frames[i][number] - here) / (times[i] - times[index]) for i in beside]
            if len(rates) == 2:
                before, after = times[index] - times[index - 1], times[index + 1] - times[index]
                speed = (after * rates[0] + before * rates[1]) / (before + after)
                sd = 0.5 * np.abs((rates[1] - rates[0]).mean(axis=0))
                found[index][number] = TagMotion(speed, sd)
            elif rates:
                found[index][number] = TagMotion(rates[0], 0.5 * np.abs(rates[0].mean(axis=0)))
            else:
                lonely.append((index, number))
    for index, number in lonely:
        speeds = [sweep[number].speed.mean(axis=0) for sweep in found if number in sweep]
        own = np.ptp(frames[index][number], axis=0) / np.median(np.diff(times))
        sd = np.sqrt(np.mean(np.square(speeds), axis=0)) if speeds else own
        found[index][number] = TagMotion(np.zeros((4, 2)), sd)
    return found


def rows_of(pixels: Array, size: tuple[int, int]) -> Array:
    """Return where corners lie in a picture: of its width and height, from its middle, shape (n, 2)."""
    return np.asarray(pixels / np.array(size) - 0.5)
