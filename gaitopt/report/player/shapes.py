"""The shapes of a robot as a page draws them: MuJoCo's geoms that a viewer would show, with their colours."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.report.settings import PlayerSettings

Array = NDArray[np.float64]

_KINDS = {
    mujoco.mjtGeom.mjGEOM_PLANE: "plane",
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_HFIELD: "mesh",
    mujoco.mjtGeom.mjGEOM_MESH: "mesh",
    mujoco.mjtGeom.mjGEOM_SDF: "mesh",
}

_GROUPS_SHOWN = 3
"""MuJoCo's viewer shows the geoms of the first three groups; the others are for collisions as a rule."""

_FINEST = 96
"""Cells along the longest side of the grid to which the corners of a mesh with too many faces are moved."""

_BYTES_PER_CORNER, _BYTES_PER_FACE = 6, 6


@dataclass(frozen=True)
class Mesh:
    """A surface of triangles.

    Attributes:
        corners: m, in the geom's frame, shape (n, 3).
        faces: numbers of three corners each, shape (m, 3).
    """

    corners: Array
    faces: NDArray[np.int64]

    @property
    def size(self) -> int:
        """Bytes that it takes on a page."""
        return _BYTES_PER_CORNER * len(self.corners) + _BYTES_PER_FACE * len(self.faces)


@dataclass(frozen=True)
class Shape:
    """One geom.

    Attributes:
        name: the geom's name; empty without one.
        kind: ``box``, ``capsule``, ``cylinder``, ``sphere``, ``ellipsoid``, ``mesh`` or ``plane``.
        size: MuJoCo's sizes: half lengths and radii, m.
        colour: red, green, blue and opacity, 0 to 1.
        body: number of its body among those that move; -1 for what stands still.
        position: its place in its body, m; of what stands still in the world.
        turn: its turn there, a quaternion (w, x, y, z).
        mesh: number of its mesh; -1 without one.
    """

    name: str
    kind: str
    size: tuple[float, ...]
    colour: tuple[float, ...]
    body: int
    position: tuple[float, ...]
    turn: tuple[float, ...]
    mesh: int = -1


@dataclass(frozen=True)
class Shapes:
    """All that is drawn of one robot and its surroundings.

    Attributes:
        bodies: MuJoCo's numbers of the bodies that move and have a shape.
        geoms: MuJoCo's number of the geom of each shape.
        shapes: the shapes.
        meshes: the surfaces that they use.
    """

    bodies: tuple[int, ...]
    geoms: tuple[int, ...]
    shapes: tuple[Shape, ...]
    meshes: tuple[Mesh, ...]


def shapes_of(model: mujoco.MjModel, pose: Array, settings: PlayerSettings) -> Shapes:
    """Return what is drawn of a robot.

    Args:
        model: the robot.
        pose: a pose, qpos, for what stands still in every pose.
        settings: how many bytes its meshes may take.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    geoms = _shown(model)
    moving = model.body_weldid != 0
    bodies = sorted({int(body) for body in model.geom_bodyid[geoms] if moving[body]})
    meshes: dict[tuple[str, int], int] = {}
    shapes = []
    for geom in geoms:
        body = int(model.geom_bodyid[geom])
        if moving[body]:
            place, turn = model.geom_pos[geom], model.geom_quat[geom]
        else:
            turn = np.empty(4)
            mujoco.mju_mat2Quat(turn, data.geom_xmat[geom])
            place = data.geom_xpos[geom]
        kind = _KINDS[mujoco.mjtGeom(int(model.geom_type[geom]))]
        mesh = meshes.setdefault(_surface(model, geom), len(meshes)) if kind == "mesh" else -1
        shapes.append(
            Shape(
                name=str(model.geom(geom).name),
                kind=kind,
                size=tuple(model.geom_size[geom].tolist()),
                colour=_colour(model, geom),
                body=bodies.index(body) if moving[body] else -1,
                position=tuple(np.asarray(place).tolist()),
                turn=tuple(np.asarray(turn).tolist()),
                mesh=mesh,
            )
        )
    surfaces = [_mesh(model, *surface) for surface in meshes]
    return Shapes(tuple(bodies), tuple(geoms), tuple(shapes), tuple(_within(surfaces, settings)))


def _shown(model: mujoco.MjModel) -> list[int]:
    """Return the geoms to draw: those of the groups that viewers show, or all where these hold no robot."""
    kinds = {kind.value for kind in _KINDS}
    seen = [
        geom
        for geom in range(model.ngeom)
        if int(model.geom_type[geom]) in kinds and _colour(model, geom)[3] > 0.0
    ]
    usual = [geom for geom in seen if model.geom_group[geom] < _GROUPS_SHOWN]
    return usual if any(model.body_weldid[model.geom_bodyid[geom]] for geom in usual) else seen


def _colour(model: mujoco.MjModel, geom: int) -> tuple[float, ...]:
    """Return a geom's colour: its own, or that of its material with the mean of its texture."""
    own, material = model.geom_rgba[geom], int(model.geom_matid[geom])
    if material < 0 or not np.allclose(own, [0.5, 0.5, 0.5, 1.0]):
        return tuple(round(float(part), 4) for part in own)
    colour = np.array(model.mat_rgba[material], dtype=float)
    texture = int(model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB.value])
    if texture >= 0:
        begin, channels = int(model.tex_adr[texture]), int(model.tex_nchannel[texture])
        count = int(model.tex_height[texture]) * int(model.tex_width[texture])
        pixels = model.tex_data[begin : begin + count * channels].reshape(count, channels)
        if channels >= 3:
            colour[:3] *= pixels[:, :3].mean(axis=0) / 255.0
    return tuple(round(float(part), 4) for part in colour)


