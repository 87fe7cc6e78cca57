"""Broken and hostile input, generated: whole files and mutations of them, and what must hold of each.

A case is made from its seed, kind and number alone, so any can be made again. It is a command line, or
a reader called directly, in a folder of files of which some are broken. It must end in success or in
one clear line, and must leave no half-written file and no changed input behind.
"""

from __future__ import annotations

import contextlib
import copy
import csv
import io
import random
import re
import shutil
import signal
import sys
import tomllib
import traceback
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any
from unittest import mock

import tomli_w
from helpers import STRIDER, brief_studies

from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import write_text
from gaitopt.diagnose.record.cleaning import clean
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.export.files import export_files
from gaitopt.export.formats import FORMATS
from gaitopt.export.replay import Replay
from gaitopt.gait.gait import Channel, Gait
from gaitopt.gait.table import GaitTable, read_table
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.journal import Journal
from gaitopt.optimise.run import Request, optimise
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.runs.results import RunFolder
from gaitopt.simulation.rollout import Simulator

LIMIT_S = 20.0
"""A case that takes longer hangs; on a free core one takes a hundredth of a second."""

WHOLE_LIMIT_S = 300.0
"""The same for a whole run of a command, with its figures and its page."""

NUMBERS = [
    *("0", "-0.0", "1", "-1", "0.5", "2", "1e-9", "1e-300", "5e-324", "1e-12", "1e9", "1e18", "1e300"),
    *("1.7976931348623157e308", "-1e308", "1e309", "inf", "-inf", "nan", "+nan", "99999999999999999999999"),
    *("18446744073709551616", "-9223372036854775809", "0x10", "1_000", "1,5", "1.5.2", "٣", "", "true", "[]"),
]
"""Numbers at and beyond the edges, and texts that are nearly numbers."""

NAMES = [
    *('*/ system("x") //', "<script>alert(1)</script>", "a b", "naïve 机器人", 'quo"te', "it's", "new\nline"),
    *(
        "..",
        "../../etc/passwd",
        "/etc/passwd",
        "",
        ".",
        "a" * 5000,
        "\x00",
        "%s%n",
        "$(reboot)",
        "`id`",
        "{}",
    ),
    *(
        "{{ 7*7 }}",
        "\ufeff",
        "\u202ereversed",
        "-rf",
        "--help",
        "~",
        "*",
        "back\\slash",
        "e\u0301",
        "\U0001f916",
    ),
    *("a,b", "a;b", "a\tb", "a.b", "[x]", "a=b", "# x", "'''", '"""', "\x7f", "\x1b[31m", "None", "nan"),
]
"""Names that end a comment, a string, a path, a table cell or a screen."""

VALUES: list[Any] = [
    *(
        0,
        -1,
        2**31,
        2**63 - 1,
        10**30,
        0.0,
        -0.0,
        0.5,
        1e308,
        -1e308,
        5e-324,
        1e-9,
        float("inf"),
        float("nan"),
    ),
    *(True, "", [], {}, [[]], [1, 2], [2, 1], [0.0, 1e300], {"a": {"b": {}}}, ["x"], *NAMES[:12]),
]
"""What a key of a TOML file may be set to."""


# --- what must hold ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """One attempt: a command line, or a reader called directly, with files in `folder`."""

    arguments: list[str] = field(default_factory=list)
    call: Callable[[], object] | None = None
    may_change: tuple[str, ...] = ()
    limit_s: float = LIMIT_S

    @property
    def brief(self) -> bool:
        """Whether it is a whole run, whose studies are to have few samples."""
        return self.limit_s > LIMIT_S


@dataclass(frozen=True)
class Outcome:
    """How a case ended: ``done``, ``stated``, ``usage``, or what is wrong, with the words of the line."""

    ended: str
    words: str = ""

    @property
    def wrong(self) -> bool:
        return self.ended not in ("done", "stated", "usage")


