"""Pictures of a robot that moves: frames drawn without a screen, and the films made of them."""

from __future__ import annotations

import copy
import importlib
import math
import os
import sys
import time
from collections.abc import Generator, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import write_with
from gaitopt.diagnose.gap.predict import latest_gait_time
from gaitopt.diagnose.record.dataset import Trial
from gaitopt.gait.gait import Gait
from gaitopt.problem.model import Robot
from gaitopt.report.film.ghost import Ghost, ghost_of
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator

FORMATS = (".mp4", ".gif", ".webp")
SIZE, FPS = (640, 360), 25.0
"""Of an MP4: width and height of one robot's picture, pixels, and pictures a second."""

LOOP_SIZE, LOOP_RATES = (400, 226), (10.0, 12.5, 20.0, 25.0)
"""The same of an animation that plays for ever, which compresses less well; see `loop_rate`."""

_PER_CYCLE = 6.0
"""Pictures of a cycle below which the motion cannot be read."""

_MIN_S = 5.0
"""A film shows whole cycles that last at least this long."""

_BACK_ENDS = {"darwin": ("cgl",), "win32": ("glfw",)}
_HEADLESS = ("egl", "osmesa")
_MISSING_GL = (
    "pictures need OpenGL without a screen, and neither EGL nor OSMesa works here; on Debian or Ubuntu: "
    "apt install libegl1 (or libosmesa6)"
)

_FIELD_OF_VIEW = 30.0
_ELEVATION = -22.0
"""Degrees: low enough to see pads lift, high enough that the ground fills the picture."""

_TURN = 15.0
"""Degrees by which the camera stands aside of the robot's own side view."""

_MARGIN = 1.3
_STRIPES = 41
_LIGHT, _DARK = (1.0, 1.0, 0.99, 1.0), (0.86, 0.88, 0.89, 1.0)

_MEASURED, _SIMULATED = (0.0, 0.45, 0.7, 1.0), (0.84, 0.37, 0.0, 1.0)
"""Colours of the marker, as in the figures of a diagnosis."""

_TRAIL_S = 1.0
_TRAIL_POINTS = 30
_REACH = 1.5
"""A ghost that leaves the robot widens the picture up to so many times."""


@dataclass(frozen=True)
class Take:
    """One robot that moves, and what is written above it.

    Attributes:
        model: the compiled robot, as simulated.
        trajectory: its motion, with poses.
        axes: forward, left and up as rows; see `Roles.axes`.
        name: the gait's name.
        period_s: the gait's period.
        speed_m_s: its mean forward speed; NaN where it is not known.
        ghost: where the marker was measured, if that is to be shown.
    """

    model: mujoco.MjModel
    trajectory: Trajectory
    axes: NDArray[np.float64]
    name: str
    period_s: float
    speed_m_s: float
    ghost: Ghost | None = None

    def named(self, name: str) -> Take:
        """Return the same take under another name."""
        return replace(self, name=name)


def take(simulator: Simulator, gait: Gait, duration: float | None = None) -> Take:
    """Simulate a gait on the nominal robot and keep what its pictures need.

    Args:
        simulator: the robot.
        gait: what it does.
        duration: how long, s; at least the problem's horizon is simulated, for the mean speed.

    Raises:
        GaitoptError: the simulation failed.
    """
    length = max(simulator.duration(gait), duration or 0.0)
    trajectory = simulator.run(gait, duration=length, poses=True)
    if trajectory.status != "ok":
        raise GaitoptError(f"{gait.name}: nothing to show: the simulation {trajectory.status}")
    model = simulator.models[0]
    speed = measure(simulator.problem, gait, trajectory, Robot.of(model))["speed_m_s"]
    return Take(model, trajectory, simulator.problem.roles.axes, gait.name, gait.period_s, speed)


def take_beside(simulator: Simulator, trial: Trial, duration: float) -> Take:
    """Simulate the gait of a trial and keep what its pictures need, the measured marker with it.

    Raises:
        GaitoptError: the simulation failed, or no marker was measured.
    """
    shown = take(simulator, trial.gait, max(duration, latest_gait_time(trial)))
    return replace(shown, ghost=ghost_of(simulator, trial, shown.trajectory))


def film_length(shown: Sequence[Take] | Sequence[Gait]) -> float:
    """Return how long a film lasts unless asked otherwise: whole cycles of the slowest gait, s."""
    period = max(one.period_s for one in shown)
    return period * math.ceil(_MIN_S / period * (1.0 - 1e-12))


