"""Excessive numbers in an MJCF are refused with one line before MuJoCo reads them."""

import ctypes
import re
import struct
import zlib
from pathlib import Path

import mujoco
import pytest
from helpers import STRIDER, edited, problem_folder
from hostility import CUBE, refused, run, with_element

from gaitopt.problem.limits import COUNTS
from gaitopt.problem.model import build_model
from gaitopt.problem.problem import load_problem

ACTUATORS = '<actuator><general name="x" joint="none" {}/></actuator>'

ENDLESS = {
    "a replicate": '<worldbody><replicate count="1000000000"><geom size="1"/></replicate></worldbody>',
    "replicates in replicates": "<worldbody>"
    + 3 * '<replicate count="3000">'
    + '<geom size="1"/>'
    + 3 * "</replicate>"
    + "</worldbody>",
    "many replicates": "<worldbody>"
    + 30 * '<replicate count="400"><geom size="1"/></replicate>'
    + "</worldbody>",
    "a replicate with a sign": '<worldbody><replicate count="+1000000000"/></worldbody>',
    "a soft grid": '<worldbody><flexcomp type="grid" count="1000 1000 100" dim="3"/></worldbody>',
    "a soft ellipsoid": '<worldbody><flexcomp type="ellipsoid" count="300 300 300" dim="3"/></worldbody>',
    "cells of a soft body": '<worldbody><flexcomp cellcount="1000 1000 1000"/></worldbody>',
    "keyframes": '<size nkey="2000000000"/>',
    "user data": '<size nuserdata="2000000000"/>',
    "user numbers of geoms": '<size nuser_geom="2000000000"/>',
    "memory": '<size memory="1000G"/>',
    "memory in exabytes": '<size memory="8E"/>',
    "memory in digits": f'<size memory="{10**20}"/>',
    "a stack": '<size nstack="2000000000"/>',
    "constraints": '<size njmax="2000000000"/>',
    "contacts": '<size nconmax="2000000000"/>',
    "a height field": '<asset><hfield name="h" nrow="200000" ncol="200000" size="1 1 1 1"/></asset>',
    "many height fields": "<asset>" + 50 * '<hfield nrow="8000" ncol="8000" size="1 1 1 1"/>' + "</asset>",
    "a texture": '<asset><texture name="t" type="2d" builtin="flat" width="100000" height="9"/></asset>',
    "a texture by default": '<default><default class="d"><texture width="100000"/></default></default>',
    "many textures": "<asset>" + 50 * '<texture type="cube" builtin="flat" width="8000"/>' + "</asset>",
    "layers of a texture": '<asset><texture type="2d" builtin="flat" nchannel="99999"/></asset>',
    "a built-in mesh": '<asset><mesh name="m" builtin="supersphere" params="100000 1 1"/></asset>',
    "many built-in meshes": "<asset>" + 101 * '<mesh builtin="plate" params="300 300"/>' + "</asset>",
    "numbers of a sensor": '<sensor><user dim="2000000000"/></sensor>',
    "contacts of a sensor": '<sensor><contact num="2000000000" data="force"/></sensor>',
    "history of a sensor": '<sensor><clock nsample="2000000" delay="1" interval="1"/></sensor>',
    "history of an actuator": ACTUATORS.format('nsample="2000000" delay="1"'),
    "states of an actuator": ACTUATORS.format('dyntype="user" actdim="2000000000"'),
    "pixels of a camera": '<worldbody><camera name="c" resolution="100000 100000"/></worldbody>',
    "rays of a camera": '<worldbody><camera name="c" resolution="1000 1000"/></worldbody>'
    '<sensor><rangefinder camera="c"/></sensor>',
    "steps while compiling": '<compiler><lengthrange inttotal="1000000000" timestep="0.000001"/></compiler>',
    "no steps while compiling": '<compiler><lengthrange timestep="0"/></compiler>',
    "iterations": '<option iterations="2000000000" tolerance="0"/>',
    "iterations of a line search": '<option ls_iterations="2000000000" ls_tolerance="0"/>',
    "points of a signed distance": '<option sdf_initpoints="2000000000"/>',
    "samples of a picture": '<visual><quality offsamples="2000000000"/></visual>',
    "slices of a picture": '<visual><quality numslices="2000000000"/></visual>',
    "a large window": '<visual><global offwidth="2000000000"/></visual>',
    "elements": "<worldbody>" + 5001 * '<geom size="1"/>' + "</worldbody>",
    "a size in hexadecimal": '<worldbody><geom size="0x1p100"/></worldbody>',
}


@pytest.mark.parametrize("attack", ENDLESS)
def test_numbers_without_end_are_one_line_before_mujoco_sees_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, attack: str
) -> None:
    problem = with_element(tmp_path / "robot", ENDLESS[attack])
    monkeypatch.setattr(mujoco.MjModel, "from_xml_string", None)
    monkeypatch.setattr(mujoco.MjSpec, "from_string", None)
    said = refused(lambda: build_model(problem))
    assert "allowed: " in said
    assert "strider.xml" in said


