"""Signals of sites: positions and angles in the problem's axes, simulated where a data set asks for them."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import rigs
import tomli_w

from gaitopt.core.errors import GaitoptError
from gaitopt.core.files import csv_text
from gaitopt.diagnose.diagnosis import locate
from gaitopt.diagnose.record.dataset import DataSet, load_dataset
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.instruments import measurable_signals
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem
from gaitopt.robot.signals import is_position, site_signals, unit_of
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """An arm that a servo turns about -y; gravity is along -z. Without a marker."""
    return rigs.build(tmp_path_factory.mktemp("rig") / "arm", rigs.arm(gravity=0.0), {"hinges": ["elbow"]})


@pytest.fixture(scope="module")
def sideways(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """The same arm in a problem whose forward is y."""
    roles = {"hinges": ["elbow"], "forward": [0, 1, 0]}
    return rigs.build(tmp_path_factory.mktemp("rig") / "sideways", rigs.arm(gravity=0.0), roles)


def turned(problem: Problem, angle: float, seconds: float = 1.5) -> Trajectory:
    """The arm turned to an angle, its tip observed."""
    log = LoggedCommands.of(["turn"], [0.0], [[angle]]).recorded(seconds, 0.02, {"elbow": 0.0})
    path = Simulator.build(problem.observing(["tip"])).run(log)
    assert path.status == "ok"
    return path


def test_a_site_moves_and_turns_with_its_body(arm: Problem) -> None:
    path = turned(arm, 0.7)
    angle = path["joint.elbow"]
    np.testing.assert_allclose(path["site.tip.x"], 0.1 * np.cos(angle), atol=1e-9)
    np.testing.assert_allclose(path["site.tip.y"], 0.0, atol=1e-9)
    np.testing.assert_allclose(path["site.tip.z"], 1.0 + 0.1 * np.sin(angle), atol=1e-9)
    np.testing.assert_allclose(path["site.tip.pitch"], -angle, atol=1e-9)
    np.testing.assert_allclose(path["site.tip.roll"], 0.0, atol=1e-9)
    np.testing.assert_allclose(path["site.tip.yaw"], 0.0, atol=1e-9)


def test_its_axes_are_the_problems(arm: Problem, sideways: Problem) -> None:
    world, own = turned(arm, 0.7), turned(sideways, 0.7)
    np.testing.assert_allclose(own["site.tip.x"], world["site.tip.y"], atol=1e-9)
    np.testing.assert_allclose(own["site.tip.y"], -world["site.tip.x"], atol=1e-9)
    np.testing.assert_allclose(own["site.tip.z"], world["site.tip.z"], atol=1e-9)
    assert own["site.tip.yaw"][0] == pytest.approx(-0.5 * math.pi)


def test_angles_of_a_site_do_not_jump(tmp_path: Path) -> None:
    spinning = rigs.arm(gravity=0.0).replace('axis="0 -1 0"', 'axis="0 0 1"')
    problem = rigs.build(tmp_path / "arm", spinning, {"hinges": ["elbow"]})
    log = LoggedCommands.of(["turn"], [0.0], [[9.0]]).recorded(3.0, 0.02, {"elbow": 0.0})
    path = Simulator.build(problem.observing(["tip"])).run(log)
    assert path["joint.elbow"].max() > 2.0 * math.pi
    np.testing.assert_allclose(path["site.tip.yaw"], path["joint.elbow"], atol=1e-9)


def test_only_sites_that_are_asked_for_are_simulated(arm: Problem) -> None:
    log = LoggedCommands.of(["turn"], [0.0], [[0.3]])
    usual = Simulator.build(arm).run(log)
    assert usual.named("site") == {}
    observed = Simulator.build(carrying(arm.observing(["tip", "tip"]).with_effects({}))).run(log)
    assert list(observed.named("site")) == [name.removeprefix("site.") for name in site_signals("tip")]
    assert [name for name in observed.signals if not name.startswith("site.")] == list(usual.signals)
    assert all(np.array_equal(observed[name], usual[name]) for name in usual.signals)


def test_positions_of_sites_have_a_free_origin_and_their_angles_have_none() -> None:
    assert [is_position(name) for name in site_signals("a.b")] == [True] * 3 + [False] * 3
    assert [unit_of(name) for name in site_signals("a.b")] == ["m"] * 3 + ["rad"] * 3
    assert is_position("marker.x")
    assert not is_position("joint.x")


def written(
    folder: Path, signals: dict[str, str], columns: dict[str, np.ndarray], problem: Problem
) -> DataSet:
    """A data set of one trial of a log that is in the same table."""
    folder.mkdir(exist_ok=True)
    (folder / "one.csv").write_text(csv_text(columns))
    trial = {"name": "one", "commands": "one.csv", "file": "one.csv", "signals": signals}
    (folder / "dataset.toml").write_text(tomli_w.dumps({"trial": [trial]}))
    return load_dataset(folder, problem, measurable_signals(problem))


def test_a_right_model_of_a_site_has_no_gap(arm: Problem, tmp_path: Path) -> None:
    path = turned(arm, 0.7)
    rng = np.random.default_rng(1)
    rows = slice(None, None, 20)
    count = len(path.time[rows])
    columns = {
        "t_s": path.time[rows],
        "turn_rad": np.full(count, 0.7),
        "x_mm": 1e3 * path["site.tip.x"][rows] + 250.0 + 0.3 * rng.standard_normal(count),
        "pitch_deg": np.rad2deg(path["site.tip.pitch"][rows]) + 0.1 * rng.standard_normal(count) + 720.0,
        "elbow_rad": path["joint.elbow"][rows] + 1e-3 * rng.standard_normal(count),
    }
    signals = {"site.tip.x": "x_mm", "site.tip.pitch": "pitch_deg", "joint.elbow": "elbow_rad"}
    dataset = written(tmp_path / "data", signals, columns, arm)
    assert dataset.sites == ["tip"]
    with ThreadPoolExecutor(1) as executor:
        found = locate(Simulator.build(arm.observing(dataset.sites)), dataset, executor, 1)
    assert not found.trials[0].significant
    assert found.trials[0].aligned.rms("site.tip.x") < 5e-4
    assert found.trials[0].aligned.rms("site.tip.pitch") < 0.01


def test_an_unknown_site_gets_the_nearest_name(arm: Problem, tmp_path: Path) -> None:
    columns = {"t_s": np.arange(9) * 0.02, "turn_rad": np.zeros(9), "x_m": np.zeros(9)}

    def said(signal: str, column: str = "x_m") -> str:
        with pytest.raises(GaitoptError) as caught:
            written(tmp_path / "data", {signal: column}, columns, arm)
        return str(caught.value)

    assert said("site.tpi.x").endswith("unknown site 'tpi'; known: tip (nearest: 'tip')")
    assert "unknown signal 'site.tip.w'; known: site.tip.x, " in said("site.tip.w")
    assert "unknown signal 'elbow'; known: joint.elbow, site.NAME.x" in said("elbow")
    assert "ends in its unit, _rad, _deg" in said("site.tip.yaw")


def test_a_camera_sees_sites_scaled_and_tilted(tmp_path: Path) -> None:
    problem = rigs.build(tmp_path / "arm", rigs.arm(gravity=0.0), {"marker": "tip", "hinges": ["elbow"]})
    true = turned(problem, 0.7)
    for effect, value in (("camera_scale", {"scale": 1.1}), ("camera_tilt", {"angle_rad": 0.1})):
        simulator = Simulator.build(problem.observing(["tip"]).with_effects({effect: value}))
        seen = simulator.observe(true)
        for axis in "xyz":  # the axes are the world's, so the site is seen where the marker is
            np.testing.assert_allclose(seen[f"site.tip.{axis}"], seen[f"marker.{axis}"], atol=1e-9)
        # A level path seems to climb: what points forward is pitched up.
        tilt = value.get("angle_rad", 0.0)
        np.testing.assert_allclose(seen["site.tip.pitch"], true["site.tip.pitch"] - tilt, atol=1e-9)
