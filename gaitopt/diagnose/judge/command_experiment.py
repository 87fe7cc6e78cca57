"""What to play next on a bench: the commands that would leave the least probability on wrong alternatives.

Shapes, sizes and channels are tried on the robot of every alternative: a coarse grid first, then sizes near
the best ones. Where all alternatives are one explanation with other parameters, such as robots drawn from
its posterior, the commands that set these robots apart most are those that narrow its parameters.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from gaitopt.core.errors import GaitoptError
from gaitopt.core.streams import Stream
from gaitopt.diagnose.judge.command_score import CommandScorer, Separation
from gaitopt.diagnose.judge.command_settings import COMMANDS, CommandSettings
from gaitopt.diagnose.judge.small_errors import perturbed_robots
from gaitopt.effects.active import Values
from gaitopt.gait.command_shapes import SHAPES, ShapedCommands, Size, Travel, shaped
from gaitopt.gait.drive import Drive
from gaitopt.gait.logged import LoggedCommands
from gaitopt.gait.played_commands import PlayedCommands
from gaitopt.problem.problem import Problem
from gaitopt.problem.start import start_targets
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
class ScoredCommands:
    """Commands, and how far they set alternatives apart.

    Attributes:
        made: the commands, with their shape and size.
        played: the same as a player sends them.
        separation: how far the alternatives are apart.
    """

    made: ShapedCommands
    played: PlayedCommands
    separation: Separation

    def to_dict(self) -> dict[str, object]:
        """Return a row of ``runners_up``."""
        return {
            "shape": self.made.shape.name,
            "channel": self.made.channel,
            "amplitude_deg": round(float(np.rad2deg(self.made.amplitude_rad)), 3),
            "duration_s": self.played.commands.duration_s,
            "expected_separation": self.separation.mean,
            "doubt": self.separation.doubt,
        }


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
    """Return the commands that set alternatives apart best; None if there are none to set apart.

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
    for signal, floor in floors.items():
        if not (np.isfinite(floor) and floor > 0.0):
            raise GaitoptError(f"floor of {signal}: found {floor:g}; allowed: a positive number")
    if any(one.probability <= 0.0 for one in alternatives):
        raise GaitoptError("alternatives: found a probability of 0 or less; allowed: positive ones")
    likely = sorted(alternatives, key=lambda one: -one.probability)[: settings.alternatives]
    if len(likely) < 2 or not floors:
        return None
    problem = simulator.problem
    scorer = _scorer(simulator, likely, floors, executor, seed, settings)
    search = _Search(problem, travel_of(problem), scorer, seed, settings)
    known = {one.commands_key for one in measured if isinstance(one, LoggedCommands)}
    found = search.run(known)
    if not found:
        return None
    so_far = [one for one in scorer.separations(list(measured)) if one is not None]
    labels = [one.label for one in likely]
    chosen, *others = _best_of_each(found)
    return CommandExperiment(
        chosen,
        tuple(others[: settings.runners_up]),
        tuple(dict.fromkeys(labels)),
        max((one.mean for one in so_far), default=0.0),
        _inseparable(labels, [*(one.separation for one in found), *so_far]),
        dict(zip(problem.channel_names, np.rad2deg(search.travel.speeds).tolist(), strict=True)),
    )


def travel_of(problem: Problem) -> Travel:
    """Return how far and how fast commands may move a problem's servos.

    The range is the channel's, and where its servo is calibrated also what pulses the servo takes.
    """
    ranges, speeds = [], []
    for bounds in problem.file.channels.values():
        low, high = bounds.range_deg
        if bounds.servo.is_calibrated:
            least, most = bounds.servo.range_deg
            low, high = max(low, least), min(high, most)
        ranges.append((low, max(low, high)))
        speeds.append(bounds.servo.speed_limit_deg_s)
    span = np.deg2rad(ranges)
    rest = np.clip(start_targets(problem), *span.T)
    return Travel(tuple(problem.channel_names), rest, span, np.deg2rad(speeds))


