"""Safe reading of an MJCF: its includes and the files that it names, all from its own folder."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import mujoco

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.files import LARGEST_TEXT, MIB, inside, read_bytes, read_text
from gaitopt.problem.limits import MAX_DEPTH, check_depth, check_limits

_FILE_KEYS = ("file", *(f"file{side}" for side in ("right", "left", "up", "down", "front", "back")))
"""Attributes of MJCF elements that name a file; the sides are a cube texture's."""

LARGEST_ASSET = 64 * MIB
"""A larger mesh, picture or attached model is refused, bytes; MuJoCo itself takes at most 10 MB of STL."""

MOST_INCLUDES = 200
"""Files that an MJCF may include."""


def read_mjcf(path: Path) -> tuple[ET.Element, list[Path]]:
    """Return an MJCF with its includes resolved, and the files included, all from its own folder.

    Raises:
        GaitoptError: a file is missing, broken or too large, lies outside the folder, or is included twice.
    """
    root, included = parse_mjcf(path, read_text(path, LARGEST_TEXT)), [path]
    _resolve_includes(root, path.parent, included, 0)
    check_depth(root, path)
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
    except (ET.ParseError, ValueError) as error:
        raise GaitoptError(f"{path}: broken XML: {error}") from None
    if root.tag not in roots:
        raise bad_value(path, "root element", root.tag, " or ".join(roots))
    check_depth(root, path)
    return root


def _resolve_includes(element: ET.Element, folder: Path, included: list[Path], depth: int) -> None:
    """Replace each include by the children of its file, which must lie in the problem's own folder."""
    if depth > MAX_DEPTH:
        raise GaitoptError(f"{folder}: elements and includes nested more than {MAX_DEPTH} deep")
    for index, child in reversed(list(enumerate(element))):
        if child.tag == "include":
            content = _included(child.get("file", ""), folder, included)
            _resolve_includes(content, folder, included, depth + 1)
            element.remove(child)
            for offset, grandchild in enumerate(content):
                element.insert(index + offset, grandchild)
        else:
            _resolve_includes(child, folder, included, depth + 1)


def _included(name: str, folder: Path, included: list[Path]) -> ET.Element:
    """Return the root element of a file that is included, and note its path."""
    path = inside(folder, name)
    if not name or path is None:
        raise bad_value(folder, "include file", name, "a file inside the problem's folder")
    if path.resolve() in [known.resolve() for known in included]:  # as MuJoCo has it
        raise GaitoptError(f"{folder}: include file: {name} is included twice")
    if len(included) > MOST_INCLUDES:
        raise GaitoptError(f"{folder}: found more than {MOST_INCLUDES} includes; allowed: {MOST_INCLUDES}")
    included.append(path)
    return parse_mjcf(path, read_text(path, LARGEST_TEXT), ("mujocoinclude", "mujoco"))


def compile_mjcf(root: ET.Element, path: Path, assets: Mapping[str, bytes]) -> mujoco.MjModel:
    """Return the model of an MJCF, given every file that it names.

    Raises:
        GaitoptError: MuJoCo refuses it, or it does not pass `checked_text`.
    """
    text = checked_text(root, path, assets)
    with _refusals(path):
        return mujoco.MjModel.from_xml_string(text, dict(assets))


def spec_of(root: ET.Element, path: Path, assets: Mapping[str, bytes]) -> mujoco.MjSpec:
    """Return an MJCF as MuJoCo edits it, given every file that it names.

    Raises:
        GaitoptError: MuJoCo refuses it, or it does not pass `checked_text`.
    """
    text = checked_text(root, path, assets)
    with _refusals(path):
        return mujoco.MjSpec.from_string(text, assets=dict(assets))


def checked_text(root: ET.Element, path: Path, assets: Mapping[str, bytes]) -> str:
    """Return the text of an MJCF as MuJoCo gets it, after the text itself was parsed and checked as a whole.

    So it does not matter how the MJCF was edited before: MuJoCo reads no file that is not given to it, and
    nothing without end.

    Args:
        root: the MJCF, its includes resolved.
        path: where it lies, for messages.
        assets: content of the files that it names, by the name that MuJoCo asks for.

    Raises:
        GaitoptError: the text has a document type or an include, names a file that is not given, or a number
            in it is too large (see `limits.check_limits`).
    """
    check_depth(root, path)
    text = ET.tostring(root, encoding="unicode")
    parsed = parse_mjcf(path, text)
    if parsed.find(".//include") is not None:
        raise GaitoptError(f"{path}: found an <include> in what MuJoCo is to read; allowed: none")
    folders = _asset_folders(parsed, path)
    for element, key, name in names_of_files(parsed):
        if _asset_name(element, name, folders) not in assets:
            raise bad_value(path, f"{element.tag} {key}", name, "a file in the problem's folder")
    check_limits(parsed, path, assets)
    return text


@contextmanager
def _refusals(path: Path) -> Iterator[None]:
    """Turn what MuJoCo raises into an error of the file."""
    try:
        yield
    except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
        raise GaitoptError(f"{path}: {error or 'too little memory'}") from None


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
    for element, key, name in names_of_files(root):
        asked = _asset_name(element, name, places)
        path = inside(folder, asked)
        if path is None or Path(name).is_absolute():
            data = None
        elif carried is not None:
            data = carried.get(path_from(folder, path))
        else:
            data = read_bytes(path, LARGEST_ASSET) if path.is_file() else None
        if path is None or data is None:
            missing = "an existing file" if path is not None else "a file"
            raise bad_value(mjcf, f"{element.tag} {key}", name, f"{missing} in the problem's folder")
        assets[asked] = path, _alone(path, data) if element.tag == "model" else data
    return assets


def missing_meshes(root: ET.Element, mjcf: Path) -> dict[str, ET.Element]:
    """Return the meshes of an MJCF whose files should lie in its folder but do not, by path from there."""
    found, places = {}, _asset_folders(root, mjcf)
    for mesh in root.findall("asset/mesh"):
        asked = _asset_name(mesh, mesh.get("file", ""), places)
        path = inside(mjcf.parent, asked) if mesh.get("file") else None
        if path is not None and not path.exists():
            found[asked] = mesh
    return found


def _asset_name(element: ET.Element, name: str, folders: Mapping[str, str]) -> str:
    """Return the name by which MuJoCo asks for a file that an element names."""
    return f"{folders.get(element.tag, folders['mesh'])}{name}"


def names_of_files(root: ET.Element) -> Iterator[tuple[ET.Element, str, str]]:
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
    named = [name for _, _, name in names_of_files(root)]
    if named:
        raise bad_value(path, "file", named[0], "a model to attach that names no files")
    return ET.tostring(root)


def path_from(folder: Path, path: Path) -> str:
    """Return the path of a file from a folder, with forward slashes."""
    return Path(os.path.relpath(path, folder)).as_posix()
