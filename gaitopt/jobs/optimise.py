"""The job `optimise`: baselines, plan, search, verification and report."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from tempfile import TemporaryDirectory

from gaitopt.core.errors import GaitoptError
from gaitopt.core.interrupts import interrupts_held
from gaitopt.core.progress import OnProgress, numbered, silent
from gaitopt.gait.gait import BEST_FILE
from gaitopt.jobs.executor import check_executor, opened
from gaitopt.jobs.inputs import checked_seed, over_posterior
from gaitopt.jobs.outputs import Out, Stopped, out_folder
from gaitopt.optimise import run as search
from gaitopt.optimise.journal import Entry, Journal, succeeded
from gaitopt.optimise.run import DEFAULT_BUDGET, Optimised, Request
from gaitopt.optimise.sensitivity import SENSITIVITIES, sensitivities
from gaitopt.optimise.stages import DEFAULT_METHOD, method_of
from gaitopt.optimise.verification import Verified
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem
from gaitopt.report.settings import FILM, PAGE
from gaitopt.runs.folder import JOURNAL_FILE, REQUEST_FILE
from gaitopt.runs.run_folder import SUMMARY_FILE, Reopened, RunFolder
from gaitopt.runs.summary import Summary
from gaitopt.simulation.objective import check_searchable


@dataclass(frozen=True)
class OptimiseRun:
    """A finished search.

    Attributes:
        summary: its figures, as in ``summary.json``.
        folder: its run folder; None where nothing was written.
        fresh: what was found; None where the run was finished before and only its summary was read.
    """

    summary: Summary
    folder: Path | None
    fresh: Optimised | None

    @property
    def optimised(self) -> Optimised:
        """What was found: the best gait, the baselines and every evaluation.

        Raises:
            GaitoptError: the run was finished before; its evaluations are in its folder.
        """
        if self.fresh is None:
            raise GaitoptError(f"{self.folder}: finished before; see its best.toml and evaluations.csv")
        return self.fresh

    @property
    def best(self) -> Verified:
        """The best gait, verified."""
        return self.optimised.best

    @property
    def baselines(self) -> Sequence[Verified]:
        """The hand-tuned gaits, verified."""
        return self.optimised.baselines

    @property
    def entries(self) -> Sequence[Entry]:
        """Every evaluation of the search, in order."""
        return self.optimised.entries

    @property
    def found_by(self) -> str:
        """The solver, or the baseline, that the best gait comes from."""
        return self.optimised.found_by


@dataclass(frozen=True)
class _Asked:
    """The requested options of a search; None for the default, or that of the resumed run."""

    budget: int | None
    seed: int | None
    method: str | None
    warm_start: bool | None
    pareto: bool | None
    posterior: Path | str | None
    out: Out

    def check_resumed(self, folder: Path | str, request: Request) -> None:
        """Check that no option differs from what a resumed run takes from its folder.

        Raises:
            GaitoptError: one does.
        """
        for field in fields(self):
            asked = getattr(self, field.name)
            if asked is not None and asked != getattr(request, field.name, None):
                name = field.name.replace("_", "-")
                raise GaitoptError(f"--{name}: not with --resume, which takes it from {folder}")

    def request(self) -> Request:
        """Return the request.

        Raises:
            GaitoptError: a part of it is not allowed.
        """
        budget = DEFAULT_BUDGET if self.budget is None else self.budget
        if budget < 1:
            raise GaitoptError(f"--budget: found {budget}; allowed: 1 or more")
        seed = checked_seed(1 if self.seed is None else self.seed)
        method = method_of(self.method or DEFAULT_METHOD.name).name
        return Request(seed, budget, method, self.warm_start is not False, bool(self.pareto))


@dataclass(frozen=True)
class _Work:
    """How a search is done and reported.

    Attributes:
        full: whether the report has a film.
        sensitivities: whether it has the sensitivities of the best gait.
        executor, workers: where rollouts run; see `opened`.
        on_progress: called as each stage begins, and as each batch or rollout of it ends.
    """

    full: bool
    sensitivities: bool
    executor: Executor | str
    workers: int | None
    on_progress: OnProgress

    def numbered(self, request: Request) -> OnProgress:
        """Return what tells progress with the number of each stage of a run in a folder."""
        pages = [(SENSITIVITIES, self.sensitivities), (FILM, self.full), (PAGE, True)]
        stages = (*search.stages_of(request), *(name for name, wanted in pages if wanted))
        return numbered(self.on_progress, stages)


def optimise(
    problem: Problem | None = None,
    *,
    budget: int | None = None,
    seed: int | None = None,
    method: str | None = None,
    warm_start: bool | None = None,
    pareto: bool | None = None,
    full: bool = False,
    sensitivity: bool = True,
    executor: Executor | str = "threads",
    workers: int | None = None,
    out: Out = None,
    posterior: Path | str | None = None,
    resume: Path | str | None = None,
    on_progress: OnProgress = silent,
) -> OptimiseRun:
    """Search for the best gait of a problem, and verify it and the hand-tuned ones.

    The result depends only on the problem, `seed`, `budget`, `method`, `warm_start`, `pareto` and
    `posterior`.

    Args:
        problem: the problem; not needed with `resume`, which takes it from the folder.
        budget: gaits to evaluate; 600 by default.
        seed: seed of all randomness; 1 by default.
        method: ``default``, or one solver: ``cma-es`` or ``nelder-mead``.
        warm_start: whether to start from planned gaits, where the problem has a planar model; yes by
            default.
        pareto: whether to spend half of the budget on a front of speed against cost of transport.
        full: with `out`: add a film, and the sensitivities of the best gait, to the report.
        sensitivity: with `full`: whether the sensitivities are among it.
        executor: where rollouts run: ``threads``, ``processes``, ``serial``, ``dask://HOST:PORT`` or an
            executor.
        workers: rollouts at once; all cores by default.
        out: a new or an empty folder for the run; nothing is left behind without it.
        posterior: the run folder of a diagnosis; each scenario then runs on one of its robots, so that the
            winner is good for what is still unknown.
        resume: the folder of an interrupted run to continue, with the bits of an uninterrupted one. A
            finished run without its page gets the page, without another search.
        on_progress: called as each stage begins, and as each batch or rollout of it ends.

    Raises:
        GaitoptError: the request or the objective is wrong, every gait failed, the folder is in use, or
            the page could not be written; the results then are.
        Stopped: Ctrl-C or SIGTERM ended a search that can be resumed.
    """
    check_executor(executor, workers)
    asked = _Asked(budget, seed, method, warm_start, pareto, posterior, out)
    work = _Work(full, full and sensitivity, executor, workers, on_progress)
    if resume is not None:
        reopened = RunFolder.reopen(Path(resume))
        asked.check_resumed(resume, reopened.request)
        return _in_folder(lambda: reopened, work)
    if problem is None:
        raise GaitoptError("optimise: found no problem and no run to resume")
    problem, request = over_posterior(carrying(problem), posterior), asked.request()
    check_searchable(problem)
    if out is None:
        return _in_memory(problem, request, work)
    path = out_folder(out)
    return _in_folder(lambda: Reopened(RunFolder.create(path, problem, request), problem, request), work)


def _in_memory(problem: Problem, request: Request, work: _Work) -> OptimiseRun:
    """Search, and leave nothing behind."""
    with TemporaryDirectory() as name:
        journal = Journal(Path(name) / JOURNAL_FILE, problem)
        with opened(work.executor, work.workers) as pool:
            told = numbered(work.on_progress, search.stages_of(request))
            optimised = search.optimise(problem, request, journal, pool, told)
    return OptimiseRun(Summary.of(problem, optimised), None, optimised)


def _in_folder(open_run: Callable[[], Reopened], work: _Work) -> OptimiseRun:
    """Do or continue the work of a run. A finished one is only read, or gets the page that it lacks.

    The results are written before the page, so that no page that fails can cost a search.
    """
    with ExitStack() as stack:
        with interrupts_held():  # so that no folder is made that nobody removes
            run = open_run()
            folder = stack.enter_context(run.folder)
        stack.enter_context(_stoppable(folder, run.problem))
        finished = folder.summary
        if finished is not None and not (run.same_versions and folder.lacks_page):
            return OptimiseRun(finished, folder.path, None)
        problem = carrying(run.problem)
        journal = folder.open_journal(problem)
        if finished is not None and len(journal.entries) < finished.evaluations:
            return OptimiseRun(finished, folder.path, None)  # too little is left for a page
        with opened(work.executor, work.workers) as pool:
            told = work.numbered(run.request)
            optimised = search.optimise(problem, run.request, journal, pool, told)
            summary = finished or folder.write_results(problem, optimised)
            _write_page(folder, problem, optimised, work, pool, told)
        return OptimiseRun(summary, folder.path, optimised)


def _write_page(
    folder: RunFolder,
    problem: Problem,
    optimised: Optimised,
    work: _Work,
    pool: Executor,
    on_progress: OnProgress,
) -> None:
    """Write the page of a finished search.

    Raises:
        GaitoptError: it could not be written; the line says that the results are.
    """
    from gaitopt.report.page import after_results
    from gaitopt.report.search import write_report

    path = shlex.quote(str(folder.path))
    again = f"gaitopt optimise {path} --resume {path}"
    with after_results(folder.path, f"{BEST_FILE} and {SUMMARY_FILE}", again):
        found = (
            sensitivities(problem, optimised.best.gait, optimised.request.seed, pool, on_progress=on_progress)
            if work.sensitivities
            else []
        )
        write_report(folder, problem, optimised, work.full, found, on_progress)


def holds_run(reference: str) -> bool:
    """Return whether a problem is the folder of a run, which may have been meant to go on."""
    return (Path(reference) / REQUEST_FILE).is_file()


@contextmanager
def _stoppable(folder: RunFolder, problem: Problem) -> Iterator[None]:
    """Where Ctrl-C or SIGTERM ends a run that has begun, say what it found and where it can go on."""
    try:
        yield
    except KeyboardInterrupt as stop:
        if not folder.started:
            raise
        entries = folder.open_journal(problem).entries
        walking = succeeded(entries)
        best = walking[0].evaluation.metrics["speed_m_s"] if walking else None
        found = "none that walks" if best is None else f"{1e3 * best:.1f} mm/s"
        raise Stopped(f"{len(entries)} gaits, best so far {found}", folder.path) from stop
