"""How fast is the real robot's servo? Three real trials compared with the model, for a range of servos.

    python tests/studies/servo_choice.py --trials DIR --out results/convergence

DIR holds the trials gait-4s.csv, gait-1s.csv and gait-0.5s.csv, with columns t_s and x_m of the marker;
without them the row of the real robot is left out. Writes servo.csv, for each choice of servo, contact
and some dimensions: stride, rise, setback and rise time at periods of 4 and 1 s, speed and swing at 0.5 s.
The speed of the servo is chosen at the reference fidelity, and its rows have the speeds over scenarios, too.

Cost: 15 min of two cores.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from convergence import (
    HORIZON,
    NOMINAL,
    Choice,
    contact_stiffness,
    figure,
    fingerprint,
    loop_stiffness,
    perturbed,
    standard_error,
)
from kept_table import KeptTable, Row
from numpy.typing import NDArray

from gaitopt.gait.gait import Gait
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.problem.robot import Robot
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import draw_scenarios

STARTS = 8
RISE_WINDOW_S = 0.75
LEAD_S = 0.05
"""Cycles are counted from this long before the robot extends."""

EXTENDS_AT = 0.25
"""Share of the baselines' cycle at which the middle hinge begins to straighten."""

REAL = "real robot"
SERVOS = (0.0233, 0.03, 0.035, 0.0375, 0.04, 0.0425, 0.045, 0.05, 0.055, 0.06, 0.07)


@dataclass(frozen=True)
class Trial:
    """A recording: its file, its gait's period, and the whole cycles in it that are used.

    Attributes:
        file: name in the trials' folder.
        gait: the baseline that was commanded.
        from_s: recording time just before the first rise that is used.
        cycles: number of whole cycles from there.
    """

    file: str
    gait: str
    from_s: float
    cycles: int


TRIALS = (Trial("gait-4s.csv", "square-4s", 2.85, 6), Trial("gait-1s.csv", "square-1s", 0.95, 9))
"""The faster trials are used up to 10 s: after that their time stamps are rounded to 0.1 s."""

FAST_TRIAL = Trial("gait-0.5s.csv", "square-0.5s", 0.45, 19)
"""Its rises follow each other without a rest, so only speed and swing are compared."""

VARIED = (TRIALS[1], FAST_TRIAL)
SCENARIOS = 12
SCENARIO_SEED = 1
"""Draws of the problem's scenarios: friction, strength and trim of the servos, start pose."""

MODEL_ONLY = (
    "sideways_0.5s_mm_s",
    *(f"reached_0.5s_{channel}" for channel in ("mid_act", "foot1", "foot2")),
    *(f"varied_{trial.gait.removeprefix('square-')}{part}_mm_s" for trial in VARIED for part in ("", "_sd")),
)
"""Columns that the row of the real robot leaves empty."""

SPEEDS = tuple(Choice(f"b_motor {b:g}", {"b_motor": b}) for b in SERVOS)

OTHERS = (
    Choice("nothing"),
    Choice("b_motor 0.0233, torque_limit 0.15", {"b_motor": 0.0233, "torque_limit": 0.15}),
    Choice("torque_limit 0.18", {"torque_limit": 0.18}),
    Choice("k_motor 2", {"k_motor": 2.0}),
    Choice("k_motor 5", {"k_motor": 5.0}),
    Choice("armature 5e-5", {"armature": 5e-5}),
    Choice("armature 2e-4", {"armature": 2e-4}),
    Choice("mu_tape 1.0", {"mu_tape": 1.0}),
    Choice("mu_base 0.35", {"mu_base": 0.35}),
    Choice("mass_module 0.017", {"mass_module": 0.017}),
    Choice("pads 3 mm thick", mjcf={"default/default[@class='pad']/geom/@size": "0.005 0.0125 0.0015"}),
    Choice("pads 4.8 mm thick", mjcf={"default/default[@class='pad']/geom/@size": "0.005 0.0125 0.0024"}),
    Choice("contact solref 0.005", mjcf=contact_stiffness(0.005)),
    Choice("contact solref 0.02", mjcf=contact_stiffness(0.02)),
    Choice("impratio 1", mjcf={"option/@impratio": "1"}),
    Choice("impratio 100", mjcf={"option/@impratio": "100"}),
    Choice("pyramidal, impratio 10", mjcf={"option/@cone": "pyramidal"}),
    Choice("loop solref 0.002", mjcf=loop_stiffness(0.002)),
    Choice("loop solref 0.01", mjcf=loop_stiffness(0.01)),
)

WELD = "loop closed by a weld"

Features = dict[str, NDArray[np.float64]]


