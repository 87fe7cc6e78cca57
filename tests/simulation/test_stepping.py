"""Steps one by one have the bits of steps in one call, also where a simulation is stopped."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import rigs
from helpers import STRIDER, edited, problem_folder, same_bits
from mujoco.batch import Batch
from numpy.typing import NDArray

from gaitopt.effects.effect import Update, loop_steps
from gaitopt.gait.drive import Drive
from gaitopt.gait.logged import LoggedCommands
from gaitopt.optimise.quasi_random import quasi_random
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation import rollout
from gaitopt.simulation.effort import Counts
from gaitopt.simulation.rollout import RolloutSettings, Simulator
from gaitopt.simulation.scenario import draw_scenarios
from gaitopt.simulation.stepping import Together, jump_rows

Effects = Mapping[str, Mapping[str, float | str]]

SAG: Effects = {"servo_sag": {"share_lost": 0.3}}
DRY: Effects = {"servo_friction_load": {"share": 0.3}, "servo_stiction": {"torque_n_m": 0.02}}
LAG: Effects = {"servo_lag": {"time_constant_s": 0.03}}
GROUND: Effects = {"friction_load": {"exponent": 0.3}, "friction_direction": {"ratio": 1.3}}
PLAY: Effects = {"servo_backlash": {"half_width_rad": 0.02}, "servo_deadband": {"half_width_rad": 0.01}}


class TogetherBetweenUpdates(Together):
    """Steps in calls of MuJoCo's batch that end where the model is edited."""

    def __init__(
        self,
        model: mujoco.MjModel,
        batch: Batch,
        ctrl: NDArray[np.float64],
        out: Mapping[str, NDArray[np.float64]],
        updates: Sequence[Update],
        _: int,
        switched: Sequence[int],
    ):
        super().__init__(batch, ctrl, out)
        self._model, self._batch_of_one, self._rows = model, batch, ctrl
        self._arrays, self._updates = out, updates
        self._prompt = [update for update in updates if update.prompt]
        changes = [True, *(np.diff(ctrl.view(np.int64), axis=0) != 0).any(axis=1)]
        self._jumps = jump_rows(changes, switched) if self._prompt else set()
        self._every = loop_steps(model.opt.timestep)
        self._often = 1 if self._prompt else self._every

    def advance(self, begin: int, end: int, counts: Counts) -> bool:
        """Simulate some rows, and repeat the last one in those that are left."""
        row = begin
        while row < end:
            self._jump(row)
            after = min(end, (row // self._often + 1) * self._often)
            some = {name: one[:, row - begin : after - begin] for name, one in counts.items()}
            if not super().advance(row, after, some):
                for array in self._arrays.values():
                    array[after:end] = array[after - 1]
                return False
            for update in self._updates:
                if update.prompt or after % self._every == 0:
                    update.edit(self._arrays["sensordata"][after - 1])
            row = after
        return True

    def _jump(self, row: int) -> None:
        if row in self._jumps:
            data = self._batch_of_one.get_data(0)
            data.ctrl[:] = self._rows[row]
            mujoco.mj_forward(self._model, data)
            for update in self._prompt:
                update.edit(data.sensordata)


def in_both_ways(
    monkeypatch: pytest.MonkeyPatch, simulator: Simulator, drive: Drive, **options: Any
) -> tuple[Trajectory, Trajectory]:
    """A rollout whose steps are called one by one, and the same in calls of MuJoCo's batch."""
    calls = []

    def together(*arguments: Any) -> TogetherBetweenUpdates:
        calls.append(arguments)
        return TogetherBetweenUpdates(*arguments)

    one_by_one = simulator.run(drive, **options)
    with monkeypatch.context() as patched:
        patched.setattr(rollout, "OneByOne", together)
        other = simulator.run(drive, **options)
    assert len(calls) == 1
    return one_by_one, other


@pytest.mark.parametrize("effects", [SAG, DRY, SAG | LAG, GROUND, SAG | PLAY], ids="+".join)
@pytest.mark.parametrize("robot", ["arcfold", "strider"])
def test_a_gait_has_the_same_bits(
    monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest, robot: str, effects: Effects
) -> None:
    problem: Problem = request.getfixturevalue(robot)
    simulator = Simulator.build(problem.with_effects(effects), draw_scenarios(problem, 2, (1,)))
    for gait, scenario in zip(list(problem.baselines.values())[:2], (0, 1), strict=True):
        one, other = in_both_ways(
            monkeypatch, simulator, gait, scenario=scenario, duration=0.4, poses=scenario == 1
        )
        assert one.status == "ok"
        assert same_bits(one, other)
        assert scenario == 0 or np.array_equal(one.poses, other.poses)


def test_a_row_is_a_jump_where_the_one_before_was_held_or_the_power_changes() -> None:
    smooth = [True] * 5
    assert jump_rows(smooth, []) == {0}
    assert jump_rows([True, False, True, True, False], [4]) == {0, 2, 4}


@pytest.mark.parametrize("effects", [SAG, DRY, DRY | LAG, SAG | PLAY], ids="+".join)
def test_cut_power_has_the_same_bits(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, effects: Effects
) -> None:
    arm = rigs.build(tmp_path / "arm", rigs.arm(), {"marker": "tip", "hinges": ["elbow"]})
    rows = [[0.3], [math.nan], [0.3], [-0.0], [math.nan]]
    log = LoggedCommands.of(["turn"], [0.0, 0.137, 0.3911, 0.5, 0.6], rows)
    simulator = Simulator.build(arm.with_effects(effects))
    for start in (None, {"elbow": 0.28}):
        one, other = in_both_ways(monkeypatch, simulator, log.recorded(0.8, 0.02, start))
        assert same_bits(one, other)
        assert not one["torque.turn"][np.isnan(one["target.turn"])].any()


@pytest.mark.parametrize("timestep_s", [1e-4, 3e-3])
def test_any_timestep_has_the_same_bits(
    monkeypatch: pytest.MonkeyPatch, strider: Problem, timestep_s: float
) -> None:
    fidelity = strider.simulation.working.model_copy(update={"timestep_s": timestep_s})
    simulator = Simulator.build(strider.with_effects(SAG), fidelity=fidelity)
    assert same_bits(*in_both_ways(monkeypatch, simulator, strider.baselines["stride"], duration=0.3))


@pytest.mark.parametrize("timestep_s", [2e-4, 1e-3])
def test_what_diverges_has_the_same_bits(
    monkeypatch: pytest.MonkeyPatch, strider: Problem, timestep_s: float
) -> None:
    """With steps of 0.2 ms it diverges within a call of ten, whose other rows repeat the last."""
    exploding = strider.with_parameters({"k_servo": 1e7, "torque_limit": 1e12})
    fidelity = strider.simulation.working.model_copy(update={"timestep_s": timestep_s})
    simulator = Simulator.build(exploding.with_effects(SAG), fidelity=fidelity)
    one, other = in_both_ways(monkeypatch, simulator, strider.baselines["square"], duration=1.0, poses=True)
    assert one.status.startswith("diverged: bad")
    assert same_bits(one, other)
    assert np.array_equal(one.poses, other.poses, equal_nan=True)


@pytest.mark.parametrize("most_work", [0.5, 0.9, 1.0])
def test_what_stalls_has_the_same_bits(
    monkeypatch: pytest.MonkeyPatch, strider: Problem, most_work: float
) -> None:
    settings = RolloutSettings(most_work=most_work)
    simulator = Simulator.build(strider.with_effects(SAG), settings=settings)
    one, other = in_both_ways(monkeypatch, simulator, strider.baselines["stride"], duration=1.0)
    assert one.status.startswith("stalled: ") or most_work > 0.9
    assert same_bits(one, other)


def test_what_mujoco_stops_has_the_same_status_and_leaves_the_next_one_alone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    option = '<option cone="elliptic" impratio="10"/>'
    folder = problem_folder(tmp_path / "robot", STRIDER)
    edited(folder / "strider.xml", option, f'{option}<size memory="4900"/>')
    problem = load_problem(folder)
    simulator = Simulator.build(problem.with_effects(SAG))
    gaits = [problem.space.decode(point) for point in quasi_random(problem.space, 6, 1)]
    pairs = [in_both_ways(monkeypatch, simulator, gait) for gait in gaits]
    assert {one.status.partition(":")[0] for one, _ in pairs} == {"ok", "failed"}
    assert all(same_bits(one, other) for one, other in pairs)