def loop_rate(takes: Sequence[Take]) -> float:
    """Return the pictures a second of an animation: as few as show the fastest gait's cycle."""
    wanted = _PER_CYCLE / min(shown.period_s for shown in takes)
    return next((rate for rate in LOOP_RATES if rate >= wanted), LOOP_RATES[-1])


def check_film(path: Path) -> None:
    """Check that a film can be written under this name, before anything is computed for it.

    Raises:
        GaitoptError: its suffix is none of `FORMATS`, or its folder does not exist.
    """
    if path.suffix.lower() not in FORMATS:
        raise GaitoptError(f"{path}: no film format; allowed: a file that ends in {', '.join(FORMATS)}")
    if not path.parent.is_dir():
        raise GaitoptError(f"{path}: cannot be written: no folder {path.parent}")


def write_film(
    path: Path,
    takes: Sequence[Take],
    begin: float = 0.0,
    end: float | None = None,
) -> None:
    """Write a film of one robot, or of several side by side, in the format that the suffix says.

    Args:
        path: where to; ``.mp4`` (H.264), ``.gif`` or ``.webp`` (these two play for ever).
        takes: who is shown, from left to right, all on the same clock.
        begin, end: gait times, s.

    Raises:
        GaitoptError: the format is unknown, there is no OpenGL, or the file cannot be written.
    """
    check_film(path)
    film = path.suffix.lower() == ".mp4"
    size, fps = (SIZE, FPS) if film else (LOOP_SIZE, loop_rate(takes))
    end = film_length(takes) if end is None else end
    times = begin + np.arange(max(1, round((end - begin) * fps))) / fps
    write = _write_mp4 if film else _write_loop
    with closing(frames(takes, times, size)) as pictures:
        write_with(path, lambda temporary: write(temporary, pictures, fps))


def frames(
    takes: Sequence[Take], times: NDArray[np.float64], size: tuple[int, int] = SIZE
) -> Generator[Image.Image]:
    """Yield the pictures of a film.

    Args:
        takes: who is shown, from left to right.
        times: gait times, s, shape (n,).
        size: width and height of each robot's picture, pixels.

    Raises:
        GaitoptError: there is no OpenGL.
    """
    width, height = size
    stages = [_Stage(shown, size, times) for shown in takes]
    try:
        for at in times:
            whole = Image.new("RGB", (width * len(takes), height))
            for index, stage in enumerate(stages):
                whole.paste(stage.picture(float(at)), (width * index, 0))
            yield whole
    finally:
        for stage in stages:
            stage.close()


# --- one picture ------------------------------------------------------------------------------


