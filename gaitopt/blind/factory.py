"""What all blind cases of a problem share: the nominal robot, its trajectories and their floors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitopt.blind.settings import DEFAULT, BlindSettings
from gaitopt.core.errors import unknown_name
from gaitopt.core.streams import BLIND_FLOOR_SEED
from gaitopt.diagnose.fit.hypotheses import Hypothesis, hypotheses
from gaitopt.diagnose.gap.align import square_apart
from gaitopt.diagnose.judge.small_errors import perturbed_robots
from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.robot.signals import MARKER, is_position, joint_signal
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]

_SOURCE = "blind make"

_BEGIN_CYCLES = 1.2
"""A robot walks this many cycles longer than its recording, which may begin anywhere in the first one."""


@dataclass(frozen=True)
class RecordingPlan:
    """What is recorded in every case.

    Attributes:
        gaits: names of the problem's baselines, one trial each.
        seconds: length of a trial, s; two cycles at least.
        signals: what is measured; None for the marker and the joint that the first servo turns.
    """

    gaits: Sequence[str]
    seconds: float
    signals: Sequence[str] | None = None


@dataclass(frozen=True)
class CaseFactory:
    """What all cases of a problem share.

    Attributes:
        problem: the problem.
        gaits: the gaits recorded, by name.
        seconds: length of each recording, s.
        signals: what is measured.
        nominal: nominal robot at the working fidelity.
        paths: its trajectories, by gait.
        floors: what small unknown errors and noise change, RMS of the marker of each gait, m.
        settings: how cases are drawn.
    """

    problem: Problem
    gaits: Mapping[str, Gait]
    seconds: float
    signals: tuple[str, ...]
    nominal: Simulator
    paths: Mapping[str, Trajectory]
    floors: Mapping[str, float]
    settings: BlindSettings = DEFAULT

    @staticmethod
    def of(
        problem: Problem, plan: RecordingPlan, executor: Executor, settings: BlindSettings = DEFAULT
    ) -> CaseFactory:
        """Simulate what all cases of a problem share.

        Args:
            problem: the problem.
            plan: what is recorded.
            executor: where robots are simulated.
            settings: how cases are drawn.

        Raises:
            GaitoptError: there is no such gait or signal.
        """
        for name in plan.gaits:
            if name not in problem.baselines:
                raise unknown_name(_SOURCE, "gait", name, problem.baselines)
        nominal = Simulator.build(problem)
        signals = tuple(plan.signals or _default_signals(nominal))
        for name in signals:
            if name not in nominal.signals:
                raise unknown_name(_SOURCE, "signal", name, [s for s in nominal.signals if s])
        gaits = {name: problem.baselines[name] for name in plan.gaits}
        lengths = {name: walked_s(gait, plan.seconds, settings) for name, gait in gaits.items()}
        robots = [nominal, *perturbed_robots(nominal, BLIND_FLOOR_SEED, settings.floor_robots)]
        futures = {
            name: [executor.submit(robot.run, gait, 0, lengths[name]) for robot in robots]
            for name, gait in gaits.items()
        }
        runs = {name: [future.result() for future in of_gait] for name, of_gait in futures.items()}
        floors = {}
        for name, (path, *others) in runs.items():
            changes = [marker_distance(path, other) for other in others]
            floors[name] = math.sqrt(
                float(np.mean(np.square(changes))) + 3.0 * np.mean(settings.marker_noise_m) ** 2
            )
        paths = {name: of_gait[0] for name, of_gait in runs.items()}
        return CaseFactory(problem, gaits, plan.seconds, signals, nominal, paths, floors, settings)

    @property
    def hypotheses(self) -> list[Hypothesis]:
        """What may be planted."""
        return hypotheses(self.nominal.effects.nominal, self.problem.channel_names, offset_known=True)

    @property
    def effects(self) -> list[str]:
        """Names of the effects that may be planted."""
        return sorted({hypothesis.effect.name for hypothesis in self.hypotheses})

    def recorded_s(self, gait: Gait) -> float:
        """Return how long a recording of a gait is, s."""
        return max(self.seconds, self.settings.least_cycles * gait.period_s)

    def walked_s(self, gait: Gait) -> float:
        """Return how long a robot has to walk for a recording of a gait, s."""
        return walked_s(gait, self.seconds, self.settings)

    def gap(self, paths: Mapping[str, Trajectory], others: Mapping[str, Trajectory]) -> float:
        """Return how far two robots are apart, the largest of all gaits and signals, in floors.

        Args:
            paths: trajectories of one robot, by gait.
            others: trajectories of the other, by gait.

        Returns:
            Infinity where a simulation failed.
        """
        return float(np.max(self.floors_apart(paths, others)))

    def floors_apart(self, paths: Mapping[str, Trajectory], others: Mapping[str, Trajectory]) -> Array:
        """Return how far two robots are apart in floors, shape (gaits, 1 + angles): marker, then angles.

        The gaits are those of `paths`; infinity where a simulation failed.
        """
        angles = [name for name in self.signals if not is_position(name)]
        rows = []
        for name, path in paths.items():
            other = others[name]
            if path.status != "ok" or other.status != "ok":
                rows.append([math.inf] * (1 + len(angles)))
                continue
            moved = [math.sqrt(square_apart(path, other, signal)) for signal in angles]
            floor = 3.0 * self.settings.joint_floor_rad
            rows.append([marker_distance(path, other) / self.floors[name], *(one / floor for one in moved)])
        return np.array(rows)


def walked_s(gait: Gait, seconds: float, settings: BlindSettings = DEFAULT) -> float:
    """Return how long a robot has to walk for a recording that may begin anywhere in its first cycle, s."""
    return max(seconds, settings.least_cycles * gait.period_s) + _BEGIN_CYCLES * gait.period_s


def marker_distance(one: Trajectory, other: Trajectory) -> float:
    """Return the RMS distance of two markers, origins removed, m."""
    return math.sqrt(sum(square_apart(one, other, signal) for signal in MARKER))


def observed(robot: Simulator, gait: Gait, duration: float) -> Trajectory:
    """Return a robot's walk as a camera sees it; `duration` in s."""
    return robot.observe(robot.run(gait, 0, float(duration)))


def _default_signals(nominal: Simulator) -> list[str]:
    """Return the marker and the joint that the first servo turns, if the model measures it."""
    joint = nominal.effects.nominal.servo_joints[0]
    named = [joint_signal(nominal.models[0].joint(joint).name)] if joint >= 0 else []
    return [*MARKER, *(name for name in named if name in nominal.signals)]
