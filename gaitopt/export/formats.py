"""The files of an export: a table in each language, the player and a driver beside it, and a README."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import jinja2

from gaitopt.export.replay import Replay, servo_rows
from gaitopt.gait.table import MARK, GaitTable

_UNSAFE = str.maketrans({character: f"\\u{ord(character):04x}" for character in "/*?`|<>&"})


@dataclass(frozen=True)
class Format:
    """One output format.

    Attributes:
        table_file: the file that holds the table, and the gait.
        table: returns the text of that file.
        others: where each further file goes, and the template or source that it comes from.
        drives_pins: whether it sends the pulses itself, so that every servo needs a pin.
    """

    table_file: str
    table: Callable[[GaitTable], str]
    others: dict[str, str]
    drives_pins: bool = False


def export_files(
    name: str,
    table: GaitTable,
    replay: Replay,
    warnings: Sequence[str],
    from_datasheet: Mapping[str, Sequence[str]],
) -> dict[str, str]:
    """Return the text of every file of an export by its path.

    Args:
        name: a key of `FORMATS`.
        table: the table.
        replay: how it did in simulation.
        warnings: what the README warns of.
        from_datasheet: per channel, the values of its calibration that nobody set.
    """
    chosen = FORMATS[name]
    facts = _facts(table) | {
        "format": name,
        "table_file": chosen.table_file,
        "replay": replay,
        "warnings": warnings,
        "from_datasheet": from_datasheet,
        "pins": [servo.pin for servo in table.servos.values()],
    }
    texts = {chosen.table_file: chosen.table(table)}
    texts |= {path: _source(source) for path, source in chosen.others.items()}
    return texts | {"README.md": _rendered("README.md.jinja", facts)}


def comment(value: Any) -> str:
    """Return JSON that cannot end a comment, a string or a table cell of any of the languages here."""
    return json.dumps(value, ensure_ascii=True).translate(_UNSAFE)


def _plain(text: str) -> str:
    """Return `comment` of a text without its quotes."""
    return comment(text)[1:-1]


def _facts(table: GaitTable) -> dict[str, Any]:
    rows = zip(table.servos.items(), servo_rows(table), strict=True)
    return {
        "mark": MARK,
        "header": comment(table.header),
        "name": table.gait.name or "gait",
        "hash": table.hash,
        "period_s": table.gait.period_s,
        "period_us": table.period_us,
        "frame_us": table.frame_us,
        "led_pin": -1 if table.led_pin is None else table.led_pin,
        "pulses": table.pulses,
        "servos": [{"name": name, "pin": servo.pin, "numbers": numbers} for (name, servo), numbers in rows],
    }


def _rendered(template: str, facts: dict[str, Any]) -> str:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("gaitopt.export"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
    )
    environment.filters["comment"] = _plain
    return environment.get_template(template).render(facts)


def _source(path: str) -> str:
    return (files("gaitopt.export") / path).read_text(encoding="utf-8")


def _templated(template: str) -> Callable[[GaitTable], str]:
    return lambda table: _rendered(template, _facts(table))


def _csv(table: GaitTable) -> str:
    text = io.StringIO()
    text.write(f"# {MARK}: {comment(table.header)}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["phase", *(f"{_plain(name)}_us" for name in table.servos)])
    writer.writerows([k / len(table.pulses), *row] for k, row in enumerate(table.pulses))
    return text.getvalue()


def _json(table: GaitTable) -> str:
    rows = ",\n".join(f"  {json.dumps(row)}" for row in table.pulses)
    return f'{{\n "{MARK}": {comment(table.header)},\n "pulses_us": [\n{rows}\n ]\n}}\n'


_PLAYER = ("gait_player.h", "gait_player.c")
_C_TABLE = _templated("table.h.jinja")

FORMATS = {
    "c": Format("table.h", _C_TABLE, {name: f"templates/{name}" for name in _PLAYER}),
    "arduino": Format(
        "gait/table.h",
        _C_TABLE,
        {f"gait/{name}": f"templates/{name}" for name in (*_PLAYER, "gait.ino")},
        drives_pins=True,
    ),
    "esp-idf": Format(
        "table.h",
        _C_TABLE,
        {
            name: f"templates/{name}"
            for name in (*_PLAYER, "gait_servos.h", "gait_servos.c", "CMakeLists.txt")
        },
        drives_pins=True,
    ),
    "micropython": Format(
        "gait_table.py",
        _templated("gait_table.py.jinja"),
        {"gait_player.py": "gait_player.py", "gait_servos.py": "templates/gait_servos.py.txt"},
        drives_pins=True,
    ),
    "csv": Format("table.csv", _csv, {}),
    "json": Format("table.json", _json, {}),
}
"""The output formats by name."""
