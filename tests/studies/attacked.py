"""What the attacks of ``attacks_before.py`` stand on: a ground of their own, commands with limits, outcomes.

An attack uses a program only by its command line. So it can be tried on any version of it.
"""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from edited_runs import as_if_killed

STRIDER = Path(__file__).parents[1] / "robots" / "strider"

SECRET = "not-for-others"
"""What a file outside of a stranger's folder says; nobody who did not name that file may print it."""

ONE_LINE = "one line"
DONE = "done"

SEARCH = ("--budget", 6, "--seed", 5, "--no-warm-start", "--quiet")
"""Options of a brief search."""

CASE = ("--cases", 1, "--kind", "none", "--gaits", "stride", "--seconds", 3, "--signals", "marker.y")
"""Options of a brief blind case."""

_MEMORY = 6 * 2**30
_LARGEST_FILE = 2**30
_CONTROLS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")


@dataclass(frozen=True)
class Ended:
    """How a command ended.

    Attributes:
        code: its exit code; None where it was still running at its time limit.
        out, err: what it printed.
        more: what the attack itself found, in words; it comes before all else.
    """

    code: int | None
    out: str = ""
    err: str = ""
    more: str = ""

    @property
    def outcome(self) -> str:
        """What happened, in words."""
        if self.more:
            return self.more
        if self.code is None:
            return "still running at the limit"
        if self.code < 0:
            return f"ended by {signal.Signals(-self.code).name}"
        if "Traceback (most recent call last)" in self.err:
            return f"traceback ({self.err.strip().splitlines()[-1].split(':')[0]})"
        if SECRET in self.out + self.err:
            return "a file outside was read"
        if _CONTROLS.search(self.out + self.err):
            return "control characters were printed raw"
        if self.code == 0:
            return DONE
        if "gaitopt: out of memory" in self.err:
            return f"it filled {_MEMORY // 2**30} GiB of memory, then one line"
        lines = [line for line in self.err.splitlines() if line.strip() and not line.endswith("…")]
        return ONE_LINE if len(lines) == 1 else f"exit code {self.code} with {len(lines)} lines"


@dataclass
class Program:
    """A version of the program.

    Attributes:
        venv: the virtual environment in which it is installed.
        limit_s: a command that takes longer is ended, s.
        made: a folder for what it makes once: a run, a diagnosis, blind cases.
    """

    venv: Path
    limit_s: float
    made: Path

    @property
    def source(self) -> Path:
        """The folder of the package that it runs."""
        code = "import gaitopt; print(gaitopt.__path__[0])"
        said = subprocess.run(
            [self.venv / "bin" / "python", "-P", "-c", code],
            env=_environment(),
            capture_output=True,
            text=True,
            check=True,
        )
        return Path(said.stdout.strip())

    def run(self, *words: object, cwd: Path) -> Ended:
        """Run a command within its limits of time, memory and file size."""
        process = subprocess.Popen(
            [self.venv / "bin" / "gaitopt", *map(str, words)],
            cwd=cwd,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=_environment() | {"HOME": str(self.made), "MPLCONFIGDIR": str(self.made)},
            start_new_session=True,
            preexec_fn=_limit,
        )
        try:
            out, err = process.communicate(timeout=self.limit_s)
            code: int | None = process.returncode
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            (out, err), code = process.communicate(), None
        return Ended(code, out.decode(errors="replace"), err.decode(errors="replace"))

    def once(self, name: str, fill: Callable[..., Ended], copy: Path) -> Path:
        """Return a copy of what `fill` makes in a folder, which it does once."""
        folder = self.made / name
        if not folder.exists():
            folder.mkdir(parents=True)
            ended = fill(cwd=folder)
            assert ended.code == 0, ended
        shutil.copytree(folder, copy, dirs_exist_ok=True)
        return copy


def _environment() -> dict[str, str]:
    """What a command gets: a wide terminal, and nothing that would lead it to another version's code."""
    own = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return own | {"COLUMNS": "200", "OPENBLAS_NUM_THREADS": "1"}


def _limit() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    resource.setrlimit(resource.RLIMIT_FSIZE, (_LARGEST_FILE, _LARGEST_FILE))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


