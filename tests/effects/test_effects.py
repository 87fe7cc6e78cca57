"""The library of effects as a whole: its table, its neutral values, problem files, the command line."""

import json
import math
import pickle
import re
import tomllib
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import mujoco
import numpy as np
import pytest
import tomli_w
from helpers import STRIDER, problem_folder, same_bits, still

from gaitopt.cli.app import main
from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.fit.hypotheses import hypotheses
from gaitopt.effects import EFFECTS, Effect
from gaitopt.effects.parts import Parts
from gaitopt.effects.prior import Prior
from gaitopt.effects.rows import effect_rows
from gaitopt.optimise.evaluator import assess
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.verification import verify
from gaitopt.problem.model import nominal_mjcf, nominal_parts
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import NOMINAL, Scenario
from gaitopt.simulation.setup import RobotSetup

CONTRACT = """
servo_torque_limit limit_n_m; servo_speed_limit limit_rad_s; servo_gain scale; servo_damping scale;
servo_inertia armature_kg_m2; servo_deadband half_width_rad; servo_backlash half_width_rad;
servo_travel gain; servo_trim offset_rad; servo_sag share_lost; command_latency delay_s;
channel_timing delay_s; hinge_stiffness scale; hinge_nonlinearity cubic_n_m_rad3; hinge_damping scale;
hinge_friction torque_n_m; hinge_hysteresis yield_n_m; hinge_asymmetry ratio; pad_friction scale;
body_friction scale; friction_anisotropy ratio; friction_direction ratio; friction_load exponent;
contact_compliance scale; ground_slope angle_rad; payload_mass mass_kg; com_offset offset_m;
link_inertia scale; geometry_scale scale; tether_drag force_n; camera_scale scale; camera_tilt angle_rad;
clock_offset offset_s; clock_rate rate; clock_rounding grid_s; marker_outliers share
"""

ALL = [pytest.param(effect, id=name) for name, effect in EFFECTS.items()]


@pytest.fixture(scope="module")
def nominal(arcfold: Problem) -> Parts:
    return nominal_parts(arcfold)


@pytest.fixture(scope="module")
def reference(arcfold: Problem) -> Trajectory:
    return Simulator.build(arcfold).run(arcfold.baselines["square-1s"], duration=0.6)


def asked(effect: Effect, value: float) -> dict[str, dict[str, float | str]]:
    """What a problem file says to switch an effect on."""
    values: dict[str, float | str] = {effect.parameter: value}
    return {effect.name: values | ({"target": "mid_act"} if effect.target == "one" else {})}


def strong(effect: Effect, nominal: Parts) -> float:
    """A plausible value, well away from the neutral one."""
    low, high = effect.bounds(nominal)
    neutral = effect.neutral_value(nominal)
    if effect.scale == "lin":
        return high if neutral < high else low
    return low if neutral > math.sqrt(low * high) else math.sqrt(high * neutral)


# --- the table ----------------------------------------------------------------------------------


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
    assert effect.why_not(nominal) is None, "all of them apply to ArcFold"


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
    """What the record shows is not fitted; a shifted start is fitted only where the start is known."""
    tried = {
        known: {h.effect for h in hypotheses(nominal, nominal.channels, known)} for known in (True, False)
    }
    in_record = {effect.name for effect in EFFECTS.values() if effect.found_in_record}
    assert in_record == {"clock_rounding", "marker_outliers"}
    assert {effect.name for effect in EFFECTS.values()} - {e.name for e in tried[True]} == in_record
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
    """What an effect adds to model and loop must not be an effect of its own."""
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


# --- switched on --------------------------------------------------------------------------------


@pytest.mark.parametrize("effect", ALL)
def test_every_effect_can_be_switched_on_in_a_problem_file(
    effect: Effect, quick_folder: Path, nominal: Parts, reference: Trajectory, tmp_path: Path
) -> None:
    value = strong(effect, nominal)
    text = tomli_w.dumps({"effects": asked(effect, value)})

    def switch_on(content: dict) -> None:
        content |= tomllib.loads(text)

    problem = load_problem(problem_folder(tmp_path / "affected", quick_folder, switch_on))
    assert [(s.effect.name, s.value) for s in problem.effects] == [(effect.name, value)]
    simulator = Simulator.build(problem)
    run = simulator.run(problem.baselines["square-1s"], duration=0.6)
    assert run.status == "ok"
    assert list(run.signals) == list(reference.signals)
    measured = simulator.observe(run)
    same = np.array_equal(measured["marker.x"], reference["marker.x"])
    assert not (same and np.array_equal(measured.time, reference.time)), "it does something"
    (tmp_path / "copy").mkdir()
    (tmp_path / "copy" / "model.xml").write_text(nominal_mjcf(problem))
    (tmp_path / "copy" / "problem.toml").write_text(problem.to_toml("model.xml"))
    copy = load_problem(tmp_path / "copy")
    assert copy.to_dict() == problem.to_dict() | {"model": "model.xml"}