class _Stage:
    """A robot, its ground, lights and camera, and the OpenGL context that draws them."""

    def __init__(self, shown: Take, size: tuple[int, int], times: NDArray[np.float64]):
        self._shown, self._size = shown, size
        self._model = _lit(shown.model, size)
        self._data = mujoco.MjData(self._model)
        self._path = _followed(shown)
        self._camera = _camera(self._model, shown, self._path, size, times)
        self._context = _gl_context(*size)
        self._context.make_current()
        try:
            self._drawing = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        except mujoco.FatalError:
            raise GaitoptError(_MISSING_GL) from None
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._drawing)
        self._scene = mujoco.MjvScene(self._model, maxgeom=self._model.ngeom + 1000)
        self._options = mujoco.MjvOption()
        self._pitch = _stripe_width(self._camera.distance)

    def picture(self, at: float) -> Image.Image:
        """Return the picture at a gait time."""
        index = int(np.clip(np.searchsorted(self._shown.trajectory.time, at), 0, len(self._path) - 1))
        assert self._shown.trajectory.poses is not None
        self._data.qpos[:] = self._shown.trajectory.poses[index]
        for step in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight):
            step(self._model, self._data)
        self._camera.lookat[:] = self._path[index]
        every = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, self._data, self._options, None, self._camera, every, self._scene)
        self._stripes(self._path[index])
        self._markers(at, index)
        width, height = self._size
        rectangle = mujoco.MjrRect(0, 0, width, height)
        pixels = np.empty((height, width, 3), np.uint8)
        self._context.make_current()
        mujoco.mjr_render(rectangle, self._scene, self._drawing)
        mujoco.mjr_readPixels(pixels, None, rectangle, self._drawing)
        picture = Image.fromarray(np.ascontiguousarray(pixels[::-1]))
        _write(picture, self._words(at, index))
        return picture

    def close(self) -> None:
        """Free what OpenGL holds."""
        self._context.make_current()
        self._drawing.free()
        self._context.free()

    def _stripes(self, seen: NDArray[np.float64]) -> None:
        """Lay stripes across the ground, so that travel shows while the camera follows."""
        forward, left, up = self._shown.axes
        plane = _ground(self._model)
        if plane is None:
            return
        height = float(up @ self._data.geom_xpos[plane])
        middle = 2 * round(float(forward @ seen) / (2 * self._pitch))
        half = np.array([0.5 * self._pitch, 0.5 * _STRIPES * self._pitch, 1e-4 * self._pitch])
        for number in range(middle - _STRIPES // 2, middle + _STRIPES // 2 + 1):
            if number % 2 == 0:
                centre = (number + 0.5) * self._pitch * forward + (left @ seen) * left + height * up
                self._add(mujoco.mjtGeom.mjGEOM_BOX, half, centre, _DARK)

    def _markers(self, at: float, index: int) -> None:
        """Show the measured marker with its trail beside the simulated one."""
        ghost = self._shown.ghost
        if ghost is None:
            return
        radius = 0.012 * self._camera.distance
        trail = ghost.before(at, _TRAIL_S)
        for position in trail[:-1][:: max(1, len(trail) // _TRAIL_POINTS)]:
            self._add(mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, 0.3 * radius), position, _MEASURED)
        for position in trail[-1:]:
            self._add(mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, radius), position, _MEASURED)
        simulated = self._shown.trajectory.stacked("marker")[index]
        self._add(mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, 0.8 * radius), simulated, _SIMULATED)

    def _add(
        self,
        kind: mujoco.mjtGeom,
        half: NDArray[np.float64],
        centre: NDArray[np.float64],
        colour: tuple[float, ...],
    ) -> None:
        """Add a shape, turned as the robot's axes are, to what is drawn."""
        if self._scene.ngeom < self._scene.maxgeom:
            turn = self._shown.axes.T.ravel()
            geom = self._scene.geoms[self._scene.ngeom]
            mujoco.mjv_initGeom(geom, kind.value, half, centre, turn, np.array(colour, np.float32))
            self._scene.ngeom += 1

    def _words(self, at: float, index: int) -> tuple[str, str]:
        shown = self._shown
        marker = shown.trajectory.stacked("marker")
        travelled = float(shown.axes[0] @ (marker[index] - marker[0]))
        speed = "" if math.isnan(shown.speed_m_s) else f"   speed {_length(shown.speed_m_s)}/s"
        above = f"{shown.name}   period {shown.period_s:.3g} s{speed}"
        below = f"t = {at:5.2f} s   travelled {_length(travelled)}   stripes {_length(self._pitch, 0)}"
        if shown.ghost is not None:
            below = f"t = {at:5.2f} s   marker: orange simulated, blue measured ({shown.ghost.trial})"
        return above, below


def _lit(model: mujoco.MjModel, size: tuple[int, int]) -> mujoco.MjModel:
    """Return a copy of a model that is lit evenly, on light ground without end."""
    model = copy.copy(model)
    head = model.vis.headlight
    head.active, head.ambient[:], head.diffuse[:], head.specular[:] = 1, 0.5, 0.35, 0.0
    if model.nlight == 0:
        head.diffuse[:] = 0.6
    model.vis.quality.shadowsize, model.vis.quality.offsamples = 2048, 4
    model.vis.global_.offwidth, model.vis.global_.offheight = size
    model.vis.global_.fovy = _FIELD_OF_VIEW
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


def _camera(
    model: mujoco.MjModel,
    shown: Take,
    path: NDArray[np.float64],
    size: tuple[int, int],
    times: NDArray[np.float64],
) -> mujoco.MjvCamera:
    """Return a camera at the robot's right, so that forward is to the right, as far off as it is large."""
    _, left, _ = shown.axes
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE.value
    camera.azimuth = math.degrees(math.atan2(left[1], left[0])) + _TURN
    camera.elevation = _ELEVATION
    half_view = math.radians(_FIELD_OF_VIEW) / 2.0
    across = math.atan(math.tan(half_view) * size[0] / size[1])
    wide, high = _extent(model, shown, path)
    wide = max(wide, min(_ghost_width(shown, path, times), _REACH * wide))
    camera.distance = _MARGIN * max(wide / (2 * math.tan(across)), high / (2 * math.tan(half_view)))
    return camera


