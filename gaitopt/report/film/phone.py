"""A synthetic phone: a tagged robot, rendered by MuJoCo, through a lens, a rolling shutter and H.264."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.core.progress import OnProgress, Progress, silent
from gaitopt.core.streams import seeded
from gaitopt.report.film.gl import open_context
from gaitopt.report.film.stage import Stage, Stand, looking, robot_corners
from gaitopt.robot.boxes import CUBE
from gaitopt.track.lens import Lens
from gaitopt.track.opencv import opencv
from gaitopt.track.tag import CELLS, pattern

Array = NDArray[np.float64]

_TEXELS = 32
"""Pixels of a tag's texture along one of its cells."""

_EDGE_PX = 4
"""How much is drawn anew around a robot that moved, pixels."""


@dataclass(frozen=True)
class Phone:
    """A phone's camera.

    Attributes:
        size: width and height of its film, pixels.
        focal: focal length, pixels.
        k1, k2: radial distortion, as OpenCV has it.
        fps: frames a second, on average.
        jitter_s: standard deviation of each frame's time, s: a variable frame rate.
        exposure_s: how long each row is exposed, s.
        readout_s: time from the first row to the last one, s.
        blur_px: standard deviation of the lens's blur, pixels.
        noise: standard deviation of a pixel's noise, of 255.
        shake_m, shake_deg: standard deviation of the hand's motion.
        bit_rate: of the compressed film, bit/s; by default that of a phone, see `usual_bit_rate`.
        exposures: pictures that are averaged for a frame.
        margin: how much wider a picture is rendered, for the distortion.
    """

    size: tuple[int, int] = (1920, 1080)
    focal: float = 1500.0
    k1: float = 0.05
    k2: float = -0.05
    fps: float = 30.0
    jitter_s: float = 0.0
    exposure_s: float = 0.006
    readout_s: float = 0.012
    blur_px: float = 0.7
    noise: float = 2.0
    shake_m: float = 0.0
    shake_deg: float = 0.0
    bit_rate: float | None = None
    exposures: int = 2
    margin: float = 1.1

    @property
    def usual_bit_rate(self) -> float:
        """The rate of an iPhone's H.264, bit/s: 130 MB a minute of 1080p at 30 frames/s, 175 MB at 60.

        It says so where the frame rate is chosen. Other sizes are as fine by pixel.
        """
        share = self.size[0] * self.size[1] / (1920 * 1080)
        return 130e6 * 8 / 60 * share * math.pow(self.fps / 30, math.log2(175 / 130))


@dataclass(frozen=True)
class Filmed:
    """What a synthetic film shows.

    Attributes:
        path: the film.
        times: time stamp of each frame on the motion's clock, s: the middle row in mid-exposure.
        cameras: by frame the turn (3, 3) and the shift (3,) from the problem's axes to the camera's.
    """

    path: Path
    times: Array
    cameras: tuple[tuple[Array, Array], ...]


