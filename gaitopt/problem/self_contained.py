"""A model as one MJCF that names no other file: meshes and height fields are written into it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import PurePosixPath

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.problem.mjcf import names_of_files
from gaitopt.problem.model import compile_for, nominal_mjcf
from gaitopt.problem.problem import Problem

_TEXTURE_PX = 4
"""Edge of a plain texture, pixels."""


def self_contained_mjcf(problem: Problem) -> str:
    """Return the nominal model as one MJCF that needs no other file.

    Meshes are written as MuJoCo read them, in single precision. Textures, which only pictures show, become
    their mean colour.

    Raises:
        GaitoptError: the MJCF is missing, broken, or does not fit the problem, or it names a file that cannot
            be written into it, such as that of a skin.
    """
    text = nominal_mjcf(problem)
    root = ET.fromstring(text)
    named = list(names_of_files(root))
    if not named:
        return text
    model = compile_for(problem, root)
    for element, key, name in named:
        if element.tag not in _WRITERS:
            raise GaitoptError(
                f"{problem.model_path}: {element.tag} {key}: found {name}; a model in one file may name "
                f"files of {', '.join(_WRITERS)} only"
            )
        if key not in element.attrib:  # one of six sides of a texture, of which another was written
            continue
        if "name" not in element.attrib:
            element.set("name", PurePosixPath(name).stem)
        _WRITERS[element.tag](element, model)
    return ET.tostring(root, encoding="unicode") + "\n"


def _write_mesh(element: ET.Element, model: mujoco.MjModel) -> None:
    """Write the vertices in the frame of the file: the compiled ones are in the frame of the inertia."""
    mesh = model.mesh(element.get("name"))
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.mesh_quat[mesh.id])
    begin, count = int(mesh.vertadr[0]), int(mesh.vertnum[0])
    vertices = model.mesh_vert[begin : begin + count].astype(float) @ turn.reshape(3, 3).T
    begin, count = int(mesh.faceadr[0]), int(mesh.facenum[0])
    faces = model.mesh_face[begin : begin + count]
    _remove(element, "file", "content_type", "refpos", "refquat")
    element.set("scale", "1 1 1")  # whatever the default class says
    element.set("vertex", _text(vertices + model.mesh_pos[mesh.id]))
    element.set("face", " ".join(map(str, faces.ravel().tolist())))


def _write_height_field(element: ET.Element, model: mujoco.MjModel) -> None:
    """Write the elevations; an MJCF has the last row first."""
    field = model.hfield(element.get("name"))
    rows, columns = int(field.nrow[0]), int(field.ncol[0])
    begin = int(field.adr[0])
    heights = model.hfield_data[begin : begin + rows * columns].reshape(rows, columns)
    _remove(element, "file", "content_type")
    element.set("nrow", str(rows))
    element.set("ncol", str(columns))
    element.set("elevation", _text(heights[::-1]))


def _write_texture(element: ET.Element, model: mujoco.MjModel) -> None:
    """Write the mean colour."""
    texture = model.texture(element.get("name"))
    channels = int(model.tex_nchannel[texture.id])
    size = int(model.tex_height[texture.id]) * int(model.tex_width[texture.id]) * channels
    begin = int(model.tex_adr[texture.id])
    colour = model.tex_data[begin : begin + size].reshape(-1, channels).mean(axis=0)[:3] / 255.0
    sides = (f"file{side}" for side in ("right", "left", "up", "down", "front", "back"))
    _remove(element, "file", "content_type", "gridsize", "gridlayout", "hflip", "vflip", "nchannel", *sides)
    element.set("builtin", "flat")
    element.set("rgb1", _text(np.resize(colour, 3)))
    element.set("rgb2", _text(np.resize(colour, 3)))
    element.set("width", str(_TEXTURE_PX))
    element.set("height", str(_TEXTURE_PX if element.get("type", "cube") == "2d" else 6 * _TEXTURE_PX))


_WRITERS: dict[str, Callable[[ET.Element, mujoco.MjModel], None]] = {
    "mesh": _write_mesh,
    "hfield": _write_height_field,
    "texture": _write_texture,
}


def _remove(element: ET.Element, *keys: str) -> None:
    for key in keys:
        element.attrib.pop(key, None)


def _text(numbers: NDArray[np.floating]) -> str:
    return " ".join(map(repr, np.asarray(numbers, dtype=float).ravel().tolist()))
