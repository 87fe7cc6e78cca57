"""What a rollout achieved: plain numbers, each with its unit in its name, from its measured window.

A metric is one record here: its formula, what it says, and its title. The objective, the journal, the
tables and the pages take all of it from the record. To add one, write the record and its formula here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gaitopt.gait.drive import Drive
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.signals import MARKER
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.window import Window

Metrics = dict[str, float]
"""Metric name to value; the names are those of `metric_names`."""

LOADED = 0.05
"""A pad that carries less than this share of the robot's weight does not count as anchored."""

_BOUNCE_S = 0.01
"""Shorter gaps are a contact's chatter: a body in free flight rises g t^2 / 8 = 0.12 mm in them."""

_MAX_RATIO = 10.0
"""Largest ``sideways_ratio``."""

_YAW_SAMPLES = 200
"""About this many samples of the heading count for the turning rate: it turns slowly."""

_TILT_SAMPLE = 5
"""One sample in this many counts for the tilt."""


@dataclass(frozen=True)
class Metric:
    """One figure of a rollout.

    Attributes:
        name: its name, with the unit as suffix: a key of `Metrics` and of JSON.
        meaning: its meaning, in one line.
        formula: returns its value from the measured window of a rollout that went well.
        title: its title for readers, without unit; by default the name in words.
        share: whether it is a share of 1, shown in per cent.
        drift: whether it has a sign that scenarios cancel, so that means take its size.
        per_cycle: whether it is of one cycle, and left out where nothing repeats.
        of_marker: whether it is of the marker's travel, and left out without ``roles.marker``.
        of_ground: whether it is of how the robot stands on the ground, and left out where it is held.
        harmless: whether a gait that breaks a limit on it harms nothing: it is of where and how well the
            robot walks.
        needs: field of the objective that it needs, if any.
    """

    name: str
    meaning: str
    formula: Callable[[Window], float]
    title: str = ""
    share: bool = False
    drift: bool = False
    per_cycle: bool = False
    of_marker: bool = False
    of_ground: bool = False
    harmless: bool = False
    needs: str = ""


def measure(problem: Problem, drive: Drive, trajectory: Trajectory, robot: Robot) -> Metrics:
    """Return the metrics of the measured window of a rollout.

    Args:
        problem: the problem, for its horizon and axes.
        drive: what was commanded.
        trajectory: the rollout, from gait time 0 to at least the end of the horizon.
        robot: weight and servo limits.

    Returns:
        Metric by name. A trajectory that is not ``ok`` has NaN throughout.
    """
    names = metric_names(problem, drive.period_s is not None)
    if trajectory.status != "ok":
        return dict.fromkeys(names, math.nan)
    window = Window.of(problem, drive, trajectory, robot)
    metrics = METRICS | AIMS
    values = {name: metrics[name].formula(window) for name in names if name in metrics}
    return values | {f"{REACHED.name}.{channel}": share for channel, share in window.reached.items()}


def metric_names(problem: Problem, cyclic: bool = True, unused: bool = False) -> list[str]:
    """Return the names of a problem's metrics, in the order in which `measure` gives them.

    Args:
        problem: the problem; without ``roles.marker``, metrics of its travel are left out; where the robot is
            held, metrics of how it stands are, too.
        cyclic: whether there are cycles; without, metrics of a cycle are left out.
        unused: whether those of `AIMS` count that the objective does not name.
    """
    objective = problem.file.objective
    aims = set(AIMS) if unused else set(AIMS) & (objective.named if objective else set())
    marked, held = problem.roles.marker is not None, problem.file.start.held
    names = [
        name
        for name, metric in (METRICS | AIMS).items()
        if (name in METRICS or name in aims)
        and (marked or not metric.of_marker)
        and (cyclic or not metric.per_cycle)
        and not (held and metric.of_ground)
    ]
    return names + [f"{REACHED.name}.{channel}" for channel in problem.channel_names]


def mean_metrics(rows: Sequence[Metrics]) -> Metrics:
    """Return the mean of each metric over scenarios; of signed drifts, the mean size."""
    drifts = {name for name, metric in METRICS.items() if metric.drift}
    return {
        name: float(np.mean([abs(row[name]) if name in drifts else row[name] for row in rows]))
        for name in rows[0]
    }


def _ratio(above: float, below: float) -> float:
    return min(above / below, _MAX_RATIO) if below > 0.0 else _MAX_RATIO


