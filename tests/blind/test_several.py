"""Cases of several effects on a robot that is a little wrong in everything else, too."""

import json
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from gaitopt.blind.answers import Answer, Case
from gaitopt.blind.cases import CaseRequest, make_cases
from gaitopt.blind.drawing import Draw
from gaitopt.blind.factory import CaseFactory, RecordingPlan
from gaitopt.blind.misfits import Misfit, walk_with
from gaitopt.blind.recording import Numerics
from gaitopt.blind.scoring import score
from gaitopt.blind.sealed import PlantedEffect, Truth, read_truth
from gaitopt.blind.settings import BlindSettings
from gaitopt.optimise.executors import open_executor
from gaitopt.problem.problem import Problem
from gaitopt.problem.records import Fidelity
from gaitopt.simulation.rollout import Simulator
from gaitopt.simulation.tolerances import allowed

PLAN = RecordingPlan(("square-1s", "square-0.5s"), 3.0)


@pytest.fixture(scope="module")
def factory(arcfold: Problem) -> CaseFactory:
    with open_executor("threads", 2) as executor:
        return CaseFactory.of(arcfold, PLAN, executor, BlindSettings(floor_robots=1))


@pytest.mark.slow
def test_each_of_several_effects_is_seen_beside_the_others(arcfold: Problem, tmp_path: Path) -> None:
    settings = BlindSettings(misfit_share=1.0, floor_robots=2)
    with open_executor("threads", 2) as executor:
        make_cases(arcfold, tmp_path, CaseRequest(["several"] * 2, 12, PLAN), executor, settings=settings)
    for case in ("case-000", "case-001"):
        truth = read_truth(tmp_path / "sealed" / f"{case}.json")
        assert 1 <= len(truth.effects) <= settings.most_effects
        assert truth.gap_over_floor >= settings.smallest
        assert set(truth.seen) == {effect.name for effect in truth.effects}
        assert set(truth.seen_beside_errors) == set(truth.seen)
        assert all(0.0 < moved <= truth.seen[name] for name, moved in truth.seen_beside_errors.items())
        assert truth.trials == tuple(PLAN.gaits)
        assert set(truth.speeds_m_s) == set(arcfold.baselines) - set(PLAN.gaits)
        assert all(0.0 < abs(speed) < 0.2 for speed in truth.speeds_m_s.values())
        assert len(truth.misfits) == 1, "half of the trials fit at least"
        assert set(truth.misfits_beside_errors) == set(truth.misfits)
        assert all(moved > 0.0 for moved in truth.misfits_beside_errors.values())
        assert {error.name for error in truth.errors} >= {"servo_trim", "pad_friction", "camera_tilt"}
        assert (tmp_path / case / "dataset.toml").is_file()


def test_everything_is_a_little_wrong(factory: CaseFactory) -> None:
    """A robot without a large effect differs in friction, servos and trims, by its seed alone."""
    fidelity = Fidelity(timestep_s=1e-3, integrator="implicitfast")
    nominal = factory.nominal.models[0]
    robots = [Numerics(fidelity, 5.0, seed, True).robot(factory, Draw("none")) for seed in (1, 1, 2)]
    frictions = [robot.models[0].geom_friction[:, 0] for robot in robots]
    np.testing.assert_array_equal(frictions[0], frictions[1])
    assert np.abs(frictions[2] - frictions[0]).max() > 1e-3
    pads = [nominal.geom(name).id for name in factory.problem.roles.pads]
    assert np.abs(frictions[0][pads] / nominal.geom_friction[pads, 0] - 1.0).min() > 1e-6
    assert len(set(robots[0].scenarios[0].errors.servo_trim_rad)) == len(factory.problem.channel_names)
    assert {one.effect.name for one in robots[0].effects.active} >= {"camera_scale", "camera_tilt"}


@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("servo_torque_limit", lambda model: model.actuator_forcerange[:, 1]),
        ("servo_gain", lambda model: model.actuator_gainprm[:, 0]),
        ("servo_damping", lambda model: model.dof_damping),
    ],
)
def test_small_errors_are_told_as_effects(
    name: str, read: Callable[[mujoco.MjModel], NDArray[np.float64]], factory: CaseFactory
) -> None:
    """By the library, they make the servos of the nominal robot those of the robot that has them."""
    numerics = Numerics(Fidelity(timestep_s=1e-3, integrator="implicitfast"), 5.0, 3, True)
    told = [effect for effect in numerics.errors(factory) if effect.name == name and effect.target != "all"]
    tables = [effect.parameters | {"target": effect.target} for effect in told]
    rebuilt = Simulator.build(factory.problem.with_effects({name: tables}))
    erring = numerics.robot(factory, Draw("none"))
    np.testing.assert_allclose(read(rebuilt.models[0]), read(erring.models[0]))
    changed = read(rebuilt.models[0]) != read(factory.nominal.models[0])
    assert np.sum(changed) == len(factory.problem.channel_names)