@dataclass
class Ground:
    """A new folder for one attack, with a folder of victims beside the stranger's.

    Attributes:
        program: what is attacked.
        folder: the folder, where its commands run.
    """

    program: Program
    folder: Path
    _before: dict[str, tuple[int, str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.victims.mkdir()
        for name in ("notes.txt", ".notes.abcd1234.txt", "model.xml", "problem.toml"):
            (self.victims / name).write_text(f"{SECRET}: {name}\n")
        (self.folder / "elsewhere.xml").write_text(
            f'<mujocoinclude><site name="{SECRET}" size="0.001"/></mujocoinclude>'
        )
        self._before = self._seen()

    @property
    def victims(self) -> Path:
        """A folder of the user's, with files that a sweep of leftovers would take for its own."""
        return self.folder / "victims"

    def add_victim(self, name: str, text: str) -> None:
        """Make one more victim."""
        (self.victims / name).write_text(text)
        self._before = self._seen()

    def _seen(self) -> dict[str, tuple[int, str]]:
        paths = [path for path in self.victims.iterdir() if path.is_file()]
        return {path.name: (stat.S_IMODE(path.stat().st_mode), path.read_text()) for path in paths}

    def run(self, *words: object, cwd: Path | None = None) -> Ended:
        """Run a command of the program, in this folder by default, and look after the victims."""
        ended = self.program.run(*words, cwd=cwd or self.folder)
        return self.looked_after(ended)

    def looked_after(self, ended: Ended) -> Ended:
        """Say so where a victim was changed."""
        if self._seen() == self._before:
            return ended
        return Ended(ended.code, ended.out, ended.err, "**destroyed** files outside the folder")

    def robot(self, *edits: tuple[str, str, str], name: str = "robot") -> Path:
        """A copy of the strider's folder with some texts of its files replaced."""
        folder = self.folder / name
        shutil.copytree(STRIDER, folder)
        for file, old, new in edits:
            text = (folder / file).read_text()
            assert old in text, (file, old)
            (folder / file).write_text(text.replace(old, new))
        return folder

    def with_element(self, element: str) -> Path:
        """A robot whose MJCF has one more element."""
        return self.robot(("strider.xml", "</worldbody>", "</worldbody>" + element))

    def finished(self) -> Path:
        """A finished run of the strider."""
        made = partial(self.program.run, "optimise", STRIDER, *SEARCH, "--out", "run")
        return self.program.once("runs", made, self.folder) / "run"

    def unfinished(self) -> Path:
        """The same, as if it had been killed after three gaits."""
        return as_if_killed(self.finished())

    def cases(self) -> Path:
        """A blind case that is not diagnosed."""
        made = partial(self.program.run, "blind", "make", STRIDER, *CASE, "--out", "cases")
        return self.program.once("blind", made, self.folder) / "cases"

    def recording(self, cell: str = "0.011") -> Path:
        """A table of a motion; one cell of it may be odd."""
        rows = [f"{0.04 * index:.2f},{0.001 * index:.3f}" for index in range(100)]
        rows[11] = f"0.44,{cell}"
        path = self.folder / "walk.csv"
        path.write_text("t_s,x_m\n" + "\n".join(rows) + "\n")
        return path

    def dataset(self) -> Path:
        """A data set of one trial."""
        folder = self.folder / "trials"
        folder.mkdir()
        self.recording().rename(folder / "walk.csv")
        trial = '[[trial]]\nname = "one"\ngait = "stride"\nfile = "walk.csv"\n'
        (folder / "dataset.toml").write_text(trial + 'signals = { "marker.y" = "x_m" }\n')
        return folder

    def device(self, path: Path, minor: int) -> Path:
        """Make a device of one's own: 3 is always empty, 5 has no end. The machine's are not touched."""
        os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, minor))
        return path


@contextmanager
def ground(program: Program) -> Iterator[Ground]:
    """A new ground, which is removed after its attack."""
    with tempfile.TemporaryDirectory(prefix="gaitopt-attack-") as folder:
        yield Ground(program, Path(folder))


@contextmanager
def peer(said: bytes) -> Iterator[str]:
    """The address of something on this machine that takes every connection, says this, and waits."""
    listening = socket.create_server(("127.0.0.1", 0))
    connections: list[socket.socket] = []

    def accept() -> None:
        with suppress(OSError):
            while True:
                connection, _ = listening.accept()
                connections.append(connection)
                connection.sendall(said)

    threading.Thread(target=accept, daemon=True).start()
    try:
        yield f"dask://127.0.0.1:{listening.getsockname()[1]}"
    finally:
        for connection in (listening, *connections):
            connection.close()


Act = Callable[[Ground], Ended]


@dataclass(frozen=True)
class Attack:
    """One attack.

    Attributes:
        finding: the number of the finding in issue 28; 0 for an honest command, which must end well.
        title: what is done.
        act: does it.
        right: how it should end.
    """

    finding: int
    title: str
    act: Act
    right: str = ONE_LINE


ATTACKS: list[Attack] = []


def attack(finding: int, title: str, right: str = ONE_LINE) -> Callable[[Act], Act]:
    """Add an attack to the list."""

    def add(act: Act) -> Act:
        ATTACKS.append(Attack(finding, title, act, right))
        return act

    return add


def outside(ended: Ended) -> Ended:
    """A command that works has read a file outside of the stranger's folder."""
    return replace(ended, more="the file outside was read") if ended.code == 0 else ended


def resumed(on: Ground, run: Path) -> Ended:
    """Go on with a run."""
    return on.run("optimise", run, "--resume", run, "--quiet")


def edited_json(path: Path, change: Callable[[Any], object]) -> None:
    """Change the content of a JSON file."""
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
