"""OpenGL without a screen: the first of its back ends that works here."""

from __future__ import annotations

import importlib
import os
import sys
from typing import Protocol

from gaitopt.core.errors import GaitoptError

_BACK_ENDS = {"darwin": ("cgl",), "win32": ("glfw",)}
_HEADLESS = ("egl", "osmesa")
"""MuJoCo's back ends by platform, and those of Linux and others."""

_MISSING = (
    "pictures need OpenGL without a screen, and neither EGL nor OSMesa works here; on Debian or Ubuntu: "
    "apt install libegl1 (or libosmesa6)"
)


class Context(Protocol):
    """An OpenGL context, as MuJoCo's back ends make one."""

    def make_current(self) -> None:
        """Draw into this context from now on."""

    def free(self) -> None:
        """Free what it holds."""


def open_context(width: int, height: int) -> Context:
    """Return an OpenGL context: the one that ``MUJOCO_GL`` names, or else the first that works.

    Args:
        width, height: of the pictures, pixels.

    Raises:
        GaitoptError: none works.
    """
    named = os.environ.get("MUJOCO_GL", "").strip().lower()
    for back_end in (named,) if named else _BACK_ENDS.get(sys.platform, _HEADLESS):
        try:
            return _open_with(back_end, width, height)
        except Exception:
            _forget(back_end, named)
    raise opengl_missing(f" (MUJOCO_GL is {named!r})" if named else "")


def opengl_missing(remark: str = "") -> GaitoptError:
    """Return the error that says what to install."""
    return GaitoptError(_MISSING + remark)


def _open_with(back_end: str, width: int, height: int) -> Context:
    os.environ["MUJOCO_GL"] = back_end  # libmujoco asks for it when it looks up OpenGL's functions
    context: Context = importlib.import_module(f"mujoco.{back_end}").GLContext(width, height)
    return context


def _forget(back_end: str, named: str) -> None:
    """Undo a failed import: PyOpenGL chooses its platform only once."""
    os.environ.pop("PYOPENGL_PLATFORM", None)
    os.environ.pop("MUJOCO_GL", None)
    if named:
        os.environ["MUJOCO_GL"] = named
    failed = f"mujoco.{back_end}"
    for module in [m for m in sys.modules if m.split(".")[0] == "OpenGL" or m.startswith(failed)]:
        del sys.modules[module]
