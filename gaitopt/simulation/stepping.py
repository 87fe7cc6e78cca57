"""Steps of one robot: many in one call, or one by one where effects act between them; with the same bits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from gaitopt.effects.effect import Update, loop_steps
from gaitopt.problem.start import START
from gaitopt.simulation.effort import Counts, resting_work

Array = NDArray[np.float64]

STOPPED = (SimulationError, mujoco.FatalError)
"""What is raised where MuJoCo itself stops a simulation."""


@dataclass
class Workspace:
    """One thread's MuJoCo data for a simulator.

    Attributes:
        batch: the data.
        resting_work: work of a step of standing still in the first scenario.
        buffer: memory of the record, used again: new pages cost as much as the metrics do.
    """

    batch: Batch
    resting_work: float
    buffer: Array

    @staticmethod
    def of(model: mujoco.MjModel) -> Workspace:
        """Return the data of a model."""
        batch = Batch(model, nsim=1, nthread=1)
        work = resting_work(batch, model, model.keyframe(START).id)
        return Workspace(batch, work, np.empty(0))

    def record(self, steps: int) -> Array:
        """Return where ``sensordata`` goes, shape (steps, nsensordata)."""
        size = steps * self.batch.model.nsensordata
        if self.buffer.size < size:
            self.buffer = np.empty(size)
        record: Array = self.buffer[:size].reshape(steps, -1)
        return record

    def reset(self, model: mujoco.MjModel) -> None:
        """Put the robot, with one of its scenarios' models, to the start."""
        self.batch.set_models(model)
        self.batch.reset(keyframe=self.batch.model.keyframe(START).id, stage=mujoco.mjtStage.mjSTAGE_NONE)


@dataclass(frozen=True)
class Recorded:
    """What a rollout recorded of each step.

    Attributes:
        data: ``sensordata``, shape (n, nsensordata).
        qpos: poses, shape (n, nq); None where not asked for.
        status: ``ok``, or why it was stopped.
    """

    data: Array
    qpos: Array | None
    status: str


class Stepper(Protocol):
    """Simulates commands, one row per step, and records each step."""

    @property
    def warnings(self) -> NDArray[np.int32]:
        """How often MuJoCo has raised each warning."""

    def advance(self, begin: int, end: int, counts: Counts) -> bool:
        """Simulate the rows `begin` to `end`, and count some.

        Returns:
            Whether MuJoCo raised no warning. One ends the steps, and the record repeats the last.

        Raises:
            SimulationError, mujoco.FatalError: MuJoCo stops.
        """


class Together:
    """A `Stepper` that simulates many steps in one call, which takes as long as five of a small robot's."""

    def __init__(self, batch: Batch, ctrl: Array, out: Mapping[str, Array]):
        """Continue a batch of one simulation.

        Args:
            batch: the simulation, at its start.
            ctrl: commands, rad, shape (n, nu).
            out: where fields of `mujoco.MjData` are recorded, each of shape (n, ...).
        """
        self._batch, self._ctrl = batch, ctrl[None]
        self._out = {name: array[None] for name, array in out.items()}

    @property
    def warnings(self) -> NDArray[np.int32]:
        """How often MuJoCo has raised each warning."""
        raised: NDArray[np.int32] = self._batch.warning[0, :, 1]
        return raised

    def advance(self, begin: int, end: int, counts: Counts) -> bool:
        """Simulate some rows; see `Stepper`."""
        rows = {name: array[:, begin:end] for name, array in self._out.items()} | dict(counts)
        self._batch.rollout(end - begin, self._ctrl[:, begin:end], record=tuple(rows), out=rows)
        return not self.warnings.any()


