"""Sensors of the force between the robot's geoms and the ground."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco

from gaitopt.effects.added import added_name
from gaitopt.effects.parts import Parts

_NET_FORCE = 3
"""MuJoCo's number of ``reduce="netforce"`` in a contact sensor."""


def sense_loads(spec: mujoco.MjSpec, nominal: Parts, geoms: Sequence[int]) -> None:
    """Add a sensor of each geom's net force on the ground, in the world."""
    for geom in geoms:
        name = nominal.model.geom(geom).name
        if spec.sensor(added_name("load", name)) is not None:
            continue
        spec.add_sensor(
            name=added_name("load", name),
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname=name,
            reftype=mujoco.mjtObj.mjOBJ_BODY,
            refname="world",
            intprm=[1 << mujoco.mjtConDataField.mjCONDATA_FORCE.value, _NET_FORCE, 1],
        )


def sense_pads(spec: mujoco.MjSpec, nominal: Parts, _: float) -> None:
    """Add the same of each pad: the structure of an effect."""
    sense_loads(spec, nominal, nominal.pads)


def load_addresses(parts: Parts, geoms: Sequence[int]) -> list[int]:
    model = parts.model
    return [int(model.sensor(added_name("load", model.geom(g).name)).adr[0]) for g in geoms]
