"""Trials that are no recordings of the gaits that they name."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from planting import SIGNALS, dataset, recording_of, rollout

from gaitopt.diagnose.diagnosis import Diagnosis, DiagnosisRequest, diagnose, locate
from gaitopt.diagnose.gap.align import align
from gaitopt.diagnose.gap.misfits import misfits
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.diagnose.record.trial import Trial
from gaitopt.gait.gait import Gait
from gaitopt.gait.logged import LoggedCommands
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator

SLIPPERY = {"pad_friction": {"scale": 0.5}, "servo_gain": {"scale": 0.7, "target": "all"}}
Columns = Mapping[str, np.ndarray]


def walked(
    problem: Problem, gait: str, begin_s: float = 0.0, **effects: Mapping[str, float | str]
) -> Columns:
    """What a camera sees of a gait for six seconds, from some gait time on."""
    return recording_of(rollout(problem, gait, 6.0 + begin_s, effects), begin_s)


def without_power(problem: Problem, gait: str, from_s: float) -> Columns:
    """The same of a robot that loses its power."""
    time = np.arange(0.0, 6.0, 0.02)
    targets = np.where((time < from_s)[:, None], problem.baselines[gait].targets(time), np.nan)
    log = LoggedCommands.of(problem.channel_names, time, targets)
    return recording_of(Simulator.build(problem).run(log, duration=6.0))


def located(
    problem: Problem, folder: Path, trials: Mapping[str, tuple[str, Columns]], **more: object
) -> Diagnosis:
    data = load_dataset(dataset(folder, trials, **more), problem, list(SIGNALS))
    return locate(Simulator.build(problem), data, SerialExecutor(), 1)


@pytest.mark.slow
@pytest.mark.parametrize("known", [True, False])
def test_another_gaits_recording_is_named_and_left_out(arcfold: Problem, tmp_path: Path, known: bool) -> None:
    begin = {} if not known else {"starts_at_gait_time_s": 0.3}
    trials = {
        "right": ("square-1s", walked(arcfold, "square-1s", 0.3, **SLIPPERY)),
        "too": ("square-2s", walked(arcfold, "square-2s", 0.3, **SLIPPERY)),
        "wrong": ("square-1s", walked(arcfold, "square-2s", 0.3, **SLIPPERY)),
    }
    found = located(arcfold, tmp_path, trials, **begin)
    assert list(found.misfit_trials) == ["wrong"]
    assert found.misfit_trials["wrong"] > 3.0
    (said,) = [d.message for trial in found.trials for d in trial.defects if d.name == "another_gait"]
    assert said.startswith("moves as square-2s does, not as square-1s")
    assert [trial.name for trial in found.fitting] == ["right", "too"]


def test_masked_samples_do_not_tell_which_gait_it_was(arcfold: Problem) -> None:
    gaits = {name: arcfold.baselines[name] for name in ("square-1s", "square-2s")}
    predicted = {name: Simulator.build(arcfold).run(gait, duration=9.0) for name, gait in gaits.items()}
    seen = walked(arcfold, "square-2s", 0.3, **SLIPPERY)
    time, x = seen["t_s"], seen["x_m"]
    masked = np.arange(len(time)) % 4 == 0
    rng = np.random.default_rng(1)

    def ratio(series: np.ndarray) -> float:
        """How much more like the other gait the recording is."""
        wrong = Trial.of("wrong", gaits["square-1s"], time, {"marker.x": series}).masked(masked)
        other = Trial.of("right", gaits["square-2s"], time, {"marker.x": x})
        trials = [align(wrong, predicted["square-1s"]), align(other, predicted["square-2s"])]
        return misfits(trials)["wrong"][0].parameters["ratio"]

    assert ratio(np.where(masked, rng.normal(scale=10.0, size=len(x)), x)) == ratio(x) > 3.0


def test_recordings_of_gaits_that_command_nearly_the_same_are_not_told_apart(arcfold: Problem) -> None:
    """Where one of two such gaits is simulated better, both recordings are more like that prediction."""
    gait, other = arcfold.baselines["square-1s"], arcfold.baselines["square-2s"]
    weak = rollout(arcfold, "square-1s", 7.0, SLIPPERY)
    seen = recording_of(weak, 0.3)
    series = {"marker.x": seen["x_m"], "marker.y": seen["y_m"], "marker.z": seen["z_m"]}
    mine = align(Trial.of("mine", gait, seen["t_s"], series), rollout(arcfold, "square-2s", 7.0, {}))

    def odd(named: Gait) -> list[str]:
        return [*misfits([mine, align(Trial.of("other", named, seen["t_s"], series), weak)])]

    assert odd(other) == ["mine"]
    assert odd(gait.with_period(1.02)) == []


def test_a_robot_that_stands_between_its_steps_has_not_stopped(arcfold: Problem) -> None:
    gait = arcfold.baselines["square-1s"]
    time = np.arange(0.0, 6.0, 0.02)
    predicted = Simulator.build(arcfold).run(gait, duration=7.0)

    def odd(step_s: float, until_s: float) -> list[str]:
        """Steps of 5 mm within 0.3 s, of which the last one ends before some time."""
        steps, since = np.divmod(np.minimum(time, until_s), step_s)
        forward = 5e-3 * (steps + np.sin(0.5 * np.pi * np.minimum(since / 0.3, 1.0)) ** 2)
        return [*misfits([align(Trial.of("film", gait, time, {"marker.x": forward}), predicted)])]

    assert odd(2.4, 4.7) == []
    assert odd(0.5, 2.9) == ["film"]


def test_a_robot_that_loses_its_power_is_named_with_the_time(arcfold: Problem, tmp_path: Path) -> None:
    trials = {
        "right": ("square-1s", walked(arcfold, "square-1s", **SLIPPERY)),
        "lost": ("square-1s", without_power(arcfold, "square-1s", 3.1)),
    }
    found = located(arcfold, tmp_path, trials, starts_at_gait_time_s=0.0)
    assert list(found.misfit_trials) == ["lost"]
    (defect,) = [d for trial in found.trials for d in trial.defects if d.name == "stands_still"]
    assert defect.parameters["since_s"] == pytest.approx(3.5, abs=0.51)


@pytest.mark.slow
def test_trials_of_a_very_different_robot_all_fit(arcfold: Problem, tmp_path: Path) -> None:
    lame = {"servo_torque_limit": {"limit_n_m": 0.08, "target": "all"}, "command_latency": {"delay_s": 0.1}}
    trials = {g: (g, walked(arcfold, g, 0.2, **lame)) for g in ("square-1s", "square-2s", "square-0.5s")}
    assert not located(arcfold, tmp_path, trials).misfit_trials


@pytest.mark.slow
def test_all_trials_are_kept_where_most_seem_to_be_misfits(arcfold: Problem, tmp_path: Path) -> None:
    swapped = {
        "a": ("square-1s", walked(arcfold, "square-2s")),
        "b": ("square-2s", walked(arcfold, "square-1s")),
    }
    found = located(arcfold, tmp_path, swapped)
    assert len(found.fitting) == 2
    assert [d.name for trial in found.trials for d in trial.defects].count("another_gait") == 2


@pytest.mark.slow
def test_a_misfit_does_not_spoil_the_diagnosis(arcfold: Problem, tmp_path: Path) -> None:
    slope = {"ground_slope": {"angle_rad": 0.05}}
    trials = {
        "1s": ("square-1s", walked(arcfold, "square-1s", **slope)),
        "2s": ("square-2s", walked(arcfold, "square-2s", **slope)),
        "wrong": ("square-2s", walked(arcfold, "square-1s", **slope)),
    }
    folder = dataset(tmp_path, trials, starts_at_gait_time_s=0.0)
    data = load_dataset(folder, arcfold, list(SIGNALS))
    request = DiagnosisRequest(1, ("ground_slope", "payload_mass", "com_offset"), next_gait=False)
    found = diagnose(Simulator.build(arcfold), data, request, SerialExecutor())
    assert (found.verdict, found.causes) == ("explained", ["ground_slope"])
    assert list(found.misfit_trials) == ["wrong"]
    assert [row.trial for row in found.gap_by_trial] == ["1s", "2s"]
    assert found.to_dict()["misfit_trials"] == found.misfit_trials
