"""The job `simulate`: one gait, or a log of commands, on the nominal robot."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from gaitopt.core.files import write_text
from gaitopt.gait.drive import Drive
from gaitopt.jobs.executor import opened
from gaitopt.jobs.film import FilmOptions, check_film_request, takes_of
from gaitopt.jobs.inputs import found_drive, over_posterior
from gaitopt.jobs.outputs import writing
from gaitopt.optimise.robots import OverRobots, over_robots, robots_of
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.metrics import Metrics, measure
from gaitopt.simulation.rollout import Simulator

if TYPE_CHECKING:
    from gaitopt.report.film.take import Take

SIMULATED = 64
"""Most robots of a posterior that are simulated."""


@dataclass(frozen=True)
class Rollout:
    """One simulated gait, or log of commands.

    Attributes:
        gait: the gait or the log.
        trajectory: its time series.
        metrics: its metrics, by name.
        over_robots: what to expect of its metrics on robots of a posterior; None if not requested.
        takes: what its film shows, from left to right; empty if none was requested.
    """

    gait: Drive
    trajectory: Trajectory
    metrics: Metrics
    over_robots: OverRobots | None = None
    takes: tuple[Take, ...] = field(default=(), repr=False)

    def to_dict(self) -> dict[str, object]:
        """Return the row that `gaitopt simulate` prints; over a posterior, its metrics are means."""
        head: dict[str, object] = {
            "name": self.gait.name,
            "period_s": self.gait.period_s,
            "status": self.trajectory.status,
        }
        if self.over_robots is None:
            return head | dict(self.metrics)
        return head | self.over_robots.means | {"nominal": dict(self.metrics)}


def simulate(
    problem: Problem,
    gait: Drive | str | Path,
    *,
    csv: Path | str | None = None,
    video: Path | str | None = None,
    film: FilmOptions | None = None,
    view: bool = False,
    posterior: Path | str | None = None,
    executor: Executor | str = "threads",
    workers: int | None = None,
) -> Rollout:
    """Simulate one gait, or a log of commands, on the nominal robot.

    Args:
        problem: the problem.
        gait: a gait or other commands, what `Problem.find_gait` finds by name or path, or a log of commands.
        csv: where to write the time series.
        video: where to write a film: ``.mp4``, ``.gif`` or ``.webp``.
        film: what else the film shows, and how long it is.
        view: whether `view_rollout` is to show it afterwards in MuJoCo's viewer.
        posterior: the run folder of a diagnosis; its robots are simulated beside the nominal one, at most
            `SIMULATED`, spread evenly over the file.
        executor: where these run: ``threads``, ``processes``, ``serial``, ``dask://HOST:PORT`` or an
            executor.
        workers: rollouts at once; all cores by default.

    Raises:
        GaitoptError: the posterior or the gait does not fit the problem, the model does not compile, or a
            file cannot be written.
    """
    film = film or FilmOptions()
    check_film_request(video, film, view)
    with writing(problem, csv, video):
        problem = over_posterior(carrying(problem), posterior)
        gait = found_drive(problem, gait)
        simulator = Simulator.build(problem)
        takes = takes_of(simulator, [gait], film) if video is not None or view else []
        trajectory = takes[0].trajectory if takes else simulator.run(gait)
        if csv is not None:
            write_text(Path(csv), simulator.observe(trajectory).to_csv())
        metrics = measure(problem, gait, trajectory, Robot.of(simulator.models[0]))
        over = _over_robots(problem, gait, executor, workers) if problem.robots else None
        if video is not None:
            from gaitopt.report.film.film import write_film

            write_film(Path(video), takes, end=film.seconds)
    return Rollout(gait, trajectory, metrics, over, tuple(takes))


def _over_robots(problem: Problem, drive: Drive, executor: Executor | str, workers: int | None) -> OverRobots:
    with opened(executor, workers) as pool:
        return over_robots([(robots_of(problem, SIMULATED), drive)], pool)[0]


def view_rollout(rollout: Rollout) -> None:
    """Play a gait in MuJoCo's viewer until its window is closed; `simulate` needs ``view=True``.

    Raises:
        GaitoptError: there is no screen.
    """
    from gaitopt.report.film.viewer import view

    view(rollout.takes[0])
