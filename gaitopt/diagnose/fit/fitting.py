"""Fits of one effect to a set of trials, with as few simulations as will do.

Simulated parameter sets are kept, and between two of them the whitened residual is taken to change
evenly. So the loss of every cycle is known along the whole range of a parameter, and leaving a gait out,
resampling cycles and profiling cost no simulation. The next set is simulated where that loss is least, for
the hypotheses that still have a chance; the curve is then true where it matters. Nothing is foretold beyond
the outermost sets: they lie at the bounds, or are the last that could be simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.fit.cache import SimulationCache
from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.residual import WhitenedTrial
from gaitopt.diagnose.gap.predict import predictions
from gaitopt.effects.active import Values
from gaitopt.problem.problem import Problem
from gaitopt.robot.signals import is_marker
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]

_PER_INTERVAL = 24
"""Points of the curve between two simulated ones."""

ROUNDS = (22, 16, 12, 8, 8, 8, 6, 6, 4, 4)
"""How many hypotheses are fitted further, round by round.

More than lead: what a narrow valley leaves is seen only when the robots beside it have closed in on it.
"""

HOPELESS = (math.inf, 12.0, 6.0, 4.0)
"""In each round, the last for good, a hypothesis that leaves so many times the least loss is given up."""

ALIKE = 0.9
"""Signatures are alike from this cosine on. One like the best is not given up: it may be too small yet."""

_TOLERANCE = 0.004
_FINE = 1e-4
"""A parameter nearer to a simulated one than this share of its range need not be simulated again; the second
for one of the measurement, which takes no simulation: a tenth of a millisecond of a clock."""

_CLOSE = 0.01
"""Mean whitened square by which a leading fit may differ from the nearest robot that was simulated."""

_LEADING = 1.5
"""Fits that leave at most so many times the least loss are finished to `_CLOSE`, in so many rounds:"""

_FINISH, _FINISH_FINE = 4, 20
"""The second for those of the measurement alone."""

Note = Callable[[str, int, int], None]
"""Called with what is being done, how many robots have been simulated, and how many may be at most."""


@dataclass(frozen=True)
class Comparison:
    """All trials beside one robot.

    Attributes:
        at: coordinates of the robot's parameters, shape (number of effects,).
        whitened: residual of all trials, shape (rows,).
        marker: marker's residuals of all samples, m.
        angles: angles' residuals of all samples, rad.
    """

    at: Array
    whitened: Array
    marker: Array
    angles: Array


@dataclass(frozen=True)
class TrialSet:
    """The trials, and what simulates robots for them.

    Attributes:
        problem: the nominal problem.
        simulator: its robot.
        trials: the trials.
        nominal: nominal trajectories of the trials.
        blocks: block of each row, a cycle of a trial, from 0, shape (rows,).
        block_trials: trial of each block, shape (blocks,).
        sample_trials: trial of each sample of the marker.
        folds: blocks of each fold that is left out in turn.
        cache: what has been simulated before an interruption; None to keep nothing.
        whitening_updates: of each trial, a matrix from rows with its first covariance to rows with a later
            one; empty for the first.
    """

    problem: Problem
    simulator: Simulator
    trials: tuple[WhitenedTrial, ...]
    nominal: tuple[Trajectory, ...]
    blocks: NDArray[np.intp]
    block_trials: NDArray[np.intp]
    sample_trials: NDArray[np.intp]
    sample_blocks: NDArray[np.intp]
    folds: tuple[NDArray[np.intp], ...]
    cache: SimulationCache | None = None
    whitening_updates: tuple[Array, ...] = ()

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return len(self.block_trials)

    @property
    def n_trials(self) -> int:
        """Number of trials."""
        return int(self.block_trials[-1]) + 1

    @property
    def rows_per_block(self) -> Array:
        """Rows in each block, shape (blocks,)."""
        counts: Array = np.bincount(self.blocks, minlength=self.n_blocks).astype(float)
        return counts

    @property
    def left_out(self) -> list[tuple[NDArray[np.intp], Array]]:
        """Each fold with the weights of the blocks that its fit may see, shape (blocks,)."""
        pairs = []
        for fold in self.folds:
            weights = np.ones(self.n_blocks)
            weights[fold] = 0.0
            pairs.append((fold, weights))
        return pairs

    def losses(self, one: Array, other: Array) -> Array:
        """Return the inner product of two whitened residuals, block by block, shape (blocks,)."""
        sums: Array = np.bincount(self.blocks, one * other, minlength=self.n_blocks).astype(float)
        return sums

    def of_trials(self, whitened: Array) -> Array:
        """Return the loss of each trial from a whitened residual, shape (trials,)."""
        return self.sums(self.losses(whitened, whitened))

    def sums(self, losses: Array) -> Array:
        """Return the loss of each trial from that of each block, shape (trials,)."""
        totals: Array = np.bincount(self.block_trials, losses, minlength=self.n_trials).astype(float)
        return totals

    @property
    def first(self) -> TrialSet:
        """The trial_set before it was taught anew."""
        return replace(self, whitening_updates=())

    def with_covariance_of(self, changes: Array) -> TrialSet:
        """Return the trial_set with the covariance that some robots teach.

        Args:
            changes: what they change, whitened by the views, shape (draws, rows).
        """
        parts = np.split(changes, self._ends, axis=1)
        return replace(
            self,
            whitening_updates=tuple(
                v.whitening_update(part) for v, part in zip(self.trials, parts, strict=True)
            ),
        )

    def rewhiten(self, rows: Array, before: TrialSet) -> Array:
        """Return rows, or columns of them, that another trial_set of the same trials has whitened."""
        parts = np.split(rows, self._ends)
        if before.whitening_updates:
            undone = zip(before.whitening_updates, parts, strict=True)
            parts = [solve_triangular(turn, part, lower=True) for turn, part in undone]
        if self.whitening_updates:
            parts = [turn @ part for turn, part in zip(self.whitening_updates, parts, strict=True)]
        return np.concatenate(parts)

    def rewhiten_comparison(self, point: Comparison, before: TrialSet) -> Comparison:
        """Return a point that another trial_set of the same trials has whitened."""
        return replace(point, whitened=self.rewhiten(point.whitened, before))

    @property
    def _ends(self) -> Array:
        ends: Array = np.cumsum([len(view.counts) for view in self.trials])[:-1]
        return ends

    def point(self, at: Sequence[float], trajectories: Sequence[Trajectory]) -> Comparison | None:
        """Return the trials beside some trajectories, whitened by their views; None where one failed."""
        compared = []
        for one, trajectory in zip(self.trials, trajectories, strict=True):
            found = one.compare(trajectory)
            if found is None or not np.isfinite(found.whitened).all():
                return None
            compared.append(found)
        return Comparison(
            np.array(at, dtype=float),
            np.concatenate([c.whitened for c in compared]),
            np.concatenate([c.marker for c in compared]),
            np.concatenate([c.angles for c in compared]),
        )


def build_trial_set(
    problem: Problem,
    simulator: Simulator,
    views: Sequence[WhitenedTrial],
    nominal: Sequence[Trajectory],
    cache: SimulationCache | None = None,
) -> TrialSet:
    """Return the trials with their blocks and folds: a gait is left out, or a trial, or some cycles."""
    blocks, block_trials, first = [], [], 0
    sample_trials, sample_blocks = [], []
    for index, one in enumerate(views):
        present, numbers = np.unique(one.cycles, return_inverse=True)
        blocks.append(first + numbers)
        block_trials += [index] * len(present)
        for name, rows in one.rows.items():
            if is_marker(name):
                sample_trials += [index] * len(rows)
                sample_blocks += (first + numbers[rows]).tolist()
        first += len(present)
    trials = np.array(block_trials)
    return TrialSet(
        problem,
        simulator,
        tuple(views),
        tuple(nominal),
        np.concatenate(blocks),
        trials,
        np.array(sample_trials, dtype=np.intp),
        np.array(sample_blocks, dtype=np.intp),
        _folds(views, trials),
        cache,
    )


def _folds(views: Sequence[WhitenedTrial], block_trials: NDArray[np.intp]) -> tuple[NDArray[np.intp], ...]:
    keys = [v.aligned.trial.drive.key for v in views]
    groups = keys if len(set(keys)) > 1 else [str(i) for i in range(len(views))]
    names = np.array(groups)[block_trials]
    if len(set(groups)) > 1:
        return tuple(np.flatnonzero(names == name) for name in dict.fromkeys(groups))
    parts = np.array_split(np.arange(len(block_trials)), min(4, len(block_trials)))
    return tuple(part for part in parts if len(part))


def simulate(
    trial_set: TrialSet, effects: Mapping[str, Values], at: Sequence[float], observed_only: bool
) -> Comparison | None:
    """Return the trials beside a robot with some effects: the unit of work; None where it fails.

    Args:
        trial_set: the trials.
        effects: the effects, as a problem file says them.
        at: coordinates to note in the result.
        observed_only: the effects change the measurement alone, so nothing is simulated.
    """
    try:
        problem = trial_set.problem.with_effects(effects)
        if observed_only:
            active = replace(trial_set.simulator.effects, active=problem.effects)
            model, rng = trial_set.simulator.models[0], np.random.default_rng(0)
            point = trial_set.point(at, [active.observe(t, model, rng) for t in trial_set.nominal])
            return None if point is None else trial_set.rewhiten_comparison(point, trial_set.first)
        name = repr(sorted((effect, sorted(values.items())) for effect, values in effects.items()))
        return compare_robot(
            trial_set, Simulator.build(problem, fidelity=trial_set.simulator.fidelity), name, at
        )
    except GaitoptError:
        return None


def compare_robot(
    trial_set: TrialSet, robot: Simulator, name: str, at: Sequence[float] = ()
) -> Comparison | None:
    """Return the trials beside a robot, from cache where that has it; None where the simulation fails.

    Args:
        trial_set: the trials.
        robot: the robot.
        name: what the cache calls the result.
        at: coordinates to note in the result.
    """
    known = None if trial_set.cache is None else trial_set.cache.read(name)
    if known is not None:
        point: Comparison | None = Comparison(
            np.array(at, dtype=float), known["whitened"], known["apart"], known["angles"]
        )
    else:
        try:
            point = trial_set.point(at, predictions(robot, [v.aligned.trial for v in trial_set.trials]))
        except GaitoptError:
            return None
        if point is not None and trial_set.cache is not None:
            arrays = {"whitened": point.whitened, "apart": point.marker, "angles": point.angles}
            trial_set.cache.write(name, arrays)
    return None if point is None else trial_set.rewhiten_comparison(point, trial_set.first)


@dataclass(frozen=True)
class Curve:
    """The loss of each block along a hypothesis' range.

    Attributes:
        at: coordinates, shape (n,), ascending.
        losses: shape (blocks, n).
        left: index of the simulated point left of each coordinate, shape (n,).
        share: how far each coordinate is to the next simulated point, shape (n,).
    """

    at: Array
    losses: Array
    left: NDArray[np.intp]
    share: Array


@dataclass
class Fit:
    """One hypothesis and the parameter sets simulated for it.

    Attributes:
        hypothesis: the hypothesis.
        trial_set: the trials.
        points: simulated sets in order of their coordinate, the nominal robot among them.
        failed: coordinates that could not be simulated.
    """

    hypothesis: Hypothesis
    trial_set: TrialSet
    comparisons: list[Comparison]
    failed: list[float] = field(default_factory=list)
    _curve: Curve | None = field(default=None, repr=False)

    def on(self, trial_set: TrialSet) -> Fit:
        """Return the fit as another trial_set of the same trials sees it."""
        return Fit(
            self.hypothesis,
            trial_set,
            [trial_set.rewhiten_comparison(p, self.trial_set) for p in self.comparisons],
            [*self.failed],
        )

    def add(self, at: float, point: Comparison | None) -> None:
        """Take in one more set, None where it could not be simulated."""
        self._curve = None
        if point is None:
            self.failed.append(at)
            return
        self.comparisons = sorted([*self.comparisons, point], key=lambda p: float(p.at[0]))

    @property
    def observed(self) -> bool:
        """Whether the effect changes the measurement, not the robot."""
        return not self.hypothesis.effect.changes_robot

    @property
    def curve(self) -> Curve:
        """The loss along the range."""
        if self._curve is None:
            self._curve = _curve(self)
        return self._curve

    def best(self, weights: Array | None = None) -> float:
        """Return the coordinate of the least loss, blocks weighted."""
        return float(self.curve.at[self._least(weights)])

    def _least(self, weights: Array | None = None) -> int:
        curve = self.curve
        total = curve.losses.sum(axis=0) if weights is None else weights @ curve.losses
        return int(np.argmin(total))

    def loss(self, weights: Array | None = None) -> Array:
        """Return each block's loss where the weighted one is least, shape (blocks,)."""
        column: Array = self.curve.losses[:, self._least(weights)]
        return column

    def between(self, what: str, weights: Array | None = None) -> Array:
        """Return an attribute of `Comparison` where the weighted loss is least."""
        curve, index = self.curve, self._least(weights)
        left, share = int(curve.left[index]), float(curve.share[index])
        if len(self.comparisons) == 1:
            return np.asarray(getattr(self.comparisons[0], what))
        low, high = getattr(self.comparisons[left], what), getattr(self.comparisons[left + 1], what)
        mixed: Array = (1.0 - share) * low + share * high
        return mixed

    def product(self, row: Array) -> Array:
        """Return the inner product of the whitened residual with a row of as many, along the curve."""
        curve, last = self.curve, len(self.comparisons) - 1
        products = np.array([float(point.whitened @ row) for point in self.comparisons])
        along: Array = (1.0 - curve.share) * products[curve.left]
        along += curve.share * products[np.minimum(curve.left + 1, last)]
        return along

    def alike(self, other: Fit) -> float:
        """Return the greatest cosine between what two effects change, at the sets simulated of either."""
        one, two = self._changes(), other._changes()
        sizes = np.outer(np.linalg.norm(one, axis=1), np.linalg.norm(two, axis=1))
        return float(np.max(np.abs(one @ two.T) / np.maximum(sizes, 1e-12), initial=0.0))

    def _changes(self) -> Array:
        """Return the whitened changes of the simulated sets, that of the neutral one being 0."""
        changes: Array = np.stack([p.whitened for p in self.comparisons]) - self._neutral
        return changes

    @property
    def _neutral(self) -> Array:
        """The whitened residual without the effect."""
        return min(self.comparisons, key=lambda p: abs(float(p.at[0]) - self.hypothesis.neutral)).whitened

    def wanted(self) -> float | None:
        """Return the coordinate to simulate next, or None where that would tell nothing new."""
        at = self._next() if len(self.comparisons) > 1 else None
        return None if at is None or at in self.failed else at

    def _next(self) -> float | None:
        known = np.array([float(p.at[0]) for p in self.comparisons])
        width = self.hypothesis.high - self.hypothesis.low
        best = self.best()
        index = int(np.abs(known - best).argmin())
        tolerance = (_FINE if self.observed else _TOLERANCE) * width
        if abs(float(known[index]) - best) > tolerance:
            return best
        # The least loss is at a simulated point: look to the side where the loss rises less.
        sides = []
        for other in (index - 1, index + 1):
            if 0 <= other < len(known):
                gap = known[other] - known[index]
                if abs(gap) > 4.0 * tolerance:
                    rise = self._total(known[index] + 0.35 * gap)
                    sides.append((rise, known[index] + 0.35 * gap))
        return float(min(sides)[1]) if sides else None

    def unsure(self) -> float | None:
        """Return the best coordinate where its residual is not yet close to a simulated one."""
        best, white = self.best(), self.between("whitened")
        nearest = min(float(np.mean((p.whitened - white) ** 2)) for p in self.comparisons)
        apart = min(abs(float(p.at[0]) - best) for p in self.comparisons)
        width = self.hypothesis.high - self.hypothesis.low
        known = best in self.failed or apart <= 1e-6 * width
        return best if nearest > _CLOSE and not known else None

    def _total(self, at: float) -> float:
        curve = self.curve
        return float(np.interp(at, curve.at, curve.losses.sum(axis=0)))


