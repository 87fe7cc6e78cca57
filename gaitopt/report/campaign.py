"""The page of a campaign: what to do now, what the films say, what is known of the robot."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from gaitopt.campaign.records import LEARN, WALK, Candidate, Proposal, Speed, Step
from gaitopt.core.quantities import figure
from gaitopt.report.figures import campaign as plots
from gaitopt.report.page import Page, Picture, Section, Table, after_results, folded, save_figures
from gaitopt.report.tables import gait_table
from gaitopt.report.words import interval_text, robot_text
from gaitopt.runs.campaign_folder import PAGE_FILE, CampaignFolder, Rival
from gaitopt.runs.folder import write_into


def write_campaign(
    folder: CampaignFolder, steps: Sequence[Step], following: Proposal, best_file: str
) -> Path:
    """Write the page of a campaign, and return its path.

    Args:
        folder: the campaign.
        steps: the results of its steps, in order.
        following: the film to make next.
        best_file: file of the best gait.

    Raises:
        GaitoptError: the page could not be written; what is known is safe.
    """
    proposals, rivals = folder.proposals, folder.rivals
    picture = Picture(
        "Speeds, film by film",
        partial(plots.speeds, proposals, steps, rivals),
        "Open circles: what was expected of each film when it was proposed. Stars: what it measured.",
    )
    with after_results(folder.path, "steps and films"):
        figures = save_figures(folder.path, {"speeds": picture})
        page = _page(folder, steps, following, best_file, figures, rivals)
        return write_into(folder.path, PAGE_FILE, page.html())


def _page(
    folder: CampaignFolder,
    steps: Sequence[Step],
    following: Proposal,
    best_file: str,
    figures: Sequence[Section],
    rivals: Sequence[Rival],
) -> Page:
    step, proposals = steps[-1], folder.proposals
    best = step.candidates[step.best]
    sections = [
        _now(folder, step, following),
        *figures,
        Section("Films", table=_films(proposals, step)),
        Section("What is known of the robot", sentences=_known(step)),
        Section("The best gait", table=gait_table(best.gait, best_file)),
        folded(Section("Gaits that may be filmed", table=_candidates(step))),
        *([Section("Rivals on the same robot", table=_rivals(rivals))] if rivals else []),
    ]
    return Page(
        title=f"{folder.problem.name}: campaign",
        answer=_answer(step, following),
        asked={
            "Robot": robot_text(folder.problem),
            "Searches": f"{folder.request.budget} gaits a step, seed {folder.request.seed}",
        },
        tiles=_tiles(step, best),
        notes=step.notes,
        sections=sections,
    )


def _answer(step: Step, following: Proposal) -> str:
    best = step.candidates[step.best]
    if step.done:
        return (
            f"Done: walk with film {following.film}, {_speed(best.predicted_m_s)}. No further film is "
            "expected to gain more than the robot's own repeatability."
        )
    why = "for what it tells" if step.purpose == LEARN else "as the best gait that is known"
    expected = _speed(step.candidates[step.next].predicted_m_s)
    return f"Film {following.film} next, {why}: expected {expected}."


def _speed(speed: Speed) -> str:
    return f"{1e3 * speed.mean:.1f} mm/s (90 % interval {interval_text(speed.ci90, '.1f')})"


def _tiles(step: Step, best: Candidate) -> list[tuple[str, str]]:
    measured = step.measured
    tiles = [
        (f"{1e3 * best.predicted_m_s.mean:.1f} mm/s", f"expected of the best gait, {best.name}"),
        (f"{best.keeps_limits:.0%}", "probability that it keeps the limits on its course"),
    ]
    if measured:
        tiles.append((f"{1e3 * max(measured.values()):.1f} mm/s", "highest measured speed"))
    gain = step.still_to_gain_m_s
    low_high = interval_text(gain.ci90, ".1f")
    tiles.append((f"{1e3 * gain.mean:.1f} mm/s", f"still to gain (90 % interval {low_high})"))
    if step.repeatability_m_s is not None:
        tiles.append((f"{figure(1e3 * step.repeatability_m_s)} mm/s", "repeatability of a film"))
    return tiles


def _now(folder: CampaignFolder, step: Step, following: Proposal) -> Section:
    """Return what to do now, and the commands for it."""
    if step.done:
        return Section("What to do now", sentences=[f"Walk with {following.gait}."])
    player = f"Play it with {following.player}." if following.player else "The servos have no player."
    worth = f"{1e3 * step.film_is_worth_m_s:.1f} mm/s"
    here, gait = (shlex.quote(str(path)) for path in (folder.path, folder.path / following.gait))
    return Section(
        "What to do now",
        sentences=[
            f"Put {following.gait} on the robot. {player}",
            "Film it for some ten cycles from rest, twice if you can.",
            "It is the best gait that is known: the film shows how fast it is."
            if step.purpose == WALK
            else f"The film is expected to raise the speed of the best gait by {worth}, by its speed alone.",
            "Films may be told late, in another order, and again; one that cannot be made may be left out.",
        ],
        commands=[
            f"gaitopt import FILE --gait {gait} --problem {here} --out FILM",
            f"gaitopt campaign tell {here} FILM",
        ],
    )


def _films(proposals: Sequence[Proposal], step: Step) -> Table:
    rows = {row.film: row for row in step.films}
    cells = []
    for one in proposals:
        row = rows.get(one.film)
        measured = "–"
        if row is not None and row.measured_speed_m_s is not None:
            measured = f"{1e3 * row.measured_speed_m_s:.1f}"
        recordings = "none yet" if row is None else f"{row.recordings}"
        if row is not None and row.misfits:
            recordings += f", of which {row.misfits} fit no other"
        low_high = interval_text(one.predicted_speed_m_s.ci90, ".1f")
        expected = f"{1e3 * one.predicted_speed_m_s.mean:.1f}"
        drift = "–" if row is None or row.drift is None else f"{row.drift:+.0%}"
        cells.append([f"{one.film}", one.gait, one.purpose, expected, low_high, measured, drift, recordings])
    return Table(
        head=[
            "film",
            "gait",
            "why",
            "predicted [mm/s]",
            "90 % interval",
            "measured [mm/s]",
            "drift",
            "recordings",
        ],
        rows=cells,
        note="Predicted: when the film was proposed, before it was made. Drift: sideways over forward "
        "travel, left positive.",
        words=(1, 2, 7),
    )


def _known(step: Step) -> list[str]:
    sentences = [step.answer] if step.answer else ["Nothing was filmed yet: robots with one or two effects."]
    sentences += [f"Blamed: {', '.join(step.causes)}."] if step.causes else []
    return [
        *sentences,
        f"Where nothing was filmed, a prediction may be off by {figure(1e3 * step.discrepancy_m_s)} mm/s "
        "(standard deviation), beyond what the robots differ by.",
    ]


def _candidates(step: Step) -> Table:
    rows = []
    for one in sorted(step.candidates, key=lambda one: -one.predicted_m_s.mean):
        low_high = interval_text(one.predicted_m_s.ci90, ".1f")
        speed, worth = f"{1e3 * one.predicted_m_s.mean:.1f}", f"{1e3 * one.film_is_worth_m_s:.2f}"
        breaks = f"{one.breaks:.0%}" + ("" if one.safe else ", not filmed")
        keeps = f"{one.keeps_limits:.0%}"
        rows.append([one.name, figure(one.period_s), speed, low_high, keeps, worth, breaks])
    return Table(
        head=[
            "gait",
            "period [s]",
            "expected [mm/s]",
            "90 % interval",
            "keeps its course",
            "a film is worth [mm/s]",
            "harmful on",
        ],
        rows=rows,
        note="Keeps its course: probability that it keeps the limits on where and how well it walks. Worth: "
        "by how much a film is expected to raise the speed of the best gait, times that probability. "
        "Harmful on: share of the possible robots on which the gait breaks another limit.",
        words=(6,),
    )


def _rivals(rivals: Sequence[Rival]) -> Table:
    rows = [
        [one.name, f"{len(one.measured_speeds_m_s)}", f"{1e3 * one.measured_speeds_m_s[one.best]:.1f}"]
        for one in rivals
    ]
    return Table(head=["method", "films", "highest measured [mm/s]"], rows=rows)
