"""A dask cluster on this machine, for the tests of executors."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

Process = subprocess.Popen[bytes]

ROOT = Path(__file__).parents[1]
HERE = (ROOT, ROOT / "tests", ROOT / "tests" / "optimise")
"""Where its workers find the package, the helpers and the calls that tests send."""


def start_cluster(folder: Path, nanny: bool = True, workers: int = 2) -> tuple[str, list[Process]]:
    """Start a dask scheduler on loopback and its workers, each its own process.

    Args:
        folder: where their files go.
        nanny: whether a worker that dies is started again.
        workers: how many.

    Returns:
        The address, and the processes, the scheduler's first.
    """
    file = folder / "scheduler.json"
    begin = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
    work = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", str(file)]
    work += ["--nworkers", "1"] if nanny else ["--no-nanny"]
    commands = [
        [*begin, "--scheduler-file", str(file), "--no-dashboard"],
        *[[*work, "--nthreads", "1", "--no-dashboard"]] * workers,
    ]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, HERE))}
    with (folder / "log").open("w") as log:
        running = [subprocess.Popen(c, cwd=folder, stdout=log, stderr=log, env=environment) for c in commands]
    try:
        until = time.monotonic() + 30.0
        while (address := address_in(file)) is None:
            assert time.monotonic() < until, (folder / "log").read_text()
            time.sleep(0.05)
    except BaseException:
        for process in running:
            process.kill()
            process.wait()
        raise
    return address, running


def address_in(file: Path) -> str | None:
    """The address in a scheduler's file; none before it is there and whole: dask writes it in place."""
    try:
        return json.loads(file.read_text())["address"].removeprefix("tcp://")
    except (FileNotFoundError, json.JSONDecodeError):
        return None


@contextmanager
def running_cluster(folder: Path) -> Iterator[str]:
    """The address of a dask scheduler with two workers; it is ended as a user would."""
    address, running = start_cluster(folder)
    try:
        yield address
    finally:
        for process in reversed(running):
            process.send_signal(signal.SIGINT)
        for process in running:
            end(process)


def end(process: Process) -> None:
    """Wait for a process that was interrupted; one that was still starting may have missed it."""
    try:
        process.wait(10.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait(10.0)
