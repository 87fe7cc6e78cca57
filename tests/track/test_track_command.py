"""`gaitopt track`: from a phone's film to a data set."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from phone import Walk
from pictures import needs_opengl

from gaitopt.cli import app as cli
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.jobs.track import TrackOptions, track
from gaitopt.problem.instruments import measurable_signals
from gaitopt.problem.problem import Problem
from gaitopt.track.advice import advice
from gaitopt.track.film import pictures
from gaitopt.track.tracking import Tracker, track_film

pytestmark = [pytest.mark.slow, needs_opengl]


def test_a_film_becomes_a_trial(filmed: Walk, arcfold: Problem, tmp_path: Path) -> None:
    steps = []
    done = track([filmed.path], arcfold, "square-0.5s", tmp_path / "set", on_progress=steps.append)
    assert steps[-1].done == steps[-1].total == len(filmed.times)
    (film,) = done.films
    assert film.time == pytest.approx(filmed.times, abs=1e-3)
    assert film.room.camera is not None
    assert min(film.shares.values()) > 0.9
    for name, series in film.signals.items():
        away = series - filmed.truth[name]
        away -= np.nanmean(away)
        limit = 0.5e-3 if name.split(".")[-1] in "xyz" else np.radians(1.5)
        assert np.sqrt(np.nanmean(away**2)) < limit, name
    (trial,) = load_dataset(tmp_path / "set", arcfold, measurable_signals(arcfold)).trials
    assert list(trial.signals) == list(film.signals)
    assert trial.starts_at_s is None
    assert trial.fps == pytest.approx(24.0, rel=0.1)


def test_the_command_prints_what_was_found(filmed: Walk, tmp_path: Path, capsys: Any) -> None:
    out = tmp_path / "set"
    given = ["track", str(filmed.path), "--problem", "arcfold", "--gait", "square-0.5s", "--out", str(out)]
    assert cli.main([*given, "--sync-at", "0.25", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    (trial,) = content["trials"]
    assert trial["name"] == "walk"
    assert trial["frames"] == len(filmed.times)
    assert {row["tag"] for row in trial["tags"]} == {0, 1, 100, 101, 102, 103, 104, 105}
    assert "starts_at_gait_time_s = -0.25" in (out / "dataset.toml").read_text()
    assert cli.main(given) == 1
    assert "is not empty" in capsys.readouterr().err


def test_a_printer_that_shrinks_is_corrected(filmed: Walk, arcfold: Problem, tmp_path: Path) -> None:
    films = [
        track(
            [filmed.path], arcfold, "square-0.5s", tmp_path / f"{ruler}", TrackOptions(ruler_mm=ruler)
        ).films[0]
        for ruler in (100.0, 95.0)
    ]
    ranges = [np.ptp(film.signals["site.base_tag.z"]) for film in films]
    assert ranges[1] / ranges[0] == pytest.approx(0.95, abs=0.01)


def test_the_page_shows_what_was_found(filmed: Walk, tmp_path: Path, capsys: Any) -> None:
    given = ["track", str(filmed.path), "--problem", "arcfold", "--gait", "square-0.5s", "--quiet"]
    assert cli.main([*given, "--out", str(tmp_path / "set"), "--report", str(tmp_path / "page")]) == 0
    html = (tmp_path / "page" / "report.html").read_text()
    assert "next time" in html
    assert "Not drawn" not in html
    assert "tail_tag" in html
    overlay = list(pictures(tmp_path / "page" / "overlays" / "walk.mp4"))
    assert len(overlay) == len(filmed.times)
    assert cli.main([*given, "--out", str(tmp_path / "x"), "--report", str(tmp_path / "x")]) == 1
    assert "allowed: another folder than the data set's" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_advice_is_given_where_a_film_could_be_better(filmed: Walk, arcfold: Problem, tmp_path: Path) -> None:
    found = track([filmed.path], arcfold, "square-0.5s", tmp_path / "set").films[0]
    tracker = Tracker.of(arcfold, {int(n): tag for n, tag in arcfold.file.tags.items()})
    far = replace(found, edges_px=dict(found.edges_px) | {1: 20.0}, shares=dict(found.shares) | {0: 0.5})
    said = [line for line in advice(far, tracker) if not line.startswith("Tag 0 is 3")]
    assert said[0] == "Tag 1 is 20 pixels wide: print it with 50 mm instead of 20 mm, or film from nearer."
    assert said[1] == "Tag 0 is seen in 50% of the frames: keep it in the picture, unhidden and sharp."
    blind = replace(found, noise=dict(found.noise) | {"site.tail_tag.yaw": 0.05})
    assert any(
        line.startswith("The angles of tail_tag are known to 2.9° only") for line in advice(blind, tracker)
    )


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--tag", "x=base_tag"], "--tag: found 'x'; allowed: a number from 0 to 586"),
        (["--tag", "4=base_tug"], "tag 4: unknown site 'base_tug'; known: base_tag, end_effector, tail_tag"),
        (["--tag", "4=base_tag"], "--tag: found the site 'base_tag' twice; allowed: one tag on each site"),
        (["--ruler-mm", "10"], "--ruler-mm: found 10.0; allowed: 80 to 125: what the printed ruler"),
        (["--size-mm", "900"], "--size-mm: found 900.0; allowed: 5 to 150"),
        (["--sync-at", "1", "--sync-at", "2"], "--sync: found 2 for 1 films; allowed: one, or one each"),
        (["--sync-tag", "101"], "--sync-tag: found 101; allowed: a tag that is not on the floor sheet"),
        (["--readout-ms", "80"], "--readout-ms: found 80.0; allowed: -50 to 50"),
        (["--gait", "square-1s"], "--gait: found 2 for 1 films; allowed: one, or one each"),
    ],
)
def test_wrong_options_are_one_line(more: list[str], said: str, filmed: Walk, capsys: Any) -> None:
    given = ["track", str(filmed.path), "--problem", "arcfold", "--gait", "square-0.5s", "--out", "set"]
    assert cli.main([*given, *more]) == 1
    err = capsys.readouterr().err
    assert err.startswith("gaitopt: ")
    assert err.count("\n") == 1
    assert said in err
    assert not Path("set").exists()


def test_tags_of_another_size_than_was_said_are_named(filmed: Walk, arcfold: Problem) -> None:
    for size, wrong in ((20.0, False), (25.0, True), (16.0, True)):
        tags = {int(n): t.model_copy(update={"size_mm": size}) for n, t in arcfold.file.tags.items()}
        found = track_film(filmed.path, Tracker.of(arcfold, tags))
        named = [defect.message for defect in found.defects if defect.name == "tag_size_doubtful"]
        assert bool(named) == wrong
        widths = [float(re.findall(rf"is (\d+) mm wide, not {size:.0f}", message)[0]) for message in named]
        assert widths == pytest.approx([20.0] * len(widths), abs=1.5)
