"""Robots that the tests share, and how the tests are run."""

import contextlib
import os
from pathlib import Path
from typing import Any

import pytest
from helpers import ROBOTS, problem_folder
from hypothesis import settings

from gaitopt.core.errors import GaitoptError
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.robot.warnings import silence_warnings
from gaitopt.track.opencv import opencv

os.environ.setdefault("MPLBACKEND", "Agg")
settings.register_profile("gaitopt", deadline=None, derandomize=True, database=None)
settings.load_profile("gaitopt")
silence_warnings()  # as the command line does
with contextlib.suppress(GaitoptError):
    opencv()  # an import of cv2 by a test would leave its library path to the programs that other tests start


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Every test works in an empty folder, so that files that it leaves behind are seen."""
    folder = tmp_path_factory.mktemp("cwd")
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture(scope="session")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for property tests; their many examples share it."""
    return tmp_path_factory.mktemp("scratch")


@pytest.fixture(scope="session")
def arcfold() -> Problem:
    """The bundled robot at true scale."""
    return load_problem("arcfold")


@pytest.fixture(scope="session")
def quick_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """ArcFold's problem folder with a short horizon, few scenarios and no finer reference."""
    folder = tmp_path_factory.mktemp("quick") / "arcfold"

    def shorten(content: dict[str, Any]) -> None:
        simulation = content["simulation"]
        simulation["horizon"] = {
            "transient_s": 0.3,
            "transient_cycles": 0,
            "measured_s": 0.6,
            "measured_cycles": 1,
        }
        simulation["reference"] = simulation["working"]
        content["scenarios"] |= {"search": 1, "verification": 2}

    return problem_folder(folder, load_problem("arcfold").source.parent, shorten)


@pytest.fixture(scope="session")
def quick(quick_folder: Path) -> Problem:
    """ArcFold with a short horizon."""
    return load_problem(quick_folder)


@pytest.fixture(scope="session")
def strider() -> Problem:
    """A planar robot with two servos, without a free joint, that walks along y."""
    return load_problem(ROBOTS / "strider")
