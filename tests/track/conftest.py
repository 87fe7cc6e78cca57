"""A synthetic film of ArcFold with its tags."""

import pytest
from phone import CLOSE, SMALL, Walk

from gaitopt.problem.problem import Problem
from gaitopt.report.film.phone import shot
from gaitopt.report.film.stage import stage_of, truth, walk


@pytest.fixture(scope="session")
def filmed(tmp_path_factory: pytest.TempPathFactory, arcfold: Problem) -> Walk:
    """A second of square-4s, in which the arch folds, at a variable frame rate."""
    stage, motion = stage_of(arcfold), walk(arcfold, "square-4s", 2.4)
    path = tmp_path_factory.mktemp("film") / "walk.mp4"
    made = shot(path, stage, motion, CLOSE, SMALL, seconds=1.25, begin=0.9)
    return Walk(path, made.times - made.times[0], truth(arcfold, stage, motion, made.times))
