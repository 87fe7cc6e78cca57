"""What each effect does to the walking ArcFold, by `gaitopt` and by code of another hand (`other_walk`).

    python tests/studies/other_effects.py --out results/effects

Cost: about 3 minutes of one core.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))

from other_walk import Errors, square, walk

from gaitopt.core.files import write_text
from gaitopt.effects import EFFECTS
from gaitopt.effects.active import Values
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.robot.signals import MARKER
from gaitopt.simulation.rollout import Simulator

GAIT, PERIOD_S, SECONDS = "square-2s", 2.0, 5.0

SIZES: Mapping[tuple[str, str], float] = {
    ("servo_torque_limit", "all"): 0.08,
    ("servo_travel", "all"): 0.8,
    ("servo_trim", "foot1"): 0.15,
    ("servo_speed_limit", "all"): 2.0,
    ("servo_lag", "all"): 0.1,
    ("servo_gain", "all"): 0.3,
    ("servo_damping", "all"): 2.0,
    ("servo_inertia", "all"): 8e-4,
    ("servo_backlash", "foot2"): 0.1,
    ("servo_friction", "all"): 0.08,
    ("servo_friction_load", "all"): 0.5,
    ("servo_stiction", "all"): 0.08,
    ("servo_sag", "all"): 0.6,
    ("servo_deadband", "all"): 0.08,
    ("servo_resolution", "all"): 0.05,
    ("channel_timing", "mid_act"): 0.1,
    ("command_latency", "all"): 0.1,
    ("hinge_stiffness", "all"): 4.0,
    ("hinge_nonlinearity", "all"): 0.007,
    ("hinge_damping", "all"): 800.0,
    ("hinge_friction", "all"): 0.01,
    ("ground_slope", "all"): 0.08,
    ("payload_mass", "all"): 0.05,
    ("com_offset", "all"): 0.015,
    ("link_inertia", "all"): 2.8,
    ("geometry_scale", "all"): 1.1,
    ("tether_drag", "all"): 0.15,
    ("pad_friction", "all"): 0.5,
    ("body_friction", "all"): 2.5,
    ("pad_imbalance", "all"): 0.4,
    ("contact_compliance", "all"): 3.0,
    ("friction_anisotropy", "all"): 0.4,
    ("friction_direction", "all"): 0.4,
    ("friction_load", "all"): 0.6,
}
"""A size of each effect, by its name and target: near a bound of what is plausible."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    problem = load_problem("arcfold")
    mjcf, rows = nominal_mjcf(problem), square(PERIOD_S, SECONDS)
    nominal = way(problem, {})
    again = from_start(walk(mjcf, {}, Errors(), rows).marker)
    lines = [
        f"Nominal robots are {1e3 * apart(nominal, again):.2f} mm apart.",
        "",
        "| effect | value | moves the marker by, mm | the two are apart by, mm |",
        "|---|---|---|---|",
    ]
    for (name, target), value in SIZES.items():
        effect = EFFECTS[name]
        values: Values = {effect.parameter: value} | ({} if effect.target == "none" else {"target": target})
        own = way(problem, {name: values})
        other = from_start(walk(mjcf, {(name, target): value}, Errors(), rows).marker)
        of = "" if target == "all" else f" of {target}"
        figures = f"{1e3 * apart(own, nominal):.1f} | {1e3 * apart(own, other):.1f}"
        lines.append(f"| {name}{of} | {value:g} {effect.unit} | {figures} |")
        print(lines[-1], flush=True)
    write_text(options.out / "other-hand.md", "\n".join(lines) + "\n")


def way(problem: Problem, effects: Mapping[str, Values]) -> NDArray[np.float64]:
    """Return the marker's way from its start, m, by the simulator."""
    path = Simulator.build(problem.with_effects(effects)).run(problem.baselines[GAIT], 0, SECONDS)
    return from_start(np.stack([path[name] for name in MARKER], axis=1))


def from_start(marker: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a path from its first point, m."""
    return marker - marker[0]


def apart(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return the RMS distance of two paths, m."""
    return math.sqrt(float(np.mean(np.sum((one - other) ** 2, axis=1))))


if __name__ == "__main__":
    main()