def _curve(fit: Fit) -> Curve:
    points, trial_set = fit.comparisons, fit.trial_set
    if len(points) == 1:
        alone = trial_set.losses(points[0].whitened, points[0].whitened)
        return Curve(points[0].at[:1], alone[:, None], np.zeros(1, dtype=np.intp), np.zeros(1))
    at, losses, lefts, shares = [], [], [], []
    last = len(points) - 2
    for left in range(last + 1):
        low, high = points[left], points[left + 1]
        share = np.arange(_PER_INTERVAL) / _PER_INTERVAL
        gap = float(high.at[0] - low.at[0])
        if left == last:
            share = np.append(share, 1.0)
        own, mixed, other = (
            trial_set.losses(a.whitened, b.whitened)[:, None]
            for a, b in ((low, low), (low, high), (high, high))
        )
        losses.append((1.0 - share) ** 2 * own + 2.0 * share * (1.0 - share) * mixed + share**2 * other)
        at.append(low.at[0] + share * gap)
        lefts.append(np.full(len(share), left, dtype=np.intp))
        shares.append(share)
    return Curve(
        np.concatenate(at), np.concatenate(losses, axis=1), np.concatenate(lefts), np.concatenate(shares)
    )


def fit_all(
    trial_set: TrialSet, candidates: Sequence[Hypothesis], nominal: Comparison, executor: Executor, note: Note
) -> list[Fit]:
    """Screen every hypothesis, then fit those that have a chance, in rounds.

    Args:
        trial_set: the trials.
        candidates: the hypotheses.
        nominal: the trials beside the nominal robot.
        executor: where robots are simulated.
        note: called as it goes.
    """
    fits = [Fit(h, trial_set, [replace(nominal, at=np.array([h.neutral]))]) for h in candidates]
    count = Count("fitting effects", note)
    _simulate_each([(fit, at) for fit in fits for at in fit.hypothesis.screened], executor, count)
    rows = len(nominal.whitened)
    _refine(fits, rows, executor, count)
    finish(fits, executor, note)
    return fits


