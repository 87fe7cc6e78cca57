"""Optimal gaits of the planar model: periodic optimal control by collocation, with IPOPT."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from gaitopt.core.interrupts import interrupts_held
from gaitopt.plan.gait_vector import CHANNEL_STARTS, N_GAIT, GaitBounds, Vector, to_ramps, to_smoothing
from gaitopt.plan.planar import N_STATE, PlanarModel, Symbol

STATE_SCALE = np.array([0.05, 1.0, 1.0, 1.0])
"""Scale of the state in the unknowns: kg m/s, rad, rad, rad."""

IPOPT_OPTIONS: dict[str, Any] = {
    "expand": True,
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.option_file_name": "",
    "ipopt.tol": 1e-4,
    "ipopt.acceptable_tol": 1e-3,
    "ipopt.acceptable_iter": 4,
    "ipopt.mu_init": 1e-2,
    "ipopt.honor_original_bounds": "yes",
}
"""Tolerances far looser than IPOPT's own: a plan is a start for MuJoCo, and is integrated to confirm it.

IPOPT would also read, in the current folder, a file of options, which name files that it writes.
"""


@dataclass(frozen=True)
class Solution:
    """The result of one call of IPOPT."""

    point: Vector  # unknowns of `Collocation`
    speed: float  # m/s, collocated
    status: str
    iterations: int

    @property
    def gait(self) -> Vector:
        """The gait vector, smoothing again and phases within a cycle."""
        gait = to_smoothing(self.point[:N_GAIT])
        for c in range(2, N_GAIT, 5):
            gait[c] %= 1.0
        return gait


class Collocation:
    """Periodic optimal control of a `PlanarModel`: Radau IIA, two stages, third order.

    Unknowns: the ramped gait (16) and, for each interval, the state at 1/3 and at its end, over
    `STATE_SCALE`. Period, duties, phases, amplitudes, offsets and ramps are free within bounds. Ramps are
    no shorter than `ramp`, because a square edge has no gradient. The middle channel's phase stays fixed:
    an equal shift of all phases changes nothing.
    """

    def __init__(
        self, model: PlanarModel, bounds: GaitBounds, n_intervals: int, ramp: float, iterations: int
    ):
        """Set up the problem for IPOPT.

        Args:
            model: the planar model.
            bounds: box of gait vectors, and the servos' ranges.
            n_intervals: collocation intervals per cycle.
            ramp: least ramp of an edge, cycles.
            iterations: IPOPT's limit of one solution.
        """
        self.model, self.bounds, self.n = model, bounds, n_intervals
        self.ramp, self.iterations = ramp, iterations
        self._build()
        self._bound()

    def solve(self, point: Vector, width: float) -> Solution:
        """Optimise from a point, shape (16 + 8 n,), at one friction width, m/s."""
        lower, upper = self.lower.copy(), self.upper.copy()
        lower[2] = upper[2] = point[2]
        with interrupts_held():  # IPOPT would end only this start, and the plan would continue
            found = self.solver(
                x0=np.clip(point, lower, upper),
                p=width,
                lbx=lower,
                ubx=upper,
                lbg=self.lower_g,
                ubg=self.upper_g,
            )
        point = np.array(found["x"]).ravel()
        stats = self.solver.stats()
        return Solution(point, -float(found["f"]) / 10, stats["return_status"], stats["iter_count"])

    def guess(self, gait: Vector, width: float) -> Vector:
        """Unknowns on the integrated motion of a start, shape (16 + 8 n,)."""
        ramped = to_ramps(gait)
        for c in CHANNEL_STARTS:
            ramped[c + 4] = max(ramped[c + 4], self.ramp)
        motion = self.model.settled(ramped, width)
        grid = motion.time / motion.time[-1]
        ends = (np.arange(self.n) + 1) / self.n
        rows = [
            np.interp(at, grid, row) / scale
            for at in (ends - 2 / 3 / self.n, ends)
            for row, scale in zip(motion.state, STATE_SCALE, strict=True)
        ]
        return np.concatenate([ramped, np.array(rows).T.ravel()])

    def _interval(self) -> Symbol:
        """Return one interval's defects of both stages, and its travel over the cycle's length, m."""
        before, stage, after = (ca.SX.sym(k, N_STATE) for k in ("before", "stage", "after"))
        gait, start, width = ca.SX.sym("g", N_GAIT), ca.SX.sym("t"), ca.SX.sym("w")
        h = 1 / self.n
        scale = ca.DM(STATE_SCALE)
        f1, v1, _ = self.model.flow(stage * scale, gait, start + h / 3, width)
        f2, v2, _ = self.model.flow(after * scale, gait, start + h, width)
        defects = ca.vertcat(
            stage - before - h * (5 * f1 - f2) / 12 / scale,
            after - before - h * (3 * f1 + f2) / 4 / scale,
        )
        travel = h * (3 * v1 + v2) / 4
        return ca.Function("interval", [before, stage, after, gait, start, width], [defects, travel])

    def _build(self) -> None:
        n = self.n
        unknowns, width = ca.MX.sym("x", N_GAIT + 2 * N_STATE * n), ca.MX.sym("w")
        gait = unknowns[:N_GAIT]
        states = ca.reshape(unknowns[N_GAIT:], 2 * N_STATE, n)
        stages, ends = states[:N_STATE, :], states[N_STATE:, :]
        before = ca.horzcat(ends[:, -1], ends[:, :-1])
        starts = ca.DM(np.arange(n) / n).T
        defects, travel = self._interval().map(n)(
            before, stages, ends, ca.repmat(gait, 1, n), starts, ca.repmat(width, 1, n)
        )
        extremes = ca.vertcat(*[gait[c + 2] + gait[c + 3] for c in CHANNEL_STARTS])
        room = ca.vertcat(*[ca.vertcat(gait[c], 1 - gait[c]) - gait[c + 4] for c in CHANNEL_STARTS])
        problem = {
            "x": unknowns,
            "p": width,
            "f": -10 * ca.sum2(travel) / gait[0],
            "g": ca.vertcat(ca.vec(defects), extremes, room),
        }
        options = IPOPT_OPTIONS | {"ipopt.max_iter": self.iterations}
        self.solver = ca.nlpsol("plan", "ipopt", problem, options)

    def _bound(self) -> None:
        b, margin, slack = self.bounds, 0.2, 1e-6  # rad
        low, high = to_ramps(b.lower), to_ramps(b.upper)
        for c in CHANNEL_STARTS:
            low[c + 1], high[c + 1] = -2.0, 3.0  # phases may wind
            low[c + 4], high[c + 4] = self.ramp, 0.5
        momentum = self.model.parameters.mass / STATE_SCALE[0]  # 1 m/s
        state_low = np.tile([-momentum, *(b.angle_lower - margin)], 2 * self.n)
        state_high = np.tile([momentum, *(b.angle_upper + margin)], 2 * self.n)
        self.lower = np.concatenate([low, state_low])
        self.upper = np.concatenate([high, state_high])
        zeros = np.zeros(2 * N_STATE * self.n)
        self.lower_g = np.concatenate([zeros, b.angle_lower + slack, np.zeros(6)])
        self.upper_g = np.concatenate([zeros, b.angle_upper - slack, np.full(6, np.inf)])
