"""What was found in a film of a tagged robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.quantities import figure, unit_of
from gaitopt.diagnose.record.defect import Defect
from gaitopt.robot.signals import is_position
from gaitopt.track.room import Room, Seen
from gaitopt.track.sync import UNKNOWN, Sync

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FilmTrack:
    """What was found in a film.

    Attributes:
        film: the film.
        time: time stamp of each picture from the first one, s, shape (n,).
        signals: series by signal, m or rad, each of shape (n,), NaN in gaps.
        noise: standard deviation of each signal's noise, m or rad.
        shares: share of the pictures in which each tag of the robot, and of those of the floor that are seen
            at all, is seen.
        room: lens, floor and camera.
        error_px: standard deviation of the corners of the tags on each body, by its site, pixels.
        defects: what is wrong with the film, and what was left out.
        frames: corners of the tags in each picture.
        edges_px: median edge of each tag in the pictures, pixels.
        readout_s: how much later the last row of a picture is seen than the first, s, as a moving camera
            or robot shows or was said; 0 where that is not known.
        sync: when the gait began.
    """

    film: Path
    time: Array
    signals: Mapping[str, Array]
    noise: Mapping[str, float]
    shares: Mapping[int, float]
    room: Room
    error_px: Mapping[str, float]
    defects: tuple[Defect, ...] = ()
    frames: Sequence[Seen] = field(default=(), repr=False)
    edges_px: Mapping[int, float] = field(default_factory=dict)
    readout_s: float = 0.0
    sync: Sync = UNKNOWN

    @property
    def fps(self) -> float:
        """Frame rate, the median, frames a second."""
        return float(1.0 / np.median(np.diff(self.time)))

    def sentence(self) -> str:
        """Return what was found, in a line."""
        camera = "hand-held or moved" if self.room.camera is None else "on a stand"
        return (
            f"{self.film}: {len(self.time)} frames in {self.time[-1]:.2f} s, camera {camera}, focal length "
            f"{self.room.lens.focal:.0f} px (± {self.room.lens.focal_sd:.0f})"
        )

    def lines(self) -> list[str]:
        """Return what was found of each tag, and the noise of each signal, in lines."""
        tags = [
            f"tag {n}: seen in {share:.0%} of the frames"
            + (f", {self.edges_px[n]:.0f} px wide" if n in self.edges_px else "")
            for n, share in self.shares.items()
        ]
        signals = [
            f"{name}: noise {_shown(name, self.noise[name])}, in {np.isfinite(series).mean():.0%} of frames"
            for name, series in self.signals.items()
        ]
        return [*tags, *signals, self.sync.sentence()]

    def to_dict(self) -> dict[str, object]:
        """Return what `gaitopt track --json` prints of a film."""
        lens = self.room.lens
        return {
            "film": str(self.film),
            "frames": len(self.time),
            "seconds": float(self.time[-1]),
            "fps": self.fps,
            "camera": "moving" if self.room.camera is None else "still",
            "lens": {"focal_px": lens.focal, "focal_sd_px": lens.focal_sd, "k1": lens.k1, "k2": lens.k2},
            "readout_s": self.readout_s,
            "sync": self.sync.to_dict(),
            "floor_error_px": self.room.error_px,
            "tags": [
                {"tag": n, "seen": share, "edge_px": self.edges_px.get(n)} for n, share in self.shares.items()
            ],
            "bodies": [{"site": site, "error_px": error} for site, error in self.error_px.items()],
            "signals": [
                {
                    "signal": name,
                    "seen": float(np.isfinite(series).mean()),
                    ("noise_m" if is_position(name) else "noise_rad"): self.noise[name],
                }
                for name, series in self.signals.items()
            ],
        }


def _shown(signal: str, value: float) -> str:
    unit, factor = unit_of("_m" if is_position(signal) else "_rad")
    return f"{figure(factor * value)} {unit}"
