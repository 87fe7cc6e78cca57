"""README, tutorials, notebook, API page and help: every command and example in them, run as written.

Budgets are lowered to ``GAITOPT_DOCS_BUDGET`` (3 unless set), and ArcFold is a copy with a short horizon
and few scenarios. Set-up and the test command itself are left out. At full budget it is
`tests/studies/walk.py`, by hand.
"""

import contextlib
import json
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot
import pytest
from bench_runs import bench_run
from campaigns import brief
from helpers import brief_studies
from phone import CLOSE, SMALL
from pictures import needs_opengl
from planting import dataset, recording_of

from gaitopt.cli import app as cli
from gaitopt.cli import demo
from gaitopt.cli.command import Command
from gaitopt.cli.commands import COMMANDS
from gaitopt.cli.demo import demo_problem
from gaitopt.core.files import write_text
from gaitopt.jobs import blind
from gaitopt.jobs.campaign import Campaign
from gaitopt.problem.model import nominal_mjcf
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.report.film.phone import shot
from gaitopt.report.film.stage import stage_of, walk
from gaitopt.simulation.rollout import Simulator

ROOT = Path(__file__).parents[2]
BUDGET = int(os.environ.get("GAITOPT_DOCS_BUDGET", "3"))
PART = re.compile(
    r"^(?:Save it as `(?P<file>\S+)`:\n\n)?```(?P<kind>\w*)\n(?P<text>.*?)^```"  # a block
    r"|^\| `(?P<row>gaitopt [^`]+)`",  # a row of a table
    flags=re.M | re.S,
)
SETTING_UP = "python3 -m venv"


@pytest.fixture
def workplace(
    quick_folder: Path, quick: Problem, in_a_folder_of_its_own: Path, monkeypatch: pytest.MonkeyPatch
) -> Path:
    """A folder in which the bundled names mean quick copies; plans have few starts, films few pictures."""
    for module, name, value in brief_studies():
        monkeypatch.setattr(module, name, value)
    few = replace(blind.EACH_CASE, effects=["ground_slope", "camera_scale"])
    monkeypatch.setattr(blind, "EACH_CASE", few)
    monkeypatch.setattr(demo, "demo_problem", lambda: quick)
    monkeypatch.setattr(demo, "BUDGET", BUDGET)
    for name in ("arcfold", "arcfold-published"):
        shutil.copytree(quick_folder, name)
    bench_run(Path("bench"))
    return in_a_folder_of_its_own


def lowered(command: str) -> str:
    """The command with a small budget: few gaits, one brief blind case, two effects."""
    if command.startswith("gaitopt diagnose"):
        command += " --effects ground_slope,camera_scale"
    if command.startswith("gaitopt campaign new"):
        command += f" --budget {BUDGET}"
    command = re.sub(r"--cases \d+", "--cases 1 --gaits square-1s --seconds 3", command)
    if re.match(r"gaitopt optimise(?!.*--resume)", command):
        command = re.sub(r"\s--budget \d+", "", command) + f" --budget {BUDGET} --quiet"
    return command


def execute(command: str) -> None:
    """Run one line: gaitopt in this process, anything else in a shell."""
    command = command.partition(" > ")[0]
    if command.startswith("gaitopt "):
        with contextlib.redirect_stdout(None):
            assert cli.main(shlex.split(lowered(command))[1:]) == 0, command
    else:
        subprocess.run(["bash", "-euc", command], check=True)


def commands_in(text: str, folder: Path = Path()) -> Iterator[str]:
    """Every command of a page in order, in blocks and in tables; files that it shows go into a folder."""
    for part in PART.finditer(text):
        if part["row"]:
            yield part["row"]
        elif part["file"]:
            write_text(folder / part["file"], part["text"])
        elif not part["kind"] and SETTING_UP not in part["text"]:
            yield from part["text"].strip().splitlines()


def readme() -> list[str]:
    """The commands of the quick start, the README and the table of all commands, each once."""
    pages = ("docs/quick-start.md", "README.md", "docs/commands.md")
    return list(dict.fromkeys(c for page in pages for c in commands_in((ROOT / page).read_text())))


def film_of_a_robot(path: Path) -> None:
    """Write what Tracker would: a marker that creeps forward."""
    rows = "\n".join(f"{0.05 * i:.2f}\t{0.001 * i:.4f}\t0.0000" for i in range(60))
    write_text(path, f"mass_A\nt\tx\ty\n{rows}\n")


def film_of_a_campaign(folder: Path, out: Path) -> None:
    """Film the gait that a campaign proposes."""
    campaign = Campaign(folder)
    gait = campaign.next_gait
    path = Simulator.build(campaign.problem).run(gait, duration=3.2 * gait.period_s)
    dataset(out, {"film": ("gait.toml", recording_of(path, signals=("marker.x",)))})
    shutil.copy(folder / campaign.next().gait, out / "gait.toml")


def film_of_tags(path: Path, problem: Problem) -> None:
    """Film a tagged robot while its arch folds."""
    shot(path, stage_of(problem), walk(problem, "square-4s", 2.4), CLOSE, SMALL, seconds=1.25, begin=0.9)


@pytest.mark.slow
@needs_opengl
@pytest.mark.usefixtures("workplace")
def test_the_readmes_commands(quick: Problem) -> None:
    film_of_a_robot(Path("walk.txt"))
    film_of_tags(Path("phone.mp4"), quick)
    found = readme()
    assert len(found) >= 15
    with brief():
        for command in found:
            execute(command)


