"""Attacks with models, odd files and outputs (findings 2, 3, 6 and 8 of issue 28)."""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from attacked import (
    ATTACKS,
    DONE,
    ONE_LINE,
    STRIDER,
    Act,
    Attack,
    Ended,
    Ground,
    attack,
    outside,
)

# Finding 2: attribute names in `sets` bypass the check of files.


def with_path(on: Ground, path: str) -> Path:
    value = (
        f'[parameters.attack]\nvalue = 1.0\nunit = "1"\norigin = "assumed"\nsets = [{json.dumps(path)}]\n\n'
    )
    return on.robot(("problem.toml", "[roles]", value + "[roles]"))


@attack(2, "an attribute name in `sets` holds an include of a file outside")
def include_in_a_name(on: Ground) -> Ended:
    markup = f'margin="0"/><include file="{on.folder}/elsewhere.xml"/><site size'
    robot = with_path(on, f".//geom[@name='trunk']/@{markup}")
    return outside(on.run("model", robot, "--out", "model.xml"))


@attack(2, "an attribute name in `sets` holds other markup")
def markup_in_a_name(on: Ground) -> Ended:
    markup = 'margin="0"/><geom size="1"/><site size'
    ended = on.run("simulate", with_path(on, f".//geom[@name='trunk']/@{markup}"), "stride")
    return replace(ended, more="the robot got another part") if ended.code == 0 else ended


# Finding 3: links out of a folder, pipes, devices and files without end.


@attack(3, "the only MJCF of a problem is a link out of its folder")
def linked_model(on: Ground) -> Ended:
    robot = on.robot()
    (robot / "strider.xml").rename(on.folder / "outside.xml")
    (robot / "strider.xml").symlink_to("../outside.xml")
    return outside(on.run("simulate", robot, "stride"))


@attack(3, "`best.toml` of a run is a link out of its folder")
def linked_gait(on: Ground) -> Ended:
    run = on.finished()
    (run / "best.toml").rename(on.folder / "outside.toml")
    (run / "best.toml").symlink_to("../outside.toml")
    return outside(on.run("simulate", STRIDER, run))


PLACES: dict[str, Callable[[Ground, Path], tuple[object, ...]]] = {
    "MJCF": lambda on, odd: ("simulate", odd.parent, "stride"),
    "gait": lambda on, odd: ("simulate", STRIDER, odd),
    "recording to import": lambda on, odd: ("import", odd, "--gait", "square-1s", "--out", "out"),
    "MJCF of `new`": lambda on, odd: ("new", "bot", "--mjcf", odd, "--out", "bot"),
}


def odd_file(place: str, kind: str) -> Act:
    def act(on: Ground) -> Ended:
        if place == "MJCF":
            odd = on.robot() / "strider.xml"
            odd.unlink()
        else:
            odd = on.folder / "odd"
        if kind == "pipe":
            os.mkfifo(odd)
        elif kind == "device without end":
            on.device(odd, 5)
        else:
            with odd.open("wb") as file:
                file.truncate(2**40)
        return on.run(*PLACES[place](on, odd))

    return act


for _place in PLACES:
    for _kind in ("pipe", "device without end", "file of 1 TiB"):
        ATTACKS.append(Attack(3, f"a {_kind} as {_place}", odd_file(_place, _kind)))


@attack(3, "a pipe as an include of the MJCF")
def included_pipe(on: Ground) -> Ended:
    robot = on.with_element('<include file="parts/pipe.xml"/>')
    (robot / "parts").mkdir()
    os.mkfifo(robot / "parts" / "pipe.xml")
    return on.run("simulate", robot, "stride")


# Finding 6: MJCF without end.

ENDLESS = {
    "a million million copies": '<replicate count="1000000000"><geom size="1"/></replicate>',
    "two thousand million keyframes": '</worldbody><size nkey="2000000000"/><worldbody>',
    "a height field of 200,000 squared": '</worldbody><asset><hfield name="h" nrow="200000" ncol="200000" '
    'size="1 1 1 1"/></asset><worldbody>',
    "a memory of 1 TiB": '</worldbody><size memory="1T"/><worldbody>',
}
for _title, _element in ENDLESS.items():

    def endless(on: Ground, element: str = _element) -> Ended:
        robot = on.robot(("strider.xml", "</worldbody>", element + "</worldbody>"))
        return on.run("simulate", robot, "stride")

    ATTACKS.append(Attack(6, f"an MJCF with {_title}", endless))


# Finding 8: files that are replaced.


@attack(8, "`--csv` over a link to a file")
def csv_over_a_link(on: Ground) -> Ended:
    (on.folder / "out.csv").symlink_to(on.victims / "notes.txt")
    ended = on.run("simulate", STRIDER, "stride", "--csv", "out.csv")
    gone = not (on.folder / "out.csv").is_symlink()
    return replace(ended, more="the link was replaced") if gone and not ended.more else ended


@attack(8, "`--csv` over a pipe")
def csv_over_a_pipe(on: Ground) -> Ended:
    os.mkfifo(on.folder / "out.csv")
    ended = on.run("simulate", STRIDER, "stride", "--csv", "out.csv")
    gone = not stat.S_ISFIFO((on.folder / "out.csv").stat().st_mode)
    return replace(ended, more="the pipe was replaced") if gone else ended


@attack(8, "`--csv` over a device")
def csv_over_a_device(on: Ground) -> Ended:
    device = on.device(on.folder / "out.csv", 3)
    ended = on.run("simulate", STRIDER, "stride", "--csv", "out.csv")
    gone = not stat.S_ISCHR(device.stat().st_mode)
    return replace(ended, more="**destroyed** the device") if gone else ended


def kept(on: Ground, path: Path, *words: object) -> Ended:
    """Run a command, and say so where it changed one of its own inputs."""
    before = path.read_bytes()
    ended = on.run(*words)
    return replace(ended, more="**destroyed** its own input") if path.read_bytes() != before else ended


@attack(8, "`--csv` over the gait that is simulated")
def csv_over_its_gait(on: Ground) -> Ended:
    gait = on.finished() / "best.toml"
    return kept(on, gait, "simulate", STRIDER, gait, "--csv", gait)


@attack(8, "`model --out` over the model of the problem")
def model_over_its_model(on: Ground) -> Ended:
    robot = on.robot()
    return kept(on, robot / "strider.xml", "model", robot, "--out", robot / "strider.xml")


@attack(8, "`command --out` over the problem file", ONE_LINE)
def command_over_its_problem(on: Ground) -> Ended:
    robot = on.robot()
    words = ("command", robot, "stride", "--dt", 0.1, "--duration", 1, "--out", robot / "problem.toml")
    return kept(on, robot / "problem.toml", *words)


@attack(8, "`--csv` over a file that only its owner may read", DONE)
def mode(on: Ground) -> Ended:
    (on.folder / "out.csv").touch(mode=0o600)
    ended = on.run("simulate", STRIDER, "stride", "--csv", "out.csv")
    found = stat.S_IMODE((on.folder / "out.csv").stat().st_mode)
    return ended if found == 0o600 else replace(ended, more=f"its mode became {found:o}: others may read it")
