"""Do the attacks of issue 28 succeed on an earlier version, and do they fail now?

Each attack uses the program only by its command line, in a folder of its own, under limits of time, memory
and file size. It is run on two installed versions. What it may destroy are files that it makes itself.
Honest commands are run beside the attacks: they must end well on both versions within the same limits.
Version 0.1:

    git worktree add ../before 32f3fcf
    python3 -m venv ../before/.venv && ../before/.venv/bin/pip install --editable '../before[cluster]'
    python tests/studies/attacks_before.py --before ../before/.venv --now .venv --out results/attacks

Cost: about 13 min on one core; most of it are attacks that do not end on the earlier version.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import attacks_here  # noqa: F401
import attacks_on_clusters  # noqa: F401
import attacks_on_files  # noqa: F401
import attacks_on_names  # noqa: F401
import attacks_on_runs  # noqa: F401
from attacked import ATTACKS, Attack, Program, ground
from kept import version


def tried(one: Attack, program: Program) -> tuple[str, str]:
    """Return how an attack ends, and the last line on standard error; a device cannot always be made."""
    with ground(program) as on:
        try:
            ended = one.act(on)
        except PermissionError:
            return "not tried: only root may make a device", ""
        lines = ended.err.strip().splitlines() or [""]
        said = lines[-1].replace(str(on.folder), "FOLDER").replace(str(Path.cwd()), ".")
        return ended.outcome, ascii(said[:300])[1:-1]


def is_right(one: Attack, outcome: str) -> bool:
    return outcome in one.right.split(" or ")


NAMES = ("before", "now")


def page(rows: list[dict[str, Any]], options: argparse.Namespace) -> str:
    """Return the tables in Markdown."""
    honest, attacks = ([row for row in rows if bool(row["finding"]) is hostile] for hostile in (False, True))
    wrong = {name: sum(not row[f"{name}_right"] for row in attacks) for name in NAMES}
    well = {name: sum(row[f"{name}_right"] for row in honest) for name in NAMES}
    lines = [
        "# Each finding on version 0.1 and now",
        "",
        f"{len(attacks)} attacks by the command line alone: **{wrong['before']} of them succeed on version "
        f"0.1 (32f3fcf), {wrong['now']} now ({version()}).** Each runs in a folder of its own, with "
        f"{options.limit:g} s for a command, 6 GiB of memory and files of at most 1 GiB. Where an attack "
        "aims at files outside of a stranger's folder, these were made for it, devices too. It succeeds if "
        "the command does not end as it should: well, or with one line and exit code 1.",
        "",
        "The numbers are those of the findings in issue 28; 11 was found later. Finding 10 is about tests, "
        "not about the program: see [docs/guarantees.md](../../docs/guarantees.md) and "
        "[kill-resume](../kill-resume/README.md).",
        "",
        f"{len(honest)} honest commands ran within the same limits, so that no attack succeeds for another "
        f"reason, such as an unknown option: {well['before']} end well on version 0.1, {well['now']} now.",
        "",
        "`python tests/studies/attacks_before.py --before ../before/.venv --now .venv --out results/attacks`",
        "",
        "[before.json](before.json) has the same rows, with the last line on standard error.",
        *table("Attacks", attacks),
        *table("Honest commands", honest),
    ]
    return "\n".join([*lines, "", "✗: this is not how it should end.", ""])


def table(title: str, rows: list[dict[str, Any]]) -> list[str]:
    """Return a section with a table."""
    lines = ["", f"## {title}", "", "| finding | what is done | on 0.1 | now |", "|---|---|---|---|"]
    for row in rows:
        shown = str(row["attack"]).replace("|", "\\|")
        ends = (f"{row[name]}{'' if row[f'{name}_right'] else ' ✗'}" for name in NAMES)
        lines.append(f"| {row['finding'] or '–'} | {shown} | {' | '.join(ends)} |")
    return lines


def programs(options: argparse.Namespace, made: Path) -> dict[str, Program]:
    """Return the two versions; refuse two names of the same code."""
    found = {
        name: Program(venv.absolute(), options.limit, made / name)
        for name, venv in zip(NAMES, (options.before, options.now), strict=True)
    }
    sources = {name: program.source for name, program in found.items()}
    if len(set(sources.values())) < len(sources):
        raise SystemExit(f"--before and --now run the same code: {sources['now']}")
    return found


def main() -> int:
    """Run the attacks, and write ``before.json`` and ``before.md``."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    add = parser.add_argument
    add("--before", type=Path, required=True, help="virtual environment of the earlier version")
    add("--now", type=Path, required=True, help="virtual environment of today's version")
    add("--limit", type=float, default=20.0, help="time limit of a command, s")
    add("--only", default="", help="titles that match this pattern")
    add("--finding", type=int, help="only this one; 0 for the honest commands")
    add("--out", type=Path, help="where the table goes; without it, it is printed")
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as made:
        versions = programs(options, Path(made))
        for one in sorted(ATTACKS, key=lambda attack: attack.finding):
            if options.finding in (None, one.finding) and re.search(options.only, one.title):
                row: dict[str, Any] = {"finding": one.finding, "attack": one.title, "should": one.right}
                for name, program in versions.items():
                    row[name], row[f"{name}_said"] = tried(one, program)
                    row[f"{name}_right"] = is_right(one, row[name])
                rows.append(row)
                shown = (one.finding, one.title, row["before"], row["now"])
                print(*shown, sep=" | ", file=sys.stderr, flush=True)
    text = page(rows, options)
    if options.out is None:
        print(text)
    else:
        (options.out / "before.md").write_text(text)
        (options.out / "before.json").write_text(
            json.dumps({"made_at": version(), "rows": rows}, indent=1) + "\n"
        )
    return sum(not row["now_right"] for row in rows)


if __name__ == "__main__":
    sys.exit(main())
