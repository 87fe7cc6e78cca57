"""The output formats by name."""

from __future__ import annotations

from gaitopt.core.errors import GaitoptError
from gaitopt.export.board import ANY_ESP32
from gaitopt.export.format import ESP32S, HERE, TEMPLATES, Format
from gaitopt.export.output import DYNAMIXEL, FEETECH_SCS, FEETECH_STS, PCA9685

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
register(
    Format(
        name="arduino",
        table_file="gait/table.h",
        table=TEMPLATES / "table.h.jinja",
        play=TEMPLATES / "play_arduino.md.jinja",
        copies={
            **{f"gait/{name}": TEMPLATES / name for name in _PLAYER},
            "gait/gait.ino": TEMPLATES / "gait.ino.jinja",
        },
        drives_pins=True,
        others=ESP32S,
    )
)
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
register(
    Format(
        name="micropython",
        table_file="gait_table.py",
        table=TEMPLATES / "gait_table.py.jinja",
        play=TEMPLATES / "play_micropython.md.jinja",
        copies={
            "gait_player.py": HERE / "gait_player.py",
            "gait_servos.py": TEMPLATES / "gait_servos.py.txt",
        },
        drives_pins=True,
        others=ESP32S,
    )
)
register(Format(name="csv", table_file="table.csv", table=TEMPLATES / "table.csv.jinja", board=ANY_ESP32))
register(Format(name="json", table_file="table.json", table=TEMPLATES / "table.json.jinja", board=ANY_ESP32))
register(
    Format(
        name="pca9685-arduino",
        table_file="gait/table.h",
        table=TEMPLATES / "table.h.jinja",
        play=TEMPLATES / "play_pca9685_arduino.md.jinja",
        copies={
            **{f"gait/{name}": TEMPLATES / name for name in _PLAYER},
            "gait/gait.ino": TEMPLATES / "gait_pca9685.ino.jinja",
        },
        others=ESP32S,
        output=PCA9685,
    )
)
register(
    Format(
        name="pca9685-micropython",
        table_file="gait_table.py",
        table=TEMPLATES / "gait_table.py.jinja",
        play=TEMPLATES / "play_pca9685_micropython.md.jinja",
        copies={
            "gait_player.py": HERE / "gait_player.py",
            "pca9685.py": HERE / "pca9685.py",
            "gait_servos.py": TEMPLATES / "gait_pca9685.py.txt",
        },
        others=ESP32S,
        output=PCA9685,
    )
)
for _name, _output in {
    "feetech-sts": FEETECH_STS,
    "feetech-scs": FEETECH_SCS,
    "dynamixel": DYNAMIXEL,
}.items():
    register(
        Format(
            name=_name,
            table_file="gait_table.py",
            table=TEMPLATES / "bus_table.py.jinja",
            play=TEMPLATES / "play_bus.md.jinja",
            copies={
                "gait_player.py": HERE / "gait_player.py",
                "bus_packets.py": HERE / "bus_packets.py",
                "gait_servos.py": TEMPLATES / "gait_bus.py.txt",
            },
            others=ESP32S,
            output=_output,
        )
    )
    register(
        Format(
            name=f"{_name}-arduino",
            table_file="gait/table.h",
            table=TEMPLATES / "table.h.jinja",
            play=TEMPLATES / "play_bus_arduino.md.jinja",
            copies={
                **{f"gait/{name}": TEMPLATES / name for name in (*_PLAYER, "bus_packets.h", "bus_packets.c")},
                "gait/gait.ino": TEMPLATES / "gait_bus.ino.jinja",
            },
            others=ESP32S,
            output=_output,
        )
    )
