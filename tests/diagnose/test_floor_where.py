"""The floor and the gap's components: planted gaps are found where they were planted.

The trials are made with RK4 at half the timestep and another impratio, from another start pose, with noise.
"""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from planting import dataset, filmed, rollout

from gaitopt.diagnose.diagnosis import locate
from gaitopt.diagnose.gap.align import align, pooled_marker_rms
from gaitopt.diagnose.gap.floor import Floor, marker_floor
from gaitopt.diagnose.gap.split import COMPONENTS, split
from gaitopt.diagnose.record.cycles import PHASES, shifted, steady
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.diagnose.record.trial import Trial
from gaitopt.diagnose.words import answer, explanation
from gaitopt.gait.gait import Channel, Gait
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

TRIALS = {"2s": ("square-2s", 8.5), "1s": ("square-1s", 6.0)}


@pytest.fixture(scope="module")
def simulator(arcfold):
    return Simulator.build(arcfold)


@pytest.fixture(scope="module")
def diagnosed(arcfold, simulator, tmp_path_factory):
    """Diagnose trials with effects in them; what was simulated once is not simulated again."""
    rollouts = {}

    def run(effects=None, begin=0.0, sync=True, change=None, signals=None, repeats=1):
        key = str(effects)
        if key not in rollouts:
            rollouts[key] = {
                n: rollout(arcfold, gait, length, effects) for n, (gait, length) in TRIALS.items()
            }
        trials = {}
        for name, trajectory in rollouts[key].items():
            for repeat in range(repeats):
                more = {"signals": signals} if signals else {}
                columns = filmed(trajectory, begin, seed=1 + repeat, **more)
                if change is not None:
                    change(columns)
                trials[f"{name}-{repeat}" if repeats > 1 else name] = (TRIALS[name][0], columns)
        folder = tmp_path_factory.mktemp("planted")
        dataset(folder, trials, **({"starts_at_gait_time_s": begin} if sync else {}))
        known = [name for name in simulator.signals if name]
        with ThreadPoolExecutor(2) as executor:
            return locate(simulator, load_dataset(folder, arcfold, known), executor, 1)

    return run


def heaviest(diagnosis):
    """The component with the largest share over all signals and trials."""
    shares = dict.fromkeys(COMPONENTS, 0.0)
    for row in diagnosis.where:
        shares[row.component] += row.share
    return max(shares, key=shares.get)


def test_no_gap_where_there_is_none(diagnosed):
    diagnosis = diagnosed()
    assert diagnosis.verdict == "no_gap"
    assert diagnosis.causes == []
    assert diagnosis.gap.before < 2.0 * diagnosis.gap.floor
    assert diagnosis.gap.after == diagnosis.gap.before
    assert answer(diagnosis).startswith("No significant gap")


@pytest.mark.parametrize("begin", [-0.6, 0.7])
def test_an_unknown_offset_is_fitted(diagnosed, begin):
    diagnosis = diagnosed(begin=begin, sync=False)
    assert diagnosis.verdict == "no_gap"
    for trial in diagnosis.trials:
        assert trial.aligned.offset_s == pytest.approx(begin, abs=0.005)


@pytest.mark.parametrize(
    ("effects", "component"),
    [
        ({"command_latency": {"delay_s": 0.08}}, "timing"),
        ({"servo_travel": {"gain": 0.88}}, "stride"),
        ({"ground_slope": {"angle_rad": 0.08}}, "drift"),
        ({"pad_friction": {"scale": 0.7}}, "drift"),
    ],
)
def test_a_gap_is_found_where_it_was_planted(diagnosed, effects, component):
    diagnosis = diagnosed(effects)
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.where[0].component == component
    assert heaviest(diagnosis) == component
    assert sum(row.share for row in diagnosis.where) == pytest.approx(1.0)
    assert any(component in sentence for sentence in explanation(diagnosis))


def test_the_marker_alone_tells_a_travel_error(diagnosed):
    diagnosis = diagnosed({"servo_travel": {"gain": 0.88}}, signals=("marker.x",), sync=False)
    assert diagnosis.where[0].component == "stride"
    for trial in diagnosis.trials:
        assert trial.splits["marker.x"].size == pytest.approx(0.81, abs=0.06)


def test_a_latency_is_measured_where_the_start_is_known(diagnosed):
    effects = {"command_latency": {"delay_s": 0.08}}
    for trial in diagnosed(effects).trials:
        assert trial.splits["joint.mid_left"].delay_s == pytest.approx(0.08, abs=0.01)
    unknown = diagnosed(effects, sync=False)
    assert unknown.verdict == "no_gap"
    for trial in unknown.trials:
        assert trial.aligned.offset_s == pytest.approx(-0.08, abs=0.005)


def test_outliers_are_found_under_noise_and_explain_themselves(diagnosed):
    def spoil(columns):
        flags = np.random.default_rng(3).random(len(columns["t_s"])) < 0.05
        for name in ("x_m", "y_m", "z_m"):
            columns[name] = np.where(flags, columns[name] + 0.04, columns[name])

    diagnosis = diagnosed(change=spoil)
    assert (diagnosis.verdict, diagnosis.causes) == ("explained", ["marker_outliers"])
    assert diagnosis.where[0].component == heaviest(diagnosis) == "noise"
    assert diagnosis.gap.before > 3.0 * diagnosis.gap.after


