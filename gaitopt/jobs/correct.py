"""The job `correct`: a servo that was learnt on one robot, in the problem of another that uses it, too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import check_replaceable, found_inside, read_toml, write_text
from gaitopt.core.folders import check_new_or_empty, filled
from gaitopt.core.own_files import check_folder
from gaitopt.jobs.outputs import writing
from gaitopt.problem.model import assets_beside, carrying, nominal_mjcf
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.servo_target import LeftOut
from gaitopt.problem.servo_transfer import FigureChange, Transfer, carry_over
from gaitopt.runs.diagnosis_folder import CORRECTED_FILE, DIAGNOSIS_FILE
from gaitopt.runs.folder import MODEL_FILE, write_into


@dataclass(frozen=True)
class CorrectedServos:
    """A problem with servos that were learnt on another robot.

    Attributes:
        transfer: the problem, what it got, and what was left out.
        file: its problem file; None where nothing was written.
    """

    transfer: Transfer
    file: Path | None

    @property
    def problem(self) -> Problem:
        """The problem with the servos."""
        return self.transfer.problem

    @property
    def rows(self) -> Sequence[FigureChange]:
        """Every figure of every servo, before and after."""
        return self.transfer.rows

    @property
    def left_out(self) -> Sequence[LeftOut]:
        """What was not carried over, and why."""
        return self.transfer.left_out

    def to_dict(self) -> dict[str, object]:
        """Return what `gaitopt correct --json` prints."""
        return {
            "problem": self.problem.name,
            "file": None if self.file is None else str(self.file),
            "effects": {name: dict(values) for name, values in self.transfer.effects.items()},
            "parameters": dict(self.transfer.parameters),
            "rows": [row.to_dict() for row in self.rows],
            "left_out": [row.to_dict() for row in self.left_out],
        }


def correct_servos(
    problem: Problem,
    run: Path | str,
    *,
    channels: Mapping[str, str] | None = None,
    out: Path | str | None = None,
) -> CorrectedServos:
    """Write servos that were learnt on one robot into the problem of another that uses the same servos.

    The whole servo is carried over: its nominal figures with the effects learnt. Ratios such as
    ``servo_gain`` are converted to the other robot's own figures. Mounting, calibration and supply stay.

    Args:
        problem: the problem that uses the same servos.
        run: the run folder of a diagnosis, or any problem with effects.
        channels: for each channel of `problem` with such a servo, the channel of `run`; by default the
            channels of the same names, or all channels where `run` has one.
        out: the problem file to write. In another folder than the problem's, the model goes into a folder
            beside it that has its name.

    Raises:
        GaitoptError: there is no such run or channel, the servo cannot be carried over, nothing changes, or
            a file cannot be written.
    """
    place = None if out is None else _Place.of(Path(out), problem)
    with writing(problem, out):
        problem = carrying(problem)
        transfer = carry_over(problem, carrying(_learnt(run)), channels)
        if place is not None:
            check_replaceable(place.path)  # which may be what was read of the run
            place.write(transfer.problem)
    return CorrectedServos(transfer, None if place is None else place.path)


def _learnt(run: Path | str) -> Problem:
    """Return the corrected robot of a diagnosis, or any other problem."""
    folder = Path(run)
    found = found_inside(folder, CORRECTED_FILE)
    if found is not None:
        return load_problem(found)
    if (folder / DIAGNOSIS_FILE).is_file():
        raise GaitoptError(
            f"{folder}: no {CORRECTED_FILE}: the diagnosis found no robot that predicts better"
        )
    return load_problem(run)


@dataclass(frozen=True)
class _Place:
    """Where a problem file goes, and its model.

    Attributes:
        path: the problem file.
        folder: folder of its model; None where the problem file lies beside the model that is there.
        is_new: whether the folder is new or empty; else its model is replaced.
    """

    path: Path
    folder: Path | None
    is_new: bool = True

    @staticmethod
    def of(path: Path, problem: Problem) -> _Place:
        """Return the place of a problem file that is to be written.

        Raises:
            GaitoptError: there is no such folder, the model's folder is a link or holds something else, or it
                has no name.
        """
        check_replaceable(path)
        home = problem.source.parent
        if path.parent.resolve() == home.resolve() and problem.model_path.is_relative_to(home):
            return _Place(path, None)
        folder = path.with_suffix("")
        if not path.parent.is_dir():
            raise GaitoptError(f"{path}: cannot be written: No such folder")
        if folder == path:
            raise GaitoptError(f"--out: found {path}; allowed: a file with a suffix, such as {path}.toml")
        if folder.is_symlink():
            raise GaitoptError(f"{folder}: found a link; allowed: a folder for the model")
        if folder.is_dir():
            check_folder(folder)
        named = path.is_file() and read_toml(path).get("model") == f"{folder.name}/{MODEL_FILE}"
        own = named and folder.is_dir()
        if not own:
            check_new_or_empty(folder)
        return _Place(path, folder, not own)

    def write(self, problem: Problem) -> None:
        """Write the problem file, and before it the model; on an error a new folder is removed again.

        Raises:
            GaitoptError: a file cannot be written.
        """
        if self.folder is None:
            own = problem.model_path.relative_to(problem.source.parent)
            write_text(self.path, problem.to_toml(own.as_posix()))
            return
        with filled(self.folder) if self.is_new else nullcontext(self.folder) as folder:
            for name, data in assets_beside(problem).items():
                write_into(folder, name, data)
            write_into(folder, MODEL_FILE, nominal_mjcf(problem))
            write_text(self.path, problem.to_toml(f"{self.folder.name}/{MODEL_FILE}"))
