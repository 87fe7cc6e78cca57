"""A problem folder for a new robot: everything that can be read or guessed from its MJCF."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import jinja2
import mujoco

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.files import read_bytes, write_bytes, write_text
from gaitopt.core.folders import check_new_or_empty, filled
from gaitopt.gait.calibration import SAFE_PINS
from gaitopt.problem.drafting.checks import (
    check_actuators,
    check_angles,
    leave_out_missing,
    remarks_on,
    replace_missing,
)
from gaitopt.problem.drafting.family import FAMILIES, guess_family
from gaitopt.problem.drafting.faults import Faults
from gaitopt.problem.drafting.gaits import FirstGait, Travel, first_gaits
from gaitopt.problem.drafting.limits import DraftedLimit, draft_limits
from gaitopt.problem.drafting.motors import make_servos
from gaitopt.problem.drafting.names import name_parts
from gaitopt.problem.drafting.standing import check_ground, size_of, stance_key, stand
from gaitopt.problem.drafting.ties import DraftedTies, draft_ties
from gaitopt.problem.guesses import (
    USUAL_SERVO,
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
from gaitopt.robot.roles import Roles

_NAME = r"[A-Za-z0-9][A-Za-z0-9_.-]*"
_TIMESTEP_S = 0.005
"""Longest working timestep, s: contacts of larger steps change a walk."""

_PENALTY = 1.0
"""Cost of a serious violation of a limit, in lengths of the robot per second: 0.2 m/s for 0.2 m. A fast robot
goes three lengths a second, and a winner should not buy its speed with a violation."""

_KEY = r"[A-Za-z0-9_-]+"
"""A key that TOML takes without quotes."""


@dataclass(frozen=True)
class Draft:
    """What was guessed about a robot, as written to the problem file.

    Attributes:
        family, family_why: its family, and what that rests on; empty where it was asked for.
        roles: what effects, metrics and reports act on.
        channels: the servos, in the model's order.
        parameters: named numbers of the model.
        gaits: first gaits, the most promising first.
        ties: which servos may move alike; None where that cannot be told.
        limits: what must hold in a search.
        penalty: cost of a serious violation of one, m/s.
        stance: where the start targets come from.
        changes: how the copy of the MJCF differs from the original.
        remarks: how the roles were guessed.
        warnings: what a user should look at and correct.
        timestep_s: the working timestep: the MJCF's, or a shorter one.
    """

    family: str
    family_why: str
    roles: GuessedRoles
    channels: Sequence[GuessedChannel]
    parameters: Mapping[str, GuessedParameter]
    gaits: Sequence[FirstGait]
    ties: DraftedTies | None
    limits: Sequence[DraftedLimit]
    penalty: float
    stance: str
    changes: Sequence[str]
    remarks: Sequence[str]
    warnings: Sequence[str]
    timestep_s: float


def make_problem(
    name: str, mjcf: Path, folder: Path, from_motors: bool = False, family: str | None = None
) -> Draft:
    """Make a problem folder with the MJCF, the files it names and a commented problem file.

    The MJCF is copied as it is, with the files that it includes. Where its parts need names, a marker or
    servos, it is written anew, its includes resolved.

    Args:
        name: name of the problem.
        mjcf: the robot.
        folder: the folder to make, or an empty one to fill.
        from_motors: whether motors become position servos.
        family: one of `FAMILIES`; guessed by default.

    Raises:
        GaitoptError: the name or the MJCF cannot be used, or the folder is not empty.
    """
    if not re.fullmatch(_NAME, name):
        raise bad_value("gaitopt new", "NAME", name, "letters, digits, '_', '-' and '.'")
    if family is not None and family not in FAMILIES:
        raise bad_value("gaitopt new", "--family", family, " or ".join(FAMILIES), FAMILIES)
    check_new_or_empty(folder)
    root, included = read_mjcf(mjcf)
    missing = replace_missing(root, mjcf)
    assets = named_files(root, mjcf)
    files = [mjcf, *included, *(path for path, _ in assets.values())]
    if mjcf.parent / PROBLEM_FILE in files:
        raise GaitoptError(f"{mjcf}: it names the file {PROBLEM_FILE}; allowed: another name")
    contents = {name: data for name, (_, data) in assets.items()}
    draft = _draft(root, mjcf, contents, missing, from_motors, family)
    if draft.changes:
        files = [path for path, _ in assets.values()]
    with filled(folder) as place:
        for file in files:
            target = place / file.relative_to(mjcf.parent)
            target.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(target, read_bytes(file))
        if draft.changes:
            ET.indent(root)
            write_text(place / mjcf.name, ET.tostring(root, encoding="unicode") + "\n")
        write_text(place / PROBLEM_FILE, _text(name, mjcf.name, draft))
        nominal_mjcf(load_problem(place))  # what was written must be a problem
    return draft


def _draft(
    root: ET.Element,
    mjcf: Path,
    assets: Mapping[str, bytes],
    missing: Mapping[str, Sequence[ET.Element]],
    from_motors: bool,
    family: str | None,
) -> Draft:
    """Return what can be read or guessed from a robot's MJCF; edit it where its parts need it."""
    faults = Faults(mjcf)
    named = name_parts(root)
    changes = [f"names for {', '.join(named)} that had none"] if named else []
    model = compile_mjcf(root, mjcf, assets)
    changes += leave_out_missing(root, model, missing, faults)
    incomplete = bool(faults.found)
    check_actuators(model, faults, from_motors)
    check_angles(root, model, faults)
    if not model.nu or incomplete:
        check_ground(model, faults)
        faults.check()
    changes += make_servos(root, model, faults)
    model = compile_mjcf(root, mjcf, assets)
    if _stance_first(root, model):
        changes.append("the keyframe of the stance comes first")
        model = compile_mjcf(root, mjcf, assets)
    try:
        standing = stand(model, faults)
    except mujoco.FatalError as error:
        raise GaitoptError(f"{mjcf}: {error}") from None
    faults.check()
    roles = guess_roles(model, standing)
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, roles.marker) < 0:
        _add_marker(root, roles, mjcf)
        changes.append(f"the site {roles.marker} in the middle of {roles.trunk}")
    channels = [guess_channel(model, i, float(rest)) for i, rest in enumerate(standing.targets)]
    guessed, why = guess_family(model, standing, roles.pad_ids)
    kind = family or guessed
    axes = Roles(forward=tuple(roles.forward), up=tuple(roles.up)).axes
    travels = [_travel(one) for one in channels]
    return Draft(
        family=kind,
        family_why="" if family else why,
        roles=roles,
        channels=channels,
        parameters=guess_parameters(model, root, roles.pad_ids),
        gaits=first_gaits(kind, model, standing, roles.pad_ids, axes, travels),
        ties=draft_ties(kind, model, standing, roles.pad_ids, axes, travels),
        limits=draft_limits(kind, model, standing),
        penalty=max(0.05, round(_PENALTY * size_of(model, standing.drawn), 2)),
        stance=standing.origin,
        changes=changes,
        remarks=roles.remarks,
        warnings=remarks_on(model, standing, roles.up),
        timestep_s=min(float(model.opt.timestep), _TIMESTEP_S),
    )


