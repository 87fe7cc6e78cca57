"""Safe reading of an MJCF: its includes and the files that it names, all from its own folder."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import mujoco

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.files import inside, read_bytes, read_text

_FILE_KEYS = ("file", *(f"file{side}" for side in ("right", "left", "up", "down", "front", "back")))
"""Attributes of MJCF elements that name a file; the sides are a cube texture's."""

_PLACES = ("pos", "size", "fromto", "axis", "quat", "euler", "axisangle", "xyaxes", "zaxis", "vertex")
"""Attributes of MJCF elements that say where something is, and how large."""

LARGEST = 1e10
"""Numbers beyond this are refused: MuJoCo itself calls them bad in a robot's state."""

MAX_DEPTH = 200
"""Elements nested deeper than this are refused."""


def read_mjcf(path: Path) -> tuple[ET.Element, list[Path]]:
    """Return an MJCF with its includes resolved, and the files included, all from its own folder.

    Raises:
        GaitoptError: a file is missing or broken, lies outside the folder, or is included twice.
    """
    root, included = parse_mjcf(path, read_text(path)), [path]
    _resolve_includes(root, path.parent, included)
    return root, included[1:]


def parse_mjcf(path: Path, text: str, roots: Sequence[str] = ("mujoco",)) -> ET.Element:
    """Return the root element of an MJCF's text.

    Args:
        path: where the text comes from, for messages.
        text: the MJCF.
        roots: the root elements allowed.

    Raises:
        GaitoptError: the text is broken XML, has a document type or another root, or is nested too deep.
    """
    if "<!DOCTYPE" in text:  # its entities can expand without limit, and MuJoCo reads them differently
        raise GaitoptError(f"{path}: found a <!DOCTYPE>; allowed: elements and comments")
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise GaitoptError(f"{path}: broken XML: {error}") from None
    if root.tag not in roots:
        raise bad_value(path, "root element", root.tag, " or ".join(roots))
    level, depth = list(root), 0
    while level:
        level, depth = [child for element in level for child in element], depth + 1
        if depth > MAX_DEPTH:
            raise GaitoptError(f"{path}: elements nested more than {MAX_DEPTH} deep")
    return root


def _resolve_includes(element: ET.Element, folder: Path, included: list[Path]) -> None:
    """Replace each include by the children of its file, which must lie in the problem's own folder."""
    for index, child in reversed(list(enumerate(element))):
        if child.tag == "include":
            name = child.get("file", "")
            path = inside(folder, name)
            if not name or path is None:
                raise bad_value(folder, "include file", name, "a file inside the problem's folder")
            if path.resolve() in [known.resolve() for known in included]:  # as MuJoCo has it
                raise GaitoptError(f"{folder}: include file: {name} is included twice")
            included.append(path)
            content = parse_mjcf(path, read_text(path), ("mujocoinclude", "mujoco"))
            _resolve_includes(content, folder, included)
            element.remove(child)
            for offset, grandchild in enumerate(content):
                element.insert(index + offset, grandchild)
        else:
            _resolve_includes(child, folder, included)


def compile_mjcf(root: ET.Element, path: Path, assets: Mapping[str, bytes]) -> mujoco.MjModel:
    """Return the model of an MJCF, given every file that it names.

    Raises:
        GaitoptError: MuJoCo refuses it, or a length or position in it is beyond `LARGEST`.
    """
    for element in root.iter():
        for key in _PLACES:
            if not all(abs(number) <= LARGEST for number in _numbers(element.get(key, ""))):
                raise bad_value(path, f"{element.tag} {key}", element.get(key), f"at most {LARGEST:g}")
    try:
        return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"), dict(assets))
    except ValueError as error:
        raise GaitoptError(f"{path}: {error}") from None


def _numbers(text: str) -> list[float]:
    """Return the numbers in a text, or none where a word is no number: MuJoCo reports that."""
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return []


def named_files(
    root: ET.Element, mjcf: Path, carried: Mapping[str, bytes] | None = None
) -> dict[str, tuple[Path, bytes]]:
    """Return path and content of the files that an MJCF names, by the name that MuJoCo asks for.

    All must lie in its own folder. MuJoCo itself would read any other file that is not given to it here.

    Args:
        root: the MJCF, its includes resolved.
        mjcf: where it lies.
        carried: the files by path from its folder, where they are not read from the disk.

    Raises:
        GaitoptError: a file is missing, or lies outside the folder.
    """
    folder, places = mjcf.parent, _asset_folders(root, mjcf)
    assets = {}
    for element, key, name in _names_of_files(root):
        place = places.get(element.tag, places["mesh"])
        path = inside(folder, f"{place}{name}")
        if path is None or Path(name).is_absolute():
            data = None
        elif carried is not None:
            data = carried.get(path_from(folder, path))
        else:
            data = read_bytes(path) if path.is_file() else None
        if path is None or data is None:
            raise bad_value(mjcf, f"{element.tag} {key}", name, "a file in the problem's folder")
        assets[f"{place}{name}"] = path, _alone(path, data) if element.tag == "model" else data
    return assets


def _names_of_files(root: ET.Element) -> Iterator[tuple[ET.Element, str, str]]:
    """Yield each attribute that names a file: its element, its key and the name."""
    for element in root.iter():
        for key, name in element.attrib.items():
            if key in _FILE_KEYS:
                yield element, key, name


def _asset_folders(root: ET.Element, mjcf: Path) -> dict[str, str]:
    """Return what MuJoCo puts before the names of files, by the element that names one."""
    folders = {"meshdir": "", "texturedir": ""}
    for compiler in root.findall("compiler"):
        if compiler.get("strippath", "false") != "false":
            raise bad_value(mjcf, "compiler strippath", "true", "false: files go by their whole path")
        for key in folders:
            folders[key] = compiler.get(key, compiler.get("assetdir", folders[key]))
    mesh, texture = (f"{name.rstrip('/')}/" if name else "" for name in folders.values())
    return {"mesh": mesh, "texture": texture, "model": ""}


def _alone(path: Path, data: bytes) -> bytes:
    """Return a model that an MJCF attaches. It may name no files, because MuJoCo would read them itself."""
    try:
        root = parse_mjcf(path, data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise GaitoptError(f"{path}: not UTF-8 text") from None
    named = [name for _, _, name in _names_of_files(root)]
    if named:
        raise bad_value(path, "file", named[0], "a model to attach that names no files")
    return ET.tostring(root)


def path_from(folder: Path, path: Path) -> str:
    """Return the path of a file from a folder, with forward slashes."""
    return Path(os.path.relpath(path, folder)).as_posix()
