"""Planar model: a two-module crawler reduced to what moves it forward.

The crawler is a rear and a front module joined by an arch of two links.
A middle servo folds the arch.  Each module carries a foot: a pad that a
servo swings about the body's long axis.  All motion but the forward one is
replaced by statics.

**State** ``[P, q, f1, f2]``: forward momentum [kg m/s], middle angle and foot
angles [rad]; the rear module's position is a quadrature.

*Servos.*  A position servo with damping ``b`` and a torque limit follows

    b q' = sat(kp (target - q)) - k q,    sat(z) = z / (1 + (z/tau)^6)^(1/6)

which is the torque-speed line.  The lag of its armature (J/b, 3 ms) and the
load's reaction (under a tenth of the limit) are neglected.

*Arch.*  The module distance is d(q) = 2 L cos(q/2).  With the links' mass split
evenly between its ends (exact for the horizontal momentum of uniform links)

    P = M v1 + (m2 + ml/2) d',    v2 = v1 + d',    P' = F1 + F2

so an infinitely stiff arch needs no internal force.

*Which parts touch.*  A pad of half width r and half thickness t reaches
h(f) = r |sin f| + t cos f - c below the body's underside.  Where only one pad
is down, it carries its module.  Where both are, the body rolls away from the
pads' lower edges, y(f) = r cos f off the middle, by the smaller of the angles
h / (w + y).  The weaker module ("w") then shares its load between its pad and the
body's far edge; the other ("o") stands on its pad only.  The balance of the roll
moments about the centre line gives the weaker pad's share

    p = (Nw w - No yo) / (Nw (w + yw))

Steps between these cases are tanh over a height of ``contact_blur`` and an angle
of ``roll_blur``.  The loads N1, N2 follow from the lever rule on the two supports.

*Friction.*  The swing of a foot makes the pad or the body edge of its module slide
sideways at r sin f f'.  The slip is split between them, more for the one that grips
less.  Coulomb friction opposes the total slip:

    F = -N [mu_pad p v / |v|_pad + mu_body (1-p) v / |v|_body],
    |v|_k = sqrt(v^2 + sideways_k^2 + width^2)

``width`` [m/s] smooths the law.  It is reduced in steps; it makes the model creep
by `PlanarModel.creep`.

Not modelled: sideways motion and yaw, the dynamics of roll and of landing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from gaitopt.plan.gait_vector import CHANNEL_STARTS, N_GAIT, Vector, to_ramps
from gaitopt.plan.parameters import PlanarParameters

Symbol = Any
"""A CasADi expression; the package has no type hints."""

N_STATE = 4
"""Numbers of the state."""

SERVO_SHARPNESS = 6
"""Exponent of the smoothed torque limit."""


@dataclass(frozen=True)
class Cycle:
    """One cycle of the periodic motion; arrays over n + 1 instants."""

    time: Vector  # s
    state: Vector  # (4, n + 1)
    position: Vector  # m, rear module
    speed: float  # m/s


def _smooth_abs(value: Symbol, width: float) -> Symbol:
    return ca.sqrt(value**2 + width**2)


def _step(value: Symbol, width: float) -> Symbol:
    return 0.5 * (1 + ca.tanh(value / width))


def _positive(value: Symbol, width: float) -> Symbol:
    return 0.5 * (value + _smooth_abs(value, width))


def channel_target(
    cycle: Symbol, duty: Symbol, phase: Symbol, amplitude: Symbol, offset: Symbol, ramp: Symbol
) -> Symbol:
    """Commanded angle at a time in cycles; half-cosine ramps centred on the edges.

    The pulse is symmetric about its middle, so with u the distance from the middle
    in cycles, target = offset + amplitude (1 - sin(pi clip((u - duty/2) / ramp))) / 2.
    """
    shifted = cycle + phase - duty / 2 + 0.5
    from_middle = ca.fabs(shifted - ca.floor(shifted) - 0.5)
    edge = ca.fmax(-0.5, ca.fmin(0.5, (from_middle - duty / 2) / ramp))
    return offset + amplitude * 0.5 * (1 - ca.sin(ca.pi * edge))


class PlanarModel:
    """The reduced crawler as CasADi functions.

    Inside, gaits carry ramps (see `to_ramps`): the duty's smaller side has a kink at
    one half, where the baselines sit.  Public methods take the gait's own vector
    ``[period, (duty, phase, amplitude, offset, smoothing) x 3]``, s, cycles and rad.
    """

    def __init__(self, parameters: PlanarParameters):
        self.parameters = parameters
        state, gait = ca.SX.sym("state", N_STATE), ca.SX.sym("gait", N_GAIT)
        cycle, width = ca.SX.sym("cycle"), ca.SX.sym("width")
        targets = [channel_target(cycle, *ca.vertsplit(gait[c : c + 5])) for c in CHANNEL_STARTS]
        rates, speed, loads = self._equations(state, targets, width)
        self.flow = ca.Function(
            "flow", [state, gait, cycle, width], [rates * gait[0], speed * gait[0], loads]
        )
        self._cycles: dict[int, Symbol] = {}

    def speed(self, gait: Vector, width: float = 0.005) -> float:
        """Mean forward speed of the periodic motion, m/s."""
        return self.cycle(gait, width).speed

    def cycle(self, gait: Vector, width: float = 0.005) -> Cycle:
        """The periodic motion by plain integration (Runge-Kutta 4), settled first."""
        return self.settled(to_ramps(gait), width)

    def creep(self, gait: Vector, width: float = 0.005) -> float:
        """Speed that smoothing adds (negative: takes), m/s.

        The change from width/4 to width, times 4/3, as if it were proportional to width.
        """
        return (self.speed(gait, width) - self.speed(gait, width / 4)) * 4 / 3

    def settling_cycles(self, period: float) -> int:
        """Cycles of the start-up: those of one second, and one more."""
        return math.ceil(1 / period) + 1

    def rollout(self, n_steps: int) -> Symbol:
        """One cycle: (state and position (5,), ramped gait, width) -> (5, n_steps)."""
        if n_steps not in self._cycles:
            self._cycles[n_steps] = self._build_rollout(n_steps)
        return self._cycles[n_steps]

    def start_state(self, gait: Vector) -> Vector:
        """At rest, every servo half-way up its travel, position 0; shape (5,)."""
        angles = [gait[c + 3] + gait[c + 2] / 2 for c in CHANNEL_STARTS]
        return np.array([0.0, *angles, 0.0])

    def steps_for(self, period: float, width: float) -> int:
        """Steps that keep Runge-Kutta 4 stable on the stiffest friction, at least 200."""
        rate = self.parameters.mu_pad * self.parameters.gravity / width
        return 200 * max(1, math.ceil(period * rate / 2 / 200))

    def settled(self, ramped: Vector, width: float) -> Cycle:
        """`cycle` of a ramped gait."""
        n = self.steps_for(ramped[0], width)
        roll, state = self.rollout(n), self.start_state(ramped)
        for _ in range(self.settling_cycles(ramped[0])):
            state = np.array(roll(state, ramped, width))[:, -1]
        state[-1] = 0.0
        motion = np.column_stack([state, np.array(roll(state, ramped, width))])
        time = np.linspace(0, ramped[0], n + 1)
        return Cycle(time, motion[:-1], motion[-1], motion[-1, -1] / ramped[0])

    def _build_rollout(self, n: int) -> Symbol:
        state: Symbol = ca.SX.sym("state", N_STATE + 1)
        gait: Symbol = ca.SX.sym("gait", N_GAIT)
        step: Symbol = ca.SX.sym("step")
        width: Symbol = ca.SX.sym("width")

        def rate(at: Symbol, cycle: Symbol) -> Symbol:
            rates, speed, _ = self.flow(at[:N_STATE], gait, cycle, width)
            joined: Symbol = ca.vertcat(rates, speed)
            return joined / n

        k1: Symbol = rate(state, step / n)
        k2 = rate(state + k1 / 2, (step + 0.5) / n)
        k3 = rate(state + k2 / 2, (step + 0.5) / n)
        k4 = rate(state + k3, (step + 1) / n)
        after = state + (k1 + 2 * k2 + 2 * k3 + k4) / 6
        one = ca.Function("step", [state, gait, step, width], [after]).mapaccum(n)
        start, gaits, blur = ca.MX.sym("s", N_STATE + 1), ca.MX.sym("g", N_GAIT), ca.MX.sym("w")
        path = one(start, ca.repmat(gaits, 1, n), ca.DM(np.arange(n)).T, ca.repmat(blur, 1, n))
        return ca.Function("cycle", [start, gaits, blur], [path])

    def _equations(
        self, state: Symbol, targets: list[Symbol], width: Symbol
    ) -> tuple[Symbol, Symbol, Symbol]:
        p = self.parameters
        parts: list[Symbol] = ca.vertsplit(state)
        momentum, q, f1, f2 = parts
        stiffness, damping = p.hinge_stiffness, p.servo_damping + p.hinge_damping
        q_rate = self._servo_rate(targets[0], q, stiffness, damping)
        f1_rate = self._servo_rate(targets[1], f1, 0.0, p.servo_damping)
        f2_rate = self._servo_rate(targets[2], f2, 0.0, p.servo_damping)
        distance = 2 * p.link_length * ca.cos(0.5 * q)
        stretch = -p.link_length * ca.sin(0.5 * q) * q_rate
        v1 = (momentum - p.front_share * stretch) / p.mass
        share1, share2 = self._pad_shares(f1, f2, distance)
        n1, n2 = self._loads(share1, share2, distance)
        force1 = -n1 * self._grip(share1, f1, f1_rate, v1, width)
        force2 = -n2 * self._grip(share2, f2, f2_rate, v1 + stretch, width)
        loads = ca.vertcat(n1 * (1 - share1), n1 * share1, n2 * (1 - share2), n2 * share2)
        return ca.vertcat(force1 + force2, q_rate, f1_rate, f2_rate), v1, loads

    def _servo_rate(self, target: Symbol, angle: Symbol, stiffness: float, damping: float) -> Symbol:
        p = self.parameters
        torque = p.servo_gain * (target - angle)
        limit = (1 + (torque / p.servo_torque_limit) ** SERVO_SHARPNESS) ** (-1 / SERVO_SHARPNESS)
        return (torque * limit - stiffness * angle) / damping

    def _reach(self, foot: Symbol) -> Symbol:
        """How far a pad reaches below the underside, m; negative when retracted."""
        p = self.parameters
        swing = p.pad_half_width * _smooth_abs(ca.sin(foot), 3e-3)
        return swing + p.pad_half_thickness * ca.cos(foot) - p.underside

    def _centre(self, distance: Symbol) -> Symbol:
        """Centre of mass ahead of the rear edge, m."""
        p = self.parameters
        front = p.module_length + distance
        arch = p.arch_mass * (p.module_length + distance / 2)
        return (p.rear_mass * p.rear_com + p.front_mass * (front + p.front_com) + arch) / p.mass

    def _pad_shares(self, f1: Symbol, f2: Symbol, distance: Symbol) -> tuple[Symbol, Symbol]:
        """Share of each module's load that its pad carries, 0 to 1."""
        p = self.parameters
        front = p.module_length + distance
        reach1, reach2 = self._reach(f1), self._reach(f2)
        # the other module's lift tilts the body down on this side's outer edge
        tilt1 = p.rear_pad / (front + p.front_pad)
        tilt2 = (p.module_length - p.front_pad) / (front + p.module_length - p.rear_pad)
        down1 = _step(reach1 - tilt1 * _positive(reach2, p.contact_blur), p.contact_blur)
        down2 = _step(reach2 - tilt2 * _positive(reach1, p.contact_blur), p.contact_blur)
        edge1, edge2 = p.pad_half_width * ca.cos(f1), p.pad_half_width * ca.cos(f2)
        roll1, roll2 = (
            reach / (p.module_half_width + edge) for reach, edge in ((reach1, edge1), (reach2, edge2))
        )
        rear_stronger = _step(roll1 - roll2, p.roll_blur)
        load2 = (self._centre(distance) - p.rear_pad) / (front + p.front_pad - p.rear_pad)
        lost1 = self._share_lost(1 - load2, edge1, load2, edge2)
        lost2 = self._share_lost(load2, edge2, 1 - load2, edge1)
        share1 = down1 * (1 - (1 - rear_stronger) * down2 * lost1)
        share2 = down2 * (1 - rear_stronger * down1 * lost2)
        return share1, share2

    def _share_lost(self, load: Symbol, edge: Symbol, other_load: Symbol, other_edge: Symbol) -> Symbol:
        half_width = self.parameters.module_half_width
        return 1 - (load * half_width - other_load * other_edge) / (load * (half_width + edge))

    def _loads(self, share1: Symbol, share2: Symbol, distance: Symbol) -> tuple[Symbol, Symbol]:
        """Load of each module from the lever rule on outer edges and pads, N."""
        p = self.parameters
        weight = p.mass * p.gravity
        rear = share1 * p.rear_pad
        front = distance + 2 * p.module_length - share2 * (p.module_length - p.front_pad)
        n2 = weight * (self._centre(distance) - rear) / (front - rear)
        return weight - n2, n2

    def _grip(self, share: Symbol, foot: Symbol, foot_rate: Symbol, speed: Symbol, width: Symbol) -> Symbol:
        """Friction over load, positive for forward slip."""
        p = self.parameters
        pad, body = p.mu_pad * share, p.mu_body * (1 - share)
        sideways = p.pad_half_width * ca.sin(foot) * foot_rate
        pad_part = body**2 / (pad**2 + body**2)
        pad_slip = ca.sqrt(speed**2 + (sideways * pad_part) ** 2 + width**2)
        body_slip = ca.sqrt(speed**2 + (sideways * (1 - pad_part)) ** 2 + width**2)
        return speed * (pad / pad_slip + body / body_slip)
