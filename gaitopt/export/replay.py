"""Is what the robot will get still the gait? The exported table is played in simulation first."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.export.gait_player import DUTY_BITS, RAMP_US, WALKING, Player, duty
from gaitopt.gait.table import GaitTable, sampled_deg
from gaitopt.optimise.verification import interval90
from gaitopt.problem.model import Robot, start_targets
from gaitopt.problem.problem import Problem
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Scenario, Simulator

WARN_LOSS = 0.05
"""A larger share of the speed lost is worth a warning; so is one gained: it is not the same gait then."""

_STARTS = 8
_START_SPREAD_RAD = 5e-3
_EDGE = 1e-9

Commands = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Times, s, shape (n,), to targets, rad, shape (n, nu)."""


@dataclass(frozen=True)
class Replay:
    """How the exported table compares with the gait itself, over the same perturbed starts.

    Attributes:
        ideal_m_s, replayed_m_s: mean speeds.
        loss: share of the ideal speed that is lost; None if the gait does not go forward.
        loss_ci90: its 90 % interval over the starts.
        causes: share lost to each step from the gait to the servo, in order; only where `loss` is large and
            more than scatter.
    """

    ideal_m_s: float
    replayed_m_s: float
    loss: float | None
    loss_ci90: tuple[float, float] | None
    causes: dict[str, float]

    @property
    def warning(self) -> str | None:
        """What to tell the user, if anything."""
        if self.loss is None:
            return "the gait does not go forward in simulation, so a loss of speed cannot be told"
        if abs(self.loss) <= WARN_LOSS:
            return None
        if not self.causes:
            return f"the speed changes by {-self.loss:+.1%}, which is not more than the scatter over starts"
        what = "loses" if self.loss > 0.0 else "gains"
        cause = max(self.causes, key=lambda name: self.causes[name] * (1.0 if what == "loses" else -1.0))
        shares = ", ".join(f"{name} {-share:+.1%}" for name, share in self.causes.items())
        return f"the exported gait {what} {abs(self.loss):.1%} of its speed, most of it by {cause} ({shares})"


def replay(problem: Problem, table: GaitTable, executor: Executor) -> Replay:
    """Return what is lost between the gait and the servos, in simulation over several start poses.

    Raises:
        GaitoptError: the model does not compile or does not fit the problem, or no simulation succeeds.
    """
    trial = _Trial.build(problem, table, executor)
    stages = command_stages(problem, table)
    ideal, replayed = trial.speeds(stages["gait"]), trial.speeds(stages["player"])
    mean = float(ideal.mean())
    if not mean > 0.0:
        return Replay(mean, float(replayed.mean()), None, None, {})
    low, high = interval90((ideal - replayed) / mean)
    loss = float((ideal - replayed).mean()) / mean
    causes = {}
    if abs(loss) > WARN_LOSS and not low <= 0.0 <= high:
        causes = _causes(trial, stages, ideal, replayed)
    return Replay(mean, float(replayed.mean()), loss, (low, high), causes)


def _causes(
    trial: _Trial, stages: dict[str, Commands], ideal: NDArray[np.float64], replayed: NDArray[np.float64]
) -> dict[str, float]:
    """Return the share of speed that goes with each step from the gait to the player."""
    names = list(stages)[1:]
    speeds = [ideal, *(trial.speeds(stages[name]) for name in names[:-1]), replayed]
    means = [float(speed.mean()) for speed in speeds]
    losses = [(before - after) / means[0] for before, after in pairwise(means)]
    named = dict(zip(names, losses, strict=True))
    named["ramp and slew clamp"] = named.pop("player")
    return named


@dataclass(frozen=True)
class _Trial:
    """Perturbed starts, and a horizon that begins once the player has ramped in."""

    problem: Problem
    table: GaitTable
    simulator: Simulator
    executor: Executor

    @staticmethod
    def build(problem: Problem, table: GaitTable, executor: Executor) -> _Trial:
        simulation = problem.simulation
        late_s = 1e-6 * (RAMP_US + 2 * table.frame_us)
        horizon = simulation.horizon.model_copy(
            update={"transient_s": simulation.horizon.transient_s + late_s}
        )
        patient = problem.with_horizon(horizon)
        starts = [Scenario(start_pose_rad=_START_SPREAD_RAD, pose_seed=seed) for seed in range(_STARTS)]
        return _Trial(patient, table, Simulator.build(patient, starts), executor)

    def speeds(self, commands: Commands) -> NDArray[np.float64]:
        """Return the speed from each start, m/s; 0 where the simulation fails.

        Raises:
            GaitoptError: it fails from every start.
        """
        time = self.simulator.clock(self.simulator.duration(self.table.gait))
        sent = commands(time)
        runs = list(self.executor.map(lambda start: self.simulator.play(time, sent, start), range(_STARTS)))
        if all(run.status != "ok" for run in runs):
            raise GaitoptError(f"{self.table.gait.name}: the simulation {runs[0].status}")
        robot = Robot.of(self.simulator.models[0])
        gait = self.table.gait
        speeds = np.array([measure(self.problem, gait, run, robot)["speed_m_s"] for run in runs])
        speeds[np.isnan(speeds)] = 0.0
        return speeds


