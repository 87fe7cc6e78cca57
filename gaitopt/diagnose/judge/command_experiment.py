"""What to play next on a bench: the commands that would leave the least probability on wrong alternatives.

Shapes, sizes and channels are tried on the robot of every alternative. An explanation that only adds to a
more probable one what no commands show is no alternative to it. Where one explanation is left, the commands
narrow its parameters: they set its robots apart. These are robots drawn from its posterior where there are
some, else robots that have one parameter each a little larger.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gaitopt.core.errors import GaitoptError
from gaitopt.core.streams import Stream
from gaitopt.diagnose.judge.command_score import CommandScorer, Separation
from gaitopt.diagnose.judge.command_search import CommandSearch, ScoredCommands, best_of_each, travel_of
from gaitopt.diagnose.judge.command_settings import COMMANDS, CommandSettings
from gaitopt.diagnose.judge.small_errors import perturbed_robots
from gaitopt.effects import EFFECTS
from gaitopt.effects.active import Values
from gaitopt.effects.parts import Parts
from gaitopt.gait.drive import Drive
from gaitopt.gait.logged import LoggedCommands
from gaitopt.gait.played_commands import PlayedCommands
from gaitopt.simulation.rollout import Simulator

COMMANDS_FILE = "next.csv"
"""Name of the table of commands in a run folder."""


@dataclass(frozen=True)
class Alternative:
    """A robot that may be the true one.

    Attributes:
        label: the explanation that it belongs to, such as its effects; robots of one label need not be told
            apart.
        probability: how probable it is.
        effects: its effects, as a problem file states them.
    """

    label: str
    probability: float
    effects: Mapping[str, Values]


@dataclass(frozen=True)
class CommandExperiment:
    """Commands that would set alternatives apart.

    Attributes:
        chosen: the commands to play.
        runners_up: the best commands of other shapes or channels, the best first.
        separates: the explanations, the most probable first; one alone where its parameters are narrowed.
        before: expected separation of the best commands measured so far, in floors; 0 where there are none.
        inseparable: pairs of explanations that are closer than a floor on all commands that were tried.
        fastest_deg_s: the fastest that a target which does not jump may move, degrees/s by channel.
    """

    chosen: ScoredCommands
    runners_up: tuple[ScoredCommands, ...]
    separates: tuple[str, ...]
    before: float
    inseparable: tuple[tuple[str, str], ...]
    fastest_deg_s: Mapping[str, float]

    @property
    def played(self) -> PlayedCommands:
        """The commands to play."""
        return self.chosen.played

    @property
    def remarks(self) -> list[str]:
        """Sentences on how safe the commands are."""
        return _remarks(self)

    def to_dict(self) -> dict[str, object]:
        """Return ``next_experiment`` of a diagnosis."""
        row = self.chosen.to_dict()
        return {
            "gait": None,
            "commands": COMMANDS_FILE,
            **row,
            "separates": list(self.separates),
            "separation_so_far": self.before,
            "inseparable": [list(pair) for pair in self.inseparable],
            "runners_up": [one.to_dict() for one in self.runners_up],
            "remarks": self.remarks,
        }


def propose_commands(
    simulator: Simulator,
    alternatives: Sequence[Alternative],
    measured: Sequence[Drive],
    floors: Mapping[str, float],
    executor: Executor,
    seed: int = 1,
    settings: CommandSettings = COMMANDS,
) -> CommandExperiment | None:
    """Return the commands that set alternatives apart best; None if there is nothing to set apart.

    Args:
        simulator: the nominal robot, whose channels are commanded.
        alternatives: what may be true.
        measured: the drives of the trials so far; the same commands are not proposed again.
        floors: the signals that are measured, and the noise of each, m or rad.
        executor: where robots are simulated; it changes no bit.
        seed: seed of the commands that are drawn.
        settings: see `CommandSettings`.

    Raises:
        GaitoptError: a floor or a probability is not positive, or an effect of an alternative is wrong.
    """
    _check(alternatives, floors)
    likely = _likely(alternatives, settings)
    if not likely or not floors:
        return None
    known = frozenset(one.commands_key for one in measured if isinstance(one, LoggedCommands))
    problem = simulator.problem
    search = CommandSearch(problem, travel_of(problem), known, seed, settings)
    contest = _Contest(simulator, search, measured, floors, executor)
    if len({one.label for one in likely}) > 1:
        experiment = contest.held(likely)
        if experiment is not None:
            return experiment
    same = [one for one in likely if one.label == likely[0].label]
    return contest.held(
        same if len(same) > 1 else [*same, *_varied(same[0], simulator.effects.nominal, settings)]
    )


def _check(alternatives: Sequence[Alternative], floors: Mapping[str, float]) -> None:
    for signal, floor in floors.items():
        if not (np.isfinite(floor) and floor > 0.0):
            raise GaitoptError(f"floor of {signal}: found {floor:g}; allowed: a positive number")
    if any(one.probability <= 0.0 for one in alternatives):
        raise GaitoptError("alternatives: found a probability of 0 or less; allowed: positive ones")


def _likely(alternatives: Sequence[Alternative], settings: CommandSettings) -> list[Alternative]:
    """Return the alternatives that count, the most probable first."""
    ranked = sorted(alternatives, key=lambda one: -one.probability)[: settings.alternatives]
    return [one for one in ranked if one.probability >= settings.least_probability * ranked[0].probability]


def _varied(one: Alternative, nominal: Parts, settings: CommandSettings) -> Iterator[Alternative]:
    """Yield robots of an explanation that have one parameter each a little larger."""
    for name, values in one.effects.items():
        effect = EFFECTS[name]
        low, high = effect.bounds(nominal)
        value = float(values[effect.parameter])
        size = abs(value) if effect.scale == "log" else max(abs(value), settings.step * (high - low))
        larger = value + settings.step * size
        if np.isfinite(larger) and effect.allows(larger):
            changed = {**one.effects, name: {**values, effect.parameter: larger}}
            yield replace(one, effects=changed)


@dataclass(frozen=True)
class _Contest:
    """What alternatives compete in.

    Attributes:
        simulator: the nominal robot.
        search: how commands are searched.
        measured: the drives of the trials so far.
        floors: noise of each signal.
        executor: where robots are simulated.
    """

    simulator: Simulator
    search: CommandSearch
    measured: Sequence[Drive]
    floors: Mapping[str, float]
    executor: Executor

    def held(self, robots: Sequence[Alternative]) -> CommandExperiment | None:
        """Return the best commands for some robots; None where nothing sets their explanations apart."""
        if len(robots) < 2:
            return None
        labels = [one.label for one in robots]
        scorer = self._scorer(robots)
        coarse = self.search.coarse(scorer)
        drives = {one.key: one for one in self.measured}
        so_far = [one for one in scorer.separations(list(drives.values())) if one is not None]
        if not coarse:
            return None
        groups = _groups(robots, [*(one.separation for one in coarse), *so_far])
        others = scorer.others & (groups[:, None] != groups[None, :])
        explanations = tuple(dict.fromkeys(labels[i] for i in groups.tolist()))
        if len(explanations) < min(2, len(set(labels))):
            return None
        masked = [replace(one, separation=replace(one.separation, others=others)) for one in coarse]
        found = self.search.refined(replace(scorer, others=others), masked)
        chosen, *rest = best_of_each(found)
        travel = self.search.travel
        return CommandExperiment(
            chosen,
            tuple(rest[: self.search.settings.runners_up]),
            explanations,
            max((replace(one, others=others).mean for one in so_far), default=0.0),
            _inseparable(labels, others, [*(one.separation for one in found), *so_far]),
            dict(zip(travel.channels, np.rad2deg(travel.speeds).tolist(), strict=True)),
        )

    def _scorer(self, robots: Sequence[Alternative]) -> CommandScorer:
        """Return what scores commands, with robots perturbed about the first of each explanation."""
        settings, nominal = self.search.settings, self.simulator
        simulators = [
            Simulator.build(nominal.problem.with_effects(one.effects), fidelity=nominal.fidelity)
            for one in robots
        ]
        prior = np.array([one.probability for one in robots])
        labels = [one.label for one in robots]
        others = np.array(labels)[:, None] != np.array(labels)[None, :]
        if not others.any():  # one explanation: its robots are to be set apart
            others = ~np.eye(len(robots), dtype=bool)
        leaders = [labels.index(label) for label in dict.fromkeys(labels)][: settings.leaders]
        seed, stream = self.search.seed, Stream.EXPERIMENT_ROBOTS
        perturbed = [
            (index, robot)
            for index in leaders
            for robot in perturbed_robots(simulators[index], seed, settings.robots, stream)
        ]
        return CommandScorer(
            simulators, perturbed, prior / prior.sum(), others, self.floors, self.executor, settings
        )


def _groups(robots: Sequence[Alternative], separations: Sequence[Separation]) -> NDArray[np.int_]:
    """Return for each robot the index of the first that explains the same, shape (robots,).

    An explanation that only adds effects to another, or leaves some out, explains the same where no commands
    show the difference.
    """
    widest = np.max([one.distances for one in separations], axis=0)
    names = [set(one.effects) for one in robots]
    groups = list(range(len(robots)))
    for i, one in enumerate(names):
        same = [j for j in range(i) if (one < names[j] or names[j] < one) and widest[i, j] < 1.0]
        if same:
            groups[i] = groups[same[0]]
    return np.array(groups)


def _inseparable(
    labels: Sequence[str], others: NDArray[np.bool_], separations: Sequence[Separation]
) -> tuple[tuple[str, str], ...]:
    """Return each two explanations of which some robots are closer than a floor on all commands."""
    widest = np.max([one.distances for one in separations], axis=0)
    close = [
        (labels[j], labels[i])
        for i in range(len(labels))
        for j in range(i)
        if others[i, j] and widest[i, j] < 1.0
    ]
    return tuple({frozenset(pair): pair for pair in close if pair[0] != pair[1]}.values())


def _remarks(found: CommandExperiment) -> list[str]:
    shape = found.chosen.made.shape
    speeds = ", ".join(f"{name} {speed:.0f} degrees/s" for name, speed in found.fastest_deg_s.items())
    lines = ["Every target lies inside range_deg of its channel, and the commands begin at rest."]
    if shape.jumps:
        lines.append("The target jumps: the servo turns as fast as it can. Keep hands and cables away.")
    else:
        lines.append(f"The target moves no faster than the servos' speed_limit_deg_s: {speeds}.")
    if np.isnan(found.played.commands.rows).any():
        lines.append("At the end the servo is unpowered: what it holds falls. Put something soft below it.")
    return lines
