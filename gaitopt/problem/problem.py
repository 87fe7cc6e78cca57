"""A problem: a robot's MJCF, and a file with its parameters, channels, limits and aims."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeVar

import tomli_w

from gaitopt.core.errors import GaitoptError, bad_value, nearest, unknown_name
from gaitopt.core.files import found_inside, read_toml
from gaitopt.core.interrupts import interrupts_held
from gaitopt.core.validation import validated
from gaitopt.effects.active import ActiveEffect, EffectValues, Tables, active_effects, as_tables, written
from gaitopt.gait.gait import BEST_FILE, Gait
from gaitopt.gait.space import GaitSpace
from gaitopt.gait.table import is_table, read_gait_file
from gaitopt.gait.ties import TiedSpace
from gaitopt.problem.likeness import like_another
from gaitopt.problem.lookup import model_file, problem_file
from gaitopt.problem.objective import Objective
from gaitopt.problem.records import Horizon, ProblemFile, Simulation
from gaitopt.problem.ties import tied_spaces
from gaitopt.robot.roles import Roles

_T = TypeVar("_T")

Part = Literal["[gait]", "[objective]", "roles.marker", "roles.pads"]
"""An optional part of a problem file."""


@dataclass(frozen=True)
class Problem:
    """A checked problem: the content of its file, the paths of the file and its MJCF, and its baselines.

    Attributes:
        file: the content of the problem file.
        source: the problem file.
        model_path: the MJCF.
        baselines: the hand-tuned gaits by name.
        carried: content of the MJCF and of the files that it names, by path from its folder, for a problem
            that travels without its folder (see `model.carrying`); None where they are read from the disk.
        observed: sites whose position and angles a simulation records, too; see `observing`.
        robots: robots that stand for the nominal one in scenarios, one in each; see `with_robots`.
    """

    file: ProblemFile
    source: Path
    model_path: Path
    baselines: Mapping[str, Gait]
    carried: Mapping[str, bytes] | None = None
    observed: tuple[str, ...] = ()
    robots: tuple[EffectValues, ...] = ()

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
        problem = Problem(file, source, model_path, {}, carried)
        active_effects(file.effects, problem.roles, problem.channel_names, source)
        checked = {n: problem.check_gait(g, f"{source}: baselines.{n}") for n, g in gaits.items()}
        return replace(problem, baselines=checked)

    @property
    def name(self) -> str:
        """Name of the problem."""
        return self.file.name

    @property
    def roles(self) -> Roles:
        """What effects, metrics and reports act on. A robot that is held goes nowhere and touches nothing."""
        roles = self.file.roles
        if not self.file.start.held:
            return roles
        return roles.model_copy(update={"marker": None, "pads": [], "body": []})

    def require(self, user: str, *parts: Part) -> None:
        """Check that the file has some of its optional parts.

        Args:
            user: what needs them, for the message: "optimise".
            parts: the parts, as the message names them.

        Raises:
            GaitoptError: a part is missing.
        """
        values: dict[Part, object] = {
            "[gait]": self.file.gait,
            "[objective]": self.file.objective,
            "roles.marker": self.roles.marker,
            "roles.pads": self.roles.pads or None,
        }
        for part in parts:
            self._given(part, values[part], user)

    def _given(self, part: Part, value: _T | None, user: str) -> _T:
        """Return the value of an optional part, which must be given."""
        if value is None:
            held = self.file.start.held and part.startswith("roles.")
            why = "none, as the robot is held" if held else "missing"
            raise GaitoptError(f"{self.source}: {part}: {why}; {user} needs it")
        return value

    @cached_property
    def space(self) -> GaitSpace:
        """The gait space of a search.

        Raises:
            GaitoptError: the file has no ``[gait]``.
        """
        return self.file.gait_space(self._given("[gait]", self.file.gait, "a search for gaits"))

    @cached_property
    def tied_spaces(self) -> Sequence[TiedSpace]:
        """The smaller gait spaces with which a search begins, one for each template; none without ties."""
        gait = self.file.gait
        return tied_spaces(gait, self.space, self.file.start.ctrl_deg) if gait else ()

    @property
    def objective(self) -> Objective:
        """What to look for.

        Raises:
            GaitoptError: the file has no ``[objective]``.
        """
        return self._given("[objective]", self.file.objective, "the cost of a gait")

    @property
    def marker(self) -> str:
        """The site whose motion is the robot's motion.

        Raises:
            GaitoptError: the file has no ``roles.marker``.
        """
        return self._given("roles.marker", self.roles.marker, "the motion of the robot")

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
            best = found_inside(path, BEST_FILE)
            if best is None:
                raise GaitoptError(
                    f"{path / BEST_FILE}: no such file; {reference} is not a finished run folder"
                )
            path = best
        elif not path.exists():
            known = ", ".join(self.baselines) or "none"
            raise GaitoptError(
                f"{reference}: neither a baseline nor a gait file nor an exported table nor a run folder; "
                f"baselines: {known}{nearest(reference, self.baselines)}"
            )
        if path.suffix.lower() == ".csv" and not is_table(path):
            raise GaitoptError(
                f"{path}: a CSV table, but no exported gait; allowed: a gait. Logged commands can only be "
                "simulated, written out by `command`, and be the commands of a trial"
            )
        return self.check_gait(read_gait_file(path), path, in_range)

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

    def with_effects(self, effects: Mapping[str, Tables]) -> Problem:
        """Return the problem with more effects switched on, or with other values of those that are.

        Args:
            effects: by the effect's name, the keys of its table in a file: its parameter, and ``target``; or
                several such tables, one for each target.

        Raises:
            GaitoptError: an effect is unknown, wrong or not applicable.
        """
        switched_on = self.file.effects | {name: written(tables) for name, tables in effects.items()}
        return self._with(self.file.model_copy(update={"effects": switched_on}))

    def with_robots(self, robots: Iterable[EffectValues]) -> Problem:
        """Return the problem with robots drawn from what is known of it: each scenario runs on one of them.

        Args:
            robots: the effects of each robot, beside those that the file switches on.
        """
        return replace(self, robots=tuple(robots))

    def as_robot(self, effects: EffectValues) -> Problem:
        """Return the problem of one of the robots, as its nominal one.

        Raises:
            GaitoptError: an effect is unknown, wrong or not applicable.
        """
        return replace(self.with_effects(as_tables(effects)), robots=())

    def with_horizon(self, horizon: Horizon) -> Problem:
        """Return the problem with another horizon: which part of a rollout counts."""
        simulation = self.simulation.model_copy(update={"horizon": horizon})
        return self._with(self.file.model_copy(update={"simulation": simulation}))

    def observing(self, sites: Iterable[str]) -> Problem:
        """Return the problem with some sites of its MJCF observed: their signals are simulated, too."""
        return replace(self, observed=tuple(dict.fromkeys((*self.observed, *sites))))

    def _with(self, file: ProblemFile) -> Problem:
        """Return the problem with another content of its file and the same MJCF."""
        problem = Problem.from_file(file, self.source, self.model_path, self.carried)
        return replace(problem, observed=self.observed, robots=self.robots)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of the problem's file."""
        with interrupts_held():  # Pydantic would take Ctrl-C in a serialiser for an error
            return self.file.model_dump(mode="json", exclude_none=True)

    def to_toml(self, model: str) -> str:
        """Return a problem file with the same content that points to the MJCF `model`."""
        return tomli_w.dumps({"name": self.file.name, "model": model} | self.to_dict() | {"model": model})


def load_problem(reference: str | Path, parameters: Mapping[str, float] | None = None) -> Problem:
    """Return a problem from a folder, a problem TOML, or the bare name of a bundled one.

    Args:
        reference: the folder, the file or the name.
        parameters: named model parameters to change.

    Raises:
        GaitoptError: there is no problem, or its file is wrong.
    """
    path = problem_file(str(reference))
    content, origin = like_another(read_toml(path), path)
    file = validated(ProblemFile, content, path)
    problem = Problem.from_file(file, path, model_file(origin, file.model))
    return problem.with_parameters(parameters or {})
