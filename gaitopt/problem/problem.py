"""A problem: a robot's MJCF and a file that says what its parameters, channels, limits and aims are."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from gaitopt.core.errors import GaitoptError, bad_value, unknown_name
from gaitopt.core.files import Name, inside, read_toml, validated
from gaitopt.effects.active import ActiveEffect, Values, active_effects
from gaitopt.gait.calibration import Calibration
from gaitopt.gait.gait import Channel, Gait, read_gait
from gaitopt.gait.space import ChannelSpace, GaitSpace
from gaitopt.gait.table import is_table, read_table
from gaitopt.robot.roles import Roles

PROBLEM_FILE = "problem.toml"

_Positive = Annotated[float, Field(strict=True, gt=0.0, allow_inf_nan=False)]
_Period = Annotated[float, Field(strict=True, ge=1e-3, le=1e6, allow_inf_nan=False)]
_NonNegative = Annotated[float, Field(strict=True, ge=0.0, allow_inf_nan=False)]
_Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
_Number = Annotated[float, Field(strict=True)]
_Interval = Annotated[tuple[_Finite, _Finite], Field()]
Integrator = Literal["Euler", "RK4", "implicit", "implicitfast"]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


def _ordered(key: str, interval: tuple[float, float]) -> None:
    if interval[0] > interval[1]:
        raise ValueError(f"{key}: found {list(interval)}; allowed: [low, high] with low <= high")


class Parameter(_Record):
    """A named number of the model.

    Attributes:
        value: nominal value in `unit`.
        unit: its unit, in words.
        origin: where the number comes from: measured, datasheet, assumed.
        sets: MJCF attributes it is written to: XPaths ending in ``/@attribute``, each with the text
            to write, in which ``{}`` stands for the value.
    """

    value: _Finite
    unit: str
    origin: str
    sets: dict[str, str] = {}

    @model_validator(mode="before")
    @classmethod
    def _paths_alone_take_the_value(cls, values: Any) -> Any:
        if isinstance(values, dict) and isinstance(values.get("sets"), list):
            return values | {"sets": {str(path): "{}" for path in values["sets"]}}
        return values


class Start(_Record):
    """The state before the gait: targets held, and whether the robot first comes to rest under them.

    Attributes:
        ctrl_deg: held target of each channel; 0 where a channel is not named.
        settle: let the robot come to rest; otherwise the MJCF's keyframe ``start`` is used as it is.
    """

    ctrl_deg: dict[str, _Finite] = {}
    settle: bool = True


class ChannelBounds(_Record):
    """What a search may do with one actuator (see `ChannelSpace`), and the servo that is behind it."""

    range_deg: _Interval
    amplitude_deg: _Interval
    duty: _Interval = (0.1, 0.9)
    smoothing: _Interval = (0.0, 1.0)
    servo: Calibration = Calibration()

    @model_validator(mode="after")
    def _check(self) -> ChannelBounds:
        for key in ("range_deg", "amplitude_deg", "duty", "smoothing"):
            _ordered(key, getattr(self, key))
        for key in ("duty", "smoothing"):
            low, high = getattr(self, key)
            if low < 0.0 or high > 1.0:
                raise ValueError(f"{key}: found {[low, high]}; allowed: inside 0 to 1")
        width = self.range_deg[1] - self.range_deg[0]
        widest = max(abs(end) for end in self.amplitude_deg)
        if widest > width:
            raise ValueError(f"amplitude_deg: found {widest:g}; allowed: at most the range's {width:g}")
        return self

    @property
    def space(self) -> ChannelSpace:
        """The same bounds as the search sees them."""
        return ChannelSpace(self.range_deg, self.amplitude_deg, self.duty, self.smoothing)


class Baseline(_Record):
    """A hand-tuned gait: a whole gait, or another baseline's wave at another period."""

    period_s: _Period
    like: str | None = None
    channels: dict[str, Channel] | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Baseline:
        if (self.like is None) == (self.channels is None):
            raise ValueError('allowed: either `channels` or `like = "another baseline"`, not both')
        return self


