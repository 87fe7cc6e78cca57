"""The reduced model, compared with analytic derivatives, an integrator, symmetry and geometry."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gaitopt.plan.collocation import Collocation
from gaitopt.plan.gait_vector import N_GAIT, Vector, random_gait, to_ramps, to_smoothing
from gaitopt.plan.parameters import PlanarParameters
from gaitopt.plan.plan import Planner
from gaitopt.plan.planar import N_STATE, PlanarModel, channel_target
from gaitopt.problem.problem import Problem, load_problem

WIDTH = 0.01


@pytest.fixture(scope="module")
def problem() -> Problem:
    return load_problem("arcfold")


@pytest.fixture(scope="module")
def planner(problem: Problem) -> Planner:
    return Planner(problem)


@pytest.fixture(scope="module")
def model(planner: Planner) -> PlanarModel:
    return planner.model


@pytest.fixture(scope="module")
def nominal(model: PlanarModel) -> PlanarParameters:
    return model.parameters


def square(period: float) -> Vector:
    """The hand-tuned gait, its edges as ramps of a tenth of the half cycle."""
    down = -np.pi / 2
    return np.array(
        [period, 0.5, 0.25, np.pi / 2, 0.0, 0.1, 0.5, 0.0, down, 0.0, 0.1, 0.5, 0.5, down, 0.0, 0.1]
    )


@pytest.fixture(scope="module")
def gait(planner: Planner) -> Vector:
    gait = random_gait(planner.bounds, np.random.default_rng(3))
    gait[0] = 0.6
    gait[[5, 10, 15]] = 0.6
    return gait


def mirrored_feet(gait: Vector) -> Vector:
    return np.concatenate([gait[:6], gait[11:16], gait[6:11]])


def symmetric(nominal: PlanarParameters, **changes: float) -> PlanarModel:
    """A crawler that is symmetric front to back."""
    length = nominal.module_length
    same = {
        "front_mass": nominal.rear_mass,
        "front_com": length - nominal.rear_com,
        "front_pad": length - nominal.rear_pad,
    }
    return PlanarModel(replace(nominal, **(same | changes)))


def test_smooth_target_is_the_square_wave_away_from_its_edges() -> None:
    duty, phase, ramp = 0.3, 0.2, 0.06
    for cycle in np.linspace(0, 2, 400, endpoint=False):
        into = (cycle + phase) % 1
        if min(abs(into - e) for e in (0, duty, 1)) > ramp / 2:
            expected = 0.1 + (0.5 if into < duty else 0)
            assert float(channel_target(cycle, duty, phase, 0.5, 0.1, ramp)) == pytest.approx(expected)


def test_full_smoothing_at_half_duty_is_a_sinusoid() -> None:
    for cycle in np.linspace(0, 1, 37):
        expected = 0.5 + 0.5 * np.sin(2 * np.pi * cycle)
        assert float(channel_target(cycle, 0.5, 0.0, 1.0, 0.0, 0.5)) == pytest.approx(expected, abs=1e-12)


def test_ramps_are_smoothing_rewritten(gait: Vector) -> None:
    assert to_smoothing(to_ramps(gait)) == pytest.approx(gait)


def test_flow_derivative_equals_finite_difference(model: PlanarModel, gait: Vector) -> None:
    state, ramped = np.array([0.01, 0.6, -0.5, -0.9]), to_ramps(gait)
    x, g = ca.MX.sym("x", N_STATE), ca.MX.sym("g", N_GAIT)
    rates = model.flow(x, g, 0.37, WIDTH)[0]
    exact = np.array(ca.Function("j", [x, g], [ca.jacobian(rates, ca.vertcat(x, g))])(state, ramped))
    at = np.concatenate([state, ramped])
    for i, column in enumerate(exact.T):
        step = np.zeros_like(at)
        step[i] = 1e-6
        ahead, behind = (np.array(model.flow(v[:4], v[4:], 0.37, WIDTH)[0]) for v in (at + step, at - step))
        assert column == pytest.approx(((ahead - behind) / 2e-6).ravel(), rel=2e-5, abs=1e-5)


def test_stride_gradient_equals_finite_difference(model: PlanarModel, gait: Vector) -> None:
    ramped, start = to_ramps(gait), model.start_state(gait)
    g = ca.MX.sym("g", N_GAIT)
    stride = ca.Function("stride", [g], [model.rollout(400)(start, g, WIDTH)[-1, -1]])
    exact = np.array(ca.Function("d", [g], [ca.gradient(stride(g), g)])(ramped)).ravel()
    for i in range(N_GAIT):
        step = np.zeros(N_GAIT)
        step[i] = 1e-5
        difference = float(stride(ramped + step) - stride(ramped - step)) / 2e-5
        assert exact[i] == pytest.approx(difference, rel=1e-3, abs=1e-6)


def test_runge_kutta_agrees_with_scipy(model: PlanarModel, gait: Vector) -> None:
    ramped, cycle = to_ramps(gait), model.cycle(gait, WIDTH)

    def rate(at: float, y: Vector) -> Vector:
        rates, speed, _ = model.flow(y[:4], ramped, at, WIDTH)
        return np.append(np.array(rates).ravel(), float(speed))

    first = np.append(cycle.state[:, 0], 0.0)
    exact = solve_ivp(rate, (0, 1), first, method="Radau", rtol=1e-8, atol=1e-9, max_step=0.01)
    assert cycle.position[-1] - cycle.position[0] == pytest.approx(exact.y[-1, -1], abs=2e-5)
    assert cycle.state[:, -1] == pytest.approx(cycle.state[:, 0], abs=1e-4)


@pytest.mark.slow
def test_collocation_is_the_integrated_motion(model: PlanarModel, gait: Vector, planner: Planner) -> None:
    problem = Collocation(model, planner.bounds, n_intervals=80, ramp=0.03, iterations=40)
    point = problem.guess(gait, WIDTH)
    problem.lower[:N_GAIT] = problem.upper[:N_GAIT] = point[:N_GAIT]
    solution = problem.solve(point, WIDTH)
    assert solution.status == "Solve_Succeeded"
    assert solution.speed == pytest.approx(model.speed(gait, WIDTH), rel=0.02, abs=2e-4)


@pytest.mark.parametrize("seed", range(4))
def test_mirrored_gait_goes_backward_at_the_same_speed(
    seed: int, nominal: PlanarParameters, planner: Planner
) -> None:
    crawler, gait = symmetric(nominal), random_gait(planner.bounds, np.random.default_rng(seed))
    forward, backward = crawler.speed(gait, WIDTH), crawler.speed(mirrored_feet(gait), WIDTH)
    assert backward == pytest.approx(-forward, abs=1e-6)


def test_symmetric_gait_with_equal_friction_goes_nowhere(nominal: PlanarParameters) -> None:
    crawler = symmetric(nominal, mu_pad=nominal.mu_body)
    gait = square(0.6)
    gait[12] = gait[7]  # both feet in step
    assert crawler.speed(gait, WIDTH) == pytest.approx(0, abs=1e-5)


def test_without_friction_it_goes_nowhere(nominal: PlanarParameters) -> None:
    crawler = PlanarModel(replace(nominal, mu_pad=1e-9, mu_body=1e-9))
    assert crawler.speed(square(1.0), WIDTH) == pytest.approx(0, abs=1e-6)


def test_perfect_anchoring_gives_the_geometric_stride(nominal: PlanarParameters) -> None:
    crawler = PlanarModel(replace(nominal, mu_pad=3.0, mu_body=0.003, hinge_stiffness=0.0))
    geometric = 2 * nominal.link_length * (1 - np.cos(np.pi / 4))
    position = crawler.cycle(square(4.0), 0.002).position
    assert position[-1] - position[0] == pytest.approx(geometric, rel=0.01)


def test_creep_shrinks_with_the_width(model: PlanarModel) -> None:
    creep = [abs(model.creep(square(2.0), width)) for width in (0.02, 0.005)]
    assert creep[1] < 0.5 * creep[0]
    assert creep[1] < 1e-3


def test_load_is_the_weight(model: PlanarModel, gait: Vector, nominal: PlanarParameters) -> None:
    _, _, loads = model.flow([0, 0.7, -0.8, -1.2], to_ramps(gait), 0.1, WIDTH)
    assert float(ca.sum1(loads)) == pytest.approx(nominal.mass * nominal.gravity)
    assert float(ca.mmin(loads)) >= 0


def test_parameters_are_the_models_own(problem: Problem, nominal: PlanarParameters) -> None:
    values = {name: parameter.value for name, parameter in problem.file.parameters.items()}
    assert nominal.mu_pad == values["mu_tape"]
    assert nominal.mu_body == values["mu_base"]
    assert nominal.servo_gain == values["k_motor"]
    assert nominal.servo_damping == values["b_motor"]
    assert nominal.servo_torque_limit == values["torque_limit"]
    assert nominal.link_length == pytest.approx(0.06)
    assert nominal.hinge_stiffness == pytest.approx(3 * values["k_joint"])  # 2 middles, 4 outer at a half
    changed = Planner(problem.with_parameters({"mu_tape": 0.5})).model.parameters
    assert changed.mu_pad == 0.5
