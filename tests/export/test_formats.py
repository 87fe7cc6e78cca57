"""A new export format is a record, its templates and one registration."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from gaitopt.cli.app import main
from gaitopt.core.errors import GaitoptError
from gaitopt.export.board import Board, PinNote
from gaitopt.export.format import Format
from gaitopt.export.formats import FORMATS, register

TOY = Board(
    name="Toy",
    pins=range(30),
    warnings=(PinNote((25,), "GPIO{pin} is the toy's LED"),),
    wiring=(PinNote((4, 5), "GPIO{pin} is next to the plug."),),
)


@pytest.fixture
def toy(tmp_path: Path) -> Iterator[Format]:
    """A format that is not gaitopt's: a table in Lua, a file that is copied, and a board."""
    (tmp_path / "table.lua.jinja").write_text(
        "-- {{ mark }}: {{ header }}\n"
        "return { -- one row per phase\n"
        "{%- for row in pulses %}\n  {{ row|join(', ') }},\n{%- endfor %}\n}\n"
    )
    (tmp_path / "play_lua.md.jinja").write_text("`dofile('gait.lua')`, for {{ servos|length }} servos.\n")
    (tmp_path / "player.lua").write_text("-- plays\n")
    yield register(
        Format(
            name="lua",
            table_file="gait.lua",
            table=tmp_path / "table.lua.jinja",
            play=tmp_path / "play_lua.md.jinja",
            copies={"lib/player.lua": tmp_path / "player.lua"},
            board=TOY,
        )
    )
    del FORMATS["lua"]


def test_a_format_of_ones_own_is_one_record_and_one_registration(
    toy: Format, wired_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    command = ["export", str(wired_folder), "stride", "--format", "lua", "--out", str(out), "--json"]
    assert main([*command, "--led-pin", "25"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (out / "lib" / "player.lua").read_text() == "-- plays\n"
    readme = (out / "README.md").read_text()
    assert "`dofile('gait.lua')`, for 2 servos.\n\nThe gait begins" in readme
    assert "- GPIO4 is next to the plug.\n" in readme
    assert "GPIO5 is" not in readme
    assert "LED: GPIO25 is the toy's LED" in answer["warnings"]
    assert main(["simulate", str(wired_folder), str(out / "gait.lua"), "--json"]) == 0
    read_back = capsys.readouterr().out
    assert main(["simulate", str(wired_folder), "stride", "--json"]) == 0
    assert capsys.readouterr().out == read_back


def test_the_help_names_every_format(toy: Format, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", "--help"]) == 0
    said = capsys.readouterr().out
    assert all(name in said for name in ("micropython", "esp-idf", toy.name))


def test_two_formats_cannot_have_one_name(toy: Format) -> None:
    with pytest.raises(GaitoptError, match="'lua': there is one of this name already"):
        register(toy)


@pytest.mark.parametrize(
    ("pin", "led", "said"),
    [
        (60, 2, "channels.rear.servo.pin: found 60; allowed: 0 to 54, the pins of the ESP32"),
        (4, 99, "--led-pin: found 99; allowed: 0 to 54, the pins of the ESP32"),
    ],
)
def test_a_pin_that_the_board_lacks_is_one_line(
    wired_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], pin: int, led: int, said: str
) -> None:
    path = wired_folder / "problem.toml"
    path.write_text(path.read_text().replace("pin = 4", f"pin = {pin}"))
    out = tmp_path / "out"
    command = ["export", str(wired_folder), "stride", "--format", "c", "--led-pin", str(led)]
    assert main([*command, "--out", str(out)]) == 1
    assert said in capsys.readouterr().err
    assert not out.exists()
