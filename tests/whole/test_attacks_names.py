"""Names from files are only names: on terminals, in figures, on pages and in films."""

import ast
import json
import os
import re
import tomllib
import warnings
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest
import tomli_w
from helpers import ROBOTS, brief_studies, problem_folder
from hostility import PACKAGE
from matplotlib import rc_context
from PIL import Image
from planting import dataset, recording_of, rollout

from gaitopt.cli import app as cli
from gaitopt.cli.progress import display
from gaitopt.core.progress import Progress
from gaitopt.gait.gait import write_gait
from gaitopt.optimise.sensitivity import Sensitivity
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.report import settings
from gaitopt.report.figures import comparison as comparison_figures
from gaitopt.report.figures import gait as gait_figures
from gaitopt.report.figures import search as search_figures
from gaitopt.report.film.captions import write_lines
from gaitopt.report.page import Page, Section, png
from gaitopt.simulation.rollout import Simulator

PRINTABLE = [
    "[/x]",
    "[bold red]b[/bold red]",
    "[link=file:///etc/passwd]l",
    ":smile:",
    r"$\frac{$",
    "$x_1$",
    r"\input{/etc/passwd}",
    "_hidden",
    "步态",
    "%s %(x)s {0} {task.fields}",
    "best",
    "long " + "n" * 300,
]
"""Names that a problem file may have, and that Rich, Matplotlib or TeX would take for something else."""

UNPRINTABLE = [
    "esc\x1b[31mred\x1b]0;owned\x07",
    "line\ngaitopt: a line of its own",
    "return\roverwritten",
    "bidi\u202egnp.exe\u2066",
    "zero\u200bwidth\ufeff\u00ad",
    "tag\U000e0041",
    "c1\x9b31m",
    os.fsdecode(b"not-utf-8-\xff"),
]
"""Names that only files have, or records that were edited."""

CONTROLS = re.compile(
    r"[^\S\n ]|[\x00-\x09\x0b-\x1f\x7f-\x9f\u00ad\u200b-\u200f\u202a-\u202e\u2060-\u2069\ufeff]"
)


def raw(text: str) -> list[str]:
    """What a terminal could obey in a text; no-break spaces are the program's own."""
    return CONTROLS.findall(text.replace("\u00a0", " "))


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small figures, and a wide terminal, on which names are not broken into lines."""
    monkeypatch.setenv("COLUMNS", "1000")
    monkeypatch.setattr(settings, "DEFAULT", settings.ReportSettings(dpi=40))


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The strider with hostile names of baselines, channels, pads, marker and a parameter."""
    new = {
        "rear": r"$\frac{$",
        "front": "[/x]",
        "rear_foot": "[bold red]",
        "front_foot": "_步",
        "nose": "$n$",
    }

    def renamed(content: dict[str, Any]) -> None:
        gait = content["baselines"]["stride"]
        gait["channels"] = {new[name]: one for name, one in gait["channels"].items()}
        content["baselines"] = dict.fromkeys(PRINTABLE, gait)
        content["channels"] = {new[name]: one for name, one in content["channels"].items()}
        content["roles"] |= {"marker": new["nose"], "pads": [new["rear_foot"], new["front_foot"]]}
        known = content["parameters"]
        content["parameters"] = {"[/p] $\\frac{$": known["mass"], "torque_limit": known["torque_limit"]}
        content["scenarios"]["verification"] = 2
        content["description"] = r"[/x] $\frac{$"

    folder = problem_folder(tmp_path_factory.mktemp("hostile") / "strider", ROBOTS / "strider", renamed)
    mjcf = folder / "strider.xml"
    text = mjcf.read_text()
    for old, name in new.items():
        text = text.replace(f'name="{old}"', f"name={quoteattr(name)}")
    mjcf.write_text(text.replace('joint="rear_hip"/>', 'joint="rear_hip" kp="0.5"/>'))
    return folder


