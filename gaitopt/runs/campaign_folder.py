"""The folder of a campaign: its problem, what was told, steps and films. Each file is whole or absent.

``told/NN`` is one telling: a data set and ``told.json``. ``steps/NN`` is what was thought after NN tellings,
with its diagnosis and its searches; ``step.json`` is its result. ``films/NN`` is a film: its gait, its player
and ``proposal.json``, which is written last.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tomli_w
from pydantic import Field

from gaitopt.campaign.records import Proposal, Record, Step
from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import csv_text, read_json, read_text, read_toml, write_text
from gaitopt.core.json import to_json
from gaitopt.core.own_files import check_folder
from gaitopt.core.validation import validated
from gaitopt.diagnose.record.dataset import DATASET_FILE, load_dataset
from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.gait import Gait, read_gait, write_gait
from gaitopt.problem.lookup import PROBLEM_FILE
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.robot.signals import is_position, measured_column_of
from gaitopt.runs.folder import (
    MODEL_FILE,
    check_free,
    filled_folder,
    held,
    write_into,
    write_problem,
)

REQUEST_FILE = "campaign.toml"
"""The request; written after the problem, so that a folder with it is a campaign."""

PAGE_FILE = "campaign.html"
STEP_FILE = "step.json"
PROPOSAL_FILE = "proposal.json"
TOLD_FILE = "told.json"

FINISHED_FILE = "finished"
"""The last file of a step; a step without it goes on."""

RIVALS_FILE = "rivals.json"


class Request(Record):
    """The request of a campaign.

    Attributes:
        seed: seed of all randomness.
        budget: gaits of the searches of each step.
        player: format of the players.
        quantile: share of the posterior's robots that may be slower than the speed of a gait that is judged;
            None for as the problem file says.
    """

    seed: int = Field(default=1, ge=0)
    budget: int = Field(default=400, ge=1, le=10**6)
    player: str = "micropython"
    quantile: float | None = Field(default=None, ge=0.0, le=0.5)


class Told(Record):
    """What was told at once.

    Attributes:
        films: number of the film of each trial, by the trial's name.
        digests: of each trial's samples.
    """

    films: dict[str, int]
    digests: dict[str, str]


class Rival(Record):
    """Another method on the same robot.

    Attributes:
        name: the method.
        measured_speeds_m_s: what its films measured, in order, m/s.
        best: index of the film of the gait that it recommends.
    """

    name: str
    measured_speeds_m_s: tuple[float, ...]
    best: int


@dataclass(frozen=True)
class CampaignFolder:
    """The folder of a campaign.

    Attributes:
        path: the folder.
        problem: the nominal robot.
        request: the request.
    """

    path: Path
    problem: Problem
    request: Request

    @staticmethod
    def create(path: Path, problem: Problem, request: Request) -> CampaignFolder:
        """Make the folder of a campaign, or take that of the same one again.

        Raises:
            GaitoptError: the folder holds something else, or cannot be written.
        """
        if (path / REQUEST_FILE).is_file():
            folder = CampaignFolder.open(path)
            same = path / PROBLEM_FILE, path / MODEL_FILE
            asked = [problem.to_toml(MODEL_FILE), nominal_mjcf(problem)]
            if folder.request != request or [read_text(file) for file in same] != asked:
                raise GaitoptError(f"--out: {path} already holds another campaign; choose another folder")
            return folder
        check_free(path)
        with filled_folder(path, problem.name), held(path):
            write_problem(path, problem, nominal_mjcf(problem))
            content = {key: value for key, value in request.to_dict().items() if value is not None}
            write_into(path, REQUEST_FILE, tomli_w.dumps(content))
        return CampaignFolder.open(path)

    @staticmethod
    def open(path: Path) -> CampaignFolder:
        """Open the folder of a campaign.

        Raises:
            GaitoptError: it is none.
        """
        file = path / REQUEST_FILE
        if not file.is_file():
            raise GaitoptError(f"{path}: not the folder of a campaign (no {REQUEST_FILE})")
        check_folder(path)
        request = validated(Request, read_toml(file), file)
        return CampaignFolder(path, load_problem(path), request)

    # --- tellings ---------------------------------------------------------------------------------

    def telling_folder(self, number: int) -> Path:
        """Return the folder of a telling, from 1."""
        return self.path / "told" / f"{number:02d}"

    @property
    def tellings(self) -> int:
        """How many times something was told."""
        return len(numbered(self.path / "told"))

    def told(self, number: int) -> Told:
        """Return what was told, from 1."""
        path = self.telling_folder(number) / TOLD_FILE
        return validated(Told, read_json(path), path)

    def trials(self, until: int, known: Sequence[str]) -> list[tuple[int, Trial]]:
        """Return the films of the first tellings: each film's number, and its recording.

        Args:
            until: how many tellings.
            known: signals that the robot has.
        """
        found = []
        for number in range(1, until + 1):
            told = self.told(number)
            dataset = load_dataset(self.telling_folder(number), self.problem, known)
            found += [(told.films[trial.name], trial) for trial in dataset.trials]
        return found

    def tell(self, recordings: Sequence[tuple[int, Trial]], known: Sequence[str]) -> None:
        """Write a telling, all of it or nothing; the trials get names of their own.

        Args:
            recordings: number of the film, and the recording, of each trial.
            known: signals that the robot has.

        Raises:
            GaitoptError: it could not be read again: a recording that came from Python is no valid one.
        """
        number = self.tellings + 1
        place = self.telling_folder(number)
        half = place.with_name(f".{place.name}")
        shutil.rmtree(half, ignore_errors=True)
        half.mkdir(parents=True)
        counts: dict[int, int] = {}
        for film, _ in (pair for n in range(1, number) for pair in self._films_of(n)):
            counts[film] = counts.get(film, 0) + 1
        entries, films, digests = [], {}, {}
        for film, trial in recordings:
            counts[film] = counts.get(film, 0) + 1
            name = f"film-{film}-{counts[film]}"
            films[name], digests[name] = film, digest_of(trial)
            entries.append(_write_trial(half, name, trial))
        write_text(half / DATASET_FILE, tomli_w.dumps({"trial": entries}))
        write_text(half / TOLD_FILE, to_json(Told(films=films, digests=digests).to_dict()))
        try:
            load_dataset(half, self.problem, known)
        except GaitoptError:
            shutil.rmtree(half)
            raise
        half.rename(place)

    def _films_of(self, number: int) -> list[tuple[int, str]]:
        return [(film, name) for name, film in self.told(number).films.items()]

    @property
    def digests(self) -> dict[str, int]:
        """The film of every recording that was told, by the digest of its samples."""
        tellings = [self.told(number) for number in range(1, self.tellings + 1)]
        return {digest: one.films[name] for one in tellings for name, digest in one.digests.items()}

    # --- steps and films --------------------------------------------------------------------------

    def step_folder(self, number: int) -> Path:
        """Return the folder of the step after so many tellings."""
        return self.path / "steps" / f"{number:02d}"

    def step(self, number: int) -> Step | None:
        """Return the result of a step; None where it is not finished."""
        path = self.step_folder(number) / STEP_FILE
        return validated(Step, read_json(path), path) if path.is_file() else None

    def write_step(self, number: int, step: Step) -> None:
        """Write the result of a step."""
        write_into(self.step_folder(number), STEP_FILE, to_json(step.to_dict()))

    def is_finished(self, number: int) -> bool:
        """Return whether all of a step was done: its result, its film, and the page."""
        return (self.step_folder(number) / FINISHED_FILE).is_file()

    @property
    def last_finished(self) -> int | None:
        """The last step of which all was done; None before the first."""
        return next((number for number in range(self.tellings, -1, -1) if self.is_finished(number)), None)

    def finish(self, number: int) -> None:
        """Write that all of a step was done."""
        write_into(self.step_folder(number), FINISHED_FILE, "")

    def film_folder(self, film: int) -> Path:
        """Return the folder of a film."""
        return self.path / "films" / f"{film:02d}"

    def proposal(self, film: int) -> Proposal | None:
        """Return a film as it was proposed; None where it was not."""
        path = self.film_folder(film) / PROPOSAL_FILE
        return validated(Proposal, read_json(path), path) if path.is_file() else None

    @property
    def proposals(self) -> list[Proposal]:
        """The films that were proposed, in order."""
        numbers = numbered(self.path / "films")
        return [one for one in map(self.proposal, numbers) if one is not None]

    @property
    def gaits(self) -> dict[int, Gait]:
        """The gait of each film that was proposed, by its number."""
        return {
            one.film: replace(self._gait(self.path / one.gait), name=f"film-{one.film}")
            for one in self.proposals
        }

    def _gait(self, path: Path) -> Gait:
        return self.problem.check_gait(read_gait(path), path)

    def propose(self, proposal: Proposal) -> None:
        """Write the proposal of a film, after its gait and its player."""
        write_into(self.film_folder(proposal.film), PROPOSAL_FILE, to_json(proposal.to_dict()))

    def write_gait(self, film: int, gait: Gait) -> None:
        """Write the gait of a film."""
        self.film_folder(film).mkdir(parents=True, exist_ok=True)
        write_gait(self.film_folder(film) / "gait.toml", gait)

    # --- rivals -----------------------------------------------------------------------------------

    @property
    def rivals(self) -> list[Rival]:
        """What other methods reached on the same robot; none by default."""
        path = self.path / RIVALS_FILE
        rows = read_json(path)["rivals"] if path.is_file() else []
        return [validated(Rival, row, path) for row in rows]

    def write_rivals(self, rivals: Sequence[Rival]) -> None:
        """Write what other methods reached."""
        write_into(self.path, RIVALS_FILE, to_json({"rivals": [one.to_dict() for one in rivals]}))


def numbered(folder: Path) -> list[int]:
    """Return the numbers of the numbered folders in a folder, in order; others are not the campaign's."""
    names = [path.name for path in folder.glob("[0-9]*") if path.is_dir()]
    return sorted(int(name) for name in names if name.isdecimal() and name == f"{int(name):02d}")


