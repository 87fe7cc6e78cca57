"""Tuning constants of the next commands."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CommandSettings:
    """How the next commands are chosen.

    Attributes:
        shares: amplitudes that are tried first, as shares of the room in the range. The largest leaves room
            for an overshoot.
        factors: what the amplitudes of the best commands are multiplied with to find better ones.
        largest: largest share of the room.
        finalists: the best commands near which others are tried, each of another shape or channel.
        alternatives: robots that count, at most, the most probable ones.
        least_probability: and they are at least this probable, relative to the first.
        step: relative change of a parameter that commands are to show, where one explanation is left.
        motion_share: floor that grows with the motion, as a share of its RMS: repeats of a command on a bench
            with a hobby servo differ by 1 to 5 % of it.
        leaders: explanations about which robots are perturbed, at most: a command is worth little where small
            errors of masses and start change the motion as much as an effect does.
        robots: perturbed robots of each of them.
        caution: factor on the variance of these few robots.
        runners_up: rows of the table of other commands.
        together: commands that one unit of work simulates.
    """

    shares: tuple[float, ...] = (0.06, 0.25, 0.9)
    factors: tuple[float, ...] = (0.5, 0.75, 1.4)
    largest: float = 0.9
    finalists: int = 3
    alternatives: int = 8
    least_probability: float = 0.01
    step: float = 0.1
    motion_share: float = 0.03
    leaders: int = 2
    robots: int = 2
    caution: float = 2.0
    runners_up: int = 5
    together: int = 8


COMMANDS = CommandSettings()
