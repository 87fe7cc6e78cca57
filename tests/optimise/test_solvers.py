"""Every solver on functions with known minima, and on a robot whose optimum a grid confirms."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from gaitopt.gait.gait import Gait
from gaitopt.optimise.executors import open_executor
from gaitopt.optimise.solvers.cma_es import CmaEs
from gaitopt.optimise.solvers.nelder_mead import NelderMead
from gaitopt.optimise.solvers.registry import SOLVERS
from gaitopt.optimise.solvers.solution import Box, Solution, Stop
from gaitopt.optimise.solvers.solver import Minimisation, Solver
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import ChannelBounds, ProblemFile
from gaitopt.problem.robot import Robot
from gaitopt.simulation.metrics import measure
from gaitopt.simulation.rollout import Simulator

Points = NDArray[np.float64]
Function = Callable[[Points], Points]

DIMENSION = 5
CENTRE = np.array([0.3, 0.6, 0.45, 0.7, 0.55])
"""Where the minima lie in the unit box."""

CMA_ES, NELDER_MEAD = CmaEs(), NelderMead()


def scaled(x: Points) -> Points:
    """The unit box as -5 to 5 about the minimum."""
    return 10.0 * (x - CENTRE)


def sphere(x: Points) -> Points:
    return (scaled(x) ** 2).sum(axis=1)


def ellipsoid(x: Points) -> Points:
    """Condition number 1e4."""
    return (scaled(x) ** 2 * np.logspace(0.0, 4.0, DIMENSION)).sum(axis=1)


def rosenbrock(x: Points) -> Points:
    """A curved valley; the minimum lies at 1, ..., 1 of its own coordinates."""
    z = scaled(x) + 1.0
    return (100.0 * (z[:, 1:] - z[:, :-1] ** 2) ** 2 + (1.0 - z[:, :-1]) ** 2).sum(axis=1)


def rastrigin(x: Points) -> Points:
    """A sphere with a thousand local minima: ten along each of three axes."""
    z = scaled(x)
    return (z**2).sum(axis=1) + 10.0 * (1.0 - np.cos(2.0 * np.pi * z[:, :3])).sum(axis=1)


class Counted:
    """A function that remembers the points it was called with."""

    def __init__(self, function: Function):
        self.function = function
        self.asked: list[Points] = []

    def __call__(self, x: Points) -> Points:
        assert x.ndim == 2
        assert len(x) > 0
        self.asked.extend(x.copy())
        return self.function(x)


def box(circular: tuple[int, ...] = (), dimension: int = DIMENSION) -> Box:
    """The unit box with some circular coordinates."""
    return Box(np.isin(np.arange(dimension), circular))


def minimise(
    solver: Solver, function: Function, bounds: Box, x0: Points, spread: float, budget: int,
    draws: np.random.Generator,
) -> Solution:  # fmt: skip
    """Let a solver minimise a function."""
    return solver.minimise(Minimisation(function, bounds, x0, spread, budget, draws))


def rng(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.mark.parametrize(
    ("solver", "function", "budget", "precision"),
    [
        (CMA_ES, sphere, 1500, 1e-5),
        (CMA_ES, ellipsoid, 4000, 1e-4),
        (CMA_ES, rosenbrock, 6000, 1e-3),
        (CMA_ES, rastrigin, 30000, 1e-3),
        (NELDER_MEAD, sphere, 1500, 1e-3),
        (NELDER_MEAD, ellipsoid, 3000, 1e-3),
        (NELDER_MEAD, rosenbrock, 5000, 1e-3),
    ],
)
@pytest.mark.parametrize("seed", [1, 2])
def test_the_known_minimum_is_found(
    solver: Solver, function: Function, budget: int, precision: float, seed: int
) -> None:
    start = np.full(DIMENSION, 0.5)
    solution = minimise(solver, function, box(), start, 0.2, budget, rng(seed))
    assert solution.x == pytest.approx(CENTRE, abs=precision)
    assert solution.cost == pytest.approx(0.0, abs=1e-2)
    assert solution.cost == function(solution.x[None])[0]


@pytest.mark.parametrize("solver", SOLVERS.values())
def test_a_minimum_on_the_wall_is_found_and_no_wall_is_crossed(solver: Solver) -> None:
    """The sphere's centre lies outside the box in two coordinates."""
    beyond = np.array([-0.2, 0.4, 1.3, 0.5, 0.6])
    function = Counted(lambda x: ((x - beyond) ** 2).sum(axis=1))
    solution = minimise(solver, function, box(), np.full(DIMENSION, 0.5), 0.2, 2000, rng())
    assert solution.x == pytest.approx(beyond.clip(0.0, 1.0), abs=2e-3)
    asked = np.array(function.asked)
    assert asked.min() >= 0.0
    assert asked.max() <= 1.0


