"""A problem's MuJoCo model: parameters written into its MJCF, compiled, settled, instrumented."""

from __future__ import annotations

import copy
import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError, bad_value, nearest, unknown_name
from gaitopt.core.files import inside, read_bytes, read_text
from gaitopt.effects.active import RobotEffects, transferred
from gaitopt.effects.effect import Parts, is_added
from gaitopt.effects.library.servo import net_torque_limits
from gaitopt.problem.problem import Fidelity, Parameter, Problem
from gaitopt.robot.signals import MARKER, joint_signal

START = "start"
"""Keyframe from which every gait begins."""

_FILE_KEYS = ("file", *(f"file{side}" for side in ("right", "left", "up", "down", "front", "back")))
"""Attributes of MJCF elements that name a file; the sides are a cube texture's."""

_PLACES = ("pos", "size", "fromto", "axis", "quat", "euler", "axisangle", "xyaxes", "zaxis", "vertex")
"""Attributes of MJCF elements that say where something is, and how large."""

_LARGEST = 1e10
"""What MuJoCo itself calls bad in a robot's state."""

_MAX_DEPTH = 200
"""Elements nested deeper are no robot."""

_SETTLE_CHUNK_S = 0.25
_SETTLE_LIMIT_S = 20.0
_SETTLE_LIMIT_STEPS = 1_000_000
_REST_SPEED = 1e-6
"""Largest generalised speed at rest, rad/s or m/s: a hundred times below what the contract asks."""


def nominal_mjcf(problem: Problem) -> str:
    """Return the nominal model as one self-contained MJCF, every number at full precision.

    The working timestep and integrator are set, and the keyframe ``start`` holds the state before
    the gait and the targets that the servos hold in it.

    Raises:
        GaitoptError: the MJCF is missing, broken, or does not fit the problem.
    """
    root = _parameterised(problem)
    _set_fidelity(root, problem.simulation.working)
    if problem.file.start.settle:
        _write_start(root, problem)
    model = _compile(root, problem)
    _check_fits(model, problem)
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
    model = _compile(ET.fromstring(nominal_mjcf(problem)), problem)
    return with_fidelity(model, fidelity or problem.simulation.working)


def carrying(problem: Problem) -> Problem:
    """Return the problem with its MJCF and the files that this names: it can go where its folder is not.

    Raises:
        GaitoptError: a file is missing, or lies outside the problem's folder.
    """
    root = _with_includes(problem)
    mjcf = ET.tostring(root, encoding="unicode").encode()
    return replace(problem, carried={problem.model_path.name: mjcf} | model_assets(problem))


def model_assets(problem: Problem) -> dict[str, bytes]:
    """Return the files that the MJCF names, by path from its folder.

    Raises:
        GaitoptError: a file is missing, or lies outside the problem's folder.
    """
    folder = problem.model_path.parent
    files = named_files(_with_includes(problem), problem.model_path, problem.carried)
    return {_from(folder, path): data for path, data in files.values()}


def with_fidelity(model: mujoco.MjModel, fidelity: Fidelity) -> mujoco.MjModel:
    """Return a copy of `model` with another timestep and integrator."""
    model = copy.copy(model)
    model.opt.timestep = fidelity.timestep_s
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{fidelity.integrator.upper()}")
    return model


def start_targets(problem: Problem) -> NDArray[np.float64]:
    """Return the targets that the servos hold before the gait, rad, shape (nu,)."""
    held = problem.file.start.ctrl_deg
    return np.deg2rad([held.get(name, 0.0) for name in problem.channel_names])


