"""Does the simulated speed depend on the timestep, and how fast do nearby starts part?

    python tests/studies/convergence.py --out results/convergence

Writes convergence.csv and convergence.png (speed of each gait against timestep and integrator, over perturbed
starts; also for other choices of the model) and chaos.csv and growth.png (distance in time of starts that
differ by a millionth of a radian). Existing rows of the same model are kept, so an interrupted run continues
where it stopped.

Cost: 20 min of two cores.
"""

from __future__ import annotations

import argparse
import hashlib
import math
import time
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from kept_table import KeptTable, Row
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gaitopt.core.files import write_with
from gaitopt.gait.gait import Channel, Gait
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.problem.records import Fidelity, Horizon, Parameter
from gaitopt.problem.robot import Robot
from gaitopt.report.figures.style import COLOURS, STYLES
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario

STARTS = 16
START_SPREAD_RAD = 0.005
NUDGE_RAD = 1e-6
PARTED_MM = 0.01
"""A pair this far apart has parted, m. The perturbation alone moves the marker by a hundredth of this."""

CHAOS_S = 10.0
CHAOS_CYCLES = 6

HORIZON = Horizon(transient_s=3.0, transient_cycles=1, measured_s=10.0, measured_cycles=3)
"""Longer than a search needs: 1 + 3 cycles at 4 s, 2 + 5 at 2 s, 3 + 10 at 1 s, 6 + 20 at 0.5 s."""

LEVELS = (
    Fidelity(timestep_s=1e-3, integrator="implicitfast"),
    Fidelity(timestep_s=5e-4, integrator="implicitfast"),
    Fidelity(timestep_s=2e-4, integrator="implicitfast"),
    Fidelity(timestep_s=1e-4, integrator="implicitfast"),
    Fidelity(timestep_s=1e-4, integrator="RK4"),
)

FAST = Gait(
    0.312,
    {
        "mid_act": Channel(duty=0.556, phase=0.02, amplitude_deg=90.0),
        "foot1": Channel(duty=0.556, phase=0.78, amplitude_deg=-18.7),
        "foot2": Channel(duty=0.492, phase=0.0, amplitude_deg=-16.6),
    },
    "fast",
)
"""A gait that an early search found, rounded. A timestep must be good enough for such gaits too."""

LOOP_JOINTS = {
    "first_left": -0.5,
    "last_left": -0.5,
    "mid_right": 1.0,
    "first_right": -0.5,
    "last_right": -0.5,
}
"""Hinge angles as shares of that of ``mid_left``, where the Sarrus loop is closed."""


@dataclass(frozen=True)
class Choice:
    """One choice of what the documents of the robot leave open.

    Attributes:
        name: what is chosen, in words.
        parameters: named parameters of the problem to change.
        mjcf: MJCF attributes to change: XPath ending in ``/@attribute``, and the text to write.
    """

    name: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    mjcf: Mapping[str, str] = field(default_factory=dict)

    def problem(self) -> Problem:
        """Return the ArcFold problem with this choice and the horizon of the studies."""
        problem = load_problem("arcfold", self.parameters)
        file = problem.file
        simulation = file.simulation.model_copy(update={"horizon": HORIZON})
        edited = {"choice": Parameter(value=0.0, unit="", origin=self.name, sets=dict(self.mjcf))}
        update = {"simulation": simulation, "parameters": file.parameters | edited}
        return Problem.from_file(file.model_copy(update=update), problem.source, problem.model_path)


def contact_stiffness(time_constant_s: float) -> dict[str, str]:
    """Return the edit that sets the time constant of the ground contact."""
    return {"default/geom/@solref": f"{time_constant_s!r} 1"}


def loop_stiffness(time_constant_s: float) -> dict[str, str]:
    """Return the edit that sets the time constant of the loop's closure."""
    return {"default/equality/@solref": f"{time_constant_s!r} 1"}


