"""Tables and gaits that the tests of the export share."""

import numpy as np

from gaitopt.export.replay import Replay
from gaitopt.gait.gait import Channel, Gait
from gaitopt.gait.table import GaitTable
from gaitopt.problem.problem import Problem
from gaitopt.problem.start import start_targets

UNHURT = Replay(1.0, 1.0, 0.0, (0.0, 0.0), {})
"""A replay without loss."""


def table_of(problem: Problem, gait: Gait, slew: int = 0, samples: int = 64) -> GaitTable:
    """Return the table of a gait on the servos of a problem."""
    servos = {name: channel.servo for name, channel in problem.file.channels.items()}
    start = np.rad2deg(start_targets(problem)).tolist()
    frame_s = problem.file.servo.frame_s
    return GaitTable.sample(gait, servos, start, frame_s, [slew] * len(servos), None, samples)


def leaning(offset_deg: float, amplitude_deg: float) -> Gait:
    """A strider's gait with a given motion of the rear leg."""
    return Gait(
        0.5,
        {
            "rear": Channel(duty=0.5, phase=0.75, amplitude_deg=amplitude_deg, offset_deg=offset_deg),
            "front": Channel(duty=0.5, phase=0.0, amplitude_deg=20.0),
        },
    )
