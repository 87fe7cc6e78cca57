"""Settings of tracking that no option of the command line sets."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TrackSettings:
    """How tags are found and judged. The figures are those of synthetic films at 0.5 to 1.5 m.

    Attributes:
        alike: least correlation of a picture with a tag's pattern; other tags of the family reach 0.7.
        blur_px: blur of a pattern before it is laid on a picture, pixels; of a film it is measured.
        smallest_px: shortest edge of a tag that is located, pixels.
        search_every: frames between searches of the whole picture while a tag is missing.
        rest_px: how far the corners of a tag that rests move from one picture to the next, pixels.
        still_px: how far the tags of the floor move in the pictures of a camera on a stand, pixels.
        sampled: pictures from which the lens and the floor are solved.
        focal: expected focal length over the longer side of the picture: phones film at 60 to 75 degrees.
        focal_spread: how far it may be off, relative, as a standard deviation.
        distortion: expected size of the radial distortion: phones correct most of theirs.
        outlier: a tag's error over the usual one, beyond which it is left out.
        joint_rad: an angle of a joint is given only if it is known better than this, rad.
        readout_s: how long phones take to read a picture, s, where nothing shows it: most 5 to 30 ms.
        least_px: error of a corner that is never undercut, pixels.
    """

    alike: float = 0.85
    blur_px: float = 1.0
    smallest_px: float = 10.0
    search_every: int = 5
    rest_px: float = 0.25
    still_px: float = 0.4
    sampled: int = 24
    focal: float = 0.8
    focal_spread: float = 0.2
    distortion: float = 0.1
    outlier: float = 6.0
    joint_rad: float = 0.06
    readout_s: float = 0.015
    least_px: float = 0.02


DEFAULT = TrackSettings()
"""The settings in use."""
