"""Blind cases: data sets with a sealed truth, made by numerics that the diagnosis does not use."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import tomli_w
from numpy.typing import NDArray

from gaitopt.blind.disturbances import OUTSIDE, Figures, disturbed
from gaitopt.core.errors import GaitoptError, unknown_name
from gaitopt.core.files import csv_text, write_text
from gaitopt.core.streams import BLIND_FLOOR_SEED, Stream, generator
from gaitopt.diagnose.fit.hypotheses import Hypothesis, hypotheses
from gaitopt.diagnose.gap.align import square_apart
from gaitopt.diagnose.judge.small_errors import perturbed_robots, with_small_errors
from gaitopt.effects.active import Values
from gaitopt.gait.gait import Gait
from gaitopt.problem.lookup import PROBLEM_FILE
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.robot.signals import MARKER, is_marker, joint_signal
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import NOMINAL, Scenario, Simulator

Array = NDArray[np.float64]

KINDS = {"single": 0.6, "none": 0.18, "outside": 0.12, "pair": 0.1}
"""Kinds of cases and their shares."""

SMALL, LARGE = 3.0, 30.0
"""Gaps planted, in floors."""

_FIDELITIES = (
    Fidelity(timestep_s=5e-4, integrator="RK4"),
    Fidelity(timestep_s=2.5e-4, integrator="Euler"),
    Fidelity(timestep_s=3e-4, integrator="implicit"),
)
_IMPRATIOS = (5.0, 20.0, 40.0)
_RATES = (25.0, 30.0, 50.0, 60.0)
_NOISE_M = (3e-4, 1e-3)
_ANGLE_NOISE_RAD = 2e-3
_TRIES = 7
_DRAWS = 8
_JOINT_FLOOR_RAD = 3e-3


@dataclass(frozen=True)
class Truth:
    """What was done to the robot of a case.

    Attributes:
        kind: single, pair, none or outside.
        effects: rows with ``name``, ``target`` and ``parameters``.
        gap_over_floor: what the effect alone changed, the largest of all trials.
        figures: what else was drawn.
    """

    kind: str
    effects: list[dict[str, Any]]
    gap_over_floor: float
    figures: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Maker:
    """What all cases of a problem share.

    Attributes:
        problem: the problem.
        gaits: the gaits filmed, by name.
        seconds: length of each recording, s.
        signals: what is measured.
        nominal: nominal robot at the working fidelity.
        paths: its trajectories.
        floors: what nuisances and noise change, RMS of the marker of each gait, m.
        faint: effects that were drawn, and on some target and side make no gap of `SMALL` floors.
    """

    problem: Problem
    gaits: Mapping[str, Gait]
    seconds: float
    signals: tuple[str, ...]
    nominal: Simulator
    paths: Mapping[str, Trajectory]
    floors: Mapping[str, float]
    faint: set[str] = field(default_factory=set)

    @property
    def rivals(self) -> list[Hypothesis]:
        """What may be planted."""
        return hypotheses(self.nominal.effects.nominal, self.problem.channel_names, offset_known=True)


def maker(
    problem: Problem,
    gaits: Sequence[str],
    seconds: float,
    signals: Sequence[str] | None,
    executor: Executor,
) -> Maker:
    """Return what all cases of a problem share.

    Args:
        problem: the problem.
        gaits: names of its baselines.
        seconds: length of each recording, s; at least two cycles are filmed.
        signals: what is measured; by default the marker and the joint that the first servo turns.
        executor: where robots are simulated.
    """
    nominal = Simulator.build(problem)
    chosen = {name: problem.baselines[name] for name in gaits}
    lengths = {name: filmed_s(gait, seconds) for name, gait in chosen.items()}
    robots = [nominal, *perturbed_robots(nominal, BLIND_FLOOR_SEED, 4)]
    runs = {
        (name, index): executor.submit(robot.run, gait, 0, lengths[name])
        for name, gait in chosen.items()
        for index, robot in enumerate(robots)
    }
    done = {key: future.result() for key, future in runs.items()}
    floors = {}
    for name in chosen:
        changes = [_gap(done[name, 0], done[name, i]) for i in range(1, len(robots))]
        floors[name] = math.sqrt(float(np.mean(np.square(changes))) + 3.0 * np.mean(_NOISE_M) ** 2)
    paths = {name: done[name, 0] for name in chosen}
    return Maker(problem, chosen, seconds, tuple(signals or _signals(nominal)), nominal, paths, floors)


def _signals(nominal: Simulator) -> list[str]:
    joint = nominal.effects.nominal.servo_joints[0]
    named = [joint_signal(nominal.models[0].joint(joint).name)] if joint >= 0 else []
    return [*MARKER, *(n for n in named if n in nominal.signals)]


def filmed_s(gait: Gait, seconds: float) -> float:
    """Return how long a robot has to walk for a recording that begins when it likes, s."""
    return max(seconds, 2.1 * gait.period_s) + 1.2 * gait.period_s


def _gap(one: Trajectory, other: Trajectory) -> float:
    """Return the RMS distance of two markers, origins removed, m."""
    return math.sqrt(sum(square_apart(one, other, signal) for signal in MARKER))


@dataclass(frozen=True)
class Draw:
    """A case as it was drawn, before it is filmed."""

    kind: str
    planted: tuple[tuple[Hypothesis, float], ...]
    outside: tuple[str, dict[str, float]] | None = None

    @property
    def effects(self) -> dict[str, Values]:
        """What a problem file says of the effects."""
        return {h.effect.name: h.values(at) for h, at in self.planted}

    @property
    def rows(self) -> list[dict[str, Any]]:
        """What the truth says of the effects."""
        if self.outside is not None:
            return [{"name": self.outside[0], "target": "all", "parameters": self.outside[1]}]
        return [
            {"name": h.effect.name, "target": h.target, "parameters": {h.effect.parameter: h.value(at)}}
            for h, at in self.planted
        ]


def draw_case(
    made: Maker, kind: str, rng: np.random.Generator, executor: Executor, only: str | None = None
) -> tuple[Draw, float]:
    """Draw a case whose gap is between `SMALL` and `LARGE` floors; return it and its gap.

    Args:
        made: what all cases share.
        kind: one of `KINDS`.
        rng: where the draws come from.
        executor: where robots are simulated.
        only: the effect or disturbance to plant; any by default.

    Raises:
        GaitoptError: the effect asked for cannot make such a gap.
    """
    if kind == "none":
        return Draw(kind, ()), 0.0
    for _ in range(12):
        names = sorted({h.effect.name for h in made.rivals})
        chosen = [only] if only else rng.choice(names, 2 if kind == "pair" else 1, replace=False).tolist()
        if kind == "outside":
            found = _sized(made, executor, *_outside(made, only, rng))
        elif kind == "pair":
            found = _pair(made, [str(name) for name in chosen], rng, executor)
        else:
            found = _sized(made, executor, *_single(made, str(chosen[0]), rng))
        if found is not None:
            return found
        if kind == "single":
            made.faint.update(map(str, chosen))
    raise GaitoptError(f"{only or kind}: no gap of {SMALL:g} to {LARGE:g} floors was found inside its bounds")


def _single(
    made: Maker, name: str, rng: np.random.Generator
) -> tuple[Callable[[float], Draw], np.random.Generator]:
    of_name = [h for h in made.rivals if h.effect.name == name]
    chosen = of_name[int(rng.integers(len(of_name)))]
    bound = chosen.sides[int(rng.integers(len(chosen.sides)))]

    def at(size: float) -> Draw:
        return Draw("single", ((chosen, chosen.neutral + size * (bound - chosen.neutral)),))

    return at, rng


def _outside(
    made: Maker, only: str | None, rng: np.random.Generator
) -> tuple[Callable[[float], Draw], np.random.Generator]:
    name = only or str(rng.choice(sorted(OUTSIDE)))
    seed = int(rng.integers(2**31))

    def at(size: float) -> Draw:
        figures = OUTSIDE[name].draw(np.random.default_rng(seed), size, made.nominal)
        return Draw("outside", (), (name, figures))

    return at, rng


def _pair(
    made: Maker, names: Sequence[str], rng: np.random.Generator, executor: Executor
) -> tuple[Draw, float] | None:
    found = [_sized(made, executor, *_single(made, name, rng), most=0.7 * LARGE) for name in names]
    if found[0] is None or found[1] is None:
        return None
    draw = Draw("pair", found[0][0].planted + found[1][0].planted)
    gap = _gap_of(made, draw, executor)
    return (draw, gap) if SMALL <= gap <= 1.5 * LARGE else None


def _sized(
    made: Maker,
    executor: Executor,
    at: Callable[[float], Draw],
    rng: np.random.Generator,
    most: float = LARGE,
) -> tuple[Draw, float] | None:
    """Return a draw with a gap of a random size in range, by bisection; None where there is none."""
    wanted = SMALL * (0.8 * most / SMALL) ** float(rng.uniform(0.1, 1.0))
    low, high = 0.0, 1.0
    size = float(rng.uniform(0.1, 0.9))
    best: tuple[Draw, float] | None = None
    for _ in range(_TRIES):
        draw = at(size)
        gap = _gap_of(made, draw, executor)
        if SMALL <= gap <= most:
            best = (draw, gap)
            if 0.6 * wanted <= gap <= 1.6 * wanted:
                return best
        low, high = (size, high) if gap < wanted else (low, size)
        size = 0.5 * (low + high)
        if low > 0.95:
            break
    return best


def _gap_of(made: Maker, draw: Draw, executor: Executor) -> float:
    """Return the largest gap of any gait in floors, by the nominal numerics."""
    try:
        robot = _robot(made.problem, draw, NOMINAL, made.nominal.fidelity)
    except GaitoptError:
        return math.inf
    futures = {
        name: executor.submit(_filmed_path, robot, gait, made.paths[name].time[-1])
        for name, gait in made.gaits.items()
    }
    return _in_floors(made, made.paths, {name: future.result() for name, future in futures.items()})


def _in_floors(made: Maker, paths: Mapping[str, Trajectory], others: Mapping[str, Trajectory]) -> float:
    """Return how far two robots are apart, the largest of all gaits and signals, in floors."""
    ratios = []
    for name, path in paths.items():
        other = others[name]
        if path.status != "ok" or other.status != "ok":
            return math.inf
        angles = [math.sqrt(square_apart(path, other, s)) for s in made.signals if not is_marker(s)]
        ratios += [_gap(path, other) / made.floors[name], *(a / _JOINT_FLOOR_RAD / 3.0 for a in angles)]
    return max(ratios)


def _filmed_path(robot: Simulator, gait: Gait, duration: float) -> Trajectory:
    return robot.observe(robot.run(gait, 0, float(duration)))


def _robot(problem: Problem, draw: Draw, scenario: Scenario, fidelity: Fidelity) -> Simulator:
    robot = Simulator.build(problem.with_effects(draw.effects), (scenario,), fidelity)
    if draw.outside is None:
        return robot
    name, figures = draw.outside
    return disturbed(robot, OUTSIDE[name], figures)


@dataclass(frozen=True)
class Footage:
    """What a case's robot did, and what else was drawn for its recordings.

    Attributes:
        paths: its trajectories, by gait.
        gap: how far the effect alone moved marker and joints, the largest of all gaits, in floors.
        known: whether the recordings say when they start.
        fps: frames a second.
        noise_m: standard deviation of the marker's noise, m.
        figures: the robot's numerics.
    """

    paths: Mapping[str, Trajectory]
    gap: float
    known: bool
    fps: float
    noise_m: float
    figures: Figures


def shoot(made: Maker, draw: Draw, rng: np.random.Generator, executor: Executor) -> Footage:
    """Return what a case's robot does.

    It has another integrator, timestep and cone stiffness, a start pose a little off, and masses and hinges
    a little wrong. Its twin has all of that too, and not the effect: their distance is the gap.
    """
    fidelity = _FIDELITIES[int(rng.integers(len(_FIDELITIES)))]
    impratio = float(rng.choice(_IMPRATIOS))
    needed = any(hypothesis.effect.needs_known_start for hypothesis, _ in draw.planted)
    known = needed or bool(rng.random() < 0.5)
    fps, noise = float(rng.choice(_RATES)), float(rng.uniform(*_NOISE_M))
    errors = int(rng.integers(2**31))
    size = made.problem.file.scenarios.start_pose_rad
    poses = {
        name: Scenario(start_pose_rad=0.6 * size, pose_seed=int(rng.integers(2**31))) for name in made.gaits
    }
    runs: list[dict[str, Future[Trajectory]]] = []
    for one in (draw, Draw("none", ())) if draw.rows else (draw,):
        robot = _robot(made.problem, one, NOMINAL, fidelity)
        model = with_small_errors(copy.copy(robot.models[0]), robot, np.random.default_rng(errors))
        model.opt.impratio = impratio
        mujoco.mj_setConst(model, mujoco.MjData(model))
        runs.append(
            {
                name: executor.submit(
                    _filmed_path,
                    replace(robot, scenarios=(poses[name],), models=(model,)),
                    gait,
                    filmed_s(gait, made.seconds),
                )
                for name, gait in made.gaits.items()
            }
        )
    paths, *twin = ({name: future.result() for name, future in run.items()} for run in runs)
    figures = {"timestep_s": fidelity.timestep_s, "impratio": impratio, "noise_m": noise, "fps": fps}
    gap = _in_floors(made, twin[0], paths) if twin else 0.0
    return Footage(paths, gap, known, fps, noise, figures | {"known": float(known)})


def write_recordings(made: Maker, footage: Footage, folder: Path, rng: np.random.Generator) -> None:
    """Write a case's data set: the camera has noise, a frame rate, and perhaps a start that nobody knows."""
    folder.mkdir(parents=True, exist_ok=True)
    entries = []
    for name, path in footage.paths.items():
        gait = made.gaits[name]
        begin = float(rng.uniform(0.0, 0.3) if footage.known else rng.uniform(-0.9, 0.9) * gait.period_s)
        columns = _columns(path, made, gait, begin, footage.fps, footage.noise_m, rng)
        write_text(folder / f"{name}.csv", csv_text(columns))
        start = {"starts_at_gait_time_s": begin} if footage.known else {}
        signals = dict(zip(made.signals, list(columns)[1:], strict=True))
        entries.append(
            {"name": name, "gait": name, "file": f"{name}.csv", "fps": footage.fps, "signals": signals}
            | start
        )
    write_text(folder / "dataset.toml", tomli_w.dumps({"trial": entries}))


