"""A finding of the audit, and what to do about each kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any


@dataclass(frozen=True)
class FindingKind:
    """A kind of finding.

    Attributes:
        name: its name.
        remedy: what to do about it.
    """

    name: str
    remedy: str


NO_GROUND = FindingKind(
    "no_ground",
    'Add a floor to the worldbody, <geom name="floor" type="plane" size="5 5 0.1"/>, and let contype and '
    "conaffinity of floor and feet match.",
)
DOES_NOT_STAND = FindingKind(
    "does_not_stand",
    "Correct [start] ctrl_deg, or give the MJCF a keyframe in which the robot stands. If servos give way, "
    "look at their torque limit (forcerange), their kp and the masses: 1 kg at 0.1 m needs 1 N m.",
)
FELL_OVER = FindingKind(
    "fell_over",
    "Make the gait slower or smaller, or the stance wider; limit tilt_rad in [objective.constraints], so "
    "that a search does not count falling as walking.",
)
UNREST_AT_START = FindingKind(
    "unrest_at_start",
    "Let the robot settle under its start targets, and start there. Look for overlapping geoms and for "
    "springs that are not at rest.",
)
INERT_PARAMETER = FindingKind(
    "inert_parameter",
    "Make the parameter act on what it is meant to change, or remove it: a number that does nothing misleads "
    "whoever sets it.",
)
DIVERGED = FindingKind(
    "diverged",
    "Add armature and damping to the joints (a servo of 9 g has about 1e-4 kg m^2 and 0.01 N m s/rad), take "
    "a smaller timestep, an implicit integrator, or softer or fewer contacts.",
)
SELF_COLLISION = FindingKind(
    "self_collision", "Exclude pairs of parts that are meant to touch, and move the other parts apart."
)
AIRTIME = FindingKind(
    "airtime",
    "A crawler does not fly, a trot does for moments. Look for servos without a torque limit, masses and "
    "lengths in wrong units, and contacts that throw the robot.",
)
SIDEWAYS_DRIFT = FindingKind(
    "sideways_drift",
    "Look for what is not symmetric: contacts, inertias, start pose. Or steer against the drift.",
)
CHAOS = FindingKind(
    "chaos",
    "Judge by means over many start poses, never by one rollout. Leaps and self-collision cause chaos.",
)
COMMAND_NOT_FOLLOWED = FindingKind(
    "command_not_followed",
    "Make the gait slower or smaller, or the servo stronger if the real one is. Until then, commanded angles "
    "say little about motion.",
)
TIMESTEP_CONVERGENCE = FindingKind(
    "timestep_convergence",
    "Take the timestep that is named, or half of it until halving changes nothing: timestep_s of working in "
    "[simulation], and a quarter of that for reference. Stiff servos and light links need short ones.",
)

SEEN_FIRST = (NO_GROUND, DOES_NOT_STAND, FELL_OVER)
"""What a person would see before anything else; it explains most of the other findings."""

_KINDS = (
    *SEEN_FIRST,
    UNREST_AT_START,
    INERT_PARAMETER,
    DIVERGED,
    SELF_COLLISION,
    AIRTIME,
    SIDEWAYS_DRIFT,
    CHAOS,
    COMMAND_NOT_FOLLOWED,
    TIMESTEP_CONVERGENCE,
)

FINDING_KINDS: dict[str, FindingKind] = {kind.name: kind for kind in _KINDS}
"""Every kind of finding by name."""


@dataclass(frozen=True)
class Finding:
    """One defect of a model.

    Attributes:
        name: its kind.
        gait: the gait that shows it; empty for the model itself.
        value: the figure found.
        limit: the figure allowed.
        message: what was found, in words.
        parameter: the named parameter without effect; empty for other kinds.
        servo: the servo that shows it; empty where it is the whole robot.
    """

    name: str
    gait: str
    value: float
    limit: float
    message: str
    parameter: str = ""
    servo: str = ""

    @property
    def place(self) -> str:
        """Gait and servo that show it; empty for the model itself."""
        return ", ".join(filter(None, (self.gait, self.servo)))

    @property
    def remedy(self) -> str:
        """What to do about it."""
        return FINDING_KINDS[self.name].remedy

    def to_dict(self) -> dict[str, Any]:
        """Return the finding for a JSON file."""
        return asdict(self)


_NAMED = 3
"""Servos that are named of those that do not follow."""


def brief(findings: Sequence[Finding]) -> list[Finding]:
    """Return findings with all servos that do not follow in a gait as one, the worst named."""
    late: dict[str, list[Finding]] = {}
    for one in findings:
        if one.name == COMMAND_NOT_FOLLOWED.name:
            late.setdefault(one.gait, []).append(one)
    merged = {gait: _merged(servos) for gait, servos in late.items() if len(servos) > 1}
    shown = []
    for one in findings:
        whole = merged.get(one.gait) if one.name == COMMAND_NOT_FOLLOWED.name else None
        if whole is None:
            shown.append(one)
        elif one is late[one.gait][0]:
            shown.append(whole)
    return shown


def _merged(servos: Sequence[Finding]) -> Finding:
    ranked = sorted(servos, key=lambda one: one.value)
    worst = ", ".join(f"{one.servo} {one.value:.0%}" for one in ranked[:_NAMED])
    rest = f" and {len(ranked) - _NAMED} more" if len(ranked) > _NAMED else ""
    message = f"{len(ranked)} servos do not reach their commanded travel: {worst} of it{rest}"
    return replace(ranked[0], message=message, servo="")
