"""A gap that is below its floor shows no cause, however well an effect would fit."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from planting import SIGNALS, dataset, recording_of, rollout

from gaitopt.core.progress import Progress
from gaitopt.diagnose.diagnosis import locate
from gaitopt.diagnose.fit.hypotheses import hypotheses
from gaitopt.diagnose.fit.runner import Runner
from gaitopt.diagnose.gap.floor import Floors
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.find_causes import NominalGap, find_causes, prepare_trials
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.diagnose.trial_gap import TrialGap
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator


@pytest.fixture(scope="module")
def uphill(arcfold: Problem, tmp_path_factory: pytest.TempPathFactory) -> Sequence[TrialGap]:
    """A walk uphill, aligned with the nominal robot."""
    walk = recording_of(rollout(arcfold, "square-1s", 6.0, {"ground_slope": {"angle_rad": 0.06}}))
    folder = dataset(
        tmp_path_factory.mktemp("data"), {"walk": ("square-1s", walk)}, starts_at_gait_time_s=0.0
    )
    simulator, executor = Simulator.build(arcfold), SerialExecutor()
    return locate(simulator, load_dataset(folder, arcfold, list(SIGNALS)), executor, 1).trials


def _coarser(floors: Floors) -> Floors:
    """Floors of a simulation whose timestep changes more than the gap."""
    return {name: replace(floor, numerics=1.0) for name, floor in floors.items()}


def test_no_effect_is_tried_where_no_gap_is_above_its_floor(
    arcfold: Problem, uphill: Sequence[TrialGap]
) -> None:
    simulator, steps = Simulator.build(arcfold), list[Progress]()
    context = Context(Runner(SerialExecutor(), steps.append), 1)
    trials, floors = [one.aligned for one in uphill], [one.floors for one in uphill]
    clear = NominalGap(simulator, trials, floors, 0.0)
    faint = NominalGap(simulator, trials, [_coarser(one) for one in floors], 0.0)
    assert clear.above_floor.tolist() == [one.counts for one in uphill] == [True]
    assert faint.above_floor.tolist() == [False]
    ready = prepare_trials(faint, context)
    assert np.all(ready.trial_set.mean_squares(ready.nominal.whitened) > context.settings.verdict.no_gap)
    tried = hypotheses(simulator.effects.nominal, arcfold.channel_names, offset_known=True)
    found = find_causes(faint, tried, context)
    assert (found.verdict, list(found.candidates), steps) == ("no_gap", [], [])
