"""Effects that a problem file switches on, and files that are wrong."""

import math
import tomllib
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from effect_values import ALL, HERE, asked, strong
from helpers import STRIDER, problem_folder, same_bits, still

from gaitopt.core.errors import GaitoptError
from gaitopt.effects import Effect
from gaitopt.effects.active import Values
from gaitopt.effects.effect import loop_interval_s, loop_steps
from gaitopt.effects.parts import Parts
from gaitopt.optimise.evaluator import assess
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.robot.trajectory import Trajectory
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.scenario import NOMINAL, Scenario
from gaitopt.simulation.setup import RobotSetup
from gaitopt.simulation.tolerances import SmallErrors


@pytest.mark.parametrize("effect", ALL)
def test_every_effect_can_be_switched_on_in_a_problem_file(
    effect: Effect, quick_folder: Path, nominal: Parts, reference: Trajectory, tmp_path: Path
) -> None:
    value = strong(effect, nominal)
    text = tomli_w.dumps({"effects": asked(effect, value)})

    def switch_on(content: dict[str, Any]) -> None:
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
"""Every effect, except on a robot that is pulled: it creeps."""


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
    mild: dict[str, Values] = {}
    for effect in HERE:
        low, high = effect.bounds(nominal)
        neutral = effect.neutral_value(nominal)
        value = neutral + 0.02 * (high - low) if math.isfinite(neutral) else high
        mild |= asked(effect, value)
    simulator = Simulator.build(arcfold.with_effects(mild))
    assert len(simulator.effects.active) == len(HERE)
    assert simulator.run(arcfold.baselines["square-1s"], duration=0.6).status == "ok"


def test_scenarios_act_on_a_robot_with_effects(arcfold: Problem) -> None:
    weak = (NOMINAL, Scenario(SmallErrors(friction=(0.9,) * 15, servo_strength=(0.8,) * 3)))
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
    """Servo and link move together: an error of the pose is not free play."""
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
    """Two runs in a row are the same; nothing is left over from the first."""
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


SERVO_EFFECTS = [pytest.param(effect, id=effect.name) for effect in HERE if effect.target == "any"]


@pytest.mark.parametrize("effect", SERVO_EFFECTS)
def test_an_effect_on_each_servo_by_itself_is_the_effect_on_all(
    effect: Effect, arcfold: Problem, nominal: Parts
) -> None:
    value, gait = strong(effect, nominal), arcfold.baselines["square-1s"]
    tables: list[Values] = [{effect.parameter: value, "target": name} for name in arcfold.channel_names]
    apart = Simulator.build(arcfold.with_effects({effect.name: tables})).run(gait, duration=0.3)
    together = Simulator.build(arcfold.with_effects(asked(effect, value))).run(gait, duration=0.3)
    assert same_bits(apart, together)


def test_a_file_gives_servos_different_values_of_an_effect(quick_folder: Path, tmp_path: Path) -> None:
    tables = [{"scale": 0.9, "target": "foot1"}, {"scale": 1.2, "target": "mid_act"}]

    def unequal(content: dict[str, Any]) -> None:
        content["effects"] = {"servo_gain": tables}

    problem = load_problem(problem_folder(tmp_path / "unequal", quick_folder, unequal))
    assert [(one.value, one.target) for one in problem.effects] == [(0.9, "foot1"), (1.2, "mid_act")]
    assert tomllib.loads(problem.to_toml("model.xml"))["effects"] == {"servo_gain": tables}


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
        (
            {"servo_gain": [{"scale": 2.0}, {"scale": 1.5, "target": "foot1"}]},
            r"servo_gain: target: found 'all, foot1'; allowed: each actuator once, or all alone",
        ),
        ({"pad_friction": [{"scale": 2.0}, {"scale": 2.0}]}, r"found 'all, all'; allowed: each actuator"),
    ],
)  # fmt: skip
def test_a_wrong_effect_is_one_line(arcfold: Problem, effects: dict[str, Any], message: str) -> None:
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


@pytest.mark.parametrize(("step_s", "steps"), [(2e-4, 10), (3e-4, 7), (1e-3, 2), (5e-3, 1)])
def test_a_loop_knows_the_time_between_two_calls(step_s: float, steps: int) -> None:
    """Long steps and odd ones do not let its time constants grow."""
    assert loop_steps(step_s) == steps
    assert loop_interval_s(step_s) == pytest.approx(steps * step_s)


@pytest.mark.parametrize("step_s", [1e-3, 5e-3])
def test_a_supply_sags_as_fast_at_any_timestep(arcfold: Problem, step_s: float) -> None:
    """After three of its time constants (10 ms) all but a twentieth of the torque is lost that will be."""
    sagging = arcfold.with_effects({"servo_sag": {"share_lost": 0.4}})
    robot = Simulator.build(sagging, fidelity=arcfold.simulation.working.scaled(1e3 * step_s))
    model = robot.models[0]
    whole = model.actuator_forcerange[:3, 1].copy()
    (update,) = robot.effects.updates(model)
    for _ in range(round(0.03 / loop_interval_s(step_s))):
        update.edit(np.full(model.nsensordata, 1e3))  # every servo stalls
    lost = 1.0 - model.actuator_forcerange[:3, 1] / whole
    assert lost == pytest.approx(0.4 * (1.0 - math.exp(-3.0)), rel=0.06)
