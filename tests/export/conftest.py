"""Robots and an executor that the tests of the export share."""

from concurrent.futures import Executor
from pathlib import Path

import pytest
from helpers import STRIDER, problem_folder

from gaitopt.optimise.executors import SerialExecutor
from gaitopt.problem.problem import Problem, load_problem


@pytest.fixture
def wired_folder(tmp_path: Path) -> Path:
    """The strider with pins."""

    def wire(content: dict) -> None:
        for pin, channel in enumerate(content["channels"].values(), start=4):
            channel["servo"] = {"pin": pin}

    return problem_folder(tmp_path / "wired", STRIDER, wire)


@pytest.fixture
def wired(wired_folder: Path) -> Problem:
    """The strider with pins."""
    return load_problem(wired_folder)


@pytest.fixture
def serial() -> Executor:
    """An executor that needs no threads."""
    return SerialExecutor()