AT_REST = [p for p in ALL if p.id not in ("ground_slope", "tether_drag")]
"""All but a robot that is pulled, which creeps."""


@pytest.mark.parametrize("effect", AT_REST)
def test_a_robot_with_an_effect_starts_at_rest(effect: Effect, arcfold: Problem, nominal: Parts) -> None:
    problem = arcfold.with_effects(asked(effect, strong(effect, nominal)))
    run = Simulator.build(problem).run(still(problem), duration=0.5)
    marker = run.stacked("marker")
    assert np.linalg.norm(np.diff(marker, axis=0), axis=1).max() < 1e-4 * 1e-3, "0.1 mm/s"


def test_the_nominal_model_stays_nominal(arcfold: Problem) -> None:
    affected = arcfold.with_effects({"servo_backlash": {"half_width_rad": 0.05}})
    assert nominal_mjcf(affected) == nominal_mjcf(arcfold)


def test_all_effects_go_together(arcfold: Problem, nominal: Parts) -> None:
    mild = {}
    for effect in EFFECTS.values():
        low, high = effect.bounds(nominal)
        neutral = effect.neutral_value(nominal)
        value = neutral + 0.02 * (high - low) if math.isfinite(neutral) else high
        mild |= asked(effect, value)
    simulator = Simulator.build(arcfold.with_effects(mild))
    assert len(simulator.effects.active) == len(EFFECTS)
    assert simulator.run(arcfold.baselines["square-1s"], duration=0.6).status == "ok"


def test_scenarios_act_on_a_robot_with_effects(arcfold: Problem) -> None:
    weak = (NOMINAL, Scenario(friction=0.9, servo_strength=0.8))
    effects = {
        "servo_torque_limit": {"limit_n_m": 0.1},
        "servo_deadband": {"half_width_rad": 0.02},
        "pad_friction": {"scale": 2.0},
        "friction_anisotropy": {"ratio": 1.5},
    }
    models = Simulator.build(arcfold.with_effects(effects), weak).models
    pair = [m.pair_friction[0, :2] for m in models]
    assert pair[1] == pytest.approx(0.9 * pair[0])
    band = 3.0 * 0.02
    assert [m.actuator_forcerange[0, 1] for m in models] == pytest.approx([0.1 + band, 0.08 + band])


def test_start_pose_errors_are_those_of_the_nominal_robot(arcfold: Problem) -> None:
    """Servo and link move together: an error of the pose is not one of the free play."""
    affected = arcfold.with_effects({"servo_backlash": {"half_width_rad": 0.001}})
    gait, scenarios = still(arcfold), (NOMINAL, Scenario(start_pose_rad=0.005, pose_seed=3))
    moved = []
    for problem in (arcfold, affected):
        simulator = Simulator.build(problem, scenarios)
        rest, nudged = (simulator.run(gait, i, duration=0.01) for i in range(2))
        moved.append(
            [float(nudged[s][0] - rest[s][0]) for s in ("joint.mid_left", "joint.foot1", "heading.z")]
        )
        play = nudged["joint.foot1"][0] - nudged["position.foot1"][0]
        assert abs(play) <= 0.0011
    assert moved[0] == pytest.approx(moved[1], abs=1e-9)


def test_a_loop_s_model_is_its_run_s_own(arcfold: Problem) -> None:
    """Runs after one another are the same, whatever the loop left behind."""
    simulator = Simulator.build(
        arcfold.with_effects({"servo_sag": {"share_lost": 0.5}, "friction_direction": {"ratio": 1.5}})
    )
    gait = arcfold.baselines["square-0.5s"]
    one = simulator.run(gait, duration=0.6)
    assert same_bits(simulator.run(gait, duration=0.6), one)


def test_an_effect_does_not_depend_on_names(strider: Problem, tmp_path: Path) -> None:
    """Unnamed joints, bodies and geoms that no role names are found as well."""
    folder = problem_folder(tmp_path / "strider", STRIDER)
    xml = folder / "strider.xml"
    text = xml.read_text().replace(' name="floor"', "")
    for body in ("rear_leg", "front_leg"):
        text = text.replace(f'<body name="{body}"', "<body")
    for joint in ("along", "above", "pitch"):
        text = text.replace(f'<joint name="{joint}"', "<joint")
    xml.write_text(text)
    effects = {
        "servo_backlash": {"half_width_rad": 0.02},
        "friction_anisotropy": {"ratio": 1.3},
        "tether_drag": {"force_n": 0.01},
        "geometry_scale": {"scale": 1.05},
    }
    gait = strider.baselines["stride"]
    named = Simulator.build(strider.with_effects(effects)).run(gait)
    unnamed = Simulator.build(load_problem(folder).with_effects(effects)).run(gait)
    assert named.status == "ok"
    assert np.array_equal(named["marker.y"], unnamed["marker.y"])