class Fidelity(_Record):
    """How finely a simulation is integrated."""

    timestep_s: Annotated[float, Field(ge=1e-6, le=0.1)]
    integrator: Integrator


class Horizon(_Record):
    """Which part of a rollout counts: whole cycles after the transient.

    Attributes:
        transient_s, transient_cycles: at least this long is thrown away first.
        measured_s, measured_cycles: at least this long is measured.
    """

    transient_s: Annotated[_NonNegative, Field(le=1e6)] = 1.0
    transient_cycles: Annotated[int, Field(ge=0, le=1000)] = 1
    measured_s: Annotated[_Positive, Field(le=1e6)] = 4.0
    measured_cycles: Annotated[int, Field(ge=1, le=1000)] = 2

    def cycles(self, period_s: float) -> tuple[int, int]:
        """Return the numbers of transient and of measured cycles at a period."""
        transient = max(self.transient_cycles, _ceil(self.transient_s / period_s))
        return transient, max(self.measured_cycles, _ceil(self.measured_s / period_s))


class Simulation(_Record):
    """Working and reference fidelity, and the horizon of a rollout."""

    working: Fidelity
    reference: Fidelity
    horizon: Horizon = Horizon()


class Servo(_Record):
    """How commands reach the servos.

    Attributes:
        frame_s: period of the servo signal; a target is sent once a frame and acts one frame later.
    """

    frame_s: _Positive = 0.02


class ScenarioSpread(_Record):
    """How scenarios differ from the nominal robot.

    Attributes:
        search, verification: how many scenarios each uses; those of verification are never searched on.
        friction: half-width of the uniform relative change of every friction coefficient.
        servo_strength: half-width of the uniform relative change of the servos' torque limit.
        servo_trim_deg: half-width of the uniform zero error of each servo.
        start_pose_rad: standard deviation of the error of each joint's start angle and of the heading.
        framed: the last scenario is played at the servo's frame rate, one frame late.
    """

    search: Annotated[int, Field(ge=1, le=1000)] = 3
    verification: Annotated[int, Field(ge=2, le=1000)] = 16
    friction: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.15
    servo_strength: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.1
    servo_trim_deg: Annotated[float, Field(ge=0.0, le=45.0)] = 0.0
    start_pose_rad: Annotated[float, Field(ge=0.0, le=0.5)] = 0.005
    framed: bool = True


class Constraint(_Record):
    """A limit on a metric: at most `max` and at least `min`, each with the size of a serious violation."""

    max: float | None = None
    min: float | None = None
    scale: _Positive = 1.0

    @model_validator(mode="after")
    def _has_a_limit(self) -> Constraint:
        if self.max is None and self.min is None:
            raise ValueError("allowed: `max`, `min` or both")
        return self


class Quantile(_Record):
    """The scenario below which this share of them lies, counted from the worst."""

    quantile: Annotated[float, Field(strict=True, ge=0.0, le=0.5)]