def _surface(model: mujoco.MjModel, geom: int) -> tuple[str, int]:
    """Return which surface a geom has: a height field's or a mesh's, and its number."""
    field = int(model.geom_type[geom]) == mujoco.mjtGeom.mjGEOM_HFIELD.value
    return "field" if field else "mesh", int(model.geom_dataid[geom])


def _mesh(model: mujoco.MjModel, kind: str, number: int) -> Mesh:
    if kind == "field":
        return _field(model, number)
    corners, faces = int(model.mesh_vertadr[number]), int(model.mesh_faceadr[number])
    return Mesh(
        np.array(model.mesh_vert[corners : corners + int(model.mesh_vertnum[number])], dtype=float),
        np.array(model.mesh_face[faces : faces + int(model.mesh_facenum[number])], dtype=np.int64),
    )


def _field(model: mujoco.MjModel, number: int) -> Mesh:
    """Return the surface of a height field."""
    rows, columns = int(model.hfield_nrow[number]), int(model.hfield_ncol[number])
    begin = int(model.hfield_adr[number])
    width, length, high, _ = model.hfield_size[number]
    heights = high * model.hfield_data[begin : begin + rows * columns]
    y, x = np.meshgrid(np.linspace(-length, length, rows), np.linspace(-width, width, columns), indexing="ij")
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    lower = np.stack([first, first + 1, first + columns + 1], axis=1)
    upper = np.stack([first, first + columns + 1, first + columns], axis=1)
    return Mesh(np.stack([x.ravel(), y.ravel(), heights], axis=1), np.concatenate([lower, upper]))


def _within(meshes: list[Mesh], settings: PlayerSettings) -> list[Mesh]:
    """Return meshes that are as fine as the bytes allow, each with the same limit on its cells."""
    cells = _FINEST
    finest = meshes = [one if len(one.corners) < 65536 else coarser(one, _FINEST) for one in meshes]
    while sum(one.size for one in meshes) > settings.mesh_bytes and cells > 4:
        meshes = [coarser(one, cells) for one in finest]
        cells = int(0.8 * cells)
    return meshes


def coarser(mesh: Mesh, cells: int) -> Mesh:
    """Return a mesh whose corners in one cell of a grid are one corner, at their mean.

    Args:
        mesh: the mesh.
        cells: cells along its longest side.
    """
    low, high = mesh.corners.min(axis=0), mesh.corners.max(axis=0)
    cell = max(float((high - low).max()), 1e-12) / cells
    places = np.minimum(np.floor((mesh.corners - low) / cell), cells - 1).astype(np.int64)
    _, number = np.unique(places, axis=0, return_inverse=True)
    number = number.ravel()
    sums = np.zeros((int(number.max()) + 1, 3))
    np.add.at(sums, number, mesh.corners)
    faces = number[mesh.faces]
    a, b, c = faces.T
    faces = np.unique(faces[(a != b) & (b != c) & (c != a)], axis=0)
    return Mesh(sums / np.bincount(number)[:, None], faces)
