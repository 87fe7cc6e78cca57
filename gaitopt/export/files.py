"""The files of an export: the table, what plays it, and a README."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import jinja2

from gaitopt.core.files import read_text
from gaitopt.export.bus_packets import PROTOCOLS
from gaitopt.export.format import TEMPLATES, Format
from gaitopt.export.replay import Replay
from gaitopt.export.stages import servo_rows
from gaitopt.gait.table import MARK, GaitTable

README = "README.md"

_UNSAFE = str.maketrans({character: f"\\u{ord(character):04x}" for character in "/*?`|<>&"})


def export_files(
    format: Format,
    table: GaitTable,
    replay: Replay,
    warnings: Sequence[str],
    from_datasheet: Mapping[str, Sequence[str]],
) -> dict[str, str]:
    """Return the text of every file of an export by its path.

    Args:
        format: the output format.
        table: the table.
        replay: its result in simulation.
        warnings: the warnings of the README.
        from_datasheet: per channel, the values of its calibration that are not set.
    """
    jinja = environment()
    output = format.output
    known: dict[str, object] = {
        **vars(facts(table)),
        "format": format.name,
        "number": output.number,
        "protocol": output.protocol,
        "baud": PROTOCOLS[output.protocol].BAUD if output.protocol else None,
    }

    def filled(template: Path, **more: object) -> str:
        return jinja.from_string(read_text(template)).render(known | more)

    texts = {format.table_file: filled(format.table)}
    for path, source in format.copies.items():
        texts[path] = filled(source) if source.suffix == ".jinja" else read_text(source)
    texts[README] = filled(
        TEMPLATES / "README.md.jinja",
        table_file=format.table_file,
        replay=replay,
        warnings=warnings,
        from_datasheet=from_datasheet,
        wiring=filled(output.wiring),
        wiring_notes=_wiring_notes(format, table),
        play=filled(format.play),
    )
    return texts


def _wiring_notes(format: Format, table: GaitTable) -> list[str]:
    """Return the notes of the board on the pins in use."""
    pins = [servo.pin for servo in table.servos.values()]
    return format.board.wiring_of(pins) if format.output.on_pins else []


@dataclass(frozen=True)
class ServoFacts:
    """The data of a servo for templates.

    Attributes:
        name: its channel.
        pin: its GPIO, output or ID; None where it is not set.
        numbers: its row of `servo_rows`.
    """

    name: str
    pin: int | None
    numbers: tuple[int, ...]


@dataclass(frozen=True)
class TableFacts:
    """The data of a table for every template.

    Attributes:
        mark, header: what a table file carries to be read back: ``mark: header``.
        name: the gait's name.
        hash: of everything that moves a servo.
        period_s, period_us: one cycle.
        frame_us: period of the servo signal.
        led_pin: GPIO of the sync LED; -1 for none.
        pulses: rows of pulses, µs or steps, one for each servo.
        unit: of the pulses.
        servos: the servos.
    """

    mark: str
    header: str
    name: str
    hash: str
    period_s: float
    period_us: int
    frame_us: int
    led_pin: int
    pulses: tuple[tuple[int, ...], ...]
    unit: str
    servos: tuple[ServoFacts, ...]


def facts(table: GaitTable) -> TableFacts:
    """Return the data of a table for every template."""
    rows = zip(table.servos.items(), servo_rows(table), strict=True)
    return TableFacts(
        mark=MARK,
        header=comment(table.header),
        name=table.gait.name or "gait",
        hash=table.hash,
        period_s=table.gait.period_s,
        period_us=table.period_us,
        frame_us=table.frame_us,
        led_pin=-1 if table.led_pin is None else table.led_pin,
        pulses=table.pulses,
        unit=table.unit,
        servos=tuple(ServoFacts(name, servo.pin, numbers) for (name, servo), numbers in rows),
    )


def comment(value: object) -> str:
    """Return JSON that cannot end a comment, a string or a table cell of any of the languages here."""
    return json.dumps(value, ensure_ascii=True).translate(_UNSAFE)


def _without_quotes(text: str) -> str:
    """Return `comment` of a text without its quotes."""
    return comment(text)[1:-1]


def _cell(text: str) -> str:
    """Return a text as a cell of a CSV table, quoted where it has to be."""
    line = io.StringIO()
    csv.writer(line, lineterminator="").writerow([text])
    return line.getvalue()


def environment() -> jinja2.Environment:
    """Return what fills templates; its filters make names safe in comments, in CSV cells and in Python."""
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        loader=jinja2.FileSystemLoader(TEMPLATES),  # for what templates extend
    )
    environment.filters["comment"] = _without_quotes
    environment.filters["cell"] = _cell
    environment.filters["literal"] = ascii
    return environment
