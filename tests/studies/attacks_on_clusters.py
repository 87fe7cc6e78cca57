"""Attacks on users of a dask cluster (finding 7 of issue 28)."""

from __future__ import annotations

import random
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from threading import Thread

from attacked import (
    ATTACKS,
    DONE,
    SEARCH,
    STRIDER,
    Attack,
    Ended,
    Ground,
    attack,
    peer,
)
from cluster import address_in

_SETTLED_S = 1.0
"""What the worker had finished is in the journal this long after its death, s."""

# Finding 7: dask.


def on_cluster(on: Ground, address: str) -> Ended:
    return on.run("optimise", STRIDER, *SEARCH, "--out", "run", "--executor", address)


PEERS = {
    "says nothing": b"",
    "sends random bytes": random.Random(1).randbytes(4096),
    "is a web server": b"HTTP/1.1 400 Bad Request\r\n\r\n",
}
for _title, _said in PEERS.items():

    def talked(on: Ground, said: bytes = _said) -> Ended:
        with peer(said) as address:
            return on_cluster(on, address)

    ATTACKS.append(Attack(7, f"what answers at the address {_title}", talked))


@contextmanager
def cluster(on: Ground) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """The address of a scheduler of the attacked version, and its one worker."""
    file = on.folder / "scheduler.json"

    def started(module: str, *options: str) -> subprocess.Popen[bytes]:
        python = str(on.program.venv / "bin" / "python")
        command = [python, "-m", f"distributed.cli.{module}", "--scheduler-file", str(file), "--no-dashboard"]
        return subprocess.Popen(
            [*command, *options], cwd=on.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )

    running = [
        started("dask_scheduler", "--host", "127.0.0.1", "--port", "0"),
        started("dask_worker", "--no-nanny", "--nthreads", "1"),
    ]
    try:
        until = time.monotonic() + 60.0
        while (address := address_in(file)) is None:
            assert time.monotonic() < until, f"{file}: no scheduler began"
            time.sleep(0.1)
        yield f"dask://{address}", running[1]
    finally:
        for process in running:
            process.kill()
            process.wait()


@attack(0, "`optimise` on a cluster", DONE)
def honest(on: Ground) -> Ended:
    with cluster(on) as (address, _):
        return on_cluster(on, address)


@attack(7, "all workers of a cluster are killed during a search")
def workers_killed(on: Ground) -> Ended:
    with cluster(on) as (address, worker):
        return killed_in_a_search(on, address, worker)


def killed_in_a_search(on: Ground, address: str, worker: subprocess.Popen[bytes]) -> Ended:
    """Kill the worker as soon as the journal has a row; the search is a long one."""
    journal = on.folder / "run" / "evaluations.csv"
    rows_after: list[int] = []

    def rows() -> int:
        return journal.read_bytes().count(b"\n") if journal.exists() else 0

    def kill() -> None:
        until = time.monotonic() + on.program.limit_s
        while time.monotonic() < until and rows() < 2:
            time.sleep(0.05)
        worker.kill()
        time.sleep(_SETTLED_S)
        rows_after.append(rows())

    killer = Thread(target=kill, daemon=True)
    killer.start()
    words = ("--budget", 2000, *SEARCH[2:], "--out", "run", "--executor", address)
    ended = on.run("optimise", STRIDER, *words)
    killer.join()
    if ended.code is None and rows_after[0] < 2:
        return replace(ended, more="not tried: the search had not begun at the limit")
    if ended.code is None and rows() == rows_after[0]:
        return replace(ended, more="silence until the limit, and no gait more")
    return ended
