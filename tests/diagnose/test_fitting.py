"""Causes planted by other numerics are found again, with their parameters, and the same every time."""

import numpy as np
import pytest
from planting import dataset, filmed, rollout
from toyfits import toy_bench, toy_fit

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.diagnosis import DiagnosisRequest, diagnose
from gaitopt.diagnose.fit.hypotheses import hypotheses
from gaitopt.diagnose.judge.unevenness import UNEVEN
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.optimise.executors import open_executor
from gaitopt.simulation.rollout import Simulator

AMONG = ("servo_torque_limit", "ground_slope", "camera_scale")


@pytest.fixture(scope="module")
def simulator(arcfold):
    return Simulator.build(arcfold)


def diagnosed(
    simulator, folder, effects, among=AMONG, workers=2, known=True, gaits=("square-2s", "square-1s")
):
    trials = {gait: (gait, filmed(rollout(simulator.problem, gait, 5.0, effects))) for gait in gaits}
    start = {"starts_at_gait_time_s": 0.0} if known else {}
    data = load_dataset(
        dataset(folder, trials, **start), simulator.problem, [s for s in simulator.signals if s]
    )
    with open_executor("threads", workers) as executor:
        found = diagnose(simulator, data, DiagnosisRequest(1, among, next_gait=False), executor)
    return found.to_dict()


@pytest.mark.parametrize(
    ("name", "target", "value", "within"),
    [
        ("servo_torque_limit", "mid_act", 0.17, 0.02),
        ("camera_scale", None, 1.08, 0.02),
    ],
)
def test_a_planted_cause_is_found_with_its_parameter(simulator, tmp_path, name, target, value, within):
    parameter = {"servo_torque_limit": "limit_n_m"}.get(name, "scale")
    planted = {parameter: value} | ({"target": target} if target else {})
    found = diagnosed(simulator, tmp_path, {name: planted})
    assert found["causes"][0] == name
    assert found["verdict"] in ("explained", "ambiguous")
    row = found["effects"][0]
    assert row["name"] == name
    assert target is None or row["target"] == target
    assert row["parameters"][parameter]["value"] == pytest.approx(value, abs=within)
    low, high = row["parameters"][parameter]["ci90"]
    assert low <= row["parameters"][parameter]["value"] <= high
    gap = found["gap"]
    assert gap["heldout_after_m"] < gap["heldout_before_m"]
    assert found["unevenness"] < UNEVEN


def test_a_right_model_has_no_gap(simulator, tmp_path):
    found = diagnosed(simulator, tmp_path, {})
    assert (found["verdict"], found["causes"], found["effects"]) == ("no_gap", [], [])


def test_what_is_not_tried_is_not_found(simulator, tmp_path):
    planted = {"servo_torque_limit": {"limit_n_m": 0.1, "target": "mid_act"}}
    found = diagnosed(simulator, tmp_path, planted, ("camera_tilt", "clock_rate"), gaits=("square-1s",))
    assert found["verdict"] in ("unexplained", "partly_explained")
    assert found["other_probability"] > 0.5


@pytest.mark.parametrize("delay", [0.08, 0.0114])
def test_late_commands_and_a_late_clock_are_one_answer(simulator, tmp_path, delay):
    """However short: the clock's range is five times the other, and is searched as finely."""
    planted = {"command_latency": {"delay_s": delay}}
    among = ("command_latency", "clock_offset", "servo_gain")
    found = diagnosed(simulator, tmp_path, planted, among, gaits=("square-1s",))
    assert {*found["causes"], *found["ambiguous_with"]} == {"command_latency", "clock_offset"}
    assert found["verdict"] == "ambiguous"
    rows = {row["name"]: row["parameters"] for row in found["effects"]}
    assert rows["clock_offset"]["offset_s"]["value"] == pytest.approx(-delay, abs=3e-4)
    assert rows["command_latency"]["delay_s"]["value"] == pytest.approx(delay, abs=3e-4)


def test_the_same_bits_whatever_the_workers(simulator, tmp_path):
    planted = {"ground_slope": {"angle_rad": 0.06}}
    among = ("ground_slope", "camera_tilt")
    one, other = (
        diagnosed(simulator, tmp_path / str(n), planted, among, n, False, ("square-1s",)) for n in (1, 2)
    )
    one.pop("dataset"), other.pop("dataset")
    assert one == other


def test_nothing_to_try_is_said(simulator, tmp_path):
    with pytest.raises(GaitoptError, match="no effect can be tried"):
        diagnosed(simulator, tmp_path, {"ground_slope": {"angle_rad": 0.06}}, among=())


def test_hypotheses_stay_inside_their_bounds(simulator, arcfold):
    candidates = hypotheses(simulator.effects.nominal, arcfold.channel_names, offset_known=False)
    assert len({h.name for h in candidates}) == len(candidates)
    assert not any(h.effect.name in ("clock_offset", "clock_rounding", "marker_outliers") for h in candidates)
    for h in candidates:
        assert h.low <= h.neutral <= h.high
        assert all(h.low <= at <= h.high and at != h.neutral for at in h.screened)
        # What lies on one side of neutral foretells nothing of the other, nor a tenth of the way of the rest.
        assert all(any(at == pytest.approx(bound) for at in h.screened) for bound in h.sides)
        middle = 0.5 * (h.low + h.high)
        assert h.coordinate(h.value(middle)) == pytest.approx(middle)
        assert np.isfinite(h.value(h.low))


def test_a_fit_goes_no_farther_than_robots_can_be_simulated():
    """Where the outermost one fails, what lies before it is refined, and what lies beyond is left alone."""
    measured, slope = np.full(8, 0.7), np.ones(8)
    fit = toy_fit(toy_bench(8, 2), measured, lambda a: a * slope, (0.0, 0.5, 1.0))
    assert fit.best() == pytest.approx(0.7, abs=0.02)
    fit = toy_fit(toy_bench(8, 2), measured, lambda a: a * slope, (0.0, 0.5))
    fit.add(1.0, None)
    assert fit.best() == 0.5
    at = fit.wanted()
    assert at is not None
    assert at < 0.5
    fit.add(at, None)
    assert fit.wanted() is None
