"""Each effect of contact, slope, mass and shape in a case with a known answer: a sled on runners, an arm."""

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rigs

from gaitopt.core.errors import GaitoptError
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator

G = 9.81
FRICTIONLESS = 'condim="1"'
ROLES = {"marker": "nose", "pads": ["front", "rear"]}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> rigs.Make:
    """Makes a problem of an MJCF."""
    numbers = itertools.count()

    def make(mjcf: str, **roles: object) -> Problem:
        folder: Path = tmp_path_factory.mktemp("sled") / str(next(numbers))
        return rigs.build(folder, mjcf, ROLES | roles)

    return make


# --- outside forces and masses ------------------------------------------------------------------


def test_a_slope_of_2_degrees_pulls_back_with_g_sin_2(rig: rigs.Make) -> None:
    slope = {"angle_rad": math.radians(2.0)}
    problem = rig(rigs.sled(contact=FRICTIONLESS))
    slid = rigs.hold(problem, 0.0, 1.0, ground_slope=slope)
    assert rigs.acceleration(slid, "x") == pytest.approx(-G * math.sin(slope["angle_rad"]), rel=1e-5)
    across = rigs.hold(rig(rigs.sled(contact=FRICTIONLESS), forward=[0, 1, 0]), 0.0, 1.0, ground_slope=slope)
    assert rigs.acceleration(across, "y") == pytest.approx(-G * math.sin(slope["angle_rad"]), rel=1e-5)


def test_a_tether_pulls_back_with_its_force_over_the_mass(rig: rigs.Make) -> None:
    pulled = rigs.hold(rig(rigs.sled(contact=FRICTIONLESS)), 0.0, 1.0, tether_drag={"force_n": 0.3})
    assert rigs.acceleration(pulled, "x") == pytest.approx(-0.3, rel=1e-5)
    assert pulled["torque.turn"] == pytest.approx(0.0, abs=1e-9)


def test_a_payload_weighs_on_the_ground(rig: rigs.Make) -> None:
    laden = rigs.hold(rig(rigs.sled()), 0.0, 0.5, payload_mass={"mass_kg": 0.25})
    load = abs(laden["load.front.z"][-1]) + abs(laden["load.rear.z"][-1])
    assert load == pytest.approx(1.25 * G, rel=1e-4)


def test_a_shift_of_the_centre_of_mass_shifts_the_load(rig: rigs.Make) -> None:
    for offset in (0.03, -0.05):
        shifted = rigs.hold(rig(rigs.sled()), 0.0, 0.5, com_offset={"offset_m": offset})
        front, rear = abs(shifted["load.front.z"][-1]), abs(shifted["load.rear.z"][-1])
        lever = 0.1 * (front - rear) / (front + rear)
        assert lever == pytest.approx(offset, abs=1.1e-2), "runners are 20 mm long: the load may move in them"
        assert front + rear == pytest.approx(G, rel=1e-4)


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """An arm without gravity or damping; inertia about its axis 1e-3 + 0.1 * 0.1^2 kg m^2."""
    folder = tmp_path_factory.mktemp("arm") / "arm"
    return rigs.build(folder, rigs.arm(gravity=0.0, damping=0.0, armature=0.0), {"marker": "tip"})


def test_inertia_about_the_centre_of_mass_is_scaled(arm: Problem) -> None:
    for scale in (0.5, 3.0):
        begun = rigs.hold(arm, 1e3, 0.02, link_inertia={"scale": scale})
        assert begun["rate.turn"][-1] == pytest.approx(0.5 / (1e-3 * scale + 1e-3) * 0.02, rel=1e-6)


def test_geometry_scales_lengths_and_inertia_but_not_masses(arm: Problem) -> None:
    for scale in (0.8, 1.5):
        effect = {"geometry_scale": {"scale": scale}}
        begun = rigs.hold(arm, 1e3, 0.02, **effect)
        assert begun["rate.turn"][-1] == pytest.approx(0.5 / (2e-3 * scale**2) * 0.02, rel=1e-6)
        assert begun["marker.x"][0] == pytest.approx(0.1 * scale)
        model = Simulator.build(arm.with_effects(effect)).models[0]
        assert model.body_mass[1] == pytest.approx(0.1)
        assert model.geom("tip").size[0] == pytest.approx(0.005 * scale)


def test_a_scaled_robot_still_rests_on_the_ground(rig: rigs.Make) -> None:
    grown = rigs.hold(rig(rigs.sled()), 0.0, 0.5, geometry_scale={"scale": 1.2})
    assert grown["marker.z"][0] == pytest.approx(0.012, abs=1e-4)
    assert np.ptp(grown["marker.z"]) < 1e-6


# --- friction -----------------------------------------------------------------------------------

AHEAD, BACK, ASIDE = (1, 0), (-1, 0), (0, 1)
"""Directions in which gravity also pulls: forward, backward, to the left."""

EXCESS = 0.15
"""Pull beyond friction, m/s^2: a sled of MuJoCo's that slides faster lifts off its contacts and chatters."""


