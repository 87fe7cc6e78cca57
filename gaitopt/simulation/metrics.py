"""What a gait achieved: plain numbers, each with its unit in its name, from one trajectory."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.trajectory import Trajectory

Metrics = dict[str, float]
"""Metric name to value; the names are the keys of `METRICS`."""

METRICS = {
    "speed_m_s": "net forward speed of the marker over whole cycles",
    "stride_m": "net forward travel per cycle",
    "sideways_m_s": "net sideways speed, left positive",
    "sideways_ratio": "sideways over forward travel, in size; at most 10",
    "yaw_rate_rad_s": "net turning rate, left positive",
    "tilt_rad": "largest tilt of the first body",
    "slip_m": "backward slip of loaded pads per cycle, summed over pads",
    "airtime": "share of time in flights without any contact with the world that last over 10 ms",
    "penetration_m": "deepest penetration of the ground",
    "peak_torque_n_m": "largest servo torque",
    "rms_torque_n_m": "root mean square of the servo torques, largest of the servos",
    "power_w": "mean mechanical power at the servos' shafts; braking costs nothing and returns nothing",
    "cost_of_transport": "energy per weight and forward distance; inf when it does not go forward",
    "command_speed_ratio": "commanded peak speed over the servo's no-load speed, largest of the servos",
    "reached": "share of the commanded travel that is reached, smallest of the servos",
}
"""Every metric with what it says. ``reached.CHANNEL`` comes beside ``reached``, per channel."""

OF_THE_MARKER = ("speed_m_s", "stride_m", "sideways_m_s", "sideways_ratio", "cost_of_transport")
"""Metrics of the robot's travel, which a problem without ``roles.marker`` does not have."""

LOADED = 0.05
"""A pad that carries less than this share of the robot's weight does not count as anchored."""

_BOUNCE_S = 0.01
"""Shorter gaps are a contact's chatter: a body in free flight rises g t^2 / 8 = 0.12 mm in them."""

_MAX_RATIO = 10.0


def metric_names(problem: Problem) -> list[str]:
    """Return the names of a problem's metrics, in the order in which `measure` gives them."""
    left_out = () if problem.roles.marker else OF_THE_MARKER
    return [*(n for n in METRICS if n not in left_out), *(f"reached.{n}" for n in problem.channel_names)]


def measure(problem: Problem, gait: Gait, trajectory: Trajectory, robot: Robot) -> Metrics:
    """Return the metrics of the measured cycles of a rollout.

    Args:
        problem: the problem, for its horizon and axes.
        gait: the gait that was played.
        trajectory: the rollout, from gait time 0 to at least the end of the horizon.
        robot: weight and servo limits.

    Returns:
        Metric by name. A trajectory that is not ``ok`` has NaN throughout.
    """
    if trajectory.status != "ok":
        return dict.fromkeys(metric_names(problem), math.nan)
    transient, measured = problem.simulation.horizon.cycles(gait.period_s)
    begin, end = transient * gait.period_s, (transient + measured) * gait.period_s
    window = slice(*np.searchsorted(trajectory.time, (begin - 1e-9, end - 1e-9)).tolist())
    travel = _travel(problem, trajectory, begin, end) if problem.roles.marker else (math.nan, math.nan)
    speed, sideways = travel[0] / (end - begin), travel[1] / (end - begin)
    reached = _reached(gait, trajectory, window)
    torque = trajectory.stacked("torque")[window]
    rate = trajectory.stacked("rate")[window]
    shaft_torque = torque - robot.damping * rate
    power = float(np.maximum(shaft_torque * rate, 0.0).sum(axis=1).mean())
    limited = np.isfinite(robot.no_load_speed)
    with np.errstate(over="ignore"):  # a square wave in all but name
        peaks = gait.peak_command_speed()[limited] / robot.no_load_speed[limited]
    depth = trajectory["depth"][window]
    values = {
        "speed_m_s": speed,
        "stride_m": speed * gait.period_s,
        "sideways_m_s": sideways,
        "sideways_ratio": _ratio(abs(sideways), abs(speed)),
        "yaw_rate_rad_s": _yaw_rate(problem, trajectory, window),
        "tilt_rad": _tilt(problem, trajectory, window),
        "slip_m": _backward_slip(problem, trajectory, window, robot.weight) / measured,
        "airtime": _airtime(trajectory.time[window], trajectory["contacts"][window]),
        "penetration_m": float(max(0.0, -depth.min(initial=0.0))),
        "peak_torque_n_m": float(np.abs(torque).max(initial=0.0)),
        "rms_torque_n_m": float(np.sqrt((torque**2).mean(axis=0)).max(initial=0.0)),
        "power_w": power,
        "cost_of_transport": power / (robot.weight * speed) if robot.weight * speed > 0.0 else math.inf,
        "command_speed_ratio": float(peaks.max(initial=0.0)),
        "reached": min(reached.values(), default=1.0),
    }
    values |= {f"reached.{name}": share for name, share in reached.items()}
    return {name: values[name] for name in metric_names(problem)}


