"""Ending a command at a named point: kills and interrupts that land where they are meant to.

The command runs in a process of its own that ends itself by a signal. It does so at a tick of a named stage.
A tick is a call of the stage's function, or, while that runs, the start of a rollout or the moment before a
written file gets its name. No code of the package knows of it: functions are wrapped from outside, and an
audit hook sees the files. A marker beside the run says where the signal was sent.
"""

from __future__ import annotations

import functools
import inspect
import json
import multiprocessing
import os
import signal
import sys
import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from helpers import STRIDER, brief_studies
from planting import dataset, recording_of, rollout

from gaitopt.problem.problem import load_problem

PATIENCE_S = 300.0
"""After this a process is taken to hang, however busy the machine."""


@dataclass(frozen=True)
class Stage:
    """A stage of a command.

    Attributes:
        scope: ``module:function``, looked up where it is called.
        file: only the moment before this file gets its name counts; any tick by default.
        entry: only calls of the function count.
    """

    scope: str
    file: str = ""
    entry: bool = False


SEARCH: Mapping[str, Stage] = {
    "new folder": Stage("gaitopt.runs.run_folder:RunFolder.create"),
    "before the first gait": Stage("gaitopt.optimise.study:Study._start"),
    "in a batch": Stage("gaitopt.optimise.solvers.cma_es:CmaEs.minimise"),
    "before a batch is written": Stage("gaitopt.optimise.journal:Journal.append", entry=True),
    "between batches": Stage("gaitopt.optimise.recorder:SearchProgress", entry=True),
    "polish": Stage("gaitopt.optimise.solvers.nelder_mead:NelderMead.minimise"),
    "selection": Stage("gaitopt.optimise.run:select"),
    "verification": Stage("gaitopt.optimise.run:verify"),
    "results": Stage("gaitopt.runs.run_folder:RunFolder.write_results"),
    "sensitivities": Stage("gaitopt.jobs.optimise:sensitivities"),
    "page": Stage("gaitopt.report.search:write_report"),
    "last write": Stage("gaitopt.report.search:write_report", file="report.html"),
}
"""The stages of `gaitopt optimise --full`, in order."""

DIAGNOSIS: Mapping[str, Stage] = {
    "floor": Stage("gaitopt.diagnose.diagnosis:measure_floors"),
    "first covariance": Stage("gaitopt.diagnose.judge.find_causes:prepare_trials"),
    "fitting": Stage("gaitopt.diagnose.judge.find_causes:fit_all"),
    "finishing": Stage("gaitopt.diagnose.judge.find_causes:finish"),
    "tolerances": Stage("gaitopt.diagnose.judge.gait_sets:with_tolerances"),
    "sets": Stage("gaitopt.diagnose.fit.set_search:SetSearch.run"),
    "next experiment": Stage("gaitopt.diagnose.diagnosis:propose"),
    "correction": Stage("gaitopt.diagnose.correction:correct"),
    "diagnosis.json": Stage("gaitopt.report.diagnosis_report:write_diagnosis", file="diagnosis.json"),
    "page": Stage("gaitopt.report.diagnosis_report:write_page"),
    "last write": Stage("gaitopt.report.diagnosis_report:write_page", file="report.html"),
    "clearing": Stage("gaitopt.diagnose.fit.cache:SimulationCache.clear", entry=True),
}
"""The stages of `gaitopt diagnose`, in order."""


@dataclass(frozen=True)
class Stop:
    """Where a command is to end, and how.

    Attributes:
        stage, tick: where.
        number: the signal that it sends to itself.
        fill: a file that takes all the space of its disk instead of a signal; the command may go on.
    """

    stage: str
    tick: int
    number: int = signal.SIGKILL
    fill: Path | None = None


@dataclass(frozen=True)
class Ended:
    """How a command ended.

    Attributes:
        code: its exit code; minus the signal that ended it.
        out, err: what it printed.
        marker: where the signal was sent: stage, tick and what happened there; empty where none was.
        ticks: how many ticks each stage has, of a command that was not ended.
    """

    code: int
    out: str
    err: str
    marker: dict[str, Any]
    ticks: dict[str, int]


