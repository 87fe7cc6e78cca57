"""Run folders as a list: what each one is, how far it came, and its speed."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from gaitopt.core.errors import GaitoptError, found
from gaitopt.core.files import read_json, read_toml
from gaitopt.core.own_files import check_own
from gaitopt.problem.lookup import PROBLEM_FILE
from gaitopt.runs import campaign_folder
from gaitopt.runs.diagnosis_folder import DIAGNOSIS_FILE, read_diagnosis
from gaitopt.runs.folder import JOURNAL_FILE, PAGE_FILE, REQUEST_FILE, RUNS
from gaitopt.runs.lock import is_held
from gaitopt.runs.run_folder import SUMMARY_FILE
from gaitopt.runs.summary import Summary

FINISHED, RUNNING, INTERRUPTED = "finished", "running", "interrupted"
WAITING, UNREADABLE = "waiting for a film", "unreadable"

SEARCH, DIAGNOSIS, CAMPAIGN = "optimise", "diagnose", "campaign"

_MOST_FOLDERS = 10_000
"""Most entries of a folder that are looked at."""


@dataclass(frozen=True)
class ListedRun:
    """One run folder.

    Attributes:
        folder: the folder.
        kind: the command that made it: ``optimise``, ``diagnose`` or ``campaign``.
        problem: name of the problem; empty where it is unknown.
        state: one of the words above.
        changed: when its last result was written.
        note: what cannot be read; empty where all can.
        summary: the result of a finished search.
    """

    folder: Path
    kind: str
    problem: str
    state: str
    changed: datetime
    note: str = ""
    summary: Summary | None = None

    @property
    def page(self) -> Path | None:
        """Its page, where it has one."""
        name = campaign_folder.PAGE_FILE if self.kind == CAMPAIGN else PAGE_FILE
        return self.folder / name if (self.folder / name).is_file() else None

    def to_dict(self) -> dict[str, object]:
        """Return a row of ``gaitopt runs --json``."""
        best = None if self.summary is None else self.summary.best
        return {
            "folder": str(self.folder),
            "command": self.kind,
            "problem": self.problem,
            "state": self.state,
            "changed": self.changed.isoformat(timespec="seconds"),
            "speed_m_s": None if best is None else best.speed_m_s,
            "speed_ci90_m_s": None if best is None else list(best.speed_ci90_m_s),
            "constraints_met": None if best is None else best.constraints_met,
            "evaluations": None if self.summary is None else self.summary.evaluations,
            "seed": None if self.summary is None else self.summary.seed,
            "note": self.note,
        }


def list_runs(folders: Iterable[Path] = ()) -> list[ListedRun]:
    """Return the runs in some folders, the latest last.

    Args:
        folders: run folders, or folders that hold some; by default the current one and ``results/runs``.

    Raises:
        GaitoptError: a folder that is named is none, or cannot be read.
    """
    named = list(folders)
    rows: dict[Path, ListedRun] = {}
    for folder in named or [Path(), RUNS]:
        if named and not folder.is_dir():
            raise GaitoptError(f"{folder}: no such folder")
        for path in [folder, *_inside(folder)]:
            if path.resolve() not in rows and (kind := _kind(path)):
                rows[path.resolve()] = _listed(path, kind)
    return sorted(rows.values(), key=lambda row: (row.changed, str(row.folder)))


def _inside(folder: Path) -> Iterator[Path]:
    """Yield the folders in a folder, no links; none where there is no such folder.

    Raises:
        GaitoptError: it cannot be read, or holds too much.
    """
    try:
        with os.scandir(folder) as entries:
            for number, entry in enumerate(entries):
                if number == _MOST_FOLDERS:
                    raise GaitoptError(f"{folder}: found more than {_MOST_FOLDERS} entries; allowed: fewer")
                if entry.is_dir(follow_symlinks=False):
                    yield folder / entry.name
    except FileNotFoundError:
        return
    except OSError as error:
        raise GaitoptError(f"{folder}: cannot be read: {error.strerror}") from None


def _kind(path: Path) -> str:
    """Return which command made a run folder; an empty text for any other folder."""
    files = {
        REQUEST_FILE: SEARCH,
        campaign_folder.REQUEST_FILE: CAMPAIGN,
        DIAGNOSIS_FILE: DIAGNOSIS,
    }
    return next((kind for name, kind in files.items() if (path / name).is_file()), "")


def _listed(path: Path, kind: str) -> ListedRun:
    last = next(path / name for name in _LATEST[kind] if (path / name).is_file())
    changed = datetime.fromtimestamp(last.stat().st_mtime)
    try:
        summary = _summary(path) if kind == SEARCH else None
        problem = _problem(path, kind) if summary is None else summary.problem
        return ListedRun(path, kind, problem, _state(path, kind, summary), changed, summary=summary)
    except GaitoptError as error:
        return ListedRun(path, kind, "", UNREADABLE, changed, str(error))


_LATEST = {
    SEARCH: (SUMMARY_FILE, JOURNAL_FILE, REQUEST_FILE),
    DIAGNOSIS: (DIAGNOSIS_FILE,),
    CAMPAIGN: (campaign_folder.PAGE_FILE, campaign_folder.REQUEST_FILE),
}
"""The files that say when the last result was written; the first that is there counts."""


def _summary(path: Path) -> Summary | None:
    return Summary.read(path / SUMMARY_FILE) if check_own(path / SUMMARY_FILE) else None


def _state(path: Path, kind: str, summary: Summary | None) -> str:
    if is_held(path):
        return RUNNING
    if kind == CAMPAIGN:
        return _campaign_state(path)
    return FINISHED if kind == DIAGNOSIS or summary is not None else INTERRUPTED


def _campaign_state(campaign: Path) -> str:
    """Return whether the last step of a campaign was interrupted, or says that no film is worth making."""
    step = campaign / "steps" / f"{len(campaign_folder.numbered(campaign / 'told')):02d}"
    if not check_own(step / campaign_folder.FINISHED_FILE):
        return INTERRUPTED
    content = read_json(step / campaign_folder.STEP_FILE)
    return FINISHED if isinstance(content, dict) and content.get("done") is True else WAITING


def _problem(path: Path, kind: str) -> str:
    """Return the name of a run's problem, as its files say it."""
    if kind == DIAGNOSIS:
        diagnosis = read_diagnosis(path)
        return "" if diagnosis is None else str(diagnosis.content.get("problem", ""))
    file = path / PROBLEM_FILE
    name = read_toml(file).get("name", "") if check_own(file) else ""
    if not isinstance(name, str):
        raise GaitoptError(f"{file}: name: found {found(name)}; allowed: a text")
    return name