def _columns(
    path: Trajectory,
    made: Maker,
    gait: Gait,
    begin: float,
    fps: float,
    noise: float,
    rng: np.random.Generator,
) -> dict[str, Array]:
    length = max(made.seconds, 2.1 * gait.period_s)
    time = np.arange(0.0, length, 1.0 / fps)
    origin = rng.uniform(-0.3, 0.3, len(made.signals))
    columns = {"t_s": time}
    for index, signal in enumerate(made.signals):
        kind, _, part = signal.partition(".")
        series = np.interp(time + begin, path.time, path[signal])
        if kind == "marker":
            columns[f"{part}_m"] = series + origin[index] + noise * rng.standard_normal(len(time))
        else:
            columns[f"{part}_rad"] = series + _ANGLE_NOISE_RAD * rng.standard_normal(len(time))
    return columns


def make_case(
    made: Maker, out: Path, index: int, kind: str, seed: int, executor: Executor, only: str | None = None
) -> Path:
    """Make one case and seal its truth; return its folder."""
    rng = generator(seed, Stream.BLIND_CASE, index)
    for _ in range(_DRAWS):
        draw, _ = draw_case(made, kind, rng, executor, only)
        footage = shoot(made, draw, rng, executor)
        if kind == "none" or SMALL <= footage.gap <= 1.5 * LARGE:
            break
    else:
        raise GaitoptError(f"{only or kind}: no robot of other numerics showed a gap of {SMALL:g} floors")
    folder = out / f"case-{index:03d}"
    write_recordings(made, footage, folder, rng)
    truth = Truth(kind, draw.rows, footage.gap, dict(footage.figures))
    sealed = out / "sealed"
    sealed.mkdir(parents=True, exist_ok=True)
    write_text(sealed / f"case-{index:03d}.json", json.dumps(asdict(truth), indent=1) + "\n")
    return folder


