"""Commands watched by the kernel, with strace: which files they and their children read and change."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

TESTS = Path(__file__).parent

_RUN = f"""
import sys
sys.path.insert(0, {str(TESTS)!r})
from helpers import brief_studies
for module, name, value in brief_studies():
    setattr(module, name, value)
from dataclasses import replace
from gaitopt.jobs import blind
blind.EACH_CASE = replace(blind.EACH_CASE, effects=("pad_friction", "ground_slope"))
from gaitopt.cli.app import main
sys.exit(main(sys.argv[1:]))
"""

_CALL = re.compile(r"^\d+ +(?P<name>\w+)\((?P<rest>.*)$")
_PATH = re.compile(r'(?:(?:AT_FDCWD|\d+)(?:<(?P<base>[^>]*)>)?, )?"(?P<path>(?:[^"\\]|\\.)*)"')
_GOT = re.compile(r"= \d+<(?P<path>/[^>]*)>$")
_OPENS = ("open", "openat", "openat2", "creat")
_CHANGES = re.compile(
    r"(unlink|rename|mkdir|link|symlink|mknod|chmod|fchmodat|chown|lchown|fchownat|utimensat|utime)(at|at2)?"
    r"|rmdir|truncate"
)
_TO_CHANGE = re.compile(r"O_(WRONLY|RDWR|CREAT|TRUNC|APPEND)")


@dataclass(frozen=True)
class Watched:
    """What a command did.

    Attributes:
        code: its exit code.
        err: what it printed on standard error.
        opened: every file that it tried to open, by its name and, if that is a link, by what it got.
        changed: of these, those that it tried to open to write; and the paths that it tried to make, remove,
            rename or change otherwise. Links on the way are resolved.
    """

    code: int
    err: str
    opened: frozenset[Path]
    changed: frozenset[Path]

    def changed_outside(self, *folders: Path) -> set[Path]:
        """What it changed outside of these folders; what belongs to no disk is left out."""
        mine = (*(folder.resolve() for folder in folders), *map(Path, ("/dev", "/proc")))
        return {path for path in self.changed if not any(path.is_relative_to(one) for one in mine)}


def watched(*words: object, settings: Path) -> Watched:
    """Run a command, with brief studies, in a process of its own, and watch it.

    Args:
        words: the command.
        settings: a folder for what libraries keep between runs.
    """
    trace = settings / "trace"
    settings.mkdir(exist_ok=True)
    kept = {name: str(settings) for name in ("MPLCONFIGDIR", "XDG_CACHE_HOME", "HOME")}
    done = subprocess.run(
        [
            *("strace", "-f", "-qq", "-y", "-e", "trace=%file,creat", "-o", trace),
            *(sys.executable, "-c", _RUN, *map(str, words)),
        ],
        capture_output=True,
        text=True,
        env=os.environ | kept | {"PYTHONDONTWRITEBYTECODE": "1"},
        check=False,
    )
    opened, changed = set(), set()
    for name, rest in _calls(trace):
        paths = {_resolved(found, Path.cwd()) for found in _PATH.finditer(rest)}
        if name in _OPENS:
            got = _GOT.search(rest)
            opened |= paths | ({Path(got["path"])} if got else set())
        if "= -1 EEXIST" in rest:
            continue
        if _CHANGES.fullmatch(name) or (name in _OPENS and _TO_CHANGE.search(_PATH.sub("", rest))):
            changed |= paths
    assert len(opened) > 50
    return Watched(done.returncode, done.stderr, frozenset(opened), frozenset(changed))


def _calls(trace: Path) -> Iterator[tuple[str, str]]:
    for line in trace.read_text(errors="replace").splitlines():
        call = _CALL.match(line)
        if call is not None:
            yield call["name"], call["rest"]


def _resolved(found: re.Match[str], here: Path) -> Path:
    """The path of a call; of its last part a link is not followed."""
    text = found["path"].encode().decode("unicode_escape", errors="replace")
    path = Path(found["base"] or here) / text
    return path.parent.resolve() / path.name if path.name else path