class Objective(_Record):
    """What to look for: weighted metrics to minimise, and limits that must hold.

    Attributes:
        terms: weight of each metric in the cost (negative: more of it is better).
        constraints: limits by metric name; a violation costs `penalty` per `scale`.
        penalty: cost of violating a constraint by its scale.
        search_margin: share by which the search tightens every limit: it ends on a limit, and its few
            scenarios cannot tell on which side of it.
        over_scenarios: what a gait is worth over its scenarios: the ``mean``, by which limits hold for
            mean metrics; the ``worst``, by which they hold in every scenario; or a quantile in between,
            by which at most this share of the scenarios may be worse and may violate a limit.
    """

    terms: dict[str, _Finite]
    constraints: dict[str, Constraint] = {}
    penalty: _Positive = 1.0
    search_margin: Annotated[float, Field(strict=True, ge=0.0, lt=1.0)] = 0.0
    over_scenarios: Literal["mean", "worst"] | Quantile = "mean"

    @field_validator("over_scenarios", mode="before")
    @classmethod
    def _is_a_rule(cls, value: Any) -> Any:
        share = value.get("quantile") if isinstance(value, dict) and len(value) == 1 else None
        number = isinstance(share, (int, float)) and not isinstance(share, bool) and 0.0 <= share <= 0.5
        if not (number or value in ("mean", "worst") or isinstance(value, Quantile)):
            raise ValueError(f'found {value!r}; allowed: "mean", "worst" or {{ quantile = 0 to 0.5 }}')
        return {"quantile": float(share)} if share is not None else value

    @property
    def worse_share(self) -> float | None:
        """Share of the scenarios that may be worse than what a gait is worth; None for the mean."""
        if isinstance(self.over_scenarios, Quantile):
            return self.over_scenarios.quantile
        return 0.0 if self.over_scenarios == "worst" else None


class Planar(_Record):
    """What the reduced planar model needs to know of a two-module crawler; all figures are the MJCF's.

    Attributes:
        middle, rear_foot, front_foot: channels that fold the arch and swing the feet.
        rear_bodies, front_bodies: bodies that move with the rear and the front module.
        rear_pad, front_pad: geoms of the pads.
        rear_underside, front_underside: geoms that the modules stand on when their pad is retracted.
        links: two bodies one link apart when the arch is flat.
    """

    middle: str
    rear_foot: str
    front_foot: str
    rear_bodies: list[str]
    front_bodies: list[str]
    rear_pad: str
    front_pad: str
    rear_underside: str
    front_underside: str
    links: tuple[str, str]


class _Gait(_Record):
    period_s: tuple[_Period, _Period]


class ProblemFile(_Record):
    """The content of a problem file."""

    name: Annotated[str, Field(max_length=100, pattern=r"^\w[\w .+-]*$")]
    description: str = ""
    model: str | None = None
    parameters: dict[Name, Parameter] = {}
    roles: Roles
    start: Start = Start()
    gait: _Gait
    channels: Annotated[dict[Name, ChannelBounds], Field(min_length=1)]
    baselines: dict[Name, Baseline] = {}
    simulation: Simulation
    servo: Servo = Servo()
    scenarios: ScenarioSpread = ScenarioSpread()
    effects: dict[str, dict[str, _Number | str]] = {}
    objective: Objective
    planar: Planar | None = None

    @model_validator(mode="after")
    def _check(self) -> ProblemFile:
        _ordered("gait.period_s", self.gait.period_s)
        for name in self.start.ctrl_deg:
            if name not in self.channels:
                raise ValueError(str(unknown_name("start.ctrl_deg", "channel", name, self.channels)))
        for name, baseline in self.baselines.items():
            source = self.baselines.get(baseline.like) if baseline.like else baseline
            if source is None or source.channels is None:
                known = [other for other, b in self.baselines.items() if b.channels is not None]
                raise ValueError(
                    str(unknown_name(f"baselines.{name}.like", "baseline", baseline.like, known))
                )
        return self


