"""The job `import`: recordings of tracking programs to a data set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gaitopt.diagnose.record.defect import Defect
from gaitopt.diagnose.record.export import ImportOptions
from gaitopt.diagnose.record.importing import Imported, import_files
from gaitopt.jobs.inputs import check_positive


@dataclass(frozen=True)
class ImportRun:
    """A data set that was written.

    Attributes:
        folder: the data set.
        files: the files imported.
        recordings: the motion in each of them.
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
            {"name": path.stem, "program": motion.program, "signals": list(motion.signals)}
            for path, motion in zip(self.files, self.recordings, strict=True)
        ]
        rows = [defect.to_dict() for defect in self.defects]
        return {"dataset": str(self.folder), "trials": trials, "defects": rows}


def import_recordings(
    files: Sequence[Path | str],
    gaits: Sequence[str] | str,
    out: Path | str,
    options: ImportOptions | None = None,
) -> ImportRun:
    """Write a data set of exports of tracking programs; nothing is written unless all can be read.

    Args:
        files: exports of Tracker, DeepLabCut, SLEAP or Kinovea, or CSV files, each a trial.
        gaits: what was commanded: one name or gait file for all, or one for each.
        out: the new data set.
        options: what the files do not say themselves.

    Raises:
        GaitoptError: the folder holds something, or a file cannot be imported.
    """
    options = options or ImportOptions()
    check_positive("fps", options.fps)
    check_positive("scale-m-per-px", options.scale_m_per_px)
    paths = tuple(map(Path, files))
    imported = import_files(paths, [gaits] if isinstance(gaits, str) else gaits, Path(out), options)
    return ImportRun(Path(out), paths, tuple(imported))
