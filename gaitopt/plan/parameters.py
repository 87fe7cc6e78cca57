"""The numbers of the planar model, read off the compiled MJCF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from gaitopt.core.errors import unknown_name
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Planar

Index = list[int]


@dataclass(frozen=True)
class PlanarParameters:
    """The reduced crawler, SI units; lengths along the body from a module's rear edge."""

    rear_mass: float  # kg
    front_mass: float  # kg
    arch_mass: float  # kg, all links
    link_length: float  # m
    module_length: float  # m
    module_half_width: float  # m
    rear_com: float  # m
    front_com: float  # m
    rear_pad: float  # m
    front_pad: float  # m
    pad_half_width: float  # m
    pad_half_thickness: float  # m
    underside: float  # m, of the body below the feet's axes
    mu_pad: float
    mu_body: float
    hinge_stiffness: float  # N m/rad, of all hinges about the middle angle
    hinge_damping: float  # N m s/rad, likewise
    servo_gain: float  # N m/rad
    servo_torque_limit: float  # N m
    servo_damping: float  # N m s/rad
    gravity: float  # m/s^2
    contact_blur: float = 4e-4  # m
    roll_blur: float = 0.02  # rad

    @property
    def mass(self) -> float:
        """Total mass, kg."""
        return self.rear_mass + self.front_mass + self.arch_mass

    @property
    def front_share(self) -> float:
        """Mass that moves with the front module, kg."""
        return self.front_mass + self.arch_mass / 2


@dataclass(frozen=True)
class _Named:
    """Ids in the compiled model of the parts that a planar section names.

    Attributes:
        rear, front: bodies of the modules.
        links: two bodies one link apart.
        pads, undersides: geoms, the rear module's first.
        servo: actuator that folds the arch.
        middle, foot: joints that the middle servo and the rear foot's turn.
    """

    rear: Index
    front: Index
    links: Index
    pads: Index
    undersides: Index
    servo: int
    middle: int
    foot: int

    @staticmethod
    def of(model: mujoco.MjModel, problem: Problem, section: Planar) -> _Named:
        """Find the parts.

        Raises:
            GaitoptError: the section names a part that the MJCF does not have.
        """

        def ids(kind: str, names: Sequence[str], count: int) -> Index:
            known = [getattr(model, kind)(i).name for i in range(count)]
            for name in names:
                if name not in known:
                    raise unknown_name(f"{problem.source}: planar", kind, name, [n for n in known if n])
            return [known.index(name) for name in names]

        rear = ids("body", section.rear_bodies, model.nbody)
        front = ids("body", section.front_bodies, model.nbody)
        links = ids("body", section.links, model.nbody)
        pads = ids("geom", [section.rear_pad, section.front_pad], model.ngeom)
        undersides = ids("geom", [section.rear_underside, section.front_underside], model.ngeom)
        servo, foot = ids("actuator", [section.middle, section.rear_foot], model.nu)
        middle_joint, foot_joint = (int(model.actuator_trnid[i, 0]) for i in (servo, foot))
        return _Named(rear, front, links, pads, undersides, servo, middle_joint, foot_joint)


def planar_parameters(problem: Problem, section: Planar) -> PlanarParameters:
    """Read the planar crawler off the compiled model, flat and with its pads retracted.

    Raises:
        GaitoptError: the section names a part that the MJCF does not have.
    """
    model = build_model(problem)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    parts = _Named.of(model, problem, section)
    stiffness, damping = _reflected_hinges(model, parts.middle)
    values = {
        **_modules(model, data, parts),
        **_pads(model, data, parts),
        "hinge_stiffness": stiffness,
        "hinge_damping": damping,
        "servo_gain": model.actuator_gainprm[parts.servo, 0],
        "servo_torque_limit": model.actuator_forcerange[parts.servo, 1],
        "servo_damping": model.dof_damping[model.jnt_dofadr[parts.middle]],
        "gravity": float(np.linalg.norm(model.opt.gravity)),
    }
    return PlanarParameters(**{key: float(value) for key, value in values.items()})


def _modules(model: mujoco.MjModel, data: mujoco.MjData, parts: _Named) -> dict[str, float]:
    """Return masses, kg, and lengths, m, of the modules and the arch; forward is the world's x."""
    rear_mass, rear_x = _centre_of_mass(model, data, parts.rear)
    front_mass, front_x = _centre_of_mass(model, data, parts.front)
    length, edges = _length(model, parts), _edges(model, data, parts)
    return {
        "rear_mass": rear_mass,
        "front_mass": front_mass,
        "arch_mass": model.body_mass.sum() - rear_mass - front_mass,
        "link_length": data.xpos[parts.links[1], 0] - data.xpos[parts.links[0], 0],
        "module_length": length,
        "module_half_width": model.geom_size[parts.undersides[0], 1],
        "rear_com": rear_x - edges[0],
        "front_com": front_x - edges[1],
    }


def _pads(model: mujoco.MjModel, data: mujoco.MjData, parts: _Named) -> dict[str, float]:
    """Return places and sizes of the pads, m, and the coefficients of friction."""
    (rear, front), underside = parts.pads, parts.undersides[0]
    edges = _edges(model, data, parts)
    return {
        "rear_pad": data.geom_xpos[rear, 0] - edges[0],
        "front_pad": data.geom_xpos[front, 0] - edges[1],
        "pad_half_width": model.geom_size[rear, 1],
        "pad_half_thickness": model.geom_size[rear, 2],
        "underside": data.xanchor[parts.foot, 2]
        - data.geom_xpos[underside, 2]
        + model.geom_size[underside, 2],
        "mu_pad": model.geom_friction[rear, 0],
        "mu_body": model.geom_friction[underside, 0],
    }


def _length(model: mujoco.MjModel, parts: _Named) -> float:
    """Return the length of a module, m."""
    return float(2.0 * model.geom_size[parts.undersides[0], 0])


def _edges(model: mujoco.MjModel, data: mujoco.MjData, parts: _Named) -> list[float]:
    """Return where the modules' rear edges are, m."""
    edges: list[float] = (data.geom_xpos[parts.undersides, 0] - _length(model, parts) / 2.0).tolist()
    return edges


def _centre_of_mass(model: mujoco.MjModel, data: mujoco.MjData, bodies: Index) -> tuple[float, float]:
    """Return the mass of some bodies, kg, and the forward place of their centre, m."""
    mass = model.body_mass[bodies]
    return float(mass.sum()), float(mass @ data.xipos[bodies, 0] / mass.sum())


def _reflected_hinges(model: mujoco.MjModel, middle: int) -> tuple[float, float]:
    """Return stiffness and damping of the passive joints about the middle angle, through the couplings."""
    stiffness = float(model.jnt_stiffness[middle])
    damping = 0.0
    for i in np.flatnonzero(model.eq_type == mujoco.mjtEq.mjEQ_JOINT):
        if model.eq_obj2id[i] == middle:
            joint, ratio = model.eq_obj1id[i], model.eq_data[i, 1]
            stiffness += float(ratio**2 * model.jnt_stiffness[joint])
            damping += float(ratio**2 * model.dof_damping[model.jnt_dofadr[joint]])
    return stiffness, damping
