"""The records of a problem file."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from gaitopt.core.errors import unknown_name
from gaitopt.core.validation import PLAIN_NUMBER, Name
from gaitopt.gait.calibration import Calibration
from gaitopt.gait.gait import Channel
from gaitopt.gait.space import ChannelSpace, GaitSpace
from gaitopt.problem.fields import (
    FileRecord,
    Finite,
    Interval,
    NonNegative,
    Number,
    Period,
    Positive,
    check_ordered,
)
from gaitopt.problem.objective import Objective
from gaitopt.problem.tags import TagTables
from gaitopt.problem.ties import GaitBounds, tied_spaces
from gaitopt.problem.tolerances import Tolerances, with_moved_tolerances
from gaitopt.robot.roles import Roles

EffectTable = dict[str, Number | str]

EffectTables = Annotated[
    Annotated[EffectTable, Tag("")]
    | Annotated[list[Annotated[EffectTable, Field(min_length=1)]], Field(min_length=1), Tag(" ")],
    Discriminator(lambda value: " " if isinstance(value, list) else ""),
]
"""The table of an effect, or several, one for each of its targets; messages leave blank tags out."""

Integrator = Literal["Euler", "RK4", "implicit", "implicitfast"]


class Parameter(FileRecord):
    """A named number of the model.

    Attributes:
        value: nominal value in `unit`.
        unit: its unit, in words.
        origin: where the number comes from: measured, datasheet, assumed.
        sets: MJCF attributes that it is written to: XPaths that end in ``/@attribute``, each with the text
            to write, where ``{}`` stands for the value.
    """

    value: Finite
    unit: str
    origin: str
    sets: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _paths_alone_take_the_value(cls, values: Any) -> Any:
        if isinstance(values, dict) and isinstance(values.get("sets"), list):
            return values | {"sets": {str(path): "{}" for path in values["sets"]}}
        return values


class Start(FileRecord):
    """The state before the gait: the targets held, and whether the robot first comes to rest under them.

    Attributes:
        ctrl_deg: held target of each channel; 0 where a channel is not named.
        settle: let the robot come to rest; otherwise the MJCF's keyframe ``start`` is used unchanged.
        held: the robot is held: it has no free joint and no contacts, neither with the world nor with itself.
    """

    ctrl_deg: dict[str, Finite] = Field(default_factory=dict)
    settle: bool = True
    held: bool = False


class ChannelBounds(FileRecord):
    """One actuator: its travel, its servo, and what a search may do with it (see `ChannelSpace`).

    Attributes:
        range_deg: travel of the servo.
        amplitude_deg: amplitudes that a search may use; needed only with ``[gait]``.
        duty, smoothing: duty factors and smoothing that a search may use.
        servo: calibration of the servo.
    """

    range_deg: Interval
    amplitude_deg: Interval | None = None
    duty: Interval = (0.1, 0.9)
    smoothing: Interval = (0.0, 1.0)
    servo: Calibration = Calibration()

    @model_validator(mode="after")
    def _check(self) -> ChannelBounds:
        check_ordered("range_deg", self.range_deg)
        if self.amplitude_deg is not None:
            self._check_amplitude(self.amplitude_deg)
        for key in ("duty", "smoothing"):
            check_ordered(key, getattr(self, key))
        for key in ("duty", "smoothing"):
            low, high = getattr(self, key)
            if low < 0.0 or high > 1.0:
                raise ValueError(f"{key}: found {[low, high]}; allowed: inside 0 to 1")
        return self

    def _check_amplitude(self, amplitude_deg: tuple[float, float]) -> None:
        check_ordered("amplitude_deg", amplitude_deg)
        width = self.range_deg[1] - self.range_deg[0]
        widest = max(abs(end) for end in amplitude_deg)
        if widest > width:
            raise ValueError(f"amplitude_deg: found {widest:g}; allowed: at most the range's {width:g}")

    @property
    def space(self) -> ChannelSpace | None:
        """The same bounds as the search sees them; None without amplitudes."""
        if self.amplitude_deg is None:
            return None
        return ChannelSpace(self.range_deg, self.amplitude_deg, self.duty, self.smoothing)


class Baseline(FileRecord):
    """A hand-tuned gait: a whole gait, or another baseline's wave at another period."""

    period_s: Period
    like: str | None = None
    channels: dict[str, Channel] | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Baseline:
        if (self.like is None) == (self.channels is None):
            raise ValueError('allowed: either `channels` or `like = "another baseline"`, not both')
        return self


class Measured(FileRecord):
    """What the real robot did with a baseline.

    Attributes:
        speed_m_s: its forward speed, m/s.
        origin: where the figure comes from.
    """

    speed_m_s: Finite
    origin: str


class Fidelity(FileRecord):
    """How finely a simulation is integrated."""

    timestep_s: Annotated[float, Field(ge=1e-6, le=0.1), PLAIN_NUMBER]
    integrator: Integrator

    def scaled(self, factor: float) -> Fidelity:
        """Return this fidelity with a timestep longer by a factor."""
        return self.model_copy(update={"timestep_s": factor * self.timestep_s})


