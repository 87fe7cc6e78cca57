"""Ties between channels: the gait space of a robot whose servos move alike, mirrored or one after another."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from gaitopt.gait.gait import Channel, Gait
from gaitopt.gait.space import ChannelSpace, GaitSpace, Range, Variable

_UNEVEN = 0.1
"""How uneven a nearly even wave is: share of a cycle for its duty, of half of the travel for its middle."""


@dataclass(frozen=True)
class Tie:
    """How a channel follows another one: the same wave, but for its phase and its sign.

    Attributes:
        like: the other channel; it may follow a third one.
        shift: cycles that this channel is ahead of it.
        by: name of a shift that the search chooses, in addition; empty for none.
        times: how often that shift counts: -1 for behind.
        mirrored: whether its angles have the other sign.
    """

    like: str
    shift: float = 0.0
    by: str = ""
    times: int = 1
    mirrored: bool = False


@dataclass(frozen=True)
class Follower:
    """How a channel follows one that is free, through all ties between them.

    Attributes:
        leader: the free channel.
        shift: cycles that it is ahead of it.
        by: how often each shift that the search chooses counts.
        sign: 1, or -1 for mirrored angles.
    """

    leader: str
    shift: float = 0.0
    by: Mapping[str, int] = field(default_factory=dict)
    sign: int = 1

    def after(self, tie: Tie) -> Follower:
        """Return how a channel follows that is tied to this one."""
        by = dict(self.by)
        if tie.by:
            by[tie.by] = by.get(tie.by, 0) + tie.times
        return Follower(self.leader, self.shift + tie.shift, by, -self.sign if tie.mirrored else self.sign)

    def ahead(self, shifts: Mapping[str, float]) -> float:
        """Return the cycles that it is ahead of its leader."""
        return self.shift + sum(times * shifts[name] for name, times in self.by.items())


@dataclass(frozen=True)
class TiedSpace:
    """The gaits of a `GaitSpace` that obey some ties, as points of a smaller unit box.

    Its coordinates are those of the gait space of the free channels, then the shifts that are chosen.

    Attributes:
        name: what the ties make: ``trot``, or ``ties``.
        full: the space of all gaits.
        followers: how each channel follows; a free one follows itself.
        shifts: bounds of the shifts that are chosen, cycles.
        middles: channels whose waves are nearly the same to both sides of these angles, deg.
    """

    name: str
    full: GaitSpace
    followers: Mapping[str, Follower]
    shifts: Mapping[str, Range]
    middles: Mapping[str, float]

    @staticmethod
    def of(
        name: str,
        full: GaitSpace,
        ties: Mapping[str, Tie],
        shifts: Mapping[str, Range],
        middles: Mapping[str, float] = MappingProxyType({}),
    ) -> TiedSpace:
        """Return the space of ties.

        Raises:
            ValueError: channels are tied in a circle, or a channel can do nothing that its leader can.
        """
        space = TiedSpace(name, full, {c: _follower(c, ties) for c in full.channels}, shifts, middles)
        space.free  # noqa: B018  its bounds are checked
        return space

    @cached_property
    def free(self) -> GaitSpace:
        """The space of the free channels: each may do what all that follow it may do, too."""
        channels = {}
        for name in self.full.channels:
            if self.followers[name].leader == name:
                followers = [c for c, follower in self.followers.items() if follower.leader == name]
                common = _common(name, [(self.full.channels[c], self.followers[c].sign) for c in followers])
                middle = self.middles.get(name)
                channels[name] = common if middle is None else _nearly_even(common, middle)
        return replace(self.full, channels=channels)

    @property
    def variables(self) -> list[Variable]:
        """The coordinates in order."""
        return [*self.free.variables, *(Variable(f"shifts.{name}") for name in self.shifts)]

    @property
    def circular(self) -> NDArray[np.bool_]:
        """Which coordinates are circular, shape (d,)."""
        return np.array([variable.circular for variable in self.variables])

    def decode(self, point: NDArray[np.float64], name: str = "") -> Gait:
        """Return the gait at a point, shape (d,); every point is a gait inside the bounds."""
        own, shares = np.split(point, [len(self.free.variables)])
        leaders = self.free.decode(own)
        bounds = self.shifts.items()
        shifts = {
            key: low + float(np.clip(share, 0.0, 1.0)) * (high - low)
            for share, (key, (low, high)) in zip(shares, bounds, strict=True)
        }
        channels = {
            c: leaders.channels[c] if f.leader == c else _followed(leaders.channels[f.leader], f, shifts)
            for c, f in self.followers.items()
        }
        return Gait(leaders.period_s, channels, name)

    def encode(self, gait: Gait) -> NDArray[np.float64]:
        """Return the point of the gait whose free channels are those of `gait`, shape (d,).

        The shifts that are chosen are those of the first channel that each one moves by itself.
        """
        own = {name: gait.channels[name] for name in self.free.channels}
        shares = [self._share(name, gait) for name in self.shifts]
        return np.append(self.free.encode(replace(gait, channels=own)), shares)

    def lift(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points of this space as points of the space of all gaits, shape (n, full d)."""
        return np.array([self.full.encode(self.decode(point)) for point in points])

    def project(self, points: Iterable[NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return for points of the space of all gaits those of this one, shape (n, d)."""
        return np.array([self.encode(self.full.decode(point)) for point in points])

    def _share(self, name: str, gait: Gait) -> float:
        low, high = self.shifts[name]
        for channel, follower in self.followers.items():
            if set(follower.by) == {name}:
                leader = gait.channels[follower.leader]
                ahead = gait.channels[channel].phase - leader.phase - follower.shift
                value = (ahead + (0.0 if follower.sign > 0 else leader.duty)) / follower.by[name]
                nearest = value - round(value - 0.5 * (low + high))
                return min(max((nearest - low) / (high - low), 0.0), 1.0) if high > low else 0.0
        return 0.5


def _follower(channel: str, ties: Mapping[str, Tie]) -> Follower:
    """Return how a channel follows a free one."""
    path = [channel]
    while path[-1] in ties:
        following = ties[path[-1]].like
        if following in path:
            raise ValueError(f"ties.{channel}: found a circle, {' like '.join([*path, following])}")
        path.append(following)
    follower = Follower(path[-1])
    for name in reversed(path[:-1]):
        follower = follower.after(ties[name])
    return follower


def _common(name: str, followers: list[tuple[ChannelSpace, int]]) -> ChannelSpace:
    """Return what a channel may do so that each follower stays within its own bounds."""

    def within(ranges: Iterable[Range], what: str) -> Range:
        ranges = list(ranges)
        low, high = max(low for low, _ in ranges), min(high for _, high in ranges)
        if low > high:
            raise ValueError(f"ties: {what} of {name} and of what follows it have nothing in common")
        return low, high

    return ChannelSpace(
        within((_opposite(space.range_deg, 0.0, sign) for space, sign in followers), "range_deg"),
        within((space.amplitude_deg for space, _ in followers), "amplitude_deg"),
        within((_opposite(space.duty, 1.0, sign) for space, sign in followers), "duty"),
        within((space.smoothing for space, _ in followers), "smoothing"),
    )


def _nearly_even(space: ChannelSpace, middle_deg: float) -> ChannelSpace:
    """Return what a channel may do to both sides of an angle nearly alike, as far as its bounds allow."""
    low, high = space.range_deg
    aside = _UNEVEN * 0.5 * (high - low)
    shortest, longest = (min(max(0.5 + side * _UNEVEN, space.duty[0]), space.duty[1]) for side in (-1, 1))
    return replace(space, duty=(shortest, longest), middle_deg=(middle_deg - aside, middle_deg + aside))


def _opposite(range_: Range, whole: float, sign: int) -> Range:
    """Return a range, or for mirrored angles what is left of `whole`."""
    low, high = range_
    return (low, high) if sign > 0 else (whole - high, whole - low)


def _followed(leader: Channel, follower: Follower, shifts: Mapping[str, float]) -> Channel:
    """Return the wave of a channel that follows another one.

    A mirrored wave keeps the sign of its amplitude: it is up while the other one is down.
    """
    ahead = follower.ahead(shifts)
    if follower.sign > 0:
        return leader.model_copy(update={"phase": _cycle(leader.phase + ahead)})
    return leader.model_copy(
        update={
            "duty": 1.0 - leader.duty,
            "phase": _cycle(leader.phase + ahead - leader.duty),
            "offset_deg": -leader.offset_deg - leader.amplitude_deg,
        }
    )


def _cycle(phase: float) -> float:
    """Return a phase within a cycle, from 0 to below 1; ``phase % 1.0`` is 1.0 just below 0."""
    return math.fmod(math.fmod(phase, 1.0) + 1.0, 1.0)
