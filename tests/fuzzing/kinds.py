"""The kinds of input: each makes one case in a folder."""

from __future__ import annotations

import csv
import io
import random
import re
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import tomli_w
from helpers import STRIDER

from fuzzing.material import (
    PROGRAMS,
    export_of,
    finished_run,
    gait_of,
    problem,
    strider_in,
    table_of,
    table_text,
)
from fuzzing.mutations import NAMES, NUMBERS, broken, changed, changed_xml
from fuzzing.outcome import Case
from gaitopt.core.files import write_text
from gaitopt.diagnose.record.cleaning import clean
from gaitopt.diagnose.record.dataset import load_dataset
from gaitopt.export.formats import FORMATS
from gaitopt.gait.table import read_table
from gaitopt.runs.run_folder import RunFolder


def commands_on(rng: random.Random, reference: str, gait: str = "stride") -> list[str]:
    """Return one of the brief commands on a problem."""
    return rng.choice(
        [
            ["model", reference, "--out", "out.xml"],
            ["effects", reference, "--json"],
            ["command", reference, gait, "--dt", "0.05", "--duration", "1", "--out", "out.csv"],
            ["simulate", reference, gait, "--csv", "out.csv", "--json"],
            ["simulate", reference, gait],
        ]
    )


def problem_text(rng: random.Random, folder: Path) -> Case:
    path = strider_in(folder) / "problem.toml"
    path.write_bytes(broken(rng, path.read_bytes()))
    return Case(commands_on(rng, "robot"))


def problem_content(rng: random.Random, folder: Path) -> Case:
    path = strider_in(folder) / "problem.toml"
    path.write_text(tomli_w.dumps(changed(rng, tomllib.loads(path.read_text()))), encoding="utf-8")
    return Case(commands_on(rng, "robot"))


def mjcf_text(rng: random.Random, folder: Path) -> Case:
    path = strider_in(folder) / "strider.xml"
    path.write_bytes(broken(rng, path.read_bytes()))
    return Case(rng.choice([commands_on(rng, "robot"), ["new", "bot", "--mjcf", str(path), "--out", "out"]]))


