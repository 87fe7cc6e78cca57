"""A problem folder for a new robot: everything that can be read or guessed from its MJCF."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import jinja2
import mujoco
import numpy as np

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.files import read_bytes, write_bytes, write_text
from gaitopt.core.folders import check_new_or_empty, filling
from gaitopt.gait.calibration import SAFE_PINS
from gaitopt.problem.guesses import (
    GuessedChannel,
    GuessedParameter,
    GuessedRoles,
    guess_channel,
    guess_parameters,
    guess_roles,
)
from gaitopt.problem.lookup import PROBLEM_FILE
from gaitopt.problem.mjcf import compile_mjcf, named_files, read_mjcf
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import load_problem

_NAME = r"[A-Za-z0-9][A-Za-z0-9_.-]*"
_KEY = r"[A-Za-z0-9_-]+"
"""A key that TOML takes without quotes."""


@dataclass(frozen=True)
class Draft:
    """What was guessed about a robot, as written to the problem file.

    Attributes:
        roles: what effects, metrics and reports act on.
        channels: the servos, in the model's order.
        parameters: named numbers of the model.
        timestep_s: the MJCF's timestep.
    """

    roles: GuessedRoles
    channels: Sequence[GuessedChannel]
    parameters: Mapping[str, GuessedParameter]
    timestep_s: float


def make_problem(name: str, mjcf: Path, folder: Path) -> Draft:
    """Make a problem folder with the MJCF, the files it names and a commented problem file.

    Args:
        name: name of the problem.
        mjcf: the robot.
        folder: the folder to make, or an empty one to fill.

    Raises:
        GaitoptError: the name or the MJCF cannot be used, or the folder is not empty.
    """
    if not re.fullmatch(_NAME, name):
        raise bad_value("gaitopt new", "NAME", name, "letters, digits, '_', '-' and '.'")
    check_new_or_empty(folder)
    root, included = read_mjcf(mjcf)
    assets = named_files(root, mjcf)
    files = [mjcf, *included, *(path for path, _ in assets.values())]
    if mjcf.parent / PROBLEM_FILE in files:
        raise GaitoptError(f"{mjcf}: it names the file {PROBLEM_FILE}; allowed: another name")
    draft = _draft(root, mjcf, {name: data for name, (_, data) in assets.items()})
    with filling(folder):
        for file in files:
            target = folder / file.relative_to(mjcf.parent)
            target.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(target, read_bytes(file))
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
    roles = guess_roles(model, data)
    channels = [guess_channel(model, i) for i in range(model.nu)]
    parameters = guess_parameters(model, root, roles.pads)
    return Draft(roles, channels, parameters, float(model.opt.timestep))


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


def _text(name: str, model: str, draft: Draft) -> str:
    """Return the text of the problem file."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("gaitopt.problem"),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["key"] = lambda key: (
        key if re.fullmatch(_KEY, key) else json.dumps(key, ensure_ascii=False)
    )
    environment.filters["toml"] = lambda value: json.dumps(value, ensure_ascii=False)
    count = len(draft.channels)
    channels = [asdict(one) | _first_wave(one, i, count) for i, one in enumerate(draft.channels)]
    template = environment.get_template("problem.toml.jinja")
    return template.render(name=name, model=model, draft=draft, channels=channels, pins=SAFE_PINS)


def _first_wave(channel: GuessedChannel, index: int, count: int) -> dict[str, Any]:
    """Return a servo's wave in the first gait: through half its range, one servo after another."""
    reach = max(channel.amplitude_deg, key=abs)
    low = channel.range_deg[0] if reach > 0.0 else channel.range_deg[1]
    return {
        "swing_deg": round(0.5 * reach, 3),
        "offset_deg": round(low + 0.25 * reach, 3),
        "phase": 0.25 * index if count == 2 else round(index / count, 4),
    }
