"""Whose friction a contact has: the robot's own, whatever the priorities in the MJCF.

MuJoCo takes the parameters of the geom of higher ``priority``, and the larger coefficient where priorities
are equal, as they are by default. A change of the smaller one then changes nothing. So each geom of the robot
that has no higher priority than the ground gets one, and with it the values that MuJoCo has used so far: the
nominal contact stays as it is, and named parameters, tolerances and effects act on what MuJoCo uses. A
coefficient that a named parameter sets is taken as it is set: of the robot's geom, or else of the ground.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import ArrayLike

from gaitopt.effects.parts import Parts
from gaitopt.robot.contact import can_touch, mixed_contact


def let_friction_act(root: ET.Element, parts: Parts, named: Collection[int]) -> bool:
    """Give the robot's geoms a higher priority than the ground's where they have none, in place.

    Geoms that the text does not name, and those that stand on ground of several kinds, stay as they are.

    Args:
        root: the MJCF, its includes resolved and its parameters written in.
        parts: the robot of this MJCF.
        named: geoms whose friction a named parameter sets.

    Returns:
        Whether anything was changed.
    """
    elements = {element.get("name", ""): element for element in root.iter("geom")}
    changed = False
    for geom in parts.touching:
        element = elements.get(parts.model.geom(geom).name)
        grounds = parts.overruled_by(geom)
        if element is not None and grounds:
            changed |= _raise(element, parts, geom, grounds, named)
    return changed


def _raise(
    element: ET.Element, parts: Parts, geom: int, grounds: Sequence[int], named: Collection[int]
) -> bool:
    """Give one geom priority, and the values of its contacts so far; return whether that was possible."""
    model = parts.model
    standing = [g for g in parts.static_surroundings if can_touch(model, geom, g)]
    mixes = [mixed_contact(model, geom, ground) for ground in standing]
    friction = mixes[0].friction
    of_ground = [ground for ground in standing if ground in named]
    if geom in named:
        friction = np.array(model.geom_friction[geom])
    elif of_ground:
        friction = np.array(model.geom_friction[of_ground[0]])
    elif any(not np.array_equal(mix.friction, friction) for mix in mixes):
        return False
    element.set("priority", str(int(model.geom_priority[standing].max()) + 1))
    _write(element, "friction", friction, model.geom_friction[geom])
    _write(element, "solref", mixes[0].solref, model.geom_solref[geom])
    _write(element, "solimp", mixes[0].solimp, model.geom_solimp[geom])
    if mixes[0].condim != int(model.geom_condim[geom]):
        element.set("condim", str(mixes[0].condim))
    return True


def _write(element: ET.Element, key: str, values: ArrayLike, own: ArrayLike) -> None:
    """Write the numbers of an attribute at full precision, where the geom does not have them anyway."""
    if not np.array_equal(values, own):
        element.set(key, " ".join(map(repr, np.asarray(values).tolist())))