def run(capfd: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Run a command that must end well, and return what it printed: only names, nothing to obey."""
    capfd.readouterr()
    code = cli.main([str(argument) for argument in arguments])
    out, err = capfd.readouterr()
    assert code == 0, err
    assert not raw(out)
    assert not raw(err)
    assert "Warning" not in err
    assert not [line for line in (out + err).splitlines() if line.startswith("gaitopt: a line of its own")]
    return out


def unbroken(text: str) -> str:
    return re.sub(r"\s+", "", text)


@pytest.mark.parametrize("name", PRINTABLE)
def test_a_name_is_printed_as_it_is(
    hostile: Path, capfd: pytest.CaptureFixture[str], small: None, name: str
) -> None:
    assert unbroken(name) in unbroken(run(capfd, "compare", hostile, name, "best"))
    out = unbroken(run(capfd, "simulate", hostile, name))
    assert unbroken(name) in out
    assert r"$\frac{$" in out


@pytest.mark.slow
def test_a_search_over_hostile_names_ends_with_its_page(
    hostile: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], small: None
) -> None:
    """Channels, pads, baselines and the parameter all reach figures, tables and the terminal."""
    out = tmp_path / "run"
    said = run(capfd, "optimise", hostile, "--budget", 4, "--no-warm-start", "--out", out, "--full")
    assert all(unbroken(name) in unbroken(said) for name in PRINTABLE)
    page = (out / "report.html").read_text()
    assert "Not drawn" not in page
    assert "[/p] $\\frac{$" in json.loads((out / "sensitivity.json").read_text())["rows"][-2]["name"]
    assert {"gait.png", "angles.png", "position.png", "sensitivity-model.png"} <= {
        path.name for path in (out / "figures").iterdir()
    }
    assert run(capfd, "optimise", out, "--resume", out) == said


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ("check",),
        ("sweep", "[/x]", "--over", r"$\frac{$.duty=0.4,0.5"),
        ("compare", *PRINTABLE),
        ("plan",),
        ("effects",),
        ("export", "[/x]", "--format", "c"),
        ("command", "[/x]", "--dt", "0.1", "--duration", "1"),
    ],
)
def test_other_commands_end_well_or_in_one_line(
    hostile: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], small: None, command: tuple[str, ...]
) -> None:
    name, *rest = command
    out = [] if name in ("plan", "effects") else ["--out", str(tmp_path / "out")]
    code = cli.main([name, str(hostile), *rest, *out])
    said, err = capfd.readouterr()
    assert code in (0, 1)
    assert "Traceback" not in err + said
    assert "Warning" not in err
    assert not raw(said + err)
    if code == 1:
        assert [line for line in err.splitlines() if not line.startswith("checking")][1:] == []
    page = tmp_path / "out" / "report.html"
    if name in ("check", "compare"):
        assert "Not drawn" not in page.read_text()


@pytest.mark.slow
def test_a_diagnosis_of_hostile_names_ends_with_its_page(
    quick_folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Trials and gaits; the film beside the measured marker, too."""
    for place, setting, value in brief_studies():
        monkeypatch.setattr(place, setting, value)
    monkeypatch.setenv("COLUMNS", "1000")
    known = load_problem(quick_folder)
    columns = recording_of(rollout(known, "square-1s", 5.0, {"ground_slope": {"angle_rad": 0.15}}))
    names = [r"$\frac{$", "[/x]", "_步", "n" * 100]

    def renamed(content: dict[str, Any]) -> None:
        known = content["baselines"]
        gait = known["square-4s"] | {"period_s": known["square-1s"]["period_s"]}
        content["baselines"] = dict.fromkeys(names, gait)
        content["measured"] = dict.fromkeys(names[:1], content["measured"]["square-1s"])

    robot = problem_folder(tmp_path / "robot", quick_folder, renamed)
    trials = {f"{name} #1": (name, columns) for name in names[:2]}
    data = dataset(tmp_path / "trials", {f"t{i}": trial for i, trial in enumerate(trials.values())})
    file = data / "dataset.toml"
    content = tomllib.loads(file.read_text())
    for entry, name in zip(content["trial"], trials, strict=True):
        entry["name"] = name
    file.write_text(tomli_w.dumps(content))
    out = tmp_path / "out"
    said = run(capfd, "diagnose", robot, data, "--effects", "ground_slope", "--full", "--out", out)
    assert r"$\frac{$ #1" in said
    page = (out / "report.html").read_text()
    assert "Not drawn" not in page
    assert "No film" not in page or "OpenGL" in page
    assert {"measured-2.png", "components.png", "map.png", "ranking.png"} <= {
        path.name for path in (out / "figures").iterdir()
    }


@pytest.mark.slow
def test_the_names_of_gait_files_are_escaped(
    strider: Problem, tmp_path: Path, capfd: pytest.CaptureFixture[str], small: None
) -> None:
    files = [tmp_path / f"{name}.toml" for name in (*UNPRINTABLE, "[bold red]")]
    robot, out = ROBOTS / "strider", tmp_path / "out"
    for file in files:
        write_gait(file, strider.baselines["stride"])
        run(capfd, "simulate", robot, file)
    run(capfd, "compare", robot, "square", *files, "--out", out)
    assert not raw((out / "report.html").read_text().replace("\t", ""))


@pytest.mark.slow
@pytest.mark.parametrize("name", [*UNPRINTABLE, "[bold red]"])
def test_the_name_of_the_gait_of_a_sweep_is_escaped(
    strider: Problem, tmp_path: Path, capfd: pytest.CaptureFixture[str], small: None, name: str
) -> None:
    file = tmp_path / f"{name}.toml"
    write_gait(file, strider.baselines["stride"])
    run(capfd, "sweep", ROBOTS / "strider", file, "--over", "period_s=0.4,0.5", "--out", tmp_path / "sweep")


@pytest.mark.slow
@pytest.mark.parametrize("name", [*UNPRINTABLE, "[/x]"])
def test_an_edited_summary_prints_only_names(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str
) -> None:
    row = {"name": name, "period_s": 1.0, "speed_m_s": 0.01, "speed_ci90_m_s": [0.0, 0.02]}
    row |= {"constraints_met": False, "violations": {name: 1.0}, "status": name}
    out = tmp_path / "run"
    run(capfd, "optimise", ROBOTS / "strider", "--budget", 1, "--no-warm-start", "--quiet", "--out", out)
    content = {"baselines": [row], "best": row, "ratio_to_best_baseline": 1.0}
    (out / "summary.json").write_text(json.dumps(content))
    run(capfd, "optimise", out, "--resume", out)
    assert run(capfd, "optimise", out, "--resume", out, "--json").isascii()


@pytest.mark.parametrize("name", UNPRINTABLE)
def test_an_edited_diagnosis_prints_only_names(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str
) -> None:
    (tmp_path / "diagnosis.json").write_text(json.dumps({"answer": name, "explanation": [name]}))
    (tmp_path / "report.html").touch()
    said = run(capfd, "diagnose", "arcfold", tmp_path, "--resume", tmp_path)
    assert said.count("\n") == 3
    assert run(capfd, "diagnose", "arcfold", tmp_path, "--resume", tmp_path, "--json").isascii()


def test_everything_is_printed_through_functions_that_escape() -> None:
    """No other file prints, writes to a stream or makes a console of Rich's."""
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call):
                called = ast.unparse(node.func)
                place = path.relative_to(PACKAGE).as_posix()
                assert called != "print" or place in ("cli/lines.py", "cli/commands/completion.py"), place
                assert called != "Console" or place == "cli/display.py", place
                assert called not in ("sys.stdout.write", "sys.stderr.write", "rich.print"), place


