"""Settings of the comparison of measured and simulated trials."""

from __future__ import annotations

from dataclasses import dataclass

from gaitopt.diagnose.record.settings import DEFAULT as DEFECTS
from gaitopt.diagnose.record.settings import DefectSettings


@dataclass(frozen=True)
class AlignSettings:
    """How an unknown offset in time is searched.

    Attributes:
        offsets: offsets tried before the best is refined: 5 ms apart where a gait's cycle lasts 1 s, 10 ms
            at most where commands were logged.
        precision_s: precision of the refined offset, s.
    """

    offsets: int = 401
    precision_s: float = 1e-5


@dataclass(frozen=True)
class FloorSettings:
    """How the floor is measured.

    Attributes:
        start_poses: number of start poses drawn; see `floor` for their size.
        halved: the error by the timestep is this many times the change when the timestep is halved. It is 2
            for a method of first order, and contact makes every method one of first order.
        quietest: of the recordings of one sensor this share is quieter than the noise that is taken for all.
    """

    start_poses: int = 4
    halved: float = 2.0
    quietest: float = 0.25


@dataclass(frozen=True)
class MismatchSettings:
    """When a recording is taken not to fit its simulation at all.

    Attributes:
        ratios: periods tried, over the commanded one.
        near: periods this far either side of each are tried too, as a share of it,
        near_steps: in this many steps.
        explained: a period is one of the motion if its mean cycle explains this share of the variance.
        as_good: of several such periods the shortest is taken that explains this share of the best.
        part_of_longer: where a longer period than the commanded one is found, the commanded one may explain
            at most this share of what the longer one does. An uneven walk repeats better every two or four
            cycles than every cycle, but it does repeat every cycle.
        frames_per_period: a period that is tried has at least this many frames.
        periods_per_span: the recording has at least this many of it.
        unlike: a measured range within a block this many times the simulated one, or the inverse, is in
            another unit.
        reversed: correlation with the simulated motion below which an axis is reversed.
        travels: a coordinate travels if its travel per cycle exceeds this share of its swing within a cycle.
        travels_back: it is reversed if it travels the other way by this share of the simulated travel.
        moves: an angle moves if its range is this many times its noise.
    """

    ratios: tuple[float, ...] = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125)
    near: float = 0.05
    near_steps: int = 21
    explained: float = 0.5
    as_good: float = 0.85
    part_of_longer: float = 0.4
    frames_per_period: float = 4.0
    periods_per_span: float = 1.5
    unlike: float = 20.0
    reversed: float = -0.6
    travels: float = 0.5
    travels_back: float = 0.25
    moves: float = 20.0


@dataclass(frozen=True)
class MisfitSettings:
    """When a recording is taken not to be of its gait.

    Attributes:
        window: a robot stands still in a window of this length, in blocks,
        still: if no signal's range in it exceeds this share of its usual range,
        usual: which is this quantile over the windows: the robot may stand still in most of them,
        above_noise: or this many times its noise.
        expected: only windows count in which the prediction moves by this share of its usual range.
        still_windows: it stands still for so many windows, up to the end,
        still_longer: and for this many times as many as ever before.
        unlike: a recording is not like its prediction if their mean squared difference is more than this, in
            variances of the recording. The commands of two gaits are alike by the same measure,
        near_period: if the logarithms of their periods differ by this at most.
        explained: another gait explains a recording if it leaves at most this, in variances of it,
        more_alike: and at most this share of what its own gait leaves.
    """

    window: float = 0.5
    still: float = 0.08
    usual: float = 0.85
    above_noise: float = 8.0
    expected: float = 0.3
    still_windows: int = 2
    still_longer: float = 2.0
    unlike: float = 0.4
    near_period: float = 0.1
    explained: float = 0.7
    more_alike: float = 0.6


@dataclass(frozen=True)
class SplitSettings:
    """How a gap is split into its components.

    Attributes:
        delays: number of delays tried between measured and simulated motion.
        largest_delay: the largest of them, in blocks either side.
        resembles: the measured motion resembles the simulated one if the best delay and size leave less than
            this share of its mean square. Otherwise no delay and no size are fitted.
    """

    delays: int = 121
    largest_delay: float = 0.25
    resembles: float = 0.5


@dataclass(frozen=True)
class CommandSplitSettings:
    """How a gap under commands without a period is split into its components.

    Attributes:
        longest_lag_s: longest delay tried, s: several times what passes between a command and a hobby servo's
            first motion (0.05 s).
        longest_lag: longest delay tried, as a share of the recording.
        delays: number of delays tried,
        finer: and between the neighbours of the best.
        limits: limits of the speed tried, over the top speed of the slower curve.
        behind: a limit counts where it changes the quicker curve by this share of the slower one's range.
        at_limit: in this share of the samples where it counts, the slower curve must run at it,
        near_limit: to within this share of it.
        slowest_limit: a limit is at least this share of the top speed in all trials.
        still: a curve hardly moves if its motion is smaller than this share of the other one's.
        plain: drift is fitted only if it leaves less than this share of what any other component leaves.
        least: a component is fitted while it removes this share of the gap's mean square,
        chance: and this many times what a constant fitted to noise alone removes.
        rounds: most components fitted; one may come again after another.
        points_per_frame: points of a simulated curve between two samples,
        points: and about this many in all where there are many samples.
        settle_s: what is left this soon after a jump of the command belongs to that jump, s. A large step
            of a hobby servo takes 0.4 s; ringing at 8 Hz with a damping of 0.2 falls below a tenth in 0.25 s.
        near_top: motion is at its limit if it has this share of its top speed,
        ahead_s: and the command is further ahead than it comes in this time, s, more than the lag of a servo
            that follows; or if the command is further away than it comes in this time at its top speed.
        asked: in a trial at a limit, the command goes this many times as far in that time as the motion can.
        slow_s: length of the smoothing that divides slow from fast, s. Stick and slip is faster (4 to 8 Hz).
    """

    longest_lag_s: float = 0.25
    longest_lag: float = 0.5
    delays: int = 101
    finer: int = 21
    limits: tuple[float, ...] = (0.75, 0.8, 0.85, 0.9, 0.95, 1.0, 1.05)
    near_limit: float = 0.2
    behind: float = 0.02
    at_limit: float = 0.75
    slowest_limit: float = 0.5
    still: float = 0.2
    plain: float = 0.5
    least: float = 0.01
    chance: float = 8.0
    rounds: int = 8
    points_per_frame: int = 4
    points: int = 4000
    settle_s: float = 0.5
    near_top: float = 0.7
    ahead_s: float = 0.2
    asked: float = 1.2
    slow_s: float = 0.5


@dataclass(frozen=True)
class GapSettings:
    """Settings of everything that compares measured with simulated trials, from their cleaning on."""

    defects: DefectSettings = DEFECTS
    align: AlignSettings = AlignSettings()
    floor: FloorSettings = FloorSettings()
    mismatches: MismatchSettings = MismatchSettings()
    misfits: MisfitSettings = MisfitSettings()
    split: SplitSettings = SplitSettings()
    split_commands: CommandSplitSettings = CommandSplitSettings()


DEFAULT = GapSettings()