NOMINAL = Choice("nominal")
OTHERS = (
    Choice("contact solref 0.005", mjcf=contact_stiffness(0.005)),
    Choice("contact solref 0.02", mjcf=contact_stiffness(0.02)),
    Choice("impratio 100", mjcf={"option/@impratio": "100"}),
    Choice("armature 1e-5", {"armature": 1e-5}),
    Choice("b_motor 0.04", {"b_motor": 0.04}),
    Choice(
        "loop as MuJoCo's default",
        mjcf=loop_stiffness(0.02) | {"default/equality/@solimp": "0.9 0.95 0.001 0.5 2"},
    ),
)
"""Choices that were rejected or are similar, for the two most sensitive gaits."""

OTHERS_GAITS = ("square-1s", "square-0.5s")
OTHERS_LEVELS = (LEVELS[0], LEVELS[2])


def fingerprint(problem: Problem) -> str:
    """Return eight digits that change with the model, but not with its resting pose."""
    root = ET.fromstring(nominal_mjcf(problem))
    for keyframes in root.findall("keyframe"):
        root.remove(keyframes)
    return hashlib.sha256(ET.tostring(root)).hexdigest()[:8]


def perturbed(count: int = STARTS, more_rad: float = 0.0) -> tuple[Scenario, ...]:
    """Return starts with errors on every joint and the heading.

    Args:
        count: how many.
        more_rad: added to the errors' standard deviation; the errors of two sets are proportional,
            so this perturbs each start by that much.
    """
    spread = START_SPREAD_RAD + more_rad
    return tuple(Scenario(start_pose_rad=spread, pose_seed=seed) for seed in range(count))


def figure(value: float, digits: int = 5) -> str:
    """Return a number for a table."""
    return f"{value:.{digits}g}"


def standard_error(values: NDArray[np.float64]) -> float:
    """Return the standard error of a mean."""
    return float(np.std(values, ddof=1) / math.sqrt(len(values)))


def loop_error(trajectory: Trajectory, after_s: float) -> float:
    """Return how far the hinges are off the closed loop from some time on, rad."""
    late = trajectory.time >= after_s
    mid = trajectory["joint.mid_left"]
    strayed = (trajectory[f"joint.{name}"] - share * mid for name, share in LOOP_JOINTS.items())
    return max(float(np.abs(error[late]).max()) for error in strayed)


def speeds(simulator: Simulator, gait: Gait, executor: Executor) -> Row:
    """Run a gait from every start and return the table's row about its speed."""
    robot = Robot.of(simulator.models[0])

    def one(scenario: int) -> dict[str, float]:
        trajectory = simulator.run(gait, scenario)
        metrics = measure(simulator.problem, gait, trajectory, robot)
        own = trajectory["contacts_all"] - trajectory["contacts"]
        return metrics | {"loop": loop_error(trajectory, HORIZON.transient_s), "self": float(own.max())}

    began = time.process_time()
    rows = list(executor.map(one, range(len(simulator.scenarios))))
    spent = time.process_time() - began
    found = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    forward, sideways = 1e3 * found["speed_m_s"], 1e3 * found["sideways_m_s"]
    simulated = len(rows) * simulator.duration(gait)
    return {
        "starts": str(len(rows)),
        "speed_mm_s": figure(forward.mean()),
        "speed_se_mm_s": figure(standard_error(forward), 2),
        "speed_min_mm_s": figure(forward.min()),
        "speed_max_mm_s": figure(forward.max()),
        "sideways_mm_s": figure(sideways.mean()),
        "sideways_se_mm_s": figure(standard_error(sideways), 2),
        "yaw_deg_s": figure(np.rad2deg(found["yaw_rate_rad_s"].mean()), 3),
        "airtime": figure(found["airtime"].mean(), 3),
        "tilt_deg": figure(np.rad2deg(found["tilt_rad"].max()), 3),
        "penetration_mm": figure(1e3 * found["penetration_m"].max(), 3),
        "reached": figure(found["reached"].mean(), 3),
        "loop_error_rad": figure(found["loop"].max(), 2),
        "self_contacts": figure(found["self"].max(), 3),
        "simulated_s": figure(simulated),
        "cpu_us_per_step": figure(1e6 * spent * simulator.fidelity.timestep_s / simulated, 3),
    }