def features(
    time: NDArray[np.float64], forward: NDArray[np.float64], period: float, begin: float, cycles: int
) -> Features:
    """Return the features of each cycle's extension.

    Args:
        time: s, shape (n,).
        forward: position of the marker, m, shape (n,).
        period: of the gait, s.
        begin: when the first cycle begins, just before a rise, s.
        cycles: how many.

    Returns:
        Per cycle: ``stride``, net travel, mm; ``rise``, from the smallest to the largest position in the
        window around the extension, mm; ``setback``, the part of the rise that is lost within the cycle, mm;
        ``rise_time``, from 10 to 90 % of the rise, s.
    """
    starts = begin + period * np.arange(cycles + 1)
    stride = np.diff(np.interp(starts, time, forward))
    rise, rise_time = np.empty(cycles), np.empty(cycles)
    for i, start in enumerate(starts[:-1]):
        window = (time >= start) & (time < start + RISE_WINDOW_S)
        clock, position = time[window], forward[window]
        top = int(position.argmax())
        bottom = int(position[: top + 1].argmin())
        clock, position = clock[bottom : top + 1], position[bottom : top + 1]
        rise[i] = position[-1] - position[0]
        tenth, nine_tenths = position[0] + np.array([0.1, 0.9]) * rise[i]
        left = int(np.flatnonzero(position <= tenth)[-1])
        reached = int(np.flatnonzero(position >= nine_tenths)[0])
        rise_time[i] = _crossing(clock, position, reached - 1, nine_tenths) - _crossing(
            clock, position, left, tenth
        )
    return {
        "stride": 1e3 * stride,
        "rise": 1e3 * rise,
        "setback": 1e3 * (rise - stride),
        "rise_time": rise_time,
    }


def _crossing(time: NDArray[np.float64], forward: NDArray[np.float64], before: int, level: float) -> float:
    """Return when a level is crossed upward between two samples: recordings have few of them in a rise."""
    pair = slice(before, before + 2)
    return float(np.interp(level, forward[pair], time[pair]))


def swings(
    time: NDArray[np.float64], forward: NDArray[np.float64], period: float, begin: float, cycles: int
) -> Features:
    """Return the features of each cycle of a fast gait; the arguments are those of `features`.

    Returns:
        Per cycle: ``speed``, mm/s; ``swing``, from the smallest to the largest position in the cycle, without
        the cycle's net travel, mm.
    """
    shares = np.linspace(0.0, 1.0, 51)
    starts = begin + period * np.arange(cycles)[:, None]
    position = np.interp(starts + period * shares, time, forward)
    stride = position[:, -1] - position[:, 0]
    return {
        "speed": 1e3 * stride / period,
        "swing": 1e3 * np.ptp(position - stride[:, None] * shares, axis=1),
    }


def fast_columns(found: Features) -> Row:
    """Return the table's cells about the fast gait: mean and standard error of each feature."""
    cells = {}
    for (name, values), unit in zip(found.items(), ("mm_s", "mm"), strict=True):
        cells[f"{name}_0.5s_{unit}"] = figure(values.mean(), 4)
        cells[f"{name}_0.5s_se_{unit}"] = figure(standard_error(values), 2)
    return cells


def columns(found: Features, gait: str) -> Row:
    """Return the table's cells about one gait: mean and standard error of each feature."""
    cells = {}
    for name, values in found.items():
        unit = "s" if name == "rise_time" else "mm"
        label = f"{name}_{gait.removeprefix('square-')}"
        cells[f"{label}_{unit}"] = figure(values.mean(), 4)
        cells[f"{label}_se_{unit}"] = figure(standard_error(values), 2)
    return cells


