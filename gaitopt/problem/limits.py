"""Bounds on the numbers of an MJCF, checked before MuJoCo sees it: compiling it ends and fits into memory.

A child process with limits of memory and time would also cover attributes of later MuJoCo versions. But it
takes 0.25 s of processor time for each model, and a whole `gaitopt simulate` takes 0.7 s. Its time limit
would also make the outcome depend on the machine. So the numbers are checked, and a test fails if MuJoCo has
an attribute that was not considered here.
"""

from __future__ import annotations

import math
import re
import struct
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from pathlib import Path

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.files import MIB

LARGEST = 1e10
"""Numbers beyond this are refused: MuJoCo itself calls them bad in a robot's state."""

MAX_DEPTH = 200
"""Elements nested deeper than this are refused."""

MOST_ELEMENTS = 5000
"""Elements of a model, after its replicates and attached models are written out. A robot has hundreds."""

MOST_PIXELS = 2**25
"""Pixels of all textures, and cells of all height fields: two pictures of 4096 x 4096."""

MOST_ASSET_BYTES = 256 * MIB
"""Bytes of all files that a model names."""

MOST_RANGE_STEPS = 1_000_000
"""Steps in which MuJoCo measures the ranges of actuators' lengths while it compiles; 1000 each by default."""

_PLACES = ("pos", "size", "fromto", "axis", "quat", "euler", "axisangle", "xyaxes", "zaxis", "vertex")
"""Attributes that say where something is, and how large."""

COUNTS: Mapping[str, int] = {
    "count": MOST_ELEMENTS,
    "cellcount": MOST_ELEMENTS,
    "nkey": 1000,
    "nuserdata": 100_000,
    **{
        f"nuser_{kind}": 100
        for kind in ("actuator", "body", "cam", "geom", "jnt", "sensor", "site", "tendon")
    },
    "nstack": 10**8,
    "njmax": 10_000,
    "nconmax": 10_000,
    "nrow": 8192,
    "ncol": 8192,
    "height": 8192,
    "nchannel": 4,
    "dim": 1000,
    "num": 100,
    "nsample": 1000,
    "actdim": 10,
    "resolution": 2**24,
    "iterations": 1000,
    "ls_iterations": 1000,
    "noslip_iterations": 1000,
    "ccd_iterations": 1000,
    "sdf_iterations": 1000,
    "sdf_initpoints": 1000,
    "offwidth": 8192,
    "offheight": 8192,
    "shadowsize": 16384,
    "offsamples": 64,
    "numslices": 1000,
    "numstacks": 1000,
    "numquads": 1000,
}
"""Attributes that say how many of something there are, and the largest product of their numbers."""

_WEIGHTS = {"mesh": 100, "tactile": 1000}
"""Elements that a built-in mesh, and a sensor with values for each of a mesh's vertices, count for."""

_LARGEST_PARAMETER = 360.0
"""Largest number among the parameters of a built-in mesh: a resolution, or an angle in degrees."""

_MEMORY = {"": 1, "k": 2**10, "m": 2**20, "g": 2**30}
_LARGEST_MEMORY = 2**30

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", re.ASCII | re.IGNORECASE)

_PNG = b"\x89PNG\r\n\x1a\n"

_BYTES_PER_POINT = 30
"""Bytes of a mesh's file for each point of a `flexcomp` made of it."""


def check_limits(root: ET.Element, path: Path, assets: Mapping[str, bytes]) -> None:
    """Check the numbers of an MJCF.

    Args:
        root: the MJCF, its includes resolved.
        path: its path, for messages.
        assets: the files that it names, by the name that MuJoCo asks for.

    Raises:
        GaitoptError: it is nested too deep, has too many elements, or a number in it is too large.
    """
    check_depth(root, path)
    attached = {name: ET.fromstring(assets[name]) for name in _attached_files(root) if name in assets}
    for tree in (root, *attached.values()):
        check_depth(tree, path)
        _check_numbers(tree, path)
    counter = _Counter(path, root, attached, assets)
    counter.count(root)
    _check_sums([root, *attached.values()], path, assets, counter)


