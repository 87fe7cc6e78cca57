"""A case is drawn: which effect or disturbance is planted, and how large."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from gaitopt.blind.disturbances import OUTSIDE, disturbed
from gaitopt.blind.factory import CaseFactory, observed
from gaitopt.blind.sealed import PlantedEffect
from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.effects.active import Values
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import NOMINAL, Scenario


@dataclass(frozen=True)
class Planted:
    """An effect of the library at one value: a hypothesis and its coordinate."""

    hypothesis: Hypothesis
    at: float


@dataclass(frozen=True)
class PlantedDisturbance:
    """A disturbance outside the library: its name and what was drawn for it."""

    name: str
    figures: Mapping[str, float]


@dataclass(frozen=True)
class Draw:
    """A case as it was drawn, before it is recorded.

    Attributes:
        kind: one of `kinds.KINDS`.
        planted: the effects planted.
        disturbance: the disturbance planted, if any.
        grip: chance of each pad's grip, where `grip_variation` is not planted.
    """

    kind: str
    planted: tuple[Planted, ...] = ()
    disturbance: PlantedDisturbance | None = None
    grip: float = 0.0

    @property
    def effects(self) -> dict[str, Values]:
        """The effects, as a problem file states them."""
        chance: dict[str, Values] = {"grip_variation": {"relative_sd": self.grip}} if self.grip else {}
        return chance | {p.hypothesis.effect.name: p.hypothesis.values(p.at) for p in self.planted}

    @property
    def rows(self) -> tuple[PlantedEffect, ...]:
        """The effects, as the sealed truth states them."""
        if self.disturbance is not None:
            figures = dict(self.disturbance.figures)
            return (PlantedEffect(name=self.disturbance.name, target="all", parameters=figures),)
        return tuple(
            PlantedEffect(
                name=p.hypothesis.effect.name,
                target=p.hypothesis.target,
                parameters={p.hypothesis.effect.parameter: p.hypothesis.value(p.at)},
            )
            for p in self.planted
        )

    def robot(self, problem: Problem, fidelity: Fidelity, scenario: Scenario = NOMINAL) -> Simulator:
        """Return the robot with what was planted, in one scenario.

        Raises:
            GaitoptError: the model with the effects does not compile.
        """
        robot = Simulator.build(problem.with_effects(self.effects), (scenario,), fidelity)
        if self.disturbance is None:
            return robot
        return disturbed(robot, OUTSIDE[self.disturbance.name], self.disturbance.figures)


@dataclass(frozen=True)
class Sized:
    """A draw whose gap has been simulated.

    Attributes:
        draw: the draw.
        gap: its gap by the nominal numerics, floors.
        faint: effects that were drawn before it and made no gap on the target and side drawn.
    """

    draw: Draw
    gap: float
    faint: tuple[str, ...] = ()


BySize = Callable[[float], Draw]
"""From a size between 0 (nothing) and 1 (the bound) to a draw."""


def draw_case(
    factory: CaseFactory, kind: str, rng: np.random.Generator, executor: Executor, only: str | None = None
) -> Sized:
    """Draw a case whose gap is between the settings' smallest and largest.

    Args:
        factory: what all cases share.
        kind: one of `kinds.KINDS`.
        rng: where the draws come from.
        executor: where robots are simulated.
        only: the effect or disturbance to plant; any by default.

    Raises:
        GaitoptError: the requested effect cannot make such a gap.
    """
    if kind == "none":
        return Sized(Draw(kind), 0.0)
    faint: list[str] = []
    for _ in range(factory.settings.effects_tried):
        count = _count(factory, kind, rng)
        chosen = [only] if only else rng.choice(factory.effects, count, replace=False).tolist()
        if kind == "outside":
            found = _sized(factory, _disturbance_by_size(factory, only, rng), rng, executor)
        elif kind in ("pair", "several"):
            found = _together(factory, kind, [str(name) for name in chosen], rng, executor)
        else:
            found = _sized(factory, _effect_by_size(factory, str(chosen[0]), rng), rng, executor)
        if found is not None:
            return Sized(found.draw, found.gap, tuple(faint))
        if kind == "single":
            faint.append(str(chosen[0]))
    low, high = factory.settings.smallest, factory.settings.largest
    raise GaitoptError(f"{only or kind}: no gap of {low:g} to {high:g} floors was found inside its bounds")


def _effect_by_size(factory: CaseFactory, name: str, rng: np.random.Generator) -> BySize:
    """Draw an effect's target and side, and leave the size open."""
    of_name = [one for one in factory.hypotheses if one.effect.name == name]
    chosen = of_name[int(rng.integers(len(of_name)))]
    bound = chosen.sides[int(rng.integers(len(chosen.sides)))]

    def by_size(size: float) -> Draw:
        return Draw("single", (Planted(chosen, chosen.neutral + size * (bound - chosen.neutral)),))

    return by_size


