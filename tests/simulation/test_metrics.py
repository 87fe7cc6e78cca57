"""Metrics on trajectories with a known answer, and on the robot."""

import math
from collections.abc import Mapping

import numpy as np
import pytest
from drives import wandering
from helpers import still
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from gaitopt.gait.gait import Channel, Gait
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.labels import label_of
from gaitopt.simulation.metrics import METRICS, Metric, mean_metrics, measure, metric_names
from gaitopt.simulation.objective import check_objective, evaluate
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import Scenario

Series = NDArray[np.float64]

PERIOD_S, BEGIN_S, END_S = 0.5, 0.5, 1.5
"""With the quick horizon a gait of 0.5 s is measured over its second and third cycle."""


def robot(weight: float = 2.0, damping: float = 0.0, no_load_speed: float = 10.0) -> Robot:
    """A robot of three servos."""
    return Robot(weight, np.full(3, 0.1), np.full(3, damping), np.full(3, no_load_speed))


def clock() -> Series:
    return np.arange(1501.0) * 1e-3


def synthetic(problem: Problem, signals: Mapping[str, ArrayLike]) -> Trajectory:
    """A trajectory at rest on the ground, but for some signals: series, or constants."""
    time = clock()
    names = [f"marker.{axis}" for axis in "xyz"] + [f"heading.{part}" for part in "xyz"]
    names += [
        f"{kind}.{c}" for kind in ("target", "position", "rate", "torque") for c in problem.channel_names
    ]
    names += [f"{kind}.{p}.{a}" for kind in ("load", "pad_speed") for p in problem.roles.pads for a in "xyz"]
    values: dict[str, ArrayLike] = dict.fromkeys(names, 0.0)
    values |= {"heading.w": 1.0, "contacts": 2.0, "contacts_all": 2.0, "depth": 0.0}
    assert set(signals) <= set(values)
    values |= signals
    return Trajectory(
        time, {name: np.zeros(len(time)) + np.asarray(series) for name, series in values.items()}
    )


def figures(problem: Problem, signals: Mapping[str, ArrayLike], of: Robot | None = None) -> dict[str, float]:
    """The metrics of a synthetic trajectory."""
    return measure(problem, still(problem, PERIOD_S), synthetic(problem, signals), of or robot())


def turned(problem: Problem, **roles: object) -> Problem:
    """The problem with other roles."""
    file = problem.file.model_copy(update={"roles": problem.roles.model_copy(update=roles)})
    return Problem.from_file(file, problem.source, problem.model_path)


def rotation(axis: str, angle: ArrayLike) -> dict[str, ArrayLike]:
    """A heading turned about a world axis."""
    half = np.asarray(angle) / 2.0
    return {"heading.w": np.cos(half), f"heading.{axis}": np.sin(half)}


# --- known answers ----------------------------------------------------------------------------


def test_there_is_a_figure_for_every_metric_and_no_other(quick: Problem) -> None:
    found = figures(quick, {})
    assert list(found) == metric_names(quick)
    assert {type(value) for value in found.values()} == {float}


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-5.0, 5.0))
def test_speed_is_net_travel_over_whole_cycles(
    quick: Problem, speed: float, sideways: float, origin: float
) -> None:
    """Motion inside a cycle, and before the measured cycles, does not count."""
    time = clock()
    wiggle = 0.03 * np.sin(2.0 * np.pi * time / PERIOD_S)
    jump = np.where(time < 0.4, 1.0, 0.0)
    found = figures(
        quick,
        {
            "marker.x": origin + speed * time + wiggle + jump,
            "marker.y": -origin + sideways * time - wiggle,
            "marker.z": wiggle,
        },
    )
    assert found["speed_m_s"] == pytest.approx(speed, abs=1e-9)
    assert found["stride_m"] == pytest.approx(speed * PERIOD_S, abs=1e-9)
    assert found["sideways_m_s"] == pytest.approx(sideways, abs=1e-9)
    if abs(speed) > 1e-3:
        assert found["sideways_ratio"] == pytest.approx(min(10.0, abs(sideways / speed)), abs=1e-5)


def test_travel_between_samples_counts(quick: Problem) -> None:
    """A cycle that ends between two samples is measured to its end."""
    gait = still(quick, 0.4997)
    trajectory = synthetic(quick, {"marker.x": 0.1 * clock()})
    assert measure(quick, gait, trajectory, robot())["speed_m_s"] == pytest.approx(0.1, rel=1e-9)


