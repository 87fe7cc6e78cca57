"""Sealed cases of a second make: ArcFold walks by `other_walk`, and a camera of another make films it.

Nothing of `gaitopt` simulates, draws or measures here; it writes the files. Small errors are normal, not
uniform. Frames come late or not at all, their stamps are rounded, and recordings begin and end anywhere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tomli_w
from numpy.typing import NDArray
from other_walk import HINGES, ROW_S, Errors, Numerics, Walk, apart, square, walk
from sealed_cases import Key, Kind, draw, rms

from gaitopt.blind.sealed import PlantedEffect, Truth, seal
from gaitopt.core.files import write_text

Array = NDArray[np.float64]

PERIODS = {"square-4s": 4.0, "square-2s": 2.0, "square-1s": 1.0}
"""The gaits that are filmed, s."""

UNSEEN = {"square-0.5s": 0.5}
"""A gait that is not, s, and whose speed is to be predicted."""

FILM_S = 8.4, 10.5
"""Shortest and longest film, s."""

FLOORS = 3.0, 30.0
"""Gap of a case: the change by what was planted, the largest of all gaits, in floors."""

DRAWS = 60

_SERVO = ("all", "mid_act", "foot1", "foot2")
_ONE = ("mid_act", "foot1", "foot2")

KINDS: Mapping[str, Kind] = {
    "servo_torque_limit": Kind("limit_n_m", ((0.2, 0.05),), _SERVO, 0.245),
    "servo_speed_limit": Kind("limit_rad_s", ((5.0, 1.2),), _SERVO, math.inf),
    "servo_damping": Kind("scale", ((0.8, 0.3), (1.25, 3.5)), _SERVO, 1.0),
    "servo_deadband": Kind("half_width_rad", ((0.02, 0.1),), _SERVO),
    "servo_backlash": Kind("half_width_rad", ((0.02, 0.12),), _SERVO),
    "servo_travel": Kind("gain", ((0.95, 0.72), (1.05, 1.28)), _SERVO, 1.0),
    "servo_trim": Kind("offset_rad", ((0.04, 0.25), (-0.04, -0.25)), _SERVO),
    "servo_friction": Kind("torque_n_m", ((0.02, 0.14),), _SERVO),
    "servo_friction_load": Kind("share", ((0.1, 0.7),), _SERVO),
    "servo_sag": Kind("share_lost", ((0.15, 0.75),)),
    "channel_timing": Kind("delay_s", ((0.02, 0.14), (-0.02, -0.14)), _ONE),
    "command_latency": Kind("delay_s", ((0.02, 0.19),)),
    "hinge_friction": Kind("torque_n_m", ((0.003, 0.012),)),
    "hinge_nonlinearity": Kind("cubic_n_m_rad3", ((0.002, 0.007),)),
    "ground_slope": Kind("angle_rad", ((0.02, 0.115), (-0.02, -0.115))),
    "payload_mass": Kind("mass_kg", ((0.008, 0.048),)),
    "com_offset": Kind("offset_m", ((0.004, 0.018), (-0.004, -0.018))),
    "geometry_scale": Kind("scale", ((0.97, 0.87), (1.03, 1.14)), neutral=1.0),
    "tether_drag": Kind("force_n", ((0.02, 0.22),)),
    "pad_friction": Kind("scale", ((0.8, 0.35), (1.25, 2.8)), neutral=1.0),
    "body_friction": Kind("scale", ((0.8, 0.35), (1.25, 2.8)), neutral=1.0),
    "pad_imbalance": Kind("ratio", ((0.8, 0.35), (1.25, 2.8)), neutral=1.0),
    "contact_compliance": Kind("scale", ((0.7, 0.3), (1.4, 3.8)), neutral=1.0),
    "friction_anisotropy": Kind("ratio", ((0.8, 0.35), (1.25, 2.8)), neutral=1.0),
    "friction_direction": Kind("ratio", ((0.8, 0.35), (1.25, 2.8)), neutral=1.0),
    "friction_load": Kind("exponent", ((0.15, 0.9),)),
    "camera_scale": Kind("scale", ((0.97, 0.87), (1.03, 1.14)), neutral=1.0),
}
"""What may be planted, by the names and within the bounds of the effects."""

_CAMERA_SCALE: Key = ("camera_scale", "all")


@dataclass(frozen=True)
class Case:
    """A case before it is filmed.

    Attributes:
        kind: ``none``, ``single``, or ``several``: one to three effects on a robot with errors everywhere.
        robot: what is planted.
        errors: small errors of the robot.
        numerics: how it is simulated.
        chance: seed of its start and of the grip of its steps.
    """

    kind: str
    robot: Mapping[Key, float]
    errors: Errors
    numerics: Numerics
    chance: int


@dataclass(frozen=True)
class Maker:
    """Makes cases.

    Attributes:
        mjcf: the nominal model.
        pool: where robots walk.
        floors: what small errors and noise change, RMS of the marker in each gait, m.
    """

    mjcf: str
    pool: ProcessPoolExecutor
    floors: Mapping[str, float]

    @staticmethod
    def of(mjcf: str, pool: ProcessPoolExecutor) -> Maker:
        """Measure the floors: how far robots are from the nominal one that differ in small errors alone."""
        maker = Maker(mjcf, pool, {})
        nominal = Case("none", {}, Errors(), Numerics(), 0)
        others = [
            Case("none", {}, _small(np.random.default_rng([3, i])), Numerics(), 100 + i) for i in range(4)
        ]
        first, *walks = maker.walks([nominal, *others], PERIODS)
        noise = math.sqrt(3.0) * 0.65e-3
        floors = {
            name: math.hypot(
                noise, rms(np.array([apart(first[name].marker, one[name].marker) for one in walks]))
            )
            for name in PERIODS
        }
        return Maker(mjcf, pool, floors)

    def walks(self, cases: Sequence[Case], periods: Mapping[str, float]) -> list[dict[str, Walk]]:
        """Return the walks of some robots in some gaits."""
        futures = [
            {name: self.pool.submit(_walk, self.mjcf, case, period) for name, period in periods.items()}
            for case in cases
        ]
        return [{name: future.result() for name, future in row.items()} for row in futures]

    def make(self, kind: str, rng: np.random.Generator) -> tuple[Case, dict[str, Walk], dict[str, float]]:
        """Return a case, its walks, and the gap of everything planted, and of each effect beside the others.

        Raises:
            RuntimeError: no draw makes a gap.
        """
        for _ in range(DRAWS):
            case = _drawn(kind, rng)
            if not case.robot:
                (own,) = self.walks([case], PERIODS)
                return case, own, {"all": 0.0}
            twin = replace(case, robot={})
            own, none = self.walks([case, twin], PERIODS)
            gap = self._gap(case, own, twin, none)
            if not FLOORS[0] <= gap <= FLOORS[1]:
                continue
            alone = {key[0]: _without(case, key) for key in case.robot} if len(case.robot) > 1 else {}
            others = self.walks(list(alone.values()), PERIODS)
            seen = {
                name: self._gap(case, own, one, walks)
                for (name, one), walks in zip(alone.items(), others, strict=True)
            }
            return case, own, {"all": gap} | seen
        raise RuntimeError(f"{kind}: no draw makes a gap of {FLOORS[0]:g} floors")

    def _gap(self, case: Case, own: Mapping[str, Walk], other: Case, walks: Mapping[str, Walk]) -> float:
        """Return how far two cases are apart as they are filmed, the largest of all gaits, in floors."""
        gaps = [
            apart(_scale(case) * own[name].marker, _scale(other) * walks[name].marker) / self.floors[name]
            for name in PERIODS
        ]
        return max(gaps)


def _walk(mjcf: str, case: Case, period_s: float) -> Walk:
    rows = square(period_s, FILM_S[1] + period_s)
    rng = np.random.default_rng([case.chance, round(1e3 * period_s)])
    return walk(
        mjcf,
        _without(case, _CAMERA_SCALE).robot,
        case.errors,
        rows,
        case.numerics,
        rng if case.chance else None,
    )


def _drawn(kind: str, rng: np.random.Generator) -> Case:
    """Draw what is planted, small errors and numerics."""
    count = {"none": 0, "single": 1, "several": int(rng.integers(1, 4))}[kind]
    names = [str(name) for name in rng.choice(sorted(KINDS), count, replace=False)]
    robot = dict(draw(name, KINDS[name], None, rng) for name in names)
    errors = _everywhere(rng) if kind == "several" else _small(rng)
    step_s = float(rng.choice([1e-3 / 5, 1e-3 / 4]))
    numerics = Numerics(step_s, bool(rng.integers(2)), float(rng.choice([5.0, 20.0, 40.0])))
    return Case(kind, robot, errors, numerics, int(rng.integers(1, 2**31)))


def _small(rng: np.random.Generator) -> Errors:
    """Draw masses that are 2 % wrong, and hinges that are 5 % wrong."""
    return Errors(masses=_each(BODIES, 0.02, rng), stiffness=_each(HINGES, 0.05, rng))


def _everywhere(rng: np.random.Generator) -> Errors:
    """Draw errors of everything, as large as in the problem's ``[tolerances]``."""
    floor = float(rng.normal(0.0, 0.087))
    grip = {name: floor + error for name, error in _each(GEOMS, 0.03, rng).items()}
    strength = rng.normal(0.0, 0.058) + rng.normal(0.0, 0.03, 3)
    trims = math.radians(1.15) * rng.standard_normal(3)
    servos = np.stack([strength, rng.normal(0.0, 0.06, 3), rng.normal(0.0, 0.06, 3), trims])
    slope = tuple(math.radians(0.17) * rng.standard_normal(2))
    small = _small(rng)
    return Errors(small.masses, small.stiffness, grip, servos, slope, float(rng.uniform(0.02, 0.08)))


