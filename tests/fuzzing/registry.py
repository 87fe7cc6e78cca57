"""Every kind of case with its share, and how a case is made."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

from fuzzing.kinds import (
    command_line,
    data_set,
    exported_table,
    gait_file,
    gait_round_trip,
    importer,
    journal,
    mjcf_content,
    mjcf_text,
    problem_content,
    problem_text,
    run_folder,
    written_over,
)
from fuzzing.outcome import Case
from fuzzing.runs import check_whole, compare_whole, diagnose_whole, optimise_whole, resume_whole, sweep_whole

KINDS: dict[str, tuple[int, Callable[[random.Random, Path], Case]]] = {
    "problem file, text": (10, problem_text),
    "problem file, values": (14, problem_content),
    "MJCF, text": (8, mjcf_text),
    "MJCF, elements": (12, mjcf_content),
    "gait file": (10, gait_file),
    "gait through a table and back": (4, gait_round_trip),
    "exported table": (10, exported_table),
    "tracker export": (14, importer),
    "data set": (10, data_set),
    "run folder": (8, run_folder),
    "journal": (8, journal),
    "command line": (14, command_line),
    "over a user's file": (4, written_over),
}
"""Each kind of input with its share of the cases."""

WHOLE: dict[str, tuple[int, Callable[[random.Random, Path], Case]]] = {
    "optimise, whole": (1, optimise_whole),
    "optimise, resumed": (1, resume_whole),
    "check, whole": (1, check_whole),
    "compare, whole": (1, compare_whole),
    "sweep, whole": (1, sweep_whole),
    "diagnose, whole": (1, diagnose_whole),
}
"""Complete runs; each takes a second or more."""

KINDS |= WHOLE


def make(seed: int, kind: str, number: int, folder: Path) -> Case:
    """Make one case in an empty folder; the same seed, kind and number make the same one."""
    return KINDS[kind][1](random.Random(f"{seed}/{kind}/{number}"), folder)
