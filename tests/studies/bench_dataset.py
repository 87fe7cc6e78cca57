"""A data set for `gaitopt diagnose servo-bench DATASET` from recordings of a servo on a bench.

    python tests/studies/bench_dataset.py RECORDINGS --out DATASET [--kinds step-3deg,ramp] [--channel servo]

RECORDINGS is a folder of CSV tables, KIND-REPEAT.csv each, with the columns t_s, target_rad (held until the
next row; blank where the servo is unpowered) and angle_rad. Each table becomes a trial, and is its own log of
commands. The recordings are copied beside ``dataset.toml``.

Cost: a second.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Collection
from pathlib import Path

import tomli_w


def write_dataset(
    recordings: Path,
    out: Path,
    kinds: Collection[str] = (),
    channel: str = "servo",
    joint: str = "arm",
) -> list[str]:
    """Write the data set, and return the names of its trials.

    Args:
        recordings: the folder of the tables.
        out: a new folder.
        kinds: beginnings of the names of the recordings to take; all by default.
        channel: the actuator that was commanded.
        joint: the joint that was measured.
    """
    files = [
        path for path in sorted(recordings.glob("*.csv")) if not kinds or path.stem.startswith(tuple(kinds))
    ]
    if not files:
        raise SystemExit(f"{recordings}: no recordings of {', '.join(kinds) or 'any kind'}")
    out.mkdir(parents=True)
    trials = []
    for file in files:
        shutil.copyfile(file, out / file.name)
        trials.append(
            {
                "name": file.stem,
                "commands": file.name,
                "file": file.name,
                "channels": {channel: "target_rad"},
                "signals": {f"joint.{joint}": "angle_rad"},
            }
        )
    (out / "dataset.toml").write_text(tomli_w.dumps({"trial": trials}))
    return [file.stem for file in files]


def main() -> None:
    """Write a data set as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("recordings", type=Path, help="folder of the tables")
    parser.add_argument("--out", type=Path, required=True, help="a new folder")
    parser.add_argument("--kinds", default="", help="beginnings of names, with commas between them")
    parser.add_argument("--channel", default="servo", help="the actuator that was commanded")
    parser.add_argument("--joint", default="arm", help="the joint that was measured")
    options = parser.parse_args()
    kinds = tuple(filter(None, options.kinds.split(",")))
    names = write_dataset(options.recordings, options.out, kinds, options.channel, options.joint)
    print(f"{options.out}: {len(names)} trials")


if __name__ == "__main__":
    main()
