"""A search for commands that set alternatives apart: all shapes in some sizes, then sizes near the best."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaitopt.core.firsts import firsts
from gaitopt.diagnose.judge.command_score import CommandScorer, Separation
from gaitopt.diagnose.judge.command_settings import COMMANDS, CommandSettings
from gaitopt.effects.parts import ALL
from gaitopt.gait.command_shapes import SHAPES, ShapedCommands, Size, Travel, shaped
from gaitopt.gait.played_commands import PlayedCommands
from gaitopt.problem.problem import Problem
from gaitopt.problem.start import start_targets


@dataclass(frozen=True)
class ScoredCommands:
    """Commands, and how far they set alternatives apart.

    Attributes:
        made: the commands, with their shape and size.
        played: the same as a player sends them.
        separation: how far the alternatives are apart.
    """

    made: ShapedCommands
    played: PlayedCommands
    separation: Separation

    @property
    def words(self) -> str:
        """What it is, such as ``step of 30 degrees on arm``."""
        degrees = float(np.rad2deg(self.made.amplitude_rad))
        where = "all channels" if self.made.channel == ALL else self.made.channel
        return f"{self.made.shape.name} of {degrees:.3g} degrees on {where}"

    def to_dict(self) -> dict[str, object]:
        """Return a row of ``runners_up``."""
        return {
            "shape": self.made.shape.name,
            "channel": self.made.channel,
            "amplitude_deg": round(float(np.rad2deg(self.made.amplitude_rad)), 3),
            "duration_s": self.played.commands.duration_s,
            "expected_separation": self.separation.mean,
            "doubt": self.separation.doubt,
        }


@dataclass(frozen=True)
class CommandSearch:
    """A search among shapes, sizes and channels.

    Attributes:
        problem: the problem whose channels are commanded.
        travel: how far and how fast they may move.
        known: commands that are not tried, by their `LoggedCommands.commands_key`.
        seed: seed of the commands that are drawn.
        settings: see `CommandSettings`.
    """

    problem: Problem
    travel: Travel
    known: frozenset[str]
    seed: int
    settings: CommandSettings = COMMANDS

    def coarse(self, scorer: CommandScorer) -> list[ScoredCommands]:
        """Return commands of all shapes in some sizes, with their separations."""
        return self._scored(scorer, self._grid(), ())

    def refined(self, scorer: CommandScorer, found: Sequence[ScoredCommands]) -> list[ScoredCommands]:
        """Return these and others near the best of them, with their separations, the best first."""
        best = best_of_each(found)[: self.settings.finalists]
        near = [made for one in best for made in self._near(one.made)]
        return sorted([*found, *self._scored(scorer, near, found)], key=_rank)

    def _grid(self) -> Iterator[ShapedCommands | None]:
        """Yield commands of every shape and some sizes, for each channel, and for all of them together."""
        count = len(self.problem.channel_names)
        several = [tuple(range(count))] if count > 1 else []
        for moving in [*((index,) for index in range(count)), *several]:
            for shape in SHAPES:
                for time_s in shape.times_s[: 1 if several else None]:
                    for share in self.settings.shares:
                        for signed in (share,) if shape.both_sides else (share, -share):
                            yield shaped(shape, Size(signed, time_s, moving), self.travel, self.seed)

    def _near(self, made: ShapedCommands) -> Iterator[ShapedCommands | None]:
        """Yield commands of one shape with other amplitudes, times and draws."""
        size = made.size
        for draw, factor in enumerate(self.settings.factors, start=1):
            share = float(np.clip(factor * size.share, -self.settings.largest, self.settings.largest))
            yield shaped(made.shape, replace(size, share=share), self.travel, self.seed)
            yield shaped(
                made.shape, replace(size, time_s=factor * size.time_s, draw=draw), self.travel, self.seed
            )

    def _scored(
        self,
        scorer: CommandScorer,
        tried: Iterable[ShapedCommands | None],
        before: Sequence[ScoredCommands],
    ) -> list[ScoredCommands]:
        """Return commands with their separations, without those that are known or were tried before."""
        servos = {name: bounds.servo for name, bounds in self.problem.file.channels.items()}
        keys = {*self.known, *(one.played.commands.commands_key for one in before)}
        fresh: list[tuple[ShapedCommands, PlayedCommands]] = []
        for made in tried:
            played = None if made is None else PlayedCommands.of(made.commands, servos)
            if made is not None and played is not None and played.commands.commands_key not in keys:
                keys.add(played.commands.commands_key)
                fresh.append((made, played))
        separations = scorer.separations([played.commands for _, played in fresh])
        rows = zip(fresh, separations, strict=True)
        return [ScoredCommands(*pair, apart) for pair, apart in rows if apart is not None]


def best_of_each(found: Sequence[ScoredCommands]) -> list[ScoredCommands]:
    """Return the best commands of each shape, channel and side, the best first."""
    return firsts(
        sorted(found, key=_rank),
        lambda one: (one.made.shape.name, one.made.channel, one.made.size.share > 0.0),
    )


def _rank(one: ScoredCommands) -> tuple[float, float]:
    """Return what is small for good commands: doubt first; where that is as good as none, the distance."""
    return round(one.separation.doubt, 4), -one.separation.mean


def travel_of(problem: Problem) -> Travel:
    """Return how far and how fast commands may move a problem's servos.

    The range is the channel's, and where its servo is calibrated also what pulses the servo takes.
    """
    ranges, speeds = [], []
    for bounds in problem.file.channels.values():
        low, high = bounds.range_deg
        if bounds.servo.is_calibrated:
            least, most = bounds.servo.range_deg
            low, high = max(low, least), min(high, most)
        ranges.append((low, max(low, high)))
        speeds.append(bounds.servo.speed_limit_deg_s)
    span = np.deg2rad(ranges)
    rest = np.clip(start_targets(problem), *span.T)
    return Travel(tuple(problem.channel_names), rest, span, np.deg2rad(speeds))
