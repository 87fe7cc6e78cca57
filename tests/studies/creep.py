"""Does a robot that should stand still creep, and how much does that depend on the contact's settings?

    python tests/studies/creep.py --out results/convergence

For each choice of the contact and each pose, the robot is moved into the pose and comes to rest. Then its
first body is pulled with a fifth of the robot's weight, less than half of the force that friction can hold.
Writes creep.csv.

Cost: 30 s of two cores.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import mujoco
import numpy as np
from convergence import NOMINAL, Choice, contact_stiffness, figure, fingerprint
from kept_table import KeptTable, Row
from numpy.typing import NDArray

from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.problem.start import START

PULL = 0.2
"""Share of the robot's weight; the body's friction coefficient is 0.43."""

RAMP_S = 1.0
PULL_FROM_S = 2.5
MEASURED_FROM_S = 4.0
END_S = 8.0

RIGHT_ANGLE = np.pi / 2.0
POSES = {
    "flat": (0.0, 0.0, 0.0),
    "rear pad": (0.0, -RIGHT_ANGLE, 0.0),
    "front pad": (0.0, 0.0, -RIGHT_ANGLE),
    "both pads": (0.0, -RIGHT_ANGLE, -RIGHT_ANGLE),
    "bent, rear pad": (RIGHT_ANGLE, -RIGHT_ANGLE, 0.0),
}
"""Targets of the middle hinge and the two feet, rad. Flat is the start of every gait."""

ALONE, FORWARD, SIDEWAYS = (0.0, 0.0), (1.0, 0.0), (0.0, 1.0)

CHOICES = (
    NOMINAL,
    Choice("impratio 1", mjcf={"option/@impratio": "1"}),
    Choice("impratio 100", mjcf={"option/@impratio": "100"}),
    Choice("solref 0.02", mjcf=contact_stiffness(0.02)),
    Choice("solref 0.005", mjcf=contact_stiffness(0.005)),
    Choice("pyramidal, impratio 1", mjcf={"option/@cone": "pyramidal", "option/@impratio": "1"}),
    Choice("pyramidal, impratio 10", mjcf={"option/@cone": "pyramidal"}),
)


class Standing:
    """A robot that is brought into a pose and then held, perhaps under a pull.

    Attributes:
        velocity: mean velocity of the marker while it is measured, m/s, shape (3,).
        marker_speed, joint_speed: largest in that time, m/s and rad/s.
        penetration: deepest contact at the end, m.
    """

    def __init__(self, problem: Problem, pose: tuple[float, ...], pull: tuple[float, float]):
        self.model = build_model(problem)
        self.data = mujoco.MjData(self.model)
        self.marker = self.model.site(problem.marker).id
        mujoco.mj_resetDataKeyframe(self.model, self.data, self.model.keyframe(START).id)
        force = PULL * Robot.of(self.model).weight * np.array(pull)
        begin = np.zeros(3)
        self.marker_speed = self.joint_speed = 0.0
        steps = round(END_S / self.model.opt.timestep)
        measured_from = round(MEASURED_FROM_S / self.model.opt.timestep)
        for step in range(steps):
            self.data.ctrl[:] = np.array(pose) * min(1.0, self.data.time / RAMP_S)
            if self.data.time > PULL_FROM_S:
                self.data.xfrc_applied[1, :2] = force
            mujoco.mj_step(self.model, self.data)
            if step == measured_from:
                begin = self.position()
            if step >= measured_from:
                self.observe()
        duration = (steps - 1 - measured_from) * self.model.opt.timestep
        self.velocity = (self.position() - begin) / duration
        self.penetration = -min((float(c.dist) for c in self.data.contact), default=0.0)

    def position(self) -> NDArray[np.float64]:
        """Return where the marker is, m."""
        return np.array(self.data.site_xpos[self.marker])

    def observe(self) -> None:
        """Update the largest speeds."""
        velocity = np.empty(6)
        kind = mujoco.mjtObj.mjOBJ_SITE
        mujoco.mj_objectVelocity(self.model, self.data, kind, self.marker, velocity, 0)
        self.marker_speed = max(self.marker_speed, float(np.linalg.norm(velocity[3:])))
        self.joint_speed = max(self.joint_speed, float(np.abs(self.data.qvel[6:]).max()))


def stand(problem: Problem, pose: tuple[float, ...]) -> Row:
    """Return the table's row about one pose."""
    alone, forward, sideways = (Standing(problem, pose, pull) for pull in (ALONE, FORWARD, SIDEWAYS))
    return {
        "unpulled_mm_s": figure(1e3 * abs(alone.velocity[0]), 2),
        "pulled_forward_mm_s": figure(1e3 * forward.velocity[0], 2),
        "pulled_sideways_mm_s": figure(1e3 * sideways.velocity[1], 2),
        "penetration_mm": figure(1e3 * alone.penetration, 2),
        "unpulled_fastest_marker_mm_s": figure(1e3 * alone.marker_speed, 2),
        "unpulled_fastest_joint_rad_s": figure(alone.joint_speed, 2),
    }


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    table = KeptTable(options.out / "creep.csv", ("contact", "pose", "model"))
    for choice in CHOICES:
        problem = choice.problem()
        model = fingerprint(problem)
        for name, pose in POSES.items():
            key = {"contact": choice.name, "pose": name, "model": model}

            def row(problem: Problem = problem, pose: tuple[float, ...] = pose) -> list[Row]:
                return [stand(problem, pose)]

            table.fill(key, row)


if __name__ == "__main__":
    main()