def command_stages(problem: Problem, table: GaitTable) -> dict[str, Commands]:
    """Return the way from the gait to the servos: each stage adds one thing to the stage before it.

    ``gait`` is the gait itself; ``interpolation`` between the table's samples; ``quantisation`` to
    whole microseconds and to the timer's steps; ``frame rate``, one command a frame; ``latency``, each
    acts one frame late; ``player`` is the sequence that is really sent, with ramp and slew clamp.
    """
    frame_s = 1e-6 * table.frame_us

    def interpolation(time: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.deg2rad(_interpolated_deg(table, time)))

    def quantisation(time: NDArray[np.float64]) -> NDArray[np.float64]:
        return _quantised(table, _interpolated_deg(table, time))

    def frame_rate(time: NDArray[np.float64]) -> NDArray[np.float64]:
        return quantisation(np.floor(time / frame_s + _EDGE) * frame_s)

    def latency(time: NDArray[np.float64]) -> NDArray[np.float64]:
        started = (time >= frame_s * (1.0 - _EDGE))[:, None]
        return np.where(started, frame_rate(time - frame_s), start_targets(problem))

    def player(time: NDArray[np.float64]) -> NDArray[np.float64]:
        frames = np.floor(time / frame_s + _EDGE).astype(int)
        pulses = np.array([table.start_us, *sent_pulses(table, int(frames[-1]))])
        return np.asarray(_angles(table, pulses)[frames])

    return {
        "gait": table.gait.targets,
        "interpolation": interpolation,
        "quantisation": quantisation,
        "frame rate": frame_rate,
        "latency": latency,
        "player": player,
    }


def sent_pulses(table: GaitTable, frames: int) -> list[list[int]]:
    """Return the pulses of the first frames from gait time 0 on, as the player sends them, µs."""
    player = player_of(table)
    player.start(0)
    now = 0
    sent: list[list[int]] = []
    while len(sent) < frames:
        player.tick(now)
        if player.state == WALKING:
            sent.append(list(player.pulse_us))
        now += table.frame_us
    return sent


def player_of(table: GaitTable) -> Player:
    """Return a player of a table."""
    return Player(table.period_us, table.frame_us, servo_rows(table), tuple(np.ravel(table.pulses).tolist()))


def servo_rows(table: GaitTable) -> tuple[tuple[int, int, int, int, int], ...]:
    """Return pin (-1: none), start, shortest and longest pulse and slew limit of each servo."""
    return tuple(
        (-1 if servo.pin is None else servo.pin, start, servo.min_us, servo.max_us, slew)
        for servo, start, slew in zip(table.servos.values(), table.start_us, table.slew_us, strict=True)
    )


def _interpolated_deg(table: GaitTable, time: NDArray[np.float64]) -> NDArray[np.float64]:
    samples = sampled_deg(table.gait, len(table.pulses))
    closed = np.vstack([samples, samples[:1]])
    phase = np.mod(time / (1e-6 * table.period_us), 1.0)
    grid = np.linspace(0.0, 1.0, len(closed))
    return np.stack([np.interp(phase, grid, column) for column in closed.T], axis=-1)


def _quantised(table: GaitTable, angles_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    columns = zip(table.servos.values(), angles_deg.T, strict=True)
    pulses = [
        servo.neutral_us + servo.trim_us + servo.direction * servo.us_per_deg * c for servo, c in columns
    ]
    return _angles(table, np.rint(np.stack(pulses, axis=-1)).astype(int))


def _angles(table: GaitTable, pulses_us: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the targets that pulses ask for once the timer has rounded them, rad."""
    timer_us = duty_us(pulses_us, table.frame_us)
    columns = [
        servo.direction * (timer_us[:, i] - servo.neutral_us - servo.trim_us) / servo.us_per_deg
        for i, servo in enumerate(table.servos.values())
    ]
    return np.deg2rad(np.stack(columns, axis=-1))


def duty_us(pulses_us: NDArray[np.int64], frame_us: int) -> NDArray[np.float64]:
    """Return the length of pulses after rounding to the timer's steps (1.22 µs at 50 Hz), µs."""
    ticks = np.vectorize(lambda pulse: duty(int(pulse), frame_us), otypes=[float])(pulses_us)
    return np.asarray(ticks * (frame_us / (1 << DUTY_BITS)), dtype=float)
