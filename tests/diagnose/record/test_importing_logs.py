"""Data sets of logs: what `gaitopt import` writes is read again as it was."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
import rigs
from helpers import STRIDER
from hostility import refused, run
from servologs import followed, targets

from gaitopt.cli import app as cli
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.diagnose.record.export import ImportOptions
from gaitopt.diagnose.record.importing import import_files
from gaitopt.gait.logged import LoggedCommands
from gaitopt.problem.problem import Problem

TIME = np.arange(0.0, 2.0, 0.02)
SENT = np.where(TIME < 1.5, targets(TIME), np.nan)
SEEN = followed(TIME, targets(TIME))
MAPPED = ImportOptions(commands={"turn": "target_rad"}, signals={"joint.elbow": "angle_rad"})


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """An arm, whose servo is called ``turn`` and whose joint is called ``elbow``."""
    return rigs.build(tmp_path_factory.mktemp("rig") / "arm", rigs.arm(), {"marker": "tip"})


def bench(path: Path) -> Path:
    """A log as a bench writes it."""
    rows = [f"{t:.2f},{'' if np.isnan(a) else a},{b}" for t, a, b in zip(TIME, SENT, SEEN, strict=True)]
    path.write_text("\n".join(["t_s,target_rad,angle_rad", *rows]) + "\n")
    return path


def film(path: Path) -> Path:
    """A tracked film."""
    rows = [f"{t:.2f}\t{0.01 * t}\t0.0" for t in TIME]
    path.write_text("\n".join(["mass_A", "t\tx\ty", *rows]) + "\n")
    return path


def test_a_log_becomes_a_trial_with_its_commands(tmp_path: Path, rig: Problem) -> None:
    out = tmp_path / "trials"
    import_files([bench(tmp_path / "up.csv")], [], out, MAPPED)
    assert sorted(path.name for path in out.iterdir()) == ["dataset.toml", "up-commands.csv", "up.csv"]
    (entry,) = tomllib.loads((out / "dataset.toml").read_text())["trial"]
    assert entry == {
        "name": "up",
        "commands": "up-commands.csv",
        "file": "up.csv",
        "time": "t_s",
        "signals": {"joint.elbow": "elbow_rad"},
    }
    assert (out / "up-commands.csv").read_text().splitlines()[0] == "t_s,turn_rad"
    assert (out / "up-commands.csv").read_text().splitlines()[76] == "1.5,"
    (trial,) = load_dataset(out, rig, ["joint.elbow"]).trials
    assert isinstance(trial.drive, LoggedCommands)
    np.testing.assert_allclose(trial.drive.targets(TIME)[:, 0], SENT)
    np.testing.assert_allclose(trial.signals["joint.elbow"], SEEN)
    assert trial.starts_at_s == 0.0


def test_a_clock_that_counts_from_1970_is_read_again(tmp_path: Path, rig: Problem) -> None:
    path, out = tmp_path / "up.jsonl", tmp_path / "trials"
    rows = zip(TIME.tolist(), np.nan_to_num(SENT).tolist(), SEEN.tolist(), strict=True)
    path.write_text(
        "".join(
            json.dumps({"ts": 1.7e9 + t, "cmd": {"turn_us": 1500 + 500 * a}, "joint": {"elbow_rad": b}})
            + "\n"
            for t, a, b in rows
        )
    )
    import_files([path], [], out, ImportOptions())
    (trial,) = load_dataset(out, rig, ["joint.elbow"]).trials
    np.testing.assert_allclose(trial.time, TIME, atol=1e-6)


def test_films_and_logs_in_one_data_set(tmp_path: Path) -> None:
    out = tmp_path / "trials"
    files = [film(tmp_path / "walk.txt"), bench(tmp_path / "up.csv"), film(tmp_path / "trot.txt")]
    arguments = ["import", *files, "--out", out, "--problem", STRIDER, "--gait", "stride", "--gait", "square"]
    mixed = [str(argument) for argument in arguments]
    assert cli.main([*mixed, "--command", "a=target_rad"]) == 1
    columns = bench(tmp_path / "up.csv").read_text().replace("target_rad", "cmd.a_rad")
    (tmp_path / "up.csv").write_text(columns.replace("angle_rad", "joint.a_rad"))
    assert cli.main(mixed) == 0
    trials = tomllib.loads((out / "dataset.toml").read_text())["trial"]
    assert [trial.get("gait") for trial in trials] == ["stride", None, "square"]
    assert [trial.get("commands") for trial in trials] == [None, "up-commands.csv", None]


def test_the_command_says_what_it_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = bench(tmp_path / "up.csv"), tmp_path / "trials"
    chosen = ["--command", "turn=target_rad", "--signal", "joint.elbow=angle_rad"]
    assert cli.main(["import", str(log), *chosen, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert f"{log}: plain CSV, 100 samples of joint.elbow; commands of turn\n" in said
    assert cli.main(["import", str(log), *chosen, "--out", str(tmp_path / "again"), "--json"]) == 0
    (trial,) = json.loads(capsys.readouterr().out)["trials"]
    assert trial == {
        "name": "up",
        "program": "plain CSV",
        "signals": ["joint.elbow"],
        "commands": ["turn"],
    }


def test_defects_of_a_log_are_named_when_it_is_imported(tmp_path: Path) -> None:
    """A sensor that never moves though its servo does, in a log that begins late on its clock."""
    path = bench(tmp_path / "up.csv")
    head, *rows = path.read_text().splitlines()
    kept = [line.split(",") for index, line in enumerate(rows[:70]) if index not in (20, 21)]
    stuck = [f"{float(stamp) + 7.0:.2f},{sent},0.25" for stamp, sent, _ in kept]
    path.write_text("\n".join([head, *stuck]) + "\n")
    (recording,) = import_files([path], [], tmp_path / "trials", MAPPED)
    assert [defect.name for defect in recording.defects] == ["gaps", "stuck_angles"]
    assert "2 samples lost in 1 gap" in recording.defects[0].message
    assert (
        "joint.elbow never changes from t = 7.00 s on, though the commands do" in recording.defects[1].message
    )


def test_names_with_nan_in_them_stay_whole(tmp_path: Path) -> None:
    path, out = tmp_path / "up.csv", tmp_path / "trials"
    text = (
        bench(path).read_text().replace("target_rad", "cmd.nana_rad").replace("angle_rad", "joint.nana_rad")
    )
    path.write_text(text)
    import_files([path], [], out, ImportOptions())
    for name in ("up.csv", "up-commands.csv"):
        assert (out / name).read_text().startswith("t_s,nana_rad\n")


def test_one_line_says_what_is_missing_or_too_much(tmp_path: Path) -> None:
    log, walk, out = bench(tmp_path / "up.csv"), film(tmp_path / "walk.txt"), tmp_path / "trials"
    said = refused(lambda: import_files([walk], [], out, ImportOptions()))
    assert "walk.txt: holds no commands, such as target.NAME_rad; say what was commanded: --gait GAIT" in said
    said = refused(lambda: import_files([log], ["stride"], out, MAPPED))
    assert said == "--gait: found one, and every file holds its commands; allowed: none"
    said = refused(lambda: import_files([walk], ["stride"], out, MAPPED))
    assert "Tracker: takes no --command and no --signal; allowed: for logs" in said
    synchronous = ImportOptions(sync_at_s=1.0, commands=MAPPED.commands, signals=MAPPED.signals)
    said = refused(lambda: import_files([log], [], out, synchronous))
    assert said.startswith("--sync-at: found one for a log of commands")
    measured = ImportOptions(commands={"turn": "target_rad"})
    log.write_text(log.read_text().replace("angle_rad", "elbow_rad"))
    other = tmp_path / "up-commands.txt"
    other.write_text("t_s,target_rad,elbow_rad\n0,0,0\n1,0,0\n2,1,1\n")
    said = refused(lambda: import_files([log, other], [], out, measured))
    assert "two files have the same name: up, up-commands, up-commands, up-commands-commands" in said
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--command", "turn"], "found 'turn'; allowed: NAME=COLUMN"),
        (["--signal", "=angle_rad"], "found '=angle_rad'; allowed: NAME=COLUMN"),
        (["--full-scale-deg", "arm=wide"], "found 'arm=wide'; allowed: DEG, or NAME=DEG"),
    ],
)
def test_options_that_are_no_pairs_are_wrong_usage(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    assert cli.main(["import", str(bench(tmp_path / "up.csv")), "--out", "out", *arguments]) == 2
    assert said in capsys.readouterr().err


def test_a_missing_column_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = bench(tmp_path / "up.csv")
    code, said = run(capsys, "import", log, "--command", "turn=target_deg", "--out", tmp_path / "out")
    assert code == 1
    assert "--command turn: unknown column 'target_deg'; known: target_rad, angle_rad" in said
    assert not (tmp_path / "out").exists()
