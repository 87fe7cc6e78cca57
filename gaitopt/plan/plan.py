"""Plans: gaits that are good for the reduced planar model, found in seconds and without MuJoCo's steps.

A plan is a warm start. What it predicts is what a model without sideways motion, yaw, roll dynamics
and landing can know; `planar` has the equations.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from gaitopt.core.errors import GaitoptError, unknown_name
from gaitopt.gait.gait import Channel, Gait
from gaitopt.plan.planar import (
    CHANNEL_STARTS,
    N_GAIT,
    Collocation,
    GaitBounds,
    PlanarModel,
    PlanarParameters,
    Vector,
)
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Planar

Index = list[int]

MISSES = (
    "the planar model knows no sideways motion, yaw, roll dynamics or landing: it predicts gaits that "
    "drift too fast"
)
"""What to bear in mind with every predicted speed."""


@dataclass(frozen=True)
class PlanSettings:
    """How hard to plan; every limit is a count.

    Attributes:
        n_intervals: collocation intervals per cycle.
        widths: friction widths, m/s, tightened from one to the next.
        ramp: least ramp of an edge, cycles.
        n_samples: random gaits among which starts are chosen.
        n_starts: how many starts are optimised at each width; the slower are left behind.
        iterations: IPOPT's limit at each width.
        n_elites: how many plans are handed over.
        separation: least distance of two elites, as in `gait_distance`.
        seed: seed of the random gaits.
    """

    n_intervals: int = 40
    widths: tuple[float, ...] = (0.03, 0.01, 0.005)
    ramp: float = 0.03
    n_samples: int = 96
    n_starts: tuple[int, ...] = (20, 9, 6)
    iterations: int = 40
    n_elites: int = 5
    separation: float = 0.1
    seed: int = 0


@dataclass(frozen=True)
class Elite:
    """A planned gait and the speed that the planar model predicts for it, by plain integration, m/s."""

    gait: Gait
    predicted_speed_m_s: float


@dataclass(frozen=True)
class Plan:
    """What planning gave.

    Attributes:
        elites: distinct gaits, fastest first; empty where no start converged.
        dropped: one line for each start that was dropped, with the reason.
        baselines: predicted speed of each baseline, m/s.
        creep: speed that the smoothing of friction adds to each baseline (negative: takes), m/s.
    """

    elites: tuple[Elite, ...]
    dropped: tuple[str, ...]
    baselines: dict[str, float]
    creep: dict[str, float]


class Planner:
    """The planar model of one problem, and the map between its gait vectors and gaits."""

    def __init__(self, problem: Problem, settings: PlanSettings | None = None):
        """Derive the planar model.

        Raises:
            GaitoptError: the problem has no planar section or no gait space, or the section names parts that
                do not exist.
        """
        section = problem.file.planar
        if section is None:
            raise GaitoptError(f"{problem.source}: no [planar] section, so nothing can be planned")
        problem.require("plan", "[gait]")
        self.problem = problem
        self.settings = settings or PlanSettings()
        self.channels = (section.middle, section.rear_foot, section.front_foot)
        if sorted(self.channels) != sorted(problem.channel_names):
            raise unknown_name(
                f"{problem.source}: planar", "set of channels", self.channels, problem.channel_names
            )
        self.model = PlanarModel(planar_parameters(problem, section))
        self.bounds = self._bounds()

    def predicted_speed(self, gait: Gait) -> float:
        """Return the planar model's speed of a gait, m/s, its edges no sharper than planning allows."""
        return self.model.speed(self.vector(gait), self.settings.widths[-1])

    def plan(self) -> Plan:
        """Optimise from many starts and keep distinct elites.

        At every width a solution counts only when plain integration of its gait confirms the
        collocated speed, whatever IPOPT's status: a point that IPOPT left at its limit is a gait like
        any other. A start without a confirmed solution is dropped and said so.
        """
        settings, bounds = self.settings, self.bounds
        collocation = Collocation(
            self.model, bounds, settings.n_intervals, settings.ramp, settings.iterations
        )
        points = {k: collocation.guess(s, settings.widths[0]) for k, s in enumerate(self._starts())}
        found: list[tuple[Vector, float]] = []
        good: set[int] = set()
        failed: dict[int, str] = {}
        running = list(points)
        for width, n_kept in zip(settings.widths, settings.n_starts, strict=True):
            speeds = {}
            for k in running[:n_kept]:
                solution = collocation.solve(points[k], width)
                speed = self.model.speed(solution.gait, width)
                if not confirmed(solution.speed, speed):
                    failed[k] = (
                        f"{1e3 * solution.speed:.1f} mm/s planned, {1e3 * speed:.1f} integrated "
                        f"({solution.status})"
                    )
                    continue
                points[k], speeds[k] = solution.point, speed
                good.add(k)
                found.append((solution.gait, self.model.speed(solution.gait, settings.widths[-1])))
            running = sorted(speeds, key=lambda k: -speeds[k])
        dropped = tuple(f"start {k}: {why}" for k, why in failed.items() if k not in good)
        baselines = {name: self.vector(gait) for name, gait in self.problem.baselines.items()}
        width = settings.widths[-1]
        return Plan(
            self._elites(found),
            dropped,
            {name: self.model.speed(vector, width) for name, vector in baselines.items()},
            {name: self.model.creep(vector, width) for name, vector in baselines.items()},
        )

    def _elites(self, found: Iterable[tuple[Vector, float]]) -> tuple[Elite, ...]:
        chosen: list[tuple[Vector, float]] = []
        for vector, speed in sorted(found, key=lambda pair: -pair[1]):
            apart = all(gait_distance(vector, other) > self.settings.separation for other, _ in chosen)
            if apart and speed > 0.0 and len(chosen) < self.settings.n_elites:
                chosen.append((vector, speed))
        return tuple(Elite(self._gait(v, f"plan-{i + 1}"), s) for i, (v, s) in enumerate(chosen))

    def _starts(self) -> list[Vector]:
        """Return the baselines, then the fastest of a random sample on a smooth model."""
        settings, rng = self.settings, np.random.default_rng(self.settings.seed)
        baselines = [self.vector(gait) for gait in self.problem.baselines.values()]
        sample = [random_gait(self.bounds, rng) for _ in range(settings.n_samples)]
        speeds = [self.model.speed(gait, settings.widths[0]) for gait in sample]
        fastest = np.argsort(speeds, kind="stable")[::-1]
        wanted = max(0, settings.n_starts[0] - len(baselines))
        return [*baselines, *(sample[i] for i in fastest[:wanted])]

    def _bounds(self) -> GaitBounds:
        """Return the search's own bounds as the planar model's gait vectors have them."""
        low, high = self.problem.space.period_s
        lower, upper = [low], [high]
        spaces = [self.problem.space.channels[name] for name in self.channels]
        for space in spaces:
            angles = np.deg2rad([space.amplitude_deg, space.range_deg])
            lower += [space.duty[0], 0.0, *angles[:, 0], space.smoothing[0]]
            upper += [space.duty[1], 1.0, *angles[:, 1], space.smoothing[1]]
        ranges = np.deg2rad([space.range_deg for space in spaces])
        return GaitBounds(np.array(lower), np.array(upper), ranges[:, 0], ranges[:, 1])

    def vector(self, gait: Gait) -> Vector:
        """Return a gait as the planar model's vector, its ramps no shorter than planning allows."""
        vector = [gait.period_s]
        for name in self.channels:
            channel = gait.channels[name]
            share = max(
                channel.smoothing, self.settings.ramp / max(1e-9, min(channel.duty, 1.0 - channel.duty))
            )
            angles = np.deg2rad([channel.amplitude_deg, channel.offset_deg]).tolist()
            vector += [channel.duty, channel.phase, *angles, min(1.0, share)]
        return np.array(vector)

    def _gait(self, vector: Vector, name: str) -> Gait:
        """Return the gait of a vector, inside the search's bounds to the last bit."""
        channels = {}
        for start, channel in zip(CHANNEL_STARTS, self.channels, strict=True):
            duty, phase, amplitude, offset, smoothing = vector[start : start + 5].tolist()
            channels[channel] = Channel(
                duty=duty,
                phase=phase % 1.0,
                amplitude_deg=math.degrees(amplitude),
                offset_deg=math.degrees(offset),
                smoothing=min(1.0, max(0.0, smoothing)),
            )
        ordered = {channel: channels[channel] for channel in self.problem.channel_names}
        space = self.problem.space
        return space.decode(space.encode(Gait(float(vector[0]), ordered)), name)


