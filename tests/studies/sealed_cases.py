"""Draws sealed cases of logged commands on a rig: which effects are planted, and how large; writes data sets.

The size of an effect is drawn from a third of its range (small, middle, large), again and again until the
effect is clear: without it, recordings of `CLEAR_IN` commands or more would differ by `CLEAR` floors. Of
three effects, each must be clear beside the others, and no two may change the recordings alike.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import tomli_w
from numpy.typing import NDArray

from gaitopt.blind.sealed import truth_path
from gaitopt.core.files import csv_text, write_text
from gaitopt.core.json import to_json

Array = NDArray[np.float64]

CLEAR = 4.0
CLEAR_IN = 2

ALIKE = 0.95
"""Two effects of one case change its recordings with a smaller cosine than this."""

DRAWS = 60
"""An effect that is not clear after so many draws cannot be."""

SIZES = ("small", "middle", "large")

ALL = "all"

Key = tuple[str, str]
"""Name and target of an effect."""

Robot = Mapping[Key, float]
"""What is planted: values by effect."""


@dataclass(frozen=True)
class Kind:
    """How an effect is drawn on a rig.

    Attributes:
        parameter: its parameter, with the unit.
        ranges: values from hardly any to large, of which one is drawn.
        targets: servos that it may act on.
        neutral: the value that changes nothing.
    """

    parameter: str
    ranges: Sequence[tuple[float, float]]
    targets: Sequence[str] = (ALL,)
    neutral: float = 0.0


@dataclass(frozen=True)
class Recording:
    """What is commanded in one recording.

    Attributes:
        name: the name of the command, and the number of the repeat after a dash.
        rows: targets, rad, shape (n, number of channels); NaN: unpowered.
        held: targets before time 0, rad.
    """

    name: str
    rows: Array
    held: tuple[float, ...]

    @property
    def command(self) -> str:
        """Name of the command, which repeats share."""
        return self.name.rpartition("-")[0]


class Rig(Protocol):
    """What is measured, by numerics of its own."""

    # properties, not attributes: those of a frozen record cannot be set

    @property
    def problem(self) -> str:
        """Name of the problem."""

    @property
    def channels(self) -> Sequence[str]:
        """The servo of each column of commands."""

    @property
    def joints(self) -> Sequence[str]:
        """The joint of each column of angles."""

    @property
    def row_s(self) -> float:
        """Time between two rows of a log, s."""

    @property
    def kinds(self) -> Mapping[str, Kind]:
        """The effects that can be planted, by name."""

    def recordings(self, rng: np.random.Generator) -> list[Recording]:
        """Return what is commanded in a case."""

    def chances(self, plan: Sequence[Recording], rng: np.random.Generator) -> list[object]:
        """Return what happens by chance in each recording: its start, and which commands are late."""

    def angles(
        self, robots: Sequence[Robot], plan: Sequence[Recording], chances: Sequence[Sequence[object]]
    ) -> list[list[Array]]:
        """Return the angles of each robot in each recording, rad, shape (n, joints), before it is read.

        Raises:
            OverflowError: a joint reaches a stop.
        """

    def read(self, angle: Array, rng: np.random.Generator) -> Array:
        """Return angles as the encoder gives them."""


@dataclass(frozen=True)
class Plan:
    """One case to make.

    Attributes:
        name: its name.
        kind: ``single``, ``several`` or ``none``.
        effect: effect of a single; None: drawn.
        size: which third of its range, an index of `SIZES`; None: drawn.
    """

    name: str
    kind: str
    effect: str | None = None
    size: int | None = None


@dataclass(frozen=True)
class Made:
    """A case: what was planted, and what was measured.

    Attributes:
        robot: values by effect.
        clear: gap of each effect beside the others, in floors: the largest of all commands.
        recordings: what was commanded.
        angles: what was measured in each, rad, shape (n, joints).
    """

    robot: Robot
    clear: Mapping[Key, float]
    recordings: Sequence[Recording]
    angles: Sequence[Array]


COUNT = {"none": 0, "single": 1, "several": 3}
"""Number of effects of each kind of case."""


def make(rig: Rig, plan: Plan, rng: np.random.Generator) -> Made | None:
    """Return a case; None where an effect that is asked for cannot be clear."""
    for attempt in range(DRAWS):
        size = None if attempt >= DRAWS // 2 else plan.size  # rather another size than no case
        names = sorted(rig.kinds)
        drawn = [plan.effect] if plan.effect else list(rng.choice(names, COUNT[plan.kind], replace=False))
        robot = dict(draw(str(name), rig.kinds[str(name)], size, rng) for name in drawn)
        made = _measured(rig, robot, rng)
        if made is not None:
            return made
    return None


def draw(name: str, kind: Kind, size: int | None, rng: np.random.Generator) -> tuple[Key, float]:
    """Return an effect with a target and a value: from a third of a range, ratios equally likely."""
    target = str(kind.targets[int(rng.integers(len(kind.targets)))])
    low, high = kind.ranges[int(rng.integers(len(kind.ranges)))]
    third = int(rng.integers(len(SIZES))) if size is None else size
    share = (third + rng.uniform()) / len(SIZES)
    return (name, target), float(f"{low * (high / low) ** share:.4g}")


def _measured(rig: Rig, robot: Robot, rng: np.random.Generator) -> Made | None:
    """Return a case with these effects; None where one is not clear, or is like another."""
    plan = rig.recordings(rng)
    own, other = rig.chances(plan, rng), rig.chances(plan, rng)
    robots = [robot, *({k: v for k, v in robot.items() if k != key} for key in robot), robot]
    try:
        moved, *without, again = rig.angles(robots, plan, [own] * (1 + len(robot)) + [other])
    except OverflowError:
        return None
    measured, repeated = ([rig.read(one, rng) for one in row] for row in (moved, again))
    floors = [rms(a - b) / math.sqrt(2.0) for a, b in zip(measured, repeated, strict=True)]
    changes = {
        key: [(a - b) / floor for a, b, floor in zip(moved, row, floors, strict=True)]
        for key, row in zip(robot, without, strict=True)
    }
    clear = {key: _gaps(plan, rows) for key, rows in changes.items()}
    if any(gaps[CLEAR_IN - 1] < CLEAR for gaps in clear.values()) or _alike(list(changes.values())):
        return None
    return Made(robot, {key: gaps[0] for key, gaps in clear.items()}, plan, measured)


def _gaps(plan: Sequence[Recording], changes: Sequence[Array]) -> list[float]:
    """Return the size of a change for each command, in floors, the largest first."""
    by_command: dict[str, float] = {}
    for one, change in zip(plan, changes, strict=True):
        by_command[one.command] = max(rms(change), by_command.get(one.command, 0.0))
    return sorted(by_command.values(), reverse=True)


def _alike(changes: Sequence[Sequence[Array]]) -> bool:
    """Whether two of some changes have nearly the same direction."""
    vectors = [np.concatenate([rows.ravel() for rows in change]) for change in changes]
    units = [vector / np.linalg.norm(vector) for vector in vectors]
    return any(abs(float(a @ b)) > ALIKE for i, a in enumerate(units) for b in units[:i])


def rms(values: Array) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))


def write_case(folder: Path, rig: Rig, plan: Plan, made: Made) -> None:
    """Write a case's data set to FOLDER/NAME, and its truth to FOLDER/sealed/NAME.json."""
    case = folder / plan.name
    case.mkdir(parents=True, exist_ok=True)
    trials = []
    for one, angle in zip(made.recordings, made.angles, strict=True):
        file = f"{one.name}.csv"
        columns = {"t_s": np.round(np.arange(len(angle)) * rig.row_s, 6)}
        columns |= {f"{name}_rad": one.rows[:, i] for i, name in enumerate(rig.channels)}
        columns |= {f"angle_{name}_rad": angle[:, i] for i, name in enumerate(rig.joints)}
        write_text(case / file, csv_text(columns, nan=""))
        signals = {f"joint.{name}": f"angle_{name}_rad" for name in rig.joints}
        trials.append({"name": one.name, "commands": file, "file": file, "signals": signals})
    write_text(case / "dataset.toml", tomli_w.dumps({"trial": trials}))
    effects = [
        {"name": name, "target": target, "parameters": {rig.kinds[name].parameter: value}}
        for (name, target), value in made.robot.items()
    ]
    gaps = {f"{name}.{target}": gap for (name, target), gap in made.clear.items()}
    largest = max(gaps.values(), default=0.0)
    truth = {"kind": plan.kind, "effects": effects, "gap_over_floor": largest, "gaps_over_floor": gaps}
    path = truth_path(folder, plan.name)
    path.parent.mkdir(exist_ok=True)
    write_text(path, to_json(truth))
