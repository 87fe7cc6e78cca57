"""What keeps a robot from being simulated, collected so that it is all said at once, each with its remedy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from gaitopt.core.errors import GaitoptError


@dataclass
class Faults:
    """The faults of one MJCF.

    Attributes:
        path: the MJCF.
        found: what is wrong, each with what to do about it.
    """

    path: Path
    found: list[str] = field(default_factory=list)

    def add(self, what: str, remedy: str) -> None:
        """Note a fault, and what to do about it."""
        self.found.append(f"{what}: {remedy}")

    def check(self) -> None:
        """Tell all faults.

        Raises:
            GaitoptError: there is one.
        """
        if len(self.found) == 1:
            raise GaitoptError(f"{self.path}: {self.found[0]}")
        if self.found:
            listed = "; ".join(f"({number}) {text}" for number, text in enumerate(self.found, start=1))
            raise GaitoptError(f"{self.path}: {len(self.found)} problems: {listed}")


def listed(names: Sequence[str]) -> str:
    """Return names, or the first and how many more."""
    return ", ".join(names) if len(names) <= 4 else f"{', '.join(names[:3])} and {len(names) - 3} more"
