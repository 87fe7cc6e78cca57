"""MuJoCo's warning handler belongs to the program, not to the library."""

import subprocess
import sys

_IMPORTS = "gaitopt.api, gaitopt.problem.draft, gaitopt.optimise.executors, gaitopt.cli.app"


def handler_after(code: str) -> str:
    """Return what MuJoCo reports about its handler after some code, in a separate process."""
    code += "; import mujoco; print(mujoco.get_mju_user_warning())"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_an_import_leaves_mujoco_s_warnings_to_the_program() -> None:
    assert handler_after(f"import {_IMPORTS}") == "None\n"


def test_the_command_line_and_its_workers_silence_them() -> None:
    assert "None" not in handler_after("from gaitopt.cli.app import main; main(['effects', 'arcfold'])")[-40:]
    assert handler_after("from gaitopt.optimise.processes import _begin_worker; _begin_worker()") != "None\n"
