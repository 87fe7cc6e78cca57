"""Drives in, trajectories out: MuJoCo's compiled rollouts in several scenarios."""

from __future__ import annotations

import copy
import math
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.streams import seeded
from gaitopt.effects.active import RobotEffects
from gaitopt.effects.added import control_columns
from gaitopt.gait.drive import Commands, Drive
from gaitopt.problem.instruments import CONTACTS_WITHIN, build_instrumented
from gaitopt.problem.model import with_fidelity
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.problem.start import held_activation, settled, start_targets
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.beginning import held_before, started_pose
from gaitopt.simulation.commands import drive_commands, row_commands
from gaitopt.simulation.effort import WorkBudget
from gaitopt.simulation.power import Flags, changes_of_power, held_while_unpowered, switch, without_others
from gaitopt.simulation.scenario import NOMINAL, Scenario, disturb_start, scenario_model
from gaitopt.simulation.sites import with_sites
from gaitopt.simulation.stepping import (
    STOPPED,
    OneByOne,
    Recorded,
    Stepper,
    Together,
    Workspace,
    stop_reason,
    warning_names,
)
from gaitopt.simulation.tolerances import NO_ERRORS

Array = NDArray[np.float64]

_SAMPLE_S = 1e-3
"""Trajectories keep one sample a millisecond, or every step where steps are longer."""


@dataclass(frozen=True)
class RolloutSettings:
    """Limits of a rollout; every limit is a count.

    Attributes:
        max_steps: longest rollout that is simulated at all; its record takes one to two gigabytes.
        most_work: a rollout that takes more than this many times the work of standing still as long is
            stopped (`effort`). ArcFold's gaits need 0.8 to 1.1 times that work, those of the strider in the
            tests 0.9 to 1.1. Those of ArcFold's published model, which starts deep in its contacts, need 0.4.
            Standing still is a reference for all gaits of a robot; any other gait may itself be slow.
        chunk: steps that are simulated at once; then the work is checked, which costs 1 to 3 % of it.
        count_every: one step in this many is counted.
        settle_limit_s: time in which a robot with effects or errors comes to rest before a rollout, s. It
            starts near its rest, and on a slope it creeps by micrometres without end.
    """

    max_steps: int = 5_000_000
    most_work: float = 100.0
    chunk: int = 500
    count_every: int = 100
    settle_limit_s: float = 4.0


