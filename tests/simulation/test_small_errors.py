"""Robots with small errors: what is drawn, and what it does to a model."""

import copy
import math
from dataclasses import fields

import mujoco
import numpy as np
import pytest

from gaitopt.core.streams import seeded
from gaitopt.effects import EFFECTS
from gaitopt.effects.parts import Parts
from gaitopt.problem.model import nominal_parts
from gaitopt.problem.problem import Problem
from gaitopt.problem.tolerances import Tolerances
from gaitopt.simulation.tolerances import SmallErrors, apply_errors, draw_errors, draw_measurement


def exact(**sizes: float) -> Tolerances:
    """Tolerances of which all are 0 but those given."""
    return Tolerances(**dict.fromkeys(Tolerances.model_fields, 0.0) | sizes)


def edited(problem: Problem, errors: SmallErrors) -> tuple[mujoco.MjModel, mujoco.MjModel]:
    """The nominal model, and the same with errors."""
    parts = nominal_parts(problem)
    model = copy.copy(parts.model)
    apply_errors(Parts(model, parts.roles, parts.channels), errors)
    return parts.model, model


def values(errors: SmallErrors, name: str) -> np.ndarray:
    return np.atleast_1d(getattr(errors, name))


def test_every_part_has_an_error_of_its_own(arcfold: Problem) -> None:
    parts = nominal_parts(arcfold)
    errors = draw_errors(parts, arcfold.file.tolerances, seeded(1))
    counts = {field.name: len(set(values(errors, field.name).tolist())) for field in fields(errors)}
    assert counts == {
        "friction": 15,
        "servo_strength": 3,
        "servo_gain": 3,
        "servo_damping": 3,
        "servo_trim_rad": 3,
        "mass": parts.model.nbody,
        "hinge_stiffness": 6,
        "slope_rad": 2,
    }


@pytest.mark.parametrize(
    ("key", "name", "unit"),
    [
        ("friction", "friction", 1.0),
        ("friction_each", "friction", 1.0),
        ("servo_strength", "servo_strength", 1.0),
        ("servo_strength_each", "servo_strength", 1.0),
        ("servo_gain_each", "servo_gain", 1.0),
        ("servo_damping_each", "servo_damping", 1.0),
        ("servo_trim_deg", "servo_trim_rad", math.pi / 180.0),
        ("mass_each", "mass", 1.0),
        ("hinge_stiffness_each", "hinge_stiffness", 1.0),
        ("slope_deg", "slope_rad", math.pi / 180.0),
    ],
)
def test_a_tolerance_is_the_standard_deviation_of_its_error_alone(
    arcfold: Problem, key: str, name: str, unit: float
) -> None:
    parts, rng = nominal_parts(arcfold), seeded(2)
    drawn = [draw_errors(parts, exact(**{key: 0.1}), rng) for _ in range(1500)]
    of_all = np.array([values(errors, name) for errors in drawn])
    middle = 0.0 if name.endswith("_rad") else 1.0
    assert np.std(of_all, axis=0) == pytest.approx(0.1 * unit, rel=0.06)
    assert np.abs(of_all - middle).max() <= math.sqrt(3.0) * 0.1 * unit + 1e-12
    for other in fields(SmallErrors):
        if other.name != name:
            assert np.ptp([values(errors, other.name) for errors in drawn]) == 0.0


def test_an_error_does_not_depend_on_the_size_of_another(arcfold: Problem) -> None:
    parts = nominal_parts(arcfold)
    usual = draw_errors(parts, Tolerances(), seeded(3))
    rough = draw_errors(parts, Tolerances(friction=0.3, servo_gain_each=0.0), seeded(3))
    assert rough.hinge_stiffness == usual.hinge_stiffness
    assert rough.servo_trim_rad == usual.servo_trim_rad


def test_errors_of_size_0_leave_the_model_as_it_is(strider: Problem) -> None:
    nominal, model = edited(strider, draw_errors(nominal_parts(strider), exact(), seeded(4)))
    for name in ("geom_friction", "actuator_forcerange", "body_mass", "jnt_stiffness", "dof_damping"):
        assert getattr(model, name).tolist() == getattr(nominal, name).tolist()
    assert model.opt.gravity.tolist() == nominal.opt.gravity.tolist()


def test_each_error_changes_its_own_part(arcfold: Problem) -> None:
    parts = nominal_parts(arcfold)
    bodies = tuple(1.0 + 0.01 * i for i in range(parts.model.nbody))
    errors = SmallErrors(
        friction=(0.9, *(1.0,) * 14),
        servo_strength=(1.0, 0.8, 1.0),
        servo_gain=(1.0, 1.0, 1.1),
        servo_damping=(1.2, 1.0, 1.0),
        mass=bodies,
        hinge_stiffness=(1.0, 1.0, 1.3, 1.0, 1.0, 1.0),
    )
    nominal, model = edited(arcfold, errors)
    changed = np.flatnonzero((model.geom_friction != nominal.geom_friction).any(axis=1))
    assert [model.geom(i).name for i in changed] == ["foot1_pad"]
    np.testing.assert_array_equal(
        model.actuator_forcerange, nominal.actuator_forcerange * [[1.0], [0.8], [1.0]]
    )
    np.testing.assert_allclose(model.actuator_gainprm[:, 0] / nominal.actuator_gainprm[:, 0], [1.0, 1.0, 1.1])
    np.testing.assert_allclose(model.body_mass, nominal.body_mass * bodies)
    np.testing.assert_allclose(model.body_inertia, nominal.body_inertia * np.array(bodies)[:, None])
    stiffened = np.flatnonzero(model.jnt_stiffness != nominal.jnt_stiffness)
    assert [model.joint(i).name for i in stiffened] == ["last_left"]
    damped = np.flatnonzero(model.dof_damping != nominal.dof_damping)
    assert damped.tolist() == [parts.servo_dofs[0]]


def test_a_slope_tilts_gravity_as_the_effect_does(arcfold: Problem) -> None:
    nominal, model = edited(arcfold, SmallErrors(slope_rad=(0.02, 0.0)))
    sloped, edit = copy.copy(nominal), EFFECTS["ground_slope"].model
    assert edit is not None
    edit(Parts(sloped, arcfold.roles, arcfold.channel_names), 0.02, 0.0)
    np.testing.assert_allclose(model.opt.gravity, sloped.opt.gravity, atol=1e-15)


def test_a_slope_to_the_left_pulls_to_the_right(arcfold: Problem) -> None:
    _, model = edited(arcfold, SmallErrors(slope_rad=(0.0, 0.02)))
    left = arcfold.roles.axes[1]
    assert model.opt.gravity @ left == pytest.approx(-9.81 * math.sin(0.02))


def test_errors_of_camera_and_clock_are_effects_of_the_measurement() -> None:
    tolerances = Tolerances(camera_tilt_deg=1.0)
    rng = seeded(5)
    drawn = [draw_measurement(tolerances, rng) for _ in range(1500)]
    assert not any(one.effect.changes_robot for one in drawn[0])
    names = [one.effect.name for one in drawn[0]]
    assert names == ["camera_scale", "camera_tilt", "clock_offset", "clock_rate"]
    of_all = np.array([[one.value for one in row] for row in drawn])
    np.testing.assert_allclose(np.std(of_all, axis=0), [0.006, math.pi / 180.0, 0.01, 0.0006], rtol=0.06)
    np.testing.assert_allclose(np.mean(of_all, axis=0), [1.0, 0.0, 0.0, 1.0], atol=2e-3)
