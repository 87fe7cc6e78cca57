"""A new export format is a record, its templates and one registration."""

import json
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import STRIDER, problem_folder

from gaitopt.cli.app import main
from gaitopt.core.errors import GaitoptError
from gaitopt.export.board import ESP32, ESP32_C3, ESP32_S3, Board, PinNote
from gaitopt.export.format import Format
from gaitopt.export.formats import FORMATS, register
from gaitopt.export.handover import Choices, prepare
from gaitopt.export.stages import command_stages
from gaitopt.export.wiring import check_wiring
from gaitopt.gait.calibration import SAFE_PINS
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.problem.draft import make_problem
from gaitopt.problem.problem import Problem, load_problem

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


def test_a_format_of_ones_own_may_send_to_a_bus(tmp_path: Path) -> None:
    problem = wired_as(tmp_path / "bot", rear={"bus": {"id": 7}}, front={"bus": {"id": 3}})
    for name, table, line in (
        ("feetech-sts", "gait_table.py", 'PROTOCOL = "feetech-sts"\n'),
        ("feetech-sts-arduino", "gait/table.h", "#define GAIT_BUS BUS_FEETECH_STS "),
    ):
        own = register(replace(FORMATS[name], name="mine"))
        try:
            made = prepare(problem, problem.baselines["stride"], Choices("mine"), SerialExecutor())
        finally:
            del FORMATS[own.name]
        assert line in made.files[table]
        assert "(1000000 as delivered)" in made.files["README.md"]


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


def refusal(problem: Problem, choices: Choices) -> str:
    """Why an export of the strider's stride is refused."""
    with pytest.raises(GaitoptError) as caught:
        prepare(problem, problem.baselines["stride"], choices, SerialExecutor())
    return str(caught.value)


def wired_as(folder: Path, **servos: dict[str, object]) -> Problem:
    """The strider with other servos."""

    def wire(content: dict) -> None:
        for name, servo in servos.items():
            content["channels"][name]["servo"] = servo

    return load_problem(problem_folder(folder, STRIDER, wire))


@pytest.mark.parametrize("pin", [6, 20, 24, 34, 36, 39])
def test_a_pin_that_the_module_lacks_or_that_is_an_input_takes_no_servo(tmp_path: Path, pin: int) -> None:
    problem = wired_as(tmp_path / "bot", rear={"pin": pin}, front={"pin": 13})
    said = refusal(problem, Choices("arduino"))
    listed = "0 to 5, 12 to 19, 21 to 23, 25 to 27, 32 to 33, the pins of the ESP32"
    assert f"channels.rear.servo.pin: found {pin}; allowed: {listed}" in said


def test_a_board_has_its_own_pins(tmp_path: Path) -> None:
    problem = wired_as(tmp_path / "bot", rear={"pin": 38}, front={"pin": 13})
    assert "allowed: 0 to 5" in refusal(problem, Choices("micropython"))
    assert "the pins of the ESP32-C3" in refusal(problem, Choices("micropython", board="esp32-c3"))
    made = prepare(
        problem, problem.baselines["stride"], Choices("micropython", board="esp32-s3"), SerialExecutor()
    )
    assert not any("GPIO" in warning for warning in made.warnings)
    said = refusal(problem, Choices("arduino", board="esp32-s2"))
    assert "unknown board 'esp32-s2'; known: esp32, esp32-s3, esp32-c3 (nearest: 'esp32-s3')" in said


@pytest.mark.parametrize(
    ("board", "warnings"),
    [("esp32", []), ("esp32-c3", ["LED: GPIO2 of an ESP32-C3 decides at reset how it boots"])],
)
def test_an_led_on_a_pin_of_booting_is_warned_of_unless_boards_have_theirs_there(
    tmp_path: Path, board: str, warnings: list[str]
) -> None:
    problem = wired_as(tmp_path / "bot", rear={"pin": 4}, front={"pin": 3})
    choices = Choices("micropython", led_pin=2, board=board)
    made = prepare(problem, problem.baselines["stride"], choices, SerialExecutor())
    assert [warning for warning in made.warnings if "LED" in warning] == warnings


@pytest.mark.parametrize(("board", "most"), [(ESP32, 16), (ESP32_S3, 8), (ESP32_C3, 6)])
def test_no_board_makes_more_pulses_than_it_has_channels(board: Board, most: int) -> None:
    assert board.timers == most
    assert len(board.pins) >= most


def test_drafted_pins_exist_and_are_safe(tmp_path: Path) -> None:
    assert set(SAFE_PINS) <= set(ESP32.pins)
    assert [ESP32.warnings_of(pin) + ESP32.wiring_of([pin]) for pin in SAFE_PINS] == [[]] * len(SAFE_PINS)
    make_problem("bot", STRIDER / "strider.xml", tmp_path / "bot")
    text = (tmp_path / "bot" / "problem.toml").read_text()
    assert "# servo = { pin = 13, neutral_us" in text
    assert "# servo = { pin = 16, neutral_us" in text


def test_outputs_of_a_pca9685_are_numbered_in_order_or_by_the_file(tmp_path: Path) -> None:
    for folder, servos, pins in (
        ("none", {"rear": {"pin": 6}, "front": {}}, [0, 1]),
        ("all", {"rear": {"output": 15}, "front": {"output": 2}}, [15, 2]),
    ):
        problem = wired_as(tmp_path / folder, **servos)
        for form in ("pca9685-arduino", "pca9685-micropython"):
            made = prepare(problem, problem.baselines["stride"], Choices(form), SerialExecutor())
            assert [servo.pin for servo in made.table.servos.values()] == pins
    twice = wired_as(tmp_path / "twice", rear={"output": 2}, front={"output": 2})
    said = refusal(twice, Choices("pca9685-arduino"))
    assert "channels.front.servo.output: found 2; allowed: not the output of channels.rear.servo" in said
    one = wired_as(tmp_path / "one", rear={"output": 2}, front={})
    assert "channels.front.servo.output: missing; allowed: one for each" in refusal(
        one, Choices("pca9685-arduino")
    )


