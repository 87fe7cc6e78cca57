"""Whether a model matches its problem file: actuators, sites, geoms, joints and keyframe by name."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco

from gaitopt.core.errors import GaitoptError, bad_value, nearest, unknown_name
from gaitopt.problem.problem import Problem
from gaitopt.problem.start import START


def check_matches(model: mujoco.MjModel, problem: Problem) -> None:
    """Check that a model has all that the problem file names.

    Raises:
        GaitoptError: the channels are not the model's actuators in order, an actuator is no position servo,
            a role names a missing part, or there is no keyframe or no body.
    """
    _check_actuators(model, problem)
    _check_roles(model, problem)
    if not problem.file.start.settle and START not in _names(model, "key", model.nkey):
        raise unknown_name(problem.model_path, "keyframe", START, _names(model, "key", model.nkey))
    if model.nbody < 2:
        raise GaitoptError(f"{problem.model_path}: no body under the world")


def _check_actuators(model: mujoco.MjModel, problem: Problem) -> None:
    """Check that the channels are the model's actuators in order, and that these are position servos."""
    source, actuators = problem.source, _names(model, "actuator", model.nu)
    for name in problem.channel_names:
        if name not in actuators:
            raise GaitoptError(
                f"{source}: channels.{name}: {problem.model_path} has no actuator of this name; "
                f"it has {', '.join(actuators) or 'none'}{nearest(name, actuators)}"
            )
    if problem.channel_names != actuators:
        found = ", ".join(problem.channel_names)
        raise bad_value(source, "channels", found, f"the model's actuators in order: {', '.join(actuators)}")
    for name in actuators:
        if model.actuator(name).biastype[0] != mujoco.mjtBias.mjBIAS_AFFINE:
            raise bad_value(
                problem.model_path, f"actuator {name}", "not a position servo", "position actuators"
            )


def _check_roles(model: mujoco.MjModel, problem: Problem) -> None:
    """Check that the model has the sites, geoms and joints of the roles, and the sites of the tags."""
    source, roles = problem.source, problem.roles
    marker = [roles.marker] if roles.marker else []
    sites = _names(model, "site", model.nsite)
    _check_names(source, "roles.marker", "site", marker, sites)
    for number, tag in problem.file.tags.items():
        _check_names(source, f"tags.{number}.site", "site", [tag.site] if tag.site else [], sites)
    geoms = _names(model, "geom", model.ngeom)
    _check_names(source, "roles.pads", "geom", roles.pads, geoms)
    _check_names(source, "roles.body", "geom", roles.body, geoms)
    trunk = [roles.trunk] if roles.trunk else []
    _check_names(source, "roles.trunk", "body", trunk, _names(model, "body", model.nbody))
    _check_names(source, "roles.hinges", "joint", roles.hinges, _names(model, "joint", model.njnt))


def _names(model: mujoco.MjModel, kind: str, count: int) -> list[str]:
    return [getattr(model, kind)(i).name for i in range(count)]


def _check_names(source: object, key: str, what: str, asked: Sequence[str], known: Sequence[str]) -> None:
    for name in asked:
        if name not in known:
            raise unknown_name(source, f"{what} in {key}:", name, [n for n in known if n])
