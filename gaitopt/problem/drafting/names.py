"""Names for the parts of an MJCF that have none: a problem file speaks of parts by their names."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET
from collections.abc import Container, Iterator

_NESTED = ("body", "frame", "replicate")
"""Elements that hold parts of the world: inside others, such as `composite`, names mean something else."""

_NAMED = ("body", "geom", "site", "joint", "freejoint")


def name_parts(root: ET.Element) -> list[str]:
    """Name the bodies, geoms, sites, joints and actuators of an MJCF that have no name, in place.

    A part is called after its body, and an actuator after what it acts on.

    Args:
        root: the MJCF, its includes resolved.

    Returns:
        What was named, in words: ``3 geoms``.
    """
    names: dict[str, set[str]] = {}
    for element in root.iter():
        names.setdefault(_kind(element.tag), set()).add(element.get("name", ""))
    actuators = [element for section in root.findall("actuator") for element in section]
    names["actuator"] = {element.get("name", "") for element in actuators}
    counts: dict[str, int] = {}

    def give(element: ET.Element, kind: str, name: str) -> None:
        chosen = unused(name, names[kind])
        names[kind].add(chosen)
        element.set("name", chosen)
        counts[kind] = counts.get(kind, 0) + 1

    for world in root.findall("worldbody"):
        for element, owner in _parts(world, ""):
            if not element.get("name") and element.tag in _NAMED:
                give(element, _kind(element.tag), _called(element, owner))
    for element in actuators:
        if not element.get("name"):
            acted_on = (element.get(key) for key in ("joint", "tendon", "jointinparent", "site", "body"))
            give(element, "actuator", next(filter(None, acted_on), "servo"))
    plural = {"body": "bodies"}
    return [
        f"{count} {kind if count == 1 else plural.get(kind, f'{kind}s')}" for kind, count in counts.items()
    ]


def unused(name: str, taken: Container[str]) -> str:
    """Return a name, with a number behind it where it is taken."""
    numbered = (f"{name}_{number}" for number in itertools.count(2))
    return next(one for one in itertools.chain([name], numbered) if one not in taken)


def _parts(element: ET.Element, owner: str) -> Iterator[tuple[ET.Element, str]]:
    """Yield each part of the world with the name of its body, bodies before what they hold."""
    for child in element:
        yield child, owner
        if child.tag in _NESTED:
            yield from _parts(child, child.get("name", "") if child.tag == "body" else owner)


def _called(element: ET.Element, owner: str) -> str:
    """Return what a part is called after: its body, its kind, and the ground's shape."""
    if element.tag == "body":
        return f"{owner}_part" if owner else "robot"
    if not owner:
        return "floor" if element.get("type") == "plane" else f"world_{_kind(element.tag)}"
    return owner if element.tag == "geom" else f"{owner}_{_kind(element.tag)}"


def _kind(tag: str) -> str:
    return "joint" if tag == "freejoint" else tag