def converge(out: Path, executor: Executor) -> KeptTable:
    """Fill convergence.csv."""
    table = KeptTable(out / "convergence.csv", ("choice", "gait", "integrator", "timestep_s", "model"))
    for choice in (NOMINAL, *OTHERS):
        problem = choice.problem()
        levels = LEVELS if choice is NOMINAL else OTHERS_LEVELS
        names = problem.baselines if choice is NOMINAL else OTHERS_GAITS
        gaits = [problem.baselines[name] for name in names] + ([FAST] if choice is NOMINAL else [])
        model = fingerprint(problem)
        simulator = Simulator.build(problem, perturbed())
        for gait in gaits:
            for level in levels:
                key = {
                    "choice": choice.name,
                    "gait": gait.name,
                    "integrator": level.integrator,
                    "timestep_s": repr(level.timestep_s),
                    "model": model,
                }
                finer = simulator.at(level)

                def row(finer: Simulator = finer, gait: Gait = gait) -> list[Row]:
                    return [speeds(finer, gait, executor)]

                table.fill(key, row)
    return table


def growth(simulator: Simulator, nudged: Simulator, gait: Gait, executor: Executor) -> Iterator[Row]:
    """Yield the distance of perturbed pairs, four times per cycle, and the share of them that has parted."""
    duration = max(CHAOS_S, CHAOS_CYCLES * gait.period_s)
    pairs = range(len(simulator.scenarios))
    apart = []
    for one, other in zip(
        executor.map(lambda i: simulator.run(gait, i, duration), pairs),
        executor.map(lambda i: nudged.run(gait, i, duration), pairs),
        strict=True,
    ):
        between = one.stacked("marker") - other.stacked("marker")
        apart.append(np.hypot(between[:, 0], between[:, 1]))
        clock = one.time
    for at in np.arange(1, round(4 * duration / gait.period_s) + 1) * gait.period_s / 4.0:
        sample = min(int(np.searchsorted(clock, at - 1e-9)), len(clock) - 1)
        distance = 1e3 * np.array([series[sample] for series in apart])
        yield {
            "pairs": str(len(apart)),
            "time_s": figure(at),
            "apart_mm": figure(math.exp(np.log(np.maximum(distance, 1e-15)).mean()), 3),
            "apart_min_mm": figure(distance.min(), 3),
            "apart_max_mm": figure(distance.max(), 3),
            "share_parted": figure((distance > PARTED_MM).mean(), 3),
        }


def part(out: Path, executor: Executor) -> KeptTable:
    """Fill chaos.csv."""
    table = KeptTable(out / "chaos.csv", ("gait", "integrator", "timestep_s", "model"))
    problem = NOMINAL.problem()
    model = fingerprint(problem)
    starts = Simulator.build(problem, perturbed())
    nudged = Simulator.build(problem, perturbed(more_rad=NUDGE_RAD))
    for level in (problem.simulation.working, problem.simulation.reference):
        for gait in (*problem.baselines.values(), FAST):
            key = {
                "gait": gait.name,
                "integrator": level.integrator,
                "timestep_s": repr(level.timestep_s),
                "model": model,
            }
            table.fill(key, partial(growth, starts.at(level), nudged.at(level), gait, executor))
    return table


def gait_names(table: KeptTable) -> list[str]:
    """Return the gaits of a table in their order, slowest first."""
    names = dict.fromkeys(row["gait"] for row in table.rows)
    return sorted(names, key=lambda name: (name == FAST.name, -_period(name)))


def _period(name: str) -> float:
    return FAST.period_s if name == FAST.name else load_problem("arcfold").baselines[name].period_s


def _title(name: str) -> str:
    return f"{name} (period {_period(name):g} s)"