class _Stopper:
    """Counts the ticks of stages, and ends the process at one."""

    def __init__(self, stages: Mapping[str, Stage], stop: Stop | None, marker: Path):
        self._stages, self._stop, self._marker = stages, stop, marker
        self._running: Counter[str] = Counter()
        self._lock = threading.RLock()
        self.ticks: Counter[str] = Counter()

    def install(self) -> None:
        """Wrap the functions of the stages, and watch rollouts and the names that files get."""
        for name, stage in self._stages.items():
            _wrap(stage.scope, functools.partial(self._scoped, name))
        _wrap("gaitopt.simulation.rollout:Simulator.run", self._counted)
        sys.addaudithook(self._watch)

    def _scoped(self, name: str, original: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(original, updated=())
        def scoped(*arguments: Any, **options: Any) -> Any:
            self._running[name] += 1
            try:
                if not self._stages[name].file:
                    self._tick(name, "call")
                return original(*arguments, **options)
            finally:
                self._running[name] -= 1

        return scoped

    def _counted(self, original: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(original)
        def counted(*arguments: Any, **options: Any) -> Any:
            self._happened("rollout")
            return original(*arguments, **options)

        return counted

    def _watch(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "os.rename":
            self._happened(Path(os.fsdecode(arguments[1])).name)

    def _happened(self, what: str) -> None:
        for name, stage in self._stages.items():
            if self._running[name] and not stage.entry and stage.file in ("", what):
                self._tick(name, what)

    def _tick(self, name: str, what: str) -> None:
        with self._lock:
            self.ticks[name] += 1
            stop = self._stop
            if stop is None or (name, self.ticks[name]) != (stop.stage, stop.tick):
                return
            self._stop = None
        with self._marker.open("w") as file:
            json.dump({"stage": name, "tick": stop.tick, "at": what}, file)
            file.flush()
            os.fsync(file.fileno())
        if stop.fill is None:
            os.kill(os.getpid(), stop.number)
        else:
            fill(stop.fill)


def fill(path: Path) -> None:
    """Write a file until its disk is full."""
    with path.open("ab", buffering=0) as file:
        for size in (1 << 20, 4096, 1):
            with suppress(OSError):
                while file.write(bytes(size)) == size:
                    pass


def _wrap(target: str, wrapper: Callable[[Callable[..., Any]], Callable[..., Any]]) -> None:
    module, _, path = target.partition(":")
    *owners, name = path.split(".")
    owner = functools.reduce(getattr, owners, import_module(module))
    wrapped: Any = wrapper(getattr(owner, name))
    if isinstance(inspect.getattr_static(owner, name), staticmethod):
        wrapped = staticmethod(wrapped)
    setattr(owner, name, wrapped)


def run(
    stages: Mapping[str, Stage], arguments: Sequence[object], notes: Path, stop: Stop | None = None
) -> Ended:
    """Run a command, with brief studies, in a process of its own; end it at a tick of a stage.

    Args:
        stages: the stages to watch.
        arguments: the command.
        notes: a new folder for what the process prints and marks, outside the run folder.
        stop: where to end it; nowhere by default.
    """
    notes.mkdir()
    context = multiprocessing.get_context("forkserver")  # a child has the modules, and no threads
    context.set_forkserver_preload(
        ["gaitopt.cli.app", *(stage.scope.partition(":")[0] for stage in (SEARCH | DIAGNOSIS).values())]
    )
    words = [str(argument) for argument in arguments]
    process = context.Process(target=_run, args=(dict(stages), words, notes, stop))
    process.start()
    process.join(PATIENCE_S)
    assert process.exitcode is not None, "it hangs"
    marker, ticks = (_json(notes / name) for name in ("marker", "ticks"))
    return Ended(process.exitcode, (notes / "out").read_text(), (notes / "err").read_text(), marker, ticks)


def _run(stages: dict[str, Stage], words: list[str], notes: Path, stop: Stop | None) -> None:
    for number, name in enumerate(("out", "err"), 1):
        os.dup2(os.open(notes / name, os.O_WRONLY | os.O_CREAT), number)
    from gaitopt.cli.app import main

    for module, name, value in brief_studies():
        setattr(module, name, value)
    stopper = _Stopper(stages, stop, notes / "marker")
    stopper.install()
    code = main(words)
    (notes / "ticks").write_text(json.dumps(stopper.ticks))
    sys.stdout.flush()
    sys.exit(code)


def _json(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text()) if path.exists() else {}


def result(folder: Path) -> dict[str, Any]:
    """Everything in a run folder, to the last bit; the clock's figures aside, the page is only there."""
    found: dict[str, Any] = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        name = path.relative_to(folder).as_posix()
        if name == "summary.json":
            found[name] = json.loads(path.read_text())
            del found[name]["wall_s"]
        else:
            found[name] = None if path.suffix in (".html", ".webp") else path.read_bytes()
    return found


def small_trials(folder: Path) -> Path:
    """Write a data set of the strider whose gap no effect alone explains: sets are fitted, too."""
    problem = load_problem(STRIDER)
    planted = {"servo_gain": {"scale": 0.5}, "ground_slope": {"angle_rad": 0.1}}
    columns = recording_of(rollout(problem, "stride", 2.0, planted), signals=("marker.y", "marker.z"))
    return dataset(folder, {"walk": ("stride", columns)}, starts_at_gait_time_s=0.0)


@dataclass(frozen=True)
class Work:
    """A command that fills a run folder, and how it goes on.

    Attributes:
        stages: its stages.
        begin: the command without its folder.
        folder: the run folder.
        notes: where the processes' notes go; beside the run folder by default.
    """

    stages: Mapping[str, Stage]
    begin: tuple[object, ...]
    folder: Path
    notes: Path | None = None

    @property
    def resume(self) -> list[object]:
        """The command that goes on."""
        if self.begin[0] == "diagnose":
            return [*self.begin, "--resume", self.folder]
        again = ("--full",) if "--full" in self.begin else ()
        return ["optimise", self.folder, "--resume", self.folder, *again, *self.begin[-3:]]

    @property
    def next(self) -> list[object]:
        """The command to give next: the first one again, where nothing is there to go on with."""
        made = "run.toml" if self.begin[0] == "optimise" else "simulated-*/[0-9a-f]*.npz"
        found = any(self.folder.glob(made)) or (self.folder / "diagnosis.json").exists()
        return self.resume if found else [*self.begin, "--out", self.folder]

    def run(self, stop: Stop | None = None) -> Ended:
        """Begin or go on, to the end or to a stop."""
        number, beside = 0, self.notes or self.folder.parent
        while (notes := beside / f"{self.folder.name}-notes-{number}").exists():
            number += 1
        return run(self.stages, self.next, notes, stop)


def search(folder: Path, full: bool = True, workers: int = 1) -> Work:
    """A small search on the strider."""
    options = ("--full",) if full else ()
    begin = ("optimise", STRIDER, "--budget", 24, "--seed", 2, *options, "--quiet", "--workers", workers)
    return Work(SEARCH, begin, folder)


def diagnosis(folder: Path, trials: Path, workers: int = 1) -> Work:
    """A small diagnosis on the strider."""
    effects = ("--effects", "pad_friction,ground_slope")
    return Work(DIAGNOSIS, ("diagnose", STRIDER, trials, *effects, "--quiet", "--workers", workers), folder)
