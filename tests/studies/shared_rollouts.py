"""Rollouts shared between blind cases: every diagnosis tries the same robots first, on the same gaits.

A rollout that is requested a second time is kept for the third. It is simulated a little longer than
requested, because recordings begin at any time. Cut to the requested length, it has the same bits as a
separate rollout.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace

import mujoco
import numpy as np

from gaitopt.effects.active import RobotEffects
from gaitopt.gait.drive import Drive
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

MOST = 1300
"""Number of rollouts kept, the latest requested ones: 4 MB each. Diagnoses of ArcFold share about 1100."""


@contextmanager
def shared_rollouts(longest: Mapping[str, float]) -> Iterator[None]:
    """Share rollouts within the block.

    Args:
        longest: for each gait, by `gait_key`, the longest rollout that any case may need, s.
    """
    own = Simulator.run
    seen: set[str] = set()
    kept: OrderedDict[str, Trajectory] = OrderedDict()

    def run(
        self: Simulator, drive: Drive, scenario: int = 0, duration: float | None = None, poses: bool = False
    ) -> Trajectory:
        most = longest.get(drive.key, 0.0)
        if duration is None or duration > most or poses or type(self.effects) is not RobotEffects:
            return own(self, drive, scenario, duration, poses)
        key = _key(self, drive, scenario)
        if key not in seen:
            seen.add(key)
            return own(self, drive, scenario, duration)
        path = kept.pop(key, None) or own(self, drive, scenario, most)
        kept[key] = path  # behind all others
        if len(kept) > MOST:
            kept.popitem(last=False)
        if path.status != "ok":
            return own(self, drive, scenario, duration)
        return _cut(path, len(self.clock(duration)[:: self.sample_steps]))

    Simulator.run = run  # type: ignore[method-assign]
    try:
        yield
    finally:
        Simulator.run = own  # type: ignore[method-assign]


def _key(robot: Simulator, drive: Drive, scenario: int) -> str:
    model = robot.models[scenario]
    content = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, content)
    said = (robot.scenarios[scenario], robot.effects.active, robot.fidelity, drive.key)
    return hashlib.sha256(content.tobytes() + repr(said).encode()).hexdigest()


def _cut(path: Trajectory, samples: int) -> Trajectory:
    signals = {name: series[:samples] for name, series in path.signals.items()}
    return replace(path, time=path.time[:samples], signals=signals)
