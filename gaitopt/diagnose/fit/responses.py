"""What each effect does alone, from the robots that were simulated with it and no other.

Added to the residual of a set of effects, it predicts what the effect does beside them. Responses add up only
roughly, so the sum says which effects are worth a simulation beside the set, not how well they fit.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaitopt.diagnose.fit.hypotheses import Hypothesis
from gaitopt.diagnose.fit.single import Fit
from gaitopt.diagnose.fit.trials import Comparison


@dataclass(frozen=True)
class Like:
    """An effect that alone does nearly what others do.

    Attributes:
        hypothesis: the effect.
        at: its coordinate where it comes closest to them,
        robot: and the robot expected there.
        cosine: cosine between what it changes and what they do.
    """

    hypothesis: Hypothesis
    at: float
    robot: Comparison
    cosine: float


@dataclass(frozen=True)
class SingleResponses:
    """The robots with one effect each.

    Attributes:
        robots: each effect's robots with its coordinates, by the name of the hypothesis.
        centre: the trials compared with the robot without any of them.
    """

    robots: Mapping[str, Sequence[tuple[float, Comparison]]]
    centre: Comparison

    @staticmethod
    def of_fits(fits: Sequence[Fit], nominal: Comparison) -> SingleResponses:
        """Return what the effects' own fits tell."""
        robots = {fit.hypothesis.name: [(float(one.at[0]), one) for one in fit.comparisons] for fit in fits}
        return SingleResponses(robots, nominal)

    def beside(self, robot: Comparison, hypothesis: Hypothesis) -> list[tuple[float, Comparison]]:
        """Return what an effect is expected to do to another robot, at each coordinate that was simulated.

        Args:
            robot: the trials compared with the other robot.
            hypothesis: the effect.
        """
        return [
            (at, self._sum(robot, one, at))
            for at, one in self.robots.get(hypothesis.name, ())
            if abs(hypothesis.moved(at)) > _NEUTRAL
        ]

    def likest(
        self, robot: Comparison, other: Comparison, hypothesis: Hypothesis
    ) -> tuple[float, Comparison | None, float]:
        """Return where an effect, added to a robot, comes closest to another robot.

        Args:
            robot: the trials compared with the robot.
            other: the trials compared with the other one.
            hypothesis: the effect.

        Returns:
            Its coordinate; the expected robot, None where the effect was not simulated; and the cosine
            between what it changes and the difference of the robots.
        """
        wanted = other.whitened - robot.whitened
        best: tuple[float, Comparison | None, float] = (hypothesis.neutral, None, 0.0)
        least = np.inf
        for at, expected in self.beside(robot, hypothesis):
            change = expected.whitened - robot.whitened
            apart = float(np.sum((change - wanted) ** 2))
            if apart < least:
                least = apart
                sizes = float(np.linalg.norm(change) * np.linalg.norm(wanted))
                best = (at, expected, float(change @ wanted) / max(sizes, 1e-12))
        return best

    def likes(
        self, robot: Comparison, other: Comparison, hypotheses: Iterable[Hypothesis], least: float
    ) -> list[Like]:
        """Return the effects that alone, added to a robot, do nearly what another robot does otherwise.

        Args:
            robot: the trials compared with the robot.
            other: the trials compared with the other one.
            hypotheses: the effects to look among.
            least: the least cosine of one that is returned.
        """
        found = []
        for hypothesis in hypotheses:
            at, expected, cosine = self.likest(robot, other, hypothesis)
            if expected is not None and cosine >= least:
                found.append(Like(hypothesis, at, expected, cosine))
        return found

    def _sum(self, robot: Comparison, one: Comparison, at: float) -> Comparison:
        return replace(
            robot,
            at=np.append(robot.at, at),
            whitened=robot.whitened + one.whitened - self.centre.whitened,
            marker=robot.marker + one.marker - self.centre.marker,
            angles=robot.angles + one.angles - self.centre.angles,
        )


_NEUTRAL = 1e-6
"""A coordinate closer to the neutral one, in ranges, shows nothing of the effect."""
