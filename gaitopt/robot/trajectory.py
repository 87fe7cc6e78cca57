"""Named time series that carry their units: what a simulation gave, or what was measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.files import csv_text
from gaitopt.robot.signals import column_of


@dataclass(frozen=True)
class Trajectory:
    """One simulation or trial.

    Attributes:
        time: gait time of each sample, s, shape (n,).
        signals: series by name, each of shape (n,). ``marker.x|y|z`` is the marker in the world, m;
            ``heading.w|x|y|z`` the trunk's turn from how it is drawn, a quaternion; per actuator
            ``target``, ``position`` (rad), ``rate`` (rad/s) and ``torque`` (N m); ``joint.NAME`` (rad);
            per pad ``load.PAD.x|y|z``, its force on the ground (N, in the world: negative along up), and
            ``pad_speed.PAD.x|y|z`` (m/s); ``contacts``, the number of contacts with what is around the robot,
            ``contacts_all`` with those between its own parts, and ``depth``, the distance of the deepest (m,
            negative inside).
        status: ``ok``, or why the simulation is not to be trusted.
        poses: MuJoCo's qpos at each sample, shape (n, nq), where pictures were asked for.
    """

    time: NDArray[np.float64]
    signals: Mapping[str, NDArray[np.float64]]
    status: str = "ok"
    poses: NDArray[np.float64] | None = None

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.signals[name]

    def named(self, kind: str) -> dict[str, NDArray[np.float64]]:
        """Return the series of one kind by the name after the dot, in recorded order."""
        prefix = f"{kind}."
        return {n.removeprefix(prefix): s for n, s in self.signals.items() if n.startswith(prefix)}

    def stacked(self, kind: str) -> NDArray[np.float64]:
        """Return the series of one kind side by side, shape (n, number of them)."""
        columns = list(self.named(kind).values())
        return np.stack(columns, axis=-1) if columns else np.empty((len(self.time), 0))

    def to_csv(self) -> str:
        """Return a CSV table: ``t_s``, then one column per signal with its unit as suffix."""
        columns = {"t_s": self.time}
        for name, series in self.signals.items():
            columns[column_of(name)] = series
        return csv_text(columns)