def _disturbance_by_size(factory: CaseFactory, only: str | None, rng: np.random.Generator) -> BySize:
    """Draw a disturbance and a seed, and leave the size open."""
    name = only or str(rng.choice(sorted(OUTSIDE)))
    seed = int(rng.integers(2**31))

    def by_size(size: float) -> Draw:
        figures = OUTSIDE[name].draw(np.random.default_rng(seed), size, factory.nominal)
        return Draw("outside", (), PlantedDisturbance(name, figures))

    return by_size


def _count(factory: CaseFactory, kind: str, rng: np.random.Generator) -> int:
    """Return how many effects are planted."""
    if kind == "several":
        return int(rng.integers(1, factory.settings.most_effects + 1))
    return 2 if kind == "pair" else 1


def _together(
    factory: CaseFactory, kind: str, names: list[str], rng: np.random.Generator, executor: Executor
) -> Sized | None:
    """Draw some effects, each of which makes a gap; None where they do not."""
    settings = factory.settings
    most = settings.pair_share * settings.largest
    found = [_sized(factory, _effect_by_size(factory, name, rng), rng, executor, most) for name in names]
    sized = [one for one in found if one is not None]
    if len(sized) < len(names):
        return None
    draw = Draw(kind, tuple(planted for one in sized for planted in one.draw.planted))
    gap = _gap_of(factory, draw, executor)
    return Sized(draw, gap) if settings.fits(gap, settings.excess * settings.largest) else None


def _sized(
    factory: CaseFactory,
    by_size: BySize,
    rng: np.random.Generator,
    executor: Executor,
    most: float | None = None,
) -> Sized | None:
    """Find a draw with a gap of a random size in range, by bisection; None where there is none.

    Args:
        factory: what all cases share.
        by_size: the draw at a size.
        rng: where the wanted gap comes from.
        executor: where robots are simulated.
        most: largest gap, floors; the settings' by default.
    """
    settings = factory.settings
    most = settings.largest if most is None else most
    wanted = settings.smallest * (0.8 * most / settings.smallest) ** float(rng.uniform(0.1, 1.0))
    low, high = 0.0, 1.0
    size = float(rng.uniform(0.1, 0.9))
    best: Sized | None = None
    for _ in range(settings.bisections):
        draw = by_size(size)
        gap = _gap_of(factory, draw, executor)
        if settings.fits(gap, most):
            best = Sized(draw, gap)
            if settings.close * wanted <= gap <= settings.wide * wanted:
                return best
        low, high = (size, high) if gap < wanted else (low, size)
        size = 0.5 * (low + high)
        if low > 0.95:
            break
    return best


def _gap_of(factory: CaseFactory, draw: Draw, executor: Executor) -> float:
    """Return the largest gap of any gait in floors, by the nominal numerics."""
    try:
        robot = draw.robot(factory.problem, factory.nominal.fidelity)
    except GaitoptError:
        return math.inf
    futures = {
        name: executor.submit(observed, robot, gait, factory.paths[name].time[-1])
        for name, gait in factory.gaits.items()
    }
    return factory.gap(factory.paths, {name: future.result() for name, future in futures.items()})
