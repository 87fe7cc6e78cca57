"""Tuning constants of the judgement and of the next experiment, and of a whole diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

from gaitopt.diagnose.fit.settings import (
    EXACT_SETS,
    FIT,
    GAIT_SETS,
    RESPONSE,
    SETS,
    WHITENING,
    FitSettings,
    ResponseSettings,
    SetSettings,
    WhiteningSettings,
)
from gaitopt.diagnose.gap import settings as gap_settings
from gaitopt.diagnose.gap.settings import GapSettings


@dataclass(frozen=True)
class LatenessSettings:
    """How the delays of commands by chance are found.

    Attributes:
        shortest_s: commands whose changes follow one another sooner, in the median, are left out, s.
        tried_s: delay at which the response is simulated, s, at most half the time to the next change.
        least_s, most_s: standard deviations of the delays that are tried, s.
        sizes: number of them.
        rounds: times that the response is simulated, later at the delay that was found.
        gain: logarithm of how much likelier the repeats' differences must be with delays than without.
        explained: share of the differences above the noise that delays must explain: a wandering sensor has
            0.6, short delays have 0.98.
        long_s: smallest standard deviation of long delays, s. A reversal that is so late meets the next one,
            and what the two do is not the sum of what each does.
        long_explained: the share that long delays must explain: planted ones of 17 and 24 ms have 0.88.
        interval: fall of the logarithm of the likelihood at the ends of a 90 % interval (half of 2.71, the
            90 % point of chi-square with one degree of freedom).
    """

    shortest_s: float = 0.05
    tried_s: float = 5e-3
    least_s: float = 5e-4
    most_s: float = 0.1
    sizes: int = 90
    rounds: int = 2
    gain: float = 10.0
    explained: float = 0.9
    long_s: float = 0.01
    long_explained: float = 0.8
    interval: float = 1.355


LATENESS = LatenessSettings()


@dataclass(frozen=True)
class SmallErrorSettings:
    """Robots with small errors.

    Attributes:
        robots: number of robots about the nominal one.
        tolerant: number of robots that are wrong in everything by the tolerances: more than there are errors
            on a robot with few servos, so that each error is in the covariance.
        mass: relative standard deviation of each body's mass: a kitchen scale on parts of some grams.
        hinge: relative standard deviation of one hinge's stiffness about the others'.
        almost_equal: number of robots that say how much of a loss is luck,
        almost: and how far their start poses differ, in tolerances.
    """

    robots: int = 7
    tolerant: int = 56
    almost_equal: int = 6
    almost: float = 0.1
    mass: float = 0.02
    hinge: float = 0.05


@dataclass(frozen=True)
class EvidenceSettings:
    """How held-out losses become probabilities.

    Attributes:
        temper: number of whitened squares that count as one: the residual of a correct model is correlated
            from bin to bin.
        jump_share: share of the jumps of the loss near the best candidate that is added to `temper`, trial by
            trial: a fast gait, on which the loss jumps, then does not weaken the evidence of a slow one.
        prior_weight: weight of the prior of a fitted parameter: bounds and priors are guesses too.
        prior_freedom: degrees of freedom of the Student's t tails of the priors.
        luck: errors of the scores of sets, in standard deviations of the losses of almost equal robots. A fit
            is the luckiest of several such robots, and robots with other effects differ more.
        luck_draws: draws of these errors.
        in_set: a candidate belongs to the answer if it is at least this probable, relative to the first.
        set_share: candidates are added to the answer until their probabilities sum to this.
        chance_draws: draws of the parametric bootstrap that gives the p-value.
        gap_draws: resamplings of the blocks that give the interval of the shrinkage.
    """

    temper: float = 3.0
    jump_share: float = 0.5
    luck: float = 2.0
    luck_draws: int = 4000
    prior_weight: float = 0.3
    prior_freedom: float = 3.0
    in_set: float = 0.05
    set_share: float = 0.97
    chance_draws: int = 999
    gap_draws: int = 400


@dataclass(frozen=True)
class PrecisionSettings:
    """How the interval of a parameter is found.

    Attributes:
        robots: number of robots with small errors about a candidate.
        tail: one-sided probability of Student's t for the shifts of the fit with these robots.
        likely: rise of the loss at the ends of a 90 % interval, in tempered squares: 1.645 squared.
        jump_share: share of a jump of the response by which a fit may be off. With it 9 in 10 of 50 intervals
            covered the truth.
    """

    robots: int = 8
    tail: float = 0.95
    likely: float = 2.71
    jump_share: float = 0.5


@dataclass(frozen=True)
class CovarianceSettings:
    """How the covariance is re-estimated.

    Attributes:
        contenders: number of leading candidates whose perturbed robots give it, at most; one of the same
            effects.
        estimates: number of times that it is re-estimated at most.
    """

    contenders: int = 3
    estimates: int = 3


@dataclass(frozen=True)
class VerdictSettings:
    """Thresholds of the answer. The residual of a candidate is a mean whitened square: 1 for a correct model.

    Attributes:
        no_gap: a nominal robot that leaves at most this in every trial whose gap is above its floor has no
            significant gap. It is below 1: a small effect that acts equally in all trials is not visible in
            their mean squares, but a robot with the effect fits better.
        faint_gap: a nominal robot that leaves at most this has no gap if no effect explains it.
        left: a candidate that leaves more than this leaves a significant gap.
        other_half: something else has a probability of one half if the best candidate leaves this.
        other_slope: how fast that probability changes with the logarithm of what is left.
        significance: an effect is blamed if its p-value is at most this.
        above_none: an effect joins the answer beside the first if it is this many times as probable as none.
        short: one effect alone does not explain the trials if it leaves more than this; a correct one nearly
            always leaves less.
        exact_begin: few effects of an exactly made robot are fitted to whole trials if they leave at most
            this of the beginning of each, by the covariance of the nominal robot.
        little: an effect that takes away a smaller part of the whitened residual than this explains nothing.
        uneven: recorded cycles are uneven if they differ this many times as much as simulated ones.
        noise_error: relative error of the measurement's noise, as estimated from the record.
        matters: an effect of sets is no cause where it changes less than this, as a mean whitened square in
            the trial that it changes most: it makes a small error smaller. In gaits of a robot that is a
            little wrong in everything, the change is counted in floors.
        hinted: an effect that is as probable as a cause may be one if it moves gaits at least this many times
            as far as `matters` says; squares count by the square of this. So may one of logged commands
            where no effect matters, but they close a gap above its floor.
        certain: p-value below which a gap is real even if each effect changes less than `matters`: a
            covariance that is a little too narrow does not explain it.
        at_work: an effect of sets is a cause if it is at least this probable,
        possible: and may be one if it is at least this probable.
    """

    no_gap: float = 0.8
    faint_gap: float = 1.8
    left: float = 2.0
    other_half: float = 3.0
    other_slope: float = 3.0
    significance: float = 0.02
    above_none: float = 3.0
    short: float = 1.2
    exact_begin: float = 3.0
    little: float = 0.3
    uneven: float = 4.0
    noise_error: float = 0.3
    matters: float = 2.0
    hinted: float = 0.5
    certain: float = 1e-9
    at_work: float = 0.5
    possible: float = 0.1


@dataclass(frozen=True)
class ExperimentSettings:
    """How the next experiment is chosen.

    Attributes:
        seconds: length of the proposed recording, s; at least two cycles.
        random: gaits drawn at random.
        hand_tuned_doubt: a hand-tuned wave is proposed if it leaves at most this much more doubt.
        refined: gaits drawn near the best one, for each step.
        steps: sizes of the steps from the best gait so far, in units of the box.
        candidates: candidates that count, on all their targets, at most.
        least_probability: and they are at least this probable, relative to the first.
        noise_m: noise of a recorded marker, m.
        angle_noise_rad: noise of a recorded angle, rad.
        caution: factor on the variance of a few robots about a candidate that is not quite right.
        leaders: candidates about which robots are perturbed, at most.
        robots: perturbed robots of each of them.
        finalists: gaits that are scored again, by other robots: of many gaits scored by few robots, the best
            one is partly best by chance.
        final_robots: perturbed robots of each leading candidate for the finalists.
    """

    seconds: float = 8.0
    random: int = 10
    hand_tuned_doubt: float = 0.02
    refined: int = 5
    steps: tuple[float, ...] = (0.12, 0.08)
    candidates: int = 8
    least_probability: float = 0.01
    noise_m: float = 1e-3
    angle_noise_rad: float = 3e-3
    caution: float = 2.0
    leaders: int = 3
    robots: int = 2
    finalists: int = 3
    final_robots: int = 3


@dataclass(frozen=True)
class ChanceSettings:
    """How the size of an effect of chance is found.

    Attributes:
        shares: shares of its range at which it is simulated.
        grid: sizes that are compared between the smallest and the largest of these.
        least_ratio: smaller ratios of squares count as this one.
        least_scatter: standard deviation of the logarithm of a ratio, at least: with ten cycles a variance is
            known to half of itself.
        interval: how much the squares may grow, in variances, inside the 90 % interval; twice what
            independent signals would allow.
        least_log_prior: logarithm of the prior density of a plausible size, at least, the largest being 0:
            three standard deviations.
    """

    shares: tuple[float, ...] = (0.03, 0.08, 0.2, 0.45, 1.0)
    grid: int = 241
    least_ratio: float = 1e-3
    least_scatter: float = 0.5
    interval: float = 5.4
    least_log_prior: float = -4.5


@dataclass(frozen=True)
class DiagnosisSettings:
    """All tuning constants of a diagnosis, by what they belong to."""

    gap: GapSettings = gap_settings.DEFAULT
    whitening: WhiteningSettings = WHITENING
    fit: FitSettings = FIT
    sets: SetSettings = SETS
    gait_sets: SetSettings = GAIT_SETS
    exact_sets: SetSettings = EXACT_SETS
    response: ResponseSettings = RESPONSE
    lateness: LatenessSettings = LATENESS
    small_errors: SmallErrorSettings = SmallErrorSettings()
    evidence: EvidenceSettings = EvidenceSettings()
    precision: PrecisionSettings = PrecisionSettings()
    covariance: CovarianceSettings = CovarianceSettings()
    verdict: VerdictSettings = VerdictSettings()
    experiment: ExperimentSettings = ExperimentSettings()
    chance: ChanceSettings = ChanceSettings()


SMALL_ERRORS = SmallErrorSettings()
EVIDENCE = EvidenceSettings()
VERDICT = VerdictSettings()
EXPERIMENT = ExperimentSettings()
DEFAULT = DiagnosisSettings()
