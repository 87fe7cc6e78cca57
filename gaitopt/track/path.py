"""The path of a tagged body through a film: one pose a picture, or a gap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from gaitopt.robot.rotation import roll_pitch_yaw
from gaitopt.track.bodies import TaggedBody
from gaitopt.track.pose import Pose, cross, follows, poses_of
from gaitopt.track.room import Room, Seen
from gaitopt.track.settings import DEFAULT, TrackSettings

Array = NDArray[np.float64]

_MOST_COST = 25.0
"""Squared error of a picture, in variances, that speaks against a pose at most: errors are not all chance."""

_JUMP_RAD, _AWAY_RAD = 0.09, 0.7
"""Turns between two pictures, and away from the pose before the gait, that speak against a pose by 1."""

_STEP = 1e-6


@dataclass(frozen=True)
class Path:
    """Where a body is in each picture, in the frame of the floor.

    Attributes:
        poses: by picture; None where it was not seen, or not well.
        error_px: standard deviation of the corners in the pictures, pixels.
        left_out: pictures whose pose was left out as an outlier.
        noise: factor from the spread of a pose to its covariance: the variance of a direction.
    """

    poses: tuple[Pose | None, ...]
    error_px: float
    left_out: tuple[int, ...]
    noise: float

    @property
    def seen(self) -> NDArray[np.bool_]:
        """In which pictures the body has a pose, shape (n,)."""
        return np.array([pose is not None for pose in self.poses], dtype=bool)

    def doubted(
        self, body: TaggedBody, cameras: Sequence[Pose | None], doubts: Sequence[Seen], focal: float
    ) -> Path:
        """Return the path with spreads that hold that corners may be off by more than chance.

        Args:
            body: the body.
            cameras: as for `path_of`.
            doubts: how far the corners may be off in each picture: standard deviations by tag, pixels, shape
                (k, 4, 2), of k ways that are independent of each other.
            focal: focal length, pixels.
        """
        poses = list(self.poses)
        for index, (pose, camera) in enumerate(zip(self.poses, cameras, strict=True)):
            if pose is not None and camera is not None:
                poses[index] = _with_doubts(pose, body, camera, doubts[index], focal, self.noise)
        return replace(self, poses=tuple(poses))

    def point(self, own: Array) -> tuple[Array, Array]:
        """Return a point of the body in each picture, m, and its variance, m^2, both of shape (n, 3).

        Args:
            own: the point in the body's frame, m, shape (3,).
        """
        places, variances = (np.full((len(self.poses), 3), np.nan) for _ in range(2))
        for index, pose in enumerate(self.poses):
            if pose is not None:
                arm = pose.turn @ own
                slopes = np.hstack([-cross(arm), np.eye(3)])
                places[index] = pose.shift + arm
                variances[index] = self.noise * np.diag(slopes @ pose.spread @ slopes.T)
        return places, variances

    def angles(self) -> tuple[Array, Array]:
        """Return roll, pitch and yaw in each picture, rad, without jumps, and their variances, (n, 3)."""
        angles, variances = (np.full((len(self.poses), 3), np.nan) for _ in range(2))
        here = np.flatnonzero(self.seen)
        if len(here) == 0:
            return angles, variances
        known = [pose for pose in self.poses if pose is not None]
        turns = np.array([pose.turn for pose in known])
        middle = roll_pitch_yaw(turns)
        angles[here] = np.unwrap(middle, axis=1).T
        slopes = np.stack(
            [(roll_pitch_yaw((np.eye(3) + _STEP * cross(e)) @ turns) - middle) / _STEP for e in np.eye(3)],
            axis=2,
        )  # (3 angles, n, 3 turns)
        spreads = np.array([pose.spread for pose in known])[:, :3, :3]
        variances[here] = self.noise * np.einsum("ant,ntu,anu->na", slopes, spreads, slopes)
        return angles, variances


def path_of(
    body: TaggedBody,
    frames: Sequence[Seen],
    cameras: Sequence[Pose | None],
    room: Room,
    settings: TrackSettings = DEFAULT,
) -> Path:
    """Return the path of a body.

    Args:
        body: the body.
        frames: what is seen in each picture.
        cameras: pose of the floor in the camera's frame of each picture; with a spread where it moves.
        room: lens and floor.
        settings: what is an outlier.
    """
    choices = _choices(body, frames, cameras, room)
    found = [(poses[0], freedom) for poses, freedom in choices if poses]
    if not found:
        return Path((None,) * len(frames), np.nan, (), np.nan)
    usual = float(np.median([pose.error / chi2.median(freedom) for pose, freedom in found]))
    noise = max(usual, (settings.least_px / room.lens.focal) ** 2)
    chosen = _chosen(body, choices, noise)
    noise = max(noise, _mean_noise(chosen, choices, noise, settings))
    poses: list[Pose | None] = []
    left_out = []
    for index, pose in enumerate(chosen):
        if pose is not None and pose.error > settings.outlier**2 * noise * max(choices[index][1], 1):
            left_out.append(index)
            pose = None
        camera = cameras[index]
        if pose is None or camera is None:
            poses.append(None)
            continue
        others = [other for other in choices[index][0] if other is not pose]
        poses.append(_with_camera(_with_others(pose, others, noise), camera, noise))
    return Path(tuple(poses), float(np.sqrt(noise) * room.lens.focal), tuple(left_out), noise)


def _mean_noise(
    chosen: Sequence[Pose | None],
    choices: Sequence[tuple[list[Pose], int]],
    usual: float,
    settings: TrackSettings,
) -> float:
    """Return the mean variance of a direction: moving pictures, which are blurred, count as they are."""
    kept = [
        (pose.error, freedom)
        for pose, (_, freedom) in zip(chosen, choices, strict=True)
        if pose is not None and pose.error <= settings.outlier**2 * usual * freedom
    ]
    return sum(error for error, _ in kept) / max(sum(freedom for _, freedom in kept), 1)


def _choices(
    body: TaggedBody, frames: Sequence[Seen], cameras: Sequence[Pose | None], room: Room
) -> list[tuple[list[Pose], int]]:
    """Return the poses that each picture allows, on the floor, and the numbers that they leave over."""
    choices: list[tuple[list[Pose], int]] = []
    before: list[Pose] = []
    for seen, camera in zip(frames, cameras, strict=True):
        here = [number for number in body.tags if number in seen]
        if camera is None or not here:
            choices.append(([], 0))
            continue
        points = np.concatenate([body.tags[n] for n in here])
        directions = room.lens.directions(np.concatenate([seen[n] for n in here]))
        starts = [pose.seen_from(camera) for pose in before]
        poses = poses_of(points, directions, starts)[:2]
        before = [pose.back(camera) for pose in poses]
        choices.append((before, 2 * len(points) - 6))
    return choices


def _chosen(body: TaggedBody, choices: Sequence[tuple[list[Pose], int]], noise: float) -> list[Pose | None]:
    """Return one pose a picture: of a flat tag's two, those that fit the pictures and each other best."""
    costs: list[float] = []
    trails: list[list[int]] = []
    last: list[Pose] = []
    seen = [(index, poses) for index, (poses, _) in enumerate(choices) if poses]
    for _, poses in seen:
        best = min(pose.error for pose in poses)
        own = [
            min((pose.error - best) / noise, _MOST_COST) + (_turn(pose.turn, body.start) / _AWAY_RAD) ** 2
            for pose in poses
        ]
        if not last:
            costs, trails = own, [[i] for i in range(len(poses))]
        else:
            steps = [
                [
                    c + (_turn(pose.turn, other.turn) / _JUMP_RAD) ** 2
                    for c, other in zip(costs, last, strict=True)
                ]
                for pose in poses
            ]
            froms = [int(np.argmin(step)) for step in steps]
            costs, trails = (
                [own[i] + steps[i][j] for i, j in enumerate(froms)],
                [[*trails[j], i] for i, j in enumerate(froms)],
            )
        last = poses
    chosen: list[Pose | None] = [None] * len(choices)
    if seen:
        for (index, poses), which in zip(seen, trails[int(np.argmin(costs))], strict=True):
            chosen[index] = poses[which]
    return chosen


