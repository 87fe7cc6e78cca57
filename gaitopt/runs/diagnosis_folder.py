"""The run folder of a diagnosis: made, locked, and read back when it is finished."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import read_json
from gaitopt.core.validation import validated
from gaitopt.runs.folder import filled_folder, held

DIAGNOSIS_FILE = "diagnosis.json"
"""The result, written before its page: it shows that the diagnosis is finished."""

CORRECTED_FILE = "corrected.toml"
"""The problem with the causes switched on, if any were found."""

NEXT_FILE = "next.toml"
"""The gait to measure next."""


class _Printed(BaseModel):
    """What is printed of a finished diagnosis."""

    model_config = ConfigDict(frozen=True)

    answer: str
    explanation: tuple[str, ...]


@dataclass(frozen=True)
class FinishedDiagnosis:
    """A diagnosis read from its file.

    Attributes:
        folder: its run folder.
        answer: the verdict in one sentence.
        explanation: sentence by sentence, what is known.
        content: all of ``diagnosis.json``.
    """

    folder: Path
    answer: str
    explanation: tuple[str, ...]
    content: dict[str, object]


def read_diagnosis(folder: Path) -> FinishedDiagnosis | None:
    """Return the finished diagnosis of a run folder; None where there is none yet.

    Raises:
        GaitoptError: its file was changed since, and what is printed of it is no longer there.
    """
    path = folder / DIAGNOSIS_FILE
    if not path.is_file():
        return None
    content = read_json(path)
    try:
        printed = validated(_Printed, content, path)
    except GaitoptError:
        raise GaitoptError(f"{path}: not the answer of a diagnosis: changed since?") from None
    return FinishedDiagnosis(folder, printed.answer, printed.explanation, content)


@contextmanager
def diagnosis_folder(out: Path | None, resumed: Path | None, name: str) -> Iterator[Path]:
    """Yield the run folder of a diagnosis, and keep every other run out; one that stays empty is removed.

    Args:
        out: the folder; a new one by default.
        resumed: the folder of an interrupted diagnosis to continue instead.
        name: the problem's name.

    Raises:
        GaitoptError: the folder holds something already, cannot be written, or another run works there.
    """
    place = filled_folder(out, f"{name}-diagnosis") if resumed is None else nullcontext(resumed)
    with place as folder, held(folder):
        yield folder
