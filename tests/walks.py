"""Synthetic recordings of a walk, for tests that need no simulation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gaitopt.diagnose.record.trial import Flags, Series, Trial
from gaitopt.gait.gait import Channel, Gait
from gaitopt.robot.trajectory import Trajectory

GAIT = Gait(2.0, {"servo": Channel(duty=0.5, phase=0.0, amplitude_deg=30.0)}, "wave")
FPS = 30.0


def steps(time: Series) -> Series:
    """Strides of 30 mm in a quarter of a 2 s cycle, and a little slip back."""
    turns = time / GAIT.period_s
    push = np.clip((turns % 1.0) / 0.25, 0.0, 1.0)
    strides: Series = 0.03 * (np.floor(turns) + 0.5 - 0.5 * np.cos(np.pi * push)) - 0.004 * (turns % 1.0)
    return strides


def heights(time: Series) -> Series:
    """A hump of 10 mm in each cycle."""
    humps: Series = 0.01 * np.maximum(0.0, np.sin(2.0 * np.pi * time / GAIT.period_s))
    return humps


def recorded(duration: float = 12.0, fps: float = FPS, noise_m: float = 3e-4, seed: int = 1) -> Trial:
    """A filmed walk: `steps` along x and `heights` along z, with noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, 1.0 / fps)
    signals = {
        "marker.x": steps(time) + noise_m * rng.standard_normal(len(time)),
        "marker.z": heights(time) + noise_m * rng.standard_normal(len(time)),
    }
    return Trial.of("walk", GAIT, time, signals)


def with_samples(trial: Trial, flags: Flags, shift: float) -> Trial:
    """A trial with some samples elsewhere, by `shift` in m."""
    signals = {name: np.where(flags, series + shift, series) for name, series in trial.signals.items()}
    return Trial.of(trial.name, trial.drive, trial.time, signals)


def simulated(
    x: Callable[[Series], Series] = steps, z: Callable[[Series], Series] = heights, duration: float = 16.0
) -> Trajectory:
    """The walk as a correct model predicts it."""
    time = np.arange(0.0, duration, 1e-3)
    return Trajectory(time, {"marker.x": x(time), "marker.z": z(time)})


def wave(time: Series, size: float = 1.0, drift: float = 0.0, delay: float = 0.0) -> Series:
    """Strides with 20 mm of travel per cycle and 8 mm of swing, and additional drift, m per cycle."""
    turns = (time - delay) / GAIT.period_s
    return size * (0.02 * turns + 0.008 * np.sin(2.0 * np.pi * turns)) + drift * time / GAIT.period_s