@pytest.mark.parametrize("name", [*PRINTABLE, *UNPRINTABLE])
def test_a_progress_bar_shows_names_alone(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    for terminal in ("", "1"):
        monkeypatch.setenv("FORCE_COLOR", terminal)
        monkeypatch.setenv("COLUMNS", "500")
        with display(quiet=False) as on_progress:
            on_progress(Progress(name, 1, 2))
        with display(quiet=False):
            pass
        err = capfd.readouterr().err
        own = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", err) if terminal and name in PRINTABLE else err
        assert "\x1b]0" not in err
        assert "\x9b" not in err
        assert "\u202e" not in err
        if name in PRINTABLE:
            assert name in own


# --- figures, pages and films -----------------------------------------------------------------


def drawn_with(name: str, problem: Problem) -> list[Any]:
    """Every kind of figure that has names, made."""
    trajectory = Simulator.build(problem).run(problem.baselines["stride"])
    one = Sensitivity(name, "gait", 0.001, -0.002, -0.0015, 0.001)
    from gaitopt.optimise.compare import ComparedGait

    row = ComparedGait(
        name=name, period_s=1.0, speed_ci90_m_s=(0.009, 0.011), speed_worst_m_s=0.008, difference_m_s=0.0,
        difference_ci90_m_s=(0.0, 0.0), ratio=None, ratio_ci90=None, more_than_noise=False,
        constraints_met=True, violations={}, status="ok", scenario_speeds_m_s=(0.008, 0.012),
        metrics={"speed_m_s": 0.01},
    )  # fmt: skip
    return [
        gait_figures.overlay({name: trajectory}, problem.roles),
        gait_figures.panels({name: trajectory, "b": trajectory}, problem.roles),
        comparison_figures.speeds([row]),
        comparison_figures.differences([row, row]),
        search_figures.sensitivity([one], "5 % of its range"),
    ]


@pytest.mark.parametrize("name", [*PRINTABLE, *UNPRINTABLE, "n" * 100_000, "$" * 400, "", " "])
def test_figures_draw_names_as_they_are(strider: Problem, small: None, name: str) -> None:
    """Without a warning, and though the user's own settings give texts to TeX."""
    with warnings.catch_warnings(), rc_context({"text.usetex": name in PRINTABLE}):
        warnings.simplefilter("error")
        for figure in drawn_with(name, strider):
            assert len(png(figure)) > 1000


def test_a_formula_is_drawn_as_its_letters(strider: Problem, small: None) -> None:
    """As wide as letters are: what Matplotlib reads as a formula is much narrower."""
    trajectory = Simulator.build(strider).run(strider.baselines["stride"])
    widths = []
    for name in ("$x_{abcdef}$", "Sx_{abcdef}S"):
        figure = gait_figures.panels({name: trajectory}, strider.roles)
        png(figure)
        title = figure.axes[0].get_title(loc="left")
        assert title == name
        text = next(t for t in figure.findobj() if getattr(t, "get_text", lambda: "")() == name)
        widths.append(text.get_window_extent().width)
    assert widths[0] == pytest.approx(widths[1], rel=0.05)


def test_a_legend_keeps_a_name_that_begins_with_an_underscore(strider: Problem) -> None:
    trajectory = Simulator.build(strider).run(strider.baselines["stride"])
    figure = gait_figures.overlay({"_a": trajectory, "b": trajectory}, strider.roles)
    assert [text.get_text().strip() for text in figure.axes[0].get_legend().get_texts()] == ["_a", "b"]


@pytest.mark.parametrize("name", [*PRINTABLE, *UNPRINTABLE, "n" * 100_000])
def test_films_draw_names_as_they_are(name: str) -> None:
    from gaitopt.report.letters import drawable

    picture = Image.new("RGB", (400, 226))
    write_lines(picture, drawable(name), drawable(name))
    assert np.asarray(picture).any()


@pytest.mark.parametrize("name", UNPRINTABLE)
def test_a_page_shows_names_alone(name: str) -> None:
    """In its title, anchors, attributes, captions and commands, too."""
    section = Section(name, sentences=[name], image="data:image/png;base64,", caption=name, commands=[name])
    html = Page(name, name, {name: name}, [(name, name)], [name], [section, section]).html()
    assert not raw(html)
    html.encode()
    ids = re.findall(r'<section id="([^"]*)"', html)
    assert len(set(ids)) == 2
    assert re.findall(r'<a href="#([^"]*)"', html) == ids


@pytest.mark.slow
def test_a_baseline_called_best_is_drawn_beside_the_winner(
    hostile: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, small: None
) -> None:
    shown: list[list[str]] = []
    overlay = gait_figures.overlay

    def seen(trajectories: dict[str, Any], *arguments: Any, **options: Any) -> Any:
        shown.append(list(trajectories))
        return overlay(trajectories, *arguments, **options)

    monkeypatch.setattr(gait_figures, "overlay", seen)
    content = tomllib.loads((hostile / "problem.toml").read_text())
    content["baselines"] = {"best": content["baselines"]["best"]}
    folder = problem_folder(tmp_path / "robot", hostile)
    (folder / "problem.toml").write_text(tomli_w.dumps(content))
    load_problem(folder)
    assert (
        cli.main(["optimise", str(folder), "--budget", "1", "--no-warm-start", "--quiet", "--out", "run"])
        == 0
    )
    assert shown == 2 * [["best", "best, hand-tuned"]]  # for a wide and for a narrow window
