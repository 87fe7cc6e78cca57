"""Pictures of where the tags go on a robot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from gaitopt.problem.problem import Problem
from gaitopt.report.film.phone import Phone, Studio
from gaitopt.report.film.stage import Stage, Stand, robot_corners, stage_of
from gaitopt.report.letters import drawable, font

Array = NDArray[np.float64]

_CAMERA = Phone(size=(960, 640), focal=1400.0, k1=0.0, k2=0.0)
"""A camera that looks from far, so that little is distorted."""

_FACES = 0.35
"""Cosine to the line of sight of a tag that is seen well."""

_COLOUR, _LINE = (213, 94, 0), (255, 255, 255)


def tag_places(problem: Problem) -> list[Image.Image]:
    """Return pictures of a robot at its start with its tags and their names.

    Args:
        problem: the robot's problem, with tags on sites.

    Raises:
        GaitoptError: there is no OpenGL, or the model is broken.
    """
    stage = replace(stage_of(problem), floor={})
    model = mujoco.MjModel.from_xml_string(stage.mjcf)
    data = mujoco.MjData(model)
    pose = model.key_qpos[0].copy()
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    studio = Studio(stage, _CAMERA)
    try:
        return [_picture(studio, stage, data, pose, here, ahead) for here, ahead in _views(stage, data)]
    finally:
        studio.close()


def _views(stage: Stage, data: mujoco.MjData) -> list[tuple[list[int], Array]]:
    """Return groups of tags that one camera sees, with the direction from the robot to it."""
    faces = {n: stage.axes @ data.site(site).xmat.reshape(3, 3)[:, 2] for n, (site, _) in stage.tags.items()}
    left = list(faces)
    views = []
    while left:
        middle = np.mean([faces[n] for n in left], axis=0)
        middle = faces[left[0]] if np.linalg.norm(middle) < 0.3 else middle
        ahead = np.array([middle[0] - 0.25, middle[1], max(middle[2], 0.0) + 0.4])
        if np.linalg.norm(ahead[:2]) < 0.3:
            ahead[1] -= 0.5
        ahead /= np.linalg.norm(ahead)
        here = [n for n in left if faces[n] @ ahead > _FACES] or [left[0]]
        views.append((here, ahead))
        left = [n for n in left if n not in here]
    return views


def _picture(
    studio: Studio, stage: Stage, data: mujoco.MjData, pose: Array, here: Sequence[int], ahead: Array
) -> Image.Image:
    """Return the robot from a direction, with some of its tags named."""
    corners = robot_corners(data) @ stage.axes.T
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    radius = 0.5 * float(np.linalg.norm(np.ptp(corners, axis=0)))
    far = 0.95 * radius / math.sin(math.atan(0.5 * _CAMERA.size[1] / _CAMERA.focal))
    stand = Stand(_three(middle + far * ahead), _three(middle))
    image = Image.fromarray(studio.still(pose, stand))
    draw = ImageDraw.Draw(image)
    places = studio.pixels(np.array([stage.axes @ data.site(stage.tags[n][0]).xpos for n in here]), stand)
    rows = np.argsort(np.argsort([x for x, _ in places]))
    for number, (x, y), row in zip(here, places, rows, strict=True):
        site, edge = stage.tags[number]
        words = f"{number}: {drawable(site)}, {1e3 * edge:g} mm"
        width = draw.textlength(words, font(24))
        left = float(np.clip(x - 0.5 * width, 8.0, image.width - width - 8.0))
        top = 12.0 + 34.0 * float(row)
        draw.line([(x, top + 28.0), (x, y)], fill=_COLOUR, width=2)
        draw.ellipse((x - 4, y - 4, x + 4, y + 4), fill=_COLOUR)
        draw.text((left, top), words, _COLOUR, font(24), stroke_width=3, stroke_fill=_LINE)
    _draw_forward(draw, studio, stand, middle, radius)
    return image


def _draw_forward(
    draw: ImageDraw.ImageDraw, studio: Studio, stand: Stand, middle: Array, radius: float
) -> None:
    """Draw an arrow in the direction of travel under the robot."""
    low = np.array([middle[0], middle[1], 0.0]) + np.array([0.0, -0.6 * radius, 0.0])
    begin, end = studio.pixels(np.array([low, low + np.array([0.6 * radius, 0.0, 0.0])]), stand)
    draw.line([tuple(begin), tuple(end)], fill=(0, 114, 178), width=4)
    along = (end - begin) / np.linalg.norm(end - begin)
    across = np.array([-along[1], along[0]])
    tip = [tuple(end + 14.0 * along), tuple(end - 8.0 * across), tuple(end + 8.0 * across)]
    draw.polygon(tip, fill=(0, 114, 178))
    draw.text((float(begin[0]), float(begin[1]) + 8.0), "forward", (0, 114, 178), font(20))


def _three(point: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in point)
    return x, y, z
