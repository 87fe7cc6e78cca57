"""The library of effects as a whole: its table, and its neutral values."""

import math
import pickle

import numpy as np
import pytest
from effect_values import ALL, ELSEWHERE, HERE, asked
from helpers import same_bits

from gaitopt.diagnose.fit.hypotheses import hypotheses
from gaitopt.effects import EFFECTS, Effect
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior
from gaitopt.effects.rows import effect_rows
from gaitopt.problem.problem import Problem
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator

CONTRACT = """
servo_torque_limit limit_n_m; servo_speed_limit limit_rad_s; servo_gain scale; servo_damping scale;
servo_inertia armature_kg_m2; servo_deadband half_width_rad; servo_backlash half_width_rad;
servo_travel gain; servo_trim offset_rad; servo_sag share_lost; command_latency delay_s;
channel_timing delay_s; hinge_stiffness scale; hinge_nonlinearity cubic_n_m_rad3; hinge_damping scale;
hinge_friction torque_n_m; hinge_hysteresis yield_n_m; hinge_asymmetry ratio; pad_friction scale;
body_friction scale; friction_anisotropy ratio; friction_direction ratio; friction_load exponent;
contact_compliance scale; ground_slope angle_rad; payload_mass mass_kg; com_offset offset_m;
link_inertia scale; geometry_scale scale; tether_drag force_n; camera_scale scale; camera_tilt angle_rad;
clock_offset offset_s; clock_rate rate; clock_rounding grid_s; marker_outliers share;
servo_lag time_constant_s; servo_resolution step_rad; command_jitter sd_s; servo_friction torque_n_m;
servo_friction_load share; servo_stiction torque_n_m; pad_imbalance ratio; grip_variation relative_sd
"""


def test_the_library_has_the_contract_s_effects() -> None:
    """It may have more: a new effect needs no line here."""
    rows = dict(row.split() for row in CONTRACT.replace("\n", " ").strip().split(";"))
    assert {name: EFFECTS[name].parameter for name in rows} == rows


@pytest.mark.parametrize("effect", ALL)
def test_every_effect_has_an_implementation_a_unit_and_a_source(effect: Effect, nominal: Parts) -> None:
    hooks = [effect.structure, effect.model, effect.commands, effect.loop, effect.observe]
    assert any(hook is not None for hook in hooks)
    suffix = {"N m": "_n_m", "rad/s": "_rad_s", "rad": "_rad", "s": "_s", "m": "_m", "kg": "_kg", "N": "_n"}
    suffix |= {"kg m^2": "_kg_m2", "N m/rad^3": "_n_m_rad3"}
    assert effect.parameter.endswith(suffix.get(effect.unit, ""))
    assert len(effect.prior.source) > 20
    low, high = effect.bounds(nominal)
    assert low < high
    assert effect.allows(high)
    assert effect.allows(low) or low == 0.0
    assert effect.allows(effect.neutral_value(nominal))
    assert effect.scale == "lin" or low > 0.0
    assert effect.why_not(nominal) is None


def test_all_but_a_few_apply_to_arcfold(nominal: Parts) -> None:
    assert {name for name, effect in EFFECTS.items() if effect.why_not(nominal)} == set(ELSEWHERE)


@pytest.mark.parametrize("effect", ALL)
def test_a_plausible_value_has_a_prior_and_an_absurd_one_less(effect: Effect, nominal: Parts) -> None:
    low, high = effect.bounds(nominal)
    middle = math.sqrt(low * high) if effect.scale == "log" else 0.5 * (low + high)
    assert -50.0 < effect.log_prior(middle, nominal) <= 0.0
    assert effect.log_prior(high * 1e3, nominal) < effect.log_prior(middle, nominal)
    if effect.prior.kind != "normal":
        assert effect.log_prior(-high, nominal) == -math.inf


