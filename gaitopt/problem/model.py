"""A problem's MuJoCo model: its parameters written into its MJCF, compiled, and at rest."""

from __future__ import annotations

import copy
import math
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import mujoco
import numpy as np

from gaitopt.core.errors import GaitoptError, bad_value, found
from gaitopt.effects.parts import Parts
from gaitopt.problem.friction import let_friction_act
from gaitopt.problem.held import hold
from gaitopt.problem.matching import check_matches
from gaitopt.problem.mjcf import compile_mjcf, named_files, parse_mjcf, path_from, read_mjcf
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity, Parameter
from gaitopt.problem.start import START, held_activation, settled, start_targets

_ATTRIBUTE = r"[A-Za-z_][\w.-]*"
"""Name of an attribute of an MJCF. It is written without changes, so it may not contain markup."""

_MOST_DESCENTS = 2

_WRITTEN = re.compile(
    r"model\.xml|[^/]+\.(toml|csv|json|html)|(figures|pareto|simulated-[^/]*)/.*|(.*/)?\.[^/]*(/.*)?",
    re.IGNORECASE,
)
"""Paths of files that gaitopt writes or removes in a run folder."""


def nominal_mjcf(problem: Problem) -> str:
    """Return the nominal model as one self-contained MJCF, every number at full precision.

    The working timestep and integrator are set, and the keyframe ``start`` holds the state before
    the gait and the targets that the servos hold in it.

    Raises:
        GaitoptError: the MJCF is missing, broken, or does not fit the problem.
    """
    root = _parameterised(problem)
    _set_fidelity(root, problem.simulation.working)
    if problem.file.friction == "robot" and not problem.file.start.held:
        model = compile_for(problem, root)
        check_matches(model, problem)
        parts = Parts(model, problem.roles, problem.channel_names)
        if any(parts.overruled_by(geom) for geom in parts.touching):
            let_friction_act(root, parts, _with_named_friction(root, problem, model))
    if problem.file.start.settle:
        _write_start(root, problem)
    model = compile_for(problem, root)
    check_matches(model, problem)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def build_model(problem: Problem, fidelity: Fidelity | None = None) -> mujoco.MjModel:
    """Return the compiled nominal model with its keyframe ``start``, without instruments.

    Args:
        problem: the problem.
        fidelity: timestep and integrator; the problem's working fidelity by default.

    Raises:
        GaitoptError: the MJCF is missing, broken, or does not fit the problem.
    """
    model = compile_for(problem, ET.fromstring(nominal_mjcf(problem)))
    return with_fidelity(model, fidelity or problem.simulation.working)


def carrying(problem: Problem) -> Problem:
    """Return the problem with the content of its MJCF and of the files that this names.

    It needs no folder any more, so it can travel to another machine.

    Raises:
        GaitoptError: a file is missing, or lies outside the problem's folder.
    """
    root = with_includes(problem)
    mjcf = ET.tostring(root, encoding="unicode").encode()
    return replace(problem, carried={problem.model_path.name: mjcf} | model_assets(problem))


def content_of(problem: Problem) -> tuple[str, list[tuple[str, bytes]]]:
    """Return the problem file and the files of its model: equal for two problems that simulate the same.

    Args:
        problem: a problem that carries its files; see `carrying`.
    """
    return problem.to_toml(problem.model_path.name), sorted((problem.carried or {}).items())


def model_assets(problem: Problem) -> dict[str, bytes]:
    """Return the files that the MJCF names, by path from its folder.

    Raises:
        GaitoptError: a file is missing, or lies outside the problem's folder.
    """
    folder = problem.model_path.parent
    files = named_files(with_includes(problem), problem.model_path, problem.carried)
    return {path_from(folder, path): data for path, data in files.values()}


def assets_beside(problem: Problem) -> dict[str, bytes]:
    """Return the files that the MJCF names, to be written beside the nominal model in another folder.

    Raises:
        GaitoptError: one has the name of a file that gaitopt writes there, is missing, or lies outside the
            problem's folder.
    """
    assets = model_assets(problem)
    for name in assets:
        if _WRITTEN.fullmatch(name):
            allowed = "names that files of a run do not have, such as assets/foot.obj"
            raise GaitoptError(f"{problem.model_path}: it names the file {found(name)}; allowed: {allowed}")
    return assets


def with_fidelity(model: mujoco.MjModel, fidelity: Fidelity) -> mujoco.MjModel:
    """Return a copy of `model` with another timestep and integrator.

    The constraints of one kinematic tree are one island, so looking for islands changes no bit. Without it a
    step of ArcFold takes 6 % less time.
    """
    model = copy.copy(model)
    model.opt.timestep = fidelity.timestep_s
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{fidelity.integrator.upper()}")
    if model.ntree == 1:
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    return model


