"""Importers: what tracking programs write becomes a data set in SI units."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from helpers import STRIDER

from gaitopt.core.errors import GaitoptError
from gaitopt.diagnose.record.export import ImportOptions
from gaitopt.diagnose.record.importing import import_file, import_files
from gaitopt.problem.problem import load_problem

COUNT = 12
TIME = np.arange(COUNT) / 25.0
X = 0.5 + 0.25 * np.arange(COUNT)
Y = -1.0 - 0.5 * np.arange(COUNT)


def comma(value: float) -> str:
    """A number with a decimal comma and a typographic minus sign."""
    return f"{value:.4f}".replace(".", ",").replace("-", "\N{MINUS SIGN}")


def tracker_txt() -> str:
    """An export of Tracker, as text with tabs."""
    rows = [f"{comma(t)}\t{comma(x)}\t{comma(y)}" for t, x, y in zip(TIME, X, Y, strict=True)]
    return "\n".join(["mass_A", "t\tx\ty", *rows])


def tracker_csv() -> str:
    """The same as a table with commas, one point missing."""
    rows = [f"{t:.3f},{i},{x},{y}," for i, (t, x, y) in enumerate(zip(TIME, X, Y, strict=True))]
    rows[3] = f"{TIME[3]:.3f},3,,,"
    return "\n".join([",mass A,,,", "t,frame,x,y,", *rows])


def deeplabcut() -> str:
    """An export of DeepLabCut with two points, one sample of the second unlikely."""
    head = [
        "scorer" + 6 * ",net",
        "bodyparts,tail,tail,tail,nose,nose,nose",
        "coords" + 2 * ",x,y,likelihood",
    ]
    rows = [
        f"{i},0,0,0.9,{100 * x},{100 * y},{1e-4 if i == 4 else 0.99}"
        for i, (x, y) in enumerate(zip(X, Y, strict=True))
    ]
    return "\n".join([*head, *rows])


def sleap() -> str:
    """An analysis file of SLEAP, a frame and a point missing."""
    rows = [
        f",{i},0.9,{100 * x},{100 * y},0.8" if i != 2 else ",2,0.9,,,"
        for i, (x, y) in enumerate(zip(X, Y, strict=True))
        if i != 6
    ]
    return "\n".join(["track,frame_idx,instance.score,nose.x,nose.y,nose.score", *rows])


def kinovea() -> str:
    """An export of Kinovea."""
    rows = [f'"{1e3 * t:g}";"{comma(x)}";"{comma(y)}"' for t, x, y in zip(TIME, X, Y, strict=True)]
    return "\n".join(['"Time";"foot/1/X";"foot/1/Y"', *rows])


def plain() -> str:
    """A plain table of a marker and a joint."""
    rows = [f"{t},{1e3 * x},{1e3 * y},{10 * i}" for i, (t, x, y) in enumerate(zip(TIME, X, Y, strict=True))]
    return "\n".join(["t_s,x_mm,z_mm,mid_left_deg", *rows])


PIXELS = ImportOptions(fps=25.0, scale_m_per_px=0.01, marker="nose")


def written(folder: Path, text: str, name: str = "walk.csv") -> Path:
    """A file with this text."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "options", "program", "up", "missing"),
    [
        (tracker_txt(), ImportOptions(), "Tracker", 1, []),
        (tracker_csv(), ImportOptions(), "Tracker", 1, [3]),
        (deeplabcut(), PIXELS, "DeepLabCut", -1, [4]),
        (sleap(), PIXELS, "SLEAP", -1, [2]),
        (kinovea(), ImportOptions(), "Kinovea", 1, []),
        (plain(), ImportOptions(), "plain CSV", 1, []),
    ],
)
def test_every_format(
    tmp_path: Path, text: str, options: ImportOptions, program: str, up: int, missing: list[int]
) -> None:
    motion = import_file(written(tmp_path, text), options)
    kept = [i for i in range(COUNT) if not (program == "SLEAP" and i == 6)]
    assert motion.program == program
    np.testing.assert_allclose(motion.time, TIME[kept], atol=1e-9)
    x, z = X[kept].copy(), up * Y[kept]
    for index in missing:
        x[kept.index(index)] = z[kept.index(index)] = np.nan
    np.testing.assert_allclose(motion.signals["marker.x"], x, atol=1e-9)
    np.testing.assert_allclose(motion.signals["marker.z"], z, atol=1e-9)


def test_what_was_changed_is_said(tmp_path: Path) -> None:
    named = {defect.name for defect in import_file(written(tmp_path, deeplabcut()), PIXELS).defects}
    assert {"pixels", "unlikely_points", "gaps"} <= named
    by_name = {defect.name: defect for defect in import_file(written(tmp_path, sleap()), PIXELS).defects}
    assert "1 frame missing" in by_name["gaps"].message