BODIES = ("base_bot", "first_left", "second_left", "tail_bot", "first_right", "second_right", "tail_right")
GEOMS = (*BODIES, "base_left", "base_right", "tail_left", "foot1_pad", "foot2_pad")


def _each(names: Sequence[str], sd: float, rng: np.random.Generator) -> dict[str, float]:
    return dict(zip(names, rng.normal(0.0, sd, len(names)).tolist(), strict=True))


def _without(case: Case, key: Key) -> Case:
    return replace(case, robot={one: value for one, value in case.robot.items() if one != key})


def _scale(case: Case) -> float:
    """Return the planted scale of the camera: seen over true length."""
    return case.robot.get(_CAMERA_SCALE, 1.0)


def speed_of(one: Walk, period_s: float) -> float:
    """Return the forward speed over whole cycles after the first two seconds, m/s."""
    end = float(one.time[-1])
    cycles = math.floor((end - 2.0) / period_s)
    begin = round((end - cycles * period_s) / ROW_S)
    return float(one.marker[-1, 0] - one.marker[begin, 0]) / (cycles * period_s)


# --- films ------------------------------------------------------------------------------------


def write_case(
    folder: Path,
    name: str,
    case: Case,
    walks: Mapping[str, Walk],
    gaps: Mapping[str, float],
    speeds: Mapping[str, float],
    rng: np.random.Generator,
) -> None:
    """Film a case, write its data set to FOLDER/NAME, and its truth to FOLDER/sealed/NAME.json."""
    (folder / name).mkdir(parents=True, exist_ok=True)
    camera = _Camera.drawn(case, rng)
    trials = [_film(folder / name, gait, walks[gait], camera, rng) for gait in PERIODS]
    write_text(folder / name / "dataset.toml", tomli_w.dumps({"trial": trials}))
    truth = Truth(
        kind=case.kind,
        effects=tuple(
            PlantedEffect(name=effect, target=target, parameters={KINDS[effect].parameter: value})
            for (effect, target), value in case.robot.items()
        ),
        gap_over_floor=gaps["all"],
        figures={"known": float(camera.known), "grid_s": camera.grid_s, "fps": camera.fps},
        seen={effect: gap for effect, gap in gaps.items() if effect != "all"},
        trials=tuple(PERIODS),
        speeds_m_s=dict(speeds),
    )
    seal(folder, name, truth)


