"""Robots behind a function: a gait in, a film of it out, simulated by other numerics than a campaign uses."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from gaitopt.diagnose.record.trial import Trial
from gaitopt.effects.active import Tables
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.robot.signals import is_position
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario

OTHER = Fidelity(timestep_s=5e-4, integrator="implicit")
POSED = Scenario(start_pose_rad=0.002)


@dataclass
class Walker:
    """A robot that is filmed: each film begins from another start pose and has its own noise.

    Attributes:
        problem: the nominal robot.
        effects: what is different in truth.
        scenario: small errors of everything, and the spread of its start pose.
        fidelity: timestep and integrator.
        signals: what is measured.
        seconds: length of a film; four cycles at least.
        fps: frames per second.
        noise_m: standard deviation of positions, m; of angles 2 mrad.
        impratio: stiffness of the friction cones.
        films: how many were made.
    """

    problem: Problem
    effects: Mapping[str, Tables] = field(default_factory=dict)
    scenario: Scenario = POSED
    fidelity: Fidelity = OTHER
    signals: tuple[str, ...] = ("marker.x", "marker.y", "marker.z")
    seconds: float = 6.0
    fps: float = 50.0
    noise_m: float = 5e-4
    impratio: float | None = None
    films: int = 0

    def __call__(self, gait: Gait) -> Trial:
        """Return a film of a gait."""
        self.films += 1
        length = max(self.seconds, 4.0 * gait.period_s)
        path = self.walk(gait, length, self.films)
        rng = np.random.default_rng([7, self.films])
        time = np.arange(0.0, length, 1.0 / self.fps)
        signals = {}
        for name in self.signals:
            noise = (self.noise_m if is_position(name) else 2e-3) * rng.standard_normal(len(time))
            signals[name] = np.interp(time, path.time, path[name]) + noise
        trial = Trial.of(f"film {self.films}", gait, time, signals)
        return replace(trial, starts_at_s=0.0, fps=self.fps)

    def walk(self, gait: Gait, seconds: float, seed: int) -> Trajectory:
        """Return a walk as a camera sees it."""
        robot = self.robot(replace(self.scenario, pose_seed=seed))
        return robot.observe(robot.run(gait, duration=seconds))

    def robot(self, scenario: Scenario) -> Simulator:
        """Return the robot in truth."""
        robot = Simulator.build(self.problem.with_effects(self.effects), (scenario,), self.fidelity)
        if self.impratio is None:
            return robot
        model = copy.copy(robot.models[0])
        model.opt.impratio = self.impratio
        return robot.with_model(model)
