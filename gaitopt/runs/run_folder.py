"""The run folder of `optimise`: its problem, its request, its journal and its results."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

import tomli_w

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.files import read_bytes, read_toml
from gaitopt.core.json import to_json
from gaitopt.core.own_files import check_folder, check_own
from gaitopt.core.versions import versions
from gaitopt.gait.gait import BEST_FILE
from gaitopt.optimise.journal import Journal
from gaitopt.optimise.run import Optimised, Request
from gaitopt.problem.model import assets_beside, model_assets, nominal_mjcf
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.runs.folder import (
    FIRST_FILES,
    JOURNAL_FILE,
    PAGE_FILE,
    POSTERIOR_FILE,
    REQUEST_FILE,
    make_folder,
    next_free,
    remove_half_written,
    write_into,
    write_problem,
)
from gaitopt.runs.front_table import front_csv
from gaitopt.runs.lock import FolderLock
from gaitopt.runs.posterior import posterior_csv, read_robots
from gaitopt.runs.summary import Summary

SUMMARY_FILE = "summary.json"
"""The result of a run, the last one before its page: it shows that the search is finished."""

_ROBOTS = "robots"
"""Key of the request: how many robots of a posterior the scenarios run on; absent without any."""


@dataclass(frozen=True)
class Reopened:
    """The run that a folder holds.

    Attributes:
        folder: the folder, not locked yet.
        problem: the problem of the run.
        request: the request.
        same_versions: whether it was made with the same versions, so that it can be resumed.
    """

    folder: RunFolder
    problem: Problem
    request: Request
    same_versions: bool = True


class RunFolder:
    """A folder that holds one run. Use it as a context manager: it is locked for other runs meanwhile.

    A folder that was made for a run which ended before its first evaluation is removed again.

    Attributes:
        path: the folder.
    """

    def __init__(self, path: Path, new: bool, made: bool = False):
        self.path = path
        self._new = new
        self._made = made
        self._lock = FolderLock(path)
        self._assets: list[Path] = []

    @staticmethod
    def create(path: Path | None, problem: Problem, request: Request) -> RunFolder:
        """Make the folder of a new run and write its problem, model and request.

        Raises:
            GaitoptError: the folder holds something already, or cannot be written.
        """
        model, assets = nominal_mjcf(problem), assets_beside(problem)
        path = path or next_free(problem.name)
        folder = RunFolder(path, new=True, made=make_folder(path))
        folder._lock.take()
        try:
            folder._assets = [path / name for name in assets]
            write_problem(path, problem, model)
            content = asdict(request) | versions()
            if problem.robots:
                folder.file(POSTERIOR_FILE, posterior_csv(problem.robots))
                content[_ROBOTS] = len(problem.robots)
            folder.file(REQUEST_FILE, tomli_w.dumps(content))
        except BaseException:
            folder.discard()
            folder._lock.release()
            folder._remove_if_made()
            raise
        return folder

    @staticmethod
    def reopen(path: Path) -> Reopened:
        """Open the folder of an interrupted or finished run.

        Raises:
            GaitoptError: the folder does not hold a run, or an unfinished one of other versions.
        """
        file = path / REQUEST_FILE
        if not file.is_file():
            raise GaitoptError(f"--resume: {path}: not a run folder (no {REQUEST_FILE})")
        check_folder(path)
        values = read_toml(file)
        values = {"pareto": False} | values  # which runs of earlier versions do not name
        for key, default in asdict(Request()).items():
            if key not in values:
                raise GaitoptError(f"{file}: {key}: missing; it is required")
            if type(values[key]) is not type(default):
                raise bad_value(file, key, values[key], f"{type(default).__name__}")
        others = [name for name, here in versions().items() if values.get(name, here) != here]
        if others and not (path / SUMMARY_FILE).exists():
            name = others[0]
            raise bad_value(file, name, values[name], f"{versions()[name]}, the version here, to go on")
        request = Request(**{key: values[key] for key in asdict(Request())})
        request.check(file)
        problem = _with_robots(load_problem(path), path, values.get(_ROBOTS, 0))
        return Reopened(RunFolder(path, new=False), problem, request, not others)

    def __enter__(self) -> RunFolder:
        self._lock.take()
        try:
            remove_half_written(self.path)
        except BaseException:
            self._lock.release()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if self._new and not self.started:
            self.discard()
        self._lock.release()
        if not self.started:
            self._remove_if_made()

    @property
    def journal(self) -> Path:
        """The file of the evaluations."""
        return self.path / JOURNAL_FILE

    @property
    def started(self) -> bool:
        """Whether the folder holds anything that took time to compute."""
        try:
            return check_own(self.journal) and read_bytes(self.journal).count(b"\n") > 1
        except GaitoptError:
            return False

    def open_journal(self, problem: Problem) -> Journal:
        """Open the journal of the run, or begin it.

        Raises:
            GaitoptError: it does not belong to the files beside it, or was changed since.
        """
        return Journal(self.journal, problem, self.journal_key(problem))

    def journal_key(self, problem: Problem) -> str:
        """Return a digest of what evaluations depend on: the problem's files, the request and the versions.

        Raises:
            GaitoptError: a file of them cannot be read.
        """
        own = (REQUEST_FILE, *FIRST_FILES, *([POSTERIOR_FILE] if problem.robots else []))
        named = [read_bytes(self.path / name) for name in own]
        digests = [hashlib.sha256(data).digest() for data in (*named, *model_assets(problem).values())]
        return hashlib.sha256(b"".join(digests[: len(named)] + sorted(digests[len(named) :]))).hexdigest()

    @property
    def summary(self) -> Summary | None:
        """The summary of a finished run, or None.

        Raises:
            GaitoptError: it was changed since, and what is printed of it is no longer there.
        """
        path = self.path / SUMMARY_FILE
        return Summary.read(path) if path.exists() else None

    @property
    def lacks_page(self) -> bool:
        """Whether the page, the last step of a run, is to be written, and there is what it shows."""
        return self.journal.is_file() and not (self.path / PAGE_FILE).is_file()

    def file(self, name: str, content: str | Callable[[Path], object]) -> Path:
        """Write one file of the run whole or not at all, and return its path; see `write_into`."""
        return write_into(self.path, name, content)

    def discard(self) -> None:
        """Remove the folder with what the run wrote into it, and nothing else."""
        written = [self.path / name for name in (REQUEST_FILE, *FIRST_FILES, POSTERIOR_FILE, JOURNAL_FILE)]
        with suppress(OSError):  # the folder may be gone, or have become read-only
            for path in [*written, *self._assets]:
                path.unlink(missing_ok=True)
            folders = {folder for path in self._assets for folder in path.parents}
            for folder in sorted(folders, reverse=True):  # the innermost first
                if self.path in folder.parents:
                    folder.rmdir()

    def write_results(self, problem: Problem, optimised: Optimised) -> Summary:
        """Write the best gait, the front if one was requested, and the summary; return the summary."""
        summary = Summary.of(problem, optimised)
        self.file(BEST_FILE, optimised.best.gait.to_toml())
        if optimised.request.pareto:
            self.file("pareto.csv", front_csv(problem, optimised.front))
        for found in optimised.front:
            gait = found.verified.gait
            self.file(f"pareto/{gait.name}.toml", gait.to_toml())
        self.file(SUMMARY_FILE, to_json(summary.to_dict()))
        return summary

    def _remove_if_made(self) -> None:
        if self._made:
            with suppress(OSError):
                self.path.rmdir()


def _with_robots(problem: Problem, path: Path, count: object) -> Problem:
    """Return the problem of a run with the robots of its posterior.

    Raises:
        GaitoptError: they are not those of the request.
    """
    if count == 0:
        return problem
    robots = read_robots(path / POSTERIOR_FILE, problem)
    if count != len(robots):
        raise bad_value(path / REQUEST_FILE, _ROBOTS, count, f"{len(robots)}, as in {POSTERIOR_FILE}")
    return problem.with_robots(robots)
