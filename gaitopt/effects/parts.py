"""The parts of a model that effects act on, found through roles, actuators and axes, never by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.robot.roles import Roles

ALL = "all"
"""The target that stands for every actuator."""

FIRST_BODY = 1
"""The first body under the world: the first module."""


@dataclass(frozen=True)
class Parts:
    """The parts of a compiled model that effects act on.

    Attributes:
        model: the model, nominal or being edited.
        roles: the problem's roles.
        channels: the problem's actuators, which come first in the model.
        target: one of the channels, or `ALL`.
    """

    model: mujoco.MjModel
    roles: Roles
    channels: Sequence[str]
    target: str = ALL

    @property
    def step_s(self) -> float:
        """Step of the clock on which the model runs, s."""
        return float(self.model.opt.timestep)

    @property
    def servos(self) -> list[int]:
        """Actuator ids of the target, which are also its columns in a command."""
        return [i for i, name in enumerate(self.channels) if self.target in (ALL, name)]

    @cached_property
    def servo_joints(self) -> list[int]:
        """Joint ids that the target's actuators turn; -1 for another transmission."""
        joint = int(mujoco.mjtTrn.mjTRN_JOINT)
        types, ids = self.model.actuator_trntype, self.model.actuator_trnid
        return [int(ids[i, 0]) if int(types[i]) == joint else -1 for i in self.servos]

    @cached_property
    def servo_dofs(self) -> list[int]:
        """Degrees of freedom that the target's actuators turn."""
        return [int(self.model.jnt_dofadr[j]) for j in self.servo_joints if j >= 0]

    @property
    def on_bench(self) -> bool:
        """Whether the first body turns only as servos turn it."""
        first = int(self.model.body_jntadr[FIRST_BODY])
        joints = set(range(first, first + int(self.model.body_jntnum[FIRST_BODY])))
        return joints <= set(Parts(self.model, self.roles, self.channels).servo_joints)

    @cached_property
    def hinges(self) -> list[int]:
        """Joint ids of the passive hinges."""
        return [self.model.joint(name).id for name in self.roles.hinges]

    @cached_property
    def undriven_hinges(self) -> list[int]:
        """Joint ids of the passive hinges that no actuator turns as well."""
        driven = Parts(self.model, self.roles, self.channels).servo_joints
        return [j for j in self.hinges if j not in driven]

    @cached_property
    def pads(self) -> list[int]:
        """Geom ids of the pads."""
        return [self.model.geom(name).id for name in self.roles.pads]

    @cached_property
    def body(self) -> list[int]:
        """Geom ids of the other geoms that may touch the ground."""
        return [self.model.geom(name).id for name in self.roles.body]

    @property
    def touching(self) -> list[int]:
        """Geom ids of everything that may touch the ground, the pads first."""
        return self.pads + self.body

    @property
    def mass(self) -> float:
        """Mass of the first body under the world with all that it carries, kg."""
        return float(self.model.body_subtreemass[FIRST_BODY])

    @property
    def weight(self) -> float:
        """Weight of the same, N."""
        return self.mass * float(np.linalg.norm(self.model.opt.gravity))

    @property
    def axes(self) -> NDArray[np.float64]:
        """Forward, left and up as the rows of a rotation, shape (3, 3)."""
        return self.roles.axes

    @cached_property
    def at_zero(self) -> mujoco.MjData:
        """The model's kinematics in its reference pose."""
        data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, data)
        return data


Figure = Callable[[Parts], float]
"""A figure of the nominal robot: its mass, its servos' torque limit, …"""