def test_forward_is_the_problems(quick: Problem) -> None:
    moving = {"marker.x": 0.1 * clock(), "marker.y": 0.2 * clock()}
    for forward, speed, left in (
        ((1.0, 0.0, 0.0), 0.1, 0.2),
        ((0.0, 1.0, 0.0), 0.2, -0.1),
        ((-1.0, 0.0, 0.0), -0.1, -0.2),
        ((0.0, -3.0, 0.0), -0.2, 0.1),
        ((5.0, 0.0, 9.0), 0.1, 0.2),
    ):
        found = figures(turned(quick, forward=forward), moving)
        assert (found["speed_m_s"], found["sideways_m_s"]) == pytest.approx((speed, left), abs=1e-12)


def test_up_is_the_problems(quick: Problem) -> None:
    """On a robot whose up is y, z is its right."""
    problem = turned(quick, up=(0.0, 2.0, 0.0))
    found = figures(
        problem, {"marker.x": 0.1 * clock(), "marker.y": 9.0 * clock(), "marker.z": 0.2 * clock()}
    )
    assert (found["speed_m_s"], found["sideways_m_s"]) == pytest.approx((0.1, -0.2), abs=1e-12)
    np.testing.assert_allclose(problem.roles.axes, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-15)


@pytest.mark.parametrize("rate", [0.3, -0.3, 0.0, 8.0, -8.0])
def test_a_turn_to_the_left_is_positive(quick: Problem, rate: float) -> None:
    found = figures(quick, rotation("z", rate * clock()))
    assert found["yaw_rate_rad_s"] == pytest.approx(rate, abs=1e-9)
    assert found["tilt_rad"] == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_tilt_is_the_largest_in_the_measured_cycles(quick: Problem, axis: str) -> None:
    time = clock()
    angle = np.where(time < BEGIN_S, 1.2, 0.4 * np.exp(-(((time - 1.0) / 0.1) ** 2)))
    found = figures(quick, rotation(axis, angle))
    assert found["tilt_rad"] == pytest.approx(0.4, abs=2e-3)
    assert found["yaw_rate_rad_s"] == pytest.approx(0.0, abs=1e-9)


def test_airtime_is_flight_and_not_chatter(quick: Problem) -> None:
    """Gaps of up to 10 ms are a contact's chatter; a flight of 100 ms in 1 s is a tenth."""
    time = clock()
    chatter = np.where(np.arange(len(time)) % 20 < 9, 0.0, 1.0)
    assert figures(quick, {"contacts": chatter})["airtime"] == 0.0
    flight = np.where((time >= 0.8) & (time < 0.9), 0.0, 1.0)
    assert figures(quick, {"contacts": flight})["airtime"] == pytest.approx(0.1, abs=2e-3)
    assert figures(quick, {"contacts": flight * chatter})["airtime"] == pytest.approx(0.1, abs=2e-2)
    assert figures(quick, {"contacts": 0.0})["airtime"] == pytest.approx(1.0)
    early = np.where(time < BEGIN_S - 0.01, 0.0, 1.0)
    assert figures(quick, {"contacts": early})["airtime"] == 0.0


def test_slip_is_backward_and_under_load(quick: Problem) -> None:
    """20 mm/s backward for 1 s is 20 mm, in two cycles 10 mm each; forward or unloaded is none."""
    pads = quick.roles.pads
    loaded = {f"load.{pads[0]}.z": -1.0}

    def slip(signals: Mapping[str, ArrayLike]) -> float:
        return figures(quick, signals)["slip_m"]

    backward = {f"pad_speed.{pads[0]}.x": -0.02}
    assert slip(backward | loaded) == pytest.approx(0.01, rel=2e-3)
    assert slip({f"pad_speed.{pads[0]}.x": 0.02} | loaded) == 0.0
    assert slip({f"pad_speed.{pads[0]}.y": -0.02} | loaded) == 0.0
    assert slip(backward) == 0.0
    both = backward | loaded | {f"pad_speed.{pads[1]}.x": -0.04, f"load.{pads[1]}.z": 1.0}
    assert slip(both) == pytest.approx(0.03, rel=2e-3)


def test_penetration_is_the_deepest(quick: Problem) -> None:
    depth = np.where(clock() == 1.0, -0.003, 0.001)
    assert figures(quick, {"depth": depth})["penetration_m"] == pytest.approx(0.003)
    assert figures(quick, {"depth": 0.001})["penetration_m"] == 0.0


