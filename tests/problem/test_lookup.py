"""Where problems are found."""

from pathlib import Path

from helpers import STRIDER, complaint, problem_folder

from gaitopt.problem.lookup import bundled_problems
from gaitopt.problem.problem import load_problem


def test_a_problem_is_a_bundled_name_a_folder_or_a_file(tmp_path: Path) -> None:
    named = load_problem("arcfold")
    assert named.source == bundled_problems() / "arcfold" / "problem.toml"
    assert load_problem(named.source.parent) == named
    assert load_problem(named.source) == named
    other = named.source.parent.joinpath("arcfold.xml").read_text()
    (tmp_path / "arcfold.xml").write_text(other)
    elsewhere = tmp_path / "another-name.toml"
    elsewhere.write_text(named.source.read_text())
    assert load_problem(elsewhere).file == named.file


def test_a_folder_here_comes_before_a_bundled_name() -> None:
    problem_folder(Path("arcfold"), STRIDER)
    assert load_problem("arcfold").name == "strider"


def test_every_bundled_problem_loads() -> None:
    names = [path.parent.name for path in bundled_problems().glob("*/problem.toml")]
    assert {"arcfold", "arcfold-held", "arcfold-published", "servo-bench"} <= set(names)
    for name in names:
        assert load_problem(name).name == name


def test_an_unknown_problem_says_which_exist() -> None:
    assert complaint("arcfoldd") == (
        "arcfoldd: no such problem; allowed: a folder with problem.toml, a problem TOML, "
        "or one of arcfold, arcfold-held, arcfold-published, quadruped, servo-bench, snake "
        "(nearest: 'arcfold')"
    )


def test_a_folder_without_a_problem_file_says_so(tmp_path: Path) -> None:
    assert complaint(tmp_path) == f"{tmp_path}: no problem.toml in this folder"