@dataclass(frozen=True)
class _Search:
    """A search among shapes, sizes and channels."""

    problem: Problem
    travel: Travel
    scorer: CommandScorer
    seed: int
    settings: CommandSettings

    def run(self, known: set[str]) -> list[ScoredCommands]:
        """Return commands that are not known yet with their separations, the best first."""
        keys = set(known)
        found = self._scored(self._coarse(), keys)
        best = _best_of_each(found)[: self.settings.finalists]
        found += self._scored([made for one in best for made in self._near(one.made)], keys)
        return sorted(found, key=_rank)

    def _coarse(self) -> Iterator[ShapedCommands | None]:
        """Yield commands of every shape and some sizes, for each channel, and for all of them together."""
        count = len(self.problem.channel_names)
        several = [tuple(range(count))] if count > 1 else []
        for moving in [*((index,) for index in range(count)), *several]:
            for shape in SHAPES:
                for time_s in shape.times_s[: 1 if several else None]:
                    for share in self.settings.shares:
                        for signed in (share,) if shape.both_sides else (share, -share):
                            yield shaped(shape, Size(signed, time_s, moving), self.travel, self.seed)

    def _near(self, made: ShapedCommands) -> Iterator[ShapedCommands | None]:
        """Yield commands of one shape with other amplitudes, times and draws."""
        size = made.size
        for draw, factor in enumerate(self.settings.factors, start=1):
            share = float(np.clip(factor * size.share, -self.settings.largest, self.settings.largest))
            yield shaped(made.shape, replace(size, share=share), self.travel, self.seed)
            yield shaped(
                made.shape, replace(size, time_s=factor * size.time_s, draw=draw), self.travel, self.seed
            )

    def _scored(self, tried: Iterable[ShapedCommands | None], keys: set[str]) -> list[ScoredCommands]:
        """Return commands with their separations, without those whose keys are known."""
        servos = {name: bounds.servo for name, bounds in self.problem.file.channels.items()}
        fresh: list[tuple[ShapedCommands, PlayedCommands]] = []
        for made in tried:
            played = None if made is None else PlayedCommands.of(made.commands, servos)
            if made is not None and played is not None and played.commands.commands_key not in keys:
                keys.add(played.commands.commands_key)
                fresh.append((made, played))
        separations = self.scorer.separations([played.commands for _, played in fresh])
        rows = zip(fresh, separations, strict=True)
        return [ScoredCommands(*pair, apart) for pair, apart in rows if apart is not None]


def _scorer(
    simulator: Simulator,
    likely: Sequence[Alternative],
    floors: Mapping[str, float],
    executor: Executor,
    seed: int,
    settings: CommandSettings,
) -> CommandScorer:
    """Return what scores commands, with robots perturbed about the first alternative of each explanation."""
    problem = simulator.problem
    robots = [
        Simulator.build(problem.with_effects(one.effects), fidelity=simulator.fidelity) for one in likely
    ]
    prior = np.array([one.probability for one in likely])
    labels = [one.label for one in likely]
    others = np.array(labels)[:, None] != np.array(labels)[None, :]
    if not others.any():  # one explanation: its robots are to be set apart
        others = ~np.eye(len(likely), dtype=bool)
    leaders = [labels.index(label) for label in dict.fromkeys(labels)][: settings.leaders]
    perturbed = [
        (index, robot)
        for index in leaders
        for robot in perturbed_robots(robots[index], seed, settings.robots, Stream.EXPERIMENT_ROBOTS)
    ]
    return CommandScorer(robots, perturbed, prior / prior.sum(), others, floors, executor, settings)


def _best_of_each(found: Sequence[ScoredCommands]) -> list[ScoredCommands]:
    """Return the best commands of each shape, channel and side, the best first."""
    best: dict[tuple[str, str, bool], ScoredCommands] = {}
    for one in sorted(found, key=_rank):
        best.setdefault((one.made.shape.name, one.made.channel, one.made.size.share > 0.0), one)
    return list(best.values())


def _rank(one: ScoredCommands) -> tuple[float, float]:
    """Return what is small for good commands: doubt first; where that is as good as none, the distance."""
    return round(one.separation.doubt, 4), -one.separation.mean


def _inseparable(labels: Sequence[str], separations: Sequence[Separation]) -> tuple[tuple[str, str], ...]:
    """Return each two explanations of which some robots are closer than a floor on all commands."""
    widest = np.max([one.distances for one in separations], axis=0)
    close = [(labels[j], labels[i]) for i in range(len(labels)) for j in range(i) if widest[i, j] < 1.0]
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
