"""The versions that the bits of a result depend on."""

from __future__ import annotations

from functools import cache
from importlib.metadata import version

_PACKAGES = ("gaitopt", "mujoco", "numpy")


@cache
def versions() -> dict[str, str]:
    """Return the version of each package that the bits of a result depend on, by its name."""
    return {name: version(name) for name in _PACKAGES}


def versions_text() -> str:
    """Return the same versions in one line."""
    return ", ".join(f"{name} {number}" for name, number in versions().items())
