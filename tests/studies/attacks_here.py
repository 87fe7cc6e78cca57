"""Honest commands, and attacks by the folder in which a command runs: files that libraries look for there.

The honest commands show that an attack does not fail for another reason, such as an unknown option.
"""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

from attacked import (
    ATTACKS,
    CASE,
    DONE,
    SEARCH,
    STRIDER,
    Act,
    Attack,
    Ended,
    Ground,
    attack,
    resumed,
)

LATER = 11
"""The number of what was found after issue 28 was written."""


def honest(*words: object) -> Act:
    """A command on files that nobody changed."""
    return lambda on: on.run(*words)


HONEST: dict[str, Act] = {
    "`simulate --csv`": honest("simulate", STRIDER, "stride", "--csv", "out.csv"),
    "`simulate` of the gait of a run": lambda on: on.run("simulate", STRIDER, on.finished()),
    "`compare`": honest("compare", STRIDER, "stride", "square"),
    "`model --out`": honest("model", STRIDER, "--out", "model.xml"),
    "`command --out`": honest(
        "command", STRIDER, "stride", "--dt", 0.1, "--duration", 1, "--out", "table.csv"
    ),
    "`new`, and `simulate` of what it made": lambda on: drafted(on),
    "`import`": lambda on: on.run("import", on.recording(), "--gait", "square-1s", "--out", "out"),
    "`optimise`": honest("optimise", STRIDER, *SEARCH, "--out", "run"),
    "`optimise --executor processes`": honest(
        "optimise", STRIDER, *SEARCH, "--out", "run", "--executor", "processes"
    ),
    "`optimise --resume` of a finished run": lambda on: resumed(on, on.finished()),
    "`optimise --resume` of an unfinished run": lambda on: resumed(on, on.unfinished()),
    "`diagnose`": lambda on: on.run(
        "diagnose", STRIDER, on.dataset(), "--effects", "ground_slope", "--quiet", "--out", "diagnosis"
    ),
    "`plan`": honest("plan", "arcfold"),
    "`blind make`": honest("blind", "make", STRIDER, *CASE, "--out", "cases"),
}
for _title, _act in HONEST.items():
    ATTACKS.append(Attack(0, _title, _act, DONE))


def drafted(on: Ground) -> Ended:
    """A new problem of the strider's MJCF, simulated."""
    ended = on.run("new", "bot", "--mjcf", STRIDER / "strider.xml", "--out", "bot")
    return on.run("simulate", "bot", "first-guess") if ended.code == 0 else ended


def stranger(on: Ground, name: str, text: str) -> Path:
    """A stranger's folder, in which a command runs, with one file."""
    folder = on.folder / "here"
    folder.mkdir()
    (folder / name).write_text(text)
    return folder


@attack(LATER, "`multiprocessing.py` in the current folder, and worker processes", DONE)
def module_here(on: Ground) -> Ended:
    here = stranger(on, "multiprocessing.py", f"open({json.dumps(str(on.folder / 'ran'))}, 'w')\n")
    ended = on.run("optimise", STRIDER, *SEARCH, "--executor", "processes", "--out", "../run", cwd=here)
    return replace(ended, more="**code** of the stranger's ran") if (on.folder / "ran").exists() else ended


@attack(LATER, "`ipopt.opt` in the current folder names an output file", DONE)
def options_here(on: Ground) -> Ended:
    here = stranger(on, "ipopt.opt", "output_file ../victims/notes.txt\nfile_print_level 5\n")
    return on.run("plan", "arcfold", cwd=here)


@attack(LATER, "`cma_signals.in` in the current folder", DONE)
def signals_here(on: Ground) -> Ended:
    here = stranger(on, "cma_signals.in", "{'ftarget': 'x'}")
    return on.run("optimise", STRIDER, "--budget", 40, *SEARCH[2:], "--out", "../run", cwd=here)


@attack(LATER, "`matplotlibrc` in the current folder is a pipe", DONE)
def pipe_here(on: Ground) -> Ended:
    here = stranger(on, "note", "")
    os.mkfifo(here / "matplotlibrc")
    return on.run("optimise", STRIDER, *SEARCH, "--out", "../run", cwd=here)


@attack(LATER, "`MUJOCO_LOG.TXT` in the current folder links to a file, and a simulation diverges", DONE)
def log_here(on: Ground) -> Ended:
    here = stranger(on, "note", "")
    (here / "MUJOCO_LOG.TXT").symlink_to(on.victims / "notes.txt")
    robot = on.robot(("strider.xml", "<option ", '<option gravity="0 0 1e12" '))
    ended = on.run("simulate", robot, "stride", cwd=here)
    return ended if "diverged" in ended.out else replace(ended, more="it did not diverge")