class TooLongError(BaseException):
    """The limit on a case's time; no command may catch it."""


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    def stop(number: int, frame: FrameType | None) -> None:
        raise TooLongError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def attempt(case: Case, folder: Path) -> Outcome:
    """Run a case in its folder, the working directory, and say how it ended."""
    before = contents(folder)
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", newline="\n")
    err = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="backslashreplace", newline="\n")
    try:
        with (
            brief_run() if case.brief else contextlib.nullcontext(),
            limited(case.limit_s),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("always")  # a warning on standard error is a line too many
            code = cli.main(case.arguments) if case.call is None else called(case.call)
    except TooLongError:
        return Outcome("hang")
    except BaseException:
        return Outcome("traceback", traceback.format_exc())
    err.flush()
    said = err.buffer.getvalue().decode()  # type: ignore[attr-defined]
    lines = said.removesuffix("\n").split("\n") if said else []
    if code not in (0, 1, 2):
        return Outcome(f"exit {code}", said)
    if len(lines) != (code != 0) or not all(line.startswith("gaitopt: ") and line.strip() for line in lines):
        return Outcome("not one line", said)
    wrong = wrong_files(before, contents(folder), code, case.may_change)
    if wrong:
        return Outcome("files", wrong)
    return Outcome(("done", "stated", "usage")[code], said.strip())


@contextlib.contextmanager
def brief_run() -> Iterator[None]:
    with contextlib.ExitStack() as stack:
        for module, name, value in brief_studies():
            stack.enter_context(mock.patch.object(module, name, value))
        yield


def called(call: Callable[[], object]) -> int:
    """Call a reader as the command line would."""
    try:
        call()
    except GaitoptError as problem:
        print(f"gaitopt: {problem}", file=sys.stderr)
        return 1
    return 0


def contents(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def wrong_files(
    before: dict[str, bytes], after: dict[str, bytes], code: int, may_change: tuple[str, ...]
) -> str:
    """Return what a command did to files that it must not have done, or nothing."""
    for name, data in before.items():
        if name.split("/")[0] not in may_change and after.get(name) != data:
            return f"{name} was {'changed' if name in after else 'removed'}"
        if code and name.startswith("out") and after.get(name) != data:
            return f"{name} was overwritten by a command that failed"
    new = [name for name in after if name not in before]
    half = [name for name in new if re.search(r"(^|/)\.[^/]+\.[a-z0-9_]{8}(\.|$|/)", name)]
    if half:
        return f"{half[0]} is half-written"
    if code and [name for name in new if name.split("/")[0] not in may_change]:
        return f"{new[0]} was left by a command that failed"
    return ""


# --- mutations --------------------------------------------------------------------------------


def broken(rng: random.Random, data: bytes) -> bytes:
    """Return a file with one to four things wrong with it, now and then with none."""
    for _ in range(rng.choice([0, 1, 1, 1, 1, 2, 2, 3, 4])):
        data = rng.choice(BREAKERS)(rng, data)
    return data


def _cut(rng: random.Random, data: bytes) -> tuple[int, int]:
    begin = rng.randrange(len(data) + 1)
    return begin, min(len(data), begin + rng.choice([1, 1, 2, 10, 100]))


def _truncated(rng: random.Random, data: bytes) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def _without_a_piece(rng: random.Random, data: bytes) -> bytes:
    begin, end = _cut(rng, data)
    return data[:begin] + data[end:]


def _with_a_piece_twice(rng: random.Random, data: bytes) -> bytes:
    begin, end = _cut(rng, data)
    return data[:end] + data[begin:end] * rng.choice([1, 2, 50]) + data[end:]


def _with_other_bytes(rng: random.Random, data: bytes) -> bytes:
    begin, end = _cut(rng, data)
    return data[:begin] + rng.randbytes(rng.choice([1, 1, 2, 8])) + data[end:]


def _with_other_letters(rng: random.Random, data: bytes) -> bytes:
    begin, _ = _cut(rng, data)
    return data[:begin] + rng.choice("\"'[]{}=,.:;#<>&/\\\n\r\t -+_0").encode() + data[begin + 1 :]


def _with_other_lines(rng: random.Random, data: bytes) -> bytes:
    lines = data.split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    what = rng.randrange(4)
    if what == 0:
        lines[i], lines[j] = lines[j], lines[i]
    elif what == 1:
        del lines[i]
    elif what == 2:
        lines.insert(j, lines[i])
    else:
        lines = lines[: rng.choice([0, 1, 2])]
    return b"\n".join(lines)


def _with_another_number(rng: random.Random, data: bytes) -> bytes:
    found = list(re.finditer(rb"-?\d+(\.\d+)?(e-?\d+)?", data))
    if not found:
        return data
    match = rng.choice(found)
    return data[: match.start()] + rng.choice(NUMBERS).encode() + data[match.end() :]


def _with_another_word(rng: random.Random, data: bytes) -> bytes:
    found = list(re.finditer(rb"[A-Za-z_]{2,}", data))
    if not found:
        return data
    match = rng.choice(found)
    word = rng.choice([rng.choice(NAMES).encode(), rng.choice(found).group()])
    return data[: match.start()] + word + data[match.end() :]


def _of_another_system(rng: random.Random, data: bytes) -> bytes:
    text = data.decode("utf-8", "replace")
    what = rng.randrange(7)
    if what == 0:
        return data.replace(b"\n", b"\r\n")
    if what == 1:
        return b"\xef\xbb\xbf" + data
    if what == 2:
        return text.encode("utf-16")
    if what == 3:
        return text.encode("latin-1", "replace") + b"\xe9"
    if what == 4:
        return data.replace(b"\n", b"\r")
    if what == 5:
        return re.sub(rb"(\d)\.(\d)", rb"\1,\2", data)
    return data.replace(b",", b";")


def _hostile(rng: random.Random, data: bytes) -> bytes:
    deep = rng.choice([100, 3000])
    text = rng.choice(
        [
            b"",
            b"\n",
            b"\x00" * 10,
            b"[" * deep,
            b"a = " + b"[" * deep + b"]" * deep,
            b"a = " + b"{a=" * deep,
            b"a." * deep + b"a = 1",
            b'{"a":' * deep,
            b"<a>" * deep + b"</a>" * deep,
            b"9" * 5000,
            b"x = " + b"9" * 5000,
            b'"',
            b"-",
        ]
    )
    begin, _ = _cut(rng, data)
    return rng.choice([text, data[:begin] + text + data[begin:], data + b"\n" + text])


BREAKERS: list[Callable[[random.Random, bytes], bytes]] = [
    *(_truncated, _without_a_piece, _with_a_piece_twice, _with_other_bytes, _with_other_letters),
    *(_with_other_lines, _with_another_number, _with_another_number, _with_another_word),
    *(_with_another_word, _of_another_system, _hostile),
]


def changed(rng: random.Random, content: dict[str, Any]) -> dict[str, Any]:
    """Return the content of a TOML file with one to three keys changed, removed or added."""
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        holders = list(_holders(content))
        holder = rng.choice(holders)
        keys: list[Any] = list(holder) if isinstance(holder, dict) else list(range(len(holder)))
        what = rng.randrange(5)
        if not keys or (what == 0 and isinstance(holder, dict)):
            if isinstance(holder, dict):
                holder[rng.choice(NAMES)] = copy.deepcopy(rng.choice(VALUES))
            continue
        key = rng.choice(keys)
        if what == 1:
            del holder[key]
        elif what == 2 and isinstance(holder, dict):
            holder[rng.choice(NAMES)] = holder.pop(key)
        else:
            holder[key] = copy.deepcopy(rng.choice(VALUES))
    return content


def _holders(value: Any) -> Iterator[Any]:
    if isinstance(value, (dict, list)):
        yield value
        for item in value.values() if isinstance(value, dict) else value:
            yield from _holders(item)


def changed_xml(rng: random.Random, root: ET.Element) -> ET.Element:
    """Return an MJCF with one to three elements or attributes changed."""
    for _ in range(rng.choice([1, 1, 2, 3])):
        parents = list(root.iter())
        element = rng.choice(parents)
        what = rng.randrange(8)
        if what <= 2 and element.attrib:
            name = rng.choice(list(element.attrib))
            element.set(name, rng.choice([rng.choice(NUMBERS), rng.choice(NAMES), *ATTRIBUTES.values()]))
        elif what == 3 and element.attrib:
            del element.attrib[rng.choice(list(element.attrib))]
        elif what == 4:
            name = rng.choice(list(ATTRIBUTES))
            element.set(name, rng.choice([ATTRIBUTES[name], rng.choice(NUMBERS)]))
        elif what == 5 and len(element):
            element.remove(rng.choice(list(element)))
        elif what == 6:
            element.insert(0, ET.fromstring(rng.choice(ELEMENTS)))
        else:
            element.append(copy.deepcopy(rng.choice(parents)))
    return root


ATTRIBUTES = {
    "pos": "1e300 0 0",
    "size": "0 0 0",
    "mass": "1e-300",
    "axis": "0 0 0",
    "range": "1 -1",
    "damping": "-1e9",
    "kp": "1e308",
    "friction": "-1 0 0",
    "timestep": "1e-12",
    "integrator": "RK4",
    "memory": "1",
    "nconmax": "1",
    "gravity": "0 0 0",
    "type": "mesh",
    "solref": "0 0",
    "name": "trunk",
    "class": "none",
    "file": "../../../etc/passwd",
    "angle": "degree",
    "iterations": "0",
    "armature": "nan",
    "forcerange": "1 -1",
    "quat": "0 0 0 0",
}
ELEMENTS = [
    '<include file="strider.xml"/>',
    '<include file="/etc/passwd"/>',
    '<include file="parts"/>',
    '<mesh file="/etc/hostname"/>',
    '<asset><mesh name="m" file="wedge.obj"/></asset>',
    '<geom type="mesh" mesh="none"/>',
    '<geom type="sphere" size="1e-9"/>',
    '<body><freejoint/><geom size="1"/></body>',
    '<joint type="free"/>',
    '<replicate count="3"><geom size="0.01"/></replicate>',
    '<composite type="cable" count="100000 1 1"/>',
    '<plugin plugin="mujoco.none"/>',
    '<keyframe><key name="start" qpos="1 2"/></keyframe>',
    '<equality><weld body1="trunk" body2="trunk"/></equality>',
    '<sensor><touch site="nose"/></sensor>',
    '<actuator><motor joint="rear_hip"/></actuator>',
    '<size memory="1K"/>',
    '<option><flag gravity="disable"/></option>',
]


def nudged(rng: random.Random, data: bytes) -> bytes:
    """Return a file with one to three numbers changed to others that are often allowed."""
    for _ in range(rng.choice([1, 1, 2, 3])):
        found = list(re.finditer(rb"(?<![\w.])-?\d+(\.\d+)?(e-?\d+)?(?![\w.])", data))
        if found:
            match = rng.choice(found)
            number = float(match.group()) * rng.choice([0.0, -1.0, 0.01, 0.5, 0.9, 1.1, 2.0, 3.0, 100.0])
            text = f"{number:g}" if b"." in match.group() or number % 1.0 else f"{number:.0f}"
            data = data[: match.start()] + text.encode() + data[match.end() :]
    return data


# --- whole files to start from ----------------------------------------------------------------


@cache
def problem() -> Problem:
    return load_problem(STRIDER)


def gait_of(rng: random.Random) -> Gait:
    """Return a gait of any shape that a file may hold, within the servos' range or not."""
    low, high = rng.choice([(-45.0, 45.0), (-90.0, 90.0)])
    channels = {}
    for name in problem().channel_names:
        offset = rng.uniform(low, high)
        channels[name] = Channel(
            duty=rng.choice([0.0, 1.0, 5e-324, rng.random()]),
            phase=rng.choice([0.0, -0.0, 1.0, -1e-18, 1e300, rng.uniform(-2.0, 2.0)]),
            amplitude_deg=rng.choice([0.0, 5e-324, rng.uniform(low - offset, high - offset)]),
            offset_deg=offset,
            smoothing=rng.choice([0.0, 1.0, 5e-324, rng.random()]),
        )
    return Gait(rng.choice([0.25, 0.5, 1.0, rng.uniform(0.1, 3.0)]), channels, "made")


def table_of(gait: Gait) -> GaitTable:
    channels = problem().file.channels
    servos = {name: channel.servo for name, channel in channels.items()}
    return GaitTable.sample(gait, servos, [0.0] * len(servos), 0.02, [0, 133], led_pin=2, samples=8)


def table_text(gait: Gait, name: str) -> str:
    """Return the file of a format that holds the table."""
    table = table_of(gait)
    unset: dict[str, list[str]] = {key: [] for key in table.servos}
    files = export_files(FORMATS[name], table, Replay(1.0, 1.0, 0.0, (0.0, 0.0), {}), [], unset)
    return files[FORMATS[name].table_file]


def motion(rng: random.Random) -> list[tuple[float, float, float]]:
    """Return time, x and z of a marker that goes forward in steps, sometimes badly filmed."""
    frame, rows = rng.choice([0.02, 0.04, 1 / 30]), []
    for index in range(rng.choice([1, 2, 3, 12, 60])):
        t = index * frame
        rows.append((t, 0.01 * t + 0.001 * (index % 7), 0.002 * (index % 3)))
    if rng.random() < 0.2:
        rows = [(round(t, 1), x, z) for t, x, z in rows]
    return rows


def export_of(rng: random.Random, program: str) -> str:
    """Return a file as a tracking program writes it."""
    rows = motion(rng)
    if program == "tracker":
        return "\n".join(["mass_A", "t\tx\ty", *(f"{t:.4f}\t{x:.6f}\t{z:.6f}" for t, x, z in rows)])
    if program == "tracker-comma":
        text = "\n".join(["mass_A", "t\tx\ty", *(f"{t:.4f}\t{x:.6f}\t{z:.6f}" for t, x, z in rows)])
        return text.replace(".", ",").replace("-", "\N{MINUS SIGN}")
    if program == "deeplabcut":
        head = ["scorer,net,net,net", "bodyparts,nose,nose,nose", "coords,x,y,likelihood"]
        return "\n".join(
            [*head, *(f"{i},{1e3 * x:.2f},{1e3 * z:.2f},0.9" for i, (_, x, z) in enumerate(rows))]
        )
    if program == "sleap":
        head = "track,frame_idx,instance.score,nose.x,nose.y,nose.score"
        return "\n".join([head, *(f",{i},0.9,{1e3 * x},{1e3 * z},0.8" for i, (_, x, z) in enumerate(rows))])
    if program == "kinovea":
        lines = [f'"{1e3 * t:g}";"{x:.5f}";"{z:.5f}"'.replace(".", ",") for t, x, z in rows]
        return "\n".join(['"Time";"foot/1/X";"foot/1/Y"', *lines])
    return "\n".join(["t_s,x_m,z_m,rear_hip_deg", *(f"{t},{x},{z},{100 * x}" for t, x, z in rows)])


PROGRAMS = ("tracker", "tracker-comma", "deeplabcut", "sleap", "kinovea", "plain")


@cache
def finished_run(seed: int = 1) -> dict[str, bytes]:
    """Return the files of a brief run, without its report."""
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "run"
        folder = RunFolder.create(path, problem(), Request(seed=seed, budget=6, warm_start=False))
        with folder:
            found = optimise(problem(), Request(seed=seed, budget=6, warm_start=False),
                             Journal(folder.journal, problem()), SerialExecutor())  # fmt: skip
            folder.write_results(problem(), found)
        return contents(path)


def strider_in(folder: Path, name: str = "robot") -> Path:
    shutil.copytree(STRIDER, folder / name)
    return folder / name


# --- the kinds --------------------------------------------------------------------------------


def commands_on(rng: random.Random, reference: str, gait: str = "stride") -> list[str]:
    """Return one of the brief commands on a problem."""
    return rng.choice(
        [
            ["model", reference, "--out", "out.xml"],
            ["effects", reference, "--json"],
            ["command", reference, gait, "--dt", "0.05", "--duration", "1", "--out", "out.csv"],
            ["simulate", reference, gait, "--csv", "out.csv", "--json"],
            ["simulate", reference, gait],
        ]
    )


def problem_text(rng: random.Random, folder: Path) -> Case:
    path = strider_in(folder) / "problem.toml"
    path.write_bytes(broken(rng, path.read_bytes()))
    return Case(commands_on(rng, "robot"))


def problem_content(rng: random.Random, folder: Path) -> Case:
    path = strider_in(folder) / "problem.toml"
    path.write_text(tomli_w.dumps(changed(rng, tomllib.loads(path.read_text()))), encoding="utf-8")
    return Case(commands_on(rng, "robot"))


def mjcf_text(rng: random.Random, folder: Path) -> Case:
    path = strider_in(folder) / "strider.xml"
    path.write_bytes(broken(rng, path.read_bytes()))
    return Case(rng.choice([commands_on(rng, "robot"), ["new", "bot", "--mjcf", str(path), "--out", "out"]]))


def mjcf_content(rng: random.Random, folder: Path) -> Case:
    path = strider_in(folder) / "strider.xml"
    (path.parent / "parts").write_bytes(broken(rng, b'<mujocoinclude><site name="more"/></mujocoinclude>'))
    (path.parent / "wedge.obj").write_bytes(broken(rng, b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\n"))
    root = changed_xml(rng, ET.parse(path).getroot())
    # What is no XML is another kind's; what is left out here cannot be written as XML.
    text = re.sub(r"[\x00-\x08\x0b\x0c\x0e-\x1f]", "", ET.tostring(root, encoding="unicode"))
    path.write_text(text, encoding="utf-8")
    return Case(rng.choice([commands_on(rng, "robot"), ["new", "bot", "--mjcf", str(path), "--out", "out"]]))


def gait_file(rng: random.Random, folder: Path) -> Case:
    gait = gait_of(rng)
    if rng.random() < 0.5:
        data = broken(rng, gait.to_toml().encode())
    else:
        data = tomli_w.dumps(changed(rng, tomllib.loads(gait.to_toml()))).encode()
    (folder / "gait.toml").write_bytes(data)
    exporting = [
        "export",
        str(STRIDER),
        "gait.toml",
        "--format",
        rng.choice(["c", "json", "csv"]),
        "--out",
        "out",
    ]
    chosen = (
        [exporting, [*exporting, "--clip"]]
        if rng.random() < 0.15
        else [commands_on(rng, str(STRIDER), "gait.toml")]
    )
    return Case(rng.choice(chosen))


def gait_round_trip(rng: random.Random, folder: Path) -> Case:
    gait = gait_of(rng)
    text = table_text(gait, rng.choice(list(FORMATS)))
    (folder / "table").write_text(text, encoding="utf-8")

    def check() -> None:
        back = read_table(folder / "table")
        assert back.gait == gait
        assert back == table_of(gait)

    return Case(call=check)


def exported_table(rng: random.Random, folder: Path) -> Case:
    text = table_text(gait_of(rng), rng.choice(list(FORMATS)))
    (folder / "table.h").write_bytes(broken(rng, text.encode()))
    if rng.random() < 0.5:
        return Case(call=lambda: read_table(folder / "table.h"))
    return Case(commands_on(rng, str(STRIDER), "table.h"))


def importer(rng: random.Random, folder: Path) -> Case:
    name = rng.choice(
        [
            "walk.txt",
            "walk.csv",
            "a b.csv",
            "naïve 机.csv",
            "q'uo\"te.csv",
            "new\nline.csv",
            "-x.csv",
            "\udcff.csv",
        ]
    )
    (folder / name).write_bytes(broken(rng, export_of(rng, rng.choice(PROGRAMS)).encode()))
    arguments = [
        "import",
        f"./{name}",
        "--gait",
        rng.choice(["stride", "square", rng.choice(NAMES[:4])]),
        "--out",
        "out",
    ]
    for option, values in {
        "--fps": ["25", "30", "0", "-1", "nan", "1e308", "5e-324"],
        "--scale-m-per-px": ["0.001", "0", "1e308", "nan", "5e-324"],
        "--time-unit": ["s", "ms", "min"],
        "--length-unit": ["mm", "m", "px"],
        "--view": ["side", "top", "front"],
        "--marker": ["nose", "foot/1", "mass_A", "A", "x"],
        "--sync-at": ["0.5", "nan", "1e308", "-1"],
    }.items():
        if rng.random() < (0.7 if option in ("--fps", "--scale-m-per-px") else 0.15):
            usual = values[0] if rng.random() < 0.7 else rng.choice(values)
            arguments.append(f"{option}={usual}")
    return Case([*arguments, *rng.choice([[], ["--json"]])])


def data_set(rng: random.Random, folder: Path) -> Case:
    rows = ["t_s,x_m,z_m,rear_hip_deg"]
    rows += [
        f"{0.05 * i},{0.01 * i},{0.002 * (i % 3)},{10.0 * (i % 5)}" for i in range(rng.choice([3, 30, 60]))
    ]
    entry = {
        "name": "walk",
        "gait": rng.choice(["stride", "square", "gait.toml"]),
        "file": "walk.csv",
        "starts_at_gait_time_s": 0.0,
        "noise_m": 0.001,
        "fps": 20,
        "signals": {"marker.y": "x_m", "marker.z": "z_m", "joint.rear_hip": "rear_hip_deg"},
    }
    content: dict[str, Any] = {"trial": [entry]}
    data, table, gait = (
        tomli_w.dumps(content).encode(),
        "\n".join(rows).encode(),
        gait_of(rng).to_toml().encode(),
    )
    what = rng.randrange(4)
    if what == 0:
        data = broken(rng, data)
    elif what == 1:
        data = tomli_w.dumps(changed(rng, content)).encode()
    elif what == 2:
        table = broken(rng, table)
    else:
        gait, table = broken(rng, gait), broken(rng, table)
    (folder / "set").mkdir()
    for name, text in {"dataset.toml": data, "walk.csv": table, "gait.toml": gait}.items():
        (folder / "set" / name).write_bytes(text)
    known = ["marker.x", "marker.y", "marker.z", "joint.rear_hip", "joint.front_hip"]

    def read() -> None:
        for trial in load_dataset(folder / "set", problem(), known).trials:
            clean(trial, trial.period)

    return Case(call=read)


def run_folder(rng: random.Random, folder: Path) -> Case:
    """A finished run, something in it broken: looked at, walked, or asked to go on."""
    run = folder / "run"
    for name, data in finished_run().items():
        path = run / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    victim = rng.choice(
        ["best.toml", "summary.json", "run.toml", "problem.toml", "model.xml", "evaluations.csv"]
    )
    path = run / victim
    data = path.read_bytes()
    if victim.endswith(".toml") and rng.random() < 0.5:
        data = tomli_w.dumps(changed(rng, tomllib.loads(data.decode()))).encode()
    else:
        data = broken(rng, data)
    path.write_bytes(data)
    if rng.random() < 0.05:
        path.unlink()
    resume = ["optimise", "run", "--resume", "run", *rng.choice([[], ["--json"], ["--seed", "1"]])]
    if victim == "summary.json" and not path.exists():
        resume = ["simulate", "run", "run"]
    return Case(
        rng.choice([resume, resume, commands_on(rng, "run", "run"), commands_on(rng, str(STRIDER), "run")])
    )


def journal(rng: random.Random, folder: Path) -> Case:
    """A journal, torn or edited: replayed whole, or refused in one line."""
    path = folder / "evaluations.csv"
    data = finished_run()["evaluations.csv"]
    if rng.random() < 0.5:
        data = broken(rng, data)
    else:
        rows = list(csv.reader(io.StringIO(data.decode())))
        row = rng.choice(rows)
        row[rng.randrange(len(row))] = rng.choice([*NUMBERS, *NAMES])
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(rows)
        data = text.getvalue().encode()
    path.write_bytes(data)
    return Case(call=lambda: Journal(path, problem()), may_change=("evaluations.csv",))


def command_line(rng: random.Random, folder: Path) -> Case:
    """Any command with any values; what would start a long search is stopped by its folder."""
    (folder / "full").mkdir()
    (folder / "full" / "mine.txt").write_text("mine")
    (folder / "out.csv").write_text("mine")
    words = [
        *NUMBERS,
        *(name for name in NAMES if "\x00" not in name),
        "\udcff.xml",
        str(STRIDER),
        "stride",
        "full",
    ]

    def word() -> str:
        return rng.choice(words)

    def text() -> str:
        return rng.choice([word(), word(), "stride"])

    robot = rng.choice([str(STRIDER), str(STRIDER), word()])
    dt = rng.choice(["0.1", "0.1", "nan", "-1", "0", "1e-300", "inf", "1e300", word()])
    number = rng.choice(["1", "4", "0", "-1", "1e400", "99999999999999999999", word()])
    made = rng.choice(
        [
            [
                "model",
                robot,
                "--out",
                rng.choice(["out.xml", "none/out.xml", "full", word()]),
                "--set",
                text(),
            ],
            [
                "model",
                robot,
                "--out",
                "out.xml",
                "--set",
                f"{rng.choice(['mass', 'k_servo', 'mu_rear'])}={word()}",
            ],
            ["effects", robot, "--set", f"mass={word()}"],
            [
                "command",
                robot,
                text(),
                f"--dt={dt}",
                f"--duration={rng.choice(['1', '1', word()])}",
                "--out=out.csv",
            ],
            [
                "simulate",
                robot,
                text(),
                rng.choice(["--json", f"--csv={word()}", "--seconds=1", f"--video={word()}"]),
            ],
            ["optimise", robot, "--out", "full", f"--budget={number}", f"--seed={number}"],
            ["optimise", robot, "--out", "full", f"--executor={word()}", f"--workers={number}"],
            ["optimise", robot, "--out", "full", f"--method={word()}"],
            ["optimise", robot, f"--resume={word()}", *rng.choice([[], ["--pareto"]])],
            ["compare", robot, text(), "--out", "full"],
            [
                "sweep",
                robot,
                "stride",
                f"--over={rng.choice(['period_s', 'mass', 'rear.duty', word()])}={word()},x",
            ],
            ["check", robot, "--out", "full"],
            ["diagnose", robot, word(), *rng.choice([[], [f"--effects={word()}"], [f"--resume={word()}"]])],
            ["blind", "make", robot, f"--cases={rng.choice(['0', '-1', 'x'])}", "--out", "out"],
            ["blind", "score", rng.choice(["full", "none", word()])],
            ["export", robot, text(), f"--format={word()}", "--out", "out"],
            ["export", robot, text(), "--format=c", "--out", "full"],
            [
                "export",
                robot,
                "stride",
                "--format=json",
                "--out=out",
                rng.choice([f"--slew={word()}", f"--samples={number}", f"--led-pin={number}"]),
            ],
            ["import", text(), "--gait", text(), "--out", rng.choice(["out", "full"])],
            [
                "new",
                word(),
                "--mjcf",
                rng.choice([str(STRIDER / "strider.xml"), word()]),
                "--out",
                rng.choice(["out", "full"]),
            ],
            ["completion", word()],
            [word() for _ in range(rng.randrange(1, 5))],
        ]
    )
    if rng.random() < 0.3:
        free = [i for i, said in enumerate(made) if said != "full" and "--out" not in said]
        made[rng.choice(free)] = word()
    if made[0] in ("demo", "plan") or any(w.startswith("--h") or w == "-h" for w in made):
        made = ["effects", *made[1:]]
    mine = ("out.csv",) if "command" in made[:1] or "simulate" in made[:1] else ()
    return Case(made, may_change=(*mine,))


def written_over(rng: random.Random, folder: Path) -> Case:
    """A file of the user's stands where the answer goes: replaced whole, or left alone."""
    (folder / "out.csv").write_text("mine")
    (folder / "out.xml").write_text("mine")
    path = strider_in(folder) / "problem.toml"
    path.write_bytes(broken(rng, path.read_bytes()))
    write_text(folder / "gait.toml", gait_of(rng).to_toml())
    return Case(
        commands_on(rng, "robot", rng.choice(["stride", "gait.toml"])), may_change=("out.csv", "out.xml")
    )


# --- whole runs -------------------------------------------------------------------------------


def tiny(folder: Path) -> Path:
    """Copy the strider with a horizon of a cycle, and three baselines of which one stands still."""
    path = strider_in(folder) / "problem.toml"
    content = tomllib.loads(path.read_text())
    content["simulation"]["horizon"] = {"transient_s": 0.0, "transient_cycles": 0, "measured_s": 0.1}
    content["simulation"]["horizon"]["measured_cycles"] = 1
    content["simulation"]["reference"] = content["simulation"]["working"]
    content["scenarios"]["verification"] = 2
    path.write_text(tomli_w.dumps(content))
    return path.parent


def spoilt(rng: random.Random, folder: Path) -> Path:
    """Return a tiny robot with something wrong in its files, or something unusual, or nothing."""
    robot = tiny(folder)
    victim = robot / rng.choice(["problem.toml", "problem.toml", "strider.xml"])
    how = rng.random()
    if how < 0.5:
        victim.write_bytes(nudged(rng, victim.read_bytes()))
    elif how < 0.7 and victim.suffix == ".toml":
        content = changed(rng, tomllib.loads(victim.read_text()))
        victim.write_text(tomli_w.dumps(content), encoding="utf-8")
    elif how < 0.7:
        root = changed_xml(rng, ET.parse(victim).getroot())
        text = re.sub(r"[\x00-\x08\x0b\x0c\x0e-\x1f]", "", ET.tostring(root, encoding="unicode"))
        victim.write_text(text, encoding="utf-8")
    elif how < 0.85:
        victim.write_bytes(broken(rng, victim.read_bytes()))
    return robot


def whole(*arguments: object, may_change: tuple[str, ...] = ()) -> Case:
    """Return a whole run, without its progress, in one thread so that the limit on its time holds."""
    words = [str(argument) for argument in arguments]
    return Case([*words, "--json", "--workers", "1"], may_change=may_change, limit_s=WHOLE_LIMIT_S)


def a_gait(rng: random.Random, folder: Path) -> str:
    """Return a baseline's name, or a gait file that is whole or broken."""
    data = gait_of(rng).to_toml().encode()
    (folder / "gait.toml").write_bytes(
        rng.choice([bytes, lambda d: nudged(rng, d), lambda d: broken(rng, d)])(data)
    )
    return rng.choice(["stride", "square", "gait.toml", "gait.toml"])


def optimise_whole(rng: random.Random, folder: Path) -> Case:
    """A search; what an interrupted one would leave may stay where it fails."""
    robot = spoilt(rng, folder)
    options = rng.choice(
        [[], [], ["--pareto"], ["--method", "cma-es"], ["--method", "nelder-mead"], ["--seed", "7"]]
    )
    if rng.random() < 0.3:
        options = [*options, "--no-warm-start"]
    budget = rng.choice([1, 2, 3, 5])
    return whole(
        "optimise", robot, "--budget", budget, "--out", "out", "--quiet", *options, may_change=("out",)
    )


def resume_whole(rng: random.Random, folder: Path) -> Case:
    """An unfinished run, something in it changed, that is to go on."""
    run = folder / "run"
    for name, data in finished_run().items():
        if name != "summary.json":
            (run / name).parent.mkdir(parents=True, exist_ok=True)
            (run / name).write_bytes(data)
    victim = run / rng.choice(["run.toml", "problem.toml", "model.xml", "evaluations.csv", "evaluations.csv"])
    data = victim.read_bytes()
    if victim.suffix == ".csv" and rng.random() < 0.5:
        data = b"".join(data.splitlines(keepends=True)[: rng.randrange(8)])
    else:
        data = rng.choice([nudged, broken])(rng, data)
    victim.write_bytes(data)
    return whole("optimise", "run", "--resume", "run", "--quiet", may_change=("run",))


def check_whole(rng: random.Random, folder: Path) -> Case:
    return whole("check", spoilt(rng, folder), *rng.choice([[], ["--out", "out"]]))


def compare_whole(rng: random.Random, folder: Path) -> Case:
    gaits = ["stride", a_gait(rng, folder)]
    return whole("compare", spoilt(rng, folder), *gaits, *rng.choice([[], ["--out", "out"]]))


def sweep_whole(rng: random.Random, folder: Path) -> Case:
    name, usual = rng.choice(
        [
            ("period_s", 0.5),
            ("mass", 0.03),
            ("mu_rear", 1.0),
            ("k_servo", 0.5),
            ("rear.duty", 0.5),
            ("front.phase", 0.3),
        ]
    )
    values = [
        usual * rng.choice([1.0, 0.5, 2.0, 0.9, 1e-3, 1e3, 0.0, -1.0]) for _ in range(rng.choice([1, 2, 3]))
    ]
    over = f"--over={name}={','.join(map(repr, values))}"
    return whole("sweep", spoilt(rng, folder), a_gait(rng, folder), over, "--out", "out")


@cache
def walked() -> dict[str, list[float]]:
    """Return what a camera sees of a strider with weak servos."""
    weak = Simulator.build(problem().with_effects({"servo_gain": {"scale": 0.5}}))
    seen = weak.run(problem().baselines["stride"], duration=1.6)
    names = {"t_s": seen.time, "x_m": seen["marker.y"], "z_m": seen["marker.z"]}
    return {name: column[::20].tolist() for name, column in names.items()}


def diagnose_whole(rng: random.Random, folder: Path) -> Case:
    robot, columns = spoilt(rng, folder), walked()
    rows = [",".join(columns), *(",".join(map(repr, row)) for row in zip(*columns.values(), strict=True))]
    signals = {"marker.y": "x_m", "marker.z": "z_m"}
    trials = [
        {
            "name": name,
            "gait": rng.choice(["stride", "stride", "gait.toml"]),
            "file": "walk.csv",
            "signals": signals,
        }
        | rng.choice([{}, {"starts_at_gait_time_s": 0.0}, {"noise_m": 0.001, "fps": 25}])
        for name in ("one", "other")[: rng.choice([1, 2])]
    ]
    files = {
        "dataset.toml": tomli_w.dumps({"trial": trials}).encode(),
        "walk.csv": "\n".join(rows).encode() + b"\n",
        "gait.toml": problem().baselines["square"].to_toml().encode(),
    }
    victim = rng.choice([*files, ""])
    for name, data in files.items():
        path = folder / "set" / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(rng.choice([nudged, nudged, broken])(rng, data) if name == victim else data)
    effects = rng.choice(["servo_gain", "servo_trim", "pad_friction", "clock_rate"])
    asked = ["--effects", effects, "--out", "out", "--quiet"]
    return whole("diagnose", robot, "set", *asked, may_change=("out",))


KINDS: dict[str, tuple[int, Callable[[random.Random, Path], Case]]] = {
    "problem file, text": (10, problem_text),
    "problem file, values": (14, problem_content),
    "MJCF, text": (8, mjcf_text),
    "MJCF, elements": (12, mjcf_content),
    "gait file": (10, gait_file),
    "gait through a table and back": (4, gait_round_trip),
    "exported table": (10, exported_table),
    "tracker export": (14, importer),
    "data set": (10, data_set),
    "run folder": (8, run_folder),
    "journal": (8, journal),
    "command line": (14, command_line),
    "over a user's file": (4, written_over),
}
"""Each kind of input with its share of the cases."""

WHOLE: dict[str, tuple[int, Callable[[random.Random, Path], Case]]] = {
    "optimise, whole": (1, optimise_whole),
    "optimise, resumed": (1, resume_whole),
    "check, whole": (1, check_whole),
    "compare, whole": (1, compare_whole),
    "sweep, whole": (1, sweep_whole),
    "diagnose, whole": (1, diagnose_whole),
}
"""Whole runs, each a second or some."""

KINDS |= WHOLE


def make(seed: int, kind: str, number: int, folder: Path) -> Case:
    """Make one case in an empty folder; the same seed, kind and number make the same one."""
    return KINDS[kind][1](random.Random(f"{seed}/{kind}/{number}"), folder)
