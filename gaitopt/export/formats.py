"""The output formats by name."""

from __future__ import annotations

from gaitopt.core.errors import GaitoptError
from gaitopt.export.format import HERE, TEMPLATES, Format

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
    )
)
register(
    Format(
        name="arduino",
        table_file="gait/table.h",
        table=TEMPLATES / "table.h.jinja",
        play=TEMPLATES / "play_arduino.md.jinja",
        copies={f"gait/{name}": TEMPLATES / name for name in (*_PLAYER, "gait.ino")},
        drives_pins=True,
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
    )
)
register(Format(name="csv", table_file="table.csv", table=TEMPLATES / "table.csv.jinja"))
register(Format(name="json", table_file="table.json", table=TEMPLATES / "table.json.jinja"))
