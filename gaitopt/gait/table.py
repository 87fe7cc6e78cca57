"""A gait as a microcontroller plays it: pulse widths at uniform phases, with the limits of each servo.

A table file of any format has one line ``gaitopt-table: {…}`` with everything but the pulses, the gait's
own parameters included. The pulses follow as rows of numbers. So every exported file can be read back, and
a file whose numbers were changed later does not match its hash.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.files import LARGEST_TEXT, read_text
from gaitopt.core.validation import PLAIN_NUMBER, validated
from gaitopt.gait.calibration import Calibration
from gaitopt.gait.gait import Gait, read_gait

FORMAT = 1
"""Version of the file format."""

SAMPLES = 64
"""Default number of phase samples of a table: 384 bytes for three servos."""

MARK = "gaitopt-table"

_LINE = re.compile(rf"^[ \t]*[^\w\s\"']{{0,3}} ?{MARK}: (\{{.*)$", re.MULTILINE)
"""A line that begins with the mark, as a comment. Names may hold the mark too, but none begins a line."""

_JSON = re.compile(rf'^[\s\[{{]*"{MARK}"')
"""The beginning of a JSON file whose first key is the mark."""

_ROW = re.compile(r"^[ \t]*(\d[\d., ]*)$", re.MULTILINE | re.ASCII)

Unit = Literal["us", "steps"]

_Word = Annotated[int, Field(ge=0, le=65535), PLAIN_NUMBER]
_Microseconds = Annotated[int, Field(ge=1, le=2**32 - 1), PLAIN_NUMBER]


class _Header(BaseModel):
    model_config = ConfigDict(extra="forbid")

    format: int
    hash: str
    name: str = ""
    period_us: _Microseconds
    frame_us: _Microseconds
    led_pin: int | None
    gait: dict[str, object]
    servos: dict[str, Calibration]
    start_us: tuple[_Word, ...]
    slew_us: tuple[_Word, ...]
    unit: Unit = "us"


@dataclass(frozen=True)
class GaitTable:
    """A gait and the servos that play it.

    Attributes:
        gait: the gait that was sampled.
        servos: calibration of each channel, complete, in the order of the gait's channels.
        start_us: pulses held before and after the gait, µs.
        slew_us: largest change of each pulse per frame, µs; 0 where it is not limited.
        frame_us: period of the servo signal, µs.
        period_us: period of the gait, µs.
        led_pin: GPIO that goes high at gait time 0, if any.
        pulses: rows of pulses, µs. Row k is the mean of the wave over the interval centred on phase
            k / len(pulses), so an edge between two samples keeps its time.
        unit: of what is called pulses here, µs or, for the positions of servos on a bus, steps.
    """

    gait: Gait
    servos: Mapping[str, Calibration]
    start_us: tuple[int, ...]
    slew_us: tuple[int, ...]
    frame_us: int
    period_us: int
    led_pin: int | None
    pulses: tuple[tuple[int, ...], ...]
    unit: Unit = "us"

    @staticmethod
    def sample(
        gait: Gait,
        servos: Mapping[str, Calibration],
        start_deg: Sequence[float],
        frame_s: float,
        slew_us: Sequence[int],
        led_pin: int | None = None,
        samples: int = SAMPLES,
        unit: Unit = "us",
    ) -> GaitTable:
        """Return the table of a gait.

        Args:
            gait: the gait; its targets lie within the servos' range.
            servos: calibration of each channel.
            start_deg: targets before and after the gait, degrees.
            frame_s: period of the servo signal, s.
            slew_us: largest change of each pulse per frame, µs; 0 where it is not limited.
            led_pin: GPIO that goes high at gait time 0.
            samples: number of phase samples.
            unit: of the pulses.
        """
        complete = {name: Calibration(**servos[name].complete) for name in gait.channels}
        start = tuple(
            _rounded(servo, servo.pulse_us(angle))
            for servo, angle in zip(complete.values(), start_deg, strict=True)
        )
        angles = sampled_deg(gait, samples)
        pulses = tuple(
            tuple(
                _rounded(servo, servo.pulse_us(angle))
                for servo, angle in zip(complete.values(), row, strict=True)
            )
            for row in angles.tolist()
        )
        frame_us, period_us = round(1e6 * frame_s), round(1e6 * gait.period_s)
        return GaitTable(gait, complete, start, tuple(slew_us), frame_us, period_us, led_pin, pulses, unit)

    @property
    def header(self) -> dict[str, Any]:
        """Everything but the pulses, as in a table file."""
        content = self._content
        return {"format": FORMAT, "hash": self.hash, "name": self.gait.name} | content

    @property
    def hash(self) -> str:
        """The first 16 hexadecimal digits of the SHA-256 of everything that moves a servo."""
        content = {"format": FORMAT, **self._content, "pulses_us": self.pulses}
        text = json.dumps(content, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def _content(self) -> dict[str, Any]:
        return {
            "period_us": self.period_us,
            "frame_us": self.frame_us,
            "led_pin": self.led_pin,
            "gait": self.gait.to_dict(),
            "servos": {name: servo.complete for name, servo in self.servos.items()},
            "start_us": self.start_us,
            "slew_us": self.slew_us,
        } | ({} if self.unit == "us" else {"unit": self.unit})


def sampled_deg(gait: Gait, samples: int) -> NDArray[np.float64]:
    """Return the mean targets over `samples` equal intervals centred on uniform phases.

    Linear interpolation between such means has the mean of the wave, and every edge keeps its time.

    Returns:
        Degrees, shape (samples, nu).
    """
    begin = (np.arange(samples) - 0.5) / samples
    columns = [
        c.offset_deg + c.amplitude_deg * c.mean_wave(begin, 1.0 / samples) for c in gait.channels.values()
    ]
    return np.stack(columns, axis=-1)


def _rounded(servo: Calibration, pulse_us: float) -> int:
    return min(max(round(pulse_us), servo.min_us), servo.max_us)


def is_table(path: Path) -> bool:
    """Return whether a file has the mark of a gait table."""
    text = read_text(path, LARGEST_TEXT)
    if text.lstrip().startswith("{"):
        return f'"{MARK}"' in text
    return (_JSON.match(text) or _LINE.search(text)) is not None


def read_table(path: Path) -> GaitTable:
    """Return the table in an exported file of any format.

    Raises:
        GaitoptError: the file has no table, is of another version, or was changed after its export.
    """
    header, pulses = _parts(read_text(path, LARGEST_TEXT), path)
    version = header.get("format") if isinstance(header, dict) else None
    if version != FORMAT:
        raise bad_value(path, "format", version, f"{FORMAT}: export it again")
    checked = validated(_Header, header, path)
    gait = Gait.from_dict(checked.gait, path, checked.name)
    table = GaitTable(
        gait,
        checked.servos,
        checked.start_us,
        checked.slew_us,
        checked.frame_us,
        checked.period_us,
        checked.led_pin,
        tuple(tuple(row) for row in pulses),
        checked.unit,
    )
    if table.hash != checked.hash:
        raise GaitoptError(
            f"{path}: found content with hash {table.hash}; allowed: {checked.hash}, as exported: "
            "it was changed since, export the gait again"
        )
    return table


def read_gait_file(path: Path) -> Gait:
    """Return the gait in a gait file or an exported table.

    Raises:
        GaitoptError: the file cannot be read or its content is wrong.
    """
    return read_table(path).gait if is_table(path) else read_gait(path)


def _parts(text: str, path: Path) -> tuple[Any, list[list[int]]]:
    """Return the header and the rows of pulses of a table file."""
    try:
        if text.lstrip().startswith("{"):
            values = json.loads(text)
            return values[MARK], [[_whole(pulse) for pulse in row] for row in values["pulses_us"]]
        found = _LINE.search(text)
        header = json.loads(found.group(1)) if found else None
        channels = len(header["gait"]["channels"]) if isinstance(header, dict) else 0
        rows = [row.rstrip(", ").split(",") for row in _ROW.findall(text, found.end() if found else 0)]
        return header, [[int(pulse) for pulse in row[-channels:]] for row in rows]
    except (ValueError, KeyError, TypeError, RecursionError):
        raise GaitoptError(f"{path}: a gait table that cannot be read: changed since its export?") from None


def _whole(pulse: object) -> int:
    """Return a pulse of a JSON file.

    Raises:
        ValueError: it is no whole number.
    """
    if type(pulse) is not int:
        raise ValueError(f"not a whole number: {pulse!r}")
    return pulse
