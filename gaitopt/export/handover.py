"""The export of a gait: checked against the servos, replayed in simulation, then written whole."""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Iterable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.export.formats import FORMATS, export_files
from gaitopt.export.limits import Lag, check_wiring, clipped, lags, refuse_outside
from gaitopt.export.replay import Replay, replay
from gaitopt.gait.gait import Gait
from gaitopt.gait.table import SAMPLES, GaitTable
from gaitopt.problem.model import start_targets
from gaitopt.problem.problem import Problem

_MAX_SERVOS = 16
_MAX_PERIOD_S = 4294.0
_FLASH_PINS = range(6, 12)
_INPUT_PINS = range(34, 40)


@dataclass(frozen=True)
class Choices:
    """What a user chooses about an export.

    Attributes:
        format: a key of `FORMATS`.
        clip: whether a gait outside the servos' range becomes the nearest one inside it.
        slew: ``off``, ``servo`` (each at its own speed limit) or a speed, degrees/s.
        led_pin: GPIO of the sync LED, if any.
        samples: phase samples of the table.
    """

    format: str
    clip: bool = False
    slew: str = "off"
    led_pin: int | None = None
    samples: int = SAMPLES


@dataclass(frozen=True)
class Handover:
    """An export, checked and ready to be written."""

    table: GaitTable
    format: str
    replay: Replay
    lags: list[Lag]
    warnings: list[str]
    from_datasheet: dict[str, list[str]]

    @property
    def files(self) -> dict[str, str]:
        """The text of every file by its path."""
        return export_files(self.format, self.table, self.replay, self.warnings, self.from_datasheet)

    def to_dict(self, files: Iterable[Path]) -> dict[str, Any]:
        """Return the answer of `gaitopt export`."""
        return {
            "format": self.format,
            "hash": self.table.hash,
            "ideal_speed_m_s": self.replay.ideal_m_s,
            "replayed_speed_m_s": self.replay.replayed_m_s,
            "loss": self.replay.loss,
            "loss_ci90": self.replay.loss_ci90,
            "loss_by_cause": self.replay.causes,
            "lags": {lag.channel: {"angle_deg": lag.angle_deg, "time_s": lag.time_s} for lag in self.lags},
            "warnings": self.warnings,
            "from_datasheet": self.from_datasheet,
            "files": [str(file) for file in files],
        }


def prepare(problem: Problem, gait: Gait, choices: Choices, executor: Executor) -> Handover:
    """Return the export of a gait, played in simulation as the servos will get it.

    Raises:
        GaitoptError: the gait leaves a servo's range, a pin is missing or used twice, or the model does
            not fit the problem.
    """
    if not 4 <= choices.samples <= 1024:
        raise GaitoptError(f"--samples: found {choices.samples}; allowed: 4 to 1024")
    if len(gait.channels) > _MAX_SERVOS or gait.period_s > _MAX_PERIOD_S:
        raise GaitoptError(
            f"found {len(gait.channels)} servos and a period of {gait.period_s:g} s; "
            f"allowed: at most {_MAX_SERVOS} and {_MAX_PERIOD_S:g} s"
        )
    check_wiring(problem, FORMATS[choices.format].drives_pins, choices.led_pin)
    warnings = _pin_warnings(problem, choices.led_pin)
    if choices.clip:
        gait, changes = clipped(problem, gait)
        warnings += changes
    refuse_outside(problem, gait)
    table = _table(problem, gait, choices)
    played = replay(problem, table, executor)
    if played.warning:
        warnings.append(played.warning)
    calibrations = {name: channel.servo for name, channel in problem.file.channels.items()}
    unset = {name: servo.from_datasheet for name, servo in calibrations.items()}
    return Handover(table, choices.format, played, lags(problem, gait), warnings, unset)


def _table(problem: Problem, gait: Gait, choices: Choices) -> GaitTable:
    frame_s = problem.file.servo.frame_s
    servos = {name: problem.file.channels[name].servo for name in gait.channels}
    limit = _slew_deg_s(choices.slew)
    slew = [
        0 if limit == 0.0 else servo.pulse_per_frame_us(limit or servo.speed_limit_deg_s, frame_s)
        for servo in servos.values()
    ]
    start = np.rad2deg(start_targets(problem)).tolist()
    return GaitTable.sample(gait, servos, start, frame_s, slew, choices.led_pin, choices.samples)


def _slew_deg_s(text: str) -> float | None:
    """Return the slew clamp, degrees/s: 0 for none, None for each servo's own limit."""
    if text in ("off", "servo"):
        return 0.0 if text == "off" else None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise bad_value("--slew", "speed", text, "off, servo, or degrees per second", ("off", "servo"))
    return value


def _pin_warnings(problem: Problem, led_pin: int | None) -> list[str]:
    pins = {name: channel.servo.pin for name, channel in problem.file.channels.items()} | {"LED": led_pin}
    warnings = []
    for name, pin in pins.items():
        if pin in _FLASH_PINS:
            warnings.append(f"{name}: GPIO{pin} belongs to the flash of a classic ESP32")
        elif pin in _INPUT_PINS:
            warnings.append(f"{name}: GPIO{pin} of a classic ESP32 is an input only")
    return warnings


def check_folder(path: Path) -> None:
    """Check that an export may be written to `path`.

    Raises:
        GaitoptError: something is there already.
    """
    if path.is_dir() and any(path.iterdir()):
        raise GaitoptError(f"--out: {path} is not empty; allowed: a new or an empty folder")
    if path.exists() and not path.is_dir():
        raise GaitoptError(f"--out: {path} is a file; allowed: a new or an empty folder")


def write_folder(path: Path, texts: dict[str, str]) -> list[Path]:
    """Write files into a new or empty folder, all of them or none, and return their paths.

    Raises:
        GaitoptError: the folder holds something already, or cannot be written.
    """
    check_folder(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name}."))
        try:
            for name, text in texts.items():
                file = temporary / name
                file.parent.mkdir(exist_ok=True)
                file.write_text(text, encoding="utf-8", newline="\n")
            path.mkdir(exist_ok=True)
            for item in sorted(temporary.iterdir()):
                item.rename(path / item.name)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
    except OSError as error:
        raise GaitoptError(f"--out: {path}: cannot be written: {error.strerror or error}") from None
    return [path / name for name in texts]