def kinds_of(cases: int, seed: int) -> list[str]:
    """Return the kinds of so many cases, in shares of `KINDS`, in random order."""
    counts = {kind: round(share * cases) for kind, share in KINDS.items()}
    counts["single"] += cases - sum(counts.values())
    kinds = [kind for kind, count in counts.items() for _ in range(count)]
    generator(seed, Stream.BLIND_KINDS).shuffle(kinds)
    return kinds


NOMINAL_FOLDER = "nominal"
"""Where a folder of cases keeps the problem that they are diagnosed with."""


def make_all(
    problem: Problem,
    out: Path,
    kinds: Sequence[str],
    seed: int,
    gaits: Sequence[str],
    seconds: float,
    signals: Sequence[str] | None,
    only: str | None,
    executor: Executor,
) -> list[str]:
    """Make cases, those that exist already kept; return the effects drawn that could make no gap.

    Args:
        problem: the problem.
        out: their folder, where `NOMINAL_FOLDER` keeps the problem.
        kinds: the kind of each case.
        seed: seed of all randomness.
        gaits: names of the baselines filmed.
        seconds: length of a trial, s.
        signals: what is measured; None for the marker and the joint of the first servo.
        only: the effect or disturbance to plant; None for any.
        executor: where robots are simulated.

    Raises:
        GaitoptError: there is no such gait or signal, or what is to be planted cannot make a gap.
    """
    for name in gaits:
        if name not in problem.baselines:
            raise unknown_name("blind make", "gait", name, problem.baselines)
    made = maker(problem, gaits, seconds, signals, executor)
    for name in made.signals:
        if name not in made.nominal.signals:
            raise unknown_name("blind make", "signal", name, [s for s in made.nominal.signals if s])
    known = [*OUTSIDE, *sorted({h.effect.name for h in made.rivals})]
    if only is not None and only not in known:
        raise unknown_name("blind make", "effect or disturbance", only, known)
    (out / NOMINAL_FOLDER).mkdir(parents=True, exist_ok=True)
    write_text(out / NOMINAL_FOLDER / "model.xml", nominal_mjcf(problem))
    write_text(out / NOMINAL_FOLDER / PROBLEM_FILE, problem.to_toml("model.xml"))
    for index, kind in enumerate(kinds):
        if not (out / "sealed" / f"case-{index:03d}.json").exists():
            make_case(made, out, index, kind, seed, executor, only)
    return sorted(made.faint)
