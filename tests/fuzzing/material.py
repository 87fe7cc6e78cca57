"""Whole files that mutations start from."""

from __future__ import annotations

import dataclasses
import json
import random
import shutil
from functools import cache
from pathlib import Path

from helpers import STRIDER

from fuzzing.outcome import contents
from gaitopt.export.files import export_files
from gaitopt.export.formats import FORMATS
from gaitopt.export.replay import Replay
from gaitopt.gait.gait import Channel, Gait
from gaitopt.gait.table import GaitTable
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.run import Request, optimise
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.runs.run_folder import RunFolder


@cache
def problem() -> Problem:
    return load_problem(STRIDER)


def gait_of(rng: random.Random) -> Gait:
    """Return any gait that a file can hold, inside or outside the servos' range."""
    low, high = rng.choice([(-45.0, 45.0), (-90.0, 90.0)])
    channels = {}
    for name in problem().channel_names:
        offset = rng.uniform(low, high)
        channels[name] = Channel(
            duty=rng.choice([0.0, 1.0, 5e-324, rng.random()]),
            phase=rng.choice([0.0, -0.0, 1.0, -1e-18, 1e300, rng.uniform(-2.0, 2.0)]),
            amplitude_deg=rng.choice([0.0, 5e-324, rng.uniform(low - offset, high - offset)]),
            offset_deg=offset,
            smoothing=rng.choice([0.0, 1.0, 5e-324, rng.random()]),
        )
    return Gait(rng.choice([0.25, 0.5, 1.0, rng.uniform(0.1, 3.0)]), channels, "made")


def table_of(gait: Gait) -> GaitTable:
    channels = problem().file.channels
    servos = {name: channel.servo for name, channel in channels.items()}
    return GaitTable.sample(gait, servos, [0.0] * len(servos), 0.02, [0, 133], led_pin=2, samples=8)


def table_text(gait: Gait, name: str) -> str:
    """Return the file of a format that holds the table."""
    table = table_of(gait)
    unset: dict[str, list[str]] = {key: [] for key in table.servos}
    files = export_files(FORMATS[name], table, Replay(1.0, 1.0, 0.0, (0.0, 0.0), {}), [], unset)
    return files[FORMATS[name].table_file]


def motion(rng: random.Random) -> list[tuple[float, float, float]]:
    """Return time, x and z of a marker that moves forward in steps, sometimes badly filmed."""
    frame, rows = rng.choice([0.02, 0.04, 1 / 30]), []
    for index in range(rng.choice([1, 2, 3, 12, 60])):
        t = index * frame
        rows.append((t, 0.01 * t + 0.001 * (index % 7), 0.002 * (index % 3)))
    if rng.random() < 0.2:
        rows = [(round(t, 1), x, z) for t, x, z in rows]
    return rows


def export_of(rng: random.Random, program: str) -> str:
    """Return a file as a tracking program writes it."""
    rows = motion(rng)
    if program == "tracker":
        return "\n".join(["mass_A", "t\tx\ty", *(f"{t:.4f}\t{x:.6f}\t{z:.6f}" for t, x, z in rows)])
    if program == "tracker-comma":
        text = "\n".join(["mass_A", "t\tx\ty", *(f"{t:.4f}\t{x:.6f}\t{z:.6f}" for t, x, z in rows)])
        return text.replace(".", ",").replace("-", "\N{MINUS SIGN}")
    if program == "deeplabcut":
        head = ["scorer,net,net,net", "bodyparts,nose,nose,nose", "coords,x,y,likelihood"]
        return "\n".join(
            [*head, *(f"{i},{1e3 * x:.2f},{1e3 * z:.2f},0.9" for i, (_, x, z) in enumerate(rows))]
        )
    if program == "sleap":
        head = "track,frame_idx,instance.score,nose.x,nose.y,nose.score"
        return "\n".join([head, *(f",{i},0.9,{1e3 * x},{1e3 * z},0.8" for i, (_, x, z) in enumerate(rows))])
    if program == "kinovea":
        lines = [f'"{1e3 * t:g}";"{x:.5f}";"{z:.5f}"'.replace(".", ",") for t, x, z in rows]
        return "\n".join(['"Time";"foot/1/X";"foot/1/Y"', *lines])
    if program == "log":
        head = "t_s,target.rear_rad,target.front_us,rear_hip_deg"
        return "\n".join([head, *(f"{t},{x},{1500 + z:.1f},{100 * x}" for t, x, z in rows)])
    if program == "json-lines":
        told = [{"t": t, "cmd": {"rear_rad": x, "front_us": 1500 + z}, "hip": z} for t, x, z in rows]
        return "\n".join(json.dumps(line | {"joint.rear_hip_deg": 9.0 * line["hip"]}) for line in told)
    return "\n".join(["t_s,x_m,z_m,rear_hip_deg", *(f"{t},{x},{z},{100 * x}" for t, x, z in rows)])


PROGRAMS = ("tracker", "tracker-comma", "deeplabcut", "sleap", "kinovea", "plain", "log", "json-lines")


@cache
def finished_run(seed: int = 1) -> dict[str, bytes]:
    """Return the files of a brief run, without its report."""
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "run"
        folder = RunFolder.create(path, problem(), Request(seed=seed, budget=6, warm_start=False))
        with folder:
            found = optimise(problem(), Request(seed=seed, budget=6, warm_start=False),
                             folder.open_journal(problem()), SerialExecutor())  # fmt: skip
            # The time that a run took would make the bytes that a case breaks depend on the machine.
            folder.write_results(problem(), dataclasses.replace(found, wall_s=1.0))
        return contents(path)


def strider_in(folder: Path, name: str = "robot") -> Path:
    shutil.copytree(STRIDER, folder / name)
    return folder / name
