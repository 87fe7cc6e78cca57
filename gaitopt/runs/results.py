"""Run folders: what a run leaves behind, whole or not at all."""

from __future__ import annotations

import json
import math
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import IO, Any

import tomli_w
from pydantic import BaseModel

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.files import read_json, read_toml, validated, write_text, write_with
from gaitopt.core.folders import not_empty
from gaitopt.core.versions import versions
from gaitopt.gait.gait import write_gait
from gaitopt.optimise.journal import gait_columns
from gaitopt.optimise.pareto import FrontGait, speed, transport
from gaitopt.optimise.run import Optimised, Request
from gaitopt.optimise.verification import Verified
from gaitopt.problem.lookup import PROBLEM_FILE
from gaitopt.problem.model import model_assets, nominal_mjcf
from gaitopt.problem.problem import Problem, load_problem

RUNS = Path("results") / "runs"
"""Where run folders go by default; git ignores it."""

_REQUEST_FILE = "run.toml"
_SUMMARY_FILE = "summary.json"
_LOCK_FILE = ".lock"
_MODEL_FILE = "model.xml"
_FIRST_FILES = (PROBLEM_FILE, _MODEL_FILE)

_HALF_WRITTEN = re.compile(r"\..+\.[a-z0-9_]{8}\.\w+")
"""Names of the temporary files that `files.write_with` renames into place; a killed run may leave one."""


class _Row(BaseModel):
    """What is printed of one gait; a figure that is not finite stands as null."""

    name: str
    period_s: float
    speed_m_s: float | None
    speed_ci90_m_s: tuple[float | None, float | None]
    constraints_met: bool
    violations: dict[str, float | None]
    status: str


class _Summary(BaseModel):
    """What is printed of a finished run."""

    best: _Row
    baselines: list[_Row]
    ratio_to_best_baseline: float | None


class RunFolder:
    """A folder that holds one run: its problem, model, journal and results.

    Holding it keeps every other run out; use it as a context manager. A folder that was made for a
    run which ended before its first evaluation is removed again.
    """

    def __init__(self, path: Path, new: bool, made: bool = False):
        self.path = path
        self._new = new
        self._made = made
        self._lock: IO[str] | None = None
        self._assets: list[Path] = []

    @staticmethod
    def create(path: Path | None, problem: Problem, request: Request) -> RunFolder:
        """Make the folder of a new run and write its problem, model and request.

        Raises:
            GaitoptError: the folder holds something already, or cannot be written.
        """
        model, assets = nominal_mjcf(problem), model_assets(problem)
        path = path or _next_free(problem.name)
        made = _make(path)
        folder = RunFolder(path, new=True, made=made)
        folder._take()
        try:
            for name, data in assets.items():
                folder._write_asset(name, data)
            write_problem(path, problem, model)
            content = asdict(request) | versions()
            folder.file(_REQUEST_FILE, lambda p: write_text(p, tomli_w.dumps(content)))
        except BaseException:
            folder.discard()
            folder._let_go()
            if made:
                folder._remove_empty()
            raise
        return folder

    @staticmethod
    def reopen(path: Path) -> tuple[RunFolder, Problem, Request]:
        """Open the folder of an interrupted or finished run.

        Raises:
            GaitoptError: the folder does not hold a run, or an unfinished one of other versions.
        """
        if not (path / _REQUEST_FILE).is_file():
            raise GaitoptError(f"--resume: {path}: not a run folder (no {_REQUEST_FILE})")
        values = read_toml(path / _REQUEST_FILE)
        values = {"pareto": False} | values  # which runs of earlier versions do not name
        for key, default in asdict(Request()).items():
            if key not in values:
                raise GaitoptError(f"{path / _REQUEST_FILE}: {key}: missing; it is required")
            if type(values[key]) is not type(default):
                raise bad_value(path / _REQUEST_FILE, key, values[key], f"{type(default).__name__}")
        for name, here in versions().items():
            if values.get(name, here) != here and not (path / _SUMMARY_FILE).exists():
                raise bad_value(
                    path / _REQUEST_FILE, name, values[name], f"{here}, the version here, to go on"
                )
        request = Request(**{key: values[key] for key in asdict(Request())})
        return RunFolder(path, new=False), load_problem(path), request

    def __enter__(self) -> RunFolder:
        if self._lock is None:
            self._take()
        _sweep_up(self.path)
        return self

    def __exit__(self, *_: object) -> None:
        if self._new and not self.started:
            self.discard()
        self._let_go()
        if self._made and not self.started:
            self._remove_empty()

    def _take(self) -> None:
        self._lock = _locked(self.path / _LOCK_FILE)

    def _let_go(self) -> None:
        if self._lock is not None:
            _unlock(self._lock, self.path / _LOCK_FILE)
            self._lock = None

    def _write_asset(self, name: str, data: bytes) -> None:
        path = self.path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_with(path, lambda temporary: temporary.write_bytes(data))
        self._assets.append(path)

    @property
    def journal(self) -> Path:
        """The file of the evaluations."""
        return self.path / "evaluations.csv"

    @property
    def started(self) -> bool:
        """Whether the folder holds anything that took time to compute."""
        try:
            return self.journal.read_bytes().count(b"\n") > 1
        except OSError:
            return False

    @property
    def summary(self) -> dict[str, Any] | None:
        """The summary of a finished run, or None.

        Raises:
            GaitoptError: it was changed since, and what is printed of it is no longer there.
        """
        path = self.path / _SUMMARY_FILE
        if not path.exists():
            return None
        summary: dict[str, Any] = read_json(path)
        validated(_Summary, summary, path)
        return summary

    def file(self, name: str, write: Callable[[Path], object]) -> Path:
        """Write one file of the run whole or not at all, and return its path."""
        return write_into(self.path, name, write)

    def discard(self) -> None:
        """Remove the folder with what the run wrote into it, and nothing else."""
        written = [self.path / name for name in (_REQUEST_FILE, *_FIRST_FILES, self.journal.name)]
        with suppress(OSError):  # the folder may be gone, or have become read-only
            for path in [*written, *self._assets]:
                path.unlink(missing_ok=True)
            for folder in {path.parent for path in self._assets} - {self.path}:
                folder.rmdir()

    def _remove_empty(self) -> None:
        with suppress(OSError):
            self.path.rmdir()

    def write_results(self, problem: Problem, optimised: Optimised) -> dict[str, Any]:
        """Write the best gait and the summary, and return the summary."""
        summary = summary_of(problem, optimised)
        self.file("best.toml", lambda p: write_gait(p, optimised.best.gait))
        if optimised.request.pareto:
            self.file("pareto.csv", lambda p: write_text(p, front_csv(problem, optimised.front)))
        for found in optimised.front:
            gait = found.verified.gait
            self.file(f"pareto/{gait.name}.toml", partial(write_gait, gait=gait))
        self.file(_SUMMARY_FILE, lambda p: write_text(p, to_json(summary)))
        return summary