def planar_parameters(problem: Problem, section: Planar) -> PlanarParameters:
    """Read the planar crawler off the compiled model, flat and with its pads retracted.

    Raises:
        GaitoptError: the section names a part that the MJCF does not have.
    """
    model = build_model(problem)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)

    def ids(kind: str, names: Sequence[str], count: int) -> Index:
        known = [getattr(model, kind)(i).name for i in range(count)]
        for name in names:
            if name not in known:
                raise unknown_name(f"{problem.source}: planar", kind, name, [n for n in known if n])
        return [known.index(name) for name in names]

    rear = ids("body", section.rear_bodies, model.nbody)
    front = ids("body", section.front_bodies, model.nbody)
    links = ids("body", section.links, model.nbody)
    pads = ids("geom", [section.rear_pad, section.front_pad], model.ngeom)
    floors = ids("geom", [section.rear_underside, section.front_underside], model.ngeom)
    servo, foot = ids("actuator", [section.middle, section.rear_foot], model.nu)
    middle, foot_joint = (int(model.actuator_trnid[i, 0]) for i in (servo, foot))
    rear_mass, rear_x = _centre_of_mass(model, data, rear)
    front_mass, front_x = _centre_of_mass(model, data, front)
    length = 2.0 * model.geom_size[floors[0], 0]
    edges = data.geom_xpos[floors, 0] - length / 2.0
    stiffness, damping = _reflected_hinges(model, middle)
    values = {
        "rear_mass": rear_mass,
        "front_mass": front_mass,
        "arch_mass": model.body_mass.sum() - rear_mass - front_mass,
        "link_length": data.xpos[links[1], 0] - data.xpos[links[0], 0],
        "module_length": length,
        "module_half_width": model.geom_size[floors[0], 1],
        "rear_com": rear_x - edges[0],
        "front_com": front_x - edges[1],
        "rear_pad": data.geom_xpos[pads[0], 0] - edges[0],
        "front_pad": data.geom_xpos[pads[1], 0] - edges[1],
        "pad_half_width": model.geom_size[pads[0], 1],
        "pad_half_thickness": model.geom_size[pads[0], 2],
        "underside": data.xanchor[foot_joint, 2]
        - data.geom_xpos[floors[0], 2]
        + model.geom_size[floors[0], 2],
        "mu_pad": model.geom_friction[pads[0], 0],
        "mu_body": model.geom_friction[floors[0], 0],
        "hinge_stiffness": stiffness,
        "hinge_damping": damping,
        "servo_gain": model.actuator_gainprm[servo, 0],
        "servo_torque_limit": model.actuator_forcerange[servo, 1],
        "servo_damping": model.dof_damping[model.jnt_dofadr[middle]],
        "gravity": float(np.linalg.norm(model.opt.gravity)),
    }
    return PlanarParameters(**{key: float(value) for key, value in values.items()})