def test_torque_power_and_cost_of_transport(quick: Problem) -> None:
    """0.1 N m at 3 rad/s is 0.3 W; braking recovers nothing; 2 N at 0.05 m/s cost 0.1 W ideally."""
    time, (first, second, _) = clock(), quick.channel_names
    wave = np.sin(2.0 * np.pi * time / PERIOD_S)
    signals: dict[str, ArrayLike] = {f"torque.{first}": 0.1, f"rate.{first}": 3.0, "marker.x": 0.05 * time}
    found = figures(quick, signals)
    assert found["power_w"] == pytest.approx(0.3)
    assert found["cost_of_transport"] == pytest.approx(0.3 / (2.0 * 0.05))
    assert found["peak_torque_n_m"] == pytest.approx(0.1)
    assert found["rms_torque_n_m"] == pytest.approx(0.1)
    assert figures(quick, signals | {f"rate.{first}": -3.0})["power_w"] == 0.0
    swinging = signals | {f"torque.{second}": 0.4 * wave, f"rate.{second}": 1.0}
    found = figures(quick, swinging)
    assert found["peak_torque_n_m"] == pytest.approx(0.4, rel=1e-4)
    assert found["rms_torque_n_m"] == pytest.approx(0.4 / math.sqrt(2.0), rel=1e-3)
    assert found["power_w"] == pytest.approx(0.3 + 0.4 / math.pi, rel=1e-3)


def test_a_motors_own_friction_does_no_work_on_the_robot(quick: Problem) -> None:
    """Damping of the driven joint is the motor's: at no-load speed its shaft does no work."""
    name = quick.channel_names[0]
    signals = {f"torque.{name}": 0.1, f"rate.{name}": 5.0}
    assert figures(quick, signals, robot(damping=0.02))["power_w"] == pytest.approx(0.0, abs=1e-12)
    assert figures(quick, signals, robot(damping=0.01))["power_w"] == pytest.approx(0.25)


def test_transport_backward_or_nowhere_costs_without_end(quick: Problem) -> None:
    for speed in (0.0, -0.1):
        assert figures(quick, {"marker.x": speed * clock()})["cost_of_transport"] == math.inf


def test_a_weightless_robot_is_measured_too(quick: Problem) -> None:
    found = figures(quick, {"marker.x": 0.1 * clock()}, robot(weight=0.0))
    assert found["speed_m_s"] == pytest.approx(0.1)


def test_reached_is_the_share_of_the_commanded_travel(quick: Problem) -> None:
    first, second, third = quick.channel_names
    wave = 0.5 + 0.5 * np.sin(2.0 * np.pi * clock() / PERIOD_S)
    found = figures(
        quick,
        {
            f"target.{first}": wave,
            f"position.{first}": 0.2 + 0.6 * wave,
            f"target.{second}": -wave,
            f"position.{second}": 0.5 - 2.0 * wave,
            f"position.{third}": wave,
        },
    )
    assert found[f"reached.{first}"] == pytest.approx(0.6, rel=1e-3)
    assert found[f"reached.{second}"] == pytest.approx(1.0)  # beyond the ends counts as the ends
    assert found[f"reached.{third}"] == 1.0  # nothing commanded, nothing missed
    assert found["reached"] == found[f"reached.{first}"]


def test_command_speed_is_over_the_servos(quick: Problem) -> None:
    gait = Gait(
        PERIOD_S,
        {
            name: Channel(duty=0.5, phase=0.0, amplitude_deg=10.0 * i, smoothing=1.0)
            for i, name in enumerate(quick.channel_names)
        },
    )
    found = measure(quick, gait, synthetic(quick, {}), robot(no_load_speed=4.0))
    peak = math.radians(20.0) * math.pi / (2.0 * 0.5 * PERIOD_S)
    assert found["command_speed_ratio"] == pytest.approx(peak / 4.0)
    square = Gait(PERIOD_S, {n: c.model_copy(update={"smoothing": 0.0}) for n, c in gait.channels.items()})
    assert measure(quick, square, synthetic(quick, {}), robot())["command_speed_ratio"] == math.inf


def test_a_failed_simulation_has_no_figures(quick: Problem) -> None:
    gait = still(quick)
    failed = measure(quick, gait, Trajectory(np.empty(0), {}, "diverged: badqacc"), robot())
    assert list(failed) == list(figures(quick, {}))
    assert all(math.isnan(value) for value in failed.values())


def test_means_of_signed_drifts_are_of_their_size(quick: Problem) -> None:
    left = figures(quick, {"marker.y": 0.1 * clock(), "marker.x": 0.2 * clock()})
    right = figures(quick, {"marker.y": -0.1 * clock(), "marker.x": -0.2 * clock()})
    mean = mean_metrics([left, right])
    assert mean["sideways_m_s"] == pytest.approx(0.1)
    assert mean["speed_m_s"] == pytest.approx(0.0)
    assert list(mean) == list(left)


# --- the registry -----------------------------------------------------------------------------


