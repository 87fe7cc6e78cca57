"""Gaits in, trajectories out: MuJoCo's compiled rollouts over scenarios and gaits."""

from __future__ import annotations

import copy
import math
import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.effects.active import RobotEffects
from gaitopt.effects.added import control_columns, with_added
from gaitopt.effects.effect import LOOP_INTERVAL_S
from gaitopt.gait.drive import Commands, Drive
from gaitopt.problem.instruments import build_instrumented, scalar_joints
from gaitopt.problem.model import with_fidelity
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.problem.start import START, settled, start_targets
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.effort import counters, mean_work, resting_work

_SAMPLE_S = 1e-3
"""Trajectories keep one sample a millisecond, or every step where steps are longer."""

_MAX_STEPS = 5_000_000
"""Longest rollout that is simulated at all; its record takes a gigabyte or two."""

_FRAME_EDGE = 1e-9
"""Frames: a time this close before a frame counts as after it."""

_SETTLE_LIMIT_S = 4.0
"""A robot with effects starts near its rest, and on a slope it creeps for ever, by micrometres."""

_BEFORE = 1e-6
"""Steps: a time this close before 0 counts as 0."""

_MOST_WORK = 100.0
"""A rollout may be this many times the work of standing still for as long, and no more (`effort`).

ArcFold's gaits are 0.8 to 1.1 times that work, those of the strider in the tests 0.9 to 1.1, those of
ArcFold's published model, which starts deep in its contacts, 0.4. Standing still is what all gaits of a
robot have in common; any other gait may itself be the slow one.
"""

_CHUNK = 500
"""Steps that are simulated at once; the work is then looked at, which costs 1 to 3 % of theirs."""

_COUNT_EVERY = 100
"""Steps of which one tells the work of all."""


@dataclass(frozen=True)
class Scenario:
    """One draw of what is never known exactly.

    Attributes:
        friction: factor on every friction coefficient.
        servo_strength: factor on every torque limit; the supply voltage does the same to a servo.
        servo_trim: zero error of each servo, rad; none where it is empty.
        start_pose_rad: standard deviation of the errors of the joints' start angles and of the heading.
        pose_seed: seed of those errors.
        framed: commands are sampled at the servo's frame rate and act one frame late.
    """

    friction: float = 1.0
    servo_strength: float = 1.0
    servo_trim: tuple[float, ...] = ()
    start_pose_rad: float = 0.0
    pose_seed: int = 0
    framed: bool = False


NOMINAL = Scenario()