def _extent(model: mujoco.MjModel, shown: Take, path: NDArray[np.float64]) -> tuple[float, float]:
    """Return how wide and how high a picture about `path` must be for the robot to stay in it, m."""
    forward, _, up = shown.axes
    wide = high = 0.0
    own = np.flatnonzero((model.geom_bodyid > 0) & (model.geom_rgba[:, 3] > 0.0))
    data = mujoco.MjData(model)
    assert shown.trajectory.poses is not None
    every = max(1, len(path) // 200)
    for pose, seen in zip(shown.trajectory.poses[::every], path[::every], strict=True):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        corners = _corners(model, data, own) - seen
        wide = max(wide, 2.0 * float(np.abs(corners @ forward).max()))
        high = max(high, 2.0 * float(np.abs(corners @ up).max()))
    return wide, high


def _ghost_width(shown: Take, path: NDArray[np.float64], times: NDArray[np.float64]) -> float:
    """Return how wide a picture about `path` must be for the ghost to stay in it, m; 0 without one."""
    ghost = shown.ghost
    if ghost is None:
        return 0.0
    during = (ghost.time >= times[0]) & (ghost.time <= times[-1])
    forward = shown.axes[0]
    seen = np.interp(ghost.time[during], shown.trajectory.time, path @ forward)
    return 2.0 * float(np.abs(ghost.positions[during] @ forward - seen).max(initial=0.0))


def _corners(model: mujoco.MjModel, data: mujoco.MjData, geoms: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the corners of the boxes around some geoms in the world, shape (8 n, 3)."""
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    centre, half = model.geom_aabb[geoms, :3], model.geom_aabb[geoms, 3:]
    local = centre[:, None] + signs * half[:, None]
    turned = np.einsum("gij,gcj->gci", data.geom_xmat[geoms].reshape(-1, 3, 3), local)
    corners: NDArray[np.float64] = (data.geom_xpos[geoms, None] + turned).reshape(-1, 3)
    return corners


def _followed(shown: Take) -> NDArray[np.float64]:
    """Return where the camera looks: the robot's middle, averaged over a cycle, shape (n, 3)."""
    trajectory = shown.trajectory
    assert trajectory.poses is not None
    model, every = shown.model, max(1, len(trajectory.time) // 400)
    data = mujoco.MjData(model)
    own = np.flatnonzero(model.geom_bodyid > 0)
    middles = []
    for pose in trajectory.poses[::every]:
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        corners = _corners(model, data, own)
        middles.append(0.5 * (corners.min(axis=0) + corners.max(axis=0)))
    step = float(np.median(np.diff(trajectory.time[::every]))) if len(middles) > 1 else 1.0
    half = max(1, round(0.5 * shown.period_s / step))
    smooth = np.stack([_running_mean(series, half) for series in np.array(middles).T], axis=1)
    sampled = trajectory.time[::every]
    return np.stack([np.interp(trajectory.time, sampled, series) for series in smooth.T], axis=1)


def _running_mean(series: NDArray[np.float64], half: int) -> NDArray[np.float64]:
    padded = np.pad(series, half, mode="edge")
    return np.convolve(padded, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")


def _stripe_width(distance: float) -> float:
    """Return a round width, about a fifth of what is seen, m: 1, 2 or 5 times a power of ten."""
    wanted = 0.2 * distance
    power = 10.0 ** math.floor(math.log10(wanted))
    return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= wanted * (1 + 1e-9))


def _length(metres: float, places: int = 1) -> str:
    """Return a length in words; `places` decimals of a millimetre where it is short."""
    if abs(metres) >= 1.0:
        text = f"{metres:.{2 * places}f} m"
    else:
        millimetres = 1e3 * metres
        text = f"{millimetres:.{0 if abs(millimetres) >= 100.0 else places}f} mm"
    return text.replace("-", "−")


def _write(picture: Image.Image, words: tuple[str, str]) -> None:
    """Draw one line at the top and one at the foot of a picture, each on a light ground."""
    draw = ImageDraw.Draw(picture, "RGBA")
    size = max(12, picture.height // 20)
    font = _font(size)
    while size > 8 and max(draw.textlength(line, font=font) for line in words) > picture.width - 16:
        size -= 1
        font = _font(size)
    for line, y in zip(words, (6, picture.height - 6 - round(1.5 * size)), strict=True):
        box = (6, y, 6 + draw.textlength(line, font=font) + 8, y + round(1.5 * size))
        draw.rectangle(box, fill=(255, 255, 255, 200))
        draw.text((10, y + round(0.15 * size)), line, fill=(20, 20, 20, 255), font=font)


@cache
def _font(size: int) -> ImageFont.FreeTypeFont:
    from matplotlib import get_data_path

    return ImageFont.truetype(str(Path(get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), size)


# --- OpenGL without a screen ------------------------------------------------------------------


def _gl_context(width: int, height: int) -> Any:
    """Return an OpenGL context: the one that ``MUJOCO_GL`` names, or else the first that works."""
    named = os.environ.get("MUJOCO_GL", "").strip().lower()
    tried = (named,) if named else _BACK_ENDS.get(sys.platform, _HEADLESS)
    for back_end in tried:
        try:
            return _load_back_end(back_end)(width, height)
        except Exception:
            _forget_back_end(back_end, named)
    raise GaitoptError(_MISSING_GL + (f" (MUJOCO_GL is {named!r})" if named else ""))


def opengl_is_missing() -> bool:
    """Return whether pictures cannot be drawn here."""
    try:
        context = _gl_context(8, 8)
    except GaitoptError:
        return True
    context.free()
    return False


def _load_back_end(name: str) -> Any:
    os.environ["MUJOCO_GL"] = name  # libmujoco asks for it when it looks up OpenGL's functions
    return importlib.import_module(f"mujoco.{name}").GLContext


def _forget_back_end(name: str, named: str) -> None:
    """Undo a failed import: PyOpenGL chooses its platform once and for all."""
    os.environ.pop("PYOPENGL_PLATFORM", None)
    os.environ.pop("MUJOCO_GL", None)
    if named:
        os.environ["MUJOCO_GL"] = named
    for module in [m for m in sys.modules if m.split(".")[0] == "OpenGL" or m.startswith(f"mujoco.{name}")]:
        del sys.modules[module]


# --- files ------------------------------------------------------------------------------------


def _write_mp4(path: Path, pictures: Iterable[Image.Image], fps: float) -> None:
    """Write an H.264 film that browsers play."""
    import av

    with av.open(path, "w", format="mp4", options={"movflags": "faststart"}) as container:
        options = {"crf": "23", "preset": "fast"}
        stream: Any = container.add_stream("libx264", rate=round(fps), options=options)
        stream.pix_fmt = "yuv420p"
        for index, picture in enumerate(pictures):
            if index == 0:
                stream.width, stream.height = (side - side % 2 for side in picture.size)
            frame = av.VideoFrame.from_ndarray(np.asarray(picture), format="rgb24")
            frame.pts, frame.time_base = index, Fraction(1, round(fps))
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def _write_loop(path: Path, pictures: Iterable[Image.Image], fps: float) -> None:
    """Write an animation that plays for ever."""
    kind = path.suffix[1:].lower()
    first, *others = _with_one_palette(pictures) if kind == "gif" else pictures
    options: dict[str, Any] = {"duration": round(1000 / fps), "loop": 0, "save_all": True}
    options |= {"optimize": True} if kind == "gif" else {"quality": 45, "method": 4}
    first.save(path, format=kind.upper(), append_images=others, **options)


def _with_one_palette(pictures: Iterable[Image.Image]) -> Generator[Image.Image]:
    """Yield pictures in the 64 colours of the first, undithered, so that still parts cost nothing."""
    palette: Image.Image | None = None
    for picture in pictures:
        palette = palette or picture.quantize(64, dither=Image.Dither.NONE)
        yield picture.quantize(palette=palette, dither=Image.Dither.NONE)


# --- on a screen ------------------------------------------------------------------------------


def check_screen() -> None:
    """Check that a window can be opened.

    Raises:
        GaitoptError: there is no screen.
    """
    screen = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    if sys.platform.startswith("linux") and not screen:
        raise GaitoptError("--view: no screen here; write a film instead: --video walk.mp4")


def view(shown: Take) -> None:
    """Play a motion over and over in MuJoCo's own viewer, until its window is closed.

    Raises:
        GaitoptError: there is no screen, or no window can be opened on it.
    """
    check_screen()
    import mujoco.viewer

    poses, clock = shown.trajectory.poses, shown.trajectory.time
    assert poses is not None
    data = mujoco.MjData(shown.model)
    try:
        window = mujoco.viewer.launch_passive(shown.model, data)
    except RuntimeError as error:
        raise GaitoptError(f"--view: {error}") from None
    with window:
        began = time.monotonic()
        while window.is_running():
            at = (time.monotonic() - began) % float(clock[-1])
            data.time, data.qpos[:] = at, poses[np.searchsorted(clock, at)]
            mujoco.mj_kinematics(shown.model, data)
            window.sync()
            time.sleep(0.02)