def _travel(channel: GuessedChannel) -> Travel:
    low, high = channel.range_deg
    return Travel(channel.name, low, high, channel.rest_deg, -1.0 if channel.amplitude_deg[1] <= 0.0 else 1.0)


def _stance_first(root: ET.Element, model: mujoco.MjModel) -> bool:
    """Move the keyframe of the stance to the front, where a robot settles from; return whether it moved."""
    key = stance_key(model)
    if not key:
        return False
    name = model.key(key).name
    sections = root.findall("keyframe")
    for section in sections:
        for element in section.findall("key"):
            if element.get("name") == name:
                section.remove(element)
                sections[0].insert(0, element)
                return True
    return False


def _add_marker(root: ET.Element, roles: GuessedRoles, mjcf: Path) -> None:
    """Add a site to the trunk."""
    body = next((one for one in root.iter("body") if one.get("name") == roles.trunk), None)
    if body is None:
        raise GaitoptError(
            f"{mjcf}: no named site on the trunk {roles.trunk}, which another file brings: put "
            '<site name="marker"/> into it'
        )
    body.append(ET.Element("site", name=roles.marker))


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
    template = environment.get_template("problem.toml.jinja")
    return template.render(name=name, model=model, draft=draft, pins=SAFE_PINS, usual=USUAL_SERVO)
