"""The way from a gait to the servos, step by step: table, timer, frames, latency, player."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gaitopt.export.gait_player import WALKING, Player
from gaitopt.export.output import LEDC, Output
from gaitopt.gait.drive import Commands
from gaitopt.gait.table import GaitTable, sampled_deg
from gaitopt.problem.problem import Problem
from gaitopt.problem.start import start_targets

_EDGE = 1e-9
"""Share of a frame: a time this close before a frame counts as in it."""


def command_stages(problem: Problem, table: GaitTable, output: Output = LEDC) -> dict[str, Commands]:
    """Return the way from the gait to the servos: each stage adds one thing to the stage before it.

    ``gait`` is the gait itself; ``interpolation`` between the table's samples; ``quantisation`` to
    whole microseconds or steps and to what the output can send; ``frame rate``, one command a frame;
    ``latency``, each acts one frame late; ``player`` is the sequence that is finally sent, with ramp and
    slew clamp.
    """
    frame_s = 1e-6 * table.frame_us

    def interpolation(time: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.deg2rad(_interpolated_deg(table, time)))

    def quantisation(time: NDArray[np.float64]) -> NDArray[np.float64]:
        return _quantised(table, _interpolated_deg(table, time), output)

    def frame_rate(time: NDArray[np.float64]) -> NDArray[np.float64]:
        return quantisation(np.floor(time / frame_s + _EDGE) * frame_s)

    def latency(time: NDArray[np.float64]) -> NDArray[np.float64]:
        started = (time >= frame_s * (1.0 - _EDGE))[:, None]
        return np.where(started, frame_rate(time - frame_s), start_targets(problem))

    def player(time: NDArray[np.float64]) -> NDArray[np.float64]:
        frames = np.floor(time / frame_s + _EDGE).astype(int)
        pulses = np.array([table.start_us, *sent_pulses(table, int(frames[-1]))])
        return np.asarray(_angles(table, pulses, output)[frames])

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


def _quantised(table: GaitTable, angles_deg: NDArray[np.float64], output: Output) -> NDArray[np.float64]:
    columns = zip(table.servos.values(), angles_deg.T, strict=True)
    pulses = [
        servo.neutral_us + servo.trim_us + servo.direction * servo.us_per_deg * c for servo, c in columns
    ]
    return _angles(table, np.rint(np.stack(pulses, axis=-1)).astype(int), output)


def _angles(table: GaitTable, pulses_us: NDArray[np.int64], output: Output) -> NDArray[np.float64]:
    """Return the targets that pulses ask for once the output has rounded them, rad."""
    timer_us = sent_us(pulses_us, table.frame_us, output)
    columns = [
        servo.direction * (timer_us[:, i] - servo.neutral_us - servo.trim_us) / servo.us_per_deg
        for i, servo in enumerate(table.servos.values())
    ]
    return np.deg2rad(np.stack(columns, axis=-1))


def sent_us(pulses_us: NDArray[np.int64], frame_us: int, output: Output = LEDC) -> NDArray[np.float64]:
    """Return what servos get of pulses, µs or steps: a timer rounds them (to 1.22 µs at 50 Hz)."""
    rounded = np.vectorize(lambda pulse: output.rounded(int(pulse), frame_us), otypes=[float])
    return np.asarray(rounded(pulses_us), dtype=float)
