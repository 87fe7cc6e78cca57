"""Figures of a compiled robot."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.effects.added import is_added
from gaitopt.effects.library.servo_back_emf import back_emf
from gaitopt.effects.library.servo_deadband import net_torque_limits
from gaitopt.robot.tree import robot_bodies


@dataclass(frozen=True)
class Robot:
    """Weight and servo limits of a compiled robot.

    Attributes:
        weight: N.
        torque_limit: N m, shape (nu,); inf where there is none.
        damping: of the driven joints with their servos' loss of torque, N m s/rad, shape (nu,): the slope of
            a motor's torque-speed line.
        no_load_speed: rad/s, shape (nu,): torque limit over damping of the driven joint. At this speed the
            damping takes all the torque of a direct-current motor. inf where there is no limit.
    """

    weight: float
    torque_limit: NDArray[np.float64]
    damping: NDArray[np.float64]
    no_load_speed: NDArray[np.float64]

    @staticmethod
    def of(model: mujoco.MjModel) -> Robot:
        """Read the figures of a model."""
        mass = float(model.body_mass[(model.body_weldid != 0) & robot_bodies(model)].sum())
        weight = mass * float(np.linalg.norm(model.opt.gravity))
        added = [is_added(model.actuator(i).name) for i in range(model.nu)]
        servos = added.count(False)
        limited = model.actuator_forcelimited[:servos].astype(bool)
        torque_limit = np.where(limited, net_torque_limits(model)[:servos], np.inf)
        damping = back_emf(model)[:servos]
        for i in range(servos):
            if model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT:
                damping[i] += model.dof_damping[model.jnt_dofadr[model.actuator_trnid[i, 0]]]
        speed = np.full(servos, np.inf)
        np.divide(torque_limit, damping, out=speed, where=damping > 0.0)
        return Robot(weight, torque_limit, damping, speed)