def test_an_effect_is_one_record_and_one_registration(
    arcfold: Problem, nominal: Parts, reference: Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Registered, it is switched on by a problem file, listed, tried by the diagnosis and simulated."""

    def loosen(parts: Parts, scale: float, _: float) -> None:
        parts.model.jnt_stiffness[parts.hinges] *= scale

    added = Effect(
        name="hinge_wear",
        summary="what wear leaves of the hinges' stiffness",
        parameter="scale",
        unit="",
        neutral=1.0,
        low=0.2,
        high=1.0,
        scale="log",
        prior=Prior("log-normal", 1.0, 0.4, "a throw-away effect of this test"),
        allowed=(0.0, math.inf),
        role="hinges",
        model=loosen,
    )
    monkeypatch.setitem(EFFECTS, added.name, added)
    assert [row.name for row in effect_rows(nominal) if row.applies][-1] == added.name
    tried = hypotheses(nominal, arcfold.channel_names, offset_known=True)
    assert added.name in {hypothesis.effect.name for hypothesis in tried}
    problem = arcfold.with_effects({added.name: {"scale": 0.3}})
    assert problem.to_dict()["effects"] == {added.name: {"scale": 0.3}}
    run = Simulator.build(problem).run(problem.baselines["square-1s"], duration=0.6)
    assert not np.array_equal(run["marker.x"], reference["marker.x"])
    assert pickle.loads(pickle.dumps(added)) is added


def test_the_diagnosis_asks_an_effect_and_no_list(nominal: Parts) -> None:
    """A value that the recording gives is not fitted; a shift of the start only if the start is known."""
    tried = {
        known: {h.effect for h in hypotheses(nominal, nominal.channels, known)} for known in (True, False)
    }
    in_record = {effect.name for effect in EFFECTS.values() if effect.found_in_record}
    assert in_record == {"clock_rounding", "marker_outliers"}
    assert {effect.name for effect in HERE} - {e.name for e in tried[True]} == in_record
    assert {e.name for e in tried[True] - tried[False]} == {"clock_offset"}
    needs_start = {effect.name for effect in EFFECTS.values() if effect.needs_known_start}
    assert needs_start == {"command_latency", "clock_offset", "clock_rate"}


# --- neutral ------------------------------------------------------------------------------------


@pytest.mark.parametrize("effect", ALL)
def test_a_neutral_value_changes_no_bit(
    effect: Effect, arcfold: Problem, nominal: Parts, reference: Trajectory
) -> None:
    problem = arcfold.with_effects(asked(effect, effect.neutral_value(nominal)))
    simulator = Simulator.build(problem)
    trajectory = simulator.run(problem.baselines["square-1s"], duration=0.6)
    assert same_bits(trajectory, reference)
    assert same_bits(simulator.observe(trajectory), reference)


@pytest.mark.parametrize("effect", ALL)
def test_a_value_close_to_neutral_changes_little(
    effect: Effect, arcfold: Problem, nominal: Parts, reference: Trajectory
) -> None:
    """The elements that an effect adds must have no effect by themselves."""
    _low, high = effect.bounds(nominal)
    neutral = effect.neutral_value(nominal)
    value = (
        1e-6 * high if neutral == 0.0 else neutral * (1.0 - 1e-6) if math.isfinite(neutral) else 1e3 * high
    )
    simulator = Simulator.build(arcfold.with_effects(asked(effect, value)))
    trajectory = simulator.run(arcfold.baselines["square-1s"], duration=0.6)
    moved = simulator.observe(trajectory)["marker.x"] - reference["marker.x"]
    assert np.abs(moved).max() < 5e-4, "the stops of the free play are not quite rigid"


def test_several_neutral_effects_change_no_bit(arcfold: Problem, reference: Trajectory) -> None:
    neutral = {"servo_torque_limit": {"limit_n_m": 0.245}, "servo_speed_limit": {"limit_rad_s": math.inf}}
    simulator = Simulator.build(arcfold.with_effects(neutral | {"hinge_friction": {"torque_n_m": 0}}))
    assert not simulator.effects.active
    assert same_bits(simulator.run(arcfold.baselines["square-1s"], duration=0.6), reference)
