"""The jobs `blind make` and `blind score`: sealed cases, and how good diagnoses of them are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from gaitopt.blind.answers import read_cases
from gaitopt.blind.cases import NOMINAL_FOLDER, CaseRequest, kinds_of, make_cases, nominal_files
from gaitopt.blind.factory import RecordingPlan
from gaitopt.blind.scoring import Score, score
from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.files import read_bytes
from gaitopt.core.folders import not_empty
from gaitopt.core.own_files import check_folder
from gaitopt.core.progress import OnProgress, Progress, silent
from gaitopt.diagnose.diagnosis import DiagnosisRequest
from gaitopt.jobs.diagnose import Question, answered_into, is_finished
from gaitopt.jobs.executor import opened
from gaitopt.jobs.inputs import checked_seed
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.runs.diagnosis_folder import diagnosis_folder
from gaitopt.runs.folder import check_free, held
from gaitopt.runs.lock import LOCK_FILE

EACH_CASE = DiagnosisRequest(seed=1, next_gait=False)
"""How every blind case is diagnosed."""


@dataclass(frozen=True)
class MadeCases:
    """Sealed cases.

    Attributes:
        folder: their folder.
        sealed: the folder of their truth, which only `blind_score` reads.
        kinds: the kind of each case.
        faint: effects that were drawn and, on some target or side, make too small a gap.
    """

    folder: Path
    sealed: Path
    kinds: tuple[str, ...]
    faint: tuple[str, ...]

    def to_dict(self) -> dict[str, object]:
        """Return what `gaitopt blind make --json` prints."""
        return {
            "cases": len(self.kinds),
            "folder": str(self.folder),
            "sealed": str(self.sealed),
            "faint": list(self.faint),
        }


def blind_make(
    problem: Problem,
    cases: int,
    out: Path | str,
    *,
    seed: int = 1,
    seconds: float = 12.0,
    gaits: Sequence[str] | None = None,
    signals: Sequence[str] | None = None,
    kind: str | None = None,
    only: str | None = None,
    executor: Executor | str = "threads",
    workers: int | None = None,
) -> MadeCases:
    """Make sealed cases: data sets whose cause only `blind_score` reads.

    Args:
        problem: the problem.
        cases: how many.
        out: their folder; cases of this problem that it holds are kept.
        seed: seed of all randomness.
        seconds: length of a trial, s.
        gaits: names of the baselines measured; all by default.
        signals: what is measured; by default the marker and the joint of the first servo.
        kind: make only this kind: ``single``, ``none``, ``outside``, ``pair`` or ``several``.
        only: with `kind`: plant this effect or disturbance.
        executor: where robots are simulated: ``threads``, ``processes``, ``serial``, ``dask://HOST:PORT``
            or an executor.
        workers: robots simulated at once; all cores by default.

    Raises:
        GaitoptError: an argument is not allowed, what is to be planted makes no gap, or the folder holds
            something else.
    """
    problem = carrying(problem)
    if cases < 1:
        raise bad_value("blind make", "--cases", cases, "1 or more")
    if only and not kind:
        raise bad_value("blind make", "--only", only, "with --kind single or outside")
    names = list(problem.baselines) if gaits is None else list(gaits)
    seed = checked_seed(seed)
    kinds = [kind] * cases if kind else kinds_of(cases, seed)
    request = CaseRequest(kinds, seed, RecordingPlan(names, seconds, signals), only)
    with _cases_folder(Path(out), problem), opened(executor, workers) as pool:
        faint = make_cases(problem, Path(out), request, pool)
    return MadeCases(Path(out), Path(out) / "sealed", tuple(kinds), tuple(faint))


@contextmanager
def _cases_folder(folder: Path, problem: Problem) -> Iterator[None]:
    """Hold the folder of cases; one that was made for them and stays empty is removed.

    Raises:
        GaitoptError: it holds something else than cases of this problem, another run works there, or it
            cannot be written.
    """
    made = not folder.exists()
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise GaitoptError(f"--out: {folder}: cannot be made: {error.strerror}") from None
        _check_cases(folder, problem)
        with held(folder):
            yield
    finally:
        if made:
            with suppress(OSError):  # it holds something
                folder.rmdir()


def _check_cases(folder: Path, problem: Problem) -> None:
    """Check that a folder holds nothing, or cases of this problem, before anything is done to it."""
    check_folder(folder)
    nominal = folder / NOMINAL_FOLDER
    if not nominal.is_dir() and {path.name for path in folder.iterdir()} - {LOCK_FILE}:
        raise not_empty(folder)
    for name, data in nominal_files(problem).items():
        path = nominal / name
        if path.exists() and read_bytes(path) != data:
            raise GaitoptError(
                f"--out: {path} is of another problem; allowed: a new folder, or cases of this problem"
            )


def blind_score(
    folder: Path | str,
    *,
    diagnoses: Path | str | None = None,
    executor: Executor | str = "threads",
    workers: int | None = None,
    on_progress: OnProgress = silent,
) -> Score:
    """Compare diagnoses with the sealed truth; cases without a diagnosis are diagnosed first.

    Args:
        folder: the folder that `blind_make` made.
        diagnoses: run folders, one for each case; ``diagnoses`` in `folder` by default.
        executor: where robots are simulated: ``threads``, ``processes``, ``serial``, ``dask://HOST:PORT``
            or an executor.
        workers: robots simulated at once; all cores by default.
        on_progress: called as each diagnosis begins.

    Raises:
        GaitoptError: there are no sealed cases, a folder holds a link or what is no plain file, something
            else is where a diagnosis is to be, or a diagnosis fails.
    """
    folder = Path(folder)
    diagnoses = folder / "diagnoses" if diagnoses is None else Path(diagnoses)
    for given in (folder, diagnoses):
        if given.is_dir():
            check_folder(given)
    with opened(executor, workers) as pool:
        _diagnose_cases(folder, diagnoses, pool, on_progress)
    return score(read_cases(folder, diagnoses))


def _diagnose_cases(folder: Path, diagnoses: Path, executor: Executor, on_progress: OnProgress) -> None:
    """Diagnose every case that has no diagnosis yet, and write a run folder for each."""
    problem = None
    for case in sorted(path for path in folder.glob("case-*") if path.is_dir()):
        out = diagnoses / case.name
        if is_finished(out):
            continue
        problem = problem or carrying(load_problem(folder / NOMINAL_FOLDER))
        on_progress(Progress(f"diagnosing {case.name}"))
        question = Question.of(problem, case, EACH_CASE)
        resumed = out if question.cache(out).folder.is_dir() else None
        if resumed is None:
            _check_free(out)
        with diagnosis_folder(out, resumed, problem.name):
            answered_into(out, question, executor, corrected=False)


def _check_free(folder: Path) -> None:
    """Check that a diagnosis may begin in a folder: a stranger may have given a case the name of it."""
    try:
        check_free(folder)
    except GaitoptError:
        allowed = "an unfinished diagnosis of this case, or nothing"
        raise GaitoptError(f"--diagnoses: {folder}: found something else; allowed: {allowed}") from None