def check_depth(root: ET.Element, path: Path) -> None:
    """Check that elements are not nested too deep.

    Raises:
        GaitoptError: they are.
    """
    level, depth = list(root), 0
    while level:
        level, depth = [child for element in level for child in element], depth + 1
        if depth > MAX_DEPTH:
            raise GaitoptError(f"{path}: elements nested more than {MAX_DEPTH} deep")


def _attached_files(root: ET.Element) -> list[str]:
    return [str(model.get("file")) for model in root.iter("model") if model.get("file")]


def _check_numbers(root: ET.Element, path: Path) -> None:
    """Check each attribute by itself."""
    for element in root.iter():
        for key, text in element.attrib.items():
            if key in _PLACES and not all(abs(number) <= LARGEST for number in _floats(text)):
                raise bad_value(path, f"{element.tag} {key}", text, f"at most {LARGEST:g}")
            most = COUNTS.get(key, LARGEST if (element.tag, key) == ("texture", "width") else None)
            if most is not None and not _product(text) <= most:
                raise bad_value(
                    path, f"{element.tag} {key}", text, f"numbers whose product is at most {most:g}"
                )
        if not all(abs(n) <= _LARGEST_PARAMETER for n in _floats(element.get("params", ""))):
            raise bad_value(path, f"{element.tag} params", element.get("params"), "numbers up to 360")
        if element.tag == "size" and not _memory(element.get("memory", "")) <= _LARGEST_MEMORY:
            raise bad_value(path, "size memory", element.get("memory"), "at most 1G")


def _floats(text: str) -> list[float]:
    """Return the numbers in a text as MuJoCo reads them; it reports words that are none."""
    found = []
    for word in text.split():
        try:
            found.append(float.fromhex(word) if "x" in word.lower() else float(word))
        except ValueError:
            continue
        except OverflowError:
            found.append(math.inf)
    return found


def _product(text: str) -> float:
    """Return the product of the numbers in a text, those below 1 left out; inf where a word is no number."""
    words = text.split()
    if not all(_NUMBER.fullmatch(word) for word in words):
        return math.inf
    return math.prod(max(1.0, abs(float(word))) for word in words)


def _memory(text: str) -> float:
    """Return an amount of memory, bytes; -1 stands for MuJoCo's own choice."""
    found = re.fullmatch(r"\s*(-?\d{1,18})\s*([kmg]?)\s*", text.lower(), re.ASCII) if text else None
    return int(found[1]) * _MEMORY[found[2]] if found else math.inf if text else 0


class _Counter:
    """Counts the elements of an MJCF after replication, all together and by tag."""

    def __init__(
        self, path: Path, root: ET.Element, attached: Mapping[str, ET.Element], assets: Mapping[str, bytes]
    ):
        self.by_tag: dict[str, float] = {}
        self._path = path
        self._assets = assets
        self._total = 0.0
        names = {m.get("name", ""): str(m.get("file")) for m in root.iter("model")}
        self._models = {name: attached[file] for name, file in names.items() if file in attached}

    def count(self, element: ET.Element, times: float = 1.0, attached: bool = False) -> None:
        """Count an element that stands for `times`, and all inside it.

        Args:
            element: the element.
            times: how often it is replicated.
            attached: whether it is a part of an attached model, which attaches no further ones.
        """
        weight = times * self._weight(element)
        self._total += weight
        if not self._total <= MOST_ELEMENTS:
            raise GaitoptError(
                f"{self._path}: found more than {MOST_ELEMENTS} elements once replicated, points of "
                f"<flexcomp> included; allowed: at most {MOST_ELEMENTS}"
            )
        self.by_tag[element.tag] = self.by_tag.get(element.tag, 0.0) + times
        inner = times * _product(element.get("count", "1")) if element.tag == "replicate" else times
        for child in element:
            self.count(child, inner, attached)
        if element.tag == "attach" and not attached:
            named = self._models.get(element.get("model", ""))
            for model in self._models.values() if named is None else [named]:
                self.count(model, times, attached=True)

    def _weight(self, element: ET.Element) -> float:
        if element.tag == "flexcomp":
            points = len(element.get("point", "").split()) / 3
            data = max((len(self._assets[name]) for name in self._names(element)), default=0)
            cells = _product(element.get("cellcount", "1"))
            return max(_product(element.get("count", "1")), points, data / _BYTES_PER_POINT, cells)
        if element.tag == "mesh" and "builtin" not in element.attrib:
            return 1.0
        return float(_WEIGHTS.get(element.tag, 1))

    def _names(self, element: ET.Element) -> list[str]:
        file = element.get("file")
        return [name for name in self._assets if file and name.endswith(file)]


