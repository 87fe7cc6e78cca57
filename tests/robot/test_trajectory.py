"""Signals and trajectories."""

import numpy as np
import pytest

from gaitopt.robot.roles import Roles
from gaitopt.robot.signals import MARKER, UNITS, column_of, is_position, joint_signal
from gaitopt.robot.trajectory import Trajectory


def test_a_column_has_its_unit() -> None:
    assert [column_of(name) for name in ("marker.x", "rate.rear", "contacts")] == [
        "marker.x_m", "rate.rear_rad_s", "contacts",
    ]  # fmt: skip
    assert all(is_position(name) for name in MARKER)
    assert not is_position(joint_signal("mid_left"))
    assert joint_signal("mid_left").partition(".")[0] in UNITS


def test_series_of_one_kind_keep_their_order() -> None:
    time = np.arange(3.0)
    signals = {"joint.b": time, "depth": -time, "joint.a": 2.0 * time}
    trajectory = Trajectory(time, signals)
    assert list(trajectory.named("joint")) == ["b", "a"]
    assert trajectory.stacked("joint").shape == (3, 2)
    assert trajectory.stacked("marker").shape == (3, 0)
    assert trajectory.to_csv().splitlines()[:2] == ["t_s,joint.b_rad,depth_m,joint.a_rad", "0.0,0.0,-0.0,0.0"]


def test_axes_are_a_rotation_with_forward_across_up() -> None:
    axes = Roles(forward=(1.0, 0.0, 1.0), up=(0.0, 0.0, 2.0)).axes
    assert axes == pytest.approx(np.eye(3))
    assert Roles().marker is None
