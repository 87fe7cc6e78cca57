"""A problem folder for a new robot: everything that can be read or guessed from its MJCF."""

from __future__ import annotations

import json
import re
import shutil
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import mujoco
import numpy as np

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.files import write_text
from gaitopt.core.folders import check_new_or_empty, filling
from gaitopt.problem.lookup import PROBLEM_FILE
from gaitopt.problem.mjcf import compile_mjcf, named_files, read_mjcf
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import load_problem
from gaitopt.robot.contact import can_touch_ground

_NAME = r"[A-Za-z0-9][A-Za-z0-9_.-]*"
_MARKERS = ("end_effector", "marker", "nose", "head", "tip", "front")
_PADS = ("pad", "foot", "toe", "sole", "paw", "shoe")
_ASSUMED_RANGE_DEG = (-45.0, 45.0)
_DEFAULT_FRICTION = (0.005, 0.0001)


@dataclass(frozen=True)
class Draft:
    """What was guessed of a robot, as it stands in the problem file."""

    roles: Mapping[str, Any]
    channels: Mapping[str, Mapping[str, Any]]
    parameters: Mapping[str, Mapping[str, Any]]
    remarks: Sequence[str]
    timestep_s: float


def make_problem(name: str, mjcf: Path, folder: Path) -> Draft:
    """Make a problem folder with the MJCF, the files it names and a commented problem file.

    Args:
        name: name of the problem.
        mjcf: the robot.
        folder: where to; new or empty.

    Raises:
        GaitoptError: the name or the MJCF cannot be used, or the folder holds something already.
    """
    if not re.fullmatch(_NAME, name):
        raise bad_value("gaitopt new", "NAME", name, "letters, digits, '_', '-' and '.'")
    check_new_or_empty(folder)
    root, included = read_mjcf(mjcf)
    assets = named_files(root, mjcf)
    files = [mjcf, *included, *(path for path, _ in assets.values())]
    draft = _draft(root, mjcf, {name: data for name, (_, data) in assets.items()})
    with filling(folder):
        for file in files:
            target = folder / file.relative_to(mjcf.parent)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, target)
        write_text(folder / PROBLEM_FILE, _text(name, mjcf.name, draft))
        nominal_mjcf(load_problem(folder))  # what was written must be a problem
    return draft


def _draft(root: ET.Element, mjcf: Path, assets: Mapping[str, bytes]) -> Draft:
    """Return what can be read or guessed from a robot's MJCF."""
    model = compile_mjcf(root, mjcf, assets)
    _check_usable(mjcf, model)
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    try:
        mujoco.mj_forward(model, data)
    except mujoco.FatalError as error:
        raise GaitoptError(f"{mjcf}: {error}") from None
    pads, body, remarks = _touching(model, data)
    forward, why = _forward(model, data)
    roles = {
        "marker": _marker(model),
        "pads": pads,
        "body": body,
        "hinges": _passive_hinges(model),
        "forward": forward,
        "up": [round(float(g), 6) + 0.0 for g in -model.opt.gravity / np.linalg.norm(model.opt.gravity)],
    }
    channels = {model.actuator(i).name: _channel(model, i) for i in range(model.nu)}
    parameters = _parameters(model, root, pads)
    return Draft(roles, channels, parameters, [why, *remarks], float(model.opt.timestep))


# --- what must be there -----------------------------------------------------------------------


def _check_usable(mjcf: Path, model: mujoco.MjModel) -> None:
    if model.nu == 0:
        raise GaitoptError(f"{mjcf}: no actuators; a gait needs position servos")
    for i in range(model.nu):
        actuator = model.actuator(i)
        if not actuator.name:
            raise GaitoptError(f"{mjcf}: actuator {i} has no name; a channel is called after its actuator")
        if actuator.biastype[0] != mujoco.mjtBias.mjBIAS_AFFINE:
            raise bad_value(mjcf, f"actuator {actuator.name}", "not a position servo", "<position kp=…>")
    if not any(model.site(i).name for i in range(model.nsite)):
        raise GaitoptError(
            f"{mjcf}: no named site; the robot's motion is that of a site: put "
            '<site name="marker"/> into the body that leads'
        )
    if not np.linalg.norm(model.opt.gravity):
        raise GaitoptError(f"{mjcf}: no gravity; which way is up?")


# --- guesses ----------------------------------------------------------------------------------


def _marker(model: mujoco.MjModel) -> str:
    """Return the site whose name says that it leads, or else the first on a moving body."""
    named = [i for i in range(model.nsite) if model.site(i).name]
    moving = [i for i in named if model.site_bodyid[i] > 0] or named
    ranked = sorted(moving, key=lambda i: (_rank(model.site(i).name, _MARKERS), i))
    return str(model.site(ranked[0]).name)


def _rank(name: str, words: Sequence[str]) -> int:
    return next((i for i, word in enumerate(words) if word in name.lower()), len(words))


