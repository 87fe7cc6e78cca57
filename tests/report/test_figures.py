"""Figures: their units, and what they read from a rollout."""

import numpy as np
import pytest
from matplotlib import pyplot as plt

from gaitopt.optimise.compare import ComparedGait
from gaitopt.optimise.sensitivity import Sensitivity
from gaitopt.problem.problem import Problem
from gaitopt.problem.robot import Robot
from gaitopt.report.figures import audit as audit_figures
from gaitopt.report.figures import comparison as comparison_figures
from gaitopt.report.figures import gait as gait_figures
from gaitopt.report.figures import search as search_figures
from gaitopt.simulation.audit.finding import Finding
from gaitopt.simulation.rollout import Simulator


def test_forward_is_the_problems_own(strider: Problem) -> None:
    trajectory = Simulator.build(strider).run(strider.baselines["stride"])
    moved = trajectory["marker.y"] - trajectory["marker.y"][0]
    np.testing.assert_allclose(gait_figures.along(trajectory, strider.roles, 0), moved, atol=1e-12)
    line = gait_figures.overlay({"stride": trajectory}, strider.roles).axes[0].lines[0]
    assert np.max(np.abs(line.get_ydata())) == pytest.approx(1e3 * np.abs(moved).max(), rel=1e-3)


def test_every_axis_has_a_unit(strider: Problem) -> None:
    simulator, gait = Simulator.build(strider), strider.baselines["stride"]
    robot, trajectory = Robot.of(simulator.models[0]), simulator.run(gait)
    row = ComparedGait(
        name="a", period_s=1.0, speed_ci90_m_s=(0.009, 0.011), speed_worst_m_s=0.008, difference_m_s=0.0,
        difference_ci90_m_s=(0.0, 0.0), ratio=None, ratio_ci90=None, more_than_noise=False,
        constraints_met=True, violations={}, status="ok", scenario_speeds_m_s=(0.008, 0.012),
        metrics={"speed_m_s": 0.01},
    )  # fmt: skip
    figures = [
        gait_figures.overlay({"a": trajectory}, strider.roles),
        gait_figures.panels({"a": trajectory, "b": trajectory}, strider.roles),
        gait_figures.gait_diagram(strider, gait, trajectory, robot),
        gait_figures.angles(strider, gait, trajectory, robot),
        comparison_figures.speeds([row]),
        comparison_figures.differences([row, row]),
        gait_figures.commanded(gait),
        audit_figures.findings([Finding("airtime", "a", 0.1, 0.02, "in the air")]),
        search_figures.sensitivity(
            [Sensitivity("x", "gait", 0.001, -0.002, -0.0015, 0.001)], "5 % of its range"
        ),
    ]
    for drawn in figures:
        labels = [axes.get_xlabel() for axes in drawn.axes] + [axes.get_ylabel() for axes in drawn.axes]
        said = [label for label in labels if label]
        assert any(label.endswith("]") or label.startswith("share") for label in said)
        assert all(label.endswith("]") or label.startswith("share") for label in said)
    assert plt.get_fignums() == []


def test_a_pad_holds_slides_or_slips(strider: Problem) -> None:
    simulator, gait = Simulator.build(strider), strider.baselines["stride"]
    robot, trajectory = Robot.of(simulator.models[0]), simulator.run(gait)
    for pad in strider.roles.pads:
        states = gait_figures.pad_states(strider, trajectory, pad, robot)
        assert states.sum(axis=0).max() == 1
        assert states.any()


def test_a_finding_lies_beyond_its_limit_on_either_side() -> None:
    over = Finding("airtime", "a", 0.1, 0.02, "in the air")
    under = Finding("command_not_followed", "a", 0.5, 0.95, "too weak")
    assert audit_figures.beyond(over) == pytest.approx(5.0)
    assert audit_figures.beyond(under) == pytest.approx(1.9)
    assert audit_figures.beyond(Finding("reached", "a", 0.0, 0.95, "does not move")) == np.inf