def _yaw_rate(window: Window) -> float:
    """Return the net turning rate about up: how fast the trunk's forward axis turns, rad/s."""
    forward, left, _ = window.axes
    every = max(1, (window.rows.stop - window.rows.start) // _YAW_SAMPLES)
    pointing = window.rotation(every) @ forward
    yaw = np.unwrap(np.arctan2(pointing @ left, pointing @ forward))
    time = window.time[::every]
    return float((yaw[-1] - yaw[0]) / (time[-1] - time[0]))


def _tilt(window: Window) -> float:
    """Return the largest angle between the trunk's up axis and up, rad."""
    up = window.axes[2]
    cosine = (window.rotation(_TILT_SAMPLE) @ up) @ up
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)).max(initial=0.0))


def _slip(window: Window) -> float:
    """Return how far the pads slid backward per cycle while they carried load, m, summed over pads."""
    forward, _, up = window.axes
    slip = 0.0
    for pad in window.problem.roles.pads:
        load = sum(up[i] * window[f"load.{pad}.{axis}"] for i, axis in enumerate("xyz"))
        speed = sum(forward[i] * window[f"pad_speed.{pad}.{axis}"] for i, axis in enumerate("xyz"))
        anchored = np.abs(load) > LOADED * window.robot.weight
        slip += float(np.maximum(-speed, 0.0)[anchored].sum()) * window.sample_s
    return slip / (window.cycles or 1)


def _airtime(window: Window) -> float:
    """Return the share of time spent in flights longer than a bounce."""
    flying = np.concatenate([[False], window["contacts"] == 0.0, [False]])
    begins, ends = np.flatnonzero(flying[1:] & ~flying[:-1]), np.flatnonzero(flying[:-1] & ~flying[1:])
    flights = (ends - begins) * window.sample_s
    return float(flights[flights > _BOUNCE_S].sum() / (len(window.time) * window.sample_s))


def _cost_of_transport(window: Window) -> float:
    """Return mean power over weight and forward speed."""
    useful = window.robot.weight * window.velocity[0]
    return window.power / useful if useful > 0.0 else math.inf


def _command_speed_ratio(window: Window) -> float:
    """Return commanded peak speed over no-load speed, of the servos whose torque is limited."""
    no_load = window.robot.no_load_speed
    limited = np.isfinite(no_load)
    with np.errstate(over="ignore"):  # practically a square wave
        peaks = window.peak_command_speed[limited] / no_load[limited]
    return float(peaks.max(initial=0.0))


def _straightness(window: Window) -> float:
    """Return net travel over the length of the path, both in the plane, from one cycle to the next."""
    forward, left, _ = window.axes
    ends = np.linspace(window.begin_s, window.end_s, (window.cycles or 1) + 1)
    series = [np.interp(ends, window.trajectory.time, window.trajectory[name]) for name in MARKER]
    steps = np.diff(np.stack(series), axis=1)
    along = np.stack([forward @ steps, left @ steps])
    path = float(np.linalg.norm(along, axis=0).sum())
    return float(np.linalg.norm(along.sum(axis=1))) / path if path > 0.0 else 0.0


def _wanted(window: Window) -> float:
    """Return the wanted forward speed, m/s; NaN where none is given."""
    objective = window.problem.file.objective
    return (objective.wanted_speed_m_s if objective else None) or math.nan


def _distance_per_charge(window: Window) -> float:
    """Return how far the robot goes with the energy of its battery, m."""
    objective = window.problem.file.objective
    battery = objective.battery if objective else None
    if battery is None:
        return math.nan
    drawn = window.power / battery.efficiency + battery.idle_w
    return window.velocity[0] * 3600.0 * battery.energy_wh / drawn


SPEED = Metric(
    "speed_m_s",
    "net forward speed of the marker over whole cycles",
    lambda window: window.velocity[0],
    title="forward speed",
    of_marker=True,
    harmless=True,
)

REACHED = Metric(
    "reached",
    "share of the commanded travel that is reached, smallest of the servos",
    lambda window: min(window.reached.values(), default=1.0),
    title="travel reached",
    share=True,
)
"""The metric that ``reached.CHANNEL`` comes beside, per channel."""

SIDEWAYS, SIDEWAYS_RATIO = "sideways_m_s", "sideways_ratio"

