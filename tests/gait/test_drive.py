"""Drives: what a gait and logged commands have in common."""

from dataclasses import replace

import numpy as np
import pytest
from drives import wandering

from gaitopt.gait.drive import Drive
from gaitopt.problem.problem import Problem


def test_a_gait_is_a_drive_whose_blocks_are_its_cycles(arcfold: Problem) -> None:
    gait = arcfold.baselines["square-1s"]
    assert isinstance(gait, Drive)
    assert (gait.period_s, gait.block_s, gait.duration_s) == (1.0, 1.0, None)


def test_logged_commands_are_a_drive_without_a_period() -> None:
    log = wandering(channels=2, seconds=3.0)
    assert isinstance(log, Drive)
    assert (log.period_s, log.duration_s) == (None, pytest.approx(3.0))
    assert log.targets(np.array([0.0, 1.0, 9.0])).shape == (3, 2)


def test_a_key_tells_commands_apart_and_not_names(arcfold: Problem) -> None:
    gait = arcfold.baselines["square-1s"]
    assert replace(gait, name="another").key == gait.key
    assert gait.with_period(1.5).key != gait.key
    log = wandering(channels=2, seconds=3.0)
    assert replace(log, name="another").key == log.key
    assert wandering(channels=2, seconds=3.0, seed=2).key != log.key