def _finish(axes: Axes, title: str, x: str, y: str) -> None:
    axes.set_title(title, loc="left", fontsize=10)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(color="0.85", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def draw_convergence(table: KeptTable, path: Path) -> None:
    """Draw speed against timestep: mean, standard error, and the range of the starts."""
    gaits = gait_names(table)
    columns = 3
    lines = math.ceil((len(gaits) + 1) / columns)
    drawing, grid = plt.subplots(lines, columns, figsize=(10.5, 3.1 * lines), layout="constrained")
    kinds = (("implicitfast", COLOURS[0], "o", 1.0), ("RK4", COLOURS[5], "s", 1.12))
    for axes, gait in zip(grid.flat, gaits, strict=False):
        for integrator, colour, marker, shift in kinds:
            rows = table.find(choice=NOMINAL.name, gait=gait, integrator=integrator)
            read = {name: np.array([float(row[name]) for row in rows]) for name in _DRAWN}
            step = 1e3 * shift * read["timestep_s"]
            mean, low, high = (read[f"speed{part}_mm_s"] for part in ("", "_min", "_max"))
            axes.vlines(step, low, high, color=colour, linewidth=1.0, alpha=0.5)
            error = read["speed_se_mm_s"]
            axes.errorbar(
                step, mean, error, color=colour, marker=marker, linestyle="", elinewidth=3, markersize=5
            )
        axes.set_xscale("log")
        axes.set_xticks([0.1, 0.2, 0.5, 1.0], ["0.1", "0.2", "0.5", "1"])
        axes.minorticks_off()
        allowed = max(0.05 * mean[0], 0.5)
        axes.margins(0.1, 0.15)
        _finish(
            axes,
            f"{_title(gait)}\nallowed change ±{allowed:.2g} mm/s",
            "timestep [ms]",
            "forward speed [mm/s]",
        )
    for axes in list(grid.flat)[len(gaits) :]:
        axes.axis("off")
        for integrator, colour, marker, shift in kinds:
            label = f"{integrator}, mean" + (" (drawn beside 0.1 ms)" if shift != 1.0 else "")
            axes.plot([], [], color=colour, marker=marker, linestyle="", label=label)
        axes.plot([], [], color="0.3", linewidth=3, label="± standard error")
        axes.plot([], [], color="0.6", linewidth=1, label="slowest to fastest start")
        axes.legend(loc="center", frameon=False, title=f"{STARTS} perturbed starts")
    write_with(path, lambda temporary: drawing.savefig(temporary, dpi=110))


_DRAWN = ("timestep_s", "speed_mm_s", "speed_se_mm_s", "speed_min_mm_s", "speed_max_mm_s")


def draw_growth(table: KeptTable, path: Path) -> None:
    """Draw the distance of perturbed pairs over time, at the working and at the reference fidelity."""
    gaits = gait_names(table)
    levels = list(dict.fromkeys((row["integrator"], row["timestep_s"]) for row in table.rows))
    drawing, grid = plt.subplots(
        2, len(levels), figsize=(10.5, 6.4), layout="constrained", sharex=True, sharey="row", squeeze=False
    )
    for (distance, share), (integrator, timestep) in zip(grid.T, levels, strict=True):
        for index, gait in enumerate(gaits):
            rows = table.find(gait=gait, integrator=integrator, timestep_s=timestep)
            time_s, apart, parted = (
                [float(row[name]) for row in rows] for name in ("time_s", "apart_mm", "share_parted")
            )
            look = {"color": COLOURS[index], "linestyle": STYLES[index], "label": _title(gait)}
            distance.plot(time_s, apart, **look)
            share.plot(time_s, parted, **look)
        distance.set_yscale("log")
        title = f"{integrator}, {1e3 * float(timestep):g} ms"
        _finish(distance, title, "", "marker apart, geometric mean [mm]")
        _finish(share, "", "time [s]", f"share of pairs over {PARTED_MM:g} mm apart")
    grid[0, 0].legend(fontsize=8, framealpha=0.9, loc="upper right")
    write_with(path, lambda temporary: drawing.savefig(temporary, dpi=110))


def main() -> None:
    """Run the study and draw its figures."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(options.threads) as executor:
        chaos = part(options.out, executor)
        draw_growth(chaos, options.out / "growth.png")
        speed = converge(options.out, executor)
        draw_convergence(speed, options.out / "convergence.png")


if __name__ == "__main__":
    main()
