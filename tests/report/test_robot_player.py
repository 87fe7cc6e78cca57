"""The robot on a page: its recorded poses, and what a browser makes of them."""

import base64
import io
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from browser import SOFTWARE_WEBGL, WITHOUT_WEBGL, Tab, browser_tab, needs_browser
from helpers import STRIDER
from numpy.typing import NDArray
from PIL import Image

from gaitopt.gait.gait import Channel, Gait
from gaitopt.problem.problem import load_problem
from gaitopt.report.film.encode import write_mp4
from gaitopt.report.film.section import film_part
from gaitopt.report.film.take import Take
from gaitopt.report.motion import player_part, shown_takes
from gaitopt.report.page import Page
from gaitopt.report.player.player import embedded_player
from gaitopt.report.player.shapes import Mesh, coarser, shapes_of
from gaitopt.report.rollouts import rollouts
from gaitopt.report.settings import PlayerSettings
from gaitopt.simulation.rollout import Simulator

KINDS = """<mujoco>
<asset><mesh name="wedge" vertex="0 0 0 1 0 0 0 1 0 0 0 1" scale=".05 .05 .05"/>
<texture name="t" type="2d" builtin="flat" rgb1="1 0.5 0" width="4" height="4"/>
<material name="painted" texture="t"/></asset>
<worldbody><geom type="plane" size="0 0 1"/><geom type="box" size=".02 .02 .02" pos=".2 0 .02"/>
<body pos="0 0 .05"><freejoint/>
<geom name="box" type="box" size=".05 .04 .01"/><geom name="ball" type="sphere" size=".02" pos="0 0 .03"/>
<geom name="capsule" type="capsule" size=".01 .04" pos="0 .06 0" rgba=".1 .2 .3 .5"/>
<geom name="cylinder" type="cylinder" size=".02 .01" pos="0 -.06 0"/>
<geom name="egg" type="ellipsoid" size=".03 .02 .01" pos=".07 0 0"/>
<geom name="wedge" type="mesh" mesh="wedge" pos="-.07 0 0" material="painted"/>
<geom name="unseen" type="sphere" size=".01" group="4"/></body></worldbody></mujoco>"""


def takes() -> list[Take]:
    problem = load_problem(STRIDER)
    simulator, gaits = Simulator.build(problem), problem.baselines
    return shown_takes(simulator, gaits, rollouts(simulator, gaits))


def page(shown: list[Take], **more: Any) -> str:
    part = player_part("The robot", "It walks.", shown, **more)
    assert not part.notes
    return str(Page(title="t", answer="a", asked={}, sections=part.sections).html())


def content(html: str) -> Any:
    return json.loads(re.findall(r'<script type="application/json">(.*?)</script>', html, re.DOTALL)[0])


def numbers(packed: Any, columns: int) -> NDArray[np.float64]:
    steps = np.frombuffer(base64.b64decode(packed["data"]), "<u2").reshape(-1, columns)
    return np.array(packed["low"]) + steps * np.array(packed["step"])


def test_the_poses_on_a_page_are_the_simulators() -> None:
    shown = takes()
    played = content(page(shown))
    for one, take in zip(shown, played["takes"], strict=True):
        bodies, count = played["robots"][take["robot"]]["bodies"], take["moments"]
        positions = numbers(take["positions"], 3).reshape(count, bodies, 3)
        turns = np.frombuffer(base64.b64decode(take["turns"]), "<i2").reshape(count, bodies, 4) / 32767
        times = take["begin_s"] + take["step_s"] * np.arange(count)
        assert 40.0 <= 1.0 / take["step_s"] <= 70.0
        assert times[-1] == pytest.approx(one.trajectory.time[-1], abs=take["step_s"])
        data = mujoco.MjData(one.model)
        for index, at in enumerate(times):
            (row,) = np.flatnonzero(np.isclose(one.trajectory.time, at, atol=1e-6))
            data.qpos[:] = one.poses[row]
            mujoco.mj_kinematics(one.model, data)
            step = np.array(take["positions"]["step"])
            assert (np.abs(positions[index] - data.xpos[1:]) <= 0.51 * step + 1e-12).all()
            aligned = np.abs(np.sum(turns[index] * data.xquat[1:], axis=1))
            assert aligned == pytest.approx(1.0, abs=1e-4)
        assert step.max() < 1e-5


def test_shapes_touch_when_the_simulation_counts_contacts() -> None:
    shown = takes()[0]
    take = content(page([shown]))["takes"][0]
    flags = np.frombuffer(base64.b64decode(take["touching"]), np.uint8).reshape(take["moments"], -1)
    rows = np.round(take["step_s"] * np.arange(take["moments"]) / 1e-3).astype(int)
    times = shown.trajectory.time
    counted = np.interp(rows * 1e-3, times, shown.trajectory["contacts"])
    assert np.mean((flags.sum(axis=1) > 0) == (counted > 0.5)) > 0.9
    assert len(np.unique(flags)) > 2