@pytest.mark.parametrize("solver", SOLVERS.values())
@pytest.mark.parametrize(("start", "phase"), [(0.95, 0.02), (0.05, 0.98)])
def test_an_optimum_at_the_wrap_is_reached_from_the_other_side(
    solver: Solver, start: float, phase: float
) -> None:
    """A circular coordinate has no boundary at 0 = 1; the shortest way crosses it."""
    function = Counted(
        lambda x: (x[:, 0] - 0.4) ** 2 + (1.0 - np.cos(2.0 * np.pi * (x[:, 1] - phase))) / 20.0
    )
    solution = minimise(solver, function, box((1,), 2), np.array([0.5, start]), 0.1, 600, rng())
    assert solution.x[0] == pytest.approx(0.4, abs=1e-3)
    assert abs((solution.x[1] - phase + 0.5) % 1.0 - 0.5) < 1e-3
    assert abs(solution.x[1] - start) < 0.5
    asked = np.array(function.asked)[:, 1]
    assert asked.min() < 0.0 or asked.max() > 1.0


@pytest.mark.parametrize("solver", SOLVERS.values())
@pytest.mark.parametrize("budget", [1, 2, 3, 7, 50, 101])
def test_the_budget_is_never_exceeded(solver: Solver, budget: int) -> None:
    function = Counted(rosenbrock)
    solution = minimise(solver, function, box(), np.full(DIMENSION, 0.5), 0.2, budget, rng())
    assert len(function.asked) == solution.evaluations == budget
    assert solution.stop is Stop.BUDGET
    costs = rosenbrock(np.array(function.asked))
    assert solution.cost == costs.min()
    assert np.array_equal(solution.x, function.asked[int(costs.argmin())])


def test_cma_es_spends_its_budget_in_restarts() -> None:
    function = Counted(rastrigin)
    solution = minimise(CMA_ES, function, box(), np.full(DIMENSION, 0.5), 0.2, 3000, rng())
    assert len(function.asked) == 3000
    assert solution.stop is Stop.BUDGET


@pytest.mark.parametrize("solver", SOLVERS.values())
def test_a_solver_that_has_converged_stops(solver: Solver) -> None:
    function = Counted(sphere)
    once = CmaEs(restarts=0) if solver == CMA_ES else solver
    start = np.full(DIMENSION, 0.5)
    solution = minimise(once, function, box(), start, 0.2, 100_000, rng())
    assert solution.stop is Stop.CONVERGED
    assert solution.evaluations == len(function.asked) < 10_000


@pytest.mark.parametrize("solver", SOLVERS.values())
def test_the_same_seed_gives_the_same_bits(solver: Solver) -> None:
    def asked(seed: int) -> Points:
        function = Counted(rastrigin)
        minimise(solver, function, box((2,)), np.full(DIMENSION, 0.4), 0.2, 200, rng(seed))
        return np.array(function.asked)

    assert np.array_equal(asked(5), asked(5))
    assert not np.array_equal(asked(5), asked(6))