def mjcf_content(rng: random.Random, folder: Path) -> Case:
    path = strider_in(folder) / "strider.xml"
    (path.parent / "parts").write_bytes(broken(rng, b'<mujocoinclude><site name="more"/></mujocoinclude>'))
    (path.parent / "wedge.obj").write_bytes(broken(rng, b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\n"))
    root = changed_xml(rng, ET.parse(path).getroot())
    # Text that is not XML belongs to another kind; what is left out here cannot be written as XML.
    text = re.sub(r"[\x00-\x08\x0b\x0c\x0e-\x1f]", "", ET.tostring(root, encoding="unicode"))
    path.write_text(text, encoding="utf-8")
    return Case(rng.choice([commands_on(rng, "robot"), ["new", "bot", "--mjcf", str(path), "--out", "out"]]))


def gait_file(rng: random.Random, folder: Path) -> Case:
    gait = gait_of(rng)
    if rng.random() < 0.5:
        data = broken(rng, gait.to_toml().encode())
    else:
        data = tomli_w.dumps(changed(rng, tomllib.loads(gait.to_toml()))).encode()
    (folder / "gait.toml").write_bytes(data)
    exporting = [
        "export",
        str(STRIDER),
        "gait.toml",
        "--format",
        rng.choice(["c", "json", "csv"]),
        "--out",
        "out",
    ]
    chosen = (
        [exporting, [*exporting, "--clip"]]
        if rng.random() < 0.15
        else [commands_on(rng, str(STRIDER), "gait.toml")]
    )
    return Case(rng.choice(chosen))


def gait_round_trip(rng: random.Random, folder: Path) -> Case:
    gait = gait_of(rng)
    text = table_text(gait, rng.choice(list(FORMATS)))
    (folder / "table").write_text(text, encoding="utf-8")

    def check() -> None:
        back = read_table(folder / "table")
        assert back.gait == gait
        assert back == table_of(gait)

    return Case(call=check)


def exported_table(rng: random.Random, folder: Path) -> Case:
    text = table_text(gait_of(rng), rng.choice(list(FORMATS)))
    (folder / "table.h").write_bytes(broken(rng, text.encode()))
    if rng.random() < 0.5:
        return Case(call=lambda: read_table(folder / "table.h"))
    return Case(commands_on(rng, str(STRIDER), "table.h"))


def importer(rng: random.Random, folder: Path) -> Case:
    name = rng.choice(
        [
            "walk.txt",
            "walk.csv",
            "a b.csv",
            "naïve 机.csv",
            "q'uo\"te.csv",
            "new\nline.csv",
            "-x.csv",
            "\udcff.csv",
        ]
    )
    program = rng.choice(PROGRAMS)
    (folder / name).write_bytes(broken(rng, export_of(rng, program).encode()))
    gait = ["--gait", rng.choice(["stride", "square", rng.choice(NAMES[:4])])]
    said = gait if (program not in ("log", "json-lines")) == (rng.random() < 0.95) else []
    arguments = ["import", f"./{name}", *said, "--problem", str(STRIDER), "--out", "out"]
    for option, values in {
        "--fps": ["25", "30", "0", "-1", "nan", "1e308", "5e-324"],
        "--scale-m-per-px": ["0.001", "0", "1e308", "nan", "5e-324"],
        "--time-unit": ["s", "ms", "min"],
        "--length-unit": ["mm", "m", "px"],
        "--view": ["side", "top", "front"],
        "--marker": ["nose", "foot/1", "mass_A", "A", "x"],
        "--sync-at": ["0.5", "nan", "1e308", "-1"],
        "--angle-unit": ["deg", "rad", "normalised", "counts", "us", "turns"],
        "--full-scale-deg": ["90", "rear=90", "0", "nan", "1e308"],
        "--counts-per-turn": ["4096", "0", "-1", "nan", "1e308"],
        "--command": ["rear=target.rear_rad", "rear=t_s", "=", "a,b=target.front_us"],
        "--signal": ["joint.rear=rear_hip_deg", "joint.=rear_hip_deg", "rear=rear_hip_deg"],
    }.items():
        if rng.random() < (0.7 if option in ("--fps", "--scale-m-per-px") else 0.15):
            usual = values[0] if rng.random() < 0.7 else rng.choice(values)
            arguments.append(f"{option}={usual}")
    return Case([*arguments, *rng.choice([[], ["--json"]])])


def data_set(rng: random.Random, folder: Path) -> Case:
    rows = ["t_s,x_m,z_m,rear_hip_deg"]
    rows += [
        f"{0.05 * i},{0.01 * i},{0.002 * (i % 3)},{10.0 * (i % 5)}" for i in range(rng.choice([3, 30, 60]))
    ]
    entry = {
        "name": "walk",
        "gait": rng.choice(["stride", "square", "gait.toml"]),
        "file": "walk.csv",
        "starts_at_gait_time_s": 0.0,
        "noise_m": 0.001,
        "fps": 20,
        "signals": {"marker.y": "x_m", "marker.z": "z_m", "joint.rear_hip": "rear_hip_deg"},
    }
    content: dict[str, Any] = {"trial": [entry]}
    data, table, gait = (
        tomli_w.dumps(content).encode(),
        "\n".join(rows).encode(),
        gait_of(rng).to_toml().encode(),
    )
    what = rng.randrange(4)
    if what == 0:
        data = broken(rng, data)
    elif what == 1:
        data = tomli_w.dumps(changed(rng, content)).encode()
    elif what == 2:
        table = broken(rng, table)
    else:
        gait, table = broken(rng, gait), broken(rng, table)
    (folder / "set").mkdir()
    for name, text in {"dataset.toml": data, "walk.csv": table, "gait.toml": gait}.items():
        (folder / "set" / name).write_bytes(text)
    known = ["marker.x", "marker.y", "marker.z", "joint.rear_hip", "joint.front_hip"]

    def read() -> None:
        for trial in load_dataset(folder / "set", problem(), known).trials:
            clean(trial)

    return Case(call=read)


def run_folder(rng: random.Random, folder: Path) -> Case:
    """A finished run with something broken: read, simulated, or resumed."""
    run = folder / "run"
    for name, data in finished_run().items():
        path = run / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    victim = rng.choice(
        ["best.toml", "summary.json", "run.toml", "problem.toml", "model.xml", "evaluations.csv"]
    )
    path = run / victim
    data = path.read_bytes()
    if victim.endswith(".toml") and rng.random() < 0.5:
        data = tomli_w.dumps(changed(rng, tomllib.loads(data.decode()))).encode()
    else:
        data = broken(rng, data)
    path.write_bytes(data)
    if rng.random() < 0.05:
        path.unlink()
    resume = ["optimise", "run", "--resume", "run", *rng.choice([[], ["--json"], ["--seed", "1"]])]
    if victim == "summary.json" and not path.exists():
        resume = ["simulate", "run", "run"]
    arguments = rng.choice(
        [resume, resume, commands_on(rng, "run", "run"), commands_on(rng, str(STRIDER), "run")]
    )
    return Case(arguments, rewrites=("run",) if arguments is resume else ())


def journal(rng: random.Random, folder: Path) -> Case:
    """A journal that was cut or edited: replayed completely, or refused in one line."""
    path = folder / "evaluations.csv"
    for name, content in finished_run().items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)
    data = path.read_bytes()
    if rng.random() < 0.5:
        data = broken(rng, data)
    else:
        rows = list(csv.reader(io.StringIO(data.decode())))
        row = rng.choice(rows)
        row[rng.randrange(len(row))] = rng.choice([*NUMBERS, *NAMES])
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(rows)
        data = text.getvalue().encode()
    path.write_bytes(data)
    return Case(
        call=lambda: RunFolder.reopen(folder).folder.open_journal(problem()), may_change=("evaluations.csv",)
    )


def command_line(rng: random.Random, folder: Path) -> Case:
    """Any command with any values; a long search is prevented by a folder that is not empty."""
    (folder / "full").mkdir()
    (folder / "full" / "mine.txt").write_text("mine")
    (folder / "out.csv").write_text("mine")
    words = [
        *NUMBERS,
        *(name for name in NAMES if "\x00" not in name),
        "\udcff.xml",
        str(STRIDER),
        "stride",
        "full",
    ]

    def word() -> str:
        return rng.choice(words)

    def text() -> str:
        return rng.choice([word(), word(), "stride"])

    robot = rng.choice([str(STRIDER), str(STRIDER), word()])
    dt = rng.choice(["0.1", "0.1", "nan", "-1", "0", "1e-300", "inf", "1e300", word()])
    number = rng.choice(["1", "4", "0", "-1", "1e400", "99999999999999999999", word()])
    made = rng.choice(
        [
            [
                "model",
                robot,
                "--out",
                rng.choice(["out.xml", "none/out.xml", "full", word()]),
                "--set",
                text(),
            ],
            [
                "model",
                robot,
                "--out",
                "out.xml",
                "--set",
                f"{rng.choice(['mass', 'k_servo', 'mu_rear'])}={word()}",
            ],
            ["effects", robot, "--set", f"mass={word()}"],
            [
                "command",
                robot,
                text(),
                f"--dt={dt}",
                f"--duration={rng.choice(['1', '1', word()])}",
                "--out=out.csv",
            ],
            [
                "simulate",
                robot,
                text(),
                rng.choice(["--json", f"--csv={word()}", "--seconds=1", f"--video={word()}"]),
            ],
            ["optimise", robot, "--out", "full", f"--budget={number}", f"--seed={number}"],
            ["optimise", robot, "--out", "full", f"--executor={word()}", f"--workers={number}"],
            ["optimise", robot, "--out", "full", f"--method={word()}"],
            ["optimise", robot, f"--resume={word()}", *rng.choice([[], ["--pareto"]])],
            ["compare", robot, text(), "--out", "full"],
            [
                "sweep",
                robot,
                "stride",
                f"--over={rng.choice(['period_s', 'mass', 'rear.duty', word()])}={word()},x",
            ],
            ["check", robot, "--out", "full"],
            ["diagnose", robot, word(), *rng.choice([[], [f"--effects={word()}"], [f"--resume={word()}"]])],
            ["blind", "make", robot, f"--cases={rng.choice(['0', '-1', 'x'])}", "--out", "out"],
            ["blind", "score", rng.choice(["full", "none", word()])],
            ["export", robot, text(), f"--format={word()}", "--out", "out"],
            ["export", robot, text(), "--format=c", "--out", "full"],
            [
                "export",
                robot,
                "stride",
                "--format=json",
                "--out=out",
                rng.choice([f"--slew={word()}", f"--samples={number}", f"--led-pin={number}"]),
            ],
            ["import", text(), "--gait", text(), "--out", rng.choice(["out", "full"])],
            [
                "new",
                word(),
                "--mjcf",
                rng.choice([str(STRIDER / "strider.xml"), word()]),
                "--out",
                rng.choice(["out", "full"]),
            ],
            ["completion", word()],
            [word() for _ in range(rng.randrange(1, 5))],
        ]
    )
    if rng.random() < 0.3:
        free = [i for i, said in enumerate(made) if said != "full" and "--out" not in said]
        made[rng.choice(free)] = word()
    if made[0] in ("demo", "plan") or any(w.startswith("--h") or w == "-h" for w in made):
        made = ["effects", *made[1:]]
    mine = ("out.csv",) if "command" in made[:1] or "simulate" in made[:1] else ()
    return Case(made, may_change=(*mine,))


def written_over(rng: random.Random, folder: Path) -> Case:
    """The output path holds a file of the user: it is replaced completely, or not changed."""
    (folder / "out.csv").write_text("mine")
    (folder / "out.xml").write_text("mine")
    path = strider_in(folder) / "problem.toml"
    path.write_bytes(broken(rng, path.read_bytes()))
    write_text(folder / "gait.toml", gait_of(rng).to_toml())
    return Case(
        commands_on(rng, "robot", rng.choice(["stride", "gait.toml"])), may_change=("out.csv", "out.xml")
    )