@pytest.mark.parametrize(
    ("form", "neutral", "per_deg"),
    [("feetech-sts", 2048, 4096 / 360), ("feetech-scs", 511, 1023 / 300), ("dynamixel", 2048, 4096 / 360)],
)
def test_bus_servos_get_positions_in_their_steps(
    tmp_path: Path, form: str, neutral: int, per_deg: float
) -> None:
    problem = wired_as(tmp_path / "bot", rear={"bus": {"id": 7, "neutral_steps": 600}, "direction": -1},
                       front={"bus": {"id": 3}})  # fmt: skip
    made = prepare(problem, problem.baselines["stride"], Choices(form), SerialExecutor())
    table = made.table
    assert (table.unit, [servo.pin for servo in table.servos.values()]) == ("steps", [7, 3])
    channels = table.gait.channels
    for column, (name, zero, sign) in enumerate((("rear", 600, -1), ("front", neutral, 1))):
        low, high = channels[name].extremes_deg
        ends = sorted(round(zero + sign * per_deg * angle) for angle in (low, high))
        column_of = [row[column] for row in table.pulses]
        assert ends[0] <= min(column_of) <= max(column_of) <= ends[1]
        assert min(column_of) - ends[0] <= 1
        assert ends[1] - max(column_of) <= 1
    time = 2.0 + 1e-3 * np.arange(1000)
    stages = command_stages(problem, table, FORMATS[form].output)
    rounding_deg = np.rad2deg(np.abs(stages["quantisation"](time) - stages["interpolation"](time)))
    assert 0.0 < rounding_deg.max() <= 0.5 / per_deg + 1e-9
    assert made.from_datasheet["rear"][0] == "bus.steps_per_deg"


def test_one_line_says_what_is_wrong_with_a_bus_servo(tmp_path: Path) -> None:
    twice = wired_as(tmp_path / "twice", rear={"bus": {"id": 3}}, front={"bus": {"id": 3}})
    said = refusal(twice, Choices("dynamixel"))
    assert "channels.front.servo.bus.id: found 3; allowed: not the id of channels.rear.servo" in said
    far = wired_as(tmp_path / "far", rear={"bus": {"max_steps": 2000}}, front={})
    said = refusal(far, Choices("feetech-scs"))
    assert "channels.rear.servo.bus.max_steps: found 2000; allowed: 2 to 1023" in said
    off = wired_as(tmp_path / "off", rear={"bus": {"max_steps": 500}}, front={})
    said = refusal(off, Choices("feetech-scs"))
    assert "start.ctrl_deg.rear: found 'a position of 511 steps'; allowed: 1 to 500" in said
    with pytest.raises(GaitoptError, match=r"channels.rear.servo.bus.neutral: unknown key"):
        wired_as(tmp_path / "typo", rear={"bus": {"neutral": 3}})


@pytest.mark.parametrize(
    ("actuator", "said"),
    [
        ('<position name="rear" tendon="t" kp="2"/>', "its actuator pulls a tendon"),
        ('<intvelocity name="rear" joint="{joint}" actrange="-1 1"/>', "is sent speeds, not angles"),
        ('<position name="rear" joint="rod" kp="2"/>', "its actuator moves a slide joint"),
    ],
)
def test_what_is_no_servo_is_refused_with_the_reason(wired_folder: Path, actuator: str, said: str) -> None:
    path = wired_folder / "strider.xml"
    root = ET.fromstring(path.read_text())
    section = root.find("actuator")
    assert section is not None
    old = next(element for element in section if element.get("name") == "rear")
    joint = str(old.get("joint"))
    index = list(section).index(old)
    section.remove(old)
    section.insert(index, ET.fromstring(actuator.format(joint=joint)))
    tendon = ET.SubElement(ET.SubElement(root, "tendon"), "fixed", name="t")
    ET.SubElement(tendon, "joint", joint=joint, coef="1")
    body = next(body for body in root.iter("body") if body.find(f"joint[@name='{joint}']") is not None)
    rod = ET.SubElement(body, "body")
    ET.SubElement(rod, "joint", name="rod", type="slide", axis="1 0 0")
    ET.SubElement(rod, "geom", size="0.001", mass="0.0001", contype="0", conaffinity="0")
    path.write_text(ET.tostring(root, encoding="unicode"))
    assert said in refusal(load_problem(wired_folder), Choices("csv"))


@pytest.mark.parametrize(
    ("form", "board", "most", "where"),
    [
        ("esp-idf", "esp32", 8, "format esp-idf on the ESP32"),
        ("arduino", "esp32-c3", 6, "format arduino on the ESP32-C3"),
        ("micropython", "esp32-s3", 8, "format micropython on the ESP32-S3"),
    ],
)
def test_more_servos_than_a_board_has_channels_are_refused(
    tmp_path: Path, form: str, board: str, most: int, where: str
) -> None:
    problem = wired_as(tmp_path / "bot", rear={"pin": 4}, front={"pin": 5})
    servos = {f"s{i}": problem.file.channels["rear"] for i in range(most + 1)}
    many = replace(problem, file=problem.file.model_copy(update={"channels": servos}))
    with pytest.raises(GaitoptError) as caught:
        check_wiring(many, FORMATS[form].on(board), None)
    assert f"found {most + 1} servos; allowed: at most {most} with {where}; a PCA9685" in str(caught.value)
