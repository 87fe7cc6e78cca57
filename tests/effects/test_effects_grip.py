"""Grip that differs from pad to pad and from step to step: a sled, and a cart that presses a pad down."""

from __future__ import annotations

import itertools
import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import rigs
from helpers import same_bits
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.fit.hypotheses import hypotheses
from gaitopt.effects.parts import Parts
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator

Array = NDArray[np.float64]

G = 9.81
MU = 0.2
"""Coefficient of the cart's pad. It is pulled with 8 N and slides all the time."""

CART = f"""
<mujoco><option gravity="8 0 0" cone="elliptic" impratio="100"/><worldbody>
  <geom name="ground" type="plane" size="50 50 1" contype="0" conaffinity="1" friction="1"/>
  <body name="cart" pos="0 0 0.1">
    <joint name="along" type="slide" axis="1 0 0" damping="10"/>
    <inertial pos="0 0 0" mass="0.9" diaginertia="1e-3 1e-3 1e-3"/>
    <site name="nose"/>
    <body name="leg"><joint name="leg" type="slide" axis="0 0 -1" damping="40"/>
      <geom name="pad" type="box" size="0.01 0.01 0.01" pos="0 0 -0.08" mass="0.1" contype="1"
        conaffinity="0" priority="1" friction="{MU}"/></body>
  </body>
</worldbody>
<actuator><position name="turn" joint="leg" kp="2000" forcerange="-10 10"/></actuator>
<keyframe><key name="start"/></keyframe></mujoco>"""

STEP_S, DOWN_S = 0.2, 0.12
"""A step of the cart, and how long its pad is down in it, s."""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> rigs.Make:
    """Makes a problem of an MJCF."""
    numbers = itertools.count()

    def make(mjcf: str, **roles: object) -> Problem:
        folder: Path = tmp_path_factory.mktemp("grip") / str(next(numbers))
        return rigs.build(folder, mjcf, {"marker": "nose"} | roles, settle=mjcf is not CART)

    return make


def sled(rig: rigs.Make, gravity: str = f"0 0 {-G}", fore: float = 0.0) -> Problem:
    return rig(rigs.sled(gravity, fore=fore), pads=["front", "rear"])


def grips(cart: Problem, steps: int, lifted_s: float = STEP_S - DOWN_S) -> Array:
    """Let the cart step, and return its grip early and late in each step, shape (steps, 2).

    It is the force against its slip over its load.
    """
    simulator = Simulator.build(cart)
    time = simulator.clock(steps * STEP_S)
    into = np.mod(time + 1e-9, STEP_S)
    target = np.where(into < STEP_S - lifted_s, 0.05, 0.0)  # 0.05: well into the ground, so at full force
    path = simulator.play(time, target[:, None])
    assert path.status == "ok"
    into = np.mod(path.time + 1e-9, STEP_S)
    step = np.floor((path.time + 1e-9) / STEP_S).astype(int)
    found = []
    for begin, end in ((0.05, 0.085), (0.085, 0.12)):
        during = (into >= begin) & (into < end)
        resists, presses = (
            np.bincount(step[during], np.abs(path[f"load.pad.{axis}"][during]), steps) for axis in "xz"
        )
        found.append(resists / presses)
    return np.stack(found, axis=1)


# --- pad_imbalance ------------------------------------------------------------------------------


def test_the_first_pad_grips_more_by_the_ratio_and_the_mean_is_kept(rig: rigs.Make) -> None:
    for ratio in (0.5, 1.0, 2.5):
        model = Simulator.build(sled(rig).with_effects({"pad_imbalance": {"ratio": ratio}})).models[0]
        front, rear = (float(model.geom(name).friction[0]) for name in ("front", "rear"))
        assert front / rear == pytest.approx(ratio, rel=1e-12)
        assert 0.5 * (front + rear) == pytest.approx(0.2, rel=1e-12)


@pytest.mark.parametrize("ratio", [0.4, 2.5])
def test_a_sled_slides_beyond_what_its_unequal_pads_hold(rig: rigs.Make, ratio: float) -> None:
    """Loads are N (1 +- fore / 0.1) / 2: the pad that bears more counts more."""
    standing = rigs.hold(sled(rig, fore=0.05), 0.0, 0.3)
    loads = np.abs([standing["load.front.z"][-1], standing["load.rear.z"][-1]])
    factors = np.array([ratio, 1.0]) * 2.0 / (ratio + 1.0)
    holds = float(0.2 * factors @ loads)
    assert abs(holds - 0.2 * G) > 0.3
    for excess in (0.15, -0.15):
        problem = sled(rig, f"{holds + excess} 0 {-G}", fore=0.05)
        slid = rigs.hold(problem, 0.0, 0.8, pad_imbalance={"ratio": ratio})
        assert rigs.acceleration(slid, "x") == pytest.approx(max(0.0, excess), abs=0.03)


