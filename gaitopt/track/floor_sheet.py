"""The floor sheet: where its tags are. It gives scale, plane and direction of travel."""

from __future__ import annotations

from gaitopt.problem.tags import SHEET_TAGS

SHEET_TAG_MM = 40.0
"""Edge of the tags on the floor sheet, mm."""

_ACROSS, _UP = (-100.0, 0.0, 100.0), (52.0, -52.0)

SHEET_MM = {number: (_ACROSS[index % 3], _UP[index // 3]) for index, number in enumerate(SHEET_TAGS)}
"""Middle of each tag, mm, from the middle of the sheet: in the direction of travel, and to its left."""

START_LINE_MM = -127.0
"""Where the start line crosses the sheet, mm from its middle in the direction of travel."""
