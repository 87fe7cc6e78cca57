"""The loop on the real robot: what it writes, and what wrong, late and repeated films do to it."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import campaigns
import numpy as np
import pytest
from browser import CHROMIUM
from campaigns import begun, brief, content, told_twice, walker
from helpers import STRIDER, still
from page_audit import faults_of

from gaitopt.campaign.check import film_of, same_gait
from gaitopt.campaign.robots import Walked, walked
from gaitopt.campaign.search import Search
from gaitopt.core.errors import GaitoptError, MachineError
from gaitopt.effects.active import as_tables
from gaitopt.gait.gait import Gait
from gaitopt.jobs import campaign_step
from gaitopt.jobs.campaign import Campaign
from gaitopt.jobs.outputs import Stopped
from gaitopt.optimise.processes import LostWorkersError
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.runs.folder import held
from gaitopt.runs.listing import INTERRUPTED, WAITING, list_runs
from gaitopt.simulation.scenario import Scenario


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign before its first film."""
    folder = tmp_path_factory.mktemp("campaign") / "walk"
    with brief():
        begun(folder)
    return folder


@pytest.fixture
def campaign(fresh: Path, tmp_path: Path) -> Campaign:
    """A copy of it."""
    import shutil

    folder = tmp_path / "walk"
    shutil.copytree(fresh, folder)
    return Campaign(folder, executor="serial")


def test_the_next_film_has_the_keys_of_the_contract(campaign: Campaign) -> None:
    found = campaign.next().to_dict()
    assert {"film", "gait", "player", "purpose", "predicted_speed_m_s", "done"} <= set(found)
    assert (found["film"], found["gait"], found["purpose"]) == (1, "films/01/gait.toml", "learn")
    assert found["player"] == "films/01/player"
    assert not found["done"]
    assert set(found["predicted_speed_m_s"]) == {"mean", "ci90"}
    assert (campaign.path / "films/01/gait.toml").is_file()
    assert list((campaign.path / "films/01/player").iterdir())
    assert (campaign.path / "campaign.html").is_file()


