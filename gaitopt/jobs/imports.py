"""The job `import`: recordings of tracking programs and logs of robots to a data set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gaitopt.diagnose.record.defect import Defect
from gaitopt.diagnose.record.export import ImportOptions
from gaitopt.diagnose.record.importing import Imported, import_files
from gaitopt.jobs.inputs import check_positive
from gaitopt.problem.problem import Problem, load_problem


@dataclass(frozen=True)
class ImportRun:
    """A data set that was written.

    Attributes:
        folder: the data set.
        files: the files imported.
        recordings: the recordings in them, one or more in each.
    """

    folder: Path
    files: tuple[Path, ...]
    recordings: tuple[Imported, ...]

    @property
    def defects(self) -> list[Defect]:
        """Everything that is wrong with the recordings."""
        return [defect for motion in self.recordings for defect in motion.defects]

    def to_dict(self) -> dict[str, object]:
        """Return what `gaitopt import --json` prints."""
        trials = [
            {"name": motion.name, "program": motion.program, "signals": list(motion.signals)}
            | ({"commands": motion.channels} if motion.sent else {})
            for motion in self.recordings
        ]
        rows = [defect.to_dict() for defect in self.defects]
        return {"dataset": str(self.folder), "trials": trials, "defects": rows}


def import_recordings(
    files: Sequence[Path | str],
    gaits: Sequence[str] | str | None,
    out: Path | str,
    options: ImportOptions | None = None,
    problem: Problem | str | None = None,
) -> ImportRun:
    """Write a data set of exports of tracking programs and logs; nothing is written unless all can be read.

    Args:
        files: exports of Tracker, DeepLabCut, SLEAP or Kinovea, CSV files and JSON lines, each a trial; and
            LeRobot data sets, a trial an episode.
        gaits: what was commanded, where the files do not say it: one for all of these, or one for each. Each
            is a run folder, a gait file, an exported table, or the name of a gait of the problem.
        out: the new data set.
        options: what the files do not say themselves.
        problem: the problem that the gaits belong to, or its folder, file or name; without it the names of
            gaits are those of bundled problems.

    Raises:
        GaitoptError: the folder holds something, a file cannot be imported, or there is no such gait.
    """
    options = options or ImportOptions()
    check_positive("fps", options.fps)
    check_positive("scale-m-per-px", options.scale_m_per_px)
    paths = tuple(map(Path, files))
    named = [gaits] if isinstance(gaits, str) else gaits or ()
    known = load_problem(problem) if isinstance(problem, str) else problem
    imported = import_files(paths, named, Path(out), options, known)
    return ImportRun(Path(out), paths, tuple(imported))