_IN_ORDER = (
    SPEED,
    Metric(
        "stride_m",
        "net forward travel per cycle",
        lambda window: window.velocity[0] * (window.drive.period_s or math.nan),
        per_cycle=True,
        of_marker=True,
        harmless=True,
    ),
    Metric(
        SIDEWAYS,
        "net sideways speed, left positive",
        lambda window: window.velocity[1],
        title="sideways speed",
        drift=True,
        of_marker=True,
        harmless=True,
    ),
    Metric(
        SIDEWAYS_RATIO,
        "sideways over forward travel, in size; at most 10",
        lambda window: _ratio(abs(window.velocity[1]), abs(window.velocity[0])),
        title="sideways over forward",
        of_marker=True,
        harmless=True,
    ),
    Metric(
        "yaw_rate_rad_s",
        "net turning rate, left positive",
        _yaw_rate,
        title="turning rate",
        drift=True,
        of_ground=True,
        harmless=True,
    ),
    Metric("tilt_rad", "largest tilt of the trunk", _tilt, title="largest tilt", of_ground=True),
    Metric(
        "slip_m",
        "backward slip of loaded pads per cycle, summed over pads",
        _slip,
        title="slip back per cycle",
        per_cycle=True,
        of_ground=True,
        harmless=True,
    ),
    Metric(
        "airtime",
        "share of time in flights without any contact with the world that last over 10 ms",
        _airtime,
        title="time in the air",
        share=True,
        of_ground=True,
    ),
    Metric(
        "penetration_m",
        "deepest penetration of the ground",
        lambda window: float(max(0.0, -window["depth"].min(initial=0.0))),
        title="deepest penetration",
        of_ground=True,
    ),
    Metric(
        "peak_torque_n_m",
        "largest servo torque",
        lambda window: float(np.abs(window.stacked("torque")).max(initial=0.0)),
    ),
    Metric(
        "rms_torque_n_m",
        "root mean square of the servo torques, largest of the servos",
        lambda window: float(np.sqrt((window.stacked("torque") ** 2).mean(axis=0)).max(initial=0.0)),
        title="RMS torque",
    ),
    Metric(
        "power_w",
        "mean mechanical power at the servos' shafts; braking costs nothing and returns nothing",
        lambda window: window.power,
        title="mechanical power",
        harmless=True,
    ),
    Metric(
        "cost_of_transport",
        "energy per weight and forward distance; inf when it does not go forward",
        _cost_of_transport,
        of_marker=True,
        harmless=True,
    ),
    Metric(
        "command_speed_ratio",
        "commanded peak speed over the servo's no-load speed, largest of the servos",
        _command_speed_ratio,
        title="command over no-load speed",
    ),
    REACHED,
)

_AIMS = (
    Metric(
        "turning_rad_s",
        "net turning rate, left positive, with its sign",
        _yaw_rate,
        title="turning to the left",
        of_ground=True,
        harmless=True,
    ),
    Metric(
        "straightness",
        "net travel over the length of the path from cycle to cycle; 1 is straight",
        _straightness,
        share=True,
        per_cycle=True,
        of_marker=True,
        harmless=True,
    ),
    Metric(
        "speed_error",
        "difference from the wanted forward speed, over it",
        lambda window: abs(window.velocity[0] / _wanted(window) - 1.0),
        title="error of the speed",
        share=True,
        of_marker=True,
        needs="wanted_speed_m_s",
        harmless=True,
    ),
    Metric(
        "cost_at_wanted_speed",
        "power over weight and wanted speed: the cost of transport of a gait that has this speed",
        lambda window: window.power / (window.robot.weight * _wanted(window)),
        title="cost of transport at the wanted speed",
        needs="wanted_speed_m_s",
        harmless=True,
    ),
    Metric(
        "distance_per_charge_m",
        "forward distance until the battery is empty",
        _distance_per_charge,
        title="distance per charge",
        of_marker=True,
        needs="battery",
        harmless=True,
    ),
)

AIMS: dict[str, Metric] = {metric.name: metric for metric in _AIMS}
"""Metrics that only objectives which name them have, by name; they come after those of every problem."""

METRICS: dict[str, Metric] = {metric.name: metric for metric in _IN_ORDER}
"""Every metric by name, in the order of tables and files; ``reached.CHANNEL`` comes after them all."""

HARMLESS = frozenset(name for name, metric in (METRICS | AIMS).items() if metric.harmless)
"""Metrics on which a broken limit harms nothing."""