@dataclass
class Count:
    """Robots simulated, and how many may be at most; said as it changes."""

    what: str
    note: Note
    done: int = 0
    most: int = 0

    def add(self, done: int, most: int) -> None:
        self.done, self.most = self.done + done, self.most + most
        self.note(self.what, self.done, max(self.done, self.most))


def _refine(fits: Sequence[Fit], rows: int, executor: Executor, count: Count) -> None:
    """Simulate the fits that look best where they look best, in rounds.

    Args:
        fits: the fits.
        rows: whitened rows: the loss of a right model.
        executor: where robots are simulated.
        count: counts them.
    """
    count.add(0, sum(min(most, len(fits)) for most in ROUNDS))
    for number, most in enumerate(ROUNDS):
        losses = [float(fit.loss().sum()) for fit in fits]
        limit = HOPELESS[min(number, len(HOPELESS) - 1)] * max(min(losses, default=0.0), rows)
        order = np.argsort(losses, kind="stable")
        ordered = [fits[i] for i in order if losses[i] <= limit or fits[i].alike(fits[order[0]]) >= ALIKE]
        wanted = [(fit, fit.wanted()) for fit in ordered[:most]]
        work = [(fit, at) for fit, at in wanted if at is not None]
        count.add(0, -min(most, len(fits)))
        if not work:
            count.add(0, -sum(min(later, len(fits)) for later in ROUNDS[number + 1 :]))
            break
        _simulate_each(work, executor, count)


