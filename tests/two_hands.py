"""What an effect does to the walking ArcFold, by the simulator and by code of another hand (`other_walk`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from other_hand import Planted
from other_walk import Errors, square, walk

from gaitopt.effects import EFFECTS
from gaitopt.effects.active import Values
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import Problem
from gaitopt.robot.signals import MARKER
from gaitopt.simulation.rollout import Simulator

GAIT, PERIOD_S, SECONDS = "square-2s", 2.0, 5.0

SIZES: Mapping[str, tuple[str, float]] = {
    "servo_torque_limit": ("all", 0.08),
    "servo_travel": ("all", 0.8),
    "servo_trim": ("foot1", 0.15),
    "servo_speed_limit": ("all", 2.0),
    "servo_lag": ("all", 0.1),
    "servo_gain": ("all", 0.3),
    "servo_damping": ("all", 2.0),
    "servo_inertia": ("all", 8e-4),
    "servo_backlash": ("foot2", 0.1),
    "servo_friction": ("all", 0.08),
    "servo_friction_load": ("all", 0.5),
    "servo_stiction": ("all", 0.08),
    "servo_sag": ("all", 0.6),
    "servo_deadband": ("all", 0.08),
    "servo_resolution": ("all", 0.05),
    "channel_timing": ("mid_act", 0.1),
    "command_latency": ("all", 0.1),
    "hinge_stiffness": ("all", 4.0),
    "hinge_nonlinearity": ("all", 0.007),
    "hinge_damping": ("all", 800.0),
    "hinge_friction": ("all", 0.01),
    "ground_slope": ("all", 0.08),
    "payload_mass": ("all", 0.05),
    "com_offset": ("all", 0.015),
    "link_inertia": ("all", 2.8),
    "geometry_scale": ("all", 1.1),
    "tether_drag": ("all", 0.15),
    "pad_friction": ("all", 0.5),
    "body_friction": ("all", 2.5),
    "pad_imbalance": ("all", 0.4),
    "contact_compliance": ("all", 3.0),
    "friction_anisotropy": ("all", 0.4),
    "friction_direction": ("all", 0.4),
    "friction_load": ("all", 0.6),
}
"""Target and size of each effect: near a bound of what is plausible."""


def by_simulator(problem: Problem, name: str | None = None) -> NDArray[np.float64]:
    """Return the marker's path with an effect or none, m, shape (n, 3)."""
    effects: dict[str, Values] = {}
    if name is not None:
        effect, (target, value) = EFFECTS[name], SIZES[name]
        effects[name] = {effect.parameter: value} | ({} if effect.target == "none" else {"target": target})
    path = Simulator.build(problem.with_effects(effects)).run(problem.baselines[GAIT], 0, SECONDS)
    return np.stack([path[signal] for signal in MARKER], axis=1)


def by_another_hand(problem: Problem, name: str | None = None) -> NDArray[np.float64]:
    """Return the same by the other code."""
    planted: Planted = {}
    if name is not None:
        target, value = SIZES[name]
        planted = {(name, target): value}
    return walk(nominal_mjcf(problem), planted, Errors(), square(PERIOD_S, SECONDS)).marker