def summary_of(problem: Problem, optimised: Optimised) -> dict[str, Any]:
    """Return the content of ``summary.json``."""
    best = optimised.best
    fastest = max((b.speed for b in optimised.baselines if math.isfinite(b.speed)), default=math.nan)
    feasible = [b.speed for b in optimised.baselines if b.evaluation.constraints_met]
    reference = problem.simulation.reference
    return {
        "problem": problem.name,
        "seed": optimised.request.seed,
        "budget": optimised.request.budget,
        "method": optimised.request.method,
        "evaluations": len(optimised.entries),
        "simulated_s": optimised.simulated_s,
        "wall_s": optimised.wall_s,
        "baselines": [_row(baseline) for baseline in optimised.baselines],
        "warm_start": _warm_start(optimised),
        "over_scenarios": problem.to_dict()["objective"]["over_scenarios"],
        "fidelity_ladder": [asdict(rung) for rung in optimised.rungs],
        "pareto": [_front_row(found) for found in optimised.front] if optimised.request.pareto else None,
        "notes": list(optimised.notes),
        "best": _row(best) | {"found_by": optimised.found_by},
        "verified": {
            "timestep_s": reference.timestep_s,
            "integrator": reference.integrator,
            "scenarios": len(best.speeds),
            "speed_m_s": best.speed,
        },
        "ratio_to_best_baseline": _ratio(best.speed, fastest),
        "ratio_to_best_feasible_baseline": _ratio(best.speed, max(feasible, default=math.nan)),
    }


def _front_row(found: FrontGait) -> dict[str, Any]:
    verified = found.verified
    low, high = verified.speed_ci90
    return {
        "name": verified.gait.name,
        "evaluation": found.entry.index,
        "speed_m_s": verified.speed,
        "speed_ci90_low_m_s": low,
        "speed_ci90_high_m_s": high,
        "speed_worst_m_s": verified.worst,
        "cost_of_transport": verified.evaluation.metrics["cost_of_transport"],
        "constraints_met": verified.evaluation.constraints_met,
        "on_front": found.efficient,
        "searched_speed_m_s": speed(found.entry),
        "searched_cost_of_transport": transport(found.entry),
    }


def front_csv(problem: Problem, front: Sequence[FrontGait]) -> str:
    """Return the gaits of speed against cost of transport as a CSV table, with what they are made of."""
    head = "name,evaluation,speed_m_s,speed_ci90_low_m_s,speed_ci90_high_m_s,speed_worst_m_s,"
    head += "cost_of_transport,constraints_met,on_front,searched_speed_m_s,searched_cost_of_transport"
    lines = [",".join([head, "period_s", *gait_columns(problem)])]
    for found in front:
        gait = found.verified.gait
        shape = [value for channel in gait.channels.values() for value in channel.model_dump().values()]
        lines.append(",".join(_csv_cell(v) for v in [*_front_row(found).values(), gait.period_s, *shape]))
    return "\n".join(lines) + "\n"


