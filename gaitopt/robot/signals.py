"""Names of signals: ``KIND.NAME``, such as ``marker.x``, ``joint.mid_left`` or ``site.tip.yaw``."""

from __future__ import annotations

AXES = "xyz"

TURNS = ("roll", "pitch", "yaw")
"""Angles of a site about forward, left and up."""

MARKER = ("marker.x", "marker.y", "marker.z")
"""The marker's coordinates in the world, m."""

UNITS = {
    "marker": "m",
    "heading": "",
    "target": "rad",
    "position": "rad",
    "rate": "rad_s",
    "torque": "n_m",
    "joint": "rad",
    "load": "n",
    "pad_speed": "m_s",
    "contacts": "",
    "contacts_all": "",
    "depth": "m",
}
"""Unit of each kind of signal, the part of its name before the dot, as a column suffix."""


def is_position(signal: str) -> bool:
    """Return whether a measured signal is a coordinate, in m, of free origin: of the marker or of a site.

    All other measured signals are angles.
    """
    return kind_of(signal) == "marker" or (kind_of(signal) == "site" and axis_of(signal) in AXES)


def kind_of(signal: str) -> str:
    """Return the kind of a signal, the part of its name before the dot, such as ``marker``."""
    return signal.partition(".")[0]


def name_of(signal: str) -> str:
    """Return the part of a signal's name after the dot: an axis, or the name of a joint."""
    return signal.partition(".")[2]


def axis_of(signal: str) -> str:
    """Return the last part of a signal's name: ``x`` of ``site.tip.x``."""
    return signal.rpartition(".")[2]


def unit_of(signal: str) -> str:
    """Return the unit of a signal, as a column suffix; empty for none."""
    if kind_of(signal) == "site":
        return "m" if is_position(signal) else "rad"
    return UNITS[kind_of(signal)]


def marker_signal(axis: str) -> str:
    """Return the signal of a coordinate of the marker, ``x``, ``y`` or ``z``, in m."""
    return f"marker.{axis}"


def site_signals(site: str) -> list[str]:
    """Return the signals of a site: its coordinates, m, and its angles, rad."""
    return [f"site.{site}.{part}" for part in (*AXES, *TURNS)]


def site_of(signal: str) -> str:
    """Return the site of a signal: ``tip`` of ``site.tip.x``."""
    return name_of(signal).rpartition(".")[0]


def joint_signal(joint: str) -> str:
    """Return the signal of a joint's angle, in rad."""
    return f"joint.{joint}"


def column_of(signal: str) -> str:
    """Return the name of a signal's column in a CSV file, with its unit as suffix."""
    unit = unit_of(signal)
    return f"{signal}_{unit}" if unit else signal


def measured_column_of(signal: str) -> str:
    """Return the name of a measured signal's column in a data set: ``x_m``, ``mid_left_rad``."""
    return f"{name_of(signal)}_{unit_of(signal)}"
