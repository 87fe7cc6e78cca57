"""Tuning constants of the fits: frozen records, each field with its reason."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class WhiteningSettings:
    """How a trial is averaged over bins, and the covariance that whitens its residual.

    Attributes:
        bins_per_block: bins in a block (a cycle, where there are cycles), if the frame rate allows.
        max_bins: bins of a trial at most: the covariance is a dense matrix of that size.
        origin_m: standard deviation of the marker's unknown origin, m.
        remainder: size of the smooth remainder, as a share of the change with small errors.
        remainder_blocks: length over which the remainder is correlated, in blocks.
        remainder_wander: variance of the remainder's random walk at the trial's end, in variances of the
            remainder.
        inflation: factor on the covariance of a few perturbed robots, which is too small by about this.
        spread_blocks: length over which the differences between cycles are correlated, in blocks.
        least_marker_m: smallest error of a bin of the marker, m: a simulator of rigid boxes is not more
            exact.
        least_angle_rad: the same of an angle, rad.
        least_clock_s: smallest error of the clock of logged commands, s: a time step of the simulation, which
            takes the angle that a servo follows from the beginning or the end of a step.
        offset_steps: Gauss–Newton steps at most for an unknown offset of the recording.
        offset_difference_s: half of the difference in offset over which a slope is measured, s.
        offset_max_blocks: longest step of the offset, in blocks.
        offset_tolerance_s: a shorter step is the last one, s.
    """

    bins_per_block: int = 20
    max_bins: int = 160
    origin_m: float = 0.05
    remainder: float = 0.35
    remainder_blocks: float = 0.1
    remainder_wander: float = 2.0
    inflation: float = 1.5
    spread_blocks: float = 0.3
    least_marker_m: float = 1e-4
    least_angle_rad: float = 1e-3
    least_clock_s: float = 1e-3
    offset_steps: int = 4
    offset_difference_s: float = 2e-3
    offset_max_blocks: float = 0.1
    offset_tolerance_s: float = 1e-4


@dataclass(frozen=True)
class FitSettings:
    """How one effect is fitted.

    Attributes:
        screened: shares of the way from neutral to each bound at which a robot is simulated first. One of
            them predicts little about another: a limit shows nothing until it is reached, some responses
            begin late, and more friction is not the opposite of less.
        probe: the one of these at which every effect is simulated;
        promising: it is simulated at the others if the change there, multiplied by some number, removes this
            share of the loss at least. For sets all are simulated: a small effect may act beside others.
        screened_measurement: the same for effects of the measurement, which need no simulation.
        per_interval: points of the loss curve between two simulated ones.
        rounds: number of hypotheses that are refined in each round. More than the leading ones: a fit in a
            narrow valley shows that it is better only when simulated robots are near its minimum.
        hopeless: in each round, the last value for the rest, a hypothesis is dropped that leaves this many
            times the least loss.
        alike: cosine from which two signatures count as similar. A hypothesis whose signature is like that of
            the best is not dropped: its parameter may still be too small.
        tolerance: parameters closer than this share of the range are not simulated again.
        tolerance_measurement: the same for effects of the measurement: a tenth of a millisecond of a clock.
        aside: where the least loss is at a simulated robot, this share of the way to a neighbour is tried.
        aside_tolerances: a neighbour counts for that if it is more than this many tolerances away.
        close: mean square by which the residual of a leading fit may differ from that of the nearest
            simulated robot.
        leading: fits that leave at most this many times the least loss are finished until they are `close`,
        near: if the least loss is at most so many times what a correct model leaves.
        head_s: length of the beginnings of trials to which all effects are fitted first, s; a block at least.
        head_share: that pays if it takes at most this share of the simulated time,
        shown: and if the sum of the whitened squares that the nominal robot leaves there is larger than that
            of a correct model by this at least.
        visible: mean whitened square from which the gap is clear there, and sets of effects are searched in
            them, too.
        hopeless_head: an effect is not fitted to whole trials that leaves this many times the least loss of
            their beginnings,
        removed_head: or that removes a smaller share than this of what the best one removes of that loss.
        leading_head: effects that are fitted to whole trials, at most.
        finish_rounds: rounds of finishing at most.
        finish_rounds_measurement: the same for effects of the measurement.
    """

    screened: tuple[float, ...] = (0.2, 0.6, 1.0)
    probe: float = 0.6
    promising: float = 0.02
    screened_measurement: tuple[float, ...] = (0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0)
    per_interval: int = 24
    rounds: tuple[int, ...] = (22, 16, 12, 8, 8, 8, 6, 6, 4, 4)
    hopeless: tuple[float, ...] = (math.inf, 12.0, 6.0, 4.0)
    alike: float = 0.9
    tolerance: float = 0.004
    tolerance_measurement: float = 1e-4
    aside: float = 0.35
    aside_tolerances: float = 4.0
    close: float = 0.01
    leading: float = 1.5
    near: float = 6.0
    head_s: float = 3.0
    head_share: float = 0.6
    shown: float = 300.0
    visible: float = 5.0
    hopeless_head: float = 12.0
    removed_head: float = 0.5
    leading_head: int = 24
    finish_rounds: int = 4
    finish_rounds_measurement: int = 20


@dataclass(frozen=True)
class SumSettings:
    """How sums of two single effects are chosen.

    Attributes:
        refined: sums that are moved to where they are least.
        turns: number of times that each coordinate of a sum is moved.
        targets: sums of the same two effects, on other targets, at most.
        kept: sums that are simulated.
    """

    refined: int = 300
    turns: int = 3
    targets: int = 3
    kept: int = 16


@dataclass(frozen=True)
class ResponseSettings:
    """How the slopes and jumps of a response are measured near a simulated robot.

    Attributes:
        near: distance within which simulated robots together show the slopes, in ranges.
        close: robots nearer than this show no slope alone: one farther robot on each side counts too.
        nearest: number of nearest robots that show the jumps; the others differ by curvature too.
    """

    near: float = 0.06
    close: float = 0.01
    nearest: int = 3


@dataclass(frozen=True)
class ProposalSettings:
    """Values of an effect that changes commands in jumps, compared without a simulation.

    Attributes:
        least: smallest of them, as a share of the range,
        values: their number at first, each by the same factor larger than the one before,
        close_values: and once it is known how joints follow: of 1 rad, rounded to 100 steps, the next value
            changes the last step by a twentieth of one.
        lags_s: lags with which joints may follow, s.
        apart: logarithm of the factor between two proposals, at least.
        most: number of proposals at a time, at most.
    """

    least: float = 0.05
    values: int = 600
    close_values: int = 6000
    lags_s: tuple[float, ...] = (0.02, 0.05, 0.1, 0.2, 0.4)
    apart: float = 0.012
    most: int = 6


PROPOSALS = ProposalSettings()


@dataclass(frozen=True)
class SetSettings:
    """How sets of effects are fitted and searched.

    Attributes:
        freedom: degrees of freedom of the scale of each trial's covariance; see `RobustLoss`.
        temper: number of rows that count as one.
        errors_rad: sizes of the error that all trials share, rad,
        error_shares: and its shares of the motion.
        prior_weight: weight of the prior of a fitted parameter.
        prior_freedom: degrees of freedom of the Student's t tails of the priors.
        price: loss that an effect must save at least, or it is left out.
        worth: gain of the score from which the search goes on.
        screened: shares of the way from neutral to each bound at which an effect is tried first.
        screened_rough: the same for an effect with a rough response, which is fitted from the best of them,
            where `Proposals` cannot say more.
        between: places between two where an effect was tried, at which the loss is predicted,
        nearer: times that it is tried at the best of them, at most.
        beyond: how far an effect is expected to go, in multiples of where it was tried.
        centred: whether a fit begins where an effect was tried, if it is better there than without it: a
            response that jumps has valleys, and slopes lead to the nearest one.
        promising: effects that are simulated beside a set: those that promise most by what each does alone,
        promising_targets: on this many targets each, at most.
        started: effects that are added and fitted roughly.
        rough_rounds: rounds of that.
        refined: sets of these that are fitted well.
        fine_rounds: rounds of that.
        doubtful: an effect may be dropped, or exchanged, if the set without it is expected to score at most
            this much worse.
        dropped: sets with one effect less that are fitted, at most.
        swapped: sets with one effect exchanged that are fitted, at most.
        exchanges: number of exchanges after an addition, at most.
        alike: cosine from which an effect does nearly the same as one of the best set: so it takes its place.
        twins: effects that take the place of each effect so, at most.
        like_two: cosine from which one effect does nearly the same as two of the best set together,
        merged: and sets with it in their place that are fitted, at most.
        begun: a search sets out from so many sets at most,
        begun_within: those that score at most this much worse than the best of them.
        leading: sets that score at most this much worse than the best are finished,
        finished: at most this many of them,
        finish_rounds: in this many rounds.
        chord_errors: standard errors by which a parameter goes aside to both sides for a wide chord, in turn,
        chord_rise: until the loss rises by more than this in the mean,
        same_slope: or the slope differs from the one before by a smaller share than this.
        most_effects: effects in a set that grows, at most.
        most_rows: rows of a trial that count as separate, at most; see `RobustLoss`.
        one_by_one: effects that are added one by one before all are fitted together,
        other_ways: pairs of effects from which the search goes up anew,
        right: if the set leaves more than this mean whitened square
        few: in more than this share of the trials.
        starts: shares of the way from neutral to the better bound at which all effects begin.
        coarse_rounds: number of these starts that are fitted further in each round, by the first loss,
        coarse_radius: longest step of a coordinate at the start of each of these rounds, in ranges, at least.
        robust_rounds: rounds of the best of them by the second, after those that do nothing were dropped.
        widest_set: effects that are fitted together, at most: those that promised most when tried alone.
        gaussian: degrees of freedom of the first of these losses: so many that no trial can leave it.
        heldout_radius: longest step of a coordinate to the fit without a fold, in ranges: the slopes are not
            those of places farther away.
        inclusion: loss that the prior asks of each effect of a set when sets are judged on held-out trials.
        probable: what the effects of a set change is simulated if the set is at least this probable.
        misfit: a trial does not fit the others if it leaves this many times what the median trial leaves, and
            this many times what a correct model leaves.
        motion: error of a model that the first of these losses expects, as a share of the motion.
        reweighted: times that the weights of the trials are found anew for a step.
        first_radius: longest step of a coordinate at first, in ranges.
        widest: longest step of a coordinate, in ranges.
        shorter: the second step that is tried in a round is this much shorter.
        least_radius: steps shorter than this are not tried, in ranges.
        least_gain: a set is settled where less than this is expected to be gained.
        difference: distance over which a slope is measured, in ranges.
    """

    freedom: float = 4.0
    temper: float = 3.0
    errors_rad: tuple[float, ...] = (0.0, *(1e-4 * 1.5**k for k in range(18)))
    error_shares: tuple[float, ...] = (0.0, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12)
    prior_weight: float = 0.6
    prior_freedom: float = 3.0
    price: float = 6.0
    worth: float = 1.0
    screened: tuple[float, ...] = (0.1, 0.35, 0.8)
    screened_rough: tuple[float, ...] = tuple(0.08 * k for k in range(1, 13))
    between: int = 9
    nearer: int = 3
    beyond: float = 1.6
    centred: bool = False
    promising: int = 10
    promising_targets: int = 2
    started: int = 5
    rough_rounds: int = 3
    refined: int = 2
    fine_rounds: int = 3
    doubtful: float = 8.0
    dropped: int = 1
    swapped: int = 4
    exchanges: int = 2
    alike: float = 0.6
    twins: int = 2
    like_two: float = 0.9
    merged: int = 4
    begun: int = 4
    begun_within: float = 24.0
    leading: float = 12.0
    finished: int = 2
    finish_rounds: int = 2
    chord_errors: tuple[float, ...] = (3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
    chord_rise: float = 100.0
    same_slope: float = 0.2
    most_effects: int = 14
    most_rows: float = 10.0
    one_by_one: int = 3
    other_ways: int = 2
    right: float = 2.0
    few: float = 0.2
    starts: tuple[float, ...] = (0.05, 0.1, 0.15)
    coarse_rounds: tuple[int, ...] = (3, 2, 2, 1, 1, 1)
    coarse_radius: float = 0.1
    robust_rounds: int = 3
    widest_set: int = 20
    gaussian: float = 1000.0
    heldout_radius: float = 0.1
    inclusion: float = 6.0
    probable: float = 0.05
    misfit: float = 30.0
    motion: float = 0.1
    reweighted: int = 3
    first_radius: float = 0.35
    widest: float = 0.7
    shorter: float = 0.3
    least_radius: float = 0.002
    least_gain: float = 0.1
    difference: float = 0.02


WHITENING = WhiteningSettings()
FIT = FitSettings()
SETS = SetSettings()
SUMS = SumSettings()
GAIT_SETS = SetSettings(
    promising=14,
    most_rows=60.0,
    errors_rad=(0.0,),
    error_shares=(0.0,),
    price=8.0,
    inclusion=8.0,
    started=3,
    swapped=3,
    exchanges=1,
    rough_rounds=2,
    fine_rounds=2,
    finish_rounds=1,
    one_by_one=14,
    other_ways=0,
    difference=0.1,
    beyond=0.5,
    centred=True,
    misfit=2.5,
)
"""For gaits. A response jumps where a foot slips in another step, so slopes are measured over a longer
distance; and the tolerances are in the covariance, so there is no further error that all trials share."""
EXACT_SETS = replace(GAIT_SETS, most_effects=2, few=1.0, begun=6, fine_rounds=4)
"""For gaits of an exactly made robot. More than two effects may be what its small errors do."""
RESPONSE = ResponseSettings()