def slides_beyond(rig: rigs.Make, direction: tuple[int, int], coefficient: float, **effects: Any) -> None:
    """Check that the sled, of coefficient 0.2, slides at a pull beyond this one and sticks below it."""
    roles = {"pads": effects.pop("pads", ["front", "rear"]), "body": effects.pop("body", [])}
    forward = effects.pop("forward", [1, 0, 0])
    within = 0.06 if "friction_load" in effects else 0.02  # m/s^2; power of a force that chatters
    axis = "x" if direction[0] else "y"
    sign = sum(direction)
    for excess in (EXCESS, -EXCESS):
        pull = coefficient * G + excess
        gravity = f"{pull * direction[0]} {pull * direction[1]} {-G}"
        problem = rig(rigs.sled(gravity), forward=forward, **roles)
        slid = sign * rigs.acceleration(rigs.hold(problem, 0.0, 0.8, **effects), axis)
        assert slid == pytest.approx(max(0.0, excess), abs=within)


@pytest.mark.parametrize(("role", "name"), [("pads", "pad_friction"), ("body", "body_friction")])
def test_friction_is_scaled_by_role(rig: rigs.Make, role: str, name: str) -> None:
    roles: dict[str, list[str]] = {"pads": [], "body": []} | {role: ["front", "rear"]}
    for scale in (0.5, 1.5):
        slides_beyond(rig, AHEAD, 0.2 * scale, **roles, **{name: {"scale": scale}})


def test_friction_of_one_role_leaves_the_other_alone(rig: rigs.Make) -> None:
    slides_beyond(rig, AHEAD, 0.15, pads=["front"], body=["rear"], pad_friction={"scale": 0.5})


def test_anisotropy_scales_the_sideways_coefficient_alone(rig: rigs.Make) -> None:
    effect = {"friction_anisotropy": {"ratio": 1.6}}
    slides_beyond(rig, AHEAD, 0.2, **effect)
    slides_beyond(rig, ASIDE, 0.32, **effect)
    slides_beyond(rig, ASIDE, 0.2, forward=[0, 1, 0], **effect)
    slides_beyond(rig, AHEAD, 0.32, forward=[0, 1, 0], **effect)


def test_anisotropy_goes_with_the_other_friction_effects(rig: rigs.Make) -> None:
    effects = {"friction_anisotropy": {"ratio": 1.5}, "pad_friction": {"scale": 0.5}}
    slides_beyond(rig, ASIDE, 0.15, **effects)
    slides_beyond(rig, BACK, 0.2, **effects, friction_direction={"ratio": 2.0})


def test_anisotropy_near_one_is_the_nominal_contact(arcfold: Problem) -> None:
    gait = arcfold.baselines["square-1s"]
    nominal = Simulator.build(arcfold).run(gait, duration=0.5)
    close = arcfold.with_effects({"friction_anisotropy": {"ratio": 1.0 + 1e-9}})
    assert Simulator.build(close).run(gait, duration=0.5)["marker.x"] == pytest.approx(
        nominal["marker.x"], abs=1e-6
    )


def test_anisotropy_needs_a_forward_along_an_axis(rig: rigs.Make) -> None:
    oblique = rig(rigs.sled(), forward=[1, 1, 0]).with_effects({"friction_anisotropy": {"ratio": 2.0}})
    with pytest.raises(GaitoptError, match="not applicable: forward is not along a world axis"):
        Simulator.build(oblique)


def test_direction_scales_the_coefficient_against_backward_slip_alone(rig: rigs.Make) -> None:
    for ratio in (0.5, 1.5):
        slides_beyond(rig, BACK, 0.2 * ratio, friction_direction={"ratio": ratio})
    slides_beyond(rig, AHEAD, 0.2, friction_direction={"ratio": 1.5})
    slides_beyond(rig, ASIDE, 0.2, friction_direction={"ratio": 1.5})


def test_load_lowers_the_coefficient_of_the_loaded_and_raises_the_other(rig: rigs.Make) -> None:
    """Loads n times the mean give friction mu N n^(-e): unequal ones together less than mu W."""
    standing = rigs.hold(rig(rigs.sled(fore=0.08)), 0.0, 0.3)
    loads = np.abs([standing["load.front.z"][-1], standing["load.rear.z"][-1]])
    assert loads.max() > 3.0 * loads.min()
    friction = 0.2 * float(np.sum(loads * (loads / (0.5 * G)) ** -0.5))
    assert friction < 0.95 * 0.2 * G
    for excess in (EXCESS, -EXCESS):
        problem = rig(rigs.sled(f"{friction + excess} 0 -9.81", fore=0.08))
        slid = rigs.hold(problem, 0.0, 0.8, friction_load={"exponent": 0.5})
        assert rigs.acceleration(slid, "x") == pytest.approx(max(0.0, excess), abs=0.06)


def test_load_changes_nothing_where_loads_are_alike(rig: rigs.Make) -> None:
    slides_beyond(rig, AHEAD, 0.2, friction_load={"exponent": 0.8})


def test_compliance_sinks_with_the_square_of_the_time_constant(rig: rigs.Make) -> None:
    problem = rig(rigs.sled(contact='condim="3" solref="0.02 1" solimp="0.9 0.9 0.001 0.5 2"'))
    depths = [
        -rigs.hold(problem, 0.0, 0.2, contact_compliance={"scale": scale})["depth"][-1] for scale in (1, 2, 3)
    ]
    assert depths[1:] / depths[0] == pytest.approx([4.0, 9.0], rel=1e-2)
