"""Plans: gaits that are good for the reduced planar model, found in seconds, without steps of MuJoCo.

A plan is a warm start. It predicts only what a model without sideways motion, yaw, roll dynamics and
landing can; `planar` has the equations.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gaitopt.core.errors import GaitoptError, unknown_name
from gaitopt.core.streams import seeded
from gaitopt.gait.gait import Channel, Gait
from gaitopt.plan.collocation import Collocation, Solution
from gaitopt.plan.gait_vector import CHANNEL_STARTS, GaitBounds, Vector, gait_distance, random_gait
from gaitopt.plan.parameters import planar_parameters
from gaitopt.plan.planar import PlanarModel
from gaitopt.problem.problem import Problem

Index = list[int]

MISSES = (
    "the planar model knows no sideways motion, yaw, roll dynamics or landing: it predicts gaits that "
    "drift too fast"
)
"""What every predicted speed neglects."""


@dataclass(frozen=True)
class PlanSettings:
    """How hard to plan; every limit is a count.

    Attributes:
        n_intervals: collocation intervals per cycle.
        widths: friction widths, m/s, tightened from one to the next.
        ramp: least ramp of an edge, cycles.
        n_samples: random gaits among which starts are chosen.
        n_starts: how many starts are optimised at each width; slower ones are dropped.
        iterations: IPOPT's limit at each width.
        n_elites: number of plans in the result.
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

    def to_dict(self) -> dict[str, object]:
        """Return the elite for a JSON file."""
        return {"predicted_speed_m_s": self.predicted_speed_m_s, "gait": self.gait.to_dict()}


@dataclass(frozen=True)
class Plan:
    """The result of planning.

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

    def to_dict(self) -> dict[str, object]:
        """Return the plan for a JSON file."""
        return {
            "elites": [elite.to_dict() for elite in self.elites],
            "baselines": [
                {"name": name, "predicted_speed_m_s": speed, "creep_m_s": self.creep[name]}
                for name, speed in self.baselines.items()
            ],
            "dropped": list(self.dropped),
            "misses": MISSES,
        }


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

        At every width a solution counts only if plain integration of its gait confirms the collocated speed.
        IPOPT's status does not matter: a point at its iteration limit is a gait, too. A start without a
        confirmed solution is dropped, with the reason.
        """
        found, dropped = self._optimised(self._starts())
        width = self.settings.widths[-1]
        baselines = {name: self.vector(gait) for name, gait in self.problem.baselines.items()}
        return Plan(
            self._elites(found),
            dropped,
            {name: self.model.speed(vector, width) for name, vector in baselines.items()},
            {name: self.model.creep(vector, width) for name, vector in baselines.items()},
        )

    def _optimised(self, starts: Sequence[Vector]) -> tuple[list[tuple[Vector, float]], tuple[str, ...]]:
        """Return confirmed gait vectors with their speeds at the last width, m/s, and the dropped starts."""
        settings = self.settings
        collocation = Collocation(
            self.model, self.bounds, settings.n_intervals, settings.ramp, settings.iterations
        )
        points = {k: collocation.guess(start, settings.widths[0]) for k, start in enumerate(starts)}
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
                    failed[k] = _reason(solution, speed)
                    continue
                points[k], speeds[k] = solution.point, speed
                good.add(k)
                found.append((solution.gait, self.model.speed(solution.gait, settings.widths[-1])))
            running = sorted(speeds, key=lambda k: -speeds[k])
        return found, tuple(f"start {k}: {why}" for k, why in failed.items() if k not in good)

    def _elites(self, found: Iterable[tuple[Vector, float]]) -> tuple[Elite, ...]:
        chosen: list[tuple[Vector, float]] = []
        for vector, speed in sorted(found, key=lambda pair: -pair[1]):
            apart = all(gait_distance(vector, other) > self.settings.separation for other, _ in chosen)
            if apart and speed > 0.0 and len(chosen) < self.settings.n_elites:
                chosen.append((vector, speed))
        return tuple(Elite(self._gait(v, f"plan-{i + 1}"), s) for i, (v, s) in enumerate(chosen))

    def _starts(self) -> list[Vector]:
        """Return the baselines, then the fastest of a random sample on a smooth model."""
        settings, rng = self.settings, seeded(self.settings.seed)
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


def confirmed(collocated: float, integrated: float) -> bool:
    """Return whether two speeds agree to a tenth and 1 mm/s."""
    return abs(integrated - collocated) <= 0.1 * abs(collocated) + 1e-3


def _reason(solution: Solution, integrated: float) -> str:
    """Return why a solution does not count: its speed, and what plain integration gives, mm/s."""
    return f"{1e3 * solution.speed:.1f} mm/s planned, {1e3 * integrated:.1f} integrated ({solution.status})"
