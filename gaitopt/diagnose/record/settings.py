"""Settings of the search for defects."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ClockSettings:
    """When time stamps are taken to be rounded to a grid.

    Attributes:
        grids_s: grids that clocks are rounded to, coarsest first, s.
        least_grid: a grid matters if it is at least this share of the time between frames.
        least_steps: fewer steps between stamps than this are not enough to judge.
        on_grid_s: a stamp this close to a line of the grid lies on it, s.
        rare_step, two_steps: evenly spaced frames, rounded, are one of two numbers of grid steps apart.
            Rounding is accepted if each of the two has the first share of the steps and both have the second.
        repeated: rounding is also accepted if this share of the stamps repeats the one before.
        continued: stamps are rounded from an even clock if they are within this share of the grid of the line
            through the frames before them. Rounding itself makes half a grid.
        fitted: the same for a line through the stamps themselves, which is less certain.
    """

    grids_s: tuple[float, ...] = (1.0, 0.5, 0.25, 0.2, 0.1, 0.05, 0.04, 0.025, 0.02, 0.01, 0.005)
    least_grid: float = 0.25
    least_steps: int = 12
    on_grid_s: float = 1e-6
    rare_step: float = 0.1
    two_steps: float = 0.9
    repeated: float = 0.2
    continued: float = 0.55
    fitted: float = 0.75


@dataclass(frozen=True)
class SteppedCurveSettings:
    """When a curve read off a plot is taken to move only at the lines of a grid.

    Gaits have edges on a grid too, and three cells of a smooth walk may look stepped by chance. So several
    cells must show it, some of them in a row.

    Attributes:
        frames_per_grid: a grid is longer than this many frames.
        grids_per_period: a period has at least this many grid cells.
        line: half the width of a line, as a share of the grid.
        cell_stepped: a cell is stepped if more than this share of its motion lies within the line. A smooth
            curve has 0.4.
        stepped: the same for all moving cells together.
        cells: at least this many cells must be stepped.
        in_a_row: at least this many of them must follow one another.
        moving: a cell moves if it moves by this share of the range within a cycle.
        noise_path: a cell that moves less than this, in standard deviations of noise a sample, may stand
            still. The path of noise alone is half of it.
    """

    frames_per_grid: float = 4.0
    grids_per_period: float = 8.0
    line: float = 0.2
    cell_stepped: float = 0.6
    stepped: float = 0.7
    cells: int = 6
    in_a_row: int = 3
    moving: float = 0.05
    noise_path: float = 1.0


@dataclass(frozen=True)
class FrameSettings:
    """When frames are taken to be missing or frozen.

    Attributes:
        dropped: a step longer than this many typical ones has frames missing.
        frozen_samples: at least this many equal samples in a row may be frozen.
        jump_quanta: after frozen frames the marker jumps by more than this many quanta of a rounded series,
        jump_steps: and by more than this many times the step that `jump_quantile` of all steps stay below.
        jump_quantile: see `jump_steps`.
    """

    dropped: float = 1.8
    frozen_samples: int = 4
    jump_quanta: float = 10.0
    jump_steps: float = 2.0
    jump_quantile: float = 0.95


@dataclass(frozen=True)
class AngleSettings:
    """When measured angles are taken to be wrapped, coarse or stuck.

    Attributes:
        turn: a step this close to a whole turn, as a share of it, is a jump of the sensor.
        moving: nothing else moves by more than this share of a turn between two samples.
        least_levels, levels: a sensor is coarse if the whole motion has this many of its steps at least, and
            this many at most; a joint at rest has one or two,
        distinct: and at most this share of the samples have distinct values.
        on_step: a difference is a whole number of steps within this share of a step.
        stuck_samples: at least this many equal samples in a row may be stuck.
        jump: a stuck sensor then jumps by more than this many times the largest other step,
        jump_steps: and by more than this many of its own steps.
        jumped: the jumps are at most this share of the whole path: a joint that rests, and moves from one
            sample to the next, is not stuck.
        commanded: an angle that never changes again is stuck if each channel is commanded through this share
            of the angle's range meanwhile, and through `least_commanded_rad`.
        least_commanded_rad: see `commanded`.
        answer_s: commands this close to the end of a recording are not counted: an angle may follow later.
    """

    turn: float = 0.2
    moving: float = 0.25
    least_levels: int = 3
    levels: int = 20
    distinct: float = 0.5
    on_step: float = 0.01
    stuck_samples: int = 4
    jump: float = 1.5
    jump_steps: float = 10.0
    jumped: float = 0.5
    commanded: float = 0.5
    least_commanded_rad: float = 0.2
    answer_s: float = 0.25


@dataclass(frozen=True)
class OutlierSettings:
    """When a sample of the marker is taken to be an outlier.

    Attributes:
        window: samples whose median an outlier is compared with.
        least_window: the window is shorter where `window` samples span much of a block, but not shorter than
            this.
        windows_per_block: how many windows fit into a block at least.
        sigmas: an outlier is off by more than this many standard deviations of the noise,
        range_share: and by more than this share of the range within a block.
        farthest: in each pass those are judged that are off by this share of the farthest; see `outliers`.
        near_frames: excursions of other cycles are at the same phase within this many frames.
        alike: they count as similar if they are at least this share of the excursion in size.
        recurring: an excursion is motion if it recurs in at least this share of the other cycles.
    """

    window: int = 7
    least_window: int = 3
    windows_per_block: float = 8.0
    sigmas: float = 6.0
    range_share: float = 0.05
    farthest: float = 0.5
    near_frames: float = 1.5
    alike: float = 0.5
    recurring: float = 0.5


@dataclass(frozen=True)
class DefectSettings:
    """Settings of the search for all defects of a recording."""

    clock: ClockSettings = ClockSettings()
    stepped_curve: SteppedCurveSettings = SteppedCurveSettings()
    frames: FrameSettings = FrameSettings()
    angles: AngleSettings = AngleSettings()
    outliers: OutlierSettings = OutlierSettings()


DEFAULT = DefectSettings()
