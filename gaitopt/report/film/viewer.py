"""A motion on the screen, in MuJoCo's viewer."""

from __future__ import annotations

import os
import sys
import time

import numpy as np

from gaitopt.core.errors import GaitoptError
from gaitopt.report.film.take import Take

_REFRESH_S = 0.02


def check_screen() -> None:
    """Check that a window can be opened.

    Raises:
        GaitoptError: there is no screen.
    """
    screen = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    if sys.platform.startswith("linux") and not screen:
        raise GaitoptError("--view: no screen here; write a film instead: --video walk.mp4")


def view(shown: Take) -> None:
    """Play a motion again and again in MuJoCo's own viewer, until its window is closed.

    Raises:
        GaitoptError: there is no screen, or no window can be opened on it.
    """
    check_screen()
    import mujoco.viewer

    clock = shown.trajectory.time
    data = mujoco.MjData(shown.model)
    try:
        window = mujoco.viewer.launch_passive(shown.model, data)
    except RuntimeError as error:
        raise GaitoptError(f"--view: {error}") from None
    with window:
        began = time.monotonic()
        while window.is_running():
            at = (time.monotonic() - began) % float(clock[-1])
            data.time, data.qpos[:] = at, shown.poses[np.searchsorted(clock, at)]
            mujoco.mj_kinematics(shown.model, data)
            window.sync()
            time.sleep(_REFRESH_S)
