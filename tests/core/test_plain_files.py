"""Only plain files are read, up to a size; only plain files are replaced, and never an input file."""

import os
import socket
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hostility import make_device, refused, within

from gaitopt.core import files
from gaitopt.core.files import (
    found_inside,
    noting_reads,
    read_bytes,
    read_json,
    read_text,
    read_toml,
    write_text,
)
from gaitopt.core.numbers import number, whole_number


@pytest.fixture(autouse=True)
def in_time() -> Iterator[None]:
    """A read that waits fails the test."""
    with within(20):
        yield


def odd_file(folder: Path, kind: str) -> Path:
    """A path at which there is no plain file."""
    path = folder / "odd.toml"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(os.path.relpath(path))
    elif kind == "device":
        make_device(path)
    elif kind == "link to a device":
        path.symlink_to(make_device(folder / "device"))
    elif kind == "link to a pipe":
        os.mkfifo(folder / "pipe")
        path.symlink_to("pipe")
    return path


ODD = ("pipe", "folder", "socket", "device", "link to a device", "link to a pipe")


@pytest.mark.parametrize("kind", ODD)
def test_what_is_no_plain_file_is_not_read(tmp_path: Path, kind: str) -> None:
    path = odd_file(tmp_path, kind)
    for read in (read_text, read_bytes, read_toml, read_json):
        said = refused(lambda read=read: read(path))  # type: ignore[misc]
        assert said.endswith(f"found a {kind.split()[-1]}; allowed: a plain file")


def test_a_pipe_that_takes_the_place_of_a_file_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = odd_file(tmp_path, "pipe")
    plain = tmp_path / "plain"
    plain.write_text("a")
    status = plain.stat()
    monkeypatch.setattr(Path, "stat", lambda self, **_: status)
    assert refused(lambda: read_text(path)).endswith("found a pipe; allowed: a plain file")


def test_a_file_without_end_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "large"
    with path.open("wb") as file:
        file.truncate(2**40)
    for read, largest in ((read_text, 256), (read_bytes, 256), (read_toml, 4), (read_json, 16)):
        said = refused(lambda read=read: read(path))  # type: ignore[misc]
        assert said.endswith(f"found 1.049e+06 MiB; allowed: at most {largest} MiB")
    path.write_bytes(b"abc")
    assert "allowed" in refused(lambda: read_bytes(path, 2))
    assert read_bytes(path, 3) == b"abc"


