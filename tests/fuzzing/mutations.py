"""Ways to break a file: its bytes, its text, its values, its elements."""

from __future__ import annotations

import copy
import random
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from typing import Any

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
"""Names that could end a comment, string, path or table cell, or control a terminal."""

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


def broken(rng: random.Random, data: bytes) -> bytes:
    """Return a file with one to four errors, sometimes with none."""
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