def test_an_effect_on_all_servos_has_their_mean_error(factory: CaseFactory) -> None:
    numerics = Numerics(Fidelity(timestep_s=1e-3, integrator="implicitfast"), 5.0, 3, True)
    erring = numerics.robot(factory, Draw("none"))
    trims = {e.target: e.parameters["offset_rad"] for e in numerics.errors(factory) if e.name == "servo_trim"}
    own = erring.scenarios[0].errors.servo_trim_rad
    assert tuple(trims[channel] for channel in factory.problem.channel_names) == own
    assert trims["all"] == pytest.approx(np.mean(own))
    pads = [factory.nominal.models[0].geom(pad).id for pad in factory.problem.roles.pads]
    (told,) = [e.parameters["scale"] for e in numerics.errors(factory) if e.name == "pad_friction"]
    friction = [robot.models[0].geom_friction[pads, 0] for robot in (erring, factory.nominal)]
    assert told == pytest.approx(np.mean(friction[0] / friction[1]))


def test_no_small_error_is_larger_than_the_tolerances_allow(factory: CaseFactory) -> None:
    """Errors of 200 robots reach far to both sides of it, and the mean error of all hinges less far."""
    fidelity = Fidelity(timestep_s=1e-3, integrator="implicitfast")
    tolerances = factory.problem.file.tolerances
    neutral = {(h.effect.name, h.target): h.value(h.neutral) for h in factory.hypotheses}
    reached: dict[str, list[float]] = {}
    for seed in range(200):
        for error in Numerics(fidelity, 5.0, seed, True).errors(factory):
            (value,) = error.parameters.values()
            low, high = allowed(error.name, neutral[error.name, error.target], tolerances)
            assert low <= value <= high, error
            reached.setdefault(error.name, []).append((value - low) / (high - low))
    assert len(reached) == 13
    for name, shares in reached.items():
        far = 0.4 if name == "hinge_stiffness" else 0.25
        assert min(shares) < far, name
        assert max(shares) > 1.0 - far, name


def test_a_payload_is_no_small_error(factory: CaseFactory) -> None:
    assert allowed("payload_mass", 0.0, factory.problem.file.tolerances) == (0.0, 0.0)


def test_nothing_else_is_wrong_with_an_exactly_made_robot(factory: CaseFactory) -> None:
    numerics = Numerics(Fidelity(timestep_s=1e-3, integrator="implicitfast"), 5.0, 3, False)
    assert numerics.errors(factory) == ()


@pytest.mark.parametrize(
    "misfit", [Misfit("wrong_file", {"gait": 1.0}), Misfit("slip", {"friction": 0.2})], ids=lambda m: m.name
)
def test_a_misfit_walks_otherwise(misfit: Misfit, factory: CaseFactory) -> None:
    path = walk_with(misfit, factory, factory.nominal, factory.gaits["square-1s"])
    usual = factory.paths["square-1s"]
    later = np.interp(usual.time, path.time, path["marker.x"])
    assert path.status == "ok"
    assert np.abs(later - usual["marker.x"]).max() > 3.0 * factory.floors["square-1s"]


def test_a_robot_without_supply_stops(factory: CaseFactory) -> None:
    cut = Misfit("supply_lost", {"at_s": 1.0})
    path = walk_with(cut, factory, factory.nominal, factory.gaits["square-0.5s"])
    late = path["marker.x"][path.time > 2.5]
    assert path.status == "ok"
    assert np.ptp(late) < 1e-3
    assert path["marker.x"][path.time < 1.0].max() > path["marker.x"][0] + 1e-3