@dataclass(frozen=True)
class Simulator:
    """A problem's robot in several scenarios at one fidelity; safe to use from several threads.

    Attributes:
        problem: the problem.
        fidelity: timestep and integrator.
        scenarios: the scenarios that `run` picks from by index.
        models: one compiled model per scenario.
        signals: signal in each place of ``sensordata``; None where it is not kept.
        effects: the problem's effects that change this robot or its measurement.
        settings: limits of a rollout.
    """

    problem: Problem
    fidelity: Fidelity
    scenarios: tuple[Scenario, ...]
    models: tuple[mujoco.MjModel, ...]
    signals: tuple[str | None, ...]
    effects: RobotEffects
    settings: RolloutSettings = RolloutSettings()
    _local: threading.local = field(default_factory=threading.local)

    @staticmethod
    def build(
        problem: Problem,
        scenarios: Sequence[Scenario] = (NOMINAL,),
        fidelity: Fidelity | None = None,
        settings: RolloutSettings = RolloutSettings(),
    ) -> Simulator:
        """Compile the problem's model for each scenario.

        Raises:
            GaitoptError: the model does not compile or does not fit the problem, or an effect does not
                apply to it.
        """
        if any(scenario.effects for scenario in scenarios):
            raise ValueError("scenarios with robots of their own: see setup.prepared")
        robot = build_instrumented(problem)
        effects = robot.effects
        if effects.changes_robot:
            _start_at_rest(robot.model, problem, NOMINAL, effects, settings.settle_limit_s)
        fidelity = fidelity or problem.simulation.working
        models = []
        for scenario in scenarios:
            started = robot.model
            if scenario.errors != NO_ERRORS:
                started = copy.copy(robot.model)
                _start_at_rest(started, problem, scenario, effects, settings.settle_limit_s)
            models.append(scenario_model(with_fidelity(started, fidelity), problem, scenario, effects))
        return Simulator(problem, fidelity, tuple(scenarios), tuple(models), robot.signals, effects, settings)

    def __getstate__(self) -> dict[str, Any]:
        """Return what is sent to another process: everything but the threads' MuJoCo data."""
        return {name: value for name, value in vars(self).items() if name != "_local"}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        vars(self).update(state, _local=threading.local())

    def at(self, fidelity: Fidelity) -> Simulator:
        """Return the same robot and scenarios at another fidelity."""
        models = tuple(with_fidelity(model, fidelity) for model in self.models)
        return replace(self, fidelity=fidelity, models=models, _local=threading.local())

    def with_model(self, model: mujoco.MjModel) -> Simulator:
        """Return the same robot, in one scenario, with another model of it."""
        return replace(self, models=(model,), _local=threading.local())

    def split(self) -> list[Simulator]:
        """Return the robot of each scenario, alone."""
        pairs = zip(self.scenarios, self.models, strict=True)
        return [replace(self, scenarios=(s,), models=(m,), _local=threading.local()) for s, m in pairs]

    def duration(self, drive: Drive) -> float:
        """Return how long a rollout lasts, s: as long as the drive, or transient and measured cycles."""
        if drive.duration_s is not None:
            return drive.duration_s
        transient, measured = self.problem.simulation.horizon.cycles(drive.block_s)
        return (transient + measured) * drive.block_s

    def run(
        self, drive: Drive, scenario: int = 0, duration: float | None = None, poses: bool = False
    ) -> Trajectory:
        """Simulate one drive in one scenario, from its measured start or else from the start pose.

        Args:
            drive: what is commanded, its channels in the problem's order.
            scenario: index into `scenarios`.
            duration: length, s; by default the drive's own, or the problem's horizon for a gait.
            poses: keep qpos too, for pictures.

        Returns:
            The trajectory, sampled each millisecond from t = 0 to at least `duration`. A simulation that
            diverges, or takes too much work, is stopped and keeps its last good values. One that MuJoCo
            itself stops has no values (NaN). `status` says which.

        Raises:
            GaitoptError: the rollout would take more steps than the settings allow, or the drive starts at
                an angle of a joint that the robot does not have.
        """
        duration = self.duration(drive) if duration is None else duration
        longest = self.settings.max_steps * self.fidelity.timestep_s
        if duration > longest:
            key, found = ("duration", duration) if drive.period_s is None else ("period_s", drive.period_s)
            raise GaitoptError(
                f"{drive.name}: {key}: found {found:g}; allowed: a rollout of at most {longest:g} s"
            )
        held = held_before(self.problem, drive, self.models[scenario])
        step_s = self.fidelity.timestep_s
        sent = drive_commands(self.problem, drive, self.scenarios[scenario], step_s, held)
        return self._simulate(self.clock(duration), sent, scenario, poses, drive)

    def play(self, time: Array, commands: Array, scenario: int = 0) -> Trajectory:
        """Simulate commands, one row per step, rad, shape (n, nu), from the start pose."""
        sent = row_commands(self.problem, time, commands, self.fidelity.timestep_s)
        return self._simulate(time, sent, scenario)

    def clock(self, duration: float) -> Array:
        """Return the times of the steps from 0 to at least `duration`, s, shape (n,)."""
        samples = math.ceil(duration / (self.sample_steps * self.fidelity.timestep_s) * (1.0 - 1e-12))
        return np.arange(samples * self.sample_steps + 1, dtype=float) * self.fidelity.timestep_s

    @property
    def sample_steps(self) -> int:
        """Steps per sample of a trajectory."""
        return max(1, round(_SAMPLE_S / self.fidelity.timestep_s))

    def observe(self, trajectory: Trajectory, seed: int = 0) -> Trajectory:
        """Return a trajectory as it would be measured: with the effects of camera, tracker and clock."""
        return self.effects.observe(trajectory, self.models[0], seeded(seed))

    def _simulate(
        self, time: Array, sent: Commands, scenario: int, poses: bool = False, drive: Drive | None = None
    ) -> Trajectory:
        """Simulate what is sent, on the clock `time`, from where the drive starts."""
        workspace, model = self._workspace(), self.models[scenario]
        if self.effects.loops:
            model = copy.copy(model)
        commands, start = sent(time), None if drive is None else drive.start
        arriving = self.effects.commands(sent, model)
        ctrl = commands if arriving is sent else arriving(time)
        columns = control_columns(model, self.problem.channel_names)
        if model.nu > ctrl.shape[1]:
            ctrl = ctrl[:, columns]
        off = None
        if start is not None or np.isnan(ctrl).any():
            before = arriving(time[:1] - self.fidelity.timestep_s)[0, columns]
            ctrl, before, off = held_while_unpowered(ctrl, before)
        if off is not None:
            off = without_others(model, off)
            model = model if self.effects.loops else copy.copy(model)
        workspace.reset(model)
        if start is not None:
            pose, act = (workspace.batch.bind(name)[0] for name in ("qpos", "act"))
            pose[:] = started_pose(model, start, pose)
            act[:] = held_activation(model, before, act)
        if self.scenarios[scenario].start_pose_rad:
            disturb_start(workspace.batch, self.problem, self.scenarios[scenario])
        try:
            recorded = self._roll(workspace, model, ctrl, poses, off)
        except STOPPED as error:
            nothing = np.full((len(time), len(self.signals)), np.nan)
            recorded = Recorded(nothing, None, f"failed: {stop_reason(error)}")
        return self._trajectory(time, commands, recorded)

    def _roll(
        self, workspace: Workspace, model: mujoco.MjModel, ctrl: Array, poses: bool, off: Flags | None
    ) -> Recorded:
        """Simulate commands, one row per step, shape (n, nu), in chunks.

        Where `off` says so, shape (n, nu), an actuator is unpowered.
        """
        settings, steps, batch = self.settings, len(ctrl), workspace.batch
        updates = self.effects.updates(model)
        sensed = workspace.record(steps)
        out = {"sensordata": sensed}
        if poses:
            out["qpos"] = np.empty((steps, model.nq))
        switched = changes_of_power(off)
        stepper: Stepper = Together(batch, ctrl, out)
        if updates:
            stepper = OneByOne(model, batch, ctrl, out, updates, settings.count_every, switched)
        allowed = settings.most_work * workspace.resting_work * steps
        budget = WorkBudget(allowed, settings.chunk, settings.count_every, model.nv)
        groups = model.actuator_group.copy()
        begins = sorted({*range(0, steps, settings.chunk), *switched})
        status = "ok"
        for begin, end in zip(begins, [*begins[1:], steps], strict=True):
            if off is not None and (begin == 0 or begin in switched):
                switch(model, off[begin], groups)
                batch.set_models(model)
            counts = budget.counters(end - begin)
            went_on = stepper.advance(begin, end, counts)
            budget.spend(counts, end - begin)
            if not went_on or budget.exceeded:
                status = self._stopped(stepper.warnings)
                for array in out.values():
                    array[end:] = array[end - 1]
                break
        return Recorded(sensed, out.get("qpos"), status)

    def _stopped(self, warnings: NDArray[np.int32]) -> str:
        """Return why a rollout stops: a warning, or else its work."""
        if warnings.any():
            return f"diverged: {warning_names(warnings)}"
        return f"stalled: over {self.settings.most_work:g} times the work of standing still"

    def _trajectory(self, time: Array, commands: Array, recorded: Recorded) -> Trajectory:
        every = self.sample_steps
        columns = np.array(recorded.data[::every].T, order="C")  # always a copy: the record is used again
        signals = {name: columns[i] for i, name in enumerate(self.signals) if name is not None}
        within = signals.pop(CONTACTS_WITHIN, None)
        if within is not None:
            signals["contacts"] = signals["contacts_all"] - within
        for index, name in enumerate(self.problem.channel_names):
            signals[f"target.{name}"] = commands[::every, index]
        if self.problem.observed:
            signals = with_sites(signals, self.problem.observed, self.problem.roles.axes)
        qpos = None if recorded.qpos is None else recorded.qpos[::every]
        return Trajectory(time[::every], signals, recorded.status, qpos)

    def _workspace(self) -> Workspace:
        """Return this thread's MuJoCo data, made on first use."""
        if not hasattr(self._local, "workspace"):
            self._local.workspace = Workspace.of(self.models[0])
        workspace: Workspace = self._local.workspace
        return workspace


def _start_at_rest(
    model: mujoco.MjModel, problem: Problem, scenario: Scenario, effects: RobotEffects, limit_s: float
) -> None:
    """Put the keyframe ``start`` where a scenario's robot rests under the targets held before a gait."""
    held = start_targets(problem) + (scenario.errors.servo_trim_rad or 0.0)
    arriving = effects.commands(lambda time: np.tile(held, (len(time), 1)), model)
    ctrl = arriving(np.zeros(1))[0, control_columns(model, problem.channel_names)]
    model.key_ctrl[0] = ctrl
    model.key_act[0] = held_activation(model, ctrl, model.key_act[0])
    if problem.file.start.settle:
        model.key_qpos[0] = settled(scenario_model(model, problem, scenario, effects), ctrl, limit_s)
