"""The cause of a gap: all rivals fitted and judged, and the answer that their evidence allows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitopt.diagnose import evidence, precision
from gaitopt.diagnose.align import Aligned
from gaitopt.diagnose.evidence import Gap, Rival
from gaitopt.diagnose.fitting import Bench, Note, Point, bench, fit_all, predictions
from gaitopt.diagnose.floor import Floors
from gaitopt.diagnose.hypotheses import Hypothesis
from gaitopt.diagnose.memory import Memory
from gaitopt.diagnose.nuisances import nuisance_robots
from gaitopt.diagnose.pairs import fit_pairs
from gaitopt.diagnose.residual import view
from gaitopt.diagnose.uneven import UNEVEN, unevenness
from gaitopt.errors import GaitoptError
from gaitopt.rollout import Simulator

NO_GAP = 1.1
"""A nominal robot that leaves no more whitened squares than this, in every trial, has no significant gap."""

FAINT_GAP = 1.8
"""And one that leaves no more than this has none either, if no effect explains it."""

LEFT = 2.0
"""A rival that leaves more than this leaves a significant gap."""

_OTHER_HALF, _OTHER_SLOPE = 3.0, 3.0
"""Something else is as likely as not where the best rival leaves so much; and how fast that changes."""

SIGNIFICANCE = 0.05

_ABOVE_NONE = 3.0
"""An effect belongs to the answer beside the first if it is so many times as probable as none."""

_PAIR_ERRORS = 1.0
"""Standard errors by which two effects must foretell more than one."""

_PAIR_GAIN = 0.6
"""Share of the loss of one effect that two may leave at most."""

_IMPROVED = 0.85
"""Share of the nominal loss that the best rival may leave at most: the best of many is a little better by
chance."""

_LITTLE = 0.3
"""A smaller part of the whitened residual explains nothing."""

_UNLIKE_NOMINAL = 0.003
"""What is left counts above this share of the nominal loss: nuisances grow with an effect."""


@dataclass(frozen=True)
class Causes:
    """What may have caused the gap.

    Attributes:
        bench: the trials.
        nominal: the trials beside the nominal robot.
        none: the rival without effect.
        rivals: the other rivals, the most probable first.
        chances: their probabilities, if the cause is in the library.
        verdict: the answer's kind.
        causes: the effects blamed.
        ambiguous_with: effects that the data cannot tell from these.
        other_probability: how likely the cause is not in the library, or not alone.
        p_value: of the first rival against none.
        gap: on held-out data; None where nothing was fitted.
        drawn: whitened changes with robots drawn about the first rival, shape (draws, rows).
        uneven: by how much the recorded cycles differ, in differences of such robots' cycles.
        seed: seed of what is random.
        robots: robots simulated.
    """

    bench: Bench
    nominal: Point
    none: Rival
    rivals: tuple[Rival, ...]
    chances: NDArray[np.float64]
    verdict: str
    causes: list[str]
    ambiguous_with: list[str]
    other_probability: float
    p_value: float
    gap: Gap | None
    drawn: NDArray[np.float64]
    uneven: float
    seed: int
    robots: int

    @property
    def best(self) -> Rival | None:
        """The most probable rival."""
        return self.rivals[0] if self.rivals else None

    @property
    def surviving(self) -> list[Rival]:
        """The most probable rival of each effect in the answer, and the runner-up where that is one alone."""
        firsts: dict[tuple[str, ...], Rival] = {}
        for rival in self.rivals:
            firsts.setdefault(tuple(rival.names), rival)
        named = [r for names, r in firsts.items() if set(names) & {*self.causes, *self.ambiguous_with}]
        others = [r for r in firsts.values() if r not in named]
        return (named + others)[: max(2, len(named))][:5]

    @cached_property
    def effects(self) -> list[dict[str, Any]]:
        """Rows of ``effects``: one for each effect, with its most probable target."""
        rows: dict[str, dict[str, Any]] = {}
        for rival, chance in zip(self.rivals, self.chances.tolist(), strict=True):
            for index, fit in enumerate(rival.fits):
                name, target = fit.hypothesis.effect.name, fit.hypothesis.target
                if name not in rows:
                    rows[name] = self._row(rival, index)
                rows[name]["probability"] += (1.0 - self.other_probability) * chance
                targets = rows[name]["targets"]
                targets[target] = targets.get(target, 0.0) + chance
        return sorted(rows.values(), key=lambda row: -row["probability"])

    def gap_of_trial(self, trial: int, floor: float) -> Gap | None:
        """Return the held-out gap of one trial, its floor given in m; None where nothing was fitted."""
        if self.gap is None or self.best is None:
            return None
        return evidence.gap_of(self.bench, self.nominal, self.best, floor, self.seed, trial)

    def _row(self, rival: Rival, index: int) -> dict[str, Any]:
        fit = rival.fits[index]
        effect, at = fit.hypothesis.effect, rival.at[index]
        ci90 = precision.intervals(rival, self.bench, self.drawn)[index]
        floor = self.gap.floor if self.gap else 0.0
        gap = evidence.gap_of(self.bench, self.nominal, rival, floor, self.seed) if self.gap else None
        return {
            "name": effect.name,
            "target": fit.hypothesis.target,
            "probability": 0.0,
            "parameters": {effect.parameter: {"value": fit.hypothesis.value(at), "ci90": list(ci90)}},
            "unit": effect.unit,
            "heldout_shrinkage": gap.shrinkage if gap else None,
            "heldout_left": evidence.left(self.bench, rival),
            "alike": evidence.cosine(self.nominal, rival, self.rivals[0]),
            "targets": {},
        }


def prepared(
    simulator: Simulator,
    trials: Sequence[Aligned],
    floors: Sequence[Floors],
    executor: Executor,
    seed: int,
    memory: Memory | None = None,
) -> tuple[Bench, Point, list[Point | None]]:
    """Return the trials ready for fitting, beside the nominal robot, and beside robots drawn about it."""
    robots = nuisance_robots(simulator, seed)
    records = [aligned.trial for aligned in trials]
    futures = [executor.submit(predictions, robot, records) for robot in robots]
    drawn = [future.result() for future in futures]
    views = [
        view(aligned, floor, [row[i] for row in drawn])
        for i, (aligned, floor) in enumerate(zip(trials, floors, strict=True))
    ]
    nominal = [aligned.simulated for aligned in trials]
    ready = bench(simulator.problem, simulator, views, nominal, memory)
    point = ready.point([0.0], nominal)
    if point is None:
        raise ValueError("the nominal prediction was checked when it was aligned")
    return ready, point, [ready.point([], row) for row in drawn]


def find_causes(
    simulator: Simulator,
    trials: Sequence[Aligned],
    floors: Sequence[Floors],
    floor_m: float,
    executor: Executor,
    seed: int,
    note: Note,
    rivals: Sequence[Hypothesis],
    memory: Memory | None = None,
) -> Causes:
    """Fit and judge every rival.

    Args:
        simulator: the nominal robot.
        trials: the trials beside the nominal prediction.
        floors: floor of each signal of each.
        floor_m: the marker's floor over all trials, m.
        executor: where robots are simulated.
        seed: seed of what is random.
        note: called as it goes.
        rivals: what is to be tried.
        memory: keeps what is simulated, and has what was; None to keep nothing.

    Raises:
        GaitoptError: no robot that is to be tried can be simulated.
    """
    ready, nominal, about = prepared(simulator, trials, floors, executor, seed, memory)
    none = evidence.nothing(ready, nominal)
    uneven = unevenness(ready, floors, about)
    if evidence.left(ready, none) <= NO_GAP and uneven <= UNEVEN:
        nothing = np.empty((0, len(ready.blocks)))
        return Causes(
            ready, nominal, none, (), np.empty(0), "no_gap", [], [], 0.0, 1.0, None, nothing, uneven, seed, 0
        )
    fits = fit_all(ready, rivals, nominal, executor, note)
    singles = [evidence.single(fit) for fit in fits if len(fit.points) > 1]
    if not singles:
        raise GaitoptError("no effect can be tried: the simulation of every robot that has one fails")
    best = min(singles, key=lambda rival: rival.evidence)
    doubles = []
    if _remains(ready, best, none) > LEFT:
        doubles = [evidence.double(pair) for pair in fit_pairs(fits, nominal, executor, note)]
    return conclude(ready, nominal, none, singles, doubles, floors, floor_m, executor, seed)


def conclude(
    ready: Bench,
    nominal: Point,
    none: Rival,
    singles: Sequence[Rival],
    doubles: Sequence[Rival],
    floors: Sequence[Floors],
    floor_m: float,
    executor: Executor,
    seed: int,
) -> Causes:
    """Return the answer that the evidence allows."""
    best = min(singles, key=lambda rival: rival.evidence)
    both = min(doubles, key=lambda rival: rival.evidence, default=None)
    two = both is not None and _needed(ready, best, both)
    order, chances, idle = _ranked(ready, doubles if two else singles, none)
    drawn = precision.drawn_about(ready, order[0], executor, seed)
    shown = precision.excludes_none(order[0], ready, drawn.changes)
    if two and not shown:
        two = False
        order, chances, idle = _ranked(ready, singles, none)
        drawn = precision.drawn_about(ready, order[0], executor, seed)
        shown = precision.excludes_none(order[0], ready, drawn.changes)
    first = order[0]
    chance_alone = evidence.p_value(ready, nominal, singles, none.evidence - first.evidence, seed)
    gap = evidence.gap_of(ready, nominal, first, floor_m, seed)
    remains = _remains(ready, first, none, precision.expected(ready, drawn.changes))
    uneven = unevenness(ready, floors, drawn.points)
    other = max(_other(remains / _OTHER_HALF), _other(uneven / UNEVEN))
    improves = chance_alone <= SIGNIFICANCE and first.evidence < _IMPROVED * none.evidence and shown
    quiet = evidence.left(ready, none) <= FAINT_GAP
    causes, rest = _named(order, chances, two, idle)
    if not improves:
        verdict, causes, rest = "no_gap" if quiet and uneven <= UNEVEN else "unexplained", [], []
    elif remains > LEFT or uneven > UNEVEN:
        explained = 1.0 - float(np.sqrt(first.held_out.sum() / none.held_out.sum()))
        verdict = "partly_explained"
        if explained < _LITTLE:
            verdict, causes, rest = "unexplained", [], []
    else:
        verdict = "ambiguous" if rest else "explained"
    robots = sum(len(r.fits[0].points) for r in singles)
    return Causes(
        ready, nominal, none, tuple(order), chances, verdict, causes, rest, other, chance_alone, gap,
        drawn.changes, uneven, seed, robots,
    )  # fmt: skip


def _ranked(
    ready: Bench, rivals: Sequence[Rival], none: Rival
) -> tuple[list[Rival], NDArray[np.float64], float]:
    """Return the rivals, the most probable first, their probabilities, and the least one worth naming."""
    weights, nothing = evidence.scores(ready, rivals), evidence.scores(ready, [*rivals, none])[-1]
    order = np.argsort(-weights, kind="stable")
    chances = evidence.probabilities(weights[order])
    idle = _ABOVE_NONE * float(chances[0] * np.exp(nothing - weights.max()))
    return [rivals[i] for i in order], chances, idle


def _other(share: float) -> float:
    """Return how likely something else is, from a sign of it in units of that which makes it even odds."""
    return 1.0 / (1.0 + math.exp(-_OTHER_SLOPE * math.log(max(share, 1e-9))))


def _remains(ready: Bench, rival: Rival, none: Rival, expected: Mapping[int, float] | None = None) -> float:
    """Return the mean whitened square left of the worst trial, in what a right model would leave.

    A small share of the nominal one passes; and a robot may scatter more with its effect than without:
    `expected` has what robots about the rival leave.
    """
    before = evidence.left_by_trial(ready, none)
    after = evidence.left_by_trial(ready, rival)
    about = expected or dict.fromkeys(after, 0.0)
    return max(after[t] / max(1.0, _UNLIKE_NOMINAL * before[t], about[t]) for t in after)


def _needed(ready: Bench, one: Rival, both: Rival) -> bool:
    """Whether two effects foretell enough more than one, and fit as much better.

    Where a response jumps, one effect may foretell a gait badly that it fits well; a second one does not mend
    that.
    """
    foretold = float(both.held_out.sum()) < _PAIR_GAIN * float(one.held_out.sum())
    fitted = float(both.seen.sum()) < _PAIR_GAIN * float(one.seen.sum())
    return foretold and fitted and evidence.better_by(ready, both, one) > _PAIR_ERRORS


def _named(
    rivals: Sequence[Rival], chances: NDArray[np.float64], two: bool, idle: float
) -> tuple[list[str], list[str]]:
    """Return the effects blamed, and those that cannot be told from them; none less probable than `idle`."""
    if not two:
        totals = evidence.by_effect(rivals, chances)
        names = evidence.answer_set(totals)
        return names[:1], [name for name in names[1:] if totals[name] >= idle]
    first = rivals[0].names
    kept = dict.fromkeys(first, 0.0)
    for rival, chance in zip(rivals, chances.tolist(), strict=True):
        if chance >= evidence.IN_SET * float(chances[0]):
            for name in rival.names:
                kept[name] = kept.get(name, 0.0) + chance
    return list(first), [name for name in kept if name not in first]