def _with_others(pose: Pose, others: Sequence[Pose], noise: float) -> Pose:
    """Return a pose whose spread holds that the other pose of a flat tag may be the right one."""
    spread = pose.spread
    for other in others:
        angle = _turn(pose.turn, other.turn)
        against = (other.error - pose.error) / noise + 2.0 * (angle / _JUMP_RAD) ** 2
        likely = 1.0 / (1.0 + np.exp(np.clip(0.5 * against, -50.0, 50.0)))
        turn = Rotation.from_matrix(other.turn @ pose.turn.T).as_rotvec()
        away = np.concatenate([turn, other.shift - pose.shift])
        spread = None if spread is None else spread + likely * np.outer(away, away) / noise
    return replace(pose, spread=spread)


def _with_camera(pose: Pose, camera: Pose, noise: float) -> Pose:
    """Return a pose whose spread holds that of a moving camera, too."""
    if camera.spread is None or pose.spread is None:
        return pose
    back = camera.turn.T
    arm = cross(camera.turn @ pose.shift)
    slopes = np.block([[-back, np.zeros((3, 3))], [back @ arm, -back]])
    return replace(pose, spread=pose.spread + slopes @ camera.spread @ slopes.T / noise)


def _with_doubts(
    pose: Pose, body: TaggedBody, camera: Pose, doubts: Seen, focal: float, noise: float
) -> Pose:
    """Return a pose whose spread holds that its corners may be off by more than chance."""
    here = [number for number in body.tags if number in doubts]
    if pose.spread is None or not here:
        return pose
    points = np.concatenate([body.tags[n] for n in here])
    ways = np.concatenate([doubts[n] for n in here], axis=1) / focal
    away = follows(points, pose, camera) @ ways.reshape(len(ways), -1).T
    return replace(pose, spread=pose.spread + away @ away.T / noise)


def _turn(one: Array, other: Array) -> float:
    """Return the angle between two turns, rad."""
    return float(np.arccos(np.clip(0.5 * (np.trace(one.T @ other) - 1.0), -1.0, 1.0)))


def cameras_of(frames: Sequence[Seen], room: Room, settings: TrackSettings = DEFAULT) -> list[Pose | None]:
    """Return the pose of the floor in the camera's frame of each picture; None where no floor is seen.

    That of a moving camera has the covariance of its turn and shift as its spread.
    """
    cameras: list[Pose | None] = []
    before: Pose | None = None
    for seen in frames:
        camera = room.camera_of(seen, before)
        cameras.append(camera)
        before = camera or before
    if room.camera is not None:
        return cameras
    counts = [8 * sum(n in seen for n in room.floor) for seen in frames]
    known = [(c.error, n) for c, n in zip(cameras, counts, strict=True) if c is not None]
    usual = [error / chi2.median(n - 6) for error, n in known]
    variance = max(float(np.median(usual)) if usual else 0.0, (settings.least_px / room.lens.focal) ** 2)
    return [
        None if c is None or c.spread is None else replace(c, spread=variance * c.spread) for c in cameras
    ]


def shares(frames: Sequence[Mapping[int, Array]], numbers: Sequence[int]) -> dict[int, float]:
    """Return in which share of the pictures each tag is seen."""
    return {n: sum(n in frame for frame in frames) / max(len(frames), 1) for n in numbers}
