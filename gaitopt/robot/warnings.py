"""MuJoCo's warnings, which it prints and appends to a log file unless a program handles them."""

from __future__ import annotations

from gaitopt.core.interrupts import interrupts_blocked


def silence_warnings() -> None:
    """Let MuJoCo print no warnings in this process.

    A simulation that diverges says so in the status of its result. MuJoCo would print a warning as well
    and append it to ``MUJOCO_LOG.TXT`` in the current folder. The handler is one for the whole process,
    so a program sets it, never a library on import.
    """
    with interrupts_blocked():  # MuJoCo's window library runs Python in another process when it loads
        import mujoco  # here, because it takes long to load

    mujoco.set_mju_user_warning(lambda message: None)
