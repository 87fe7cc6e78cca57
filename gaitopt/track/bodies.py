"""Tagged bodies of a robot: which tags sit on which body, and the joints between two of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError, unknown_name
from gaitopt.problem.instruments import scalar_joints
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem
from gaitopt.problem.tags import Tag
from gaitopt.track.pose import Pose, cross, turn_vector
from gaitopt.track.tag import corners

Array = NDArray[np.float64]

Relative = tuple[Array, Array]
"""Turn, shape (3, 3), and shift, m, shape (3,)."""

Tie = tuple[int, int, tuple[float, ...]]
"""An equality constraint: dependent joint, leading joint, and the five coefficients."""

_STEP, _MOVES = 1e-5, 1e-7
"""Turn of a joint in a difference quotient, rad, and the motion that counts as one, m or rad."""

_ROUNDS, _STRIDE, _SETTLED = 20, 0.4, 1e-4
"""Most rounds of a fit of angles, the longest step in one, and that after which it has settled, rad."""

_OTHER = 0.02
"""Angles further apart than this are other angles, rad: a little bent, an arch is as long up as down."""

_BEYOND = 0.1
"""How far beyond its range an angle may be found, rad."""

_SHARES = (0.15, 0.4, 0.65, 0.9)
"""Where in its range a joint begins in a fit."""


@dataclass(frozen=True)
class TaggedBody:
    """A body of the robot, and the tags on it.

    Attributes:
        site: the site of its first tag; poses of the body are those of this site.
        body: its number in the model.
        tags: by number the corners of each tag in the site's frame, m, shape (4, 3).
        marker: where the problem's marker is in the site's frame, m, shape (3,), if it is on this body.
        start: turn of the site in the problem's axes before the gait, shape (3, 3).
        height: of the site over the floor before the gait, m.
    """

    site: str
    body: int
    tags: Mapping[int, Array]
    marker: Array | None
    start: Array
    height: float


@dataclass(frozen=True)
class TaggedRobot:
    """A robot with its tags.

    Attributes:
        problem: the robot's problem.
        model: its model.
        bodies: the bodies that have tags.
    """

    problem: Problem
    model: mujoco.MjModel
    bodies: tuple[TaggedBody, ...]

    @staticmethod
    def of(problem: Problem, tags: Mapping[int, Tag], scale: float = 1.0) -> TaggedRobot:
        """Return a robot with some tags.

        Args:
            problem: the robot's problem.
            tags: the tags that have a site, by number.
            scale: what the printer made of 1 mm, mm.

        Raises:
            GaitoptError: there are none, a site is unknown, or the model is broken.
        """
        model = build_model(problem)
        data = mujoco.MjData(model)
        data.qpos[:] = model.key_qpos[0]
        mujoco.mj_kinematics(model, data)
        axes = problem.roles.axes
        sites = [model.site(i).name for i in range(model.nsite)]
        found: dict[int, TaggedBody] = {}
        for number, tag in sorted(tags.items()):
            if tag.site not in sites:
                raise unknown_name(f"tag {number}", "site", tag.site, filter(None, sites))
            body = int(model.body_weldid[model.site(tag.site).bodyid[0]])
            turn, place = _site(data, tag.site)
            own = corners(1e-3 * scale * tag.size_mm) @ turn.T + place
            first = found.get(body)
            if first is None:
                marker, height = _marker(problem, data, body, str(tag.site)), float((axes @ place)[2])
                first = TaggedBody(str(tag.site), body, {}, marker, axes @ turn, height)
            base, origin = _site(data, first.site)
            found[body] = replace(first, tags={**first.tags, number: (own - origin) @ base})
        if not found:
            raise GaitoptError(
                f'{problem.source}: no tag sits on the robot; say where: [tags.0] with site = "NAME", '
                "or --tag 0=NAME"
            )
        return TaggedRobot(problem, model, tuple(found.values()))

    def numbers(self) -> list[int]:
        """Return the tags on the robot."""
        return [number for body in self.bodies for number in body.tags]

    def links(self) -> list[Link]:
        """Return pairs of tagged bodies with joints between them, the fewest joints first."""
        pairs = [(a, b) for i, a in enumerate(self.bodies) for b in self.bodies[i + 1 :]]
        links = [Link.of(self.model, a, b) for a, b in pairs]
        return sorted((link for link in links if link.joints), key=lambda link: len(link.joints))


def _leaders_first(ties: Sequence[Tie]) -> tuple[Tie, ...]:
    """Return constraints in an order in which each leading joint is known; of a ring, in any."""
    ordered, left = [], list(ties)
    while left:
        waiting = {led for led, _, _ in left}
        ready = [tie for tie in left if tie[1] not in waiting] or left
        ordered += ready
        left = [tie for tie in left if tie not in ready]
    return tuple(ordered)


def _site(data: mujoco.MjData, name: str | None) -> Relative:
    """Return turn and place of a site in the world."""
    site = data.site(name)
    return site.xmat.reshape(3, 3).copy(), site.xpos.copy()


def _marker(problem: Problem, data: mujoco.MjData, body: int, site: str) -> Array | None:
    """Return the marker's place in the frame of a site of the same body; None where it is on another."""
    marker = problem.roles.marker
    if marker is None or data.model.body_weldid[data.model.site(marker).bodyid[0]] != body:
        return None
    turn, place = _site(data, site)
    return np.asarray((data.site(marker).xpos - place) @ turn)