def shot(
    path: Path,
    stage: Stage,
    motion: Callable[[float], Array],
    stand: Stand,
    phone: Phone = Phone(),
    seconds: float = 2.0,
    begin: float = 0.0,
    seed: int = 1,
    hidden: Callable[[float, NDArray[np.uint8]], NDArray[np.uint8]] | None = None,
    progress: OnProgress = silent,
) -> Filmed:
    """Film a motion.

    Args:
        path: where to; its suffix is the container.
        stage: what is filmed.
        motion: MuJoCo's qpos at a time, s.
        stand: where the phone is.
        phone: the phone.
        seconds: length of the film.
        begin: time of the first frame.
        seed: seed of noise, shake and time stamps.
        hidden: changes the picture of a frame at a time, before it is compressed.
        progress: called after each picture.
    """
    rng = seeded(seed)
    count = round(seconds * phone.fps)
    wanted = begin + np.arange(count) / phone.fps + phone.jitter_s * rng.standard_normal(count)
    times = np.round(np.sort(wanted), 5).astype(np.float64)
    shake = _shake(phone, seed)
    studio = Studio(stage, phone)
    cameras: list[tuple[Array, Array]] = []
    try:
        with av.open(str(path), "w") as container:
            rate = round(phone.bit_rate or phone.usual_bit_rate)
            # One thread: what x264 writes depends on their number.
            options = {"preset": "veryfast", "maxrate": f"{rate}", "bufsize": f"{rate // 2}", "threads": "1"}
            stream = container.add_stream("libx264", rate=round(phone.fps), options=options)
            stream.bit_rate = rate
            stream.width, stream.height = phone.size
            stream.pix_fmt = "yuv420p"
            stream.codec_context.time_base = Fraction(1, 100_000)
            for at in times:
                picture = studio.frame(float(at), motion, lambda t: _shaken(looking(stand), shake(t)))
                noise = rng.standard_normal(picture.shape, dtype=np.float32)
                grey = np.clip(np.round(picture + phone.noise * noise), 0, 255).astype(np.uint8)
                grey = grey if hidden is None else hidden(float(at), grey)
                progress(Progress(path.name, len(cameras) + 1, count, "frames"))
                frame = av.VideoFrame.from_ndarray(np.repeat(grey[..., None], 3, axis=2), format="rgb24")
                frame.pts, frame.time_base = round((at - begin) * 1e5), Fraction(1, 100_000)
                container.mux(stream.encode(frame))
                cameras.append(_shaken(looking(stand), shake(float(at))))
            container.mux(stream.encode())
    finally:
        studio.close()
    return Filmed(path, times, tuple(cameras))


def _shake(phone: Phone, seed: int) -> Callable[[float], Array]:
    """A hand's motion: turn, rad, and shift, m, at a time, shape (6,)."""
    rng = seeded(seed, 7)
    rates = rng.uniform(0.4, 7.0, (6, 6))
    phases = rng.uniform(0.0, 2 * math.pi, (6, 6))
    sizes = 1.0 / rates
    sizes *= math.sqrt(2.0) / np.linalg.norm(sizes, axis=1, keepdims=True)
    scale = np.repeat([math.radians(phone.shake_deg), phone.shake_m], 3)
    return lambda t: scale * (sizes * np.sin(2 * math.pi * rates * t + phases)).sum(axis=1)


def _shaken(camera: tuple[Array, Array], move: Array) -> tuple[Array, Array]:
    turn = opencv().Rodrigues(move[:3])[0]
    return turn @ camera[0], turn @ camera[1] + move[3:]


