"""What a person sees first: is there ground, and does the robot stand on it?"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from gaitopt.gait.gait import Gait
from gaitopt.problem.start import start_targets
from gaitopt.robot.contact import can_touch
from gaitopt.robot.rotation import rotation_matrices
from gaitopt.robot.trajectory import Trajectory
from gaitopt.robot.tree import free_joint, in_water
from gaitopt.simulation.audit.finding import DOES_NOT_STAND, FELL_OVER, NO_GROUND, Finding
from gaitopt.simulation.audit.settings import CheckSettings
from gaitopt.simulation.metrics import Metrics
from gaitopt.simulation.rollout import Simulator


def check_ground(simulator: Simulator) -> Iterator[Finding]:
    """Find that a free robot has nothing to stand on."""
    model, parts = simulator.models[0], simulator.effects.nominal
    free = free_joint(model, parts.trunk) is not None
    if not free or in_water(model) or not np.any(model.opt.gravity):
        return
    own = set(range(model.ngeom)) - set(parts.surroundings)
    around = parts.static_surroundings
    if any(can_touch(model, geom, other) for geom in own for other in around):
        return
    paired = {int(model.pair_geom1[i]) for i in range(model.npair)}
    paired |= {int(model.pair_geom2[i]) for i in range(model.npair)}
    if not paired & set(around):
        what = "nothing around the robot collides with it" if around else "the MJCF has no ground"
        yield Finding(NO_GROUND.name, "", 0.0, 0.0, f"{what}, so it falls for ever")


def check_standing(simulator: Simulator, held: Trajectory, settings: CheckSettings) -> Iterator[Finding]:
    """Find that a robot lies instead of standing at its start, or that servos do not carry it.

    Args:
        simulator: the robot.
        held: the robot held at its start.
        settings: limits.
    """
    tilt, limit = float(tilts(simulator, held)[-1]), settings.standing_tilt_rad
    if not simulator.problem.file.start.held and tilt > limit:
        message = f"under its start targets the trunk lies, tilted by {math.degrees(tilt):.0f} degrees"
        yield Finding(DOES_NOT_STAND.name, "", tilt, limit, message)
    off, limit = {}, settings.standing_servo_rad
    for name, target in zip(simulator.problem.channel_names, start_targets(simulator.problem), strict=True):
        off[name] = abs(float(held[f"position.{name}"][-1]) - float(target))
    weak = [name for name, error in off.items() if error > limit]
    if weak:
        worst = max(weak, key=lambda name: off[name])
        more = f", and {len(weak) - 1} more servos are off" if len(weak) > 1 else ""
        message = f"{worst} rests {math.degrees(off[worst]):.0f} degrees from its start target{more}"
        yield Finding(DOES_NOT_STAND.name, "", off[worst], limit, message)


def check_upright(gait: Gait, metrics: Metrics, settings: CheckSettings) -> Iterator[Finding]:
    """Find that a robot fell over in a gait."""
    tilt, limit = metrics.get("tilt_rad", 0.0), settings.fallen_rad
    if tilt > limit:
        message = f"it fell over: the trunk tilts by up to {math.degrees(tilt):.0f} degrees"
        yield Finding(FELL_OVER.name, gait.name, tilt, limit, message)


def tilts(simulator: Simulator, trajectory: Trajectory) -> np.ndarray:
    """Return the angle between the trunk's up axis and up at each sample, rad, shape (n,)."""
    up = simulator.problem.roles.axes[2]
    turns = rotation_matrices(*(trajectory[f"heading.{part}"] for part in "wxyz"))
    angles: np.ndarray = np.arccos(np.clip((turns @ up) @ up, -1.0, 1.0))
    return angles