@pytest.mark.parametrize("kind", [*ODD, "a link to a file", "a link to nothing"])
def test_what_is_no_plain_file_is_not_replaced(tmp_path: Path, kind: str) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    path = tmp_path / "odd.toml"
    if kind.startswith("a link"):
        path.symlink_to("victim" if kind == "a link to a file" else "nothing")
    else:
        odd_file(tmp_path, kind)
    before = path.lstat()
    said = refused(lambda: write_text(path, "new"))
    assert said.endswith("allowed: a new file, or a plain one to replace")
    assert (path.lstat().st_ino, path.lstat().st_mode) == (before.st_ino, before.st_mode)
    assert victim.read_text() == "precious"
    assert not [name for name in tmp_path.iterdir() if name.name.startswith(".")]


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o755, 0o664])
def test_a_file_that_is_replaced_keeps_its_mode(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "file"
    path.write_text("old")
    path.chmod(mode)
    write_text(path, "new")
    assert (path.read_text(), stat.S_IMODE(path.stat().st_mode)) == ("new", mode)
    write_text(tmp_path / "another", "new")
    assert stat.S_IMODE((tmp_path / "another").stat().st_mode) == 0o644


def test_another_name_of_a_replaced_file_keeps_its_content(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("old")
    (tmp_path / "file").hardlink_to(tmp_path / "precious")
    write_text(tmp_path / "file", "new")
    assert (tmp_path / "precious").read_text() == "old"


@contextmanager
def as_nobody(folder: Path) -> Iterator[None]:
    """Give up the rights of root, if the tests run as root."""
    users = os.getresuid()
    if users[0] == 0:
        os.chown(folder, 65534, -1)
        os.setresuid(65534, 65534, 0)
    try:
        yield
    finally:
        os.setresuid(*users)


def test_a_file_without_write_permission_is_not_replaced() -> None:
    with TemporaryDirectory() as name, as_nobody(Path(name)):
        path = Path(name) / "file"
        path.write_text("old")
        path.chmod(0o444)
        assert "Permission denied" in refused(lambda: write_text(path, "new"))
        assert path.read_text() == "old"


def test_what_was_read_is_not_replaced_under_any_name(tmp_path: Path) -> None:
    path, other = tmp_path / "file", tmp_path / "other"
    path.write_text("old")
    other.hardlink_to(path)
    (tmp_path / "link").symlink_to(path)
    with noting_reads():
        assert read_text(tmp_path / "link") == "old"
        for name in (path, other):
            assert "the command reads it" in refused(lambda name=name: write_text(name, "new"))  # type: ignore[misc]
        with noting_reads():
            assert "the command reads it" in refused(lambda: write_text(path, "new"))
        write_text(tmp_path / "new", "new")
    assert path.read_text() == "old"
    write_text(path, "new")
    assert path.read_text() == "new"
    assert files._read_files.get() is None


def test_a_file_that_becomes_a_link_while_it_is_made_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "file"

    def swap(temporary: Path) -> None:
        temporary.write_text("new")
        path.symlink_to("victim")

    assert "found a link" in refused(lambda: files.write_with(path, swap))
    assert path.is_symlink()


def test_a_file_found_in_a_folder_is_no_link_out_of_it(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    assert found_inside(folder, "x") is None
    (folder / "y").write_text("")
    (folder / "x").symlink_to("y")
    assert found_inside(folder, "x") == folder / "x"
    (tmp_path / "z").write_text("")
    (folder / "z").symlink_to("../z")
    assert "a link out of its folder" in refused(lambda: found_inside(folder, "z"))


@pytest.mark.parametrize(
    "text", ["1_000", "١٢", "１２", "²", "1e1_0", "0x10", "1,0", "", "- 1", "1 0", "९", "1d3"]
)
def test_what_is_not_written_as_a_number_is_none(text: str) -> None:
    for read in (number, whole_number):
        with pytest.raises(ValueError, match="number"):
            read(text)


@pytest.mark.parametrize("text", ["1", " -1.5 ", "+.5", "5.", "1e-3", "1E+3", "inf", "-Infinity", "nan"])
def test_a_number_is_read_as_python_reads_it(text: str) -> None:
    assert repr(number(text)) == repr(float(text))
    assert whole_number(" -12 ") == -12


@pytest.mark.parametrize("part", ["a", "1", '"a b"', "'='", '"\\""', "-"])
@pytest.mark.parametrize("line", ["{} = 1", "[{}]", "[[{}]]", "x = {{ {} = 1 }}", "x = [{{ {} = 1 }}]"])
def test_a_key_with_dots_without_end_is_one_line(tmp_path: Path, line: str, part: str) -> None:
    """Python's reader takes minutes for each of them."""
    path = tmp_path / "file.toml"
    for dot in (".", " . "):
        path.write_text("y = 1.0\n" + line.format(dot.join(100_000 * [part])))
        with within(5):
            assert "more than 64 parts" in refused(lambda: read_toml(path))
    path.write_text(line.format(".".join(20 * [part])))
    assert read_toml(path)


@pytest.mark.parametrize("text", ["a" * 10**6, "a." * 63 * 10**4, '"' * 10**6, "a. " * 10**5, "'a'" * 10**5])
def test_what_looks_like_a_long_key_is_searched_in_time(tmp_path: Path, text: str) -> None:
    (tmp_path / "file.toml").write_text(text)
    with within(10):
        refused(lambda: read_toml(tmp_path / "file.toml"))
