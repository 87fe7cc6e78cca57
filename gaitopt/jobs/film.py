"""The job `film`: gaits side by side, with the measured marker if there is one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gaitopt.gait.drive import Drive
from gaitopt.jobs.inputs import check_positive, found_drive
from gaitopt.jobs.outputs import writing
from gaitopt.problem.instruments import measurable_signals
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator

if TYPE_CHECKING:
    from gaitopt.report.film.take import Take


@dataclass(frozen=True)
class FilmOptions:
    """What a film shows beside its gait, and how long it is.

    Attributes:
        beside: another gait, to its right.
        measured: a data set; the marker that was measured is shown too.
        seconds: length, s; by default whole cycles of the slowest gait.
    """

    beside: Drive | str | Path | None = None
    measured: Path | str | None = None
    seconds: float | None = None


def film(
    problem: Problem,
    gaits: Sequence[Drive | str | Path],
    path: Path | str,
    *,
    seconds: float | None = None,
    measured: Path | str | None = None,
) -> Path:
    """Film gaits side by side.

    Args:
        problem: the problem.
        gaits: gaits, what `Problem.find_gait` finds by name or path, or logs of commands.
        path: where to: a file that ends in ``.mp4``, ``.gif`` or ``.webp``.
        seconds: length, s; by default whole cycles of the slowest gait.
        measured: a data set; the marker that was measured is shown too.

    Returns:
        The path of the film.

    Raises:
        GaitoptError: a gait does not fit, a simulation failed, or the film cannot be written.
    """
    from gaitopt.report.film.film import write_film

    options = FilmOptions(measured=measured, seconds=seconds)
    check_film_request(path, options)
    with writing(problem, path):
        problem = carrying(problem)
        found = [found_drive(problem, gait) for gait in gaits]
        takes = takes_of(Simulator.build(problem), found, options)
        write_film(Path(path), takes, end=seconds)
    return Path(path)


def check_film_request(video: Path | str | None, film: FilmOptions, view: bool = False) -> None:
    """Check that a film can be written, and a window opened, before anything is computed for it.

    Raises:
        GaitoptError: it cannot.
    """
    if video is not None:
        from gaitopt.report.film.film import check_film

        check_positive("seconds", film.seconds)
        check_film(Path(video))
    if view:
        from gaitopt.report.film.viewer import check_screen

        check_screen()


def takes_of(simulator: Simulator, gaits: Sequence[Drive], options: FilmOptions) -> list[Take]:
    """Return what a film shows, from left to right.

    Raises:
        GaitoptError: a simulation failed, or there is no trial of a gait.
    """
    from gaitopt.report.film.film import film_length
    from gaitopt.report.film.take import take, take_beside

    gaits = list(gaits)
    if options.beside is not None:
        gaits.append(found_drive(simulator.problem, options.beside))
    length = options.seconds or film_length(gaits)
    if options.measured is None:
        return [take(simulator, gait, length) for gait in gaits]
    from gaitopt.diagnose.record.dataset import load_dataset
    from gaitopt.report.film.ghost import trial_of

    problem = simulator.problem
    dataset = load_dataset(Path(options.measured), problem, measurable_signals(problem))
    if dataset.sites:
        simulator = Simulator.build(problem.observing(dataset.sites))
    return [take_beside(simulator, trial_of(dataset, gait), length) for gait in gaits]
