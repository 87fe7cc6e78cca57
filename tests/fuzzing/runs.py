"""Whole runs of commands on broken files."""

from __future__ import annotations

import random
import re
import tomllib
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path

import tomli_w

from fuzzing.material import finished_run, gait_of, problem, strider_in
from fuzzing.mutations import broken, changed, changed_xml, nudged
from fuzzing.outcome import WHOLE_LIMIT_S, Case
from gaitopt.simulation.rollout import Simulator


def tiny(folder: Path) -> Path:
    """Copy the strider with a horizon of one cycle and three baselines, one of them standing still."""
    path = strider_in(folder) / "problem.toml"
    content = tomllib.loads(path.read_text())
    content["simulation"]["horizon"] = {"transient_s": 0.0, "transient_cycles": 0, "measured_s": 0.1}
    content["simulation"]["horizon"]["measured_cycles"] = 1
    content["simulation"]["reference"] = content["simulation"]["working"]
    content["scenarios"]["verification"] = 2
    path.write_text(tomli_w.dumps(content))
    return path.parent


def spoilt(rng: random.Random, folder: Path) -> Path:
    """Return a tiny robot whose files have an error, something unusual, or nothing special."""
    robot = tiny(folder)
    victim = robot / rng.choice(["problem.toml", "problem.toml", "strider.xml"])
    how = rng.random()
    if how < 0.5:
        victim.write_bytes(nudged(rng, victim.read_bytes()))
    elif how < 0.7 and victim.suffix == ".toml":
        content = changed(rng, tomllib.loads(victim.read_text()))
        victim.write_text(tomli_w.dumps(content), encoding="utf-8")
    elif how < 0.7:
        root = changed_xml(rng, ET.parse(victim).getroot())
        text = re.sub(r"[\x00-\x08\x0b\x0c\x0e-\x1f]", "", ET.tostring(root, encoding="unicode"))
        victim.write_text(text, encoding="utf-8")
    elif how < 0.85:
        victim.write_bytes(broken(rng, victim.read_bytes()))
    return robot


def whole(*arguments: object, may_change: tuple[str, ...] = ()) -> Case:
    """Return a complete run without progress, in one thread so that the time limit holds."""
    words = [str(argument) for argument in arguments]
    return Case([*words, "--json", "--workers", "1"], may_change=may_change, limit_s=WHOLE_LIMIT_S)


def a_gait(rng: random.Random, folder: Path) -> str:
    """Return a baseline's name, or a gait file that is whole or broken."""
    data = gait_of(rng).to_toml().encode()
    (folder / "gait.toml").write_bytes(
        rng.choice([bytes, lambda d: nudged(rng, d), lambda d: broken(rng, d)])(data)
    )
    return rng.choice(["stride", "square", "gait.toml", "gait.toml"])


def optimise_whole(rng: random.Random, folder: Path) -> Case:
    """A search; a search that fails may leave the files of an interrupted one."""
    robot = spoilt(rng, folder)
    options = rng.choice(
        [[], [], ["--pareto"], ["--method", "cma-es"], ["--method", "nelder-mead"], ["--seed", "7"]]
    )
    if rng.random() < 0.3:
        options = [*options, "--no-warm-start"]
    budget = rng.choice([1, 2, 3, 5])
    return whole(
        "optimise", robot, "--budget", budget, "--out", "out", "--quiet", *options, may_change=("out",)
    )


def resume_whole(rng: random.Random, folder: Path) -> Case:
    """An unfinished run with a change in its files, which is resumed."""
    run = folder / "run"
    for name, data in finished_run().items():
        if name != "summary.json":
            (run / name).parent.mkdir(parents=True, exist_ok=True)
            (run / name).write_bytes(data)
    victim = run / rng.choice(["run.toml", "problem.toml", "model.xml", "evaluations.csv", "evaluations.csv"])
    data = victim.read_bytes()
    if victim.suffix == ".csv" and rng.random() < 0.5:
        data = b"".join(data.splitlines(keepends=True)[: rng.randrange(8)])
    else:
        data = rng.choice([nudged, broken])(rng, data)
    victim.write_bytes(data)
    return whole("optimise", "run", "--resume", "run", "--quiet", may_change=("run",))


def check_whole(rng: random.Random, folder: Path) -> Case:
    return whole("check", spoilt(rng, folder), *rng.choice([[], ["--out", "out"]]))


def compare_whole(rng: random.Random, folder: Path) -> Case:
    gaits = ["stride", a_gait(rng, folder)]
    return whole("compare", spoilt(rng, folder), *gaits, *rng.choice([[], ["--out", "out"]]))


def sweep_whole(rng: random.Random, folder: Path) -> Case:
    name, usual = rng.choice(
        [
            ("period_s", 0.5),
            ("mass", 0.03),
            ("mu_rear", 1.0),
            ("k_servo", 0.5),
            ("rear.duty", 0.5),
            ("front.phase", 0.3),
        ]
    )
    values = [
        usual * rng.choice([1.0, 0.5, 2.0, 0.9, 1e-3, 1e3, 0.0, -1.0]) for _ in range(rng.choice([1, 2, 3]))
    ]
    over = f"--over={name}={','.join(map(repr, values))}"
    return whole("sweep", spoilt(rng, folder), a_gait(rng, folder), over, "--out", "out")


@cache
def walked() -> dict[str, list[float]]:
    """Return what a camera sees of a strider with weak servos."""
    weak = Simulator.build(problem().with_effects({"servo_gain": {"scale": 0.5}}))
    seen = weak.run(problem().baselines["stride"], duration=1.6)
    names = {"t_s": seen.time, "x_m": seen["marker.y"], "z_m": seen["marker.z"]}
    return {name: column[::20].tolist() for name, column in names.items()}


def diagnose_whole(rng: random.Random, folder: Path) -> Case:
    robot, columns = spoilt(rng, folder), walked()
    rows = [",".join(columns), *(",".join(map(repr, row)) for row in zip(*columns.values(), strict=True))]
    signals = {"marker.y": "x_m", "marker.z": "z_m"}
    trials = [
        {
            "name": name,
            "gait": rng.choice(["stride", "stride", "gait.toml"]),
            "file": "walk.csv",
            "signals": signals,
        }
        | rng.choice([{}, {"starts_at_gait_time_s": 0.0}, {"noise_m": 0.001, "fps": 25}])
        for name in ("one", "other")[: rng.choice([1, 2])]
    ]
    files = {
        "dataset.toml": tomli_w.dumps({"trial": trials}).encode(),
        "walk.csv": "\n".join(rows).encode() + b"\n",
        "gait.toml": problem().baselines["square"].to_toml().encode(),
    }
    victim = rng.choice([*files, ""])
    for name, data in files.items():
        path = folder / "set" / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(rng.choice([nudged, nudged, broken])(rng, data) if name == victim else data)
    effects = rng.choice(["servo_gain", "servo_trim", "pad_friction", "clock_rate"])
    asked = ["--effects", effects, "--out", "out", "--quiet"]
    return whole("diagnose", robot, "set", *asked, may_change=("out",))