@pytest.mark.parametrize("attack", ["a replicate", "a height field", "memory", "keyframes"])
def test_new_refuses_numbers_without_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], attack: str
) -> None:
    folder = with_element(tmp_path / "robot", ENDLESS[attack]).source.parent
    code, said = run(capsys, "new", "bot", "--mjcf", folder / "strider.xml")
    assert code == 1
    assert "allowed: " in said
    assert not Path("bot").exists()


def test_an_attached_model_is_counted_each_time(tmp_path: Path) -> None:
    attached = '<asset><model name="n" file="n.xml"/></asset>'
    bodies = "<worldbody>" + 200 * '<body><attach model="n" body="b" prefix="{}"/></body>' + "</worldbody>"
    problem = with_element(tmp_path / "robot", attached + bodies)
    (tmp_path / "robot" / "n.xml").write_text(
        '<mujoco><worldbody><body name="b"><replicate count="100"><geom size="1"/></replicate></body>'
        "</worldbody></mujoco>"
    )
    assert "5000 elements" in refused(lambda: build_model(problem))
    (tmp_path / "robot" / "n.xml").write_text('<mujoco><size nkey="2000000000"/><worldbody/></mujoco>')
    assert "size nkey: found '2000000000'" in refused(lambda: build_model(problem))


def test_an_attached_model_that_attaches_itself_is_one_line(tmp_path: Path) -> None:
    attached = '<asset><model name="n" file="n.xml"/></asset>'
    body = '<worldbody><body><attach model="n" body="b" prefix="a"/></body></worldbody>'
    problem = with_element(tmp_path / "robot", attached + body)
    (tmp_path / "robot" / "n.xml").write_text(
        '<mujoco><worldbody><body name="b"><attach model="n" body="b" prefix="x"/></body>'
        "</worldbody></mujoco>"
    )
    refused(lambda: build_model(problem))


def png(width: int, height: int) -> bytes:
    """A picture of zeros that is small as a file."""
    rows = zlib.compress(bytes(min(height * (width + 1), 10**6)))
    parts = [
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)),
        (b"IDAT", rows),
        (b"IEND", b""),
    ]
    chunks = [struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in parts]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


@pytest.mark.parametrize(
    "element",
    [
        '<asset><texture name="t" type="2d" file="p.png"/></asset>',
        '<asset><hfield name="h" size="1 1 1 1" file="p.png"/></asset>',
    ],
)
def test_a_picture_that_unpacks_without_end_is_one_line(tmp_path: Path, element: str) -> None:
    problem = with_element(tmp_path / "robot", element)
    (tmp_path / "robot" / "p.png").write_bytes(png(100_000, 100_000))
    assert "pixels" in refused(lambda: build_model(problem))
    (tmp_path / "robot" / "p.png").write_bytes(png(64, 64))
    assert build_model(problem).nu == 2


def test_a_soft_body_of_a_large_mesh_is_one_line(tmp_path: Path) -> None:
    element = '<worldbody><flexcomp name="f" type="mesh" file="m.obj" dim="2" mass="1"/></worldbody>'
    problem = with_element(tmp_path / "robot", element)
    (tmp_path / "robot" / "m.obj").write_bytes(CUBE + 100_000 * b"v 0 0 1\n")
    assert "5000 elements" in refused(lambda: build_model(problem))


def test_a_mesh_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    problem = with_element(tmp_path / "robot", '<asset><mesh name="m" file="m.obj"/></asset>')
    with (tmp_path / "robot" / "m.obj").open("wb") as file:
        file.truncate(2**40)
    assert refused(lambda: build_model(problem)).endswith("found 1.049e+06 MiB; allowed: at most 64 MiB")


def test_what_mujoco_does_not_expect_is_one_line(tmp_path: Path) -> None:
    """MuJoCo itself raises a RuntimeError for this one."""
    problem = with_element(
        tmp_path / "robot", '<asset><mesh name="m" builtin="cone" params="-1000000000 1"/></asset>'
    )
    refused(lambda: build_model(problem))


def test_includes_that_nest_without_end_are_one_line(tmp_path: Path) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER)
    for index in range(400):
        (folder / f"i{index}").write_text(f'<mujocoinclude><include file="i{index + 1}"/></mujocoinclude>')
    edited(folder / "strider.xml", "<worldbody>", '<include file="i0"/><worldbody>')
    assert "allowed: 200" in refused(lambda: build_model(load_problem(folder)))


