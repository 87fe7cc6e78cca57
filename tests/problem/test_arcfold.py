"""ArcFold has the specified parts and numbers."""

import re

import mujoco
import pytest

from gaitopt.problem.model import build_model
from gaitopt.problem.problem import Problem


@pytest.fixture(scope="module")
def model(arcfold: Problem) -> mujoco.MjModel:
    return build_model(arcfold)


def names(model: mujoco.MjModel, kind: str, count: int) -> list[str]:
    """Names of all elements of one kind."""
    return [getattr(model, kind)(i).name for i in range(count)]


def test_actuators_are_the_seeds_in_its_order(model: mujoco.MjModel) -> None:
    assert names(model, "actuator", model.nu) == ["mid_act", "foot1", "foot2"]
    assert [model.joint(i).name for i in model.actuator_trnid[:, 0]] == ["mid_left", "foot1", "foot2"]


def test_joints_keep_the_seeds_names(model: mujoco.MjModel) -> None:
    chains = {f"{part}_{side}" for part in ("first", "mid", "last") for side in ("left", "right")}
    hinges = [i for i in range(model.njnt) if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_HINGE]
    assert {model.joint(i).name for i in hinges} == chains | {"foot1", "foot2"}


def test_the_first_body_is_the_module_that_carries_foot1(model: mujoco.MjModel) -> None:
    assert model.body_parentid[model.body("foot1").id] == 1
    assert model.body_parentid[1] == 0


def test_ctrl_is_a_target_angle(model: mujoco.MjModel) -> None:
    """Position servos on joints, gear 1; a torque limit is the force range."""
    for i in range(model.nu):
        assert model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT
        assert model.actuator_gear[i].tolist() == [1, 0, 0, 0, 0, 0]
        gain = model.actuator_gainprm[i, 0]
        assert gain > 0.0
        assert model.actuator_biasprm[i, :2].tolist() == [0.0, -gain]
        assert not model.actuator_ctrllimited[i]
        assert model.actuator_forcelimited[i]
        low, high = model.actuator_forcerange[i]
        assert low == -high < 0.0


def test_friction_is_by_priority_and_not_by_pairs(model: mujoco.MjModel) -> None:
    assert model.npair == 0
    ground = model.geom("ground")
    touching = [i for i in range(model.ngeom) if model.geom_contype[i] and model.geom_bodyid[i] != 0]
    assert touching
    for i in touching:
        assert model.geom_priority[i] > ground.priority[0]


def test_pads_are_the_geoms_of_the_feet(arcfold: Problem, model: mujoco.MjModel) -> None:
    feet = {model.body("foot1").id, model.body("foot2").id}
    on_feet = [model.geom(i).name for i in range(model.ngeom) if model.geom_bodyid[i] in feet]
    assert sorted(arcfold.roles.pads) == sorted(on_feet)
    mu = arcfold.file.parameters["mu_tape"].value
    assert {model.geom(pad).friction[0] for pad in on_feet} == {mu}


def test_every_geom_that_may_touch_the_ground_has_a_role(arcfold: Problem, model: mujoco.MjModel) -> None:
    touching = {
        model.geom(i).name
        for i in range(model.ngeom)
        if model.geom_bodyid[i] != 0 and model.geom_contype[i] & model.geom("ground").conaffinity[0]
    }
    assert set(arcfold.roles.pads) | set(arcfold.roles.body) == touching


def test_the_marker_is_the_end_effector(arcfold: Problem, model: mujoco.MjModel) -> None:
    assert arcfold.roles.marker == "end_effector"
    assert model.site("end_effector").bodyid[0] > 0


def test_every_parameter_says_where_it_comes_from(arcfold: Problem) -> None:
    seeds = {"k_joint", "b_joint", "k_motor", "b_motor", "mu_tape", "mu_base", "mass"}
    assert seeds <= set(arcfold.file.parameters)
    for name, parameter in arcfold.file.parameters.items():
        assert re.match(r"(measured|datasheet|assumed)\b", parameter.origin), name
        assert parameter.unit, name


def test_every_gram_has_an_origin(arcfold: Problem, model: mujoco.MjModel) -> None:
    """The mass is the sum of the named masses, each as often as it is used, and nothing else."""
    total = model.body_mass.sum()
    masses = {n: p.value for n, p in arcfold.file.parameters.items() if p.unit == "kg"}
    budget = 0.0
    for name, value in masses.items():
        heavier = build_model(arcfold.with_parameters({name: value + 1e-3})).body_mass.sum()
        count = (heavier - total) / 1e-3
        assert count == pytest.approx(round(count), abs=1e-6)
        assert round(count) >= 1, name
        budget += round(count) * value
    assert budget == pytest.approx(total, rel=1e-9)
