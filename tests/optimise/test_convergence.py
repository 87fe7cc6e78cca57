"""The winner at the timestep of the search and at the reference: does its speed depend on it?"""

import pytest

from gaitopt.optimise.executors import SerialExecutor
from gaitopt.optimise.notes import convergence_notes
from gaitopt.optimise.verification import convergence, verify
from gaitopt.problem.problem import Problem
from gaitopt.simulation.audit.settings import CheckSettings

NEVER = CheckSettings(timestep_change=-1e3, timestep_floor_m_s=-1e3)
ALWAYS = CheckSettings(timestep_change=10.0)


def test_a_winner_whose_speed_depends_on_the_timestep_is_told(strider: Problem) -> None:
    with SerialExecutor() as pool:
        (gait,) = verify(strider, [strider.baselines["stride"]], 1, pool)
        calm, wild = (convergence(strider, gait, 1, pool, settings) for settings in (ALWAYS, NEVER))
    assert calm.working.speeds.shape == gait.speeds.shape
    assert calm.change_m_s == pytest.approx(gait.speed - calm.working.speed)
    assert calm.change_ci90_m_s[0] <= calm.change_m_s <= calm.change_ci90_m_s[1]
    assert (calm.converged, wild.converged) == (True, False)
    assert convergence_notes(calm, gait, strider) == ()
    (note,) = convergence_notes(wild, gait, strider)
    assert f"{1e3 * gait.speed:.1f} mm/s at {strider.simulation.reference.timestep_s:g} s" in note