def test_searches_set_out_from_the_repertoire_of_the_first_one(
    campaign: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its winner and other good gaits, which were tried on possible robots before the first film."""
    first = campaign._folder.step(0)
    assert first is not None
    names = [one.name for one in first.candidates]
    assert names[:2] == ["nominal", "nominal-2"]
    started: list[Sequence[Gait]] = []
    searched = Search.candidates

    def spied(search: Search, known: Mapping[str, Gait], *others: Any) -> dict[str, Gait]:
        started.append([*known.values()])
        return searched(search, known, *others)

    monkeypatch.setattr(Search, "candidates", spied)
    with brief():
        campaign.tell(walker()(campaign.next_gait))
    space = campaign.problem.space
    for one in first.candidates:
        assert any(same_gait(space, one.gait, gait) for gait in started[0])


@pytest.mark.slow
def test_robots_that_knew_one_film_less_judge_the_gaits_too(
    campaign: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    judges: list[list[float]] = []

    def spied(problem: Problem, gaits: Sequence[Gait], robots: Sequence[Scenario], *others: Any) -> Walked:
        judges.append([as_tables(one.effects)["pad_friction"]["scale"] for one in robots])
        return walked(problem, gaits, robots, *others)

    monkeypatch.setattr(campaign_step, "walked", spied)
    robot = walker()
    with brief():
        campaign.tell(robot(campaign.next_gait))
        monkeypatch.setattr(campaigns, "POSTERIOR", campaigns.POSTERIOR.replace(",0.", ",0.1"))
        campaign.tell(replace(robot(campaign.next_gait), name="again"))
    assert [sum(scale > 0.5 for scale in one) for one in judges] == [4, 2]
    assert len(judges[1]) == 4


def test_the_status_can_be_asked_while_another_command_works(campaign: Campaign) -> None:
    before = campaign.status().to_dict()
    (campaign.path / "told/01").mkdir(parents=True)
    with held(campaign.path):
        assert campaign.status().to_dict() == before | {"at_work": True}
        with pytest.raises(MachineError, match="another run is working"):
            campaign.next()
    assert not before["at_work"]


def test_a_film_is_measured_and_the_next_one_proposed(campaign: Campaign) -> None:
    with brief():
        told = campaign.tell(walker()(campaign.next_gait)).to_dict()
    assert {"films", "best", "still_to_gain", "causes", "done"} <= set(told)
    assert {"gait", "measured_speed_m_s", "predicted_speed_m_s"} <= set(told["best"])
    first = told["films"][0]
    assert {"film", "gait", "predicted_speed_m_s", "measured_speed_m_s"} <= set(first)
    gait = campaign._folder.gaits[1]
    path = walker().walk(gait, 3.0, 1)
    ends = [gait.period_s, gait.period_s * int(3.0 / gait.period_s)]
    begin, end = np.interp(ends, path.time, path["marker.y"])
    assert first["measured_speed_m_s"] == pytest.approx((end - begin) / (ends[1] - ends[0]), abs=2e-3)
    assert told["causes"] == ["pad_friction"]
    page = (campaign.path / "campaign.html").read_text()
    assert "The floor is slippery" in page


def test_the_same_film_told_again_changes_nothing(campaign: Campaign) -> None:
    film = walker()(campaign.next_gait)
    with brief():
        once = campaign.tell(film).to_dict()
        before = content(campaign.path)
        assert campaign.tell(film).to_dict() == once
    assert content(campaign.path) == before


@pytest.mark.slow
def test_repeats_are_averaged_and_show_the_repeatability(campaign: Campaign) -> None:
    robot, gait = walker(), campaign.next_gait
    with brief():
        first = campaign.tell(robot(gait)).films[0]
        again = campaign.tell(replace(robot(gait), name="again")).films[0]
    assert (first.recordings, again.recordings) == (1, 2)
    assert again.measured_m_s != first.measured_m_s
    assert again.measured_m_s == pytest.approx(first.measured_m_s, rel=0.1)


@pytest.mark.slow
def test_films_come_in_another_order(campaign: Campaign) -> None:
    robot, first = walker(), campaign.next_gait
    with brief():
        late = robot(first)
        campaign.tell(robot(first))
        second = campaign._folder.gaits[max(campaign._folder.gaits)]
        campaign.tell(robot(second))
        films = campaign.tell(late).films
    assert films[0].recordings == 2
    assert films[0].measured_m_s is not None


@pytest.mark.parametrize("wrong", ["gait", "short", "no forward", "relabelled"])
def test_a_wrong_film_is_refused_in_one_line_and_changes_nothing(campaign: Campaign, wrong: str) -> None:
    robot, gait = walker(), campaign.next_gait
    film = robot(gait)
    with brief():
        if wrong == "gait":
            film = robot(still(campaign.problem))
        elif wrong == "short":
            film = replace(
                film,
                time=film.time[:5],
                signals={name: series[:5] for name, series in film.signals.items()},
                used={name: flags[:5] for name, flags in film.used.items()},
            )
        elif wrong == "no forward":
            film = replace(film, signals={"marker.z": film.signals["marker.z"]})
        else:
            campaign.tell(film)
            second = campaign._folder.gaits[max(campaign._folder.gaits)]
            assert second.key != gait.key
            film = replace(film, drive=second)
        before = content(campaign.path)
        with pytest.raises(GaitoptError) as refused:
            campaign.tell(film)
    assert "\n" not in str(refused.value)
    assert content(campaign.path) == before


def test_a_recording_that_does_not_look_like_its_gait_is_refused_unless_it_is_trusted(
    campaign: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    film = walker()(campaign.next_gait)
    monkeypatch.setattr("gaitopt.jobs.campaign.wrong_recording", lambda *_: "moves as square does")
    with brief():
        with pytest.raises(GaitoptError, match=r"film 1: moves as square does; --trust"):
            campaign.tell(film)
        assert campaign.tell(film, trust=True).films[0].recordings == 1


@pytest.mark.slow
def test_the_speed_of_a_misfit_counts_once_it_is_confirmed(campaign: Campaign) -> None:
    robot, gait = walker(), campaign.next_gait
    with brief(misfits=["film-1-1", "film-1-2"]):
        once = campaign.tell(robot(gait)).films[0]
        twice = campaign.tell(replace(robot(gait), name="again")).films[0]
    assert (once.measured_m_s, once.misfits) == (None, 1)
    assert twice.measured_m_s is not None
    assert twice.misfits == 2


@pytest.mark.slow
def test_a_robot_behind_a_function_is_filmed_until_it_is_done(campaign: Campaign) -> None:
    robot = walker()
    with brief():
        done = campaign.run(robot, films=3)
        rivals = campaign.compare(robot, films=2)
    assert done.done or campaign._folder.tellings == 3
    assert [len(tried) for _, tried in rivals] == [1, 2]
    page = campaign.path / "campaign.html"
    assert "Bayesian optimisation without a simulator" in page.read_text()
    if CHROMIUM is not None:
        assert faults_of(page) == []


def test_an_interrupted_step_goes_on_with_whatever_is_asked(
    campaign: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film = walker()(campaign.next_gait)
    with brief():
        with monkeypatch.context() as patch:
            patch.setattr("gaitopt.jobs.campaign_step.walked", _interrupt)
            with pytest.raises(Stopped):
                campaign.tell(film)
        assert campaign.status().films[0].measured_m_s is not None


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.slow
def test_a_campaign_killed_at_random_moments_ends_the_same(tmp_path: Path) -> None:
    whole, killed = tmp_path / "whole" / "walk", tmp_path / "killed" / "walk"
    told_twice(whole)
    kills, moments = 0, random.Random(4)
    program = Path(__file__).parents[1] / "campaigns.py"
    before = os.environ.get("PYTHONPATH")
    found = os.pathsep.join([str(program.parent), *([before] if before else [])])
    while kills < 200:
        words = [sys.executable, str(program), str(killed), str(moments.randint(5, 90))]
        env = os.environ | {"PYTHONPATH": found}
        ended = subprocess.run(words, capture_output=True, cwd=tmp_path, env=env)
        if ended.returncode == 0:
            break
        assert ended.returncode == -signal.SIGKILL, ended.stderr.decode()
        kills += 1
    assert kills >= 3
    assert [name for name, data in content(whole).items() if content(killed)[name] != data] == []
    assert set(content(killed)) == set(content(whole))


def test_a_folder_that_is_no_campaign_is_named(tmp_path: Path) -> None:
    with pytest.raises(GaitoptError, match="not the folder of a campaign"):
        Campaign(tmp_path)


def test_a_folder_of_another_campaign_is_refused(fresh: Path) -> None:
    with pytest.raises(GaitoptError, match="already holds another campaign"):
        Campaign.new(load_problem(STRIDER), fresh, budget=9)


def test_a_folder_of_another_robot_of_the_same_name_is_refused(fresh: Path) -> None:
    problem = load_problem(STRIDER)
    other = problem.with_parameters({"mu_rear": 0.7})
    assert other.name == problem.name
    with brief():
        assert Campaign.new(problem, fresh, budget=8, executor="serial").next().film == 1
        with pytest.raises(GaitoptError, match="already holds another campaign"):
            Campaign.new(other, fresh, budget=8)


def test_other_things_in_its_folders_are_not_the_campaigns(campaign: Campaign) -> None:
    (campaign.path / "films" / "1.mp4").write_bytes(b"a film")
    (campaign.path / "told").mkdir(exist_ok=True)
    (campaign.path / "told" / "01 copy").mkdir()
    assert campaign.next().film == 1
    assert campaign._folder.tellings == 0


def test_a_machine_that_fails_teaches_nothing(campaign: Campaign, monkeypatch: pytest.MonkeyPatch) -> None:
    """A lost worker ends the step; nothing is concluded from it, and the step can go on."""

    def lost(*_: object, **__: object) -> None:
        raise LostWorkersError("workers were killed")

    film = walker()(campaign.next_gait)
    with brief():
        with monkeypatch.context() as patch:
            patch.setattr("gaitopt.jobs.campaign_step.answered_into", lost)
            with pytest.raises(LostWorkersError):
                campaign.tell(film)
        assert campaign.status().causes == ("pad_friction",)


def test_a_recording_that_cannot_be_read_again_is_refused(campaign: Campaign) -> None:
    """From Python, sideways motion of two samples: every later step would read it again."""
    film = walker()(campaign.next_gait)
    aside = np.where(np.arange(len(film.time)) < 2, 0.0, np.nan)
    film = replace(
        film,
        signals={**film.signals, "marker.z": aside},
        used={**film.used, "marker.z": np.isfinite(aside)},
    )
    with brief():
        before = content(campaign.path)
        with pytest.raises(GaitoptError, match="numbers in 2 rows"):
            campaign.tell(film, trust=True)
        assert content(campaign.path) == before
        assert campaign.next().film == 1


def test_a_robot_that_returns_the_same_recording_again_ends_the_run(
    campaign: Campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    film = walker()(campaign.next_gait)
    with brief():
        campaign.tell(film)
        monkeypatch.setattr(Campaign, "next_gait", campaign._folder.gaits[1])
        with pytest.raises(GaitoptError, match="a recording that was told before"):
            campaign.run(lambda _: film, films=3)


def test_a_gait_that_a_search_found_again_was_filmed(campaign: Campaign) -> None:
    space, gait = campaign.problem.space, campaign.next_gait
    again = space.decode(space.encode(gait))
    assert film_of(space, again, campaign._folder.gaits) == 1
    assert film_of(space, still(campaign.problem), campaign._folder.gaits) is None


def test_a_campaign_is_listed_as_what_it_waits_for(campaign: Campaign) -> None:
    def state() -> str:
        (run,) = list_runs([campaign.path])
        return run.state

    assert state() == WAITING
    (campaign.path / "steps" / "00" / "finished").unlink()
    assert state() == INTERRUPTED