def test_rounded_time_stamps_are_found_under_timing_and_explain_themselves(diagnosed):
    def spoil(columns):
        columns["t_s"] = 0.2 * np.round(columns["t_s"] / 0.2)

    diagnosis = diagnosed(change=spoil)
    assert (diagnosis.verdict, diagnosis.causes) == ("explained", ["clock_rounding"])
    assert heaviest(diagnosis) == "timing"


def test_the_components_squares_are_the_gaps_square(diagnosed):
    for trial in diagnosed({"servo_travel": {"gain": 0.88}}).trials:
        for name, part in trial.splits.items():
            assert part.rms == pytest.approx(trial.aligned.rms(name))


def test_repeats_of_a_gait_measure_its_floor(diagnosed):
    diagnosis = diagnosed(repeats=2)
    for trial in diagnosis.trials:
        floor = trial.floors["marker.x"]
        # Repeats of one rollout differ by the camera's noise alone.
        assert floor.repeats == pytest.approx(5e-4, rel=0.4)
    assert all(floor.repeats is None for trial in diagnosed().trials for floor in trial.floors.values())


def test_the_floor_sees_noise_and_start_pose(diagnosed):
    for trial in diagnosed().trials:
        floor = trial.floors["marker.x"]
        assert floor.noise == pytest.approx(5e-4, rel=0.5)
        assert floor.spread >= 0.5 * floor.noise
        assert floor.start_pose > 0.0
        assert floor.numerics > 0.0
        assert marker_floor(trial.floors) > floor.total


def test_a_trial_below_its_floor_blames_nothing(diagnosed):
    diagnosis = diagnosed()
    quiet = [trial for trial in diagnosis.trials if not trial.counts]
    assert quiet
    blamed = {row.trial for row in diagnosis.where}
    for trial in quiet:
        assert trial.name not in blamed
        assert any(
            "not used to blame anything" in s and s.startswith(trial.name) for s in explanation(diagnosis)
        )


# --- on made-up motion ------------------------------------------------------------------------

GAIT = Gait(2.0, {"servo": Channel(duty=0.5, phase=0.0, amplitude_deg=30.0)}, "wave")


def wave(time, size=1.0, drift=0.0, delay=0.0):
    """Strides with 20 mm of travel a cycle and 8 mm of swing, and drift in m per cycle besides."""
    turns = (time - delay) / GAIT.period_s
    return size * (0.02 * turns + 0.008 * np.sin(2.0 * np.pi * turns)) + drift * time / GAIT.period_s


def made_up(**changes):
    time = np.arange(0.0, 20.0, 0.02)
    trial = Trial.of("walk", GAIT, time, {"marker.x": wave(time, **changes)})
    fine = np.arange(-1.0, 25.0, 1e-3)
    aligned = align(
        Trial(trial.name, trial.drive, trial.time, trial.signals, trial.used, starts_at_s=0.0),
        Trajectory(fine, {"marker.x": wave(fine)}),
    )
    return split(aligned, "marker.x", 2.0, {})


@given(st.floats(0.6, 1.5), st.floats(-0.01, 0.01), st.floats(-0.2, 0.2))
def test_size_drift_and_delay_are_recovered(size, drift, delay):
    part = made_up(size=size, drift=drift, delay=delay)
    assert part.size == pytest.approx(size, abs=0.01)
    assert part.delay_s == pytest.approx(delay, abs=0.01)
    assert part.travel[0] == pytest.approx(0.02 * size + drift, abs=1e-5)


@pytest.mark.parametrize(
    ("change", "component"),
    [({"size": 0.8}, "stride"), ({"drift": -0.004}, "drift"), ({"delay": 0.1}, "timing")],
)
def test_pure_changes_have_one_component(change, component):
    part = made_up(**change)
    assert part.squares[component] / part.rms**2 > 0.98


@given(st.floats(-0.5, 0.5))
def test_a_shift_is_undone_by_its_opposite(cycles):
    shape = np.sin(2.0 * np.pi * np.arange(PHASES) / PHASES)
    np.testing.assert_allclose(shifted(shifted(shape, cycles), -cycles), shape, atol=1e-3)


def test_steady_motion_has_no_rest():
    cycle = np.arange(5)[:, None] + np.arange(PHASES)[None, :] / PHASES
    travel, shape, rest = steady(0.03 * cycle + np.sin(2.0 * np.pi * cycle))
    assert travel == pytest.approx(0.03)
    np.testing.assert_allclose(shape, np.sin(2.0 * np.pi * cycle[0]), atol=1e-12)
    np.testing.assert_allclose(rest - rest.mean(), 0.0, atol=1e-12)


def test_floors_add_in_squares():
    assert Floor(1.0, 2.0, 3.0, 4.0).total == pytest.approx(math.sqrt(4.0 + 9.0 + 16.0))
    assert Floor(1.0, 2.0, 3.0, 4.0, repeats=5.0).total == pytest.approx(math.sqrt(25.0 + 16.0))


def test_trials_are_pooled_by_samples():
    time = np.arange(0.0, 8.0, 0.02)
    fine = Trajectory(np.arange(0.0, 12.0, 1e-3), {"marker.x": wave(np.arange(0.0, 12.0, 1e-3))})
    rng = np.random.default_rng(1)
    trials = []
    for count, noise in ((len(time), 1e-3), (len(time) // 2, 4e-3)):
        series = wave(time[:count]) + noise * rng.standard_normal(count)
        trial = Trial.of("walk", GAIT, time[:count], {"marker.x": series})
        trials.append(align(trial, fine))
    residuals = np.concatenate([aligned.residual["marker.x"] for aligned in trials])
    assert pooled_marker_rms(trials) == pytest.approx(math.sqrt(np.mean(residuals**2)))
