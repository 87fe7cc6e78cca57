"""One robot's part of a picture: the robot, its ground, lights, measured marker and words."""

from __future__ import annotations

import copy
import math

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gaitopt.report.film.camera import camera_of, followed
from gaitopt.report.film.captions import length_text, write_lines
from gaitopt.report.film.gl import open_context, opengl_missing
from gaitopt.report.film.take import Take
from gaitopt.report.letters import drawable
from gaitopt.report.settings import FilmSettings

_STRIPES = 41
_LIGHT, _DARK = (1.0, 1.0, 0.99, 1.0), (0.86, 0.88, 0.89, 1.0)
"""Colours of the ground and of the stripes on it."""

_MEASURED, _SIMULATED = (0.0, 0.45, 0.7, 1.0), (0.84, 0.37, 0.0, 1.0)
"""Colours of the marker, as in the figures of a diagnosis."""

_QUALITY = (512, 4, 16, 10)
"""Pixels of a shadow map, samples of a pixel, and faces of a sphere round and across: finer ones cost twice
the time without a graphics card, and look the same at the size of a film."""

_MARKER, _SIMULATED_MARKER, _TRAIL = 0.012, 0.8, 0.3
"""Radius of the measured marker over the camera's distance; of the others over that."""


class Scene:
    """A robot, its ground, lights and camera, and the OpenGL context that draws them.

    Args:
        shown: the robot.
        size: width and height of a picture, pixels.
        times: gait times of the pictures, s, shape (n,).
        settings: how it looks.

    Raises:
        GaitoptError: there is no OpenGL.
    """

    def __init__(
        self, shown: Take, size: tuple[int, int], times: NDArray[np.float64], settings: FilmSettings
    ):
        self._shown, self._size, self._settings = shown, size, settings
        self._model = _lit(shown.model, size, settings.field_of_view_deg)
        self._data = mujoco.MjData(self._model)
        self._path = followed(shown)
        self._camera = camera_of(shown, self._path, times, size, settings)
        self._stripe_m = _stripe_width(self._camera.distance)
        self._context = open_context(*size)
        self._context.make_current()
        try:
            self._drawing = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        except mujoco.FatalError:
            raise opengl_missing() from None
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._drawing)
        self._geoms = mujoco.MjvScene(self._model, maxgeom=self._model.ngeom + 1000)
        self._options = mujoco.MjvOption()

    def picture(self, at: float) -> Image.Image:
        """Return the picture at a gait time, s."""
        index = self._shown.index(at)
        self._data.qpos[:] = self._shown.poses[index]
        for step in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight):
            step(self._model, self._data)
        self._camera.lookat[:] = self._path[index]
        every = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, self._data, self._options, None, self._camera, every, self._geoms)
        self._add_stripes(self._path[index])
        self._add_markers(at, index)
        picture = self._drawn()
        write_lines(picture, *self._words(at, index))
        return picture

    def close(self) -> None:
        """Free what OpenGL holds."""
        self._context.make_current()
        self._drawing.free()
        self._context.free()

    def _drawn(self) -> Image.Image:
        width, height = self._size
        rectangle = mujoco.MjrRect(0, 0, width, height)
        pixels = np.empty((height, width, 3), np.uint8)
        self._context.make_current()
        mujoco.mjr_render(rectangle, self._geoms, self._drawing)
        mujoco.mjr_readPixels(pixels, None, rectangle, self._drawing)
        return Image.fromarray(np.ascontiguousarray(pixels[::-1]))

    def _add_stripes(self, seen: NDArray[np.float64]) -> None:
        """Lay stripes across the ground, so that travel is visible while the camera follows."""
        forward, left, up = self._shown.axes
        plane = _ground(self._model)
        if plane is None:
            return
        height = float(up @ self._data.geom_xpos[plane])
        middle = 2 * round(float(forward @ seen) / (2 * self._stripe_m))
        half = np.array([0.5 * self._stripe_m, 0.5 * _STRIPES * self._stripe_m, 1e-4 * self._stripe_m])
        for number in range(middle - _STRIPES // 2, middle + _STRIPES // 2 + 1):
            if number % 2 == 0:
                centre = (number + 0.5) * self._stripe_m * forward + (left @ seen) * left + height * up
                self._add(mujoco.mjtGeom.mjGEOM_BOX, half, centre, _DARK)

    def _add_markers(self, at: float, index: int) -> None:
        """Show the measured marker with its trail beside the simulated one."""
        ghost, settings = self._shown.ghost, self._settings
        if ghost is None:
            return
        radius = _MARKER * self._camera.distance
        trail = ghost.before(at, settings.trail_s)
        for position in trail[:-1][:: max(1, len(trail) // settings.trail_points)]:
            self._add_sphere(_TRAIL * radius, position, _MEASURED)
        for position in trail[-1:]:
            self._add_sphere(radius, position, _MEASURED)
        simulated = self._shown.trajectory.stacked("marker")[index]
        self._add_sphere(_SIMULATED_MARKER * radius, simulated, _SIMULATED)

    def _add_sphere(self, radius: float, centre: NDArray[np.float64], colour: tuple[float, ...]) -> None:
        self._add(mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, radius), centre, colour)

    def _add(
        self,
        kind: mujoco.mjtGeom,
        half: NDArray[np.float64],
        centre: NDArray[np.float64],
        colour: tuple[float, ...],
    ) -> None:
        """Add a shape, turned as the robot's axes are, to what is drawn."""
        if self._geoms.ngeom < self._geoms.maxgeom:
            turn = self._shown.axes.T.ravel()
            geom = self._geoms.geoms[self._geoms.ngeom]
            mujoco.mjv_initGeom(geom, kind.value, half, centre, turn, np.array(colour, np.float32))
            self._geoms.ngeom += 1

    def _words(self, at: float, index: int) -> tuple[str, str]:
        """Return the lines above and below the robot."""
        shown = self._shown
        marker = shown.trajectory.stacked("marker")
        travelled = float(shown.axes[0] @ (marker[index] - marker[0]))
        speed = ""
        if not math.isnan(shown.speed_m_s):
            speed = f"   speed {length_text(shown.speed_m_s)}/s ({shown.speed_of})"
        period = "" if shown.period_s is None else f"   period {shown.period_s:.3g} s"
        above = f"{drawable(shown.name)}{period}{speed}"
        stripes = length_text(self._stripe_m, 0)
        below = f"t = {at:5.2f} s   travelled {length_text(travelled)}   stripes {stripes}"
        if shown.ghost is not None:
            below = (
                f"t = {at:5.2f} s   marker: orange simulated, blue measured ({drawable(shown.ghost.trial)})"
            )
        return above, below


def _lit(model: mujoco.MjModel, size: tuple[int, int], field_of_view_deg: float) -> mujoco.MjModel:
    """Return a copy of a model that is lit evenly, on an endless light ground."""
    model = copy.copy(model)
    head = model.vis.headlight
    head.active, head.ambient[:], head.diffuse[:], head.specular[:] = 1, 0.5, 0.35, 0.0
    if model.nlight == 0:
        head.diffuse[:] = 0.6
    quality = model.vis.quality
    quality.shadowsize, quality.offsamples, quality.numslices, quality.numstacks = _QUALITY
    model.light_castshadow[1:] = 0  # each light that casts shadows draws the whole scene once more
    model.vis.global_.offwidth, model.vis.global_.offheight = size
    model.vis.global_.fovy = field_of_view_deg
    model.light_diffuse[:], model.light_specular[:], model.light_ambient[:] = 0.25, 0.0, 0.0
    plane = _ground(model)
    if plane is not None:
        model.geom_matid[plane], model.geom_rgba[plane] = -1, _LIGHT
        model.geom_size[plane, :2] = 0.0
    model.mat_reflectance[:] = 0.0
    return model


def _ground(model: mujoco.MjModel) -> int | None:
    """Return the plane that the robot walks on, if there is one."""
    planes = np.flatnonzero((model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) & (model.geom_bodyid == 0))
    return int(planes[0]) if len(planes) else None


def _stripe_width(distance: float) -> float:
    """Return a round width, about a fifth of what is seen, m: 1, 2 or 5 times a power of ten."""
    wanted = 0.2 * distance
    power = 10.0 ** math.floor(math.log10(wanted))
    return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= wanted * (1 + 1e-9))
