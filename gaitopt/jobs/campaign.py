"""The job `campaign`: the loop on the real robot: film, learn, walk faster."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from gaitopt.campaign import settings as defaults
from gaitopt.campaign.check import film_of, wrong_recording
from gaitopt.campaign.course import most_drift
from gaitopt.campaign.records import Proposal, Step
from gaitopt.campaign.rivals import Tried, bayesian_optimisation, best_of
from gaitopt.campaign.speeds import filmed_speed
from gaitopt.core.errors import GaitoptError, MachineError, unknown_name
from gaitopt.core.progress import OnProgress, Progress, silent
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.diagnose.record.trial import Trial
from gaitopt.export.formats import FORMATS
from gaitopt.export.handover import Choices
from gaitopt.gait.gait import BEST_FILE, Gait
from gaitopt.jobs.campaign_status import Next, Status
from gaitopt.jobs.campaign_step import NOMINAL, StepWork
from gaitopt.jobs.executor import check_executor, opened
from gaitopt.jobs.export import export
from gaitopt.jobs.inputs import checked_seed
from gaitopt.jobs.outputs import Stopped
from gaitopt.problem.instruments import measurable_signals
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem
from gaitopt.robot.signals import kind_of, site_of
from gaitopt.runs.campaign_folder import CampaignFolder, Request, Rival, digest_of
from gaitopt.runs.folder import held, write_into
from gaitopt.runs.lock import is_held
from gaitopt.simulation.objective import check_searchable
from gaitopt.simulation.rollout import Simulator

Robot = Callable[[Gait], Trial]
"""A robot behind a function: it walks with a gait, and is filmed."""

_FALLBACK = "csv"
"""Format of the player where the servos have no pins yet."""


class Campaign:
    """A campaign on a real robot, kept in a folder. Each step is written as it is done, so that a campaign
    that was killed at any moment goes on with whatever is asked of it next.

    Attributes:
        path: the folder.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        executor: Executor | str = "threads",
        workers: int | None = None,
        on_progress: OnProgress = silent,
    ):
        """Open the folder of a campaign.

        Args:
            path: the folder.
            executor: where rollouts run: ``threads``, ``processes``, ``serial``, ``dask://HOST:PORT`` or an
                executor.
            workers: rollouts at once; all cores by default.
            on_progress: called with the progress of each step.

        Raises:
            GaitoptError: it is no campaign, or there is no such executor.
        """
        check_executor(executor, workers)
        self.path = Path(path)
        self._folder = CampaignFolder.open(self.path)
        self._executor, self._workers, self._on_progress = executor, workers, on_progress

    @staticmethod
    def new(
        problem: Problem,
        out: Path | str,
        *,
        seed: int = 1,
        budget: int | None = None,
        player: str | None = None,
        quantile: float | None = None,
        executor: Executor | str = "threads",
        workers: int | None = None,
        on_progress: OnProgress = silent,
    ) -> Campaign:
        """Begin a campaign: search on the nominal robot, and propose the first film.

        Args:
            problem: the nominal robot.
            out: a new or an empty folder, or that of the same campaign, which goes on.
            seed: seed of all randomness.
            budget: gaits of the searches of each step; 400 by default.
            player: format of the players (see `gaitopt export`); ``micropython`` by default.
            quantile: share of the robots that may be slower than a gait's speed says, 0 to 0.5; by default as
                the problem file says, the mean.
            executor: as of `Campaign`.
            workers: as of `Campaign`.
            on_progress: as of `Campaign`.

        Raises:
            GaitoptError: the problem has no gait space, objective or marker, or the folder holds something.
            Stopped: Ctrl-C or SIGTERM ended it; it can go on.
        """
        check_executor(executor, workers)
        check_searchable(problem)
        if budget is not None and budget < 1:
            raise GaitoptError(f"--budget: found {budget}; allowed: 1 or more")
        if player is not None and player not in FORMATS:
            raise unknown_name("campaign", "format in --player", player, FORMATS)
        if quantile is not None and not 0.0 <= quantile <= 0.5:
            raise GaitoptError(f"--quantile: found {quantile:g}; allowed: 0 to 0.5")
        asked = {"budget": budget, "player": player, "quantile": quantile}
        request = Request(seed=checked_seed(seed), **{k: v for k, v in asked.items() if v is not None})
        CampaignFolder.create(Path(out), carrying(problem), request)
        campaign = Campaign(out, executor=executor, workers=workers, on_progress=on_progress)
        campaign.go_on()
        return campaign

    @property
    def problem(self) -> Problem:
        """The nominal robot."""
        return self._folder.problem

    def next(self) -> Next:
        """Return what to film next, and why; an interrupted step is finished first."""
        step = self.go_on()
        return Next.of(self._proposal_of(step), step)

    def status(self) -> Status:
        """Return what is known; an interrupted step is finished first.

        While another command works on a step, this is what was known before it.
        """
        last = self._folder.last_finished if is_held(self.path) else None
        step = self.go_on() if last is None else self._step(last)
        return Status.of(step, self._folder.proposals, self._best_file(step), at_work=last is not None)

    def tell(self, recordings: Path | str | Trial | Sequence[Trial], trust: bool = False) -> Status:
        """Take films in, diagnose all films together, search again, and propose the next film.

        Films may come late, in another order, and again. One that was told already changes nothing.

        Args:
            recordings: a data set, or a recording of a gait of the campaign, or several.
            trust: whether recordings are taken that do not look like their gait.

        Raises:
            GaitoptError: a recording is not of a film that was proposed, or cannot be used. Nothing that was
                known is changed.
            Stopped: Ctrl-C or SIGTERM ended it; it can go on.
        """
        self.go_on()
        trials = self._trials(recordings)
        with self._stoppable(), held(self.path), opened(self._executor, self._workers) as pool:
            fresh = self._fresh(trials)
            if not trust:
                self._check(fresh, pool)
            if fresh:
                self._folder.tell(fresh, measurable_signals(self.problem))
        return self.status()

    def run(self, robot: Robot, films: int = 5) -> Status:
        """Film, learn and walk faster until it is done, or so many films were told.

        No film is refused because it does not look like its gait: the gait is the right one, and a robot that
        stops shows what the gait is worth. One that fits no explanation counts once it is filmed again.

        Args:
            robot: walks with a gait and returns its recording.
            films: how often something is told, in all.

        Raises:
            GaitoptError: the robot returned a recording that was told before.
        """
        self.go_on()
        while (before := self._folder.tellings) < films and not self.next().done:
            self.tell(_filmed(robot, self.next_gait), trust=True)
            if self._folder.tellings == before:
                raise GaitoptError(f"{self.path}: the robot returned a recording that was told before")
        return self.status()

    @property
    def next_gait(self) -> Gait:
        """The gait to film next."""
        return self._folder.gaits[self.next().film]

    @property
    def nominal_winner(self) -> Gait:
        """The best gait on the nominal robot, as the first search found it."""
        self.go_on()
        return next(one.gait for one in self._step(0).candidates if one.name == NOMINAL)

    @property
    def best_gait(self) -> Gait:
        """The best gait that is known."""
        step = self.go_on()
        return step.candidates[step.best].gait

    def compare(self, robot: Robot, films: int) -> list[tuple[str, list[Tried]]]:
        """Let two rivals film the same robot, and show them on the page: one film of the nominal winner, and
        Bayesian optimisation on the robot without a simulator.

        Args:
            robot: the robot.
            films: films of the second one.

        Returns:
            Each rival's name with what it filmed.
        """

        def film(gait: Gait) -> Tried:
            return Tried.of(gait, robot(gait), problem)

        self.go_on()
        problem, seed, limit = self.problem, self._folder.request.seed, most_drift(self.problem)
        starts = [*problem.baselines.values()]
        rivals = [
            ("the nominal winner, filmed once", [film(self.nominal_winner)]),
            (
                "Bayesian optimisation without a simulator",
                bayesian_optimisation(problem.space, starts, film, films, seed, limit),
            ),
        ]
        rows = []
        for name, tried in rivals:
            speeds = tuple(one.speed_m_s for one in tried)
            best = tried.index(best_of(tried, limit))
            rows.append(Rival(name=name, measured_speeds_m_s=speeds, best=best))
        with held(self.path):
            self._folder.write_rivals(rows)
            self._write_page()
        return rivals

    # --- steps ------------------------------------------------------------------------------------

    def go_on(self) -> Step:
        """Finish what a killed command left, and return the last step."""
        last = self._folder.tellings
        if not self._folder.is_finished(last):
            with self._stoppable(), held(self.path), opened(self._executor, self._workers) as pool:
                for number in range(last + 1):
                    if not self._folder.is_finished(number):
                        self._finish(number, pool)
        return self._step(last)

    def _step(self, number: int) -> Step:
        step = self._folder.step(number)
        assert step is not None
        return step

    def _finish(self, number: int, pool: Executor) -> None:
        """Do what is left of a step."""
        if self._folder.step(number) is None:
            work = StepWork(self._folder, number, pool, self._on_progress, defaults.DEFAULT)
            self._folder.write_step(number, work.done())
        step = self._step(number)
        self._propose(step, pool)
        write_into(self.path, BEST_FILE, step.candidates[step.best].gait.to_toml())
        self._write_page(number)
        self._folder.finish(number)

    def _propose(self, step: Step, pool: Executor) -> None:
        """Write the film that a step chose, if it was not proposed before: gait, player, proposal."""
        chosen, folder = step.candidates[step.next], self._folder
        if self._proposed(chosen.gait) is not None:
            return
        film = max((one.film for one in folder.proposals), default=0) + 1
        self._on_progress(Progress(f"writing film {film}"))
        folder.write_gait(film, replace(chosen.gait, name=f"film-{film}"))
        where = folder.film_folder(film)
        proposal = Proposal(
            film=film,
            gait=str((where / "gait.toml").relative_to(self.path)),
            player=self._player(chosen.gait, where / "player", pool),
            purpose=step.purpose,
            predicted_speed_m_s=chosen.predicted_m_s,
            film_is_worth_m_s=chosen.film_is_worth_m_s,
        )
        folder.propose(proposal)

    def _player(self, gait: Gait, where: Path, pool: Executor) -> str | None:
        """Write the player of a gait; a plain table where the servos are not wired yet."""
        shutil.rmtree(where, ignore_errors=True)
        for format in dict.fromkeys((self._folder.request.player, _FALLBACK)):
            try:
                export(self.problem, gait, Choices(format), where, executor=pool)
            except MachineError:
                raise
            except GaitoptError:
                continue
            return str(where.relative_to(self.path))
        return None

    def _proposed(self, gait: Gait) -> Proposal | None:
        """Return the film of a gait as it was proposed; None where it was not."""
        film = film_of(self.problem.space, gait, self._folder.gaits)
        return None if film is None else self._folder.proposal(film)

    def _proposal_of(self, step: Step) -> Proposal:
        proposal = self._proposed(step.candidates[step.next].gait)
        if proposal is None:
            raise GaitoptError(f"{self.path}: films: the film of the last step is missing: removed since?")
        return proposal

    def _best_file(self, step: Step) -> str:
        proposal = self._proposed(step.candidates[step.best].gait)
        return BEST_FILE if proposal is None else proposal.gait

    def _write_page(self, number: int | None = None) -> None:
        from gaitopt.report.campaign import write_campaign

        last = self._folder.tellings if number is None else number
        steps = [step for step in map(self._folder.step, range(last + 1)) if step is not None]
        proposal = self._proposal_of(steps[-1])
        write_campaign(self._folder, steps, proposal, self._best_file(steps[-1]))

    @contextmanager
    def _stoppable(self) -> Iterator[None]:
        """Where Ctrl-C or SIGTERM ends a step, say that it can go on."""
        try:
            yield
        except KeyboardInterrupt as stop:
            raise Stopped("a part of a step", self.path) from (stop.__cause__ or stop)

    # --- films ------------------------------------------------------------------------------------

    def _trials(self, recordings: Path | str | Trial | Sequence[Trial]) -> list[Trial]:
        if isinstance(recordings, Trial):
            return [recordings]
        if not isinstance(recordings, (str, Path)):
            return list(recordings)
        return list(load_dataset(Path(recordings), self.problem, measurable_signals(self.problem)).trials)

    def _fresh(self, trials: Sequence[Trial]) -> list[tuple[int, Trial]]:
        """Return the recordings that were not told yet, each with the number of its film.

        Raises:
            GaitoptError: one is of no film that was proposed, or was told as another film.
        """
        told, films, space = self._folder.digests, self._folder.gaits, self.problem.space
        fresh = []
        for trial in trials:
            film = film_of(space, trial.drive, films) if isinstance(trial.drive, Gait) else None
            if film is None:
                allowed = ", ".join(one.gait for one in self._folder.proposals)
                raise GaitoptError(
                    f"trial {trial.name}: its gait was not proposed by {self.path}; allowed: {allowed}"
                )
            digest = digest_of(trial)
            before = told.get(digest)
            if before is not None and before != film:
                raise GaitoptError(
                    f"trial {trial.name}: found film {film}; the same recording is told as film {before}"
                )
            filmed_speed(trial, self.problem.roles, self.problem.simulation.horizon)
            if before is None:
                told[digest] = film
                fresh.append((film, replace(trial, drive=films[film])))
        return fresh

    def _check(self, fresh: Sequence[tuple[int, Trial]], pool: Executor) -> None:
        """Check that recordings look like their gaits on the robot as it is known.

        Raises:
            GaitoptError: one does not.
        """
        names = {signal for _, trial in fresh for signal in trial.signals}
        sites = {site_of(name) for name in names if kind_of(name) == "site"}
        robot = Simulator.build(StepWork.known_robot(self._folder).observing(sorted(sites)))
        others = [*self.problem.baselines.values(), *self._folder.gaits.values()]
        for film, trial in fresh:
            reason = wrong_recording(trial, others, robot, pool)
            if reason is not None:
                raise GaitoptError(
                    f"trial {trial.name}: film {film}: {reason}; --trust takes it all the same"
                )


def _filmed(robot: Robot, gait: Gait) -> Trial:
    """Return a recording of a gait by a robot."""
    return replace(robot(gait), drive=gait)