def _touching(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[list[str], list[str], list[str]]:
    """Return pads, other geoms that may touch the ground, and what to say about the guess."""
    solid = [i for i in range(model.ngeom) if model.geom_bodyid[i] > 0 and can_touch_ground(model, i)]
    named = [i for i in solid if model.geom(i).name]
    remarks = []
    if len(named) < len(solid):
        remarks.append(f"{len(solid) - len(named)} geoms that may touch the ground have no name: name them")
    pads = _called_pads(model, named)
    if pads:
        remarks.append("pads: geoms called after pads or feet, or on bodies that are")
    else:
        height = [float(data.geom_xpos[i, 2] - model.geom_rbound[i]) for i in named]
        lowest = min(height, default=0.0)
        pads = [i for i, h in zip(named, height, strict=True) if h <= lowest + 0.1 * model.stat.extent]
        remarks.append("pads: no geom is called after a foot or a pad; these are the lowest")
    names = [str(model.geom(i).name) for i in named]
    grip = {str(model.geom(i).name) for i in pads}
    return [n for n in names if n in grip], [n for n in names if n not in grip], remarks


def _called_pads(model: mujoco.MjModel, geoms: Sequence[int]) -> list[int]:
    """Return the geoms that the first fitting word names, or whose bodies it names."""
    called = {i: str(model.geom(i).name).lower() for i in geoms}
    carried = {i: str(model.body(int(model.geom_bodyid[i])).name).lower() for i in geoms}
    for names in (called, carried):
        for word in _PADS:
            found = [i for i in geoms if word in names[i]]
            if found:
                return found
    return []


def _passive_hinges(model: mujoco.MjModel) -> list[str]:
    driven = {int(model.actuator_trnid[i, 0]) for i in range(model.nu)}
    hinge, floating = int(mujoco.mjtJoint.mjJNT_HINGE), _floating_joints(model)
    found = [
        model.joint(i).name
        for i in range(model.njnt)
        if int(model.jnt_type[i]) == hinge and i not in driven and i not in floating
    ]
    return [str(name) for name in found if name]


def _floating_joints(model: mujoco.MjModel) -> set[int]:
    """Return the joints by which the first body moves in the world: no hinges of the robot."""
    return {i for i in range(model.njnt) if model.body_parentid[model.jnt_bodyid[i]] == 0}


def _forward(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[list[float], str]:
    """Return the direction of travel and how it was guessed."""
    for i in sorted(_floating_joints(model)):
        axis = np.abs(model.jnt_axis[i])
        if int(model.jnt_type[i]) == int(mujoco.mjtJoint.mjJNT_SLIDE) and axis[2] < 0.5:
            forward = [float(a) for a in np.round(model.jnt_axis[i], 6)]
            return forward, f"forward: the axis of the joint {model.joint(i).name!r}"
    own = np.flatnonzero(model.geom_bodyid > 0)
    sides = np.ptp(data.geom_xpos[own, :2], axis=0) if len(own) else np.array([1.0, 0.0])
    axis = [1.0, 0.0, 0.0] if sides[0] >= sides[1] else [0.0, 1.0, 0.0]
    return axis, "forward: the robot's longer side; turn it round if it walks backwards"


def _channel(model: mujoco.MjModel, actuator: int) -> dict[str, Any]:
    """Return range, allowed amplitudes and start target of a servo, degrees, and where they come from."""
    joint = int(model.actuator_trnid[actuator, 0])
    on_joint = model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_JOINT
    if model.actuator_ctrllimited[actuator]:
        ends, origin = model.actuator_ctrlrange[actuator], "the actuator's ctrlrange"
    elif on_joint and model.jnt_limited[joint]:
        ends, origin = model.jnt_range[joint], "the joint's range"
    else:
        ends, origin = np.deg2rad(_ASSUMED_RANGE_DEG), "assumed: the MJCF limits neither servo nor joint"
    low, high = (round(float(end), 3) for end in np.rad2deg(ends))
    width = high - low
    amplitude = [-width, 0.0] if high <= 0.0 else [0.0, width]
    rest = min(max(0.0, low), high)
    return {
        "range_deg": [low, high],
        "amplitude_deg": [round(a, 3) for a in amplitude],
        "rest_deg": rest,
        "origin": origin,
    }


def _parameters(model: mujoco.MjModel, root: ET.Element, pads: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the named parameters that all servos, or all pads, share."""
    found: dict[str, dict[str, Any]] = {}
    servos = len(root.findall("actuator/position"))
    gains = set(model.actuator_gainprm[:, 0].tolist())
    if servos == model.nu and len(gains) == 1:
        found["k_servo"] = _parameter(gains.pop(), "N m/rad", '["actuator/position/@kp"]')
    limits = {tuple(row) for row in model.actuator_forcerange.tolist()}
    if servos == model.nu and model.actuator_forcelimited.all() and len(limits) == 1:
        low, high = limits.pop()
        if low == -high:
            sets = '{ "actuator/position/@forcerange" = "-{} {}" }'
            found["torque_limit"] = _parameter(high, "N m", sets)
    frictions = {tuple(model.geom(name).friction.tolist()) for name in pads}
    if len(frictions) == 1 and next(iter(frictions))[1:] == _DEFAULT_FRICTION:
        paths = ", ".join(json.dumps(f".//geom[@name='{name}']/@friction") for name in pads)
        found["mu_pads"] = _parameter(frictions.pop()[0], "1", f"[{paths}]")
    return found


def _parameter(value: float, unit: str, sets: str) -> dict[str, Any]:
    return {"value": float(value), "unit": unit, "sets": sets}


def _text(name: str, model: str, draft: Draft) -> str:
    """Return the problem file; its first gait moves every servo through half its range in turn."""
    loader = jinja2.PackageLoader("gaitopt.problem")
    environment = jinja2.Environment(
        loader=loader, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    environment.filters["key"] = lambda key: key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key)
    environment.filters["toml"] = lambda value: json.dumps(value, ensure_ascii=False)
    channels = []
    for index, (channel, figures) in enumerate(draft.channels.items()):
        reach = max(figures["amplitude_deg"], key=abs)
        phase = 0.25 * index if len(draft.channels) == 2 else round(index / len(draft.channels), 4)
        low = figures["range_deg"][0] if reach > 0.0 else figures["range_deg"][1]
        wave = {
            "swing_deg": round(0.5 * reach, 3),
            "offset_deg": round(low + 0.25 * reach, 3),
            "phase": phase,
        }
        channels.append({"name": channel, **figures, **wave})
    template = environment.get_template("problem.toml.jinja")
    return template.render(name=name, model=model, draft=draft, channels=channels)
