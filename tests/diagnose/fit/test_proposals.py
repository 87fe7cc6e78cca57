"""Rounded commands are found among values that a simulation need not try."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from benches import bench, located, write_bench

from gaitopt.diagnose.fit.hypotheses import hypotheses
from gaitopt.diagnose.fit.proposals import Proposals
from gaitopt.diagnose.fit.runner import Runner
from gaitopt.diagnose.fit.single import robot_request
from gaitopt.diagnose.judge.context import Context
from gaitopt.diagnose.judge.find_causes import NominalGap, prepare_trials
from gaitopt.diagnose.judge.set_judge import SetJudge
from gaitopt.diagnose.judge.settings import DEFAULT
from gaitopt.effects.library.servo_command import SERVO_RESOLUTION
from gaitopt.simulation.rollout import Simulator

KINDS = {"step": 2, "square": 1, "ramp": 1, "telegraph": 2}


@pytest.mark.parametrize("step_rad", [0.0137, 0.0291])
def test_the_step_of_rounded_commands_is_proposed(tmp_path: Path, step_rad: float) -> None:
    problem = bench(tmp_path / "problem")
    rounded = problem.with_effects({SERVO_RESOLUTION.name: {"step_rad": step_rad, "target": "all"}})
    write_bench(tmp_path / "data", rounded, trials=KINDS)
    found, simulator = located(problem, tmp_path / "data"), Simulator.build(problem)
    trials, floors = zip(*[(one.aligned, one.floors) for one in found.trials], strict=True)
    with ThreadPoolExecutor(1) as executor:
        context = Context(Runner(executor), 1)
        prepared = prepare_trials(NominalGap(simulator, trials, floors, 0.0), context)
        judge = SetJudge.of(prepared.trial_set, context.runner, DEFAULT.sets)
        (rounding,) = [
            one
            for one in hypotheses(simulator.effects.nominal, simulator.problem.channel_names, True)
            if one.effect is SERVO_RESOLUTION and one.target == "all"
        ]
        proposals = Proposals(prepared.trial_set, judge.loss)
        empty = judge.fitter.empty(prepared.nominal)
        shares = proposals.shares(empty, rounding)
        assert proposals.shares(empty, rounding) == shares
        assert len(shares) <= proposals.settings.most
        at = [rounding.coordinate_at(share) for share in shares]
        assert np.abs(rounding.value(at[0]) / step_rad - 1.0) < 0.01
        robots = judge.fitter.simulate([robot_request([(rounding, one)]) for one in at])
    proposals.learn(empty, rounding, list(zip(shares, robots, strict=True)))
    assert proposals.knows(rounding)
    closer = proposals.shares(empty, rounding)
    assert len(closer) == len(shares)
    assert rounding.value(rounding.coordinate_at(closer[0])) == pytest.approx(step_rad, rel=5e-4)