@dataclass(frozen=True)
class _Camera:
    """A camera.

    Attributes:
        known: whether it shows when the gait begins.
        fps: frames per second.
        grid_s: stamps are multiples of this, s.
        noise_m: noise of positions, m.
        scale, tilt, rate: seen over true length; about the sideways axis, rad; its time over the true one.
    """

    known: bool
    fps: float
    grid_s: float
    noise_m: float
    scale: float
    tilt: float
    rate: float

    @staticmethod
    def drawn(case: Case, rng: np.random.Generator) -> _Camera:
        wrong = float(case.kind == "several")
        scale = _scale(case) * (1.0 + wrong * rng.normal(0.0, 0.006))
        tilt, rate = wrong * math.radians(rng.normal(0.0, 0.3)), 1.0 + wrong * rng.normal(0.0, 0.0006)
        late = any(name == "command_latency" for name, _ in case.robot)
        known = late or bool(rng.integers(2))  # where the start is not known, nobody can tell what comes late
        fps, grid = float(rng.choice([25.0, 30.0, 60.0])), float(rng.choice([0.001, 0.01]))
        return _Camera(known, fps, grid, float(rng.uniform(3e-4, 1e-3)), scale, tilt, rate)

    def see(self, marker: Array) -> Array:
        """Return a path as it is seen, m, shape (n, 3)."""
        c, s = math.cos(self.tilt), math.sin(self.tilt)
        turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
        seen: Array = self.scale * marker @ turn.T
        return seen