@pytest.mark.slow
@needs_opengl
@pytest.mark.usefixtures("workplace")
def test_the_tutorials_commands() -> None:
    for command in commands_in((ROOT / "docs" / "tutorial.md").read_text()):
        execute(command)
    assert (Path("run") / "report.html").is_file()
    assert list(Path("player").iterdir())


@pytest.mark.slow
@needs_opengl
@pytest.mark.usefixtures("workplace")
def test_the_commands_from_printed_tags_to_a_diagnosis() -> None:
    for command in commands_in((ROOT / "docs" / "film-and-diagnose.md").read_text()):
        execute(command)
    assert Path("tags.pdf").is_file()
    assert (Path("filmed-page") / "report.html").is_file()
    assert (Path("gap") / "report.html").is_file()
    assert (Path("logged") / "dataset.toml").is_file()


@pytest.mark.slow
@pytest.mark.usefixtures("workplace")
def test_the_commands_that_diagnose_one_servo() -> None:
    for command in commands_in((ROOT / "docs" / "one-servo.md").read_text()):
        execute(command)
    assert (Path("servo") / "report.html").is_file()


@pytest.mark.slow
@needs_opengl
@pytest.mark.usefixtures("workplace")
def test_the_commands_of_the_tutorial_on_ones_own_robot() -> None:
    for command in commands_in((ROOT / "docs" / "your-robot.md").read_text()):
        execute(command)
    assert (Path("dog-run") / "report.html").is_file()
    assert (Path("dog-compared") / "report.html").is_file()
    assert list(Path("dog-player").iterdir())


@pytest.mark.slow
@needs_opengl
@pytest.mark.usefixtures("workplace")
def test_the_api_pages_examples(quick: Problem, capsys: pytest.CaptureFixture[str]) -> None:
    weak = Simulator.build(quick.with_effects({"servo_torque_limit": {"limit_n_m": 0.1, "target": "all"}}))
    walked = weak.run(quick.baselines["square-1s"], duration=3.2)
    dataset(
        Path("trials"), {"weak": ("square-1s", recording_of(weak.observe(walked), signals=("marker.x",)))}
    )
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs" / "api.md").read_text(), flags=re.M | re.S)
    names: dict[str, object] = {}
    for block in blocks:
        exec(block.replace("budget=300", f"budget={BUDGET}"), names)
    printed = capsys.readouterr().out
    assert "mm/s" in printed
    assert re.search(r"^explained \['servo_torque_limit'\]", printed, flags=re.M)
    assert matplotlib.get_backend().lower() == "agg"
    assert {path.name for path in Path().iterdir()} >= {
        "walk.svg",
        "gait.pdf",
        "search.png",
        "map.png",
        "beside.webp",
    }
    assert (Path("found") / "report.html").is_file()
    assert (Path("found") / "corrected.toml").is_file()


@pytest.mark.slow
@pytest.mark.usefixtures("workplace")
def test_the_notebook_runs_and_has_no_outputs(capsys: pytest.CaptureFixture[str]) -> None:
    cells = json.loads((ROOT / "docs" / "first-gait.ipynb").read_text())["cells"]
    names: dict[str, object] = {}
    for cell in cells:
        assert not cell.get("outputs")
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]).replace("budget=30", f"budget={BUDGET}"), names)
    assert "times the fastest baseline" in capsys.readouterr().out
    assert matplotlib.pyplot.get_fignums()
    matplotlib.pyplot.close("all")


@pytest.mark.slow
@needs_opengl
@pytest.mark.usefixtures("workplace")
def test_the_examples_of_the_help(quick: Problem) -> None:
    film_of_a_robot(Path("walk.txt"))
    film_of_tags(Path("phone.mp4"), quick)
    write_text(Path("walker.xml"), nominal_mjcf(load_problem("arcfold")))
    found = dict(examples(COMMANDS, "gaitopt"))
    assert {"gaitopt blind make", "gaitopt blind score"} < set(found)
    assert all(command.startswith(name) for name, command in found.items())
    run_elsewhere = readme()
    first = [found["gaitopt import"], found["gaitopt new"]]
    with brief():
        execute(found["gaitopt campaign new"])
        film_of_a_campaign(Path("crawl"), Path("film-1"))
        for command in dict.fromkeys([*first, *found.values()]):
            if command not in run_elsewhere and command != found["gaitopt watch"]:  # which waits for a run
                execute(command)


def examples(commands: Sequence[Command], name: str) -> Iterator[tuple[str, str]]:
    """Yield every command, and every action of one, with its example."""
    for command in commands:
        yield f"{name} {command.name}", command.example
        yield from examples(command.actions, f"{name} {command.name}")


def test_the_demos_problem_is_shorter_than_the_real_one() -> None:
    problem, real = demo_problem(), load_problem("arcfold")
    gait = problem.baselines["square-1s"]
    assert problem.file.scenarios.verification < real.file.scenarios.verification
    assert sum(problem.simulation.horizon.cycles(gait.period_s)) < sum(
        real.simulation.horizon.cycles(gait.period_s)
    )
    assert problem.file.parameters == real.file.parameters


def test_the_places_that_answer_questions_are_on_pages() -> None:
    table = (ROOT / "docs/reports.md").read_text().partition("## Ten questions")[2].partition("\n## ")[0]
    titles = re.findall(r"\*\*(.+?)\*\*", table)
    code = "".join(path.read_text() for path in (ROOT / "gaitopt/report").glob("*.py"))
    assert len(titles) > 8
    assert not [title for title in titles if f'{title}"' not in code]
