"""Advice: what to do better in the next film."""

from __future__ import annotations

import math

import numpy as np

from gaitopt.problem.tags import SHEET_TAGS
from gaitopt.robot.signals import TURNS, axis_of, site_of
from gaitopt.track.found import FilmTrack
from gaitopt.track.tracking import Tracker
from gaitopt.track.untagged import PointTrack

_WANTED_PX, _FEW_PX = 50.0, 35.0
"""Edge that a tag should have in a picture, and below which a larger one is advised, pixels."""

_SEEN = 0.9
"""Share of the pictures in which a tag should be seen."""

_ANGLE_RAD = math.radians(1.0)
"""Noise of an angle above which another view is advised."""

_FOCAL = 0.02
"""Relative error of the focal length above which more of the floor should be in view."""

_BLURRED_PX = 0.1
"""Error of a tag's corners above which sharper pictures are advised, pixels."""


def advice(found: FilmTrack, tracker: Tracker) -> list[str]:
    """Return what to do better in the next film, in sentences; empty where the film was good.

    Args:
        found: what was found in a film.
        tracker: what was looked for.
    """
    return [*_small(found, tracker), *_hidden(found), *_flat(found), *_picture(found)]


def point_advice(found: FilmTrack | PointTrack) -> list[str]:
    """Return what to do better in the next film without tags."""
    seen = min(float(np.isfinite(series).mean()) for series in found.signals.values())
    lines = ["Print tags: a film of tags gives height, angles and joints, and its scale is measured."]
    if seen < _SEEN:
        lines.append(f"The point is seen in {seen:.0%} of the frames: a larger dot in a colour of its own.")
    return lines


def _small(found: FilmTrack, tracker: Tracker) -> list[str]:
    lines = []
    for body in tracker.robot.bodies:
        for number, corners in body.tags.items():
            edge = found.edges_px.get(number, _WANTED_PX)
            if edge < _FEW_PX:
                size = 1e3 * float(np.linalg.norm(corners[1] - corners[0]))
                wanted = 5.0 * math.ceil(size * _WANTED_PX / edge / 5.0 - 1e-6)
                lines.append(
                    f"Tag {number} is {edge:.0f} pixels wide: print it with {wanted:.0f} mm instead of "
                    f"{size:.0f} mm, or film from nearer."
                )
    return lines


def _hidden(found: FilmTrack) -> list[str]:
    rare = {n: share for n, share in found.shares.items() if 0.0 < share < _SEEN and n not in SHEET_TAGS}
    return [
        f"Tag {n} is seen in {share:.0%} of the frames: keep it in the picture, unhidden and sharp."
        for n, share in rare.items()
    ]


def _flat(found: FilmTrack) -> list[str]:
    worst: dict[str, float] = {}
    for name, noise in found.noise.items():
        if axis_of(name) in TURNS and noise > _ANGLE_RAD:
            worst[site_of(name)] = max(noise, worst.get(site_of(name), 0.0))
    return [
        f"The angles of {site} are known to {math.degrees(noise):.1f}° only: look at its tag less straight "
        "on, or put a second tag on another side of its body."
        for site, noise in worst.items()
    ]


def _picture(found: FilmTrack) -> list[str]:
    lines = []
    lens = found.room.lens
    if lens.focal_sd > _FOCAL * lens.focal:
        lines.append("The lens is not known well: have all of the floor sheet in the picture, from above.")
    if found.room.camera is None:
        lines.append("The camera moved: on a stand, all is measured better.")
    if max(found.error_px.values(), default=0.0) > _BLURRED_PX:
        lines.append("The tags are blurred: more light, the highest quality, and no stabilisation.")
    return lines
