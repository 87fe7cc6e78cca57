"""Small test rigs: one mechanism each, in its own problem folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import tomli_w

from gaitopt.problem.problem import Problem, load_problem
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

Make = Callable[..., Problem]

IDLE = """
<body name="idle" pos="0 0 5"><joint name="idle" type="hinge" axis="0 1 0" armature="1e-4" damping="0.01"/>
<geom type="sphere" size="0.001" mass="1e-6" contype="0" conaffinity="0"/></body>"""
"""A servo without effect, for rigs that need none."""

IDLE_SERVO = '<position name="turn" joint="idle" kp="1" forcerange="-1 1"/>'


def arm(gravity: float = 9.81, damping: float = 0.02, armature: float = 1e-4) -> str:
    """An arm of 0.1 kg at 0.1 m on a servo of 2 N m/rad and 0.5 N m; positive angles lift it."""
    return f"""
<mujoco><option gravity="0 0 {-gravity}"/><worldbody>
  <body name="arm" pos="0 0 1">
    <joint name="elbow" type="hinge" axis="0 -1 0" damping="{damping}" armature="{armature}"/>
    <inertial pos="0.1 0 0" mass="0.1" diaginertia="1e-3 1e-3 1e-3"/>
    <geom name="tip" type="sphere" pos="0.1 0 0" size="0.005" contype="0" conaffinity="0"/>
    <site name="tip" pos="0.1 0 0"/>
  </body>
</worldbody>
<actuator><position name="turn" joint="elbow" kp="2" forcerange="-0.5 0.5"/></actuator></mujoco>"""


TWO = ("turn", "other")
"""The servos of `twins`."""


def twins(
    inertia: float = 1e-3, load: float = 0.0, joint: str = "", servo: str = 'kp="2" forcerange="-0.5 0.5"'
) -> str:
    """Two equal wheels on the servos `TWO`.

    Args:
        inertia: about the axis, kg m^2.
        load: torque of gravity that turns each wheel backward at angle 0, N m.
        joint, servo: attributes of each joint and each actuator.
    """
    mass = 1e4 / 9.81 if load else 1e-6
    wheel = f"""
<body name="{{0}}" pos="0 {{1}} 1"><joint name="{{0}}" type="hinge" axis="0 -1 0" {joint}/>
<inertial pos="{1e-4 * load} 0 0" mass="{mass}" diaginertia="1e-9 {inertia} {inertia}"/>
<site name="{{0}}" pos="0.1 0 0"/></body>"""
    wheels = wheel.format("wheel", 0.0) + wheel.format("idler", 1.0)
    servos = "".join(
        f'<position name="{name}" joint="{turned}" {servo}/>'
        for name, turned in zip(TWO, ("wheel", "idler"), strict=True)
    )
    return f"<mujoco><worldbody>{wheels}</worldbody><actuator>{servos}</actuator></mujoco>"


def flaps(gravity: float = 9.81, damping: float = 0.01, qpos: str = "") -> str:
    """Two flaps, left and right, of 0.02 kg at 0.1 m on springs of 0.2 N m/rad; positive angles lift them."""
    flap = """
<body name="{0}" pos="0 {1} 0"><joint name="{0}" type="hinge" axis="0 -1 0" stiffness="0.2" damping="{2}"/>
<inertial pos="0.1 0 0" mass="0.02" diaginertia="1e-9 1e-9 1e-9"/><site name="{0}" pos="0.1 0 0"/></body>"""
    sides = flap.format("left", 0.05, damping) + flap.format("right", -0.05, damping)
    key = f'<keyframe><key name="start" qpos="{qpos}"/></keyframe>' if qpos else ""
    return f"""
<mujoco><option gravity="0 0 {-gravity}"/><worldbody><body name="frame" pos="0 0 1">
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{sides}</body>{IDLE}</worldbody>
<actuator>{IDLE_SERVO}</actuator>{key}</mujoco>"""


def sled(gravity: str = "0 0 -9.81", contact: str = 'condim="3" friction="0.2"', fore: float = 0.0) -> str:
    """A sled of 1 kg on runners 0.2 m apart, its centre of mass at the ground's height, `fore` ahead."""
    return f"""
<mujoco><option gravity="{gravity}" cone="elliptic" impratio="100"/>
<default><geom priority="1" contype="1" conaffinity="0" {contact}/></default>
<worldbody>
  <geom name="ground" type="plane" size="50 50 1" contype="0" conaffinity="1" priority="0" friction="1"/>
  <body name="sled" pos="0 0 0.01"><freejoint/>
    <inertial pos="{fore} 0 -0.01" mass="1" diaginertia="0.02 0.02 0.02"/>
    <geom name="front" type="box" size="0.01 0.1 0.01" pos="0.1 0 0"/>
    <geom name="rear" type="box" size="0.01 0.1 0.01" pos="-0.1 0 0"/>
    <site name="nose" pos="0 0 0"/>
  </body>{IDLE}
</worldbody><actuator>{IDLE_SERVO}</actuator></mujoco>"""


def build(
    folder: Path,
    mjcf: str,
    roles: Mapping[str, object],
    settle: bool = True,
    servos: Sequence[str] = ("turn",),
) -> Problem:
    """Write a rig into a problem folder and load it."""
    folder.mkdir()
    (folder / "rig.xml").write_text(mjcf)
    fidelity = {"timestep_s": 1e-3, "integrator": "implicitfast"}
    wave = {"duty": 0.5, "phase": 0.0, "amplitude_deg": 0.0}
    content = {
        "name": "rig",
        "roles": roles,
        "start": {"settle": settle},
        "gait": {"period_s": [0.25, 5.0]},
        "channels": {name: {"range_deg": [-90.0, 90.0], "amplitude_deg": [0.0, 90.0]} for name in servos},
        "baselines": {"still": {"period_s": 1.0, "channels": dict.fromkeys(servos, wave)}},
        "simulation": {"working": fidelity, "reference": fidelity},
        "objective": {"terms": {"speed_m_s": -1.0}},
    }
    (folder / "problem.toml").write_text(tomli_w.dumps(content))
    return load_problem(folder)


def hold(problem: Problem, target: float, seconds: float, **effects: Mapping[str, float | str]) -> Trajectory:
    """Simulate a constant command, rad, on a rig with effects; each is ``name=dict(parameter=value)``."""
    simulator = Simulator.build(problem.with_effects(effects))
    time = simulator.clock(seconds)
    trajectory = simulator.play(time, np.full((len(time), len(problem.channel_names)), target))
    assert trajectory.status == "ok"
    return trajectory


def acceleration(trajectory: Trajectory, axis: str, begin: float = 0.2) -> float:
    """The constant acceleration of the marker along an axis from a time on, m/s^2."""
    late = trajectory.time >= begin
    quadratic = np.polyfit(trajectory.time[late], trajectory[f"marker.{axis}"][late], 2)
    return 2.0 * float(quadratic[0])
