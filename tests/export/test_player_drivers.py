"""The exported drivers, against mocks of their boards.

Compilers that are not installed are skipped; .ci/run installs them.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest
from players import (
    HERE,
    SANITIZED,
    STRICT,
    exported,
    mock_commands,
    run,
    sketch_prints,
    table,
    tool,
)

from gaitopt.export import gait_player
from gaitopt.export.stages import player_of, sent_pulses


@pytest.mark.parametrize("core", [2, 3])
def test_the_arduino_sketch_plays_on_both_cores(tmp_path: Path, core: int) -> None:
    printed = sketch_prints(exported(tmp_path, "arduino") / "gait", "arduino", core)
    assert printed[0] == "50 Hz, 14 bits"
    assert printed[1:] == changes(arduino_duties())


def arduino_duties() -> Iterator[tuple[int, dict[int, int]]]:
    """What the Python player gives for the commands of the mock's main.cpp, by ms and GPIO."""
    player = player_of(table())
    pins = [servo[0] for servo in player.servos]
    held: dict[int, int] = {}
    for ms, ticked in mock_commands(player):
        if ticked:
            duties = [gait_player.duty(pulse, 20_000) for pulse in player.pulse_us]
            held = dict(zip(pins, duties, strict=True)) | {2: 100_000 * player.led()}
        yield ms, held


def changes(rows: Iterator[tuple[int, dict[int, int]]]) -> list[str]:
    last: dict[int, int] = {}
    lines = []
    for ms, row in rows:
        for pin in sorted(row):
            if row[pin] != last.get(pin, 0):
                lines.append(f"{ms} ms: GPIO{pin} {row[pin]}")
        last = row
    return lines


def test_the_esp_idf_component_plays(tmp_path: Path) -> None:
    compiler = tool("gcc")
    folder = exported(tmp_path, "esp-idf")
    mocks = HERE / "mocks" / "esp-idf"
    run(
        compiler, *STRICT, *SANITIZED, f"-I{mocks}", f"-I{folder}", mocks / "main.c", "gait_servos.c",
        "gait_player.c", "-o", "app", cwd=folder,
    )  # fmt: skip
    printed = run(folder / "app").splitlines()
    assert printed[:5] == [
        "50 Hz, 14 bits",
        "channel 0 GPIO12",
        "channel 1 GPIO13",
        "channel 2 GPIO14",
        "GPIO2 mode 2",
    ]
    played = [line for line in printed[5:] if line.startswith(("channel 0 ", "GPIO2 1"))]
    waiting = played.index("GPIO2 1") - 1
    duties = [int(line.split()[2]) for line in played if line.startswith("channel")]
    walked = [gait_player.duty(row[0], 20_000) for row in sent_pulses(table(), len(duties) - waiting)]
    assert duties[waiting:] == walked