@dataclass(frozen=True)
class Robot:
    """Figures of a compiled robot: its weight and its servos' limits.

    Attributes:
        weight: N.
        torque_limit: N m, shape (nu,); inf where there is none.
        damping: of the driven joints, N m s/rad, shape (nu,): the slope of a motor's torque-speed line.
        no_load_speed: rad/s, shape (nu,): torque limit over damping of the driven joint, where a
            direct-current motor's torque is used up by its own speed; inf where there is no limit.
    """

    weight: float
    torque_limit: NDArray[np.float64]
    damping: NDArray[np.float64]
    no_load_speed: NDArray[np.float64]

    @staticmethod
    def of(model: mujoco.MjModel) -> Robot:
        """Read the figures of a model."""
        mass = float(model.body_mass[model.body_weldid != 0].sum())
        weight = mass * float(np.linalg.norm(model.opt.gravity))
        added = [is_added(model.actuator(i).name) for i in range(model.nu)]
        servos = added.count(False)
        limited = model.actuator_forcelimited[:servos].astype(bool)
        torque_limit = np.where(limited, net_torque_limits(model)[:servos], np.inf)
        damping = np.zeros(servos)
        for i in range(servos):
            if model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT:
                damping[i] = model.dof_damping[model.jnt_dofadr[model.actuator_trnid[i, 0]]]
        speed = np.full(servos, np.inf)
        np.divide(torque_limit, damping, out=speed, where=damping > 0.0)
        return Robot(weight, torque_limit, damping, speed)


# --- instruments ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Instrument:
    """One sensor: the signals it gives, in the order of its numbers; None for a number not kept."""

    element: str
    attributes: dict[str, str]
    signals: tuple[str | None, ...]


def instruments(problem: Problem, model: mujoco.MjModel) -> list[Instrument]:
    """Return the sensors that metrics and diagnosis read, for any robot, from its roles."""
    root_body = model.body(1).name
    marker = problem.roles.marker
    found = [
        Instrument(
            "framepos",
            {"objtype": "site", "objname": marker},
            MARKER,
        ),
        Instrument(
            "framequat",
            {"objtype": "xbody", "objname": root_body},
            ("heading.w", "heading.x", "heading.y", "heading.z"),
        ),
        Instrument(
            "contact", {"body2": "world", "reduce": "mindist", "data": "found dist"}, ("contacts", "depth")
        ),
        Instrument("contact", {"data": "found"}, ("contacts_all",)),
    ]
    for name in problem.channel_names:
        found.append(Instrument("actuatorpos", {"actuator": name}, (f"position.{name}",)))
        found.append(Instrument("actuatorvel", {"actuator": name}, (f"rate.{name}",)))
        found.append(Instrument("actuatorfrc", {"actuator": name}, (f"torque.{name}",)))
    for name in filter(None, (model.joint(i).name for i in scalar_joints(model))):
        found.append(Instrument("jointpos", {"joint": name}, (joint_signal(name),)))
    for pad in problem.roles.pads:
        found.append(
            Instrument(
                "contact",
                {"geom1": pad, "body2": "world", "reduce": "netforce", "data": "force"},
                tuple(f"load.{pad}.{axis}" for axis in "xyz"),
            )
        )
        found.append(
            Instrument(
                "framelinvel",
                {"objtype": "geom", "objname": pad},
                tuple(f"pad_speed.{pad}.{axis}" for axis in "xyz"),
            )
        )
    return found


def build_instrumented(problem: Problem) -> tuple[mujoco.MjModel, list[str | None], RobotEffects]:
    """Return a problem's model with its sensors, the signal in each place of ``sensordata``, its effects.

    The model has the parts that its effects need; `RobotEffects.edit` then makes it the robot with effects.
    Its keyframe ``start`` is the nominal robot's.

    Raises:
        GaitoptError: the MJCF is missing, broken, or does not fit the problem, or an effect does not
            apply to it.
    """
    root, names = _instrumented(problem)
    nominal = _compile(root, problem)
    parts = Parts(nominal, problem.roles, problem.channel_names)
    active = RobotEffects.of(problem.effects, parts, problem.source)
    if not active.changes_robot:
        return nominal, names, active
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"), assets=_assets(root, problem))
    for key in list(spec.keys):
        spec.delete(key)
    active.restructure(spec)
    spec.add_key(name=START)
    try:
        model = spec.compile()
    except ValueError as error:
        raise GaitoptError(f"{problem.model_path}: with effects: {error}") from None
    model.key_qpos[0] = transferred(nominal.keyframe(START).qpos, nominal, model)
    return model, names + [None] * (model.nsensordata - len(names)), active