@dataclass(frozen=True)
class Simulator:
    """A problem's robot in several scenarios at one fidelity; safe to use from several threads.

    Attributes:
        problem: the problem.
        fidelity: timestep and integrator.
        scenarios: the scenarios that `run` picks from by index.
        models: one compiled model per scenario.
        signals: signal in each place of ``sensordata``; None where it is not kept.
        effects: the problem's effects that change this robot or what is measured of it.
    """

    problem: Problem
    fidelity: Fidelity
    scenarios: tuple[Scenario, ...]
    models: tuple[mujoco.MjModel, ...]
    signals: tuple[str | None, ...]
    effects: RobotEffects
    _local: threading.local

    @staticmethod
    def build(
        problem: Problem, scenarios: Sequence[Scenario] = (NOMINAL,), fidelity: Fidelity | None = None
    ) -> Simulator:
        """Compile the problem's model for each scenario.

        Raises:
            GaitoptError: the model does not compile or does not fit the problem, or an effect does not
                apply to it.
        """
        robot = build_instrumented(problem)
        model, effects = robot.model, robot.effects
        if effects.changes_robot:
            _start_at_rest(model, problem, effects)
        model = with_fidelity(model, fidelity or problem.simulation.working)
        models = tuple(_scenario_model(model, problem, scenario, effects) for scenario in scenarios)
        fidelity = fidelity or problem.simulation.working
        return Simulator(
            problem, fidelity, tuple(scenarios), models, robot.signals, effects, threading.local()
        )

    def __getstate__(self) -> dict[str, Any]:
        """Return what travels to another process: everything but this thread's MuJoCo data."""
        return {name: value for name, value in vars(self).items() if name != "_local"}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        vars(self).update(state, _local=threading.local())

    def at(self, fidelity: Fidelity) -> Simulator:
        """Return the same robot and scenarios at another fidelity."""
        models = tuple(with_fidelity(model, fidelity) for model in self.models)
        return replace(self, fidelity=fidelity, models=models, _local=threading.local())

    def duration(self, drive: Drive) -> float:
        """Return how long a rollout lasts, s.

        It is the transient and the measured cycles of a drive with a period; any other drive is simulated for
        as long as it lasts.
        """
        horizon = self.problem.simulation.horizon
        if drive.period_s is not None:
            transient, measured = horizon.cycles(drive.period_s)
            return (transient + measured) * drive.period_s
        return horizon.transient_s + horizon.measured_s if drive.duration_s is None else drive.duration_s

    def run(
        self, drive: Drive, scenario: int = 0, duration: float | None = None, poses: bool = False
    ) -> Trajectory:
        """Simulate one drive in one scenario from the start pose.

        Args:
            drive: the commands, in the order of the problem's channels.
            scenario: index into `scenarios`.
            duration: length, s; see `duration` for the default.
            poses: keep qpos too, for pictures.

        Returns:
            The trajectory, sampled each millisecond from t = 0 to at least `duration`. A simulation
            that diverges keeps its last good values, as does one that is stopped for all its work; one
            that MuJoCo gives up has none (NaN). Each says so in `status`.
        """
        duration = self.duration(drive) if duration is None else duration
        if duration > _MAX_STEPS * self.fidelity.timestep_s:
            key, found = ("period_s", drive.period_s) if drive.period_s else ("duration_s", duration)
            raise GaitoptError(
                f"{drive.name}: {key}: found {found:g}; allowed: a rollout of at most "
                f"{_MAX_STEPS * self.fidelity.timestep_s:g} s"
            )
        time = self.clock(duration)
        return self._simulate(time, self._sent(drive, self.scenarios[scenario]), scenario, poses)

    def _sent(self, drive: Drive, scenario: Scenario) -> Commands:
        """Return what is sent at any gait time: before 0, the start's targets."""
        held, trim = start_targets(self.problem), scenario.servo_trim

        def sent(time: NDArray[np.float64]) -> NDArray[np.float64]:
            rows = servo_commands(self.problem, drive, time, scenario.framed)
            before = time < -_BEFORE * self.fidelity.timestep_s
            if before.any():
                rows = np.where(before[:, None], held, rows)
            return rows + trim if trim else rows

        return sent

    def clock(self, duration: float) -> NDArray[np.float64]:
        """Return the times of the steps from 0 to at least `duration`, s, shape (n,)."""
        samples = math.ceil(duration / (self._every * self.fidelity.timestep_s) * (1.0 - 1e-12))
        return np.arange(samples * self._every + 1, dtype=float) * self.fidelity.timestep_s

    def play(self, time: NDArray[np.float64], commands: NDArray[np.float64], scenario: int = 0) -> Trajectory:
        """Simulate commands, one row per step, rad, shape (n, nu), from the start pose."""
        held, step_s = start_targets(self.problem), self.fidelity.timestep_s

        def sent(at: NDArray[np.float64]) -> NDArray[np.float64]:
            if at is time:
                return commands
            row = np.rint((at - time[0]) / step_s).astype(int)
            return np.where((row < 0)[:, None], held, commands[np.clip(row, 0, len(time) - 1)])

        return self._simulate(time, sent, scenario)

    def observe(self, trajectory: Trajectory, seed: int = 0) -> Trajectory:
        """Return a trajectory as it would be measured: with the effects of camera, tracker and clock."""
        return self.effects.observe(trajectory, self.models[0], np.random.default_rng(seed))

    def _simulate(
        self, time: NDArray[np.float64], sent: Commands, scenario: int, poses: bool = False
    ) -> Trajectory:
        """Simulate what is sent, on the clock `time`, from the start pose."""
        batch, model = self._batch(), self.models[scenario]
        if self.effects.loops:
            model = copy.copy(model)
        batch.set_models(model)
        batch.reset(keyframe=batch.model.keyframe(START).id, stage=mujoco.mjtStage.mjSTAGE_NONE)
        if self.scenarios[scenario].start_pose_rad:
            _disturb(batch, self.scenarios[scenario], self.problem)
        commands = sent(time)
        arriving = self.effects.commands(sent, model)
        ctrl = commands if arriving is sent else arriving(time)
        if model.nu > ctrl.shape[1]:
            ctrl = ctrl[:, control_columns(model, self.problem.channel_names)]
        try:
            recorded, qpos, status = self._rollout(batch, model, ctrl, poses)
        except SimulationError as error:
            nothing = np.full((len(time), len(self.signals)), np.nan)
            return self._trajectory(time, commands, nothing, f"failed: {_reason(error)}", None)
        return self._trajectory(time, commands, recorded, status, qpos)

    def _rollout(
        self, batch: Batch, model: mujoco.MjModel, ctrl: NDArray[np.float64], poses: bool
    ) -> tuple[NDArray[np.float64], NDArray[np.float64] | None, str]:
        """Return ``sensordata`` of each step, (n, nsensordata), qpos where asked, (n, nq), and the status."""
        steps, updates = len(ctrl), self.effects.updates(model)
        out = {"sensordata": self._buffer(batch, steps)}
        if poses:
            out["qpos"] = np.empty((1, steps, model.nq))
        chunk = max(1, round(LOOP_INTERVAL_S / self.fidelity.timestep_s)) if updates else _CHUNK
        counts, every = counters(chunk), max(1, _COUNT_EVERY // chunk)
        left, status = _MOST_WORK * self._local.resting_work * steps, "ok"
        for begin in range(0, steps, chunk):
            end = min(begin + chunk, steps)
            counted = counts if begin // chunk % every == 0 else {}
            rows: dict[str, NDArray[Any]] = {name: array[:, begin:end] for name, array in out.items()}
            rows |= {name: array[:, : end - begin] for name, array in counted.items()}
            batch.rollout(end - begin, ctrl[None, begin:end], record=tuple(rows), out=rows)
            if counted:
                told = {name: array[:, : end - begin : _COUNT_EVERY] for name, array in counted.items()}
                left -= every * (end - begin) * mean_work(told, model.nv)
            if batch.warning[0, :, 1].any():
                status = f"diverged: {_warnings(batch)}"
            elif left < 0.0:
                status = f"stalled: over {_MOST_WORK:g} times the work of standing still"
            if status != "ok":
                for array in out.values():
                    array[0, end:] = array[0, end - 1]
                break
            for update in updates:
                update(out["sensordata"][0, end - 1])
        return out["sensordata"][0], out["qpos"][0] if poses else None, status

    def _trajectory(
        self,
        time: NDArray[np.float64],
        commands: NDArray[np.float64],
        data: NDArray[np.float64],
        status: str,
        qpos: NDArray[np.float64] | None,
    ) -> Trajectory:
        every = self._every
        columns = np.array(data[::every].T, order="C")  # a copy always: `data` is reused
        signals = {name: columns[i] for i, name in enumerate(self.signals) if name is not None}
        for index, name in enumerate(self.problem.channel_names):
            signals[f"target.{name}"] = commands[::every, index]
        return Trajectory(time[::every], signals, status, None if qpos is None else qpos[::every])

    @property
    def _every(self) -> int:
        """Steps per sample."""
        return max(1, round(_SAMPLE_S / self.fidelity.timestep_s))

    def _batch(self) -> Batch:
        """Return this thread's MuJoCo data, made on first use."""
        if not hasattr(self._local, "batch"):
            model = self.models[0]
            self._local.batch = Batch(model, nsim=1, nthread=1)
            self._local.buffer = np.empty(0)
            self._local.resting_work = resting_work(self._local.batch, model, model.keyframe(START).id)
        batch: Batch = self._local.batch
        return batch

    def _buffer(self, batch: Batch, steps: int) -> NDArray[np.float64]:
        """Return this thread's reused output array: fresh pages cost as much as the metrics do."""
        size = steps * batch.model.nsensordata
        if self._local.buffer.size < size:
            self._local.buffer = np.empty(size)
        buffer: NDArray[np.float64] = self._local.buffer[:size].reshape(1, steps, -1)
        return buffer


def servo_commands(
    problem: Problem, drive: Drive, time: NDArray[np.float64], framed: bool = False
) -> NDArray[np.float64]:
    """Return what is sent to each actuator, rad, shape (n, nu).

    Args:
        problem: the problem.
        drive: the commands.
        time: gait times, s, shape (n,).
        framed: as a servo gets it: the targets at the start of a frame act from the next frame on, and
            before that the start's targets are held.
    """
    if not framed:
        return drive.targets(time)
    frame_s = problem.file.servo.frame_s
    frame = np.floor(time / frame_s + _FRAME_EDGE)
    sent = drive.targets((frame - 1.0) * frame_s)
    return np.where((frame < 1.0)[:, None], start_targets(problem), sent)


def draw_scenarios(problem: Problem, count: int, seed: Iterable[int]) -> tuple[Scenario, ...]:
    """Return `count` scenarios; the same seed gives the same ones.

    The last is played as the servo gets it, where the problem says so (`ScenarioSpread.framed`).
    """
    spread = problem.file.scenarios
    rng = np.random.default_rng(list(seed))
    scenarios = []
    for index in range(count):
        friction, strength = 1.0 + rng.uniform(-1.0, 1.0, 2) * (spread.friction, spread.servo_strength)
        trim = math.radians(spread.servo_trim_deg) * rng.uniform(-1.0, 1.0, len(problem.channel_names))
        pose_seed = int(rng.integers(2**31))
        framed = spread.framed and index == count - 1
        scenarios.append(
            Scenario(
                friction=float(friction),
                servo_strength=float(strength),
                servo_trim=tuple(trim.tolist()),
                start_pose_rad=spread.start_pose_rad,
                pose_seed=pose_seed,
                framed=framed,
            )
        )
    return tuple(scenarios)


def _start_at_rest(model: mujoco.MjModel, problem: Problem, effects: RobotEffects) -> None:
    """Put the keyframe ``start`` where the robot with effects rests under the targets held before a gait."""
    held = start_targets(problem)
    arriving = effects.commands(lambda time: np.tile(held, (len(time), 1)), model)
    ctrl = arriving(np.zeros(1))[0, control_columns(model, problem.channel_names)]
    model.key_ctrl[0] = ctrl
    if problem.file.start.settle:
        affected = _scenario_model(model, problem, NOMINAL, effects)
        model.key_qpos[0] = settled(affected, ctrl, _SETTLE_LIMIT_S)


def _scenario_model(
    model: mujoco.MjModel, problem: Problem, scenario: Scenario, effects: RobotEffects
) -> mujoco.MjModel:
    model = copy.copy(model)
    named = [model.geom(name).id for name in problem.roles.pads + problem.roles.body]
    touching = named or list(range(model.ngeom))
    model.geom_friction[touching] *= scenario.friction
    pairs = np.isin(model.pair_geom1, touching) | np.isin(model.pair_geom2, touching)
    model.pair_friction[pairs] *= scenario.friction
    model.actuator_forcerange[:] *= scenario.servo_strength
    effects.edit(model)
    return model


def _disturb(batch: Batch, scenario: Scenario, problem: Problem) -> None:
    """Add start-pose errors to the hinge joints, and turn a free first body about up."""
    model = batch.model
    qpos = batch.bind("qpos")[0]
    rng = np.random.default_rng(scenario.pose_seed)
    hinges = [j for j in scalar_joints(model) if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_HINGE)]
    errors = np.zeros(model.nq)
    errors[model.jnt_qposadr[hinges]] = scenario.start_pose_rad * rng.standard_normal(len(hinges))
    qpos += with_added(errors, model)
    if model.njnt and int(model.jnt_type[0]) == int(mujoco.mjtJoint.mjJNT_FREE):
        turn, turned = np.empty(4), np.empty(4)
        angle = scenario.start_pose_rad * rng.standard_normal()
        mujoco.mju_axisAngle2Quat(turn, np.array(problem.roles.up), angle)
        mujoco.mju_mulQuat(turned, turn, qpos[3:7].copy())
        qpos[3:7] = turned


def _reason(error: SimulationError) -> str:
    """Return why MuJoCo gave up: the first line of its own words, which is the same for every gait."""
    return str(error).rpartition("simulation 0: ")[2].partition("\n")[0]


def _warnings(batch: Batch) -> str:
    raised = np.flatnonzero(batch.warning[0, :, 1])
    return ", ".join(mujoco.mjtWarning(int(i)).name.removeprefix("mjWARN_").lower() for i in raised)
