"""Fiducial tags: where they sit on a robot, or that they lie on its floor."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

from gaitopt.core.errors import found
from gaitopt.core.validation import PLAIN_NUMBER, Name
from gaitopt.problem.fields import FileRecord

TAGS = range(587)
"""Numbers of the tags: those of the family AprilTag 36h11."""

SHEET_TAGS = range(100, 106)
"""Numbers of the tags on the floor sheet that `gaitopt tags` prints; no other tag has one of them."""

TAG_SIZES_MM = (5.0, 150.0)
"""Smallest and largest edge of a tag's black square, mm."""

TAG_SIZE_MM = 20.0
"""Edge of a tag's black square where nothing else is said, mm."""

_ALLOWED = (
    f"a number from {TAGS[0]} to {TAGS[-1]}, but not {SHEET_TAGS[0]} to {SHEET_TAGS[-1]}, which are the "
    "floor sheet's"
)


class Tag(FileRecord):
    """One tag.

    Attributes:
        site: the site of the MJCF where its middle sits: x of the site is the tag's reading direction, z
            points out of its face. None where it lies on the floor.
        size_mm: edge of its black square, mm.
    """

    site: Name | None = None
    size_mm: Annotated[float, Field(ge=TAG_SIZES_MM[0], le=TAG_SIZES_MM[1]), PLAIN_NUMBER] = TAG_SIZE_MM


def _numbered(tags: dict[str, Tag]) -> dict[str, Tag]:
    for name in tags:
        if not is_tag_number(name):
            raise ValueError(f"found {found(name)}; allowed: {_ALLOWED}")
    sites = [tag.site for tag in tags.values() if tag.site is not None]
    for site in sites:
        if sites.count(site) > 1:
            raise ValueError(f"found the site {found(site)} twice; allowed: one tag on each site")
    return tags


def is_tag_number(text: str) -> bool:
    """Return whether a text is the number of a tag that may be on a robot or lie loose on the floor."""
    plain = text.isascii() and text.isdigit() and len(text) < 4 and str(int(text)) == text
    return plain and int(text) in TAGS and int(text) not in SHEET_TAGS


def check_tag_number(option: str, text: str) -> int:
    """Return the number of a tag that may be on a robot or lie loose on the floor.

    Raises:
        ValueError: there is none of this number, or it is on the floor sheet.
    """
    if not is_tag_number(text):
        raise ValueError(f"{option}: found {found(text)}; allowed: {_ALLOWED}")
    return int(text)


TagTables = Annotated[dict[Name, Tag], AfterValidator(_numbered)]
"""The tags of a problem file, by number."""