def digest_of(trial: Trial) -> str:
    """Return a digest of a recording's samples, whatever gait it is said to be of."""
    digest = hashlib.sha256(np.ascontiguousarray(trial.time - trial.time[0]).tobytes())
    for name in sorted(trial.signals):
        digest.update(name.encode() + np.ascontiguousarray(trial.signals[name]).tobytes())
    return digest.hexdigest()[:16]


def _write_trial(folder: Path, name: str, trial: Trial) -> Mapping[str, object]:
    """Write a trial of a gait and its gait; return its entry in the data set's file."""
    columns = {signal: measured_column_of(signal) for signal in trial.signals}
    if len(set(columns.values())) < len(columns):  # a joint called as the angle of a site
        columns = {signal: f"{signal}_{'m' if is_position(signal) else 'rad'}" for signal in columns}
    series = {columns[signal]: values for signal, values in trial.signals.items()}
    write_text(folder / f"{name}.csv", csv_text({"t_s": trial.time} | series, nan=""))
    assert isinstance(trial.drive, Gait)
    write_gait(folder / f"{name}.toml", trial.drive)
    known = {
        "starts_at_gait_time_s": trial.starts_at_s,
        "noise_m": trial.noise_m,
        "fps": trial.fps,
    }
    said = {key: value for key, value in known.items() if value is not None}
    return {"name": name, "gait": f"{name}.toml", "file": f"{name}.csv", "signals": columns} | said