def case(named: list[str], misfits: dict[str, float]) -> Case:
    """A case with a seen and an unseen effect, and one trial of three that does not fit."""
    truth = Truth(
        kind="several",
        effects=(
            PlantedEffect(name="servo_trim", target="all", parameters={"offset_rad": 0.1}),
            PlantedEffect(name="hinge_friction", target="all", parameters={"torque_n_m": 0.01}),
        ),
        gap_over_floor=9.0,
        seen={"servo_trim": 8.0, "hinge_friction": 1.0},
        seen_beside_errors={"servo_trim": 2.0, "hinge_friction": 0.5},
        trials=("4s", "1s", "0.5s"),
        misfits={"1s": "slip"},
    )
    answer = {
        "verdict": "explained",
        "causes": named,
        "ambiguous_with": [],
        "effects": [],
        "other_probability": 0.1,
        "gap": {"shrinkage": 0.5},
        "misfit_trials": misfits,
    }
    return Case(name="case-000", truth=truth, diagnosis=Answer.model_validate(json.loads(json.dumps(answer))))


def test_predicted_speeds_are_scored_by_their_intervals() -> None:
    """Of gaits that were not recorded; a robot that cannot be simulated has no interval."""
    one = case(["servo_trim"], {})
    rows = [("2s", [0.01, 0.02]), ("0.35s", [0.05, 0.06]), ("0.3s", [None, None]), ("4s", [0.0, 0.1])]
    predicted = [{"gait": gait, "filmed": False, "speed_m_s": {"mean": 0.0, "ci90": e}} for gait, e in rows]
    logged = {"gait": "a log", "filmed": True, "rms": {}}
    answer = Answer.model_validate(one.diagnosis.model_dump() | {"predictions": [*predicted, logged]})
    speeds = {"2s": 0.015, "0.35s": 0.04, "0.3s": 0.05}
    truth = one.truth.model_copy(update={"speeds_m_s": speeds})
    record = score([one.model_copy(update={"truth": truth, "diagnosis": answer})])
    assert (record.speeds_covered.value, record.speeds_covered.cases) == (1 / 3, 3)
    assert record.to_dict()["speeds_covered"] == record.speeds_covered.to_dict()


def test_effects_that_cannot_be_seen_need_not_be_named() -> None:
    record = score([case(["servo_trim"], {"1s": 20.0}), case(["servo_gain"], {"4s": 20.0})])
    assert (record.several_named.value, record.several_named.cases) == (0.5, 2)
    assert record.several_named_beside_errors.cases == 0, "small errors move the robot half as far"
    assert record.several_false.value == 0.5
    assert (record.misfits_found.value, record.misfits_found.cases) == (0.5, 2)
    assert (record.misfits_false.value, record.misfits_false.cases) == (0.25, 4)


def test_a_small_error_of_the_robot_that_is_named_is_there() -> None:
    """If the interval of its size holds the true one; an error of another servo, or none, is not there."""
    told = PlantedEffect(name="servo_gain", target="foot1", parameters={"scale": 1.08})
    other = PlantedEffect(name="servo_damping", target="foot1", parameters={"scale": 1.08})
    one = case(["servo_trim", "servo_gain", "servo_damping"], {})
    truth = one.truth.model_copy(update={"errors": (told, other)})

    def named(name: str, target: str, ends: tuple[float, float]) -> dict[str, object]:
        size = {"scale": {"value": np.mean(ends), "ci90": ends}}
        row = {"name": name, "target": target, "probability": 1.0, "parameters": size}
        return row | {"heldout_shrinkage": 0.5, "alike": 1.0}

    def absent(*rows: dict[str, object]) -> float | None:
        answer = Answer.model_validate(one.diagnosis.model_dump() | {"effects": rows})
        record = score([one.model_copy(update={"truth": truth, "diagnosis": answer})])
        assert record.several_false.value == 2.0
        return record.several_absent.value

    assert absent(named("servo_gain", "foot1", (1.05, 1.1))) == 1.0
    assert absent(named("servo_gain", "foot1", (1.1, 1.2))) == 2.0
    assert absent(named("servo_gain", "foot2", (1.05, 1.1))) == 2.0
    assert (
        absent(named("servo_gain", "foot1", (1.0, 1.1)), named("servo_damping", "foot1", (1.0, 1.1))) == 0.0
    )


def test_misfits_that_small_errors_hide_need_not_be_found() -> None:
    one = case(["servo_trim"], {})
    counted = []
    for moved in (1.7, 3.5):
        truth = one.truth.model_copy(update={"misfits_beside_errors": {"1s": moved}})
        record = score([one.model_copy(update={"truth": truth})])
        assert record.misfits_found.cases == 1
        counted.append(record.misfits_found_beside_errors.cases)
    assert counted == [0, 1]