def _centre_of_mass(model: mujoco.MjModel, data: mujoco.MjData, bodies: Index) -> tuple[float, float]:
    """Return the mass of some bodies, kg, and the forward place of their centre, m."""
    mass = model.body_mass[bodies]
    return float(mass.sum()), float(mass @ data.xipos[bodies, 0] / mass.sum())


def _reflected_hinges(model: mujoco.MjModel, middle: int) -> tuple[float, float]:
    """Return stiffness and damping of the passive joints about the middle angle, through the couplings."""
    stiffness = float(model.jnt_stiffness[middle])
    damping = 0.0
    for i in np.flatnonzero(model.eq_type == mujoco.mjtEq.mjEQ_JOINT):
        if model.eq_obj2id[i] == middle:
            joint, ratio = model.eq_obj1id[i], model.eq_data[i, 1]
            stiffness += float(ratio**2 * model.jnt_stiffness[joint])
            damping += float(ratio**2 * model.dof_damping[model.jnt_dofadr[joint]])
    return stiffness, damping


def gait_distance(a: Vector, b: Vector) -> float:
    """Return the root mean square difference of two gait vectors over natural scales.

    Period by its logarithm, phases in cycles relative to the middle channel (going round), angles
    by 90 degrees.
    """
    parts = [math.log(a[0] / b[0])]
    for c in CHANNEL_STARTS:
        turn = (a[c + 1] - a[2]) - (b[c + 1] - b[2])
        parts += [a[c] - b[c], turn - round(turn)]
        parts += [(a[c + 2] - b[c + 2]) * 2 / math.pi, (a[c + 3] - b[c + 3]) * 2 / math.pi]
    return float(np.sqrt(np.mean(np.square(parts))))


def random_gait(bounds: GaitBounds, rng: np.random.Generator) -> Vector:
    """Return a gait vector within bounds: period log-uniform, commanded angles in range."""
    gait = rng.uniform(bounds.lower, bounds.upper)
    assert gait.shape == (N_GAIT,)
    gait[0] = math.exp(rng.uniform(*np.log([bounds.lower[0], bounds.upper[0]])))
    for i, c in enumerate(CHANNEL_STARTS):
        low, high = bounds.angle_lower[i], bounds.angle_upper[i]
        ends = np.sort(rng.uniform(low, high, 2))
        at_rest, moved = ends if bounds.upper[c + 2] > 0 else ends[::-1]
        gait[c + 2], gait[c + 3] = moved - at_rest, at_rest
    return gait


def confirmed(collocated: float, integrated: float) -> bool:
    """Return whether two speeds agree to a tenth and 1 mm/s."""
    return abs(integrated - collocated) <= 0.1 * abs(collocated) + 1e-3


def plan_rows(plan: Plan) -> dict[str, Any]:
    """Return a plan for a JSON file."""
    return {
        "elites": [
            {"predicted_speed_m_s": elite.predicted_speed_m_s, "gait": elite.gait.to_dict()}
            for elite in plan.elites
        ],
        "baselines": [
            {"name": name, "predicted_speed_m_s": speed, "creep_m_s": plan.creep[name]}
            for name, speed in plan.baselines.items()
        ],
        "dropped": list(plan.dropped),
        "misses": MISSES,
    }