class Studio:
    """Renders a stage as a phone sees it.

    Args:
        stage: what is filmed.
        phone: the phone.

    Raises:
        GaitoptError: there is no OpenGL.
    """

    def __init__(self, stage: Stage, phone: Phone):
        self._stage, self._phone = stage, phone
        self._wide = [2 * round(0.5 * phone.margin * side) for side in phone.size]
        self._model = _with_textures(stage, self._wide)
        self._data = mujoco.MjData(self._model)
        self._context = open_context(*self._wide)
        self._context.make_current()
        self._drawing = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._drawing)
        self._scene = mujoco.MjvScene(self._model, maxgeom=self._model.ngeom + 200)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._options = mujoco.MjvOption()
        self._options.sitegroup[:] = 0
        self._map = _lens_map(phone, self._wide)
        self._before: tuple[Array, NDArray[np.int64], NDArray[np.uint8]] | None = None

    def frame(
        self, at: float, motion: Callable[[float], Array], camera: Callable[[float], tuple[Array, Array]]
    ) -> NDArray[np.float32]:
        """One frame: rows are exposed one after another."""
        phone, height = self._phone, self._phone.size[1]
        half = 0.5 * (phone.readout_s + phone.exposure_s)
        moments = half * (2.0 * np.arange(phone.exposures) + 1.0 - phone.exposures) / phone.exposures
        middles = phone.readout_s * (np.arange(height) / (height - 1) - 0.5)
        width = 2.0 * half / phone.exposures
        total: NDArray[np.float32] = np.zeros((height, phone.size[0]), np.float32)
        weights = np.zeros(height, np.float32)
        for moment in moments:
            low = np.maximum(middles - 0.5 * phone.exposure_s, moment - 0.5 * width)
            high = np.minimum(middles + 0.5 * phone.exposure_s, moment + 0.5 * width)
            weight = np.maximum(high - low, 1e-9).astype(np.float32)
            picture = self._seen(self._rendered(motion(at + moment), camera(at + moment))[..., 1])
            total += weight[:, None] * picture
            weights += weight
        mean = total / weights[:, None]
        return opencv().GaussianBlur(mean, (0, 0), phone.blur_px) if phone.blur_px > 0.0 else mean

    def close(self) -> None:
        self._context.make_current()
        self._drawing.free()
        self._context.free()

    def still(self, pose: Array, stand: Stand) -> NDArray[np.uint8]:
        """Return a sharp picture in colour, shape (height, width, 3)."""
        return self._seen(self._rendered(pose, looking(stand)))

    def pixels(self, points: Array, stand: Stand) -> Array:
        """Return where points in the problem's axes, m, shape (n, 3), are in a sharp picture, (n, 2)."""
        turn, shift = looking(stand)
        lens = Lens(self._phone.size, self._phone.focal, self._phone.k1, self._phone.k2)
        return lens.pixels(points @ turn.T + shift)

    def _seen(self, rendered: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a rendered picture through the lens."""
        cv2 = opencv()
        return np.asarray(cv2.remap(np.ascontiguousarray(rendered), *self._map, cv2.INTER_LINEAR))

    def _rendered(self, pose: Array, camera: tuple[Array, Array]) -> NDArray[np.uint8]:
        """Return a picture without distortion; from a camera that stands, only the robot is drawn anew."""
        self._data.qpos[:] = pose
        for step in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight):
            step(self._model, self._data)
        here, window = np.column_stack(camera), self._window(camera)
        if self._before is None or not np.array_equal(self._before[0], here):
            picture = self._drawn(camera, np.array([[0, 0], self._wide]))
            self._before = (here, window, picture)
            return picture
        _, old, whole = self._before
        both = np.array([np.minimum(old[0], window[0]), np.maximum(old[1], window[1])])
        picture = whole.copy()
        picture[both[0, 1] : both[1, 1], both[0, 0] : both[1, 0]] = self._drawn(camera, both)
        return picture

    def _window(self, camera: tuple[Array, Array]) -> NDArray[np.int64]:
        """Return the corners of the part of the picture in which the robot is, pixels, shape (2, 2)."""
        data, reach = self._data, 0.5 * (CELLS + 2) / CELLS
        corners = [robot_corners(data)]
        for site, edge in self._stage.tags.values():
            corners.append(data.site(site).xpos + reach * math.sqrt(2.0) * edge * CUBE)
        turn, shift = camera
        ahead = np.concatenate(corners) @ self._stage.axes.T @ turn.T + shift
        places = self._phone.focal * ahead[:, :2] / np.maximum(ahead[:, 2:], 1e-3) + 0.5 * np.array(
            self._wide
        )
        low, high = np.floor(places.min(axis=0)) - _EDGE_PX, np.ceil(places.max(axis=0)) + _EDGE_PX
        found = np.clip(np.array([low, high]), 0, self._wide).astype(np.int64)
        return found if (found[1] > found[0]).all() else np.array([[0, 0], [1, 1]])

    def _drawn(self, camera: tuple[Array, Array], window: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Return a part of a picture: its corners are in a picture without distortion, shape (2, 2)."""
        every = mujoco.mjtCatBit.mjCAT_ALL.value
        free = mujoco.MjvCamera()
        mujoco.mjv_updateScene(self._model, self._data, self._options, None, free, every, self._scene)
        self._aim(camera, window)
        self._add_tags()
        width, height = (int(side) for side in window[1] - window[0])
        rectangle = mujoco.MjrRect(0, 0, width, height)
        pixels = np.empty((height, width, 3), np.uint8)
        self._context.make_current()
        mujoco.mjr_render(rectangle, self._scene, self._drawing)
        mujoco.mjr_readPixels(pixels, None, rectangle, self._drawing)
        return pixels[::-1]

    def _aim(self, camera: tuple[Array, Array], window: NDArray[np.int64]) -> None:
        turn, shift = camera
        place = self._stage.axes.T @ (-turn.T @ shift)
        ahead, up = self._stage.axes.T @ turn[2], self._stage.axes.T @ -turn[1]
        near = 0.02
        (left, top), (right, bottom) = near * (window - 0.5 * np.array(self._wide)) / self._phone.focal
        for eye in self._scene.camera:
            eye.pos[:], eye.forward[:], eye.up[:] = place, ahead, up
            eye.frustum_near, eye.frustum_far = near, 20.0
            eye.frustum_top, eye.frustum_bottom = -top, -bottom
            eye.frustum_center, eye.frustum_width = 0.5 * (left + right), 0.5 * (right - left)

    def _add_tags(self) -> None:
        stage = self._stage
        for number, (site, edge) in stage.tags.items():
            data = self._data.site(site)
            turn = data.xmat.reshape(3, 3)
            self._add_tag(number, edge, data.xpos, turn)
        for number, (place, angle, edge) in stage.floor.items():
            c, s = math.cos(angle), math.sin(angle)
            turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            self._add_tag(number, edge, stage.axes.T @ np.array([*place, 2e-4]), stage.axes.T @ turn)

    def _add_tag(self, number: int, edge: float, middle: Array, turn: Array) -> None:
        half = 0.5 * edge * (CELLS + 2) / CELLS
        geom = self._scene.geoms[self._scene.ngeom]
        size, colour = np.array([half, half, 0.01]), np.ones(4, np.float32)
        middle = middle + 2e-4 * turn[:, 2]
        mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_PLANE.value, size, middle, turn.ravel(), colour)
        geom.matid = self._model.material(f"tag {number}").id
        geom.texcoord = 0
        geom.emission = 0.5
        self._scene.ngeom += 1


