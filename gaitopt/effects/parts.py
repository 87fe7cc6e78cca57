"""The parts of a model that effects act on, found through roles, actuators and axes, never by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.robot.contact import can_touch
from gaitopt.robot.roles import Roles
from gaitopt.robot.tree import every_driven_joint, robot_bodies, robot_roots, surroundings, trunk

ALL = "all"
"""The target that stands for every actuator."""


@dataclass(frozen=True)
class Parts:
    """The parts of a compiled model that effects act on.

    Attributes:
        model: the model, nominal or being edited.
        roles: the problem's roles.
        channels: the problem's actuators, which come first in the model.
        target: one of the channels, or `ALL`.
        on_joints: whether the target leaves out actuators that do not turn a joint.
    """

    model: mujoco.MjModel
    roles: Roles
    channels: Sequence[str]
    target: str = ALL
    on_joints: bool = False

    @property
    def step_s(self) -> float:
        """Step of the clock on which the model runs, s."""
        return float(self.model.opt.timestep)

    @property
    def servos(self) -> list[int]:
        """Actuator ids of the target, which are also its columns in a command."""
        found = [i for i, name in enumerate(self.channels) if self.target in (ALL, name)]
        return [i for i in found if self._joint_of(i) >= 0] if self.on_joints else found

    @cached_property
    def servo_joints(self) -> list[int]:
        """Joint ids that the target's actuators turn; -1 for another transmission."""
        return [self._joint_of(i) for i in self.servos]

    def _joint_of(self, actuator: int) -> int:
        joint = int(self.model.actuator_trntype[actuator]) == int(mujoco.mjtTrn.mjTRN_JOINT)
        return int(self.model.actuator_trnid[actuator, 0]) if joint else -1

    @cached_property
    def servo_dofs(self) -> list[int]:
        """Degrees of freedom that the target's actuators turn."""
        return [int(self.model.jnt_dofadr[j]) for j in self.servo_joints if j >= 0]

    @property
    def on_bench(self) -> bool:
        """Whether the trunk turns only as servos turn it."""
        first = int(self.model.body_jntadr[self.trunk])
        joints = set(range(first, first + int(self.model.body_jntnum[self.trunk])))
        return joints <= set(Parts(self.model, self.roles, self.channels).servo_joints)

    @cached_property
    def hinges(self) -> list[int]:
        """Joint ids of the passive hinges."""
        return [self.model.joint(name).id for name in self.roles.hinges]

    @cached_property
    def undriven_hinges(self) -> list[int]:
        """Joint ids of the passive hinges that no actuator turns as well."""
        driven = every_driven_joint(self.model, range(len(self.channels)))
        return [j for j in self.hinges if j not in driven]

    @cached_property
    def trunk(self) -> int:
        """Id of the body that carries the robot: that of the role, or the root of what the actuators move."""
        named = self.roles.trunk
        return trunk(self.model, self.named_bodies) if named is None else int(self.model.body(named).id)

    @property
    def named_bodies(self) -> list[int]:
        """Ids of the bodies that carry the trunk, the marker and the pads of the roles."""
        roles, model = self.roles, self.model
        trunk = [] if roles.trunk is None else [int(model.body(roles.trunk).id)]
        marker = [] if roles.marker is None else [int(model.site(roles.marker).bodyid[0])]
        return [*trunk, *marker, *(int(model.geom_bodyid[pad]) for pad in self.pads)]

    @property
    def robot_bodies(self) -> NDArray[np.bool_]:
        """Which bodies are the robot's, shape (nbody,)."""
        return robot_bodies(self.model, self.named_bodies)

    @property
    def surroundings(self) -> list[int]:
        """Geom ids of what is not the robot: the ground, obstacles, and what lies loose."""
        return surroundings(self.model, self.named_bodies)

    @property
    def static_surroundings(self) -> list[int]:
        """Geom ids of what is around the robot and never moves."""
        model = self.model
        return [g for g in self.surroundings if int(model.body_weldid[model.geom_bodyid[g]]) == 0]

    def overruled_by(self, geom: int) -> list[int]:
        """Return what stands still around the robot and has no lower priority in contacts with a geom.

        MuJoCo then takes the friction of the other, or the larger coefficient. Contacts of explicit pairs
        have friction of their own.
        """
        model = self.model
        paired = (model.pair_geom1 == geom) | (model.pair_geom2 == geom)
        if paired.any():
            return []
        own = int(model.geom_priority[geom])
        return [
            other
            for other in self.static_surroundings
            if can_touch(model, geom, other) and int(model.geom_priority[other]) >= own
        ]

    def touches_ground(self, geom: int) -> bool:
        """Return whether a geom collides with anything around the robot."""
        return any(can_touch(self.model, geom, other) for other in self.surroundings)

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
        """Mass of the robot, kg, without what is around it."""
        return sum(
            float(self.model.body_subtreemass[root]) for root in robot_roots(self.model, self.named_bodies)
        )

    @property
    def weight(self) -> float:
        """Weight of the robot, N."""
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