@dataclass(frozen=True)
class Angles:
    """The angles of joints that explain the poses of two bodies.

    Attributes:
        values: the angles, rad, shape (n,).
        variances: their variances for errors of 1 in each direction, shape (n,).
        away: the distance that no angle explains, m.
        error: sum of the squared errors in standard deviations.
        doubt: by how much the error of the best other angles is larger; infinite where none were found.
    """

    values: Array
    variances: Array
    away: float
    error: float
    doubt: float = math.inf


@dataclass(frozen=True)
class Link:
    """Two tagged bodies, and the joints that move one against the other.

    Attributes:
        model: the robot.
        one, other: the bodies.
        joints: the joints that are free to move, by number; others follow through equality constraints.
        equalities: dependent joint, leading joint and the five coefficients of each constraint; leaders come
            first.
        data: where the model's poses are computed.
    """

    model: mujoco.MjModel
    one: TaggedBody
    other: TaggedBody
    joints: tuple[int, ...]
    equalities: tuple[Tie, ...]
    data: mujoco.MjData

    @staticmethod
    def of(model: mujoco.MjModel, one: TaggedBody, other: TaggedBody) -> Link:
        """Return the joints between two bodies."""
        rows = [i for i in range(model.neq) if model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT]
        rows = [i for i in rows if model.eq_active0[i] and model.eq_obj2id[i] >= 0]
        ties = tuple(
            (int(model.eq_obj1id[i]), int(model.eq_obj2id[i]), tuple(map(float, model.eq_data[i, :5])))
            for i in rows
        )
        led = {tie[0] for tie in ties}
        ties = _leaders_first(ties)
        free = [j for j in scalar_joints(model) if j not in led]
        data = mujoco.MjData(model)
        link = Link(model, one, other, tuple(free), ties, data)
        slopes = [link._slopes(q) for q in link._starts()]  # some poses are singular, such as a flat arch
        moving = np.abs(slopes).max(axis=(0, 1), initial=0.0) > _MOVES
        return Link(model, one, other, tuple(j for j, m in zip(free, moving, strict=True) if m), ties, data)

    def rest(self) -> Array:
        """Return the joints' angles before the gait, shape (n,)."""
        held = self.model.key_qpos[0]
        return np.array([held[self.model.jnt_qposadr[j]] for j in self.joints], dtype=float)

    def names(self) -> list[str]:
        """Return the joints' names."""
        return [self.model.joint(j).name for j in self.joints]

    def angles(self, one: Pose, other: Pose, start: Array | None, scale: float = 0.0) -> Angles | None:
        """Return the joints' angles that explain two poses best; None where the poses do not determine them.

        Args:
            one, other: poses of the two bodies in one frame, with their spreads.
            start: angles to begin with, shape (n,); several are tried without them.
            scale: standard deviation of how much larger all looks than it is, relative, over that of a
                direction.
        """
        seen = _relative(one, other)
        weights = np.asarray(np.linalg.pinv(_relative_spread(one, other, seen, scale)), dtype=float)
        found = [self._from(q, seen, weights) for q in (self._starts() if start is None else [start])]
        known = [angles for angles in found if angles is not None]
        if not known:
            return None
        best = min(known, key=lambda angles: angles.error)
        others = [a.error for a in known if np.abs(a.values - best.values).max() > _OTHER]
        return replace(best, doubt=min(others, default=math.inf) - best.error)

    def _starts(self) -> list[Array]:
        """Return angles to begin with: those before the gait, and others within the joints' ranges."""
        ranges = [self._range(joint) for joint in self.joints]
        shares = (np.array([low + s * (high - low) for low, high in ranges], dtype=float) for s in _SHARES)
        return [self.rest(), *shares]

    def _range(self, joint: int) -> tuple[float, float]:
        low, high = self.model.jnt_range[joint]
        return (float(low), float(high)) if self.model.jnt_limited[joint] else (-1.5, 1.5)

    def _from(self, start: Array, seen: Relative, weights: Array) -> Angles | None:
        """Return the angles that explain a relative pose best, near others."""
        q = start.copy()
        for _ in range(_ROUNDS):
            slopes = self._slopes(q)
            normal = slopes.T @ weights @ slopes
            if not np.isfinite(normal).all() or np.linalg.matrix_rank(normal) < len(q):
                return None
            step = np.linalg.solve(normal, slopes.T @ weights @ _difference(seen, self.relative(q)))
            q = np.asarray(q + np.clip(step, -_STRIDE, _STRIDE), dtype=float)
            if np.abs(step).max() < _SETTLED:
                break
        else:
            return None
        left = _difference(seen, self.relative(q))
        inside = all(
            low - _BEYOND <= angle <= high + _BEYOND
            for angle, (low, high) in zip(q, map(self._range, self.joints), strict=True)
        )
        if not inside:
            return None
        away = float(np.linalg.norm(left[3:]))
        return Angles(q, np.asarray(np.diag(np.linalg.inv(normal))), away, float(left @ weights @ left))

    def straight(self, q: Array, reach: Array) -> NDArray[np.bool_]:
        """Return which angles move the bodies about alike within a reach of them, shape (n,).

        An angle does not where it is near a singular pose: a flat arch gets shorter either way.

        Args:
            q: the angles, rad, shape (n,).
            reach: how far from them, rad, shape (n,).
        """
        found = np.zeros(len(q), dtype=bool)
        for index in range(len(q)):
            step = np.zeros_like(q)
            step[index] = reach[index]
            low, middle, high = (self._slopes(p)[:, index] for p in (q - step, q, q + step))
            found[index] = np.linalg.norm(high - low) < np.linalg.norm(middle)
        return found

    def _slopes(self, q: Array) -> Array:
        """Return how the relative pose changes with each angle, shape (6, n)."""
        columns = []
        for index in range(len(q)):
            step = np.zeros_like(q)
            step[index] = _STEP
            columns.append(_difference(self.relative(q + step), self.relative(q - step)) / (2.0 * _STEP))
        return np.stack(columns, axis=1) if columns else np.empty((6, 0))

    def relative(self, q: Array) -> Relative:
        """Return turn and shift of the other body in the frame of the one, by the model."""
        data, (first, second) = self.data, self._sites
        qpos = self._rest.copy()
        qpos[self._addresses] = q
        for led, leading, coefficients in self._ties:
            away = qpos[leading] - self.model.qpos0[leading]
            value = 0.0
            for coefficient in reversed(coefficients):
                value = value * away + coefficient
            qpos[led] = self.model.qpos0[led] + value
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, data)
        turns, places = data.site_xmat, data.site_xpos
        back = turns[first].reshape(3, 3).T
        return back @ turns[second].reshape(3, 3), back @ (places[second] - places[first])

    # What each of thousands of poses needs is looked up once.

    @cached_property
    def _rest(self) -> Array:
        return np.array(self.model.key_qpos[0])

    @cached_property
    def _addresses(self) -> list[int]:
        return [int(self.model.jnt_qposadr[joint]) for joint in self.joints]

    @cached_property
    def _ties(self) -> tuple[Tie, ...]:
        """The constraints, with the places of the joints' angles."""
        place = self.model.jnt_qposadr.tolist()
        return tuple((place[led], place[leading], numbers) for led, leading, numbers in self.equalities)

    @cached_property
    def _sites(self) -> tuple[int, int]:
        one, other = (self.model.site(body.site).id for body in (self.one, self.other))
        return int(one), int(other)


def _relative(one: Pose, other: Pose) -> Relative:
    return one.turn.T @ other.turn, one.turn.T @ (other.shift - one.shift)


def _difference(one: Relative, other: Relative) -> Array:
    """Return turn, rad, and shift, m, by which one relative pose differs from another, shape (6,)."""
    return np.concatenate([turn_vector(one[0] @ other[0].T), one[1] - other[1]])


def _relative_spread(one: Pose, other: Pose, seen: Relative, scale: float) -> Array:
    """Return the covariance of turn and shift of a relative pose, for errors of 1, shape (6, 6).

    If all patterns look larger than they are, then so does the distance of two.
    """
    back = one.turn.T
    arm = cross(other.shift - one.shift)
    zero = np.zeros((3, 3))
    by_other = np.block([[back, zero], [zero, back]])
    by_one = np.block([[-back, zero], [back @ arm, -back]])
    first = np.eye(6) if one.spread is None else one.spread
    second = np.eye(6) if other.spread is None else other.spread
    alike = np.concatenate([np.zeros(3), scale * seen[1]])
    by_chance = by_other @ second @ by_other.T + by_one @ first @ by_one.T
    return np.asarray(by_chance + np.outer(alike, alike))
