"""Settings of a campaign that no option of the command line sets."""

from __future__ import annotations

from dataclasses import dataclass, field

from gaitopt.optimise.study import StudySettings


@dataclass(frozen=True)
class SearchShares:
    """What a step spends the budget of gaits on.

    A gait costs as many rollouts as there are robots to judge it. A search on one robot is cheap, and its end
    depends much on chance. So there are several of these, and the robust one sets out from what they found.

    Attributes:
        repertoire: gaits of the first search that are known beside its winner. All searches set out from
            them, too.
        own_robots: robots of the posterior that a gait of its own is searched for.
        own: share of the budget for each of these searches; a gait there costs one rollout.
        robots: robots of the posterior that judge each gait of the robust search.
        robust: share of the budget for the robust search.
        kept: best gaits of the robust search that are candidates.
        study: how the searches work.
    """

    repertoire: int = 8
    own_robots: int = 3
    own: float = 0.25
    robots: int = 3
    robust: float = 0.25
    kept: int = 3
    study: StudySettings = field(default_factory=StudySettings)


@dataclass(frozen=True)
class BeliefSettings:
    """What is expected where nothing was filmed yet.

    Attributes:
        length: length scale of the discrepancy between measured and predicted speed or drift, in units of
            the gait space. Simulated: of three robots that are a little wrong in everything it is unlike in
            two gaits that are 0.1 to 0.2 apart (results/campaigns/discrepancy.md). A length for an objective
            of which nothing is known, 0.85 for ArcFold, would take a film for one of all gaits near it.
        size: standard deviation of the discrepancy before any film, as a share of the highest predicted
            speed. Simulated: in 23 steps of five campaigns 97 % of the gaits that were found then keep their
            90 % interval, and half of it makes their speeds most likely (results/campaigns/development.md).
            It is larger because those robots were few.
        evidence: films that the assumed size counts for beside the real ones.
        repeatability: least standard deviation of the speed of a gait that is filmed again, as a share of the
            speed. Assumed: a floor and a battery are never twice the same.
        confirmed: the speed of a recording that fits no explanation counts where another recording of the
            same gait differs by no more than this share of the faster one.
        drift: standard deviation of what a predicted drift, sideways over forward travel, is off. Simulated:
            14 ArcFolds that are a little wrong in everything drift by their mean plus or minus 0.04 to 0.12.
        drift_repeatability: standard deviation of the drift of a gait that is filmed again. Simulated:
            0.01 to 0.07 over the start poses of ArcFold.
        draws: joint draws of all speeds, for what there is still to gain.
    """

    length: float = 0.15
    size: float = 0.1
    evidence: float = 2.0
    repeatability: float = 0.01
    confirmed: float = 0.15
    drift: float = 0.075
    drift_repeatability: float = 0.03
    draws: int = 2000


BELIEF = BeliefSettings()


@dataclass(frozen=True)
class CampaignSettings:
    """How a campaign works.

    Attributes:
        robots: robots of the posterior over which each candidate is predicted.
        most_breaking: a gait is filmed only if it breaks a limit that guards the robot on at most this share
            of them.
        prior_effects: effects that a robot has beside the nominal ones before any film. Assumed: one or two
            large ones, as in trials of real robots.
        diagnosed_s: length of all films together that is diagnosed, s: a diagnosis simulates six hundred
            robots, each as long. Of four films 8 s named wrong effects where 12 s and 16 s named the right
            one (results/campaigns/development.md).
        search: how gaits are searched.
        belief: what is expected where nothing was filmed.
    """

    robots: int = 20
    most_breaking: float = 0.1
    prior_effects: tuple[int, int] = (1, 2)
    diagnosed_s: float = 12.0
    search: SearchShares = field(default_factory=SearchShares)
    belief: BeliefSettings = BELIEF


DEFAULT = CampaignSettings()
"""What a campaign uses where no settings are given; tests of the command line set it to less work."""
