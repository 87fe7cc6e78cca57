"""Robots with sensors: nominal ones are compiled once, and no robot changes another."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from helpers import STRIDER, edited, problem_folder, same_bits

from gaitopt.problem import instruments
from gaitopt.problem.instruments import build_instrumented
from gaitopt.problem.model import carrying
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.rollout import Simulator

EFFECTS = {
    "servo_gain": {"servo_gain": {"scale": 0.7}},
    "servo_sag": {"servo_sag": {"share_lost": 0.2}},
    "friction_load": {"friction_load": {"exponent": 0.3}},
    "link_inertia": {"link_inertia": {"scale": 1.5}},
}


def walked(problem: Problem, effect: str) -> object:
    robot = Simulator.build(problem.with_effects(EFFECTS[effect]))
    return robot.run(problem.baselines["stride"], duration=0.3)


def test_robots_of_one_problem_share_one_nominal_robot(
    strider: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A problem that reads its files from the disk shares nothing, and has the same bits."""
    compiled, compile_ = [], instruments._compiled
    monkeypatch.setattr(instruments, "_compiled", lambda one: compiled.append(one) or compile_(one))
    carried = carrying(strider.with_parameters({"mu_trunk": 0.31}))
    apart = strider.with_parameters({"mu_trunk": 0.31})
    with ThreadPoolExecutor(3) as executor:
        found = list(executor.map(lambda effect: walked(carried, effect), [*EFFECTS] * 2))
    assert len(compiled) == 1
    expected = [walked(apart, effect) for effect in EFFECTS]
    assert len(compiled) == 1 + len(EFFECTS)
    assert all(same_bits(one, other) for one, other in zip(found, expected * 2, strict=True))


def test_what_is_done_to_a_robot_reaches_no_other(strider: Problem) -> None:
    problem = carrying(strider)
    first = build_instrumented(problem)
    before = first.model.body_mass.copy()
    first.model.body_mass[:] *= 2.0
    first.effects.nominal.model.key_qpos[:] = 1.0
    second = build_instrumented(problem.with_effects(EFFECTS["servo_sag"]))
    assert np.array_equal(second.model.body_mass, before)
    assert np.array_equal(second.effects.nominal.model.body_mass, before)
    assert not (second.model.key_qpos == 1.0).all()


def test_another_parameter_or_site_makes_another_robot(strider: Problem) -> None:
    problem = carrying(strider)
    usual = build_instrumented(problem)
    heavy = build_instrumented(problem.with_parameters({"mass": 0.04}))
    assert heavy.model.body_mass.sum() > usual.model.body_mass.sum()
    assert len(build_instrumented(problem.observing(["nose"])).signals) > len(usual.signals)


def test_a_file_that_changes_on_the_disk_is_read_again(tmp_path: Path) -> None:
    problem = load_problem(problem_folder(tmp_path / "robot", STRIDER))
    before = build_instrumented(problem).model
    edited(problem.model_path, 'impratio="10"', 'impratio="20"')
    assert (before.opt.impratio, build_instrumented(problem).model.opt.impratio) == (10.0, 20.0)
