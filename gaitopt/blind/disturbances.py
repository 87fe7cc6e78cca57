"""Disturbances that are not in the library of effects: blind cases with a cause that it does not contain."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.active import RobotEffects
from gaitopt.effects.effect import Update, loop_interval_s
from gaitopt.effects.library.friction import Friction
from gaitopt.effects.parts import Parts
from gaitopt.robot.signals import MARKER
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]

Figures = Mapping[str, float]
"""What was drawn for a disturbance."""


@dataclass(frozen=True)
class Disturbance:
    """One kind of disturbance.

    Attributes:
        name: its name.
        summary: what it is.
        draw: returns its figures, of a size between 0 and 1.
        act: returns what edits the running model, called with sensor data and gait time, s.
    """

    name: str
    summary: str
    draw: Callable[[np.random.Generator, float, Simulator], dict[str, float]]
    act: Callable[[mujoco.MjModel, Simulator, Figures], Callable[[Array, float], None]]

    def __reduce__(self) -> tuple[Callable[[str], Disturbance], tuple[str]]:
        """Travel to another process by name, as effects do: every process has the same disturbances."""
        return _by_name, (self.name,)


@dataclass(frozen=True)
class Disturbed(RobotEffects):
    """The effects of a robot, and a disturbance that acts while it runs."""

    simulator: Simulator | None = None
    disturbance: Disturbance | None = None
    figures: tuple[tuple[str, float], ...] = ()

    @property
    def loops(self) -> bool:
        """Whether the model is edited while it runs: always."""
        return True

    def updates(self, model: mujoco.MjModel) -> list[Update]:
        """Return what is to be called while the model runs."""
        updates = super().updates(model)
        if self.disturbance is None or self.simulator is None:
            return updates
        act = self.disturbance.act(model, self.simulator, dict(self.figures))
        calls, interval = 0, loop_interval_s(float(model.opt.timestep))

        def update(sensed: Array) -> None:
            nonlocal calls
            calls += 1
            act(sensed, calls * interval)

        return [*updates, Update(update)]


def disturbed(simulator: Simulator, disturbance: Disturbance, figures: Figures) -> Simulator:
    """Return a robot on which a disturbance acts.

    Args:
        simulator: the robot.
        disturbance: the kind.
        figures: what its `draw` returned.
    """
    active = simulator.effects
    with_it = Disturbed(active.active, active.nominal, simulator, disturbance, tuple(figures.items()))
    return replace(simulator, effects=with_it)


def _along(simulator: Simulator, sensed: Array) -> float:
    """Return how far the marker is along forward, m."""
    columns = [simulator.signals.index(signal) for signal in MARKER]
    return float(sensed[columns] @ simulator.problem.roles.axes[0])


def _parts(model: mujoco.MjModel, simulator: Simulator) -> Parts:
    return Parts(model, simulator.problem.roles, simulator.problem.channel_names)


def _start(simulator: Simulator) -> float:
    model = simulator.models[0]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    site = data.site(simulator.problem.marker).xpos
    return float(site @ simulator.problem.roles.axes[0])


def _stretch(rng: np.random.Generator, simulator: Simulator) -> dict[str, float]:
    begin = _start(simulator) + rng.uniform(0.005, 0.025)
    return {"begin_m": begin, "end_m": begin + rng.uniform(0.02, 0.06)}


def _draw_sticky(rng: np.random.Generator, size: float, simulator: Simulator) -> dict[str, float]:
    return _stretch(rng, simulator) | {"factor": 1.0 + 4.0 * size}


def _stick(model: mujoco.MjModel, simulator: Simulator, figures: Figures) -> Callable[[Array, float], None]:
    parts = _parts(model, simulator)
    body = parts.body or parts.touching
    friction = Friction(model, body)

    def act(sensed: Array, _: float) -> None:
        inside = figures["begin_m"] <= _along(simulator, sensed) <= figures["end_m"]
        for index in range(len(body)):
            friction.scale(index, figures["factor"] if inside else 1.0)

    return act


def _draw_soft(rng: np.random.Generator, size: float, simulator: Simulator) -> dict[str, float]:
    return _stretch(rng, simulator) | {"softer": 1.0 + 9.0 * size, "factor": 1.0 - 0.7 * size}


def _sink(model: mujoco.MjModel, simulator: Simulator, figures: Figures) -> Callable[[Array, float], None]:
    geoms = _parts(model, simulator).touching
    friction, solref = Friction(model, geoms), model.geom_solref[geoms].copy()

    def act(sensed: Array, _: float) -> None:
        inside = figures["begin_m"] <= _along(simulator, sensed) <= figures["end_m"]
        for index in range(len(geoms)):
            friction.scale(index, figures["factor"] if inside else 1.0)
        model.geom_solref[geoms] = solref * ((figures["softer"], 1.0) if inside else (1.0, 1.0))

    return act


def _draw_brown_out(rng: np.random.Generator, size: float, simulator: Simulator) -> dict[str, float]:
    every = rng.uniform(1.1, 2.3)
    return {"every_s": every, "share": rng.uniform(0.2, 0.4), "left": 1.0 - 0.97 * size}


def _brown_out(
    model: mujoco.MjModel, simulator: Simulator, figures: Figures
) -> Callable[[Array, float], None]:
    ranges = model.actuator_forcerange.copy()

    def act(_: Array, time: float) -> None:
        low = (time / figures["every_s"]) % 1.0 < figures["share"]
        model.actuator_forcerange[:] = ranges * (figures["left"] if low else 1.0)

    return act


def _draw_limp(rng: np.random.Generator, size: float, simulator: Simulator) -> dict[str, float]:
    servo = float(rng.integers(len(simulator.problem.channel_names)))
    return {"servo": servo, "chance": 0.25 + 0.5 * size, "left": 0.03, "seed": float(rng.integers(10**6))}


def _limp(model: mujoco.MjModel, simulator: Simulator, figures: Figures) -> Callable[[Array, float], None]:
    servo = int(figures["servo"])
    limits = model.actuator_forcerange[servo].copy()
    weak = np.random.default_rng(int(figures["seed"])).random(1000) < figures["chance"]

    def act(_: Array, time: float) -> None:
        factor = figures["left"] if weak[int(time / 1.3) % len(weak)] else 1.0
        model.actuator_forcerange[servo] = limits * factor

    return act


def _draw_gusts(rng: np.random.Generator, size: float, simulator: Simulator) -> dict[str, float]:
    sign = float(rng.choice([-1.0, 1.0]))
    return {"angle_rad": 0.15 * size * sign, "every_s": rng.uniform(2.6, 4.3), "share": rng.uniform(0.2, 0.4)}


def _gust(model: mujoco.MjModel, simulator: Simulator, figures: Figures) -> Callable[[Array, float], None]:
    gravity = model.opt.gravity.copy()
    forward = simulator.problem.roles.axes[0]
    pushed = gravity + np.linalg.norm(gravity) * figures["angle_rad"] * forward

    def act(_: Array, time: float) -> None:
        blows = (time / figures["every_s"]) % 1.0 < figures["share"]
        model.opt.gravity[:] = pushed if blows else gravity

    return act


OUTSIDE = {
    kind.name: kind
    for kind in (
        Disturbance("sticky_stretch", "a stretch of floor on which the body sticks", _draw_sticky, _stick),
        Disturbance("soft_spot", "a soft and slippery spot in the mat", _draw_soft, _sink),
        Disturbance("brown_out", "a supply whose voltage drops at intervals", _draw_brown_out, _brown_out),
        Disturbance("limping_servo", "a servo that has no strength now and then", _draw_limp, _limp),
        Disturbance("gusts", "air that pushes along the path at intervals", _draw_gusts, _gust),
    )
}
"""Every kind of disturbance by name."""


def _by_name(name: str) -> Disturbance:
    return OUTSIDE[name]
