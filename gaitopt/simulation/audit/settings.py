"""Limits and effort of the audit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CheckSettings:
    """Limits and effort of the audit; every limit of effort is a count.

    Attributes:
        rest_s: how long the robot is held at its start, s.
        rest_marker_m_s: fastest marker of a robot at rest, m/s; required of the keyframe ``start``.
        rest_joint_rad_s: fastest joint of a robot at rest, rad/s: likewise.
        standing_tilt_rad: largest tilt of the trunk at the start, rad.
        standing_servo_rad: largest distance of a servo from its start target, rad: it holds the robot.
        fallen_rad: largest tilt of the trunk in a gait, rad: beyond, the robot fell over.
        parameter_change: factor by which a named parameter is multiplied, and then divided, to see whether it
            acts.
        parameter_at_zero: value tried instead for a parameter that is 0.
        parameter_s: shortest rollout in which it must act, s.
        airtime: largest share of time in flights.
        sideways_ratio: largest sideways over forward travel.
        reached: smallest share of its commanded travel that a joint goes through.
        nudge_rad: standard deviation of the start pose's change that shows chaos, rad.
        growth: largest ratio of the paths' distance to the nudge, in lengths of the path: without chaos, a
            perturbation of a millionth of a radian vanishes, or grows by less than this.
        timestep_change: largest change of the mean speed when the timestep is halved, as a share of it.
        timestep_floor_m_s: largest such change at any speed, m/s.
        motion_change: largest RMS change of the servos' angles when the timestep is divided by four, as a
            share of the RMS of their motion.
        motion_nudge_rad, motion_nudges: standard deviation and number of the changed start poses by which
            irregular motion is told from the timestep.
        motion_ratio: that change must be larger than this many times the mean of theirs.
        motion_step_budget: most steps of a rollout with the shortest timestep; longer gaits are left out.
        starts: perturbed starts of which the mean speed is taken.
        start_spread_rad: standard deviation of their poses, rad.
        step_budget: steps that the check of the timestep may take for a gait; a longer gait gets fewer
            starts, at least two.
    """

    rest_s: float = 5.0
    rest_marker_m_s: float = 1e-4
    rest_joint_rad_s: float = 1e-3
    standing_tilt_rad: float = 0.6
    standing_servo_rad: float = 0.35
    fallen_rad: float = 1.05
    parameter_change: float = 2.0
    parameter_at_zero: float = 1e-3
    parameter_s: float = 2.0
    airtime: float = 0.02
    sideways_ratio: float = 0.5
    reached: float = 0.95
    nudge_rad: float = 1e-6
    growth: float = 1e3
    timestep_change: float = 0.05
    timestep_floor_m_s: float = 5e-4
    motion_change: float = 0.03
    motion_nudge_rad: float = 1e-3
    motion_nudges: int = 3
    motion_ratio: float = 1.5
    motion_step_budget: int = 200_000
    starts: int = 16
    start_spread_rad: float = 5e-3
    step_budget: int = 500_000


DEFAULT = CheckSettings()
"""What `gaitopt check` uses."""