def mean_metrics(rows: list[Metrics]) -> Metrics:
    """Return the mean of each metric over scenarios; of signed drifts, the mean size."""
    sizes = {"sideways_m_s", "yaw_rate_rad_s"}
    return {
        name: float(np.mean([abs(row[name]) if name in sizes else row[name] for row in rows]))
        for name in rows[0]
    }


def axes(problem: Problem) -> NDArray[np.float64]:
    """Return forward, left and up as the rows of a (3, 3) rotation; see `Roles.axes`."""
    return problem.roles.axes


def _travel(problem: Problem, trajectory: Trajectory, begin: float, end: float) -> tuple[float, float]:
    """Return net forward and leftward travel of the marker between two times, m."""
    marker = [np.interp((begin, end), trajectory.time, trajectory[f"marker.{axis}"]) for axis in "xyz"]
    forward, left, _ = axes(problem) @ np.diff(marker, axis=1)[:, 0]
    return float(forward), float(left)


def _ratio(above: float, below: float) -> float:
    return min(above / below, _MAX_RATIO) if below > 0.0 else _MAX_RATIO


def _rotation(trajectory: Trajectory, window: slice) -> NDArray[np.float64]:
    """Return the rotation matrices of the first body, shape (n, 3, 3)."""
    w, x, y, z = (trajectory[f"heading.{part}"][window] for part in "wxyz")
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def _yaw_rate(problem: Problem, trajectory: Trajectory, window: slice) -> float:
    """Return the net turning rate about up: how fast the first body's forward axis turns, rad/s."""
    forward, left, _ = axes(problem)
    ends = slice(window.start, window.stop, max(1, (window.stop - window.start) // 200))
    pointing = _rotation(trajectory, ends) @ forward
    yaw = np.unwrap(np.arctan2(pointing @ left, pointing @ forward))
    time = trajectory.time[ends]
    return float((yaw[-1] - yaw[0]) / (time[-1] - time[0]))


def _tilt(problem: Problem, trajectory: Trajectory, window: slice) -> float:
    """Return the largest angle between the first body's up axis and up, rad."""
    up = axes(problem)[2]
    every = slice(window.start, window.stop, 5)
    cosine = (_rotation(trajectory, every) @ up) @ up
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)).max(initial=0.0))


def _airtime(time: NDArray[np.float64], contacts: NDArray[np.float64]) -> float:
    """Return the share of time spent in flights longer than a bounce."""
    flying = np.concatenate([[False], contacts == 0.0, [False]])
    begins, ends = np.flatnonzero(flying[1:] & ~flying[:-1]), np.flatnonzero(flying[:-1] & ~flying[1:])
    step = (time[-1] - time[0]) / max(1, len(time) - 1)
    flights = (ends - begins) * step
    return float(flights[flights > _BOUNCE_S].sum() / (len(time) * step))


def _backward_slip(problem: Problem, trajectory: Trajectory, window: slice, weight: float) -> float:
    """Return how far the pads slid backward while they carried load, m, summed over pads."""
    forward, _, up = axes(problem)
    time = trajectory.time[window]
    step = (time[-1] - time[0]) / max(1, len(time) - 1)
    slip = 0.0
    for pad in problem.roles.pads:
        load = sum(up[i] * trajectory[f"load.{pad}.{axis}"][window] for i, axis in enumerate("xyz"))
        speed = sum(
            forward[i] * trajectory[f"pad_speed.{pad}.{axis}"][window] for i, axis in enumerate("xyz")
        )
        anchored = np.abs(load) > LOADED * weight
        slip += float(np.maximum(-speed, 0.0)[anchored].sum()) * step
    return float(slip)


def _reached(gait: Gait, trajectory: Trajectory, window: slice) -> Mapping[str, float]:
    """Return per channel the share of the commanded travel that the joint goes through."""
    shares = {}
    for name in gait.channels:
        target = trajectory[f"target.{name}"][window]
        position = trajectory[f"position.{name}"][window]
        low, high = float(target.min()), float(target.max())
        inside = np.clip(position, low, high)
        travel = high - low
        shares[name] = float(inside.max() - inside.min()) / travel if travel > 0.0 else 1.0
    return shares