def nominal_parts(problem: Problem) -> Parts:
    """Return what effects act on in the nominal robot.

    Raises:
        GaitoptError: the MJCF is missing, broken, or does not fit the problem.
    """
    return Parts(build_model(problem), problem.roles, problem.channel_names)


def _instrumented(problem: Problem) -> tuple[ET.Element, list[str | None]]:
    """Return the nominal MJCF with its sensors, and the signal in each place of ``sensordata``."""
    root = ET.fromstring(nominal_mjcf(problem))
    for element in root.findall("sensor"):
        root.remove(element)
    bare = _compile(root, problem)
    sensors = ET.SubElement(root, "sensor")
    names: list[str | None] = []
    for instrument in instruments(problem, bare):
        ET.SubElement(sensors, instrument.element, instrument.attributes)
        names.extend(instrument.signals)
    return root, names


def scalar_joints(model: mujoco.MjModel) -> list[int]:
    """Return the ids of the robot's own hinge and slide joints."""
    scalar = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
    own = [i for i in range(model.njnt) if not is_added(model.joint(i).name)]
    return [i for i in own if int(model.jnt_type[i]) in scalar]


# --- MJCF -------------------------------------------------------------------------------------


def _parameterised(problem: Problem) -> ET.Element:
    """Return the MJCF with includes resolved and every named parameter written in."""
    root = _with_includes(problem)
    for name, parameter in problem.file.parameters.items():
        for path, template in parameter.sets.items():
            _set_attribute(root, path, template, parameter, f"{problem.source}: parameters.{name}.sets")
    return root


def _with_includes(problem: Problem) -> ET.Element:
    if problem.carried is None:
        return read_mjcf(problem.model_path)[0]
    return _parse(problem.model_path, problem.carried[problem.model_path.name].decode(), "mujoco")


def read_mjcf(path: Path) -> tuple[ET.Element, list[Path]]:
    """Return an MJCF with its includes resolved, and the files that these are, all from its own folder.

    Raises:
        GaitoptError: a file is missing or broken, lies outside the folder, or is included twice.
    """
    root, included = _parse(path, read_text(path), "mujoco"), [path]
    _resolve_includes(root, path.parent, included)
    return root, included[1:]


def _parse(path: Path, text: str, *roots: str) -> ET.Element:
    if "<!DOCTYPE" in text:  # its entities can grow without end, and MuJoCo reads them in its own way
        raise GaitoptError(f"{path}: found a <!DOCTYPE>; allowed: elements and comments")
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise GaitoptError(f"{path}: broken XML: {error}") from None
    if root.tag not in roots:
        raise bad_value(path, "root element", root.tag, " or ".join(roots))
    level, depth = list(root), 0
    while level:
        level, depth = [child for element in level for child in element], depth + 1
        if depth > _MAX_DEPTH:
            raise GaitoptError(f"{path}: elements nested more than {_MAX_DEPTH} deep")
    return root


def _resolve_includes(element: ET.Element, folder: Path, included: list[Path]) -> None:
    """Put the children of each included file where its include stands; only the problem's own folder."""
    for index, child in reversed(list(enumerate(element))):
        if child.tag == "include":
            name = child.get("file", "")
            path = inside(folder, name)
            if not name or path is None:
                raise bad_value(folder, "include file", name, "a file inside the problem's folder")
            if path.resolve() in [known.resolve() for known in included]:  # as MuJoCo has it
                raise GaitoptError(f"{folder}: include file: {name} is included twice")
            included.append(path)
            content = _parse(path, read_text(path), "mujocoinclude", "mujoco")
            _resolve_includes(content, folder, included)
            element.remove(child)
            for offset, grandchild in enumerate(content):
                element.insert(index + offset, grandchild)
        else:
            _resolve_includes(child, folder, included)


def _set_attribute(root: ET.Element, path: str, template: str, parameter: Parameter, source: str) -> None:
    xpath, separator, attribute = path.rpartition("/@")
    if not separator:
        raise bad_value(source, "path", path, "an XPath that ends in /@attribute")
    try:
        elements = root.findall(xpath)
    except (SyntaxError, KeyError, TypeError, RecursionError):  # what ElementTree raises for a bad XPath
        elements = []
    if not elements:
        raise bad_value(source, "path", path, "an XPath, from the mujoco element, that finds something")
    text = template.replace("{}", repr(parameter.value))
    for element in elements:
        element.set(attribute, text)