def test_an_effect_goes_into_other_processes(quick: Problem) -> None:
    affected = quick.with_effects({"servo_sag": {"share_lost": 0.4}})
    setting = RobotSetup.of(affected, (NOMINAL,), affected.simulation.working)
    plain = RobotSetup.of(quick, (NOMINAL,), quick.simulation.working)
    assert setting.key != plain.key
    gait = quick.baselines["square-1s"]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
        away = executor.submit(assess, setting, gait, 0).result()
    here = assess(setting, gait, 0)
    assert away.metrics == here.metrics
    assert here.metrics["speed_m_s"] != assess(plain, gait, 0).metrics["speed_m_s"]


# --- wrong files --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ({"servo_torque": {"limit_n_m": 1.0}}, r"unknown effect .* 'servo_torque'; .*'servo_torque_limit'"),
        ({"servo_gain": {"gain": 1.0}}, r"servo_gain: unknown parameter 'gain'; known: scale, target"),
        ({"servo_gain": {}}, r"effects\.servo_gain: scale: missing; it is required"),
        ({"servo_gain": {"scale": 0.0}}, r"scale: found 0.0; allowed: above 0"),
        ({"servo_sag": {"share_lost": 1.5}}, r"share_lost: found 1.5; allowed: at least 0 and at most 1"),
        ({"ground_slope": {"angle_rad": math.nan}}, r"angle_rad: found nan"),
        ({"payload_mass": {"mass_kg": math.inf}}, r"mass_kg: found inf; allowed: at least 0"),
        ({"servo_gain": {"scale": "much"}}, r"scale: found 'much'; allowed: above 0"),
        ({"servo_gain": {"scale": 2.0, "target": "foot3"}}, r"unknown target 'foot3'; known: all, mid_act"),
        ({"channel_timing": {"delay_s": 0.1}}, r"target: missing; allowed: one of mid_act, foot1, foot2"),
        ({"channel_timing": {"delay_s": 0.1, "target": "all"}}, r"unknown target 'all'"),
        ({"pad_friction": {"scale": 2.0, "target": "foot1"}}, r"unknown parameter 'target'; known: scale"),
    ],
)  # fmt: skip
def test_a_wrong_effect_is_one_line(arcfold: Problem, effects: dict, message: str) -> None:
    with pytest.raises(GaitoptError, match=message) as error:
        arcfold.with_effects(effects)
    assert "problem.toml" in str(error.value)


def test_an_effect_without_its_role_is_not_applicable(strider: Problem) -> None:
    with pytest.raises(GaitoptError, match=r"effects\.hinge_friction: not applicable: .*no roles\.hinges"):
        strider.with_effects({"hinge_friction": {"torque_n_m": 1e-3}})


def test_an_effect_that_a_model_cannot_have_is_one_line(tmp_path: Path) -> None:
    problem = load_problem("arcfold-published").with_effects({"servo_sag": {"share_lost": 0.5}})
    with pytest.raises(
        GaitoptError, match=r"effects\.servo_sag: not applicable: a servo has no torque limit"
    ):
        Simulator.build(problem)


# --- command line -------------------------------------------------------------------------------


def test_effects_prints_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects"]) == 0
    text = capsys.readouterr().out
    assert all(re.search(rf"^{name}: ", text, re.MULTILINE) for name in EFFECTS)
    assert main(["effects", "arcfold", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    limit = next(row for row in rows if row["name"] == "servo_torque_limit")
    assert limit["neutral"] == 0.245
    assert limit["bounds"] == pytest.approx([0.15 * 0.245, 1.5 * 0.245])
    assert all(row["applies"] for row in rows)


def test_effects_says_what_does_not_apply(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["effects", str(STRIDER)]) == 0
    assert "does not apply: the problem names no roles.hinges" in capsys.readouterr().out
    assert main(["effects", str(STRIDER), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert {row["name"] for row in rows if not row["applies"]} == {
        n for n in EFFECTS if n.startswith("hinge_")
    }


def test_optimise_works_on_a_robot_with_an_effect(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], strider: Problem
) -> None:
    def switch_on(content: dict) -> None:
        content["effects"] = {"servo_torque_limit": {"limit_n_m": 0.02, "target": "rear"}}

    folder, out = problem_folder(tmp_path / "weak", STRIDER, switch_on), tmp_path / "run"
    options = ["--budget", "4", "--no-warm-start", "--workers", "1", "--quiet", "--json"]
    assert main(["optimise", str(folder), *options, "--out", str(out)]) == 0
    speeds = [row["speed_m_s"] for row in json.loads(capsys.readouterr().out)["baselines"]]

    def verified(problem: Problem) -> list[float]:
        gaits = list(problem.baselines.values())
        return [row.speed for row in verify(problem, gaits, 1, SerialExecutor())]

    assert speeds == verified(load_problem(out))
    assert speeds != verified(strider)
    model = mujoco.MjModel.from_xml_path(str(out / "model.xml"))
    assert model.actuator("rear").forcerange[1] == 0.04, "the run folder's model is the nominal one"