@dataclass(frozen=True)
class Problem:
    """A checked problem: the file's content, where it and its MJCF lie, and the gaits it names.

    Attributes:
        file: the content as it stands in the file.
        source: the problem file.
        model_path: the MJCF.
        baselines: the hand-tuned gaits by name.
        space: the gait space of a search.
        carried: the MJCF and what it names by path from its folder, where the problem travels without
            its folder; None where they are read from the disk (see `model.carrying`).
    """

    file: ProblemFile
    source: Path
    model_path: Path
    baselines: Mapping[str, Gait]
    space: GaitSpace
    carried: Mapping[str, bytes] | None = None

    @staticmethod
    def load(reference: str | Path, parameters: Mapping[str, float] | None = None) -> Problem:
        """Return a problem from a folder, a problem TOML or a bundled name; see `load_problem`."""
        return load_problem(reference, parameters)

    @staticmethod
    def from_file(
        file: ProblemFile, source: Path, model_path: Path, carried: Mapping[str, bytes] | None = None
    ) -> Problem:
        """Return the problem that a checked file describes.

        Raises:
            GaitoptError: a baseline does not fit the channels.
        """
        gaits = {}
        for name, baseline in file.baselines.items():
            channels = baseline.channels or file.baselines[str(baseline.like)].channels or {}
            gaits[name] = Gait(baseline.period_s, channels, name)
        space = GaitSpace(file.gait.period_s, {name: c.space for name, c in file.channels.items()})
        problem = Problem(file, source, model_path, {}, space, carried)
        active_effects(file.effects, file.roles, problem.channel_names, source)
        checked = {n: problem.check_gait(g, f"{source}: baselines.{n}") for n, g in gaits.items()}
        return replace(problem, baselines=checked)

    @property
    def name(self) -> str:
        """Name of the problem."""
        return self.file.name

    @property
    def roles(self) -> Roles:
        """What effects, metrics and reports act on."""
        return self.file.roles

    @property
    def effects(self) -> tuple[ActiveEffect, ...]:
        """The effects that the file switches on, in the order in which they act."""
        return active_effects(self.file.effects, self.roles, self.channel_names, self.source)

    @property
    def simulation(self) -> Simulation:
        """Fidelities and horizon."""
        return self.file.simulation

    @property
    def channel_names(self) -> list[str]:
        """Channels in the order of the file, which is the model's actuator order."""
        return list(self.file.channels)

    def check_gait(self, gait: Gait, source: object, in_range: bool = True) -> Gait:
        """Return `gait` with its channels in the problem's order.

        Raises:
            GaitoptError: a channel is unknown or missing, or (if `in_range`) a target lies outside the
                servo's travel.
        """
        for name in gait.channels:
            if name not in self.file.channels:
                raise unknown_name(source, "channel", name, self.channel_names)
        ordered = {}
        for name, bounds in self.file.channels.items():
            if name not in gait.channels:
                raise GaitoptError(f"{source}: channels.{name}: missing; every channel needs a wave")
            low, high = gait.channels[name].extremes_deg
            if in_range and (low < bounds.range_deg[0] - 1e-9 or high > bounds.range_deg[1] + 1e-9):
                raise bad_value(
                    source,
                    f"channels.{name}",
                    f"targets from {low:g} to {high:g} degrees",
                    f"the servo's {bounds.range_deg[0]:g} to {bounds.range_deg[1]:g}",
                )
            ordered[name] = gait.channels[name]
        return Gait(gait.period_s, ordered, gait.name)

    def find_gait(self, reference: str, in_range: bool = True) -> Gait:
        """Return a gait by baseline name, gait file, exported table or run folder (its best gait).

        Raises:
            GaitoptError: there is no such gait, or it does not fit the problem; see `check_gait`.
        """
        if reference in self.baselines:
            return self.baselines[reference]
        path = Path(reference)
        if path.is_dir():
            path = path / "best.toml"
            if not path.is_file():
                raise GaitoptError(f"{path}: no such file; {reference} is not a finished run folder")
        elif not path.exists():
            known = ", ".join(self.baselines) or "none"
            raise GaitoptError(
                f"{reference}: neither a baseline nor a gait file nor an exported table nor a run folder; "
                f"baselines: {known}"
            )
        gait = read_table(path).gait if is_table(path) else read_gait(path)
        return self.check_gait(gait, path, in_range)

    def with_parameters(self, values: Mapping[str, float]) -> Problem:
        """Return the problem with some named parameters changed.

        Raises:
            GaitoptError: there is no such parameter, or the value is not finite.
        """
        if not values:
            return self
        dumped = self.to_dict()
        for name, value in values.items():
            if name not in self.file.parameters:
                raise unknown_name(self.source, "parameter", name, self.file.parameters)
            dumped["parameters"][name] |= {"value": value}
        return self._with(validated(ProblemFile, dumped, self.source))

    def with_effects(self, effects: Mapping[str, Values]) -> Problem:
        """Return the problem with more effects switched on, or with other values of those that are.

        Args:
            effects: by the effect's name, what a file's table says: its parameter, and ``target``.

        Raises:
            GaitoptError: an effect is unknown, wrong or not applicable.
        """
        switched_on = self.file.effects | {name: dict(values) for name, values in effects.items()}
        return self._with(self.file.model_copy(update={"effects": switched_on}))

    def with_horizon(self, horizon: Horizon) -> Problem:
        """Return the problem with another part of its rollouts counted."""
        simulation = self.simulation.model_copy(update={"horizon": horizon})
        return self._with(self.file.model_copy(update={"simulation": simulation}))

    def _with(self, file: ProblemFile) -> Problem:
        """Return the problem with another file's content, and the same model."""
        return Problem.from_file(file, self.source, self.model_path, self.carried)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of the problem's file."""
        return self.file.model_dump(mode="json", exclude_none=True)

    def to_toml(self, model: str) -> str:
        """Return a problem file with the same content that points to the MJCF `model`."""
        return tomli_w.dumps({"name": self.file.name, "model": model} | self.to_dict() | {"model": model})