def test_many_includes_are_one_line(tmp_path: Path) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER)
    for index in range(300):
        (folder / f"i{index}").write_text("<mujocoinclude/>")
    includes = "".join(f'<include file="i{index}"/>' for index in range(300))
    edited(folder / "strider.xml", "<worldbody>", includes + "<worldbody>")
    assert "more than 200 includes" in refused(lambda: build_model(load_problem(folder)))


REAL = """
act accel actearly active actlimited actrange actuation actuator actuatorfrclimited actuatorfrcrange
actuatorgravcomp actuatorgroupdisable actuatorlength actuatornegative actuatorpositive actuatortendon
actuatorwidth adhesion align alignfree alpha ambient anchor angle area armature assetdir attenuation
autolimits autoreset axis axisangle azimuth balanceinertia bias biasprm biastype bindpos bindquat body body1
body2 boundinertia boundmass builtin bulbradius bv bvactive camera cameraid castshadow ccd_tolerance cell
center childclass clampctrl class coef cogging colorspace com conaffinity condim cone conflict connect
constraint contact contactforce contactfriction contactgap contactheight contactpoint contacttorque
contactwidth content_type contype controller coordinate crankbroken cranklength cranksite ctrl ctrllimited
ctrlrange cutoff damper damping dampratio data datatype delay density diagexact diaginertia diameter diffuse
dir directional discardvisual divisor dof dynprm dyntype edge elastic2d element elemtexcoord elevation
ellipsoidinertia embed emission enclosed energy equality euler eulerdamp eulerseq exponent extent face
ffrange file fileback filedown filefront fileleft fileright fileup filterparent fitaabb fitscale flatskin
flex fluidcoef fluidshape focal focalpixel fogend fogstart fog force forcelimited forcerange forcewidth fovy
fpmax frame framelength framewidth friction frictionloss fromto frustum fullinertia fuse fusestatic fvmax
fwdinv gain gainprm gaintype gap gear geom geom1 geom2 glow gravcomp gravity grid gridlayout gridrange
gridsize group haze hfield hflip id imax impratio inductance inertia inertiabox inertiafromgeom
inertiagrouprange inflate inheritrange input instance integrator intensity interp interval inttotal
invdiscrete ipc ipd island jacobian joint joint1 joint2 jointinparent jointlength jointwidth key ki kp kv
lengthrange light limit limited linewidth lmax lmin ls_tolerance lugre magnetic margin mark markrgb mass
material maxforce maxhullvert meaninertia meanmass meansize memory mesh meshdir metallic midphase mocap mode
model motorconst mpos mquat multiccd name nativeccd needstage node nodecoord noise nominal normal
noslip_tolerance o_friction o_margin o_solimp o_solref objname objtype orthographic output override origin
params passive passthrough plastic plugin point poisson polycoef pos posrange prefix principal
principalpixel priority prm projection qpos quat qvel radius random range rangefinder realtime reduce ref
reflectance refname refpos refquat refsafe refsite reftype relpose resistance rgb1 rgb2 rgba rigid role
roughness saturation savecanonical savecompiled saveinertial scale section sectionsize selectpoint
selfcollide sensor sensorsize settotalmass shadowclip shadowscale shear shellinertia shininess sidesite
simple site site1 site2 size sleep sleep_tolerance slewmax slidercrank slidersite smoothnormal softness
solimp solimpfriction solimplimit solmix solref solreffriction solreflimit solver spacing specular
speculative spring springdamper springlength springref springyield stiffness stiffnessrot strippath subtree1
subtree2 surfacevel target tausmooth tendon tendon1 tendon2 texcoord texrepeat texture texturedir texuniform
thermal thickness time timeconst timestep tolerance tolrange torque torquescale type uselimit useexisting
user usethread value velrange vertex vertid vertweight vflip viscosity vmax warmstart width wind xyaxes
yield young zaxis zfar znear activelayers
"""
"""Attributes of MuJoCo 4.0.0 that do not say how many of something there are, or are bounded otherwise.

Otherwise: by MuJoCo itself (``maxhullvert``, ``gridsize``, ``size`` of a numeric, ids), in `limits` by name
(``memory``, ``inttotal``, ``timestep``, ``params``, ``width`` of a texture), and lists by the file's size.
"""


def test_every_attribute_of_this_mujoco_was_considered() -> None:
    """Attributes of a new version must be added to `limits.COUNTS` or to the list above."""
    library = ctypes.CDLL(next(str(path) for path in Path(mujoco.__path__[0]).glob("libmujoco*.so*")))
    schema = ctypes.create_string_buffer(1_000_000)
    library.mj_printSchema.argtypes = [ctypes.c_char_p, ctypes.c_char_p, *3 * [ctypes.c_int]]
    assert library.mj_printSchema(None, schema, len(schema), 0, 0) > 10_000
    text = re.sub(r"(?m)^ *\S+ \([!?*R]\)", "", schema.value.decode())
    assert set(text.split()) - set(REAL.split()) - set(COUNTS) == set()
