"""The public face: every name is there, loads nothing early, and is the function of the same name."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import gaitopt
from gaitopt import api

JOBS = ("diagnose", "export", "optimise", "plan", "track")
"""Jobs whose names are also those of packages inside."""


def printed(code: str) -> str:
    """What a fresh interpreter prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_every_name_is_there() -> None:
    assert len(set(gaitopt.__all__)) == len(gaitopt.__all__)
    for name in gaitopt.__all__:
        assert getattr(gaitopt, name) is not None, name
        assert getattr(api, name) is getattr(gaitopt, name)
    assert set(gaitopt.__all__) <= set(dir(gaitopt))


def test_the_types_of_the_face_are_those_that_it_loads() -> None:
    tree = ast.parse(Path(gaitopt.__file__).read_text())
    (checking,) = [node for node in tree.body if isinstance(node, ast.If)]
    imported = {
        alias.name: node.module
        for node in checking.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert imported == gaitopt._HOME_OF
    assert set(imported) == set(gaitopt.__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="'gaitopt' has no attribute 'optimize_all'"):
        _ = gaitopt.optimize_all


def test_the_package_and_the_help_load_no_simulator() -> None:
    heavy = "[m for m in ('casadi', 'mujoco', 'numpy', 'scipy') if m in sys.modules]"
    assert printed(f"import sys, gaitopt; print({heavy})") == "[]"
    assert printed(f"import sys; from gaitopt.cli import main; main(['--help']); print({heavy})").endswith(
        "[]"
    )


@pytest.mark.parametrize("name", JOBS)
def test_a_job_is_no_package_whatever_was_imported_first(name: str) -> None:
    code = f"import gaitopt.{name}; from gaitopt import {name}; print({name}.__module__)"
    assert printed(code) == f"gaitopt.jobs.{name}"