def _film(folder: Path, gait: str, one: Walk, camera: _Camera, rng: np.random.Generator) -> dict[str, object]:
    """Write one film's track, and return its entry in the data set."""
    period, length = PERIODS[gait], float(rng.uniform(*FILM_S))
    begin = float(rng.uniform(0.0, 0.3) if camera.known else rng.uniform(-0.9, 0.9) * period)
    time = np.arange(0.0, length, 1.0 / camera.fps)
    time = time[rng.random(len(time)) > 0.02] + np.abs(rng.normal(0.0, 5e-4, 1))
    taken = time + np.abs(rng.normal(0.0, 1e-3, len(time)))
    stamps = np.round(camera.rate * taken / camera.grid_s) * camera.grid_s
    fresh = np.append(True, np.diff(stamps) > 0.0)
    marker = np.stack([np.interp(taken + begin, one.time, column) for column in one.marker.T], axis=1)
    seen = camera.see(marker) + camera.noise_m * rng.standard_normal(marker.shape) + rng.uniform(-0.4, 0.4, 3)
    angle = np.interp(taken + begin, one.time, one.middle) + 2e-3 * rng.standard_normal(len(taken))
    rows = [
        f"{t:.3f},{x:.5f},{y:.5f},{z:.5f},{a:.4f}"
        for t, (x, y, z), a, kept in zip(stamps, seen, angle, fresh, strict=True)
        if kept
    ]
    write_text(folder / f"{gait}.csv", "\n".join(["t_s,x_m,y_m,z_m,middle_rad", *rows]) + "\n")
    signals = {"marker.x": "x_m", "marker.y": "y_m", "marker.z": "z_m", "joint.mid_left": "middle_rad"}
    start = {"starts_at_gait_time_s": round(begin, 3)} if camera.known else {}
    return {"name": gait, "gait": gait, "file": f"{gait}.csv", "fps": camera.fps, "signals": signals} | start
