"""Results outlive their page: it is written last, and what fails in it costs a figure or the page alone."""

import json
from pathlib import Path

import pytest
from helpers import ROBOTS, brief_studies, edited, problem_folder
from planting import dataset, recording_of, rollout

from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.jobs import optimise as optimising
from gaitopt.problem.problem import load_problem
from gaitopt.report import diagnosis_report, settings
from gaitopt.report import search as search_report
from gaitopt.report.figures import gait as gait_figures
from gaitopt.report.figures import search as search_figures
from gaitopt.report.page import Page

STRIDER = ROBOTS / "strider"
SEARCH = ("--budget", 6, "--no-warm-start", "--quiet")

FAILURES = [
    ValueError("$x^\x1b[31m\nunexpected end of text"),
    MemoryError(),
    GaitoptError("figures/speeds.png: cannot be written: No space left on device"),
    OSError(28, "No space left on device"),
    RecursionError("maximum recursion depth exceeded"),
]


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small figures."""
    monkeypatch.setattr(settings, "DEFAULT", settings.ReportSettings(dpi=40))


def run(capfd: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    capfd.readouterr()
    code = cli.main([str(argument) for argument in arguments])
    return code, *capfd.readouterr()


def failing(monkeypatch: pytest.MonkeyPatch, place: object, name: str, error: BaseException) -> None:
    def fails(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(place, name, fails)


def one_line(code: int, err: str, folder: Path, files: str) -> None:
    """Check that a command ended in one line, which says that its results are safe and where."""
    assert code == 1
    assert err.startswith(f"gaitopt: {folder}: the results are safe in {files}, but their page could not be ")
    assert err.count("\n") == 1
    assert err.strip().isprintable()


@pytest.mark.slow
@pytest.mark.parametrize("error", FAILURES, ids=lambda error: type(error).__name__)
def test_a_search_is_not_lost_to_its_page(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    out = tmp_path / "run"
    with monkeypatch.context() as patch:
        failing(patch, search_report, "write_report", error)
        code, _, err = run(capfd, "optimise", STRIDER, *SEARCH, "--out", out)
        one_line(code, err, out, "best.toml and summary.json")
        assert err.endswith(f"; to write it: gaitopt optimise {out} --resume {out}\n")
        results = {
            name: (out / name).read_bytes() for name in ("best.toml", "summary.json", "evaluations.csv")
        }
        code, _, err = run(capfd, "optimise", out, "--resume", out, "--quiet")
        one_line(code, err, out, "best.toml and summary.json")
    assert not (out / "report.html").exists()
    assert run(capfd, "simulate", out, out)[0] == 0
    code, said, err = run(capfd, "optimise", out, "--resume", out, "--quiet")
    assert (code, err) == (0, "")
    assert (out / "report.html").exists()
    assert results == {name: (out / name).read_bytes() for name in results}
    assert run(capfd, "optimise", out, "--resume", out, "--quiet") == (0, said, "")


@pytest.mark.slow
def test_a_search_is_not_lost_to_its_sensitivities(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "run"
    with monkeypatch.context() as patch:
        failing(patch, optimising, "sensitivities", GaitoptError("--executor: the connection was lost"))
        code, _, err = run(capfd, "optimise", STRIDER, *SEARCH, "--out", out, "--full")
    one_line(code, err, out, "best.toml and summary.json")
    assert run(capfd, "optimise", out, "--resume", out, "--quiet")[0] == 0
    assert (out / "report.html").exists()


@pytest.mark.slow
def test_ctrl_c_in_the_page_leaves_a_finished_search(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "run"
    with monkeypatch.context() as patch:
        failing(patch, search_report, "write_report", KeyboardInterrupt())
        code, _, err = run(capfd, "optimise", STRIDER, *SEARCH, "--out", out)
    assert code == 130
    assert err.startswith("gaitopt: stopped after 6 gaits")
    assert (out / "summary.json").exists()
    assert run(capfd, "optimise", out, "--resume", out, "--quiet")[0] == 0
    assert (out / "report.html").exists()


@pytest.mark.slow
def test_a_page_is_not_written_again_from_another_journal(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """That would be another search, whose result would stand beside the summary of this one."""
    out = tmp_path / "run"
    assert run(capfd, "optimise", STRIDER, *SEARCH, "--out", out)[0] == 0
    (out / "report.html").unlink()
    before = (out / "summary.json").read_bytes()
    journal = out / "evaluations.csv"
    journal.write_text("".join(journal.read_text().splitlines(keepends=True)[:3]))
    code, _, err = run(capfd, "optimise", out, "--resume", out)
    assert (code, err) == (0, "")
    assert not (out / "report.html").exists()
    assert (out / "summary.json").read_bytes() == before


@pytest.mark.slow
def test_a_finished_run_of_another_version_is_read_without_its_page(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    _, said, _ = run(capfd, "optimise", STRIDER, *SEARCH, "--out", out)
    (out / "report.html").unlink()
    edited(out / "run.toml", 'mujoco = "', 'mujoco = "0.')
    assert run(capfd, "optimise", out, "--resume", out) == (0, said, "")
    assert not (out / "report.html").exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["convergence"])
def test_a_figure_that_fails_leaves_a_note(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    failing(monkeypatch, search_figures, name, ValueError("two\nlines\x1b[31m"))
    out = tmp_path / "run"
    code, _, err = run(capfd, "optimise", STRIDER, *SEARCH, "--out", out)
    assert (code, err) == (0, "")
    page = (out / "report.html").read_text()
    assert "<li>Not drawn: two lines\\x1b[31m.</li>" in page
    assert "Convergence of the search" in page
    assert not (out / "figures" / f"{name}.png").exists()
    assert (out / "figures" / "position.png").exists()


@pytest.mark.slow
def test_a_film_that_fails_leaves_a_note(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from gaitopt.report.film import film

    failing(monkeypatch, film, "write_film", RuntimeError("a driver of graphics"))
    out = tmp_path / "run"
    assert run(capfd, "optimise", STRIDER, *SEARCH, "--out", out, "--full")[0] == 0
    assert "No film: a driver of graphics" in (out / "report.html").read_text()


@pytest.mark.parametrize(
    ("command", "file"),
    [
        (("compare", STRIDER, "stride", "square"), "compare.json"),
        (("check", STRIDER), "check.json"),
        (("sweep", STRIDER, "--over", "period_s=0.4,0.5"), "sweep.json"),
    ],
)
def test_other_results_are_not_lost_to_their_pages(
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    command: tuple[object, ...],
    file: str,
) -> None:
    failing(monkeypatch, Page, "html", RuntimeError("no template"))
    if command[0] == "sweep":
        failing(monkeypatch, gait_figures, "overlay", RuntimeError("no figure"))
    out = tmp_path / "out"
    code, _, err = run(capfd, *command, "--out", out)
    said = "".join(line for line in err.splitlines(keepends=True) if not line.startswith("checking"))
    one_line(code, said, out, file)
    assert json.loads((out / file).read_text())


def test_a_sweep_without_a_marker_has_its_rows(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = problem_folder(tmp_path / "robot", STRIDER, lambda content: content["roles"].pop("marker"))
    edited(folder / "problem.toml", "speed_m_s", "airtime")
    out = tmp_path / "out"
    code, _, err = run(capfd, "sweep", folder, "--over", "period_s=0.4,0.5", "--out", out)
    assert (code, err) == (0, "")
    assert len(json.loads((out / "sweep.json").read_text())["rows"]) == 2


@pytest.mark.slow
def test_a_diagnosis_is_not_lost_to_its_page(
    quick_folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was simulated stays until the page is there, so that it is written without simulating again."""
    for place, name, value in brief_studies():
        monkeypatch.setattr(place, name, value)
    columns = recording_of(rollout(load_problem(quick_folder), "square-1s", 3.0, {}))
    trials = dataset(tmp_path / "trials", {"fast": ("square-1s", columns)})
    out = tmp_path / "out"
    asked = ("diagnose", quick_folder, trials, "--effects", "ground_slope", "--quiet")
    with monkeypatch.context() as patch:
        failing(patch, diagnosis_report, "write_page", FAILURES[0])
        code, _, err = run(capfd, *asked, "--out", out)
        one_line(code, err, out, "diagnosis.json")
    assert list(out.glob("simulated-*"))
    result = (out / "diagnosis.json").read_bytes()
    code, said, err = run(capfd, *asked, "--resume", out)
    assert (code, err) == (0, "")
    assert (out / "diagnosis.json").read_bytes() == result
    assert (out / "report.html").exists()
    assert not list(out.glob("simulated-*"))
    assert run(capfd, *asked, "--resume", out) == (0, said, "")