def _with_textures(stage: Stage, size: list[int]) -> mujoco.MjModel:
    """The robot on a light floor, with a material for each tag."""
    spec = mujoco.MjSpec.from_string(stage.mjcf)
    for number in (*stage.tags, *stage.floor):
        picture = np.repeat(tag_picture(number)[..., None], 3, axis=2)
        texture = spec.add_texture(name=f"tag {number}", type=mujoco.mjtTexture.mjTEXTURE_2D)
        texture.height, texture.width, texture.nchannel = picture.shape
        texture.data = picture.tobytes()
        material = spec.add_material(name=f"tag {number}")
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = f"tag {number}"
        material.emission, material.specular = 0.6, 0.0
    model = spec.compile()
    model.vis.global_.offwidth, model.vis.global_.offheight = size
    model.vis.quality.offsamples = 4
    model.vis.map.znear = 0.001
    head = model.vis.headlight
    head.active, head.ambient[:], head.diffuse[:], head.specular[:] = 1, 0.45, 0.25, 0.0
    model.light_diffuse[:], model.light_specular[:], model.light_ambient[:] = 0.1, 0.0, 0.0
    planes = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
    model.geom_matid[planes], model.geom_rgba[planes] = -1, (0.75, 0.72, 0.68, 1.0)
    return model


def _lens_map(phone: Phone, wide: list[int]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Where each pixel of the film is in the rendered picture."""
    cv2 = opencv()
    width, height = phone.size
    inner = np.array([[phone.focal, 0, 0.5 * (width - 1)], [0, phone.focal, 0.5 * (height - 1)], [0, 0, 1.0]])
    outer = np.array(
        [[phone.focal, 0, 0.5 * (wide[0] - 1)], [0, phone.focal, 0.5 * (wide[1] - 1)], [0, 0, 1.0]]
    )
    across, down = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    points = np.stack([across.ravel(), down.ravel()], axis=1)[:, None]
    distortion = np.array([phone.k1, phone.k2, 0.0, 0.0])
    straight = cv2.undistortPoints(points, inner, distortion, P=outer).reshape(height, width, 2)
    return straight[..., 0].astype(np.float32), straight[..., 1].astype(np.float32)


def tag_picture(number: int) -> NDArray[np.uint8]:
    """A tag with its white margin."""
    cells = np.pad(np.where(pattern(number), 20, 235).astype(np.uint8), 1, constant_values=235)
    return np.kron(cells, np.ones((_TEXELS, _TEXELS), np.uint8))
