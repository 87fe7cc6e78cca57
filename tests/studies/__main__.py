"""Lists the studies, with the cost and the commands of each.

python tests/studies
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class Study:
    """One study, as its docstring describes it.

    Attributes:
        name: its file.
        title: its question.
        cost: its time from the start.
        commands: the commands that run it.
    """

    name: str
    title: str
    cost: str
    commands: tuple[str, ...]


def studies() -> list[Study]:
    """Every study; each is a file that is run by hand."""
    found = []
    for path in sorted(FOLDER.glob("*.py")):
        text = path.read_text()
        if 'if __name__ == "__main__"' in text and path.name != Path(__file__).name:
            found.append(_study(path.name, ast.get_docstring(ast.parse(text)) or ""))
    return found


def _study(name: str, about: str) -> Study:
    cost = re.search(r"^Cost: (.+)\.$", about, flags=re.M)
    commands = re.findall(r"^ +((?:python|pip) .+)$", about, flags=re.M)
    return Study(name, about.partition("\n")[0], cost[1] if cost else "", tuple(commands))


def main() -> None:
    """Print the list."""
    for study in studies():
        print(f"{study.name}: {study.title}")
        print(f"    cost: {study.cost}")
        for command in study.commands:
            print(f"    {command}")


if __name__ == "__main__":
    main()