class OneByOne:
    """A `Stepper` that calls MuJoCo for each step, for models that are edited as they run.

    A second is thousands of calls: what a step costs in Python counts.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        batch: Batch,
        ctrl: Array,
        out: Mapping[str, Array],
        updates: Sequence[Update],
        count_every: int,
        switched: Iterable[int],
    ):
        """Continue from where a batch of one simulation is; the batch itself stays there.

        Args:
            model: the model that is edited, of the layout of the batch's.
            batch: the simulation, at its start.
            ctrl: commands, rad, shape (n, nu).
            out: where fields of `mujoco.MjData` are recorded, each of shape (n, ...).
            updates: what edits the model.
            count_every: one row in this many is counted, from the first one of a call.
            switched: rows before which the power of a servo is cut or restored.
        """
        self._model, self._data, self._ctrl = model, batch.get_data(0), ctrl
        bits = ctrl.view(np.int64)
        self._changed = [True, *(bits[1:] != bits[:-1]).any(axis=1).tolist()]
        self._recorded = [(array, getattr(self._data, name)) for name, array in out.items()]
        self._raised = self._data.warning.number
        self._none_raised = self._raised.tobytes()
        self._prompt = [one.edit for one in updates if one.prompt]
        self._jumps = jump_rows(self._changed, switched) if self._prompt else set()
        self._others = [one.edit for one in updates if not one.prompt]
        self._edit_every = loop_steps(model.opt.timestep)
        self._count_every = count_every

    @property
    def warnings(self) -> NDArray[np.int32]:
        """How often MuJoCo has raised each warning."""
        raised: NDArray[np.int32] = self._raised
        return raised

    def advance(self, begin: int, end: int, counts: Counts) -> bool:
        """Simulate some rows; see `Stepper`."""
        model, data, ctrl, changed, jumps = self._model, self._data, self._ctrl, self._changed, self._jumps
        raised, none_raised = self._raised, self._none_raised
        step, target, sensed = mujoco.mj_step, data.ctrl, data.sensordata
        for row in range(begin, end):
            if changed[row]:
                target[:] = ctrl[row]
            if row in jumps:
                self._jump()
            step(model, data)
            for array, value in self._recorded:
                array[row] = value
            if raised.tobytes() != none_raised:  # in a third of the time of `any`
                self._repeat(row, end)
                return False
            if not (row - begin) % self._count_every:
                self._count(counts, row - begin)
            for edit in self._prompt:
                edit(sensed)
            if not (row + 1) % self._edit_every:
                for edit in self._others:
                    edit(sensed)
        return True

    def _jump(self) -> None:
        """Measure what a new command does at once, before any time passes, and edit the model by it."""
        mujoco.mj_forward(self._model, self._data)
        for edit in self._prompt:
            edit(self._data.sensordata)

    def _count(self, counts: Counts, index: int) -> None:
        for name, count in counts.items():
            count[0, index] = getattr(self._data, name)

    def _repeat(self, row: int, end: int) -> None:
        """Let what was recorded of a row stand for the rows after it, as `Batch.rollout` does."""
        for array, _ in self._recorded:
            array[row:end] = array[row]


def jump_rows(changed: Sequence[bool], switched: Iterable[int]) -> set[int]:
    """Return the rows in which a servo's torque may jump: the first one after rows that were held.

    Where every row is another, commands are smooth.

    Args:
        changed: whether each row differs from the one before; true for the first one.
        switched: rows before which the power of a servo is cut or restored.
    """
    before = [False, *changed[:-1]]
    return {row for row, new in enumerate(changed) if new and not before[row]}.union(switched)


def stop_reason(error: Exception) -> str:
    """Return why MuJoCo stopped: the first line of its message, which is the same for every gait."""
    return str(error).rpartition("simulation 0: ")[2].partition("\n")[0]


def warning_names(raised: NDArray[np.int32]) -> str:
    """Return the names of the warnings that were raised.

    Args:
        raised: how often each was.
    """
    return ", ".join(
        mujoco.mjtWarning(int(i)).name.removeprefix("mjWARN_").lower() for i in np.flatnonzero(raised)
    )
