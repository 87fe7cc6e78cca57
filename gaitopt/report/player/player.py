"""A player on a page: robots and their motions as one text of JSON, with numbers of two bytes in base64."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from gaitopt.core.json import to_json
from gaitopt.report import settings as defaults
from gaitopt.report.film.camera import followed
from gaitopt.report.film.take import Take
from gaitopt.report.player.recording import BYTES_PER_BODY, Recording, record
from gaitopt.report.player.shapes import Shapes, shapes_of
from gaitopt.report.settings import PlayerSettings

Array = NDArray[np.float64]

_STEPS = 65535
"""Steps between the least and the largest coordinate."""

_TURN = 32767
"""Steps between 0 and 1 of a part of a quaternion."""


PANES = ("on the left", "on the right")


@dataclass(frozen=True)
class EmbeddedPlayer:
    """A player of motions in three dimensions, as its template takes it.

    Attributes:
        names: names of the motions.
        json: the motions, for the page's script.
        marked: whether they have a marker.
        measured: whether a measured marker is shown, too.
        beside: whether two motions are shown at once at first.
    """

    names: tuple[str, ...]
    json: Markup
    marked: bool
    measured: bool
    beside: bool

    @property
    def panes(self) -> tuple[str, ...]:
        """Where a motion is shown."""
        return PANES[: len(self.names)]


def embedded_player(
    takes: Sequence[Take], settings: PlayerSettings | None = None, beside: bool = True
) -> EmbeddedPlayer:
    """Return a player for a page.

    Args:
        takes: the motions, on the same clock; the first two are shown first.
        settings: how much of them the page holds.
        beside: whether two motions are shown at once at first.
    """
    settings = settings or defaults.DEFAULT.player
    takes = takes[: settings.most_shown]
    robots = [shapes_of(shown.model, shown.poses[0], settings) for shown in takes]
    rate, seconds = _rate(takes, robots, settings)
    recordings = [record(*pair, rate, seconds) for pair in zip(takes, robots, strict=True)]
    drawn = [_robot(shapes) for shapes in robots]
    different = [robot for index, robot in enumerate(drawn) if drawn.index(robot) == index]
    beside = beside and len(takes) > 1
    content = {
        "axes": takes[0].axes.tolist(),
        "beside": beside,
        "robots": different,
        "takes": [
            {"robot": different.index(robot), **_take(shown, recording)}
            for shown, robot, recording in zip(takes, drawn, recordings, strict=True)
        ],
    }
    return EmbeddedPlayer(
        names=tuple(shown.name for shown in takes),
        json=Markup(to_json(content, indent=None).strip().replace("<", "\\u003c")),
        marked=any(recording.marker is not None for recording in recordings),
        measured=any(shown.ghost is not None for shown in takes),
        beside=beside,
    )


def _rate(takes: Sequence[Take], robots: Sequence[Shapes], settings: PlayerSettings) -> tuple[float, float]:
    """Return the poses per second and the longest time, s, that the bytes allow."""
    each = [BYTES_PER_BODY * max(1, len(shapes.bodies)) for shapes in robots]
    lengths = [float(shown.trajectory.time[-1]) for shown in takes]
    needed = sum(length * size for length, size in zip(lengths, each, strict=True))
    rate = settings.pose_bytes / max(needed, 1e-9)
    if rate >= settings.least_rate_hz:
        return min(settings.rate_hz, rate), math.inf
    return settings.least_rate_hz, settings.pose_bytes / (settings.least_rate_hz * sum(each))


def _robot(shapes: Shapes) -> dict[str, object]:
    """Return a robot's shapes as JSON takes them."""
    return {
        "bodies": len(shapes.bodies),
        "shapes": [asdict(shape) for shape in shapes.shapes],
        "meshes": [
            {"corners": _packed(mesh.corners), "faces": _text(mesh.faces.astype("<u2"))}
            for mesh in shapes.meshes
        ],
    }


def _take(shown: Take, recording: Recording) -> dict[str, object]:
    """Return a motion as JSON takes it; lengths in m, times in s."""
    time, ghost = recording.time, shown.ghost
    path = followed(shown)
    rows = np.clip(np.searchsorted(shown.trajectory.time, time), 0, len(path) - 1)
    measured = None
    if ghost is not None:
        measured = {"time": _packed(ghost.time[:, None]), "positions": _packed(ghost.positions)}
    return {
        "name": shown.name,
        "period_s": shown.period_s,
        "begin_s": float(time[0]),
        "step_s": float(time[-1] - time[0]) / max(1, len(time) - 1),
        "moments": len(time),
        "positions": _packed(recording.positions),
        "turns": _text(np.round(_TURN * recording.turns).astype("<i2")),
        "touching": _text(np.packbits(recording.touching, axis=1, bitorder="little")),
        "path": _packed(path[rows]),
        "marker": None if recording.marker is None else _packed(recording.marker),
        "trial": None if ghost is None else ghost.trial,
        "measured": measured,
    }


def _packed(values: Array) -> dict[str, object]:
    """Return numbers as steps from the least of each column, in two bytes each, shape (..., columns)."""
    flat = values.reshape(-1, values.shape[-1])
    low = flat.min(axis=0) if len(flat) else np.zeros(values.shape[-1])
    high = flat.max(axis=0) if len(flat) else low
    step = (high - low) / _STEPS
    steps = np.round((flat - low) / np.where(step > 0.0, step, 1.0)).astype("<u2")
    return {"low": low.tolist(), "step": step.tolist(), "data": _text(steps)}


def _text(numbers: NDArray[np.uint16] | NDArray[np.int16] | NDArray[np.uint8]) -> str:
    return base64.b64encode(np.ascontiguousarray(numbers).tobytes()).decode("ascii")
