"""The job `diagnose`: where measured trials and simulation differ, why, and what to measure next."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from gaitopt.core.errors import GaitoptError, unknown_name
from gaitopt.core.own_files import check_folder
from gaitopt.core.progress import OnProgress, silent
from gaitopt.diagnose import diagnosis as diagnosing
from gaitopt.diagnose.diagnosis import Diagnosis, DiagnosisRequest
from gaitopt.diagnose.fit.cache import SimulationCache
from gaitopt.diagnose.judge.command_experiment import CommandExperiment
from gaitopt.diagnose.record.dataset import DataSet, load_dataset
from gaitopt.diagnose.trial_gap import TrialGap
from gaitopt.diagnose.words import answer, explanation
from gaitopt.effects import EFFECTS
from gaitopt.jobs.executor import opened
from gaitopt.jobs.inputs import checked_seed
from gaitopt.jobs.outputs import Out, Stopped, out_folder
from gaitopt.problem.instruments import measurable_signals
from gaitopt.problem.model import assets_beside, carrying
from gaitopt.problem.problem import Problem
from gaitopt.runs.diagnosis_folder import DIAGNOSIS_FILE, diagnosis_folder, read_diagnosis
from gaitopt.runs.folder import PAGE_FILE, check_free, held
from gaitopt.simulation.rollout import Simulator

AUTO = "auto"
"""The executor that is faster for a data set."""


@dataclass(frozen=True)
class DiagnosisRun:
    """A finished diagnosis.

    Attributes:
        answer: the answer in one sentence.
        explanation: its evidence, one sentence each.
        folder: its run folder; None where nothing was written.
        fresh: the diagnosis; None if it was finished before and only its answer was read.
    """

    answer: str
    explanation: tuple[str, ...]
    folder: Path | None
    fresh: Diagnosis | None

    @property
    def content(self) -> Mapping[str, object]:
        """The content of ``diagnosis.json``.

        Raises:
            GaitoptError: it was changed since, or there is no folder.
        """
        written = read_diagnosis(self.folder) if self.folder else None
        if written is None:
            raise GaitoptError(f"{self.folder}: no {DIAGNOSIS_FILE}")
        return written.content

    @property
    def diagnosis(self) -> Diagnosis:
        """The diagnosis as records and arrays.

        Raises:
            GaitoptError: it was finished before; its content is in its folder.
        """
        if self.fresh is None:
            raise GaitoptError(f"{self.folder}: finished before; see its {DIAGNOSIS_FILE}")
        return self.fresh

    @property
    def verdict(self) -> str:
        """The kind of answer, such as ``explained``."""
        return self.diagnosis.verdict

    @property
    def causes(self) -> Sequence[str]:
        """Effects and defects of the recording that are blamed."""
        return self.diagnosis.causes

    @property
    def trials(self) -> Sequence[TrialGap]:
        """Each trial aligned with the nominal prediction."""
        return self.diagnosis.trials


@dataclass(frozen=True)
class Question:
    """What a diagnosis depends on; the executor does not count.

    Attributes:
        simulator: the nominal robot.
        dataset: the measured trials.
        request: seed, effects to try, and whether to look for the next gait.
    """

    simulator: Simulator
    dataset: DataSet
    request: DiagnosisRequest

    @staticmethod
    def of(problem: Problem, folder: Path, request: DiagnosisRequest) -> Question:
        """Return the question that a data set asks about a problem.

        Raises:
            GaitoptError: the model does not compile, or the data set is wrong.
        """
        dataset = load_dataset(folder, problem, measurable_signals(problem))
        return Question(Simulator.build(problem.observing(dataset.sites)), dataset, request)

    def cache(self, folder: Path) -> SimulationCache:
        """Return the cache, in a run folder, of what a diagnosis of it simulates."""
        return SimulationCache.of(folder, self.simulator, self.dataset, self.request.seed)

    def answered(
        self, executor: Executor, on_progress: OnProgress, cache: SimulationCache | None = None
    ) -> Diagnosis:
        """Return the diagnosis.

        Raises:
            GaitoptError: a trial is too short, or none of the requested effects can be tried.
        """
        return diagnosing.diagnose(self.simulator, self.dataset, self.request, executor, on_progress, cache)


def diagnose(
    problem: Problem | None,
    dataset: Path | str,
    *,
    effects: Collection[str] | None = None,
    seed: int = 1,
    next_gait: bool = True,
    full: bool = False,
    executor: Executor | str = "threads",
    workers: int | None = None,
    out: Out = None,
    resume: Path | str | None = None,
    on_progress: OnProgress = silent,
) -> DiagnosisRun:
    """Find where measured trials and simulation differ, what causes it, and what to measure next.

    Args:
        problem: the nominal robot; None only where `resume` names a finished diagnosis.
        dataset: folder with ``dataset.toml`` and its trials.
        effects: names of the effects to try; all that apply by default.
        seed: seed of all randomness.
        next_gait: whether to look for the gait to measure next.
        full: with `out`: add a film with the measured marker to the report.
        executor: where robots are simulated: ``threads``, ``processes``, ``serial``, ``dask://HOST:PORT``
            or an executor; `AUTO` for what is faster, processes where trials have logged commands.
        workers: robots simulated at once; all cores by default.
        out: a new or an empty folder for the run; nothing is left behind without it.
        resume: the folder of an interrupted diagnosis to continue, with the same bits.
        on_progress: called with the number of robots simulated.

    Raises:
        GaitoptError: the data set is wrong, an effect is unknown or none applies, or the folder is in use.
        Stopped: Ctrl-C or SIGTERM ended a diagnosis that can be resumed.
    """
    if resume is not None:
        _check_resumed(Path(resume), out)
        if is_finished(resume) and (finished := read_diagnosis(Path(resume))):
            _clear_leftovers(Path(resume))
            return DiagnosisRun(finished.answer, finished.explanation, finished.folder, None)
    check_free(out_folder(out))
    if problem is None:
        raise GaitoptError("diagnose: found no problem and no finished diagnosis")
    problem = carrying(problem)
    if out is not None or resume is not None:
        assets_beside(problem)  # which the run folder is to have
    for name in effects or ():
        if name not in EFFECTS:
            raise unknown_name("diagnose", "effect in --effects:", name, EFFECTS)
    chosen = None if effects is None else tuple(effects)
    request = DiagnosisRequest(checked_seed(seed), chosen, next_gait)
    question = Question.of(problem, Path(dataset), request)
    executor = _executor_for(executor, question.dataset)
    if out is None and resume is None:
        with opened(executor, workers) as pool:
            return _run(question.answered(pool, on_progress), None)
    resumed = None if resume is None else Path(resume)
    with (
        diagnosis_folder(out_folder(out), resumed, problem.name) as folder,
        opened(executor, workers) as pool,
    ):
        if resumed is not None and not question.cache(folder).folder.is_dir():
            others = "nothing was simulated there with this problem, data set and seed (changed since?)"
            raise GaitoptError(f"--resume: {folder}: {others}; allowed: what it began with, or a new --out")
        return _run(answered_into(folder, question, pool, on_progress, full=full), folder)


def _executor_for(executor: Executor | str, dataset: DataSet) -> Executor | str:
    """Return the executor that `AUTO` stands for, or the one that was asked for.

    What explains logged commands are effects such as `servo_friction_load`, whose Python code is called
    in every step of the simulation. With them two threads are slower than one, because they wait for the
    interpreter, and two processes twice as fast. Without them threads are as fast as processes, and start
    at once.
    """
    if executor != AUTO:
        return executor
    logged = any(trial.has_log for trial in dataset.trials)
    return "processes" if logged else "threads"


def answered_into(
    folder: Path,
    question: Question,
    executor: Executor,
    on_progress: OnProgress = silent,
    *,
    corrected: bool = True,
    full: bool = False,
) -> Diagnosis:
    """Return a diagnosis and write its run folder; what it simulates is kept there until it is finished.

    Args:
        folder: the run folder, held by the caller.
        question: the question.
        executor: where robots are simulated.
        on_progress: called as it goes on.
        corrected: whether gaits of the corrected robot are simulated for the page.
        full: whether the page has a film.

    Raises:
        GaitoptError: as of `Question.answered`, or a file cannot be written.
        Stopped: Ctrl-C or SIGTERM ended it, and it can be resumed.
    """
    from gaitopt.diagnose.correction import correct
    from gaitopt.export.next_commands import write_next_commands
    from gaitopt.report.diagnosis_report import write_diagnosis

    cache = question.cache(folder)
    with _stoppable(cache, folder):
        diagnosis = question.answered(executor, on_progress, cache)
        problem = question.simulator.problem
        correction = correct(problem, diagnosis, executor if corrected else None)
        cache.keep()  # until the page is written, too
        if isinstance(diagnosis.experiment, CommandExperiment):
            write_next_commands(folder, problem, diagnosis.experiment)
        write_diagnosis(folder, problem, diagnosis, correction, full)
        cache.clear()
    return diagnosis


def is_finished(folder: Path | str | None) -> bool:
    """Return whether a folder is the run folder of a finished diagnosis, and nothing is left to do there.

    A page that is missing is left to do while what was simulated is still there.
    """
    if folder is None or not (Path(folder) / DIAGNOSIS_FILE).is_file():
        return False
    return (Path(folder) / PAGE_FILE).is_file() or not SimulationCache.is_in(Path(folder))


def _clear_leftovers(folder: Path) -> None:
    """Remove what a diagnosis simulated that was killed after its last file."""
    if SimulationCache.is_in(folder):
        with held(folder):
            SimulationCache.clear_in(folder)


def _check_resumed(folder: Path, out: Out) -> None:
    if out is not None:
        raise GaitoptError(f"--out: not with --resume, which goes on in {folder}")
    if not folder.is_dir():
        raise GaitoptError(f"--resume: {folder}: no such folder")
    check_folder(folder)


def _run(diagnosis: Diagnosis, folder: Path | None) -> DiagnosisRun:
    return DiagnosisRun(answer(diagnosis), tuple(explanation(diagnosis)), folder, diagnosis)


@contextmanager
def _stoppable(cache: SimulationCache, folder: Path) -> Iterator[None]:
    """Where Ctrl-C or SIGTERM ends a diagnosis that has begun, say where it can be resumed."""
    try:
        yield
    except BaseException as stop:
        begun = cache.count > 0 or (folder / DIAGNOSIS_FILE).is_file()
        if not begun:
            cache.clear()  # an empty folder would keep the run folder from being removed
        elif isinstance(stop, KeyboardInterrupt):
            raise Stopped(f"{cache.count} robots", folder) from stop
        raise
