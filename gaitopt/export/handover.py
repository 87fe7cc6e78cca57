"""The export of a gait: checked against the servos, replayed in simulation, then written completely."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gaitopt.core.errors import GaitoptError, bad_value, unknown_name
from gaitopt.core.folders import check_new_or_empty, filled
from gaitopt.core.numbers import number
from gaitopt.export.files import export_files
from gaitopt.export.format import Format
from gaitopt.export.formats import FORMATS
from gaitopt.export.gait_player import MAX_SERVOS
from gaitopt.export.lag import Lag, lags
from gaitopt.export.limits import clipped, refuse_outside
from gaitopt.export.numbering import unset, wired
from gaitopt.export.replay import Replay, replay
from gaitopt.export.servos import check_servos
from gaitopt.export.wiring import check_wiring, pin_warnings
from gaitopt.gait.gait import Gait
from gaitopt.gait.table import SAMPLES, GaitTable
from gaitopt.problem.problem import Problem
from gaitopt.problem.start import start_targets

_MAX_PERIOD_S = 4294.0
"""Longest period that a clock of 32 bits counts in microseconds."""


@dataclass(frozen=True)
class Choices:
    """The choices of a user for an export.

    Attributes:
        format: a key of `FORMATS`.
        clip: whether a gait outside the servos' range becomes the nearest one inside it.
        slew: ``off``, ``servo`` (each at its own speed limit) or a speed, degrees/s.
        led_pin: GPIO of the sync LED, if any.
        samples: phase samples of the table.
        board: the board, one of `Format.boards`; the first of them by default.
    """

    format: str
    clip: bool = False
    slew: str = "off"
    led_pin: int | None = None
    samples: int = SAMPLES
    board: str | None = None


@dataclass(frozen=True)
class Exported:
    """The answer of `gaitopt export`.

    Attributes:
        format: name of the format.
        hash: of everything that moves a servo.
        replay: how the table did in simulation.
        lags: servos that fall behind their commands.
        warnings: what the user should know.
        from_datasheet: per channel, the values of its calibration that are not set.
        files: the files written.
    """

    format: str
    hash: str
    replay: Replay
    lags: tuple[Lag, ...]
    warnings: tuple[str, ...]
    from_datasheet: Mapping[str, Sequence[str]]
    files: tuple[Path, ...]

    def to_dict(self) -> dict[str, object]:
        """Return the answer as it is printed with ``--json``."""
        return {
            "format": self.format,
            "hash": self.hash,
            "ideal_speed_m_s": self.replay.ideal_m_s,
            "replayed_speed_m_s": self.replay.replayed_m_s,
            "loss": self.replay.loss,
            "loss_ci90": self.replay.loss_ci90,
            "loss_by_cause": dict(self.replay.causes),
            "lags": {lag.channel: {"angle_deg": lag.angle_deg, "time_s": lag.time_s} for lag in self.lags},
            "warnings": list(self.warnings),
            "from_datasheet": {name: list(keys) for name, keys in self.from_datasheet.items()},
            "files": [str(file) for file in self.files],
        }


@dataclass(frozen=True)
class Handover:
    """An export, checked and ready to be written.

    Attributes:
        format: the output format.
        table: the gait as pulses.
        replay: how the table did in simulation.
        lags: servos that fall behind their commands.
        warnings: what the user should know.
        from_datasheet: per channel, the values of its calibration that are not set.
    """

    format: Format
    table: GaitTable
    replay: Replay
    lags: tuple[Lag, ...]
    warnings: tuple[str, ...]
    from_datasheet: Mapping[str, Sequence[str]]

    @property
    def files(self) -> dict[str, str]:
        """The text of every file by its path."""
        return export_files(self.format, self.table, self.replay, self.warnings, self.from_datasheet)

    def write(self, folder: Path) -> Exported:
        """Write the files into a new or empty folder, all of them or none.

        Raises:
            GaitoptError: the folder holds something already, or cannot be written.
        """
        written = tuple(write_folder(folder, self.files))
        return Exported(
            self.format.name,
            self.table.hash,
            self.replay,
            self.lags,
            self.warnings,
            self.from_datasheet,
            written,
        )


def prepare(problem: Problem, gait: Gait, choices: Choices, executor: Executor) -> Handover:
    """Return the export of a gait, played in simulation as the servos will get it.

    Raises:
        GaitoptError: there is no such format or board, an actuator is no servo, the gait leaves a servo's
            range, a pin is missing or used twice, or the model does not fit the problem.
    """
    if choices.format not in FORMATS:
        raise unknown_name("export", "format", choices.format, FORMATS)
    format = FORMATS[choices.format]
    if choices.board is not None:
        format = format.on(choices.board)
    if not 4 <= choices.samples <= 1024:
        raise GaitoptError(f"--samples: found {choices.samples}; allowed: 4 to 1024")
    if len(gait.channels) > MAX_SERVOS or gait.period_s > _MAX_PERIOD_S:
        raise GaitoptError(
            f"found {len(gait.channels)} servos and a period of {gait.period_s:g} s; "
            f"allowed: at most {MAX_SERVOS} and {_MAX_PERIOD_S:g} s"
        )
    check_servos(problem)
    not_set = {name: unset(one.servo, format.output) for name, one in problem.file.channels.items()}
    problem = wired(problem, format.output)
    check_wiring(problem, format, choices.led_pin)
    warnings = pin_warnings(problem, format, choices.led_pin)
    if choices.clip:
        gait, changes = clipped(problem, gait)
        warnings += changes
    refuse_outside(problem, gait)
    table = _table(problem, gait, choices, format)
    played = replay(problem, table, executor, output=format.output)
    if played.warning:
        warnings.append(played.warning)
    return Handover(format, table, played, tuple(lags(problem, gait)), tuple(warnings), not_set)


def _table(problem: Problem, gait: Gait, choices: Choices, format: Format) -> GaitTable:
    frame_s = problem.file.servo.frame_s
    servos = {name: problem.file.channels[name].servo for name in gait.channels}
    limit = _slew_deg_s(choices.slew)
    slew = [
        0 if limit == 0.0 else servo.pulse_per_frame_us(limit or servo.speed_limit_deg_s, frame_s)
        for servo in servos.values()
    ]
    start = np.rad2deg(start_targets(problem)).tolist()
    unit = format.output.unit
    return GaitTable.sample(gait, servos, start, frame_s, slew, choices.led_pin, choices.samples, unit)


def _slew_deg_s(text: str) -> float | None:
    """Return the slew clamp, degrees/s: 0 for none, None for each servo's own limit."""
    if text in ("off", "servo"):
        return 0.0 if text == "off" else None
    try:
        value = number(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise bad_value("--slew", "speed", text, "off, servo, or degrees per second", ("off", "servo"))
    return value


def write_folder(path: Path, texts: dict[str, str]) -> list[Path]:
    """Write files into a new or empty folder, all of them or none, and return their paths.

    Raises:
        GaitoptError: the folder holds something already, or cannot be written.
    """
    check_new_or_empty(path)
    with filled(path) as place:
        for name, text in texts.items():
            file = place / name
            file.parent.mkdir(exist_ok=True)
            file.write_text(text, encoding="utf-8", newline="\n")
    return [path / name for name in texts]