def compile_for(problem: Problem, root: ET.Element) -> mujoco.MjModel:
    """Return the model of an MJCF that stands for the problem's own.

    Raises:
        GaitoptError: MuJoCo refuses it, or a file that it names is missing.
    """
    return compile_mjcf(root, problem.model_path, assets_for(problem, root))


def assets_for(problem: Problem, root: ET.Element) -> dict[str, bytes]:
    """Return the content of the files that the MJCF names, by the name that MuJoCo asks for."""
    return {name: data for name, (_, data) in named_files(root, problem.model_path, problem.carried).items()}


def nominal_parts(problem: Problem) -> Parts:
    """Return what effects act on in the nominal robot.

    Raises:
        GaitoptError: the MJCF is missing, broken, or does not fit the problem.
    """
    return Parts(build_model(problem), problem.roles, problem.channel_names)


def with_includes(problem: Problem) -> ET.Element:
    """Return the MJCF with includes resolved, without the named parameters."""
    if problem.carried is None:
        return read_mjcf(problem.model_path)[0]
    return parse_mjcf(problem.model_path, problem.carried[problem.model_path.name].decode())


def _parameterised(problem: Problem) -> ET.Element:
    """Return the MJCF with includes resolved and every named parameter written in."""
    root = with_includes(problem)
    for name, parameter in problem.file.parameters.items():
        for path, template in parameter.sets.items():
            _set_attribute(root, path, template, parameter, f"{problem.source}: parameters.{name}.sets")
    if problem.file.start.held:
        hold(root, compile_for(problem, root), START, problem.model_path)
    return root


def _with_named_friction(root: ET.Element, problem: Problem, model: mujoco.MjModel) -> list[int]:
    """Return the geoms whose friction a named parameter sets: another value changes it."""
    other, touched = copy.deepcopy(root), False
    for name, parameter in problem.file.parameters.items():
        changed = parameter.model_copy(update={"value": 0.5 * parameter.value + 0.1234})
        for path, template in parameter.sets.items():
            if path.endswith("/@friction"):
                _set_attribute(other, path, template, changed, f"{problem.source}: parameters.{name}.sets")
                touched = True
    if not touched:
        return []
    unlike = compile_for(problem, other).geom_friction != model.geom_friction
    return np.flatnonzero(unlike.any(axis=1)).tolist()


def _set_attribute(root: ET.Element, path: str, template: str, parameter: Parameter, source: str) -> None:
    xpath, separator, attribute = path.rpartition("/@")
    if not separator or not re.fullmatch(_ATTRIBUTE, attribute, re.ASCII):
        raise bad_value(source, "path", path, "an XPath that ends in /@attribute")
    # Each descent multiplies the number of matches: 200 nested elements give 1e16.
    if xpath.count("//") > _MOST_DESCENTS:
        raise bad_value(source, "path", path, f"an XPath with // at most {_MOST_DESCENTS} times")
    try:
        elements = root.findall(xpath)
    except (SyntaxError, KeyError, TypeError, RecursionError):  # what ElementTree raises for a bad XPath
        elements = []
    if not elements:
        raise bad_value(source, "path", path, "an XPath, from the mujoco element, that finds something")
    text = template.replace("{}", repr(parameter.value))
    if attribute.endswith("range") and not any(map(_number, text.split())):
        allowed = "another number: MuJoCo takes the range 0 0 for none"
        raise bad_value(source.removesuffix(".sets"), "value", parameter.value, allowed)
    for element in elements:
        element.set(attribute, text)


def _number(word: str) -> float:
    """Return the number that a word is; NaN for another word."""
    try:
        return float(word)
    except ValueError:
        return math.nan


def _set_fidelity(root: ET.Element, fidelity: Fidelity) -> None:
    options = root.findall("option")
    for option in options:
        option.attrib.pop("timestep", None)
        option.attrib.pop("integrator", None)
    option = options[0] if options else ET.SubElement(root, "option")
    option.set("timestep", repr(fidelity.timestep_s))
    option.set("integrator", fidelity.integrator)


def _write_start(root: ET.Element, problem: Problem) -> None:
    """Write the keyframe ``start``: the robot at rest under the targets held before the gait."""
    keyframes = root.find("keyframe")
    if keyframes is None:
        keyframes = ET.SubElement(root, "keyframe")
    for key in keyframes.findall(f"key[@name='{START}']"):
        keyframes.remove(key)
    model = compile_for(problem, root)
    check_matches(model, problem)
    held = start_targets(problem)
    qpos = settled(model, held)
    key = ET.SubElement(keyframes, "key", name=START)
    key.set("qpos", " ".join(map(repr, qpos.tolist())))
    key.set("ctrl", " ".join(map(repr, held.tolist())))
    if model.na:
        act = held_activation(model, held, np.zeros(model.na))
        key.set("act", " ".join(map(repr, act.tolist())))