def test_every_kind_of_geom_is_drawn_with_its_colour() -> None:
    model = mujoco.MjModel.from_xml_string(KINDS)
    shapes = shapes_of(model, model.qpos0, PlayerSettings())
    kinds = [shape.kind for shape in shapes.shapes]
    assert kinds == ["plane", "box", "box", "sphere", "capsule", "cylinder", "ellipsoid", "mesh"]
    assert [shape.body for shape in shapes.shapes] == [-1, -1, 0, 0, 0, 0, 0, 0]
    colours = {shape.name: shape.colour for shape in shapes.shapes}
    assert colours["capsule"] == pytest.approx((0.1, 0.2, 0.3, 0.5))
    assert colours["wedge"] == pytest.approx((1.0, 0.5, 0.0, 1.0), abs=0.01)
    assert "unseen" not in colours


def test_a_mesh_with_too_many_faces_becomes_coarser_and_keeps_its_size() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    rings = np.array([[np.cos(a) * r, np.sin(a) * r, r] for r in np.linspace(0.1, 1.0, 50) for a in angles])
    first = np.arange(49 * 400)
    mesh = Mesh(rings, np.stack([first, first + 1, first + 400], axis=1))
    small = coarser(mesh, 20)
    assert small.size < 0.1 * mesh.size
    assert np.ptp(small.corners, axis=0) == pytest.approx(np.ptp(mesh.corners, axis=0), rel=0.1)
    assert small.faces.max() < len(small.corners)


def test_a_long_motion_is_kept_within_the_bytes() -> None:
    shown = takes()
    settings = PlayerSettings(pose_bytes=2000)
    played = json.loads(embedded_player(shown, settings).json)
    used = sum(len(base64.b64decode(one[k]["data"] if k == "positions" else one[k]))
               for one in played["takes"] for k in ("positions", "turns"))  # fmt: skip
    assert 1000 < used <= 2200


def test_names_cannot_leave_the_script() -> None:
    shown = replace(takes()[0], name="</script><b>x")
    html = page([shown])
    assert "</script><b>" not in html
    assert content(html)["takes"][0]["name"] == "</script><b>x"


@pytest.fixture(scope="module")
def tab() -> Iterator[Tab]:
    with browser_tab(*SOFTWARE_WEBGL) as opened:
        yield opened


CANVAS = "document.querySelector('.player canvas').toDataURL()"
STILL = {"prefers_reduced_motion": "reduce"}


def slide(tab: Tab, at: float) -> str:
    """The picture after the slider was moved to a time, s."""
    tab.value(
        "(() => { const slider = document.querySelector('[data-part=time]');"
        f"slider.value = {at}; slider.dispatchEvent(new Event('input')) }})()"
    )
    tab.settled()
    return str(tab.value(CANVAS))


def picture(address: str) -> NDArray[np.float64]:
    """The pixels of a picture in a page, shape (height, width, 3)."""
    data = base64.b64decode(address.partition(",")[2])
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=float)


def click(tab: Tab, chosen: str) -> str:
    """The picture after a control was clicked."""
    tab.value(f"document.querySelector({f'.player {chosen}'!r}).click()")
    tab.settled()
    return str(tab.value(CANVAS))


