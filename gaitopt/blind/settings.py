"""How blind cases are drawn: kinds, gaps, numerics and cameras."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from gaitopt.problem.records import Fidelity


@dataclass(frozen=True)
class BlindSettings:
    """How blind cases are drawn. Gaps are in floors: what noise and small unknown errors change.

    Attributes:
        shares: share of each kind of case.
        smallest, largest: gap planted.
        pair_share: each of two or more effects alone makes at most this share of the largest gap.
        most_effects: effects of a case with several of them, at most.
        grip: range of the chance of each pad's grip in such a case; see `grip_variation`.
        misfit_share: share of the trials of such cases that fit no other.
        excess: two effects together, or one by other numerics, may make this many times the largest gap.
        close: a drawn gap is accepted at once between this and the next share of the one that is wanted.
        wide: see `close`.
        bisections: sizes of an effect tried for one gap.
        effects_tried: effects drawn until one makes a gap.
        cases_tried: cases drawn until one makes a gap by other numerics too.
        fidelities: timesteps and integrators of the robots recorded; the diagnosis uses another.
        impratios: stiffness of their friction cones; see MuJoCo's ``impratio``.
        frame_rates: frames per second of the cameras.
        marker_noise_m: range of the marker's noise, m: standard deviations of trackers on films.
        angle_noise_rad: standard deviation of an angle's noise, rad.
        joint_floor_rad: floor of a joint's angle, rad.
        start_pose: error of the start pose, in multiples of the problem's.
        floor_robots: perturbed robots by which the marker's floor is measured.
        known_share: share of cases that say when the recording begins.
        least_cycles: a recording has at least this many cycles.
    """

    shares: Mapping[str, float] = field(
        default_factory=lambda: {"single": 0.6, "none": 0.18, "outside": 0.12, "pair": 0.1}
    )
    smallest: float = 3.0
    largest: float = 30.0
    pair_share: float = 0.7
    most_effects: int = 4
    grip: tuple[float, float] = (0.02, 0.08)
    misfit_share: float = 0.1
    excess: float = 1.5
    close: float = 0.6
    wide: float = 1.6
    bisections: int = 7
    effects_tried: int = 12
    cases_tried: int = 8
    fidelities: Sequence[Fidelity] = (
        Fidelity(timestep_s=5e-4, integrator="RK4"),
        Fidelity(timestep_s=2.5e-4, integrator="Euler"),
        Fidelity(timestep_s=3e-4, integrator="implicit"),
    )
    impratios: Sequence[float] = (5.0, 20.0, 40.0)
    frame_rates: Sequence[float] = (25.0, 30.0, 50.0, 60.0)
    marker_noise_m: tuple[float, float] = (3e-4, 1e-3)
    angle_noise_rad: float = 2e-3
    joint_floor_rad: float = 3e-3
    start_pose: float = 0.6
    floor_robots: int = 4
    known_share: float = 0.5
    least_cycles: float = 2.1

    def fits(self, gap: float, most: float) -> bool:
        """Whether a gap is at least the smallest and at most `most`, floors."""
        return self.smallest <= gap <= most


DEFAULT = BlindSettings()
"""How the cases of the record are drawn."""
