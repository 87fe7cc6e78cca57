"""Folders that commands make."""

from pathlib import Path

import pytest

from gaitopt.core.errors import GaitoptError, MachineError
from gaitopt.core.folders import check_new_or_empty, filled


def test_a_new_or_an_empty_folder_is_taken(tmp_path: Path) -> None:
    check_new_or_empty(None)
    check_new_or_empty(tmp_path / "new")
    check_new_or_empty(tmp_path)


def test_a_folder_with_files_and_a_file_are_refused_in_one_line(tmp_path: Path) -> None:
    notes = tmp_path / "notes"
    notes.write_text("mine")
    for path, what in ((tmp_path, "is not empty"), (notes, "is a file")):
        with pytest.raises(GaitoptError) as error:
            check_new_or_empty(path)
        assert str(error.value) == f"--out: {path} {what}; allowed: a new or an empty folder"


@pytest.mark.parametrize("existing", [False, True])
def test_a_folder_is_filled_or_left_as_it_was(tmp_path: Path, existing: bool) -> None:
    folder = tmp_path / "a" / "b"
    if existing:
        folder.mkdir(parents=True)

    def fill(error: BaseException | None) -> None:
        with filled(folder) as place:
            (place / "inside").mkdir()
            (place / "inside" / "one").write_text("1")
            (place / "two").write_text("2")
            assert place == folder or not folder.exists()
            if error is not None:
                raise error

    with pytest.raises(KeyboardInterrupt):
        fill(KeyboardInterrupt())
    assert folder.exists() == existing
    assert not existing or not list(folder.iterdir())
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["b"] * existing
    with pytest.raises(GaitoptError, match=r"b: cannot be written: No space left on device"):
        fill(OSError(28, "No space left on device"))
    fill(None)
    assert sorted(path.name for path in folder.iterdir()) == ["inside", "two"]
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["b"]


def test_an_error_says_the_name_that_the_user_knows(tmp_path: Path) -> None:
    folder = tmp_path / "new"
    with pytest.raises(MachineError) as error, filled(folder) as place:
        raise MachineError(f"{place / 'one'}: cannot be written: No space left on device")
    assert str(error.value) == f"{folder / 'one'}: cannot be written: No space left on device"
    assert not list(tmp_path.iterdir())