def test_other_joints_and_the_view_from_above(tmp_path: Path) -> None:
    motion = import_file(written(tmp_path, plain()), ImportOptions())
    np.testing.assert_allclose(motion.signals["joint.mid_left"], np.deg2rad(10.0 * np.arange(COUNT)))
    motion = import_file(written(tmp_path, tracker_txt()), ImportOptions(view="top", length_unit="cm"))
    np.testing.assert_allclose(motion.signals["marker.y"], 0.01 * Y)


def test_kinovea_in_seconds(tmp_path: Path) -> None:
    motion = import_file(written(tmp_path, kinovea()), ImportOptions(time_unit="s"))
    np.testing.assert_allclose(motion.time, 1e3 * TIME)


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        (deeplabcut(), ImportOptions(scale_m_per_px=1.0, marker="nose"), "--fps"),
        (deeplabcut(), ImportOptions(fps=25.0, marker="nose"), "--scale-m-per-px"),
        (deeplabcut(), ImportOptions(fps=25.0, scale_m_per_px=1.0), "--marker: tail, nose"),
        (sleap(), ImportOptions(fps=25.0, scale_m_per_px=1.0, marker="tail"), "unknown point 'tail'"),
        (kinovea(), ImportOptions(time_unit="min"), "--time-unit: found 'min'; allowed: s, ms"),
        (tracker_txt(), ImportOptions(view="front"), "--view"),
        ("a,b\n1,2\n", ImportOptions(), "not an export of Tracker"),
        ("", ImportOptions(), "empty"),
        ("t_s,x_px\n0,1\n", ImportOptions(), "_m, _cm, _mm"),
        ("t_s,speed\n0,1\n1,2\n", ImportOptions(), "no column such as x_m"),
        ("t_s,x_m\n0,1\n0.2,1\n0.1,2\n", ImportOptions(), "time goes backward after 0.2 s"),
        ("t_s,x_m\n0,\n0.1,\n0.2,\n", ImportOptions(), "fewer than three samples"),
        ("mass_A\nt\tx\ty\n0\tone\t2\n", ImportOptions(), "line 3, column x: found 'one'"),
    ],
)
def test_one_line_says_what_is_wrong(tmp_path: Path, text: str, options: ImportOptions, said: str) -> None:
    with pytest.raises(GaitoptError) as caught:
        import_file(written(tmp_path, text), options)
    assert said in str(caught.value)


def test_a_data_set_of_several_files(tmp_path: Path) -> None:
    files = [written(tmp_path, tracker_txt(), "a.txt"), written(tmp_path, tracker_csv(), "b.csv")]
    out = tmp_path / "trials"
    import_files(files, ["square-1s", "square-2s"], out, ImportOptions(sync_at_s=1.5))
    content = tomllib.loads((out / "dataset.toml").read_text())
    assert [trial["gait"] for trial in content["trial"]] == ["square-1s", "square-2s"]
    assert content["trial"][0]["starts_at_gait_time_s"] == -1.5
    assert content["trial"][1]["signals"] == {"marker.x": "x_m", "marker.z": "z_m"}
    assert (out / "b.csv").read_text().splitlines()[4] == "0.12,,"


def test_nothing_is_overwritten_or_left_half_written(tmp_path: Path) -> None:
    good, bad = written(tmp_path, tracker_txt(), "a.txt"), written(tmp_path, "what\n", "b.csv")
    out = tmp_path / "trials"
    with pytest.raises(GaitoptError, match="not an export"):
        import_files([good, bad], ["square-1s"], out, ImportOptions())
    assert not out.exists()
    import_files([good], ["square-1s"], out, ImportOptions())
    before = {path: path.read_bytes() for path in out.iterdir()}
    with pytest.raises(GaitoptError, match="is not empty; allowed: a new or an empty folder"):
        import_files([good], ["square-2s"], out, ImportOptions())
    assert {path: path.read_bytes() for path in out.iterdir()} == before


def test_one_gait_or_one_each(tmp_path: Path) -> None:
    file = written(tmp_path, tracker_txt())
    with pytest.raises(GaitoptError, match="found 2 for 1 files"):
        import_files([file], ["square-1s", "square-2s"], tmp_path / "out", ImportOptions())


def tiny_gait(period_s: float) -> str:
    """A gait file of one servo."""
    return f"period_s = {period_s}\n[channels.a]\nduty = 0.5\nphase = 0.0\namplitude_deg = 9.0\n"