def finish(fits: Sequence[Fit], executor: Executor, note: Note) -> None:
    """Simulate the leading fits until what is left of them is known, not mixed from two robots far apart.

    Two effects of one signature are to be told apart by that alone, not by how closely either was fitted.
    """
    count = Count("finishing the best fits", note)
    for number in range(_FINISH_FINE):
        losses = [float(fit.loss().sum()) for fit in fits]
        leading = [f for f, loss in zip(fits, losses, strict=True) if loss <= _LEADING * min(losses)]
        work = [(fit, at) for fit in leading if (at := _to_finish(fit, number)) is not None]
        if not work:
            break
        _simulate_each(work, executor, count)


def _to_finish(fit: Fit, number: int) -> float | None:
    """Return where a leading fit is simulated next in a round of `finish`, or None."""
    if fit.observed:
        return fit.wanted()
    return fit.unsure() if number < _FINISH else None


def _simulate_each(work: Sequence[tuple[Fit, float]], executor: Executor, count: Count) -> None:
    count.add(0, len(work))
    futures = []
    for fit, at in work:
        h = fit.hypothesis
        call = (fit.trial_set, {h.effect.name: h.values(at)}, [at], fit.observed)
        futures.append((fit, at, executor.submit(simulate, *call)))
    for fit, at, future in futures:
        fit.add(at, future.result())
        count.add(1, 0)
