"""One step of a campaign: films are diagnosed together, gaits searched, and the next one is chosen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

from gaitopt.campaign.check import same_gait
from gaitopt.campaign.choice import Known, choose
from gaitopt.campaign.course import most_drift
from gaitopt.campaign.records import FilmRow, Step
from gaitopt.campaign.repertoire import repertoire
from gaitopt.campaign.robots import own_scenarios, prior_robots, walked
from gaitopt.campaign.search import Search
from gaitopt.campaign.settings import CampaignSettings
from gaitopt.campaign.speeds import Measured, confirmed, filmed_drifts, filmed_speed
from gaitopt.core.errors import GaitoptError, MachineError
from gaitopt.core.progress import OnProgress, Progress
from gaitopt.diagnose.diagnosis import DiagnosisRequest
from gaitopt.diagnose.record.dataset import WHOLE_CYCLES, DataSet
from gaitopt.diagnose.record.trial import Trial
from gaitopt.effects.active import EffectValues
from gaitopt.gait.gait import BEST_FILE, Gait
from gaitopt.gait.space import GaitSpace
from gaitopt.jobs.diagnose import Question, answered_into, is_finished
from gaitopt.jobs.optimise import optimise
from gaitopt.optimise.verification import evenly
from gaitopt.problem.instruments import measurable_signals
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem
from gaitopt.runs.campaign_folder import CampaignFolder
from gaitopt.runs.diagnosis_folder import read_diagnosis
from gaitopt.runs.folder import POSTERIOR_FILE, held
from gaitopt.runs.folder import REQUEST_FILE as RUN_FILE
from gaitopt.runs.posterior import read_robots
from gaitopt.runs.run_folder import RunFolder
from gaitopt.simulation.rollout import Simulator

_MORE_THAN_CYCLES = 0.1
"""A film that is shortened keeps this much more than the cycles that a diagnosis needs."""

_DIAGNOSIS = "diagnosis"

NOMINAL = "nominal"
"""Name of the winner on the nominal robot, and of its run; its repertoire has a number behind."""


@dataclass(frozen=True)
class StepWork:
    """The work of one step. Its parts are kept in its folder, so that a step that was killed goes on.

    Attributes:
        folder: the campaign.
        number: how many tellings are known to it.
        executor: where rollouts run.
        on_progress: called as it goes on.
        settings: see `CampaignSettings`.
    """

    folder: CampaignFolder
    number: int
    executor: Executor
    on_progress: OnProgress
    settings: CampaignSettings

    def done(self) -> Step:
        """Return the result of the step."""
        problem = carrying(self.folder.problem)
        self._place.mkdir(parents=True, exist_ok=True)
        return self._first(problem) if self.number == 0 else self._later(problem)

    @staticmethod
    def known_robot(folder: CampaignFolder) -> Problem:
        """Return the problem of a robot of the last posterior; the nominal one before any film."""
        robots, _ = _last_posterior(folder, folder.tellings, folder.problem)
        return folder.problem.as_robot(robots[0]) if robots else folder.problem

    def _first(self, problem: Problem) -> Step:
        """Search on the nominal robot, and try what it finds on robots as they are plausible."""
        run = self._place / NOMINAL
        request = self.folder.request
        if (run / RUN_FILE).is_file():
            optimise(resume=run, executor=self.executor, on_progress=self.on_progress)
        else:
            optimise(
                problem,
                budget=request.budget,
                seed=request.seed,
                out=run,
                executor=self.executor,
                on_progress=self.on_progress,
            )
        winner = problem.find_gait(str(run / BEST_FILE))
        opened = RunFolder.reopen(run)
        entries = opened.folder.open_journal(opened.problem).entries
        count, error = self.settings.search.repertoire, self.settings.belief.drift
        others = enumerate(repertoire(entries, problem, winner, count, error), 2)
        found = {NOMINAL: winner} | {f"{NOMINAL}-{rank}": gait for rank, gait in others}
        gaits = _distinct(problem.space, {**found, **problem.baselines})
        return self._chosen(problem, gaits, self._prior(problem), errors=True)

    def _later(self, problem: Problem) -> Step:
        """Learn from all films, and search again over the posterior."""
        films = self.folder.trials(self.number, measurable_signals(problem))
        robots, told = self._diagnosed(problem, films)
        before = self.folder.step(self.number - 1)
        filmed = {f"film {number}": gait for number, gait in self.folder.gaits.items()}
        last = [before.candidates[index] for index in (before.best, before.next)] if before else []
        known = filmed | {f"last {one.name.removeprefix('last ')}": one.gait for one in last}
        tried = {
            f"{number}: {one.name}": one.gait
            for number in (self.number - 1, 0)
            if (step := self.folder.step(number)) is not None
            for one in step.candidates
        }
        starts = _distinct(problem.space, {**known, **tried, **problem.baselines})
        search = Search(
            problem,
            robots,
            self._place,
            self.folder.request.budget,
            self.folder.request.quantile,
            self._seed,
            self.settings,
        )
        found = search.candidates(starts, self.executor, self.on_progress)
        gaits = _distinct(problem.space, {**known, **found, **problem.baselines})
        judges = self._with_those_before(problem, robots)
        return self._chosen(problem, gaits, judges, errors=False, films=films, told=told)

    @property
    def _seed(self) -> int:
        return 1000 * self.folder.request.seed + self.number

    @property
    def _place(self) -> Path:
        return self.folder.step_folder(self.number)

    def _prior(self, problem: Problem) -> Sequence[EffectValues]:
        """Return robots as they are plausible before any film."""
        settings, seed = self.settings, self.folder.request.seed
        return prior_robots(problem, settings.robots, settings.prior_effects, seed)

    def _with_those_before(self, problem: Problem, robots: Sequence[EffectValues]) -> Sequence[EffectValues]:
        """Return robots that candidates are predicted on: half of them are of the posterior before.

        A posterior can be sure and wrong, and the searches find what is fast on it. Robots that know one
        film less judge these gaits apart, and count by how well they foretold it.
        """
        before, _ = _last_posterior(self.folder, self.number - 1, problem)
        half = self.settings.robots // 2
        return [*evenly(robots, self.settings.robots - half), *evenly(before, half)] if before else robots

    def _chosen(
        self,
        problem: Problem,
        gaits: Mapping[str, Gait],
        robots: Sequence[EffectValues],
        errors: bool,
        films: Sequence[tuple[int, Trial]] = (),
        told: Mapping[str, object] | None = None,
    ) -> Step:
        """Walk the candidates on the robots, and choose."""
        self.on_progress(Progress("trying gaits on the robots that are possible"))
        scenarios = own_scenarios(problem, robots, self._seed, self.settings.robots, errors)
        speeds = walked(problem, list(gaits.values()), scenarios, self.executor)
        told = told or {}
        odd = _names(told.get("misfit_trials"))
        roles, horizon = problem.roles, problem.simulation.horizon
        each = [(number, trial.name, filmed_speed(trial, roles, horizon)) for number, trial in films]
        counts = confirmed(each, odd, self.settings.belief.confirmed)
        counted = [(number, speed) for (number, _, speed), own in zip(each, counts, strict=True) if own]
        measured = Measured.of(counted, self.settings.belief.repeatability) if counted else None
        shown = [film for film, own in zip(films, counts, strict=True) if own]
        drifts = filmed_drifts(shown, measured.means if measured else {}, roles, horizon)
        known = Known(
            space=problem.space,
            gaits=gaits,
            films=self.folder.gaits,
            walked=speeds,
            rows=_rows(films, odd, measured, drifts),
            measured=measured,
            drifts=drifts,
            most_drift=most_drift(problem),
            causes=_names(told.get("causes")),
            answer=str(told.get("answer", "")),
            notes=[
                f"{name} fits no explanation of the other films: a slip, or another robot? Its speed counts "
                "if another recording of that film shows the same."
                for name in odd
            ]
            + _names(told.get("notes")),
            seed=self._seed,
        )
        return choose(known, len(films), self.settings)

    def _diagnosed(
        self, problem: Problem, films: Sequence[tuple[int, Trial]]
    ) -> tuple[Sequence[EffectValues], Mapping[str, object]]:
        """Diagnose all films together; return robots of the posterior, and what the diagnosis says."""
        run = self._place / _DIAGNOSIS
        run.mkdir(exist_ok=True)
        try:
            if not is_finished(run):
                trials = tuple(shortened([trial for _, trial in films], self.settings.diagnosed_s))
                dataset = DataSet(Path("told"), trials)
                robot = Simulator.build(problem.observing(dataset.sites))
                request = DiagnosisRequest(self.folder.request.seed, None, next_gait=False)
                question = Question(robot, dataset, request)
                with held(run):
                    answered_into(run, question, self.executor, self.on_progress, corrected=False)
        except MachineError:
            raise
        except GaitoptError as error:  # of the data: what was known before is still known
            robots, told = _last_posterior(self.folder, self.number - 1, problem)
            return robots or self._prior(problem), {
                **told,
                "notes": [f"These films could not be diagnosed: {error}"],
            }
        finished = read_diagnosis(run)
        assert finished is not None
        return read_robots(run / POSTERIOR_FILE, problem), finished.content


def shortened(trials: Sequence[Trial], seconds: float) -> list[Trial]:
    """Return recordings cut short, so that a diagnosis of many of them takes no longer than of one.

    What is simulated is as long as the longest recording of each gait. Speeds are measured over whole films.

    Args:
        trials: recordings of gaits.
        seconds: length in all, each gait once, s; each keeps a little more than two cycles.
    """
    share = seconds / max(1, len({trial.drive.key for trial in trials}))
    short = []
    for trial in trials:
        least = (WHOLE_CYCLES + _MORE_THAN_CYCLES) * (trial.drive.period_s or math.inf)
        keep = trial.time <= trial.time[0] + max(share, least)
        kept = {name: series[keep] for name, series in trial.signals.items()}
        used = {name: flags[keep] for name, flags in trial.used.items()}
        whole = all(flags.sum() > 0.5 * keep.sum() for flags in used.values())
        short.append(replace(trial, time=trial.time[keep], signals=kept, used=used) if whole else trial)
    return short


def _last_posterior(
    folder: CampaignFolder, number: int, problem: Problem
) -> tuple[Sequence[EffectValues], Mapping[str, object]]:
    """Return the robots of the last diagnosis up to a step, and what it says; nothing where there is none."""
    for one in range(number, 0, -1):
        run = folder.step_folder(one) / _DIAGNOSIS
        if is_finished(run) and (finished := read_diagnosis(run)):
            return read_robots(run / POSTERIOR_FILE, problem), finished.content
    return (), {}


def _distinct(space: GaitSpace, gaits: Mapping[str, Gait]) -> dict[str, Gait]:
    """Return gaits without those that command the same as an earlier one."""
    kept: dict[str, Gait] = {}
    for name, gait in gaits.items():
        if not any(same_gait(space, one, gait) for one in kept.values()):
            kept[name] = replace(gait, name=name)
    return kept


def _names(values: object) -> list[str]:
    return [str(value) for value in values] if isinstance(values, (list, tuple, dict)) else []


def _rows(
    films: Sequence[tuple[int, Trial]],
    odd: Sequence[str],
    measured: Measured | None,
    drifts: Mapping[int, float],
) -> list[FilmRow]:
    """Return what each film says."""
    rows = []
    for film in sorted({number for number, _ in films}):
        own = [trial.name for number, trial in films if number == film]
        speed = None if measured is None else measured.means.get(film)
        misfits = sum(name in odd for name in own)
        rows.append(
            FilmRow(
                film=film,
                measured_speed_m_s=speed,
                drift=drifts.get(film),
                recordings=len(own),
                misfits=misfits,
            )
        )
    return rows
