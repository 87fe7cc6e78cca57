"""The output formats by name."""

from __future__ import annotations

from collections.abc import Sequence

from gaitopt.core.errors import GaitoptError
from gaitopt.export.board import ANY_ESP32
from gaitopt.export.format import ESP32S, HERE, TEMPLATES, Format
from gaitopt.export.output import DYNAMIXEL, FEETECH_SCS, FEETECH_STS, LEDC, PCA9685, Output

_PLAYER = ("gait_player.h", "gait_player.c")

FORMATS: dict[str, Format] = {}
"""Every output format by name; `register` adds one."""


def register(format: Format) -> Format:
    """Add an output format, which `gaitopt export --format` then offers.

    Raises:
        GaitoptError: there is a format of this name already.
    """
    if format.name in FORMATS:
        raise GaitoptError(f"export format {format.name!r}: there is one of this name already")
    FORMATS[format.name] = format
    return format


def _arduino(name: str, sketch: str, play: str, output: Output = LEDC, more: Sequence[str] = ()) -> Format:
    """Return a format of a sketch, in a folder of the sketch's name as the Arduino IDE wants it.

    Args:
        name: what the command line calls it.
        sketch, play: templates of the sketch and of how to play it.
        output: what the servos are sent.
        more: sources that it needs beside the player's.
    """
    return Format(
        name=name,
        table_file="gait/table.h",
        table=TEMPLATES / "table.h.jinja",
        play=TEMPLATES / play,
        copies={
            **{f"gait/{source}": TEMPLATES / source for source in (*_PLAYER, *more)},
            "gait/gait.ino": TEMPLATES / sketch,
        },
        drives_pins=output is LEDC,
        others=ESP32S,
        output=output,
    )


def _micropython(
    name: str,
    servos: str,
    play: str,
    output: Output = LEDC,
    more: Sequence[str] = (),
    table: str = "gait_table.py.jinja",
) -> Format:
    """Return a format for MicroPython.

    Args:
        name: what the command line calls it.
        servos: source of ``gait_servos.py``, which sends.
        play: template of how to play it.
        output: what the servos are sent.
        more: modules of this package that it needs beside the player.
        table: template of the table.
    """
    return Format(
        name=name,
        table_file="gait_table.py",
        table=TEMPLATES / table,
        play=TEMPLATES / play,
        copies={
            **{module: HERE / module for module in ("gait_player.py", *more)},
            "gait_servos.py": TEMPLATES / servos,
        },
        drives_pins=output is LEDC,
        others=ESP32S,
        output=output,
    )


register(
    Format(
        name="c",
        table_file="table.h",
        table=TEMPLATES / "table.h.jinja",
        play=TEMPLATES / "play_c.md.jinja",
        copies={name: TEMPLATES / name for name in _PLAYER},
        board=ANY_ESP32,
    )
)
register(_arduino("arduino", "gait.ino.jinja", "play_arduino.md.jinja"))
register(
    Format(
        name="esp-idf",
        table_file="table.h",
        table=TEMPLATES / "table.h.jinja",
        play=TEMPLATES / "play_esp_idf.md.jinja",
        copies={
            name: TEMPLATES / name for name in (*_PLAYER, "gait_servos.h", "gait_servos.c", "CMakeLists.txt")
        },
        drives_pins=True,
        most_servos=8,  # channels of the LEDC's low speed mode (ESP-IDF, LEDC_CHANNEL_MAX)
        others=ESP32S,
    )
)
register(_micropython("micropython", "gait_servos.py.txt", "play_micropython.md.jinja"))
register(Format(name="csv", table_file="table.csv", table=TEMPLATES / "table.csv.jinja", board=ANY_ESP32))
register(Format(name="json", table_file="table.json", table=TEMPLATES / "table.json.jinja", board=ANY_ESP32))
register(_arduino("pca9685-arduino", "gait_pca9685.ino.jinja", "play_pca9685_arduino.md.jinja", PCA9685))
register(
    _micropython(
        "pca9685-micropython",
        "gait_pca9685.py.txt",
        "play_pca9685_micropython.md.jinja",
        PCA9685,
        ["pca9685.py"],
    )
)
for _bus in (FEETECH_STS, FEETECH_SCS, DYNAMIXEL):
    register(
        _micropython(
            _bus.protocol,
            "gait_bus.py.txt",
            "play_bus.md.jinja",
            _bus,
            ["bus_packets.py"],
            "bus_table.py.jinja",
        )
    )
    register(
        _arduino(
            f"{_bus.protocol}-arduino",
            "gait_bus.ino.jinja",
            "play_bus_arduino.md.jinja",
            _bus,
            ["bus_packets.h", "bus_packets.c"],
        )
    )