@pytest.mark.parametrize("solver", SOLVERS.values())
def test_global_random_state_is_neither_used_nor_touched(solver: Solver) -> None:
    np.random.seed(0)  # noqa: NPY002
    before = np.random.get_state()[1].tolist()  # noqa: NPY002
    first = minimise(solver, sphere, box(), np.full(DIMENSION, 0.4), 0.2, 60, rng(3))
    assert np.random.get_state()[1].tolist() == before  # noqa: NPY002
    np.random.seed(99)  # noqa: NPY002
    again = minimise(solver, sphere, box(), np.full(DIMENSION, 0.4), 0.2, 60, rng(3))
    assert np.array_equal(first.x, again.x)


@pytest.mark.parametrize("solver", SOLVERS.values())
@pytest.mark.parametrize("corner", [0.0, 1.0])
def test_a_start_in_a_corner_is_a_start(solver: Solver, corner: float) -> None:
    solution = minimise(solver, sphere, box(), np.full(DIMENSION, corner), 0.2, 2500, rng())
    assert solution.x == pytest.approx(CENTRE, abs=0.01)


# --- a small robot problem --------------------------------------------------------------------


def two_free(problem: Problem) -> Problem:
    """The strider, with only the front leg's phase and the rear leg's amplitude free.

    Both legs swing with the same smooth even wave of half a second.
    """
    rear = {"range_deg": [-45.0, 45.0], "amplitude_deg": [10.0, 60.0]}
    front = {"range_deg": [-20.0, 20.0], "amplitude_deg": [40.0, 40.0]}
    fixed = {"duty": [0.5, 0.5], "smoothing": [1.0, 1.0]}
    content = problem.to_dict() | {
        "gait": {"period_s": [0.5, 0.5]},
        "channels": {
            "rear": ChannelBounds.model_validate(rear | fixed).model_dump(),
            "front": ChannelBounds.model_validate(front | fixed).model_dump(),
        },
        "baselines": {},
    }
    return Problem.from_file(ProblemFile.model_validate(content), problem.source, problem.model_path)


@pytest.fixture(scope="module")
def small(strider: Problem) -> Problem:
    return two_free(strider)


@pytest.fixture(scope="module")
def cost_of(small: Problem) -> Function:
    """Backward speed, m/s, at points (rear amplitude, front phase); the offset is in the middle."""
    simulator = Simulator.build(small)
    robot = Robot.of(simulator.models[0])
    names = [variable.name for variable in small.space.variables]
    at = [names.index("rear.amplitude_deg"), names.index("front.phase")]

    def one(gait: Gait) -> float:
        return -measure(small, gait, simulator.run(gait), robot)["speed_m_s"]

    def cost(points: Points) -> Points:
        full = np.full((len(points), len(names)), 0.5)
        full[:, at] = points
        with open_executor("threads", 2) as executor:
            return np.array(list(executor.map(one, map(small.space.decode, full))))

    return cost


@pytest.fixture(scope="module")
def grid(cost_of: Function) -> tuple[Points, Points]:
    """A coarse grid over both variables, and its costs."""
    amplitude, phase = np.meshgrid(np.linspace(0.0, 1.0, 9), np.arange(16) / 16, indexing="ij")
    points = np.stack([amplitude.ravel(), phase.ravel()], axis=1)
    return points, cost_of(points)


@pytest.mark.parametrize("solver", SOLVERS.values())
def test_the_best_gait_of_a_grid_is_found(
    solver: Solver, cost_of: Function, grid: tuple[Points, Points]
) -> None:
    """Nelder–Mead, a polish, starts from the grid's fourth best; CMA-ES anywhere."""
    points, costs = grid
    order = costs.argsort()
    start, sigma = (points[order[3]], 0.08) if solver == NELDER_MEAD else (np.full(2, 0.5), 0.25)
    solution = minimise(solver, cost_of, box((1,), 2), start, sigma, 200, rng())
    assert costs.min() < 0.0
    assert solution.cost <= costs.min() + 0.05 * abs(costs.min())
    worth = costs[order[:8]]
    assert worth.max() < 0.5 * costs.min(), "the grid's best gaits do not stand out"
