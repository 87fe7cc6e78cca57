"""The job `tags`: sheets of tags to print."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gaitopt.core.errors import GaitoptError, bad_value, found
from gaitopt.core.files import check_replaceable, write_with
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem
from gaitopt.problem.tags import TAG_SIZE_MM, TAG_SIZES_MM, Tag, check_tag_number

if TYPE_CHECKING:
    from PIL.Image import Image

_MOST = 200
"""Most tags that are printed at once."""


@dataclass(frozen=True)
class TagSheets:
    """A PDF of tags.

    Attributes:
        path: the file.
        tags: edge of each tag to cut out by its number, mm.
        pages: number of pages; the last one is the floor sheet.
        note: why there is no picture of where the tags go, if there is none.
    """

    path: Path
    tags: dict[int, float]
    pages: int
    note: str = ""

    def to_dict(self) -> dict[str, object]:
        """Return what `gaitopt tags --json` prints."""
        rows = [{"tag": number, "size_mm": size} for number, size in self.tags.items()]
        return {"file": str(self.path), "rows": rows, "pages": self.pages, "note": self.note}


def tags(
    path: Path | str,
    *,
    ids: str | None = None,
    size_mm: float | None = None,
    paper: str = "a4",
    problem: Problem | None = None,
) -> TagSheets:
    """Write a PDF of tags to cut out, a picture of where they go, and the floor sheet.

    Args:
        path: where to; a file that ends in ``.pdf``.
        ids: numbers of the tags, such as ``0-7`` or ``0,1,4-6``; the problem's by default, else 0 to 7.
        size_mm: edge of a tag's black square, mm, where the problem does not say it; 20 by default.
        paper: ``a4`` or ``letter``.
        problem: a robot's problem; its ``[tags]`` say sizes and sites.

    Raises:
        GaitoptError: an argument is out of range, or the file cannot be written.
    """
    from gaitopt.report.tag_sheets import PAPERS_MM, PrintedTag, tag_sheets, write_sheets

    path = Path(path)
    if path.suffix.lower() != ".pdf":
        raise GaitoptError(f"{path}: found no PDF; allowed: a file that ends in .pdf")
    if paper not in PAPERS_MM:
        raise bad_value("gaitopt tags", "--paper", paper, ", ".join(PAPERS_MM), PAPERS_MM)
    size = TAG_SIZE_MM if size_mm is None else size_mm
    low, high = TAG_SIZES_MM
    if not low <= size <= high:
        raise bad_value("gaitopt tags", "--size-mm", size, f"{low:g} to {high:g}")
    check_replaceable(path)
    if problem is not None:
        build_model(problem)  # which checks the sites
    known = {} if problem is None else {int(n): t for n, t in problem.file.tags.items()}
    numbers = tag_numbers(ids) if ids is not None else list(known) or list(range(8))
    printed = [
        PrintedTag(n, known[n].size_mm if n in known and size_mm is None else size, _name(known.get(n)))
        for n in numbers
    ]
    places, note = _places(problem)
    sheets = tag_sheets(printed, paper, places)
    write_with(path, lambda temporary: write_sheets(temporary, sheets))
    return TagSheets(path, {tag.number: tag.size_mm for tag in printed}, len(sheets), note)


def _places(problem: Problem | None) -> tuple[list[Image], str]:
    """Return pictures of where the tags go on a robot, or why there is none."""
    if problem is None or not any(tag.site for tag in problem.file.tags.values()):
        return [], ""
    from gaitopt.report.film.tag_places import tag_places

    try:
        return tag_places(problem), ""
    except GaitoptError as error:
        return [], f"no picture of where the tags go: {error}"


def tag_numbers(text: str) -> list[int]:
    """Return the numbers of tags that a text such as ``0-3,7`` names.

    Raises:
        GaitoptError: it is no such text, or names a number that a tag cannot have, or one twice.
    """
    numbers: list[int] = []
    for part in text.split(","):
        ends = re.fullmatch(r"([0-9]{1,3})(?:-([0-9]{1,3}))?", part.strip(), re.ASCII)
        if ends is None:
            raise GaitoptError(f"--ids: found {found(part)}; allowed: numbers such as 0-7 or 0,1,4-6")
        try:
            first, last = (check_tag_number("--ids", str(int(end))) for end in (ends[1], ends[2] or ends[1]))
            numbers += [check_tag_number("--ids", str(n)) for n in range(first, last + 1)]
        except ValueError as error:
            raise GaitoptError(str(error)) from None
        if first > last:
            raise GaitoptError(f"--ids: found {found(part)}; allowed: the smaller number first")
    if len(set(numbers)) < len(numbers) or len(numbers) > _MOST:
        raise GaitoptError(f"--ids: found {found(text)}; allowed: each number once, {_MOST} at most")
    return numbers


def _name(tag: Tag | None) -> str:
    return "" if tag is None else tag.site or ""
