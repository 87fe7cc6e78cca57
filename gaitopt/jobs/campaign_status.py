"""What a campaign says: the next film, and what is known so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gaitopt.campaign.records import Proposal, Speed, Step


@dataclass(frozen=True)
class Next:
    """The film to make next.

    Attributes:
        film: its number.
        gait: its gait file, from the campaign's folder.
        player: folder of its player, from the campaign's folder; None where the servos have none.
        purpose: ``learn``, or ``walk`` for the best gait that is known.
        predicted: the speed that the film is expected to show, m/s.
        worth_m_s: by how much it is expected to raise the best speed, m/s.
        done: whether no film is expected to gain more than the repeatability.
    """

    film: int
    gait: str
    player: str | None
    purpose: str
    predicted: Speed
    worth_m_s: float
    done: bool

    @staticmethod
    def of(proposal: Proposal, step: Step) -> Next:
        """Return what to film next after a step."""
        chosen = step.candidates[step.next]
        return Next(
            proposal.film,
            proposal.gait,
            proposal.player,
            step.purpose,
            chosen.predicted_m_s,
            step.film_is_worth_m_s,
            step.done,
        )

    def to_dict(self) -> dict[str, object]:
        """Return what ``campaign next --json`` prints."""
        return {
            "film": self.film,
            "gait": self.gait,
            "player": self.player,
            "purpose": self.purpose,
            "predicted_speed_m_s": self.predicted.to_dict(),
            "film_is_worth_m_s": self.worth_m_s,
            "done": self.done,
        }


@dataclass(frozen=True)
class FilmStatus:
    """A film that was proposed.

    Attributes:
        film: its number.
        gait: its gait file.
        predicted: the speed that was expected before it was told, m/s.
        measured_m_s: the speed that it shows, m/s; None before it is told, or where it fits no other.
        recordings: recordings that were told.
        misfits: how many of them fit no other.
        drift: sideways over forward travel, left positive; None where it was not measured.
    """

    film: int
    gait: str
    predicted: Speed
    measured_m_s: float | None
    recordings: int = 0
    misfits: int = 0
    drift: float | None = None

    def to_dict(self) -> dict[str, object]:
        """Return a row of ``films``."""
        return {
            "film": self.film,
            "gait": self.gait,
            "predicted_speed_m_s": self.predicted.to_dict(),
            "measured_speed_m_s": self.measured_m_s,
            "recordings": self.recordings,
            "misfits": self.misfits,
            "drift": self.drift,
        }


@dataclass(frozen=True)
class Status:
    """What is known so far.

    Attributes:
        films: the films that were proposed.
        best_gait: file of the best gait.
        best_measured_m_s: its measured speed, m/s; None before it is filmed.
        best_predicted: its expected speed, m/s.
        best_keeps_limits: probability that it keeps the limits that its film shows.
        still_to_gain: how much faster the truly best candidate may be, m/s.
        causes: effects that are blamed.
        repeatability_m_s: standard deviation of the speed of a gait that is filmed again, m/s.
        answer: the diagnosis in a sentence.
        notes: what the user should know.
        done: whether no film is expected to gain more than the repeatability.
        at_work: whether another command works on a step, of which nothing is known yet.
    """

    films: tuple[FilmStatus, ...]
    best_gait: str
    best_measured_m_s: float | None
    best_predicted: Speed
    best_keeps_limits: float
    still_to_gain: Speed
    causes: tuple[str, ...]
    repeatability_m_s: float | None
    answer: str
    notes: tuple[str, ...]
    done: bool
    at_work: bool

    @staticmethod
    def of(step: Step, proposals: Sequence[Proposal], best_gait: str, at_work: bool) -> Status:
        """Return what is known after a step."""
        rows = {row.film: row for row in step.films}
        films = []
        for one in proposals:
            row = rows.get(one.film)
            counts = (row.recordings, row.misfits, row.drift) if row else (0, 0, None)
            speed = row.measured_speed_m_s if row else None
            films.append(FilmStatus(one.film, one.gait, one.predicted_speed_m_s, speed, *counts))
        best = step.candidates[step.best]
        return Status(
            tuple(films),
            best_gait,
            next((film.measured_m_s for film in films if film.gait == best_gait), None),
            best.predicted_m_s,
            best.keeps_limits,
            step.still_to_gain_m_s,
            step.causes,
            step.repeatability_m_s,
            step.answer,
            step.notes,
            step.done,
            at_work,
        )

    def to_dict(self) -> dict[str, object]:
        """Return what ``campaign status --json`` prints."""
        return {
            "films": [film.to_dict() for film in self.films],
            "best": {
                "gait": self.best_gait,
                "measured_speed_m_s": self.best_measured_m_s,
                "predicted_speed_m_s": self.best_predicted.to_dict(),
            },
            "best_keeps_limits": self.best_keeps_limits,
            "still_to_gain": self.still_to_gain.to_dict(),
            "causes": list(self.causes),
            "repeatability_m_s": self.repeatability_m_s,
            "answer": self.answer,
            "notes": list(self.notes),
            "done": self.done,
            "at_work": self.at_work,
        }