@pytest.mark.slow
@needs_browser
def test_the_player_draws_the_robot_and_follows_the_slider(tab: Tab, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    html = page(takes())
    path.write_text(html)
    tab.opened(path, **STILL)
    first, later = slide(tab, 0.0), slide(tab, 0.7)
    assert first != later == slide(tab, 0.7)
    assert slide(tab, 0.0) == first
    assert "0.00 s of" in tab.value("document.querySelector('[data-part=clock]').textContent")
    assert tab.messages == []


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("name", ["arcfold", "quadruped", "snake", "servo-bench"])
def test_every_bundled_robot_is_drawn(name: str, tab: Tab, tmp_path: Path) -> None:
    problem, path = load_problem(name), tmp_path / "page.html"
    channel = Channel(duty=0.5, phase=0.0, amplitude_deg=20.0, offset_deg=0.0)
    moves = Gait(1.0, dict.fromkeys(problem.channel_names, channel), "moves")
    simulator = Simulator.build(problem)
    trajectory = simulator.run(moves, duration=0.5, poses=True)
    html = page(shown_takes(simulator, {"moves": moves}, {"moves": trajectory}))
    played = content(html)
    for robot in played["robots"]:
        for shape in robot["shapes"]:
            if shape["body"] >= 0:
                shape["colour"] = [0.0, 0.0, 0.0, 0.0]
    pictures = []
    for text in (html, html.replace(json.dumps(content(html)), json.dumps(played))):
        path.write_text(text)
        tab.opened(path, **STILL)
        pictures.append(picture(slide(tab, 0.3)))
    different = np.abs(pictures[0] - pictures[1]).max(axis=2) > 20
    assert 0.004 < different.mean() < 0.6
    assert np.ptp(np.flatnonzero(different.any(axis=0))) < 0.95 * different.shape[1]
    assert tab.messages == []


@pytest.mark.slow
@needs_browser
def test_the_player_turns_zooms_steps_and_shows_two_gaits(tab: Tab, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    path.write_text(page(takes()))
    tab.opened(path, **STILL)
    seen = {"": slide(tab, 0.2)}
    controls = ("[data-part=trail]", "[data-part=near]", "[data-part=on]", "[data-view=above]")
    for control in (*controls, "[data-part=follow]", "[data-part=beside]"):
        seen[control] = click(tab, control)
    for key in ("ArrowLeft", "ArrowDown", "-", "."):
        tab.value(
            f"document.querySelector('canvas').dispatchEvent(new KeyboardEvent('keydown', {{key: '{key}'}}))"
        )
        tab.settled()
        seen[key] = str(tab.value(CANVAS))
    same = [(one, other) for one in seen for other in seen if one < other and seen[one] == seen[other]]
    assert not same
    assert tab.messages == []


@pytest.mark.slow
@needs_browser
def test_the_player_plays_by_itself_unless_motion_is_to_be_reduced(tab: Tab, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    path.write_text(page(takes()))
    button = "document.querySelector('[data-part=play]').textContent"
    tab.opened(path, **STILL)
    tab.settled()
    assert tab.value(button) == "Play"
    tab.opened(path, prefers_reduced_motion="no-preference")
    tab.settled()
    assert tab.value(button) == "Pause"
    click(tab, '[data-speed="0.1"]')
    assert tab.value("document.querySelector('[aria-pressed=true]').dataset.speed") == "0.1"
    click(tab, "[data-part=play]")
    assert tab.value(button) == "Play"


@pytest.mark.slow
@needs_browser
def test_the_player_draws_once_a_picture_and_outlives_a_lost_context(tab: Tab, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    path.write_text(page(takes()))
    tab.opened(path, prefers_reduced_motion="no-preference")
    tab.settled()
    asked = tab.value(
        "new Promise(done => {"
        "  const real = requestAnimationFrame, play = document.querySelector('[data-part=play]');"
        "  for (let n = 0; n < 6; n++) play.click();"
        "  let asked = 0, frames = 0;"
        "  window.requestAnimationFrame = f => { asked++; return real(f); };"
        "  const count = () => { if (frames++ < 10) real(count); else done(asked); };"
        "  real(count);"
        "})"
    )
    assert 5 <= asked <= 12
    before = tab.value("document.querySelector('[data-part=clock]').textContent")
    tab.value(
        "new Promise(done => {"
        "  const canvas = document.querySelector('canvas');"
        "  const lost = canvas.getContext('webgl2').getExtension('WEBGL_lose_context');"
        "  canvas.addEventListener('webglcontextlost', () => setTimeout(() => lost.restoreContext(), 200));"
        "  canvas.addEventListener('webglcontextrestored', () => setTimeout(done, 300));"
        "  lost.loseContext();"
        "})"
    )
    assert tab.value("document.querySelector('[data-part=clock]').textContent") != before
    assert tab.messages == []


@pytest.mark.slow
@needs_browser
def test_a_browser_without_webgl_says_so_and_shows_the_film(tmp_path: Path) -> None:
    film = film_part(tmp_path, "walk", "Film", "It walks.", lambda path: write_mp4(path, fading(), 25.0))
    assert not film.notes
    path = tmp_path / "page.html"
    sections = [*player_part("The robot", "It walks.", takes()).sections, *film.sections]
    path.write_text(Page(title="t", answer="a", asked={}, sections=sections).html())
    said = "document.querySelector('.player').innerText"
    with browser_tab(*WITHOUT_WEBGL) as tab:
        tab.opened(path)
        assert "shows no WebGL graphics" in tab.value(said)
        assert "film on this page" in tab.value(said)
        assert tab.value("document.querySelector('.player canvas').offsetHeight") == 0
        assert tab.value("document.querySelector('.film video').videoWidth") == 64


@pytest.mark.slow
@needs_browser
def test_a_film_is_slowed_to_a_tenth_and_stepped(tab: Tab, tmp_path: Path) -> None:
    film = film_part(tmp_path, "walk", "Film", "It walks.", lambda path: write_mp4(path, fading(), 25.0))
    path = tmp_path / "page.html"
    path.write_text(Page(title="t", answer="a", asked={}, sections=film.sections).html())
    tab.opened(path)
    video = "document.querySelector('video')"
    tab.value("document.querySelector('[data-rate=\"0.1\"]').click()")
    assert tab.value(f"{video}.playbackRate") == 0.1
    shown = []
    for button in ("1", "1", "-1"):
        tab.value(
            f"new Promise(done => {{ {video}.addEventListener('seeked', done, {{once: true}});"
            f"document.querySelector('[data-frames=\"{button}\"]').click() }})"
        )
        shown.append(tab.value(f"[{video}.currentTime, {video}.paused]"))
    assert [round(25.0 * at - 0.5, 3) for at, _ in shown] == [1.0, 2.0, 1.0]
    assert all(paused for _, paused in shown)
    assert tab.messages == []


def fading() -> Iterator[Image.Image]:
    """Pictures of a film of one second."""
    return (Image.new("RGB", (64, 36), (10 * step, 0, 0)) for step in range(25))
