"""Tolerances: how far a robot, its floor and its camera may be off in everything that is not quite known."""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import Field

from gaitopt.core.validation import PLAIN_NUMBER
from gaitopt.problem.fields import FileRecord

WIDEST = math.sqrt(3.0)
"""Standard deviations from the middle to the end of a uniform draw."""

Relative = Annotated[float, Field(ge=0.0, lt=0.577), PLAIN_NUMBER]
"""Standard deviation of a factor; a uniform draw then stays above 0."""

Degrees = Annotated[float, Field(ge=0.0, le=30.0), PLAIN_NUMBER]


class Tolerances(FileRecord):
    """Standard deviation of each small error of a robot.

    Errors are drawn uniformly, so none is larger than 1.73 times its tolerance: a bound from a datasheet,
    ±10 %, is a tolerance of 0.058. Each part has its own error where a name ends in ``each``; every servo has
    its own trim, every trial its own start pose.

    Attributes:
        friction: relative error of every friction coefficient together: ±15 % between floors and days
            (assumed).
        friction_each: relative error of one geom's friction: ±5 %, repeats of a test on an inclined plane
            (assumed).
        servo_strength: relative error of every servo's torque limit together: ±10 %, a supply of 4.8 ± 0.5 V.
        servo_strength_each: relative error of one servo's torque limit: ±5 % between parts (assumed).
        servo_gain_each: relative error of one servo's gain: ±10 %, the usual tolerance of the ceramic
            capacitor that sets it in an analogue servo.
        servo_damping_each: relative error of one servo's damping, which is stall torque over no-load speed:
            ±10 %, as catalogues of small brushed motors allow.
        servo_trim_deg: zero error of each servo: a horn is mounted by eye to ±2 degrees.
        mass_each: relative error of one body's mass: a kitchen scale that reads 0.1 g, on parts of 3 g.
        hinge_stiffness_each: relative error of one passive hinge's stiffness: hinges of one sheet (assumed).
        slope_deg: slope of the floor, forward and sideways: ±0.3 degrees, the level of a phone.
        start_pose_rad: error of each joint's start angle and of the heading, rad: ±0.5 degrees, set by eye.
        camera_scale: relative error of the film's scale: ±1 %, a ruler 10 mm behind the robot, seen from 1 m.
        camera_tilt_deg: error of the camera's level: ±0.5 degrees, the level of a phone, held to its edge.
        clock_offset_s: error of the moment at which a recording says that it starts, s: half a frame at 30
            frames a second.
        tag_place_mm, tag_turn_deg: where a tag sits on its body, along each axis, and how it is turned: ±1 mm
            and ±1 degree, glued by eye to a line.
        clock_rate: relative error of a film's clock: 29.97 frames a second, taken for 30.
    """

    friction: Relative = 0.087
    friction_each: Relative = 0.03
    servo_strength: Relative = 0.058
    servo_strength_each: Relative = 0.03
    servo_gain_each: Relative = 0.06
    servo_damping_each: Relative = 0.06
    servo_trim_deg: Degrees = 1.15
    mass_each: Relative = 0.02
    hinge_stiffness_each: Relative = 0.05
    slope_deg: Degrees = 0.17
    start_pose_rad: Annotated[float, Field(ge=0.0, le=0.5), PLAIN_NUMBER] = 0.005
    camera_scale: Relative = 0.006
    camera_tilt_deg: Degrees = 0.3
    clock_offset_s: Annotated[float, Field(ge=0.0, le=1.0), PLAIN_NUMBER] = 0.01
    clock_rate: Relative = 0.0006
    tag_place_mm: Annotated[float, Field(ge=0.0, le=50.0), PLAIN_NUMBER] = 0.6
    tag_turn_deg: Degrees = 0.6


_MOVED = {
    "friction": WIDEST,
    "servo_strength": WIDEST,
    "servo_trim_deg": WIDEST,
    "start_pose_rad": 1.0,
}
"""Keys that files before version 0.2 have in ``[scenarios]``, where most were half the width of a draw;
how many of these are one standard deviation."""


def with_moved_tolerances(values: Any) -> Any:
    """Return the content of a problem file with the tolerances that older files have in ``[scenarios]``.

    Raises:
        ValueError: one of them stands in ``[tolerances]``, too; pydantic makes it an error of the file.
    """
    if not isinstance(values, dict):
        return values
    tables = [values.get(name, {}) for name in ("scenarios", "tolerances")]
    if not all(isinstance(table, dict) for table in tables):
        return values
    scenarios, tolerances = (dict(table) for table in tables)
    for key, per_deviation in _MOVED.items():
        found = scenarios.get(key)
        if isinstance(found, bool) or not isinstance(found, (int, float)):
            continue
        if key in tolerances:
            raise ValueError(f"scenarios.{key}: found {found:g}; allowed: {key} in [tolerances] alone")
        tolerances[key] = scenarios.pop(key) / per_deviation
    return values | {"scenarios": scenarios, "tolerances": tolerances}
