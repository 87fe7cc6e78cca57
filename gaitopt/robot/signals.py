"""Names of signals: ``KIND.NAME``, such as ``marker.x`` or ``joint.mid_left``."""

from __future__ import annotations

AXES = "xyz"

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


def is_marker(signal: str) -> bool:
    """Return whether a signal is a coordinate of the marker, in m."""
    return signal.startswith("marker.")


def kind_of(signal: str) -> str:
    """Return the kind of a signal, the part of its name before the dot, such as ``marker``."""
    return signal.partition(".")[0]


def name_of(signal: str) -> str:
    """Return the part of a signal's name after the dot: an axis, or the name of a joint."""
    return signal.partition(".")[2]


def unit_of(signal: str) -> str:
    """Return the unit of a measured signal: ``m`` of the marker, ``rad`` of a joint."""
    return UNITS[kind_of(signal)]


def marker_signal(axis: str) -> str:
    """Return the signal of a coordinate of the marker, ``x``, ``y`` or ``z``, in m."""
    return f"marker.{axis}"


def joint_signal(joint: str) -> str:
    """Return the signal of a joint's angle, in rad."""
    return f"joint.{joint}"


def column_of(signal: str) -> str:
    """Return the name of a signal's column in a CSV file, with its unit as suffix."""
    unit = UNITS[kind_of(signal)]
    return f"{signal}_{unit}" if unit else signal


def measured_column_of(signal: str) -> str:
    """Return the name of a measured signal's column in a data set: ``x_m``, ``mid_left_rad``."""
    return f"{name_of(signal)}_{unit_of(signal)}"