def bundled_problems() -> Path:
    """Return the folder of the problems that come with gaitopt, installed or in a checkout."""
    here = Path(__file__).resolve().parent.parent
    installed = here / "problems"
    return installed if installed.is_dir() else here.parent / "problems"


def load_problem(reference: str | Path, parameters: Mapping[str, float] | None = None) -> Problem:
    """Return a problem from a folder, a problem TOML, or the bare name of a bundled one.

    Args:
        reference: where to look.
        parameters: named model parameters to change.

    Raises:
        GaitoptError: nothing is found there, or what is found is wrong.
    """
    path = _problem_path(str(reference))
    file = validated(ProblemFile, read_toml(path), path)
    problem = Problem.from_file(file, path, _model_path(path, file.model))
    return problem.with_parameters(parameters or {})


def _problem_path(reference: str) -> Path:
    """Return the problem file; an unrelated folder of the same name does not hide a bundled problem."""
    path = Path(reference)
    if (path / PROBLEM_FILE).is_file():
        return path / PROBLEM_FILE
    if path.is_file():
        return path
    bundled = bundled_problems()
    if re.fullmatch(r"[A-Za-z0-9_.-]+", reference) and (bundled / reference / PROBLEM_FILE).is_file():
        return bundled / reference / PROBLEM_FILE
    if path.is_dir():
        raise GaitoptError(f"{path}: no {PROBLEM_FILE} in this folder")
    names = sorted(folder.parent.name for folder in bundled.glob(f"*/{PROBLEM_FILE}"))
    raise GaitoptError(
        f"{reference}: no such problem; allowed: a folder with {PROBLEM_FILE}, a problem TOML, "
        f"or one of {', '.join(names)}"
    )


def _model_path(problem_path: Path, name: str | None) -> Path:
    folder = problem_path.parent
    if name is not None:
        path = inside(folder, name)
        if path is None:
            raise bad_value(problem_path, "model", name, "a file inside the problem's folder")
        if not path.is_file():
            raise GaitoptError(f"{problem_path}: model: {path}: no such file")
        return path
    found = sorted(folder.glob("*.xml"))
    if len(found) != 1:
        raise GaitoptError(
            f"{folder}: found {len(found)} MJCF files (*.xml); allowed: exactly one, or `model`"
        )
    return found[0]


def _ceil(value: float) -> int:
    """Round up, but not for the last bit of a quotient such as 4 / 0.1."""
    return -int(-value * (1.0 - 1e-12) // 1.0)