def _csv_cell(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _warm_start(optimised: Optimised) -> dict[str, Any] | None:
    if optimised.warm_start is None or optimised.plan is None:
        return None
    verified, predicted = optimised.warm_start
    return {
        "predicted_speed_m_s": predicted,
        "speed_m_s": verified.speed,
        "speed_ci90_m_s": list(verified.speed_ci90),
        "elites": len(optimised.plan.elites),
        "dropped": list(optimised.plan.dropped),
        "rank_correlation": optimised.rank_correlation,
    }


def _row(verified: Verified) -> dict[str, Any]:
    evaluation = verified.evaluation
    return {
        "name": verified.gait.name,
        "period_s": verified.gait.period_s,
        "speed_m_s": verified.speed,
        "speed_ci90_m_s": list(verified.speed_ci90),
        "speed_worst_m_s": verified.worst,
        "stride_m": verified.speed * verified.gait.period_s,
        "constraints_met": evaluation.constraints_met,
        "violations": {name: size for name, size in evaluation.violations.items() if size > 0.0},
        "status": evaluation.status,
        "metrics": evaluation.metrics,
    }


def _ratio(speed: float, baseline: float) -> float | None:
    return speed / baseline if baseline > 0.0 else None


def to_json(value: object, indent: int | None = 1) -> str:
    """Return strict JSON, one line without `indent`; numbers that it does not know (inf, NaN) become null."""
    return json.dumps(_finite(value), indent=indent, allow_nan=False) + "\n"


def _finite(value: object) -> object:
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def write_into(folder: Path, name: str, write: Callable[[Path], object]) -> Path:
    """Write one file of a folder whole or not at all, and return its path."""
    path = folder / name
    try:
        path.parent.mkdir(exist_ok=True)
    except OSError as error:
        raise GaitoptError(f"{path.parent}: cannot be made: {error.strerror}") from None
    write_with(path, write)
    return path


def write_problem(folder: Path, problem: Problem, model: str) -> None:
    """Write the nominal model, an MJCF, and a problem file that points to it: the folder is a problem."""
    write_into(folder, _MODEL_FILE, lambda p: write_text(p, model))
    write_into(folder, PROBLEM_FILE, lambda p: write_text(p, problem.to_toml(_MODEL_FILE)))


def new_folder(path: Path | None, name: str) -> Path:
    """Return a new or empty folder: `path`, or a numbered one under `RUNS`.

    Raises:
        GaitoptError: the folder holds something already, or cannot be made.
    """
    path = path or _next_free(name)
    _make(path)
    return path


@contextmanager
def held(path: Path) -> Iterator[None]:
    """Keep every other run out of a folder, cleared of what a killed one left half-written.

    Raises:
        GaitoptError: another run is working there, or the folder cannot be written.
    """
    lock = _locked(path / _LOCK_FILE)
    try:
        _sweep_up(path)
        yield
    finally:
        _unlock(lock, path / _LOCK_FILE)


def _sweep_up(folder: Path) -> None:
    """Remove what a killed run left half-written."""
    for path in [*folder.iterdir(), *folder.glob("*/*")]:
        if _HALF_WRITTEN.fullmatch(path.name):
            path.unlink(missing_ok=True)


def _next_free(name: str) -> Path:
    number = 1
    while (RUNS / f"{name}-{number:03d}").exists():
        number += 1
    return RUNS / f"{name}-{number:03d}"


def _make(path: Path) -> bool:
    """Make a folder, or take an empty one; return whether it was made."""
    if path.is_dir():
        if (path / _REQUEST_FILE).exists() or (path / "evaluations.csv").exists():
            raise GaitoptError(
                f"--out: {path} already holds a run; choose another folder, or --resume {path}"
            )
        if any(path.iterdir()) and not _killed_while_made(path):
            raise not_empty(path)
        return False
    try:
        path.mkdir(parents=True)
    except OSError as error:
        raise GaitoptError(f"--out: {path}: cannot be made: {error.strerror}") from None
    return True


def _killed_while_made(path: Path) -> bool:
    """Whether a folder holds the lock and the first files of a run killed in its first second."""
    names = {file.name for file in path.iterdir()}
    half = {name for name in names if _HALF_WRITTEN.fullmatch(name)}
    return _LOCK_FILE in names and names - half <= {_LOCK_FILE, *_FIRST_FILES}


def _unlock(file: IO[str], path: Path) -> None:
    """Remove a lock file and let go of it, in the order that leaves no gap for a third run."""
    with suppress(OSError):
        if sys.platform == "win32":
            file.close()
        path.unlink(missing_ok=True)
        file.close()


def _locked(path: Path) -> IO[str]:
    """Return the open lock file; it is let go when the process ends, however it ends."""
    file: IO[str] | None = None
    try:
        file = path.open("w")
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not path.exists() or os.fstat(file.fileno()).st_ino != path.stat().st_ino:
                file.close()  # its owner removed it since it was opened
                return _locked(path)
    except OSError as error:
        if file is not None:
            file.close()
            raise GaitoptError(f"{path.parent}: another run is working in this folder") from None
        raise GaitoptError(f"{path}: cannot be written: {error.strerror}") from None
    return file