def test_a_gait_that_does_not_exist_is_refused_at_once(tmp_path: Path) -> None:
    file, out = written(tmp_path, tracker_txt()), tmp_path / "trials"
    (tmp_path / "unfinished").mkdir()
    for gait, problem, said in (
        ("sqare-1s", None, "--gait: found 'sqare-1s'; allowed: a run folder, a gait file, an exported table"),
        ("sqare-1s", None, "(nearest: 'square-1s'), or a gait of another problem with --problem PROBLEM"),
        ("square-1s", load_problem(STRIDER), "baselines: stride, square"),
        (str(tmp_path / "unfinished"), None, "is not a finished run folder"),
        (str(file), None, f"{file}: "),
    ):
        with pytest.raises(GaitoptError) as caught:
            import_files([file], [gait], out, ImportOptions(), problem)
        assert said in str(caught.value)
        assert not out.exists()


def test_a_gait_is_checked_with_its_problem(tmp_path: Path) -> None:
    file, gait = written(tmp_path, tracker_txt()), written(tmp_path, tiny_gait(0.1), "mine.toml")
    with pytest.raises(GaitoptError, match="unknown channel 'a'"):
        import_files([file], [str(gait)], tmp_path / "out", ImportOptions(), load_problem(STRIDER))


def test_the_best_gaits_of_two_runs_are_two_files(tmp_path: Path) -> None:
    files = [written(tmp_path, tracker_txt(), name) for name in ("a.txt", "b.txt")]
    runs = [tmp_path / "fast", tmp_path / "slow"]
    for period_s, run in zip((0.1, 0.2), runs, strict=True):
        run.mkdir()
        (run / "best.toml").write_text(tiny_gait(period_s))
    out = tmp_path / "trials"
    import_files(files, list(map(str, runs)), out, ImportOptions())
    trials = tomllib.loads((out / "dataset.toml").read_text())["trial"]
    assert [trial["gait"] for trial in trials] == ["best.toml", "slow-best.toml"]
    assert (out / "slow-best.toml").read_text() == tiny_gait(0.2)


def test_what_recurs_with_the_gait_is_no_outlier(tmp_path: Path) -> None:
    """A marker that kicks up once a cycle: without the period each kick is an outlier."""
    time = np.arange(0.0, 12.0, 1.0 / 60.0)
    phase = time % 1.0
    height = 0.05 * ((phase > 0.5) & (phase < 0.53)) + 1e-4 * np.sin(40.0 * time)
    rows = [f"{t:.5f},{0.02 * t:.6f},{z:.6f}" for t, z in zip(time, height, strict=True)]
    file = written(tmp_path, "\n".join(["t_s,x_m,z_m", *rows]))
    alone = import_file(file, ImportOptions())
    assert "marker_outliers" in {defect.name for defect in alone.defects}
    (known,) = import_files([file], ["square-1s"], tmp_path / "trials", ImportOptions())
    assert "marker_outliers" not in {defect.name for defect in known.defects}


def test_columns_without_a_unit_are_asked_for_with_the_option_to_add(tmp_path: Path) -> None:
    rows = "\n".join(f"{t},{1e3 * x},{1e3 * y}" for t, x, y in zip(TIME, X, Y, strict=True))
    file = written(tmp_path, f"t,x,y\n{rows}\n")
    with pytest.raises(
        GaitoptError, match=r"x: its unit is not known; .*; for example, add --length-unit mm"
    ):
        import_file(file, ImportOptions())
    motion = import_file(file, ImportOptions(length_unit="mm"))
    np.testing.assert_allclose(motion.signals["marker.x"], X)
    np.testing.assert_allclose(motion.signals["marker.z"], Y)


@pytest.mark.parametrize(
    ("head", "view", "signals", "said"),
    [
        ("t_s,x_m,y_m", "side", ["marker.x", "marker.z"], True),
        ("t_s,x_m,y_m", "top", ["marker.x", "marker.y"], False),
        ("t_s,marker.x_m,marker.y_m", "side", ["marker.x", "marker.y"], False),
        ("t_s,x_m,z_m", "side", ["marker.x", "marker.z"], False),
    ],
)
def test_y_of_a_side_view_is_the_height(
    tmp_path: Path, head: str, view: str, signals: list[str], said: bool
) -> None:
    rows = "\n".join(f"{t},{x},{y}" for t, x, y in zip(TIME, X, Y, strict=True))
    motion = import_file(written(tmp_path, f"{head}\n{rows}\n"), ImportOptions(view=view))
    assert list(motion.signals) == signals
    assert ("side_view" in {defect.name for defect in motion.defects}) == said
