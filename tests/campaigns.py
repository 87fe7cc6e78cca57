"""Campaigns that are brief: few robots and gaits, and a diagnosis that is written instead of made."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
from helpers import STRIDER, brief_studies
from sealed_walkers import Walker

from gaitopt.campaign import settings
from gaitopt.jobs import campaign_step
from gaitopt.jobs.campaign import Campaign
from gaitopt.problem.problem import load_problem

BRIEF = settings.CampaignSettings(
    robots=4, search=settings.SearchShares(robots=2, own_robots=1, kept=1), belief=settings.BELIEF
)

SLIPPERY = {"pad_friction": {"scale": 0.7}}
"""What is different in truth."""

POSTERIOR = "servo_gain.all,pad_friction.none\n" + "".join(
    f"{0.9 + 0.02 * index:.2f},{0.6 + 0.02 * index:.2f}\n" for index in range(8)
)


def walker() -> Walker:
    """The strider on a slippery floor."""
    return Walker(load_problem(STRIDER), SLIPPERY, seconds=3.0)


@contextmanager
def brief(misfits: Sequence[str] = ()) -> Iterator[None]:
    """Make campaigns brief; what a diagnosis says is made up.

    Args:
        misfits: recordings that the diagnosis says do not fit.
    """

    def written(folder: Path, question: object, *_: object, **__: object) -> None:
        names = [trial.name for trial in question.dataset.trials]  # type: ignore[attr-defined]
        content = {
            "answer": "The floor is slippery.",
            "explanation": [],
            "causes": ["pad_friction"],
            "misfit_trials": {name: 9.0 for name in misfits if name in names},
        }
        (folder / "posterior.csv").write_text(POSTERIOR)
        (folder / "diagnosis.json").write_text(json.dumps(content))

    with pytest.MonkeyPatch.context() as patch:
        for module, name, value in brief_studies():
            patch.setattr(module, name, value)
        patch.setattr(settings, "DEFAULT", BRIEF)
        patch.setattr(campaign_step, "answered_into", written)
        yield


def begun(folder: Path) -> Campaign:
    """A new brief campaign."""
    return Campaign.new(load_problem(STRIDER), folder, budget=8, executor="serial")


def told_twice(folder: Path) -> None:
    """A campaign with two films, from wherever a killed one is."""
    with brief():
        robot, campaign = walker(), begun(folder)
        films = campaign._folder.tellings
        robot.films = films
        while campaign._folder.tellings < 2:
            campaign.tell(robot(campaign.next_gait))


def content(folder: Path) -> dict[str, bytes]:
    """Every file of a campaign, without what a clock or the page's text of it changes."""
    return {
        str(path.relative_to(folder)): path.read_bytes().replace(str(folder).encode(), b"DIR")
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in ("summary.json", "report.html", ".lock")
    }


def main() -> None:
    """Run a campaign that kills itself at the n-th file that gets its name."""
    import os
    import signal

    folder, moment = Path(sys.argv[1]), int(sys.argv[2])
    count = 0

    def ticks(event: str, _: tuple[object, ...]) -> None:
        nonlocal count
        if event in ("os.rename", "os.mkdir", "os.rmdir", "os.remove"):
            count += 1
            if count == moment:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(ticks)
    told_twice(folder)


if __name__ == "__main__":
    main()