def read(trials: Path, trial: Trial) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the time, s, and the position, m, of a recording."""
    with (trials / trial.file).open(newline="", encoding="utf-8") as file:
        samples = np.array([(float(r["t_s"]), float(r["x_m"])) for r in csv.DictReader(file)])
    return samples[:, 0], samples[:, 1]


def real(trials: Path) -> Row:
    """Return the row of the real robot; its standard errors are over cycles."""
    baselines = NOMINAL.problem().baselines
    row: Row = {}
    for trial in TRIALS:
        period = baselines[trial.gait].period_s
        row |= columns(features(*read(trials, trial), period, trial.from_s, trial.cycles), trial.gait)
    period = baselines[FAST_TRIAL.gait].period_s
    row |= fast_columns(swings(*read(trials, FAST_TRIAL), period, FAST_TRIAL.from_s, FAST_TRIAL.cycles))
    return row | dict.fromkeys(MODEL_ONLY, "")


def extensions(simulator: Simulator, gait: Gait, executor: Executor) -> Row:
    """Return the cells about a gait of the model; its standard errors are over starts."""
    transient, measured = HORIZON.cycles(gait.period_s)
    begin = (transient + EXTENDS_AT) * gait.period_s - LEAD_S
    duration = begin + measured * gait.period_s + RISE_WINDOW_S

    def one(scenario: int) -> Features:
        trajectory = simulator.run(gait, scenario, duration)
        return features(trajectory.time, trajectory["marker.x"], gait.period_s, begin, measured)

    runs = list(executor.map(one, range(STARTS)))
    return columns({name: np.array([run[name].mean() for run in runs]) for name in runs[0]}, gait.name)


def fast(simulator: Simulator, executor: Executor) -> Row:
    """Return the cells about the fast gait; its standard errors are over starts."""
    problem, robot = simulator.problem, Robot.of(simulator.models[0])
    gait = problem.baselines[FAST_TRIAL.gait]

    def one(scenario: int) -> tuple[Features, Mapping[str, float]]:
        path = simulator.run(gait, scenario)
        return filmed(path, gait, FAST_TRIAL), measure(problem, gait, path, robot)

    runs = list(executor.map(one, range(STARTS)))
    row = fast_columns({name: np.array([found[name].mean() for found, _ in runs]) for name in runs[0][0]})
    row["sideways_0.5s_mm_s"] = figure(1e3 * float(np.mean([m["sideways_m_s"] for _, m in runs])), 4)
    for channel in problem.channel_names:
        row[f"reached_0.5s_{channel}"] = figure(float(np.mean([m[f"reached.{channel}"] for _, m in runs])), 3)
    return row


def filmed(path: Trajectory, gait: Gait, trial: Trial) -> Features:
    """Return the features of as many cycles as a trial has, after the first: the robot walks in a curve."""
    return swings(path.time, path["marker.x"], gait.period_s, gait.period_s, trial.cycles)


def varied(problem: Problem, executor: Executor) -> Row:
    """Return the mean speeds and their standard deviations over the problem's scenarios."""
    scenarios = draw_scenarios(problem, SCENARIOS, (SCENARIO_SEED,))
    simulator = Simulator.build(problem, scenarios, problem.simulation.reference)
    row: Row = {}
    for trial in VARIED:
        gait = problem.baselines[trial.gait]
        duration = (1 + trial.cycles) * gait.period_s

        def speed(
            scenario: int, gait: Gait = gait, trial: Trial = trial, duration: float = duration
        ) -> float:
            return float(filmed(simulator.run(gait, scenario, duration), gait, trial)["speed"].mean())

        speeds = np.array(list(executor.map(speed, range(SCENARIOS))))
        label = trial.gait.removeprefix("square-")
        row[f"varied_{label}_mm_s"] = figure(speeds.mean(), 4)
        row[f"varied_{label}_sd_mm_s"] = figure(float(np.std(speeds, ddof=1)), 2)
    return row


def simulated(problem: Problem, fidelity: Fidelity, executor: Executor) -> Row:
    """Return the row of one choice of the model; at the reference fidelity also over scenarios."""
    simulator = Simulator.build(problem, perturbed(STARTS), fidelity)
    row: Row = {}
    for trial in TRIALS:
        row |= extensions(simulator, problem.baselines[trial.gait], executor)
    row |= fast(simulator, executor)
    if fidelity == problem.simulation.reference:
        row |= varied(problem, executor)
    return row


@contextmanager
def welded() -> Iterator[Problem]:
    """Give the nominal problem with its loop closed by a weld, as published, not by joint angles."""
    problem = NOMINAL.problem()
    root = ET.fromstring(problem.model_path.read_text(encoding="utf-8"))
    equality = root.find("equality")
    assert equality is not None
    equality.clear()
    ET.SubElement(equality, "weld", body1="tail_right", body2="tail_bot")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / problem.model_path.name
        path.write_text(ET.tostring(root, encoding="unicode"), encoding="utf-8")
        yield replace(problem, model_path=path)


def fill(table: KeptTable, name: str, problem: Problem, fidelity: Fidelity, executor: Executor) -> None:
    """Add the row of a choice unless it is there."""
    key = {"choice": name, "model": fingerprint(problem), "timestep_s": repr(fidelity.timestep_s)}
    table.fill(key, lambda: [simulated(problem, fidelity, executor)])


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--trials", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    table = KeptTable(options.out / "servo.csv", ("choice", "model", "timestep_s"))
    trials = (*TRIALS, FAST_TRIAL)
    if options.trials and all((options.trials / trial.file).is_file() for trial in trials):
        table.fill({"choice": REAL, "model": "", "timestep_s": ""}, lambda: [real(options.trials)])
    else:
        print(f"no real trials in {options.trials}: their row is left as it is")
    with ThreadPoolExecutor(options.threads) as executor:
        for choice in SPEEDS:
            problem = choice.problem()
            fill(table, choice.name, problem, problem.simulation.reference, executor)
        for choice in OTHERS:
            problem = choice.problem()
            fill(table, choice.name, problem, problem.simulation.working, executor)
        with welded() as problem:
            fill(table, WELD, problem, problem.simulation.working, executor)


if __name__ == "__main__":
    main()