class Horizon(FileRecord):
    """Which part of a rollout counts: whole cycles after the transient.

    Attributes:
        transient_s, transient_cycles: at least this much is left out at the beginning.
        measured_s, measured_cycles: at least this much is measured.
    """

    transient_s: Annotated[NonNegative, Field(le=1e6)] = 1.0
    transient_cycles: Annotated[int, Field(ge=0, le=1000), PLAIN_NUMBER] = 1
    measured_s: Annotated[Positive, Field(le=1e6)] = 4.0
    measured_cycles: Annotated[int, Field(ge=1, le=1000), PLAIN_NUMBER] = 2

    def cycles(self, period_s: float) -> tuple[int, int]:
        """Return the numbers of transient and of measured cycles at a period."""
        transient = max(self.transient_cycles, _ceil(self.transient_s / period_s))
        return transient, max(self.measured_cycles, _ceil(self.measured_s / period_s))


class Simulation(FileRecord):
    """Working and reference fidelity, and the horizon of a rollout."""

    working: Fidelity
    reference: Fidelity
    horizon: Horizon = Horizon()


class Servo(FileRecord):
    """How commands reach the servos.

    Attributes:
        frame_s: period of the servo signal; a target is sent once a frame and acts one frame later.
    """

    frame_s: Positive = 0.02


class Scenarios(FileRecord):
    """How many robots a gait is tried on; `Tolerances` say how they differ from the nominal one.

    Attributes:
        search, verification: number of scenarios of each; a search never sees those of verification.
        framed: the last scenario gets its targets at the servo's frame rate, one frame late.
    """

    search: Annotated[int, Field(ge=1, le=1000), PLAIN_NUMBER] = 3
    verification: Annotated[int, Field(ge=2, le=1000), PLAIN_NUMBER] = 16
    framed: bool = True


class Planar(FileRecord):
    """Names that the planar model of a two-module crawler needs; all its figures come from the MJCF.

    Attributes:
        middle, rear_foot, front_foot: channels that fold the arch and swing the feet.
        rear_bodies, front_bodies: bodies that move with the rear and the front module.
        rear_pad, front_pad: geoms of the pads.
        rear_underside, front_underside: geoms on which the modules stand when their pad is retracted.
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


class ProblemFile(FileRecord):
    """The content of a problem file.

    ``friction`` says whose coefficients count where the robot touches the ground: the ``robot``'s own, as
    named parameters and effects set them (see `problem.friction`), or what ``mujoco`` makes of both.

    ``[gait]`` and ``[objective]``, like `Roles.marker` and `Roles.pads`, are optional. Code that needs a
    missing one says so: see `Problem.require`.
    """

    name: Annotated[str, Field(max_length=100, pattern=r"^\w[\w .+-]*$")]
    description: str = ""
    model: str | None = None
    parameters: dict[Name, Parameter] = Field(default_factory=dict)
    roles: Roles
    friction: Literal["robot", "mujoco"] = "robot"
    start: Start = Start()
    gait: GaitBounds | None = None
    channels: Annotated[dict[Name, ChannelBounds], Field(min_length=1)]
    baselines: dict[Name, Baseline] = Field(default_factory=dict)
    measured: dict[str, Measured] = Field(default_factory=dict)
    simulation: Simulation
    servo: Servo = Servo()
    scenarios: Scenarios = Scenarios()
    tolerances: Tolerances = Tolerances()
    effects: dict[str, EffectTables] = Field(default_factory=dict)
    tags: TagTables = Field(default_factory=dict)
    objective: Objective | None = None
    planar: Planar | None = None

    @model_validator(mode="before")
    @classmethod
    def _take_tolerances_of_scenarios(cls, values: Any) -> Any:
        return with_moved_tolerances(values)

    @model_validator(mode="after")
    def _check(self) -> ProblemFile:
        if self.gait is not None:
            self._check_gait_space(self.gait)
        for name in self.start.ctrl_deg:
            if name not in self.channels:
                raise ValueError(str(unknown_name("start.ctrl_deg", "channel", name, self.channels)))
        for name in self.measured:
            if name not in self.baselines:
                raise ValueError(str(unknown_name("measured", "baseline", name, self.baselines)))
        for name, baseline in self.baselines.items():
            source = self.baselines.get(baseline.like) if baseline.like else baseline
            if source is None or source.channels is None:
                known = [other for other, b in self.baselines.items() if b.channels is not None]
                raise ValueError(
                    str(unknown_name(f"baselines.{name}.like", "baseline", baseline.like, known))
                )
        return self

    def _check_gait_space(self, gait: GaitBounds) -> None:
        check_ordered("gait.period_s", gait.period_s)
        for name, channel in self.channels.items():
            if channel.amplitude_deg is None:
                raise ValueError(f"channels.{name}.amplitude_deg: missing; [gait] needs it")
        tied_spaces(gait, self.gait_space(gait), self.start.ctrl_deg)

    def gait_space(self, gait: GaitBounds) -> GaitSpace:
        """Return the gait space of a search within bounds."""
        spaces = {name: channel.space for name, channel in self.channels.items()}
        return GaitSpace(gait.period_s, {name: space for name, space in spaces.items() if space is not None})


def _ceil(value: float) -> int:
    """Round up, but not a quotient such as 4 / 0.1 that is above a whole number only by rounding."""
    return -int(-value * (1.0 - 1e-12) // 1.0)
