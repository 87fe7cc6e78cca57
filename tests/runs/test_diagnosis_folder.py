"""The run folder of a diagnosis: an empty one is removed, and a finished one is read back."""

from pathlib import Path

import pytest

from gaitopt.core.errors import GaitoptError
from gaitopt.runs.diagnosis_folder import DIAGNOSIS_FILE, diagnosis_folder, read_diagnosis


def test_a_folder_that_stays_empty_is_removed(tmp_path: Path) -> None:
    with diagnosis_folder(tmp_path / "out", None, "robot") as folder:
        assert folder.is_dir()
    assert not (tmp_path / "out").exists()


def test_one_run_at_a_time(tmp_path: Path) -> None:
    with diagnosis_folder(tmp_path / "out", None, "robot") as folder:
        with pytest.raises(GaitoptError, match="another run is working"), diagnosis_folder(None, folder, ""):
            pass
        (folder / "kept.txt").write_text("kept")
    assert [path.name for path in folder.iterdir()] == ["kept.txt"]


def test_a_finished_diagnosis_is_read_back(tmp_path: Path) -> None:
    assert read_diagnosis(tmp_path) is None
    (tmp_path / DIAGNOSIS_FILE).write_text('{"answer": "No gap.", "explanation": ["a", "b"], "seed": 1}')
    finished = read_diagnosis(tmp_path)
    assert finished is not None
    assert (finished.answer, finished.explanation) == ("No gap.", ("a", "b"))
    assert finished.content["seed"] == 1
    (tmp_path / DIAGNOSIS_FILE).write_text('{"answer": "No gap."}')
    with pytest.raises(GaitoptError, match=r"diagnosis.json: not the answer of a diagnosis"):
        read_diagnosis(tmp_path)
