"""The servo on a bench: its rig is that of its figures, its numerics converge, and logs are all it needs."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from gaitopt.cli.app import main
from gaitopt.diagnose.record.commands import read_commands
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

OFF = math.nan
TIME = np.arange(0.0, 2.0, 0.02)
COMMANDS = {
    "step up": np.where(TIME < 0.1, 0.0, 1.7),
    "step down": np.where(TIME < 0.1, 0.0, -1.88),
    "small step": np.where(TIME < 0.1, 0.0, 0.05),
    "ramp": -0.47 * TIME,
    "chirp": 1.96 * np.sin(2.0 * math.pi * (0.2 * TIME + 0.7 * TIME**2)),
    "telegraph": 1.88 * np.sign(np.sin(20.0 * TIME + 1.0)),
    "drop": np.where(TIME < 0.2, 0.0, OFF),
}


@pytest.fixture(scope="module")
def bench() -> Problem:
    """The bundled bench."""
    return load_problem("servo-bench")


def played(problem: Problem, rows: np.ndarray, start: float = 0.0, timestep_s: float = 1e-3) -> Trajectory:
    """Simulate rows of commands at 50 Hz."""
    log = LoggedCommands.of(["servo"], TIME[: len(rows)], rows[:, None]).recorded(0.0, 0.02, {"arm": start})
    fidelity = problem.simulation.working.model_copy(update={"timestep_s": timestep_s})
    path = Simulator.build(problem, fidelity=fidelity).run(log)
    assert path.status == "ok"
    return path


def test_the_arm_has_the_mass_moment_and_inertia_of_the_rig(bench: Problem) -> None:
    model = build_model(bench)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert model.body_subtreemass[0] == pytest.approx(0.354)
    assert data.qfrc_bias[0] == pytest.approx(0.354 * 9.81 * 0.168)  # gravity pulls toward negative angles
    assert model.dof_M0[0] - model.dof_armature[0] == pytest.approx(0.0105)
    assert model.dof_armature[0] == 0.005
    assert (model.dof_frictionloss[0], model.dof_damping[0]) == (0.1, 0.0)


def test_the_servo_is_that_of_its_makers(bench: Problem) -> None:
    servo = build_model(bench).actuator("servo")
    assert servo.gainprm[0] == 25.0
    assert servo.biasprm[:3].tolist() == [0.0, -25.0, -5.0]
    assert servo.forcerange.tolist() == [-2.7, 2.7]
    assert int(servo.dyntype[0]) == int(mujoco.mjtDyn.mjDYN_FILTEREXACT)
    assert servo.dynprm[0] == 0.1
    assert bench.file.channels["servo"].servo.range_deg == pytest.approx((-135.0, 135.0))
    origins = [parameter.origin for parameter in bench.file.parameters.values()]
    assert all(origin.startswith(("measured:", "CAD:", "assumed")) for origin in origins)


def test_its_command_lags_by_a_tenth_of_a_second(bench: Problem) -> None:
    path = played(bench, np.full(50, 0.05))
    rest = path["joint.arm"], path["rate.servo"]
    asked = path["torque.servo"] / 25.0 + rest[0] + 5.0 / 25.0 * rest[1]  # what the gain acts on
    np.testing.assert_allclose(asked, 0.05 * (1.0 - np.exp(-path.time / 0.1)), atol=1e-3)


def test_an_unpowered_arm_swings_as_its_weight_and_friction_say(bench: Problem) -> None:
    path = played(bench, np.full(50, OFF))
    slope = np.polyfit(path.time[:50], path["joint.arm"][:50], 2)[0]
    assert 2.0 * slope == pytest.approx(-(0.354 * 9.81 * 0.168 - 0.1) / 0.0155, rel=0.01)
    assert not path["torque.servo"].any()


def test_dry_friction_holds_the_unpowered_arm(bench: Problem) -> None:
    rough = bench.with_parameters({"friction": 0.6})
    path = played(rough, np.full(100, OFF))
    assert abs(path["joint.arm"][-1]) < 2e-4  # under 0.58 N m


@pytest.mark.parametrize("kind", COMMANDS)
def test_a_smaller_timestep_changes_little(bench: Problem, kind: str) -> None:
    usual = played(bench, COMMANDS[kind])
    drop = 2.0 if kind == "drop" else 1.0  # where it comes to rest by friction is less certain
    for timestep_s, apart in ((5e-4, 2e-3 * drop), (1e-4, 4e-3 * drop)):
        finer = played(bench, COMMANDS[kind], timestep_s=timestep_s)
        angle = np.interp(usual.time, finer.time, finer["joint.arm"])
        assert np.abs(angle - usual["joint.arm"]).max() < apart


def test_no_joint_angle_is_beyond_the_stops(bench: Problem) -> None:
    freer = bench.with_parameters({"friction": 0.0})
    path = played(freer, np.full(100, OFF), start=2.0)
    assert path["joint.arm"].min() > math.radians(-136.0)


@pytest.fixture
def log() -> Path:
    """A log of a step, a cut of power and a return."""
    path = Path("log.csv")
    path.write_text("t_s,servo_deg\n0,0\n0.2,60\n1.0,\n1.4,0\n")
    return path


def test_a_log_is_simulated_and_its_result_is_a_log(
    bench: Problem, log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", "servo-bench", str(log), "--csv", "out.csv", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert (row["name"], row["period_s"], row["status"]) == ("log", None, "ok")
    assert not {"speed_m_s", "airtime", "tilt_rad"} & set(row)
    again = replace(read_commands(Path("out.csv"), bench), name="log")
    first = read_commands(log, bench)
    assert again.commands_key == first.commands_key
    usual, replayed = (Simulator.build(bench).run(drive, duration=1.8) for drive in (first, again))
    np.testing.assert_array_equal(usual["joint.arm"], replayed["joint.arm"])


def test_a_log_is_written_out_with_blank_cells_and_read_back(bench: Problem, log: Path) -> None:
    asked = ["command", "servo-bench", str(log), "--dt", "0.1", "--duration", "1.8", "--out", "sent.csv"]
    assert main(asked) == 0
    lines = Path("sent.csv").read_text().splitlines()
    assert lines[0] == "t_s,servo"
    assert lines[11].split(",")[1] == ""
    assert read_commands(Path("sent.csv"), bench).commands_key == read_commands(log, bench).commands_key


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("optimise servo-bench", "[gait]: missing; optimise needs it"),
        ("plan servo-bench", "no [planar] section, so nothing can be planned"),
        ("sweep servo-bench --over k_servo=20,30", "no baselines; name a gait"),
        ("compare servo-bench log.csv", "a CSV table, but no exported gait; allowed: a gait."),
        (
            "export servo-bench log.csv --format c --out e",
            "a CSV table, but no exported gait; allowed: a gait.",
        ),
        ("simulate servo-bench square-1s", "baselines: none"),
        (
            "simulate servo-bench log.csv --video a.mp4",
            "roles.marker: none, as the robot is held; a film needs it",
        ),
        (
            "blind make servo-bench --cases 1 --out b",
            "roles.marker: none, as the robot is held; blind make needs it",
        ),
    ],
)
def test_what_needs_a_gait_or_a_marker_says_so_in_one_line(
    asked: str, said: str, log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(asked.split()) == 1
    text = capsys.readouterr().err.strip()
    assert "\n" not in text
    assert said in text


def test_what_needs_neither_works(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["model", "servo-bench", "--out", "model.xml"]) == 0
    assert mujoco.MjModel.from_xml_path("model.xml").keyframe("start").act.tolist() == [0.0]
    assert main(["effects", "servo-bench", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out.partition("\n")[2])["rows"]
    applicable = {row["name"] for row in rows if row["applies"]}
    assert {"servo_torque_limit", "servo_gain", "servo_lag", "command_latency"} <= applicable
    assert "pad_friction" not in applicable
    assert main(["check", "servo-bench"]) == 0
