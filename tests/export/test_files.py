"""The files of an export: names stay names, and the README says what to do."""

import ast
import shutil
import subprocess
import tomllib
from concurrent.futures import Executor
from pathlib import Path

import pytest
import tomli_w
from exporting import UNHURT, table_of

from gaitopt.cli.app import main
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.export.files import comment, export_files
from gaitopt.export.formats import FORMATS
from gaitopt.export.handover import Choices, Handover, prepare, write_folder
from gaitopt.problem.problem import Problem, load_problem


def hostile(wired_folder: Path, name: str) -> Problem:
    """The strider with a servo of another name."""
    text = (wired_folder / "strider.xml").read_text()
    quoted = name.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;").replace("\n", "&#10;")
    (wired_folder / "strider.xml").write_text(text.replace('name="rear"', f'name="{quoted}"'))
    path = wired_folder / "problem.toml"
    content = tomllib.loads(path.read_text())
    content["channels"] = {
        name if key == "rear" else key: value for key, value in content["channels"].items()
    }
    for baseline in content["baselines"].values():
        baseline["channels"] = {
            name if key == "rear" else key: value for key, value in baseline["channels"].items()
        }
    path.write_text(tomli_w.dumps(content))
    return load_problem(path)


@pytest.mark.parametrize(
    "name",
    ['*/ system("x") //', "a\\nimport os", '"); system("x"); //', "\\", "??/", "{{ 7 * 7 }}", "|`<b>", "ü"],
)
def test_a_name_stays_a_name(wired_folder: Path, tmp_path: Path, name: str) -> None:
    problem = hostile(wired_folder, name)
    table = table_of(problem, problem.baselines["stride"])
    unset: dict[str, list[str]] = {name: [], "front": []}
    texts = {form: export_files(FORMATS[form], table, UNHURT, [], unset) for form in FORMATS}
    program = ast.parse(texts["micropython"]["gait_table.py"])
    assert {type(statement) for statement in program.body} == {ast.Assign}
    assert comment(name)[1:-1] in texts["c"]["README.md"]
    for form, files in texts.items():
        path = tmp_path / f"{form}.txt"
        path.write_text(files[FORMATS[form].table_file])
        assert list(problem.find_gait(str(path)).channels) == [name, "front"]
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("gcc is not installed")
    write_folder(tmp_path / "c", texts["c"])
    (tmp_path / "c" / "user.c").write_text(
        '#include "table.h"\nint main(void) { return gait_table.servos - 2; }\n'
    )
    strict = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-pedantic"]
    subprocess.run([compiler, *strict, "user.c", "gait_player.c"], cwd=tmp_path / "c", check=True)


def test_the_readme_has_wiring_the_lines_to_type_and_how_to_film(wired: Problem, serial: Executor) -> None:
    handover: Handover = prepare(wired, wired.baselines["stride"], Choices("micropython", led_pin=2), serial)
    text = handover.files["README.md"]
    for part in (
        "| 4 | `rear` | 1500 | 500 to 2500 | neutral_us, min_us,",
        "import gait_servos\ngait_servos.run(20)",
        "Sync LED: GPIO2",
        "scale bar",
        "square to the path",
        "Three repeats",
        "gaitopt import walk.csv --gait gait_table.py --sync-at 2.4 --out trials",
        f"hash `{handover.table.hash}`",
    ):
        assert part in text


@pytest.mark.parametrize("format", list(FORMATS))
@pytest.mark.parametrize("led_pin", [None, 2])
def test_the_import_of_the_readme_runs_as_written(
    wired: Problem,
    serial: Executor,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    format: str,
    led_pin: int | None,
) -> None:
    handover = prepare(wired, wired.baselines["stride"], Choices(format, led_pin=led_pin), serial)
    write_folder(tmp_path / "out", handover.files)
    rows = "\n".join(f"{0.02 * i:.2f},{0.01 * i:.3f},0.0" for i in range(300))
    (tmp_path / "out" / "walk.csv").write_text(f"t_s,x_m,z_m\n{rows}\n")
    monkeypatch.chdir(tmp_path / "out")
    (line,) = (line for line in handover.files["README.md"].splitlines() if line.startswith("gaitopt import"))
    assert main(line.split()[1:]) == 0
    (trial,) = load_dataset(Path("trials"), wired, ["marker.x", "marker.z"]).trials
    assert trial.drive == wired.baselines["stride"]
    assert trial.starts_at_s == (None if led_pin is None else -2.4)