def test_an_imbalance_needs_two_pads(rig: rigs.Make) -> None:
    lame = rig(rigs.sled(), pads=["front"], body=["rear"]).with_effects({"pad_imbalance": {"ratio": 2.0}})
    with pytest.raises(GaitoptError, match=r"not applicable: the problem names one pad in roles\.pads"):
        Simulator.build(lame)


# --- grip_variation -----------------------------------------------------------------------------


@pytest.mark.parametrize("sd", [0.1, 0.3])
def test_the_grip_of_many_steps_has_the_stated_mean_and_spread(rig: rigs.Make, sd: float) -> None:
    count = 250
    found = grips(rig(CART, pads=["pad"]).with_effects({"grip_variation": {"relative_sd": sd}}), count)
    assert found[:, 1] == pytest.approx(found[:, 0], rel=1e-3), "within a step it stays"
    grip = found[:, 1] / MU
    assert grip.min() > 0.0
    assert grip.mean() == pytest.approx(1.0, abs=3.0 * sd / math.sqrt(count))
    assert grip.std() == pytest.approx(sd, rel=0.15)
    assert np.log(grip).std() == pytest.approx(math.sqrt(math.log1p(sd**2)), rel=0.15)
    assert abs(np.corrcoef(grip[:-1], grip[1:])[0, 1]) < 3.0 / math.sqrt(count), "no step knows the last one"


def test_without_it_every_step_grips_alike(rig: rigs.Make) -> None:
    assert grips(rig(CART, pads=["pad"]), 5) == pytest.approx(MU, rel=1e-3)


def test_a_pad_that_bounces_for_a_moment_makes_no_new_step(rig: rigs.Make) -> None:
    uneven = rig(CART, pads=["pad"]).with_effects({"grip_variation": {"relative_sd": 0.3}})
    bounced = grips(uneven, 10, lifted_s=0.01)
    assert bounced == pytest.approx(bounced[0, 0], rel=1e-3)


def test_each_pad_has_a_grip_of_its_own(rig: rigs.Make) -> None:
    """A sled stands on both: it slides beyond the mean of what the two have been given."""
    uneven = sled(rig).with_effects({"grip_variation": {"relative_sd": 0.4}})
    simulator = Simulator.build(uneven)
    model = simulator.models[0]
    update = simulator.effects.updates(model)[0]
    update.edit(np.full(model.nsensordata, -1.0))  # all loads: 1 N
    front, rear = (float(model.geom(name).friction[0]) for name in ("front", "rear"))
    assert abs(front - rear) > 0.01
    holds = 0.5 * (front + rear) * G
    for excess in (0.15, -0.15):
        problem = sled(rig, f"{holds + excess} 0 {-G}").with_effects(uneven.to_dict()["effects"])
        slid = rigs.hold(problem, 0.0, 0.8)
        assert rigs.acceleration(slid, "x") == pytest.approx(max(0.0, excess), abs=0.03)


def test_chance_is_the_same_in_every_run_and_on_every_worker(arcfold: Problem) -> None:
    uneven = arcfold.with_effects({"grip_variation": {"relative_sd": 0.3}})
    gait = uneven.baselines["square-0.5s"]
    one = Simulator.build(uneven).run(gait, duration=1.0)
    assert not same_bits(one, Simulator.build(arcfold).run(gait, duration=1.0))
    shared = Simulator.build(uneven)
    with ThreadPoolExecutor(2) as executor:
        for other in executor.map(lambda _: shared.run(gait, duration=1.0), range(3)):
            assert same_bits(one, other)


def test_factors_of_several_effects_on_one_pad_multiply(rig: rigs.Make) -> None:
    """Loops of grip, load and direction each have their own factor."""
    effects = {
        "pad_imbalance": {"ratio": 1.5},
        "grip_variation": {"relative_sd": 0.2},
        "friction_direction": {"ratio": 2.0},
        "friction_load": {"exponent": 0.3},
    }

    def grip(*names: str) -> float:
        problem = sled(rig, f"-0.5 0 {-G}", fore=0.08)
        simulator = Simulator.build(problem.with_effects({name: effects[name] for name in names}))
        model, sensed = simulator.models[0], []
        for update in simulator.effects.updates(model):
            state = np.tile([0.3, 0.0, -3.0], model.nsensordata)[: model.nsensordata]
            sensed.append(state)
            update.edit(state)
        return float(model.geom("front").friction[0]) / 0.2

    product = math.prod(grip(name) for name in effects)
    assert grip(*effects) == pytest.approx(product, rel=1e-9)
    assert abs(product - 1.0) > 0.05


def test_the_diagnosis_tries_both_without_a_target(nominal: Parts) -> None:
    tried = {h.name for h in hypotheses(nominal, nominal.channels, offset_known=False)}
    assert {"pad_imbalance", "grip_variation"} <= tried