def test_a_metric_is_one_record(quick: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    """Added to the registry, it is measured, named in tables, averaged, and a term of the objective."""
    lowest = Metric(
        "lowest_marker_m", "smallest height", lambda window: float(window["marker.z"].min()), title="low"
    )
    monkeypatch.setitem(METRICS, lowest.name, lowest)
    found = figures(quick, {"marker.z": 0.1 + clock()})
    assert found[lowest.name] == pytest.approx(0.1 + BEGIN_S)
    assert list(found) == metric_names(quick)
    assert label_of(lowest.name) == "low [mm]"
    assert mean_metrics([found, found])[lowest.name] == found[lowest.name]
    objective = quick.objective.model_copy(update={"terms": {lowest.name: 1.0}, "constraints": {}})
    problem = Problem.from_file(
        quick.file.model_copy(update={"objective": objective}), quick.source, quick.model_path
    )
    check_objective(problem)
    assert evaluate(problem, [found], ["ok"]).cost == pytest.approx(found[lowest.name])


def test_without_cycles_metrics_of_a_cycle_are_left_out(quick: Problem) -> None:
    drive = wandering(3, 1.5)
    found = measure(quick, drive, synthetic(quick, {"marker.x": 0.2 * clock()}), robot())
    assert list(found) == metric_names(quick, cyclic=False)
    assert set(METRICS) - set(found) == {"stride_m", "slip_m"}
    assert found["speed_m_s"] == pytest.approx(0.2)


# --- on the robot -----------------------------------------------------------------------------


def on_robot(problem: Problem, gait: Gait, scenario: Scenario | None = None) -> dict[str, float]:
    """The metrics of a gait on the robot."""
    simulator = Simulator.build(problem, (scenario or Scenario(),))
    trajectory = simulator.run(gait)
    assert trajectory.status == "ok"
    return measure(problem, gait, trajectory, Robot.of(simulator.models[0]))


def test_with_swapped_feet_it_walks_the_other_way(arcfold: Problem) -> None:
    """If it grips with the other foot while it stretches, the stride goes backward."""
    gait = arcfold.baselines["square-2s"]
    mid, foot1, foot2 = gait.channels.items()
    swapped = Gait(gait.period_s, dict([mid, (foot1[0], foot2[1]), (foot2[0], foot1[1])]))
    there, back = on_robot(arcfold, gait)["speed_m_s"], on_robot(arcfold, swapped)["speed_m_s"]
    assert there > 0.0 > back
    assert abs(back) > 0.2 * there


def test_the_hand_tuned_gaits_stride_forward_on_the_ground(arcfold: Problem) -> None:
    for name in ("square-4s", "square-2s", "square-1s"):
        found = on_robot(arcfold, arcfold.baselines[name])
        assert found["speed_m_s"] > 0.0, name
        assert found["airtime"] < 0.02, name
        # No more than the geometric stride of two 60 mm links bent to 45 degrees, and some sliding.
        assert 0.0 < found["stride_m"] < 1.5 * 2.0 * 0.06 * (1.0 - math.cos(math.radians(45.0))), name


def test_the_incomplete_motion_of_a_fast_gait_shows(arcfold: Problem) -> None:
    """Weak servos do not reach the targets of a fast square wave; those of a slow one they reach."""
    weak = arcfold.with_parameters({"torque_limit": 0.2 * arcfold.file.parameters["torque_limit"].value})
    slow, fast = (on_robot(weak, arcfold.baselines[f"square-{p}s"]) for p in ("4", "0.5"))
    assert fast["reached.mid_act"] < 0.9 * slow["reached.mid_act"]


def test_a_motionless_gait_has_nothing_to_report(arcfold: Problem, strider: Problem) -> None:
    for problem in (arcfold, strider):
        found = on_robot(problem, still(problem))
        for name in ("speed_m_s", "stride_m", "sideways_m_s", "yaw_rate_rad_s", "slip_m", "power_w"):
            assert found[name] == pytest.approx(0.0, abs=1e-5), name
        assert found["airtime"] == 0.0
        assert found["reached"] == 1.0
        assert found["command_speed_ratio"] == 0.0


def test_a_planar_robot_does_not_turn_or_drift(strider: Problem) -> None:
    found = on_robot(strider, strider.baselines["square"])
    assert found["speed_m_s"] != 0.0
    assert found["sideways_m_s"] == pytest.approx(0.0, abs=1e-9)
    assert found["yaw_rate_rad_s"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("robot_name", ["quick", "strider"])
def test_more_power_is_drawn_than_transport_needs(robot_name: str, request: pytest.FixtureRequest) -> None:
    """The servos work against friction, so the mechanical work is positive."""
    problem = request.getfixturevalue(robot_name)
    for gait in problem.baselines.values():
        found = on_robot(problem, gait)
        assert found["power_w"] > 0.0
        assert found["rms_torque_n_m"] <= found["peak_torque_n_m"]
        assert 0.0 <= found["reached"] <= 1.0
