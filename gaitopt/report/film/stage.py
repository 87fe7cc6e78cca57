"""What a synthetic phone films: a tagged robot that walks beside a floor sheet, and the truth about it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import Problem
from gaitopt.robot.boxes import box_corners
from gaitopt.robot.rotation import roll_pitch_yaw
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator
from gaitopt.track.floor_sheet import SHEET_MM, SHEET_TAG_MM

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Stand:
    """Where the phone is: its place and what it looks at, m, in the problem's axes."""

    place: tuple[float, float, float]
    target: tuple[float, float, float] = (0.1, 0.0, 0.02)


@dataclass(frozen=True)
class Stage:
    """What is filmed: a robot, the tags on it, and those on the floor.

    Attributes:
        mjcf: the robot.
        axes: forward, left and up as rows.
        tags: by number the site and the edge, m.
        floor: by number the middle in the problem's axes, m, the turn about up, rad, and the edge, m.
    """

    mjcf: str
    axes: Array
    tags: Mapping[int, tuple[str, float]]
    floor: Mapping[int, tuple[tuple[float, float], float, float]]


def stage_of(problem: Problem, sheet: tuple[float, float] = (0.12, -0.14)) -> Stage:
    """A problem's robot with its tags, beside a floor sheet whose middle lies at a place, m.

    Args:
        problem: the robot's problem.
        sheet: forward and left, m.
    """
    tags = {int(n): (str(t.site), 1e-3 * t.size_mm) for n, t in problem.file.tags.items() if t.site}
    return Stage(nominal_mjcf(problem), problem.roles.axes, tags, sheet_at(*sheet))


def walk(problem: Problem, gait: str, seconds: float) -> Callable[[float], Array]:
    """What a problem's robot does with a gait: MuJoCo's qpos at a time, s."""
    drive = problem.find_gait(gait)
    trajectory = Simulator.build(problem).run(drive, duration=seconds + 0.1, poses=True)
    if trajectory.status != "ok":
        raise GaitoptError(f"{gait}: the simulation failed: {trajectory.status}")
    return motion_of(trajectory)


def motion_of(trajectory: Trajectory) -> Callable[[float], Array]:
    """MuJoCo's qpos at a time, s, of a trajectory with poses.

    Raises:
        ValueError: it has none.
    """
    time, poses = trajectory.time, trajectory.poses
    if poses is None:
        raise ValueError("a trajectory without poses")
    return lambda t: poses[np.clip(np.searchsorted(time, t), 0, len(time) - 1)]


def truth(problem: Problem, stage: Stage, motion: Callable[[float], Array], times: Array) -> dict[str, Array]:
    """The signals of marker, tagged sites and joints at some times, m or rad."""
    model = mujoco.MjModel.from_xml_string(stage.mjcf)
    data = mujoco.MjData(model)
    found: dict[str, list[float]] = {}
    for at in times:
        data.qpos[:] = motion(float(at))
        mujoco.mj_kinematics(model, data)
        values: dict[str, Array] = {}
        if problem.roles.marker:
            values |= {"marker": stage.axes @ data.site(problem.roles.marker).xpos}
        for site, _ in stage.tags.values():
            turn = stage.axes @ data.site(site).xmat.reshape(1, 3, 3)
            values[f"site.{site}"] = np.concatenate(
                [stage.axes @ data.site(site).xpos, roll_pitch_yaw(turn)[:, 0]]
            )
        for name, parts in values.items():
            for part, value in zip(("x", "y", "z", "roll", "pitch", "yaw"), parts, strict=False):
                found.setdefault(f"{name}.{part}", []).append(float(value))
        for j in range(model.njnt):
            if model.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE.value:
                angle = float(data.qpos[model.jnt_qposadr[j]])
                found.setdefault(f"joint.{model.joint(j).name}", []).append(angle)
    return {name: np.array(series) for name, series in found.items()}


def sheet_at(x: float, y: float, turn: float = 0.0) -> dict[int, tuple[tuple[float, float], float, float]]:
    """The tags of a floor sheet whose middle lies at a place, m, turned about up, rad."""
    c, s = math.cos(turn), math.sin(turn)
    found = {}
    for number, (along, left) in SHEET_MM.items():
        a, b = 1e-3 * along, 1e-3 * left
        found[number] = ((x + c * a - s * b, y + s * a + c * b), turn, 1e-3 * SHEET_TAG_MM)
    return found


def looking(stand: Stand) -> tuple[Array, Array]:
    """Turn and shift from the problem's axes to a camera's: x right, y down, z ahead."""
    place, target = np.array(stand.place), np.array(stand.target)
    ahead = (target - place) / np.linalg.norm(target - place)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    turn = np.stack([right, np.cross(ahead, right), ahead])
    return turn, -turn @ place


def robot_corners(data: mujoco.MjData) -> Array:
    """Return the corners of the boxes around the robot's visible geoms in the world, m, shape (n, 3)."""
    model = data.model
    own = np.flatnonzero((model.geom_bodyid > 0) & (model.geom_rgba[:, 3] > 0.0))
    return box_corners(data, own)