def _set_fidelity(root: ET.Element, fidelity: Fidelity) -> None:
    options = root.findall("option")
    for option in options:
        option.attrib.pop("timestep", None)
        option.attrib.pop("integrator", None)
    option = options[0] if options else ET.SubElement(root, "option")
    option.set("timestep", repr(fidelity.timestep_s))
    option.set("integrator", fidelity.integrator)


def _compile(root: ET.Element, problem: Problem) -> mujoco.MjModel:
    return compile_mjcf(root, problem.model_path, _assets(root, problem))


def compile_mjcf(root: ET.Element, path: Path, assets: Mapping[str, bytes]) -> mujoco.MjModel:
    """Return the model of an MJCF, given every file that it names.

    Raises:
        GaitoptError: MuJoCo refuses it, or something in it is as far away as no robot is.
    """
    for element in root.iter():
        for key in _PLACES:
            if not all(abs(number) <= _LARGEST for number in _numbers(element.get(key, ""))):
                raise bad_value(path, f"{element.tag} {key}", element.get(key), f"at most {_LARGEST:g}")
    try:
        return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"), dict(assets))
    except ValueError as error:
        raise GaitoptError(f"{path}: {error}") from None


def _numbers(text: str) -> list[float]:
    """Return the numbers in a text; MuJoCo says what is none."""
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return []


def _assets(root: ET.Element, problem: Problem) -> dict[str, bytes]:
    """Return the content of the files that the MJCF names, by the name that MuJoCo asks for."""
    return {name: data for name, (_, data) in named_files(root, problem.model_path, problem.carried).items()}


def named_files(
    root: ET.Element, mjcf: Path, carried: Mapping[str, bytes] | None = None
) -> dict[str, tuple[Path, bytes]]:
    """Return path and content of the files that an MJCF names, by the name that MuJoCo asks for.

    They come from its own folder alone; MuJoCo itself would read any file that it is not given here.

    Args:
        root: the MJCF, its includes resolved.
        mjcf: where it lies.
        carried: the files by path from its folder, where they are not read from the disk.

    Raises:
        GaitoptError: a file is missing, or lies outside the folder.
    """
    folder, places = mjcf.parent, _asset_folders(root, mjcf)
    assets = {}
    for element, key, name in _names_of_files(root):
        place = places.get(element.tag, places["mesh"])
        path = inside(folder, f"{place}{name}")
        if path is None or Path(name).is_absolute():
            data = None
        elif carried is not None:
            data = carried.get(_from(folder, path))
        else:
            data = read_bytes(path) if path.is_file() else None
        if path is None or data is None:
            raise bad_value(mjcf, f"{element.tag} {key}", name, "a file in the problem's folder")
        assets[f"{place}{name}"] = path, _alone(path, data) if element.tag == "model" else data
    return assets


def _names_of_files(root: ET.Element) -> Iterator[tuple[ET.Element, str, str]]:
    """Yield each attribute that names a file: its element, its key and the name."""
    for element in root.iter():
        for key, name in element.attrib.items():
            if key in _FILE_KEYS:
                yield element, key, name


def _asset_folders(root: ET.Element, mjcf: Path) -> dict[str, str]:
    """Return what MuJoCo puts before the names of files, by the element that names one."""
    folders = {"meshdir": "", "texturedir": ""}
    for compiler in root.findall("compiler"):
        if compiler.get("strippath", "false") != "false":
            raise bad_value(mjcf, "compiler strippath", "true", "false: files go by their whole path")
        for key in folders:
            folders[key] = compiler.get(key, compiler.get("assetdir", folders[key]))
    mesh, texture = (f"{name.rstrip('/')}/" if name else "" for name in folders.values())
    return {"mesh": mesh, "texture": texture, "model": ""}


def _alone(path: Path, data: bytes) -> bytes:
    """Return a model that an MJCF attaches, which may name no files: MuJoCo reads those by itself."""
    try:
        root = _parse(path, data.decode("utf-8-sig"), "mujoco")
    except UnicodeDecodeError:
        raise GaitoptError(f"{path}: not UTF-8 text") from None
    named = [name for _, _, name in _names_of_files(root)]
    if named:
        raise bad_value(path, "file", named[0], "a model to attach that names no files")
    return ET.tostring(root)


