"""The page of a diagnosis of logged commands: figures by log, tables of components, no marker anywhere."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rigs
from benches import CHANNEL, SIGNAL, bench, located, write_bench
from matplotlib.figure import Figure
from pages import page_of, words_of
from planting import dataset, recording_of

from gaitopt.diagnose.correction import Correction
from gaitopt.diagnose.diagnosis import Diagnosis, GapOfTrial
from gaitopt.diagnose.gap.align import align
from gaitopt.diagnose.gap.predict import predict
from gaitopt.diagnose.judge.gap import Gap
from gaitopt.diagnose.words import answer
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.problem import Problem
from gaitopt.report import settings
from gaitopt.report.diagnosis import write_page
from gaitopt.report.diagnosis_of_logs import repeats_of
from gaitopt.report.diagnosis_report import write_diagnosis
from gaitopt.report.figures import logs as plots
from gaitopt.simulation.rollout import Simulator


@pytest.fixture(autouse=True)
def small_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures that are quick to draw."""
    monkeypatch.setattr(settings, "DEFAULT", settings.ReportSettings(dpi=40))


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """The made bench."""
    return bench(tmp_path_factory.mktemp("bench") / "arm")


@pytest.fixture(scope="module")
def diagnosis(arm: Problem, tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    """Where the gap lies of six recordings that come 40 ms late."""
    folder = write_bench(tmp_path_factory.mktemp("data"), arm, lambda time, at: at(time - 0.04))
    return located(arm, folder)


@pytest.fixture(scope="module")
def correction(arm: Problem, diagnosis: Diagnosis) -> Correction:
    """The same robot with its commands 40 ms late, beside the same trials."""
    corrected = arm.with_effects({"command_latency": {"delay_s": 0.04}})
    trials = [gap.aligned.trial for gap in diagnosis.trials]
    with ThreadPoolExecutor(1) as executor:
        paths = predict(Simulator.build(corrected), trials, executor)
    return Correction(corrected, tuple(align(*pair) for pair in zip(trials, paths, strict=True)))


FIGURES = {"logs", "components-of-logs", "log", "log-2", "log-3", "log-4"}


@pytest.mark.slow
def test_the_page_of_a_bench_has_one_figure_a_log(arm: Problem, diagnosis: Diagnosis, tmp_path: Path) -> None:
    write_diagnosis(tmp_path, arm, diagnosis)
    page = page_of(tmp_path, FIGURES)
    assert "6 recordings of 4 logs of commands" in page
    assert "gap of the angles" in page
    assert "Log step-1 and step-2" in page
    assert "stick and slip" in page
    assert "repeats of others" in page
    for absent in ("marker", " mm", "a cycle", "Where in the cycle", "Not drawn"):
        assert absent not in words_of(page), absent


@pytest.mark.slow
def test_what_the_corrected_robot_leaves_is_drawn(
    arm: Problem, diagnosis: Diagnosis, correction: Correction, tmp_path: Path
) -> None:
    write_page(tmp_path / "run", arm, diagnosis, correction)
    page_of(tmp_path / "run", FIGURES)
    (step, *_) = repeats_of(diagnosis, correction)
    above, below = plots.responses(step).axes
    labels = [line.get_label() for line in above.lines]
    assert [name for name in labels if not str(name).startswith("_")] == [
        "commanded",
        "nominal",
        "measured",
        "corrected",
    ]
    nominal, corrected = (
        [line for line in below.lines if line.get_linestyle() == style] for style in ("--", "-")
    )
    assert len(nominal) == len(corrected) == 2
    for line, after in zip(corrected, step.after, strict=True):
        np.testing.assert_allclose(line.get_ydata(), np.rad2deg(after.residual[SIGNAL]))


@pytest.mark.slow
def test_the_gap_of_each_log_before_and_after_is_drawn_and_told(
    arm: Problem, diagnosis: Diagnosis, tmp_path: Path
) -> None:
    fitted = replace(diagnosis)
    gap = Gap(np.deg2rad(3.0), np.deg2rad(0.5), np.deg2rad(0.25), (0.8, 1.0))
    vars(fitted)["gap_angles_by_trial"] = [GapOfTrial(trial.name, gap) for trial in diagnosis.trials]
    write_page(tmp_path / "run", arm, fitted)
    page = page_of(tmp_path / "run", FIGURES | {"corrected-angles"})
    assert "step-1 (×2) 3 0.5 0.25 91 %" in " ".join(words_of(page).split())
    axes = plots.held_out([("step", gap), ("ramp", gap)]).axes[0]
    assert [line.get_xdata().round(6).tolist() for line in axes.lines[:2]] == [[3.0, 3.0], [0.5, 0.5]]


def test_repeats_are_drawn_over_one_another(diagnosis: Diagnosis) -> None:
    logs = repeats_of(diagnosis)
    assert [one.short_name for one in logs] == ["step-1 (×2)", "ramp-1", "square-1 (×2)", "telegraph-1"]
    dots = [line for line in plots.responses(logs[0]).axes[0].lines if line.get_marker() == "."]
    assert len(dots) == 2
    shown = plots.overview(logs, SIGNAL)
    assert [axes.get_title(loc="left") for axes in shown.axes if axes.axison] == [
        one.short_name for one in logs
    ]


def test_bars_of_components_are_as_long_as_the_gap(diagnosis: Diagnosis) -> None:
    logs = repeats_of(diagnosis)
    axes = plots.components(logs).axes[0]
    ends = np.zeros(len(logs))
    for container in axes.containers:
        ends += [patch.get_width() for patch in container]  # type: ignore[union-attr]
    for end, repeats in zip(ends, logs, strict=True):
        gaps = [trial.aligned.rms(SIGNAL) for trial in repeats.trials]
        floor = np.mean([trial.floors[SIGNAL].total for trial in repeats.trials])
        assert end == pytest.approx(np.sqrt(np.mean(np.square(gaps))) / floor)


def test_a_servo_without_power_is_shaded(arm: Problem, diagnosis: Diagnosis) -> None:
    first = diagnosis.trials[0]
    time = np.array([0.0, 0.5])
    drive = LoggedCommands.of((CHANNEL,), time, np.array([[0.3], [np.nan]]))
    cut = replace(first.aligned, trial=replace(first.aligned.trial, drive=drive))
    figure = plots.responses(plots.Repeats([replace(first, aligned=cut)]))
    assert "unpowered" in legend_of(figure)
    assert "unpowered" not in legend_of(plots.responses(plots.Repeats([first])))


@pytest.mark.slow
def test_a_film_of_a_bench_without_a_marker_is_left_out(
    arm: Problem, diagnosis: Diagnosis, tmp_path: Path
) -> None:
    write_page(tmp_path / "run", arm, diagnosis, full=True)
    page_of(tmp_path / "run", FIGURES)


@pytest.mark.slow
def test_gaits_and_logs_share_a_page(tmp_path: Path) -> None:
    """A marker and a joint under a gait, and the joint under a log."""
    problem = rigs.build(tmp_path / "arm", rigs.arm(damping=0.2), {"marker": "tip", "forward": [1, 0, 0]})
    wave = replace(problem.baselines["still"], name="wave")
    moved = wave.channels[CHANNEL].model_copy(update={"amplitude_deg": 20.0})
    problem = replace(problem, baselines={"wave": replace(wave, channels={CHANNEL: moved})})
    path = Simulator.build(problem).run(problem.baselines["wave"], duration=6.0)
    signals = ("marker.x", "marker.z", SIGNAL)
    folder = write_bench(tmp_path / "data", problem, trials={"square": 2})
    both = (folder / "dataset.toml").read_text()
    dataset(folder, {"wave": ("wave", recording_of(path, signals=signals))}, starts_at_gait_time_s=0.0)
    (folder / "dataset.toml").write_text(both + "\n" + (folder / "dataset.toml").read_text())
    diagnosis = located(problem, folder)
    write_page(tmp_path / "run", problem, diagnosis)
    assert "RMS of the marker" in answer(diagnosis)
    assert "RMS of the angles" in answer(diagnosis)
    page = page_of(tmp_path / "run", {"measured", "components", "map", "components-of-logs", "log", "way"})
    assert "Trial wave" in page
    assert "Log square-1 and square-2" in page
    assert "2 recordings of 1 log of commands" in page


def legend_of(figure: Figure) -> list[str]:
    """The texts of a figure's legend."""
    return [text.get_text() for text in figure.legends[0].get_texts()]
