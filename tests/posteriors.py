"""Posteriors that the tests share."""

from pathlib import Path

from gaitopt.runs.diagnosis_folder import DIAGNOSIS_FILE
from gaitopt.runs.folder import POSTERIOR_FILE

WEAK = "servo_gain.all,servo_trim.rear,contact_compliance.none\n" + "".join(
    f"{0.7 + 0.02 * index:.2f},{'' if index % 2 else 0.03},\n" for index in range(16)
)
"""Sixteen striders with weaker servos; half of them have a trim."""


def diagnosed(folder: Path, content: str = WEAK) -> Path:
    """Write what `--posterior` reads of the run folder of a diagnosis, and return the folder."""
    folder.mkdir()
    (folder / DIAGNOSIS_FILE).write_text("{}")
    (folder / POSTERIOR_FILE).write_text(content)
    return folder
