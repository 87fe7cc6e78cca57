"""Hypotheses: every effect on each of its targets, with a range that is searched."""

import numpy as np
import pytest

from gaitopt.diagnose.fit.hypotheses import hypotheses
from gaitopt.problem.problem import Problem
from gaitopt.simulation.rollout import Simulator


def test_hypotheses_stay_inside_their_bounds(arcfold: Problem) -> None:
    nominal = Simulator.build(arcfold).effects.nominal
    found = hypotheses(nominal, arcfold.channel_names, offset_known=False)
    assert len({h.name for h in found}) == len(found)
    assert not any(h.effect.name in ("clock_offset", "clock_rounding", "marker_outliers") for h in found)
    for h in found:
        assert h.low <= h.neutral <= h.high
        assert all(h.low <= at <= h.high and at != h.neutral for at in h.screened())
        # Values on one side of neutral do not predict the other side; nor does a tenth of the way predict the
        # rest.
        assert all(any(at == pytest.approx(bound) for at in h.screened()) for bound in h.sides)
        middle = 0.5 * (h.low + h.high)
        assert h.coordinate(h.value(middle)) == pytest.approx(middle)
        assert np.isfinite(h.value(h.low))