def _check_sums(
    trees: Iterable[ET.Element], path: Path, assets: Mapping[str, bytes], counter: _Counter
) -> None:
    """Check the total of elements that are allowed one by one: the largest of each, times their number."""
    trees = list(trees)
    count = counter.by_tag.get
    side = max(_largest(trees, "texture", "width"), _largest(trees, "texture", "height"))
    cells = _largest(trees, "hfield", "nrow") * _largest(trees, "hfield", "ncol")
    pixels = [_pixels(data) for data in assets.values()]
    drawn = count("texture", 0) * side**2 + count("hfield", 0) * cells + sum(pixels)
    if drawn > MOST_PIXELS:
        raise GaitoptError(
            f"{path}: found {drawn:.3g} pixels and cells of textures and height fields, as the largest times "
            f"how many; allowed: at most {MOST_PIXELS}"
        )
    rays = _largest(trees, "camera", "resolution") * sum(
        "camera" in sensor.attrib for tree in trees for sensor in tree.iter("rangefinder")
    )
    if rays > MOST_ELEMENTS:
        raise GaitoptError(
            f"{path}: found {rays:.3g} rays of cameras with rangefinders; allowed: at most {MOST_ELEMENTS}"
        )
    size = sum(map(len, assets.values()))
    if size > MOST_ASSET_BYTES:
        raise GaitoptError(
            f"{path}: its files have {size / MIB:.4g} MiB; allowed: at most {MOST_ASSET_BYTES / MIB:g} MiB"
        )
    actuators = sum(len(section) for tree in trees for section in tree.iter("actuator"))
    steps = actuators * _range_steps(trees)
    if not steps <= MOST_RANGE_STEPS:
        raise GaitoptError(
            f"{path}: compiler lengthrange: found inttotal / timestep x actuators = {steps:.3g}; "
            f"allowed: at most {MOST_RANGE_STEPS}"
        )


def _largest(trees: Iterable[ET.Element], tag: str, key: str) -> float:
    """Return the largest product of an attribute's numbers in all elements of a tag, defaults included."""
    return max((_product(e.get(key, "")) for tree in trees for e in tree.iter(tag)), default=1.0)


def _range_steps(trees: Iterable[ET.Element]) -> float:
    """Return the steps in which MuJoCo measures the range of an actuator's length."""
    most = 0.0
    for tree in trees:
        for element in tree.iter("lengthrange"):
            total = max(_floats(element.get("inttotal", "10")), default=10.0)
            step = min(_floats(element.get("timestep", "0.01")), default=0.01)
            most = max(most, total / step if step > 0.0 else math.inf)
    return most


def _pixels(data: bytes) -> int:
    """Return the pixels of a PNG picture, as its header says; 0 of another file."""
    if not data.startswith(_PNG) or len(data) < 24:
        return 0
    width, height = struct.unpack(">II", data[16:24])
    return int(width * height)
