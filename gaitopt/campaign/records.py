"""What a campaign writes down: gaits that may be filmed, the choice of each step, films and their speeds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from pydantic import BaseModel, ConfigDict

from gaitopt.core.validation import Figure
from gaitopt.gait.gait import Channel, Gait
from gaitopt.optimise.robots import Expected

LEARN, WALK = "learn", "walk"
"""Why a gait is filmed: for what it tells, or as the best that is known."""


class Record(BaseModel):
    """A part of a campaign's files."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    def to_dict(self) -> dict[str, object]:
        """Return the content for JSON."""
        return self.model_dump()


class Speed(Record):
    """What to expect of a speed.

    Attributes:
        mean: the expected speed, m/s.
        ci90: its 90 % interval, m/s.
    """

    mean: Figure
    ci90: tuple[Figure, Figure]

    @staticmethod
    def of(expected: Expected) -> Speed:
        """Return the record of a figure."""
        return Speed(mean=expected.mean, ci90=expected.ci90)


class Candidate(Record):
    """A gait that may be filmed.

    Attributes:
        name: where it comes from.
        period_s, channels: the gait.
        film: number of its film, if it was proposed before.
        breaks: share of the robots on which it breaks a limit that guards the robot.
        safe: whether it may be filmed.
        keeps_limits: probability that it keeps the limits that its film shows.
        predicted_m_s: the expected speed of a film of it, m/s.
        film_is_worth_m_s: by how much a film of it is expected to raise the best speed, m/s.
    """

    name: str
    period_s: float
    channels: dict[str, Channel]
    film: int | None = None
    breaks: float
    safe: bool
    keeps_limits: float = 1.0
    predicted_m_s: Speed
    film_is_worth_m_s: Figure

    @property
    def gait(self) -> Gait:
        """The gait."""
        return Gait(self.period_s, self.channels, self.name)


class FilmRow(Record):
    """One film as it is known at a step.

    Attributes:
        film: its number.
        measured_speed_m_s: mean over its recordings that count, m/s; None where none does.
        drift: sideways over forward travel, left positive; None where it was not measured.
        recordings: how many there are.
        misfits: how many of them fit no explanation of the others; see `speeds.confirmed`.
    """

    film: int
    measured_speed_m_s: float | None
    drift: float | None = None
    recordings: int
    misfits: int


class Step(Record):
    """What is known after some recordings, and what to film next: ``step.json``.

    Attributes:
        recordings: how many recordings were told.
        films: what each film says.
        causes: effects that are blamed.
        answer: the diagnosis in a sentence; empty before any film.
        notes: what the user should know.
        candidates: the gaits that may be filmed.
        next, best: index of the gait to film next, and of the best one.
        purpose: why it is filmed.
        film_is_worth_m_s: by how much that film is expected to raise the best speed, m/s.
        repeatability_m_s: standard deviation of the speed of a gait that is filmed again, m/s; None before
            any film.
        discrepancy_m_s: standard deviation of what a prediction may be off where nothing was filmed, m/s.
        still_to_gain_m_s: how much faster than the best gait the truly best candidate may be, m/s.
        done: whether no film is expected to gain more than the repeatability.
    """

    recordings: int
    films: tuple[FilmRow, ...]
    causes: tuple[str, ...]
    answer: str
    notes: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    next: int
    best: int
    purpose: Literal["learn", "walk"]
    film_is_worth_m_s: Figure
    repeatability_m_s: float | None
    discrepancy_m_s: Figure
    still_to_gain_m_s: Speed
    done: bool

    @property
    def measured(self) -> Mapping[int, float]:
        """Measured speed by the film's number, m/s."""
        return {row.film: row.measured_speed_m_s for row in self.films if row.measured_speed_m_s is not None}


class Proposal(Record):
    """A film as it was proposed: ``proposal.json`` beside its gait.

    Attributes:
        film: its number.
        gait: its gait file, from the campaign's folder.
        player: folder of the player, from the campaign's folder; None where the servos have none.
        purpose: why it is filmed.
        predicted_speed_m_s: the speed that was expected of the film then, m/s.
        film_is_worth_m_s: by how much it was expected to raise the best speed, m/s.
    """

    film: int
    gait: str
    player: str | None
    purpose: Literal["learn", "walk"]
    predicted_speed_m_s: Speed
    film_is_worth_m_s: Figure