def _from(folder: Path, path: Path) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


# --- the start pose ---------------------------------------------------------------------------


def _write_start(root: ET.Element, problem: Problem) -> None:
    """Write the keyframe ``start``: the robot at rest under the targets held before the gait."""
    keyframes = root.find("keyframe")
    if keyframes is None:
        keyframes = ET.SubElement(root, "keyframe")
    for key in keyframes.findall(f"key[@name='{START}']"):
        keyframes.remove(key)
    model = _compile(root, problem)
    _check_fits(model, problem)
    held = start_targets(problem)
    qpos = settled(model, held)
    key = ET.SubElement(keyframes, "key", name=START)
    key.set("qpos", " ".join(map(repr, qpos.tolist())))
    key.set("ctrl", " ".join(map(repr, held.tolist())))


def settled(
    model: mujoco.MjModel, held: NDArray[np.float64], limit_s: float = _SETTLE_LIMIT_S
) -> NDArray[np.float64]:
    """Return the pose in which the robot comes to rest under constant targets, shape (nq,).

    It falls from its keyframe 0 or its default pose. A robot that never rests is returned as it is
    after `limit_s`: `gaitopt check` says so.

    Raises:
        GaitoptError: MuJoCo gives up, for lack of the memory that the MJCF grants it.
    """
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[:] = held
    steps = max(1, round(_SETTLE_CHUNK_S / model.opt.timestep))
    limit_s = min(limit_s, _SETTLE_LIMIT_STEPS * model.opt.timestep)
    for _ in range(max(1, round(limit_s / _SETTLE_CHUNK_S))):
        try:
            mujoco.mj_step(model, data, steps)
        except mujoco.FatalError as error:
            raise GaitoptError(f"the robot cannot be brought to rest: {error}") from None
        if np.abs(data.qvel).max(initial=0.0) < _REST_SPEED:
            break
    return np.array(data.qpos)


# --- does it fit ------------------------------------------------------------------------------


def _check_fits(model: mujoco.MjModel, problem: Problem) -> None:
    source = problem.source
    actuators = [model.actuator(i).name for i in range(model.nu)]
    for name in problem.channel_names:
        if name not in actuators:
            raise GaitoptError(
                f"{source}: channels.{name}: {problem.model_path} has no actuator of this name; "
                f"it has {', '.join(actuators) or 'none'}{nearest(name, actuators)}"
            )
    if problem.channel_names != actuators:
        raise bad_value(
            source,
            "channels",
            ", ".join(problem.channel_names),
            f"the model's actuators in order: {', '.join(actuators)}",
        )
    for name in actuators:
        if model.actuator(name).biastype[0] != mujoco.mjtBias.mjBIAS_AFFINE:
            raise bad_value(
                problem.model_path, f"actuator {name}", "not a position servo", "position actuators"
            )
    _check_names(source, "roles.marker", "site", [problem.roles.marker], _names(model, "site", model.nsite))
    geoms = _names(model, "geom", model.ngeom)
    _check_names(source, "roles.pads", "geom", problem.roles.pads, geoms)
    _check_names(source, "roles.body", "geom", problem.roles.body, geoms)
    _check_names(source, "roles.hinges", "joint", problem.roles.hinges, _names(model, "joint", model.njnt))
    if not problem.file.start.settle and START not in _names(model, "key", model.nkey):
        raise unknown_name(problem.model_path, "keyframe", START, _names(model, "key", model.nkey))
    if model.nbody < 2:
        raise GaitoptError(f"{problem.model_path}: no body under the world")


def _names(model: mujoco.MjModel, kind: str, count: int) -> list[str]:
    return [getattr(model, kind)(i).name for i in range(count)]


def _check_names(source: object, key: str, what: str, asked: Sequence[str], known: Sequence[str]) -> None:
    for name in asked:
        if name not in known:
            raise unknown_name(source, f"{what} in {key}:", name, [n for n in known if n])
