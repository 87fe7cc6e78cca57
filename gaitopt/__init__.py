"""gaitopt: optimal gaits for small robots that crawl, walk or swim, from a MuJoCo model to the servos.

    from gaitopt import Problem, compare, diagnose, optimise, simulate

The names listed here are the public face: they stay here when modules move inside the package. Each
name is loaded on first use, so that ``import gaitopt`` takes no time.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gaitopt.core.errors import GaitoptError
    from gaitopt.core.progress import OnProgress, Progress
    from gaitopt.diagnose.diagnosis import Diagnosis
    from gaitopt.diagnose.record.commands import read_commands
    from gaitopt.diagnose.record.trial import Trial
    from gaitopt.diagnose.words import answer
    from gaitopt.export.handover import Choices, Exported
    from gaitopt.gait.drive import Drive
    from gaitopt.gait.gait import Channel, Gait, read_gait, write_gait
    from gaitopt.gait.logged import LoggedCommands
    from gaitopt.jobs.blind import MadeCases, blind_make, blind_score
    from gaitopt.jobs.campaign import Campaign
    from gaitopt.jobs.check import audit, check
    from gaitopt.jobs.command import CommandTable, command
    from gaitopt.jobs.compare import compare
    from gaitopt.jobs.correct import CorrectedServos, correct_servos
    from gaitopt.jobs.diagnose import DiagnosisRun, diagnose
    from gaitopt.jobs.draft import NewProblem, draft_problem
    from gaitopt.jobs.effects import list_effects
    from gaitopt.jobs.export import export
    from gaitopt.jobs.film import FilmOptions, film
    from gaitopt.jobs.imports import ImportRun, import_recordings
    from gaitopt.jobs.model import model
    from gaitopt.jobs.optimise import OptimiseRun, optimise
    from gaitopt.jobs.outputs import NUMBERED, Stopped
    from gaitopt.jobs.plan import plan
    from gaitopt.jobs.runs import list_runs
    from gaitopt.jobs.simulate import Rollout, simulate
    from gaitopt.jobs.sweep import SweepRun, sweep
    from gaitopt.jobs.tags import TagSheets, tags
    from gaitopt.jobs.track import TrackOptions, TrackRun, track
    from gaitopt.jobs.watch import watch
    from gaitopt.optimise.run import Optimised
    from gaitopt.plan.plan import Plan
    from gaitopt.problem.problem import Problem, load_problem
    from gaitopt.robot.trajectory import Trajectory
    from gaitopt.robot.warnings import silence_warnings
    from gaitopt.runs.listing import ListedRun
    from gaitopt.simulation.audit.finding import Finding
    from gaitopt.simulation.metrics import Metrics

__all__ = [
    "NUMBERED",
    "Campaign",
    "Channel",
    "Choices",
    "CommandTable",
    "CorrectedServos",
    "Diagnosis",
    "DiagnosisRun",
    "Drive",
    "Exported",
    "FilmOptions",
    "Finding",
    "Gait",
    "GaitoptError",
    "ImportRun",
    "ListedRun",
    "LoggedCommands",
    "MadeCases",
    "Metrics",
    "NewProblem",
    "OnProgress",
    "OptimiseRun",
    "Optimised",
    "Plan",
    "Problem",
    "Progress",
    "Rollout",
    "Stopped",
    "SweepRun",
    "TagSheets",
    "TrackOptions",
    "TrackRun",
    "Trajectory",
    "Trial",
    "answer",
    "audit",
    "blind_make",
    "blind_score",
    "check",
    "command",
    "compare",
    "correct_servos",
    "diagnose",
    "draft_problem",
    "export",
    "film",
    "import_recordings",
    "list_effects",
    "list_runs",
    "load_problem",
    "model",
    "optimise",
    "plan",
    "read_commands",
    "read_gait",
    "silence_warnings",
    "simulate",
    "sweep",
    "tags",
    "track",
    "watch",
    "write_gait",
]

_HOMES = {
    "gaitopt.core.errors": ("GaitoptError",),
    "gaitopt.core.progress": (
        "OnProgress",
        "Progress",
    ),
    "gaitopt.diagnose.diagnosis": ("Diagnosis",),
    "gaitopt.diagnose.record.commands": ("read_commands",),
    "gaitopt.diagnose.record.trial": ("Trial",),
    "gaitopt.diagnose.words": ("answer",),
    "gaitopt.export.handover": (
        "Choices",
        "Exported",
    ),
    "gaitopt.gait.drive": ("Drive",),
    "gaitopt.gait.gait": (
        "Channel",
        "Gait",
        "read_gait",
        "write_gait",
    ),
    "gaitopt.gait.logged": ("LoggedCommands",),
    "gaitopt.jobs.blind": (
        "MadeCases",
        "blind_make",
        "blind_score",
    ),
    "gaitopt.jobs.campaign": ("Campaign",),
    "gaitopt.jobs.check": (
        "audit",
        "check",
    ),
    "gaitopt.jobs.command": (
        "CommandTable",
        "command",
    ),
    "gaitopt.jobs.compare": ("compare",),
    "gaitopt.jobs.correct": (
        "CorrectedServos",
        "correct_servos",
    ),
    "gaitopt.jobs.diagnose": (
        "DiagnosisRun",
        "diagnose",
    ),
    "gaitopt.jobs.draft": (
        "NewProblem",
        "draft_problem",
    ),
    "gaitopt.jobs.effects": ("list_effects",),
    "gaitopt.jobs.export": ("export",),
    "gaitopt.jobs.film": (
        "FilmOptions",
        "film",
    ),
    "gaitopt.jobs.imports": (
        "ImportRun",
        "import_recordings",
    ),
    "gaitopt.jobs.model": ("model",),
    "gaitopt.jobs.optimise": (
        "OptimiseRun",
        "optimise",
    ),
    "gaitopt.jobs.outputs": (
        "NUMBERED",
        "Stopped",
    ),
    "gaitopt.jobs.plan": ("plan",),
    "gaitopt.jobs.runs": ("list_runs",),
    "gaitopt.jobs.simulate": (
        "Rollout",
        "simulate",
    ),
    "gaitopt.jobs.sweep": (
        "SweepRun",
        "sweep",
    ),
    "gaitopt.jobs.tags": (
        "TagSheets",
        "tags",
    ),
    "gaitopt.jobs.track": (
        "TrackOptions",
        "TrackRun",
        "track",
    ),
    "gaitopt.jobs.watch": ("watch",),
    "gaitopt.optimise.run": ("Optimised",),
    "gaitopt.plan.plan": ("Plan",),
    "gaitopt.problem.problem": (
        "Problem",
        "load_problem",
    ),
    "gaitopt.robot.trajectory": ("Trajectory",),
    "gaitopt.robot.warnings": ("silence_warnings",),
    "gaitopt.runs.listing": ("ListedRun",),
    "gaitopt.simulation.audit.finding": ("Finding",),
    "gaitopt.simulation.metrics": ("Metrics",),
}
"""Where the names of the public face are defined."""

_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}


class _Face(ModuleType):
    """This module. Jobs such as `optimise` keep their names, though packages inside have the same ones."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOME_OF and isinstance(value, ModuleType)):  # which an import inside would set
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Face


def __getattr__(name: str) -> object:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
