"""The size of chance is found by how much the recorded cycles differ."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from planting import SIGNALS, dataset, recording_of, rollout

from gaitopt.core.streams import seeded
from gaitopt.diagnose.diagnosis import locate
from gaitopt.diagnose.fit.hypotheses import Hypothesis, hypotheses
from gaitopt.diagnose.fit.runner import Runner
from gaitopt.diagnose.judge.chance import fit_size, fitted_chance
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.find_causes import NominalGap, prepare_trials
from gaitopt.diagnose.judge.settings import ChanceSettings
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.effects.active import Values
from gaitopt.effects.prior import Prior
from gaitopt.optimise.executors import open_executor
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator

SETTINGS = ChanceSettings()
PRIOR = Prior("half-normal", 0.0, 0.15, "a test")
EFFECT = SimpleNamespace(name="grip", parameter="sd", log_prior=lambda value, _: PRIOR.log_density(value))
GRIP = cast(Hypothesis, SimpleNamespace(effect=EFFECT, nominal=None))


def ratios(true: float, values: np.ndarray, signals: int = 6, scatter: float = 0.0) -> np.ndarray:
    """Recorded by simulated squares where the differences of cycles grow with the size."""
    each = np.exp(scatter * seeded(2).standard_normal(signals))
    return (true / values[:, None]) ** 2 * each


def test_the_size_is_that_at_which_cycles_differ_as_much() -> None:
    values = np.array([0.02, 0.05, 0.12, 0.3, 0.6])
    ((squares, chance),) = fit_size(GRIP, values, ratios(0.08, values), SETTINGS)
    assert chance.value == pytest.approx(0.08, rel=0.02)
    assert chance.ci90[0] < chance.value < chance.ci90[1] < 0.6
    assert squares == pytest.approx(0.0, abs=1e-3)
    assert chance.unevenness == pytest.approx(1.0, abs=0.02)


def test_signals_that_disagree_widen_the_interval() -> None:
    values = np.geomspace(0.02, 0.6, 6)
    widths = []
    for scatter in (0.0, 2.0):
        ((_, chance),) = fit_size(GRIP, values, ratios(0.1, values, scatter=scatter), SETTINGS)
        widths.append(np.log(chance.ci90[1] / chance.ci90[0]))
    assert widths[1] > 1.5 * widths[0]


@pytest.mark.parametrize("true", [0.001, 9.0])
def test_nothing_is_said_beyond_what_was_simulated(true: float) -> None:
    values = np.array([0.02, 0.1, 0.6])
    assert fit_size(GRIP, values, ratios(true, values), SETTINGS) == []


@pytest.mark.parametrize(("true", "plausible"), [(0.4, True), (0.5, False)])
def test_a_size_that_is_implausible_is_said(true: float, plausible: bool) -> None:
    values = np.array([0.02, 0.1, 0.6])
    ((_, chance),) = fit_size(GRIP, values, ratios(true, values), SETTINGS)
    assert chance.plausible is plausible
    assert chance.to_dict()["plausible"] is plausible
    assert chance.left_of(9.0) == (chance.unevenness if plausible else 9.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "values", "within"),
    [
        ("grip_variation", {"relative_sd": 0.25}, (0.12, 0.5)),
        ("command_jitter", {"sd_s": 0.02}, (0.01, 0.04)),
    ],
)
def test_planted_chance_is_found(
    arcfold: Problem, tmp_path: Path, name: str, values: Values, within: tuple[float, float]
) -> None:
    trials: dict[str, Any] = {
        gait: (gait, recording_of(rollout(arcfold, gait, 10.0, {name: values})))
        for gait in ("square-2s", "square-1s")
    }
    folder = dataset(tmp_path / "data", trials, starts_at_gait_time_s=0.0)
    simulator = Simulator.build(arcfold)
    data = load_dataset(folder, arcfold, list(SIGNALS))
    with open_executor("threads", 2) as executor:
        found = locate(simulator, data, executor, 1).trials
        gap = NominalGap(simulator, [one.aligned for one in found], [one.floors for one in found], 0.0)
        context = Context(Runner(executor), 1)
        prepared = prepare_trials(gap, context)
        robots = [one for one in prepared.perturbed if one is not None]
        tried = hypotheses(simulator.effects.nominal, arcfold.channel_names, True)
        chance = fitted_chance(prepared.trial_set, gap.floors, robots, [], tried, context)
    assert chance is not None
    assert chance.effect == name
    assert within[0] < chance.value < within[1]
