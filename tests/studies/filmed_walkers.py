"""A sealed robot before a synthetic phone: a gait in, a data set of a tracked film out."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

from films import stand
from sealed_walkers import Walker

from gaitopt.gait.gait import Gait
from gaitopt.jobs.campaign import Campaign
from gaitopt.jobs.track import track
from gaitopt.report.film.phone import Phone, shot
from gaitopt.report.film.stage import motion_of, stage_of

PHONE = Phone(exposures=3)
DISTANCE_M, ALONG_M = 0.7, 0.12
"""Where the phone stands, so that a fast robot stays in the picture."""

CYCLES, SHORTEST_S, LONGEST_S = 8.0, 6.0, 8.0
LEAST_CYCLES = 2.2
"""A film has so many cycles, no less seconds than `gaitopt campaign` asks for, and few more."""

BEGIN_S = 0.02
"""The first picture is so long after the gait's beginning, which the film does not say."""


def film(robot: Walker, gait: Gait, path: Path) -> None:
    """Film a walk of a robot; each film begins from another start pose."""
    robot.films += 1
    seconds = max(LEAST_CYCLES * gait.period_s, SHORTEST_S, min(LONGEST_S, CYCLES * gait.period_s))
    simulator = robot.robot(replace(robot.scenario, pose_seed=robot.films))
    walked = simulator.run(gait, duration=seconds + 0.2, poses=True)
    stage = stage_of(robot.problem.with_effects(robot.effects))
    shot(
        path,
        stage,
        motion_of(walked),
        stand(DISTANCE_M, along=ALONG_M),
        PHONE,
        seconds,
        begin=BEGIN_S,
        seed=robot.films,
    )


def tracked(campaign: Campaign, robot: Walker, folder: Path) -> Path:
    """Film the next gait of a campaign as a user would, and return the data set of the film."""
    proposed = campaign.next()
    path, out = folder / f"film-{proposed.film}.mp4", folder / f"film-{proposed.film}"
    shutil.rmtree(out, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    film(robot, campaign.next_gait, path)
    track([path], campaign.problem, str(campaign.path / proposed.gait), out)
    return out
