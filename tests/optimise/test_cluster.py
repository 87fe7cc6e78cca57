"""An address without a cluster, a silent cluster, or one that loses its workers: one line, in time."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from cluster import start_cluster
from helpers import ROBOTS

from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.optimise.cluster import ClusterSettings, DaskExecutor
from gaitopt.optimise.executors import open_executor

pytest.importorskip("distributed", reason="dask.distributed (the extra `cluster`) is not installed")

GREETING = (
    b":\0\0\0\0\0\0\0\1\0\0\0\0\0\0\0*\0\0\0\0\0\0\0"
    b"\x83\xabcompression\xc0\xa6python\x93\x03\x0b\x07\xafpickle-protocol\x05"
)
"""What a scheduler of dask 2026.8 sends first."""


@contextmanager
def serving(answer: Callable[[socket.socket, int], object]) -> Iterator[str]:
    """Serve on loopback: `answer` has each connection and its number; none is closed before the end."""
    listening = socket.create_server(("127.0.0.1", 0))
    connections: list[socket.socket] = []

    def accept() -> None:
        while True:
            try:
                connection, _ = listening.accept()
            except OSError:
                return
            connections.append(connection)
            number = len(connections)
            threading.Thread(target=answering, args=(connection, number), daemon=True).start()

    def answering(connection: socket.socket, number: int) -> None:
        try:
            answer(connection, number)
        except OSError:  # the other side has gone
            return

    threading.Thread(target=accept, daemon=True).start()
    try:
        yield f"127.0.0.1:{listening.getsockname()[1]}"
    finally:
        for connection in (listening, *connections):
            connection.close()


def dripped(connection: socket.socket, _: int) -> None:
    """Send a long message, a byte at a time."""
    connection.sendall(b"\0\xff\0\0\0\0\0\0")
    while True:
        connection.sendall(b"x")
        time.sleep(0.1)


def once_polite(connection: socket.socket, number: int) -> None:
    """Greet as a scheduler the first time, and say nothing later."""
    if number == 1:
        connection.sendall(GREETING)


def random_later(connection: socket.socket, number: int) -> None:
    """Greet as a scheduler the first time, and send random bytes later."""
    if number == 1:
        connection.sendall(GREETING)
    else:
        connection.sendall(np.random.default_rng(number).bytes(4096))


SILENT = {
    "silence": lambda connection, number: None,
    "drops of a long message": dripped,
    "the end of the connection": lambda connection, number: connection.close(),
    "a greeting once, then silence": once_polite,
    "a greeting once, then random bytes": random_later,
}


@pytest.mark.parametrize("kind", SILENT)
def test_a_peer_that_does_not_answer_is_one_line_in_time(kind: str) -> None:
    with serving(SILENT[kind]) as address, pytest.raises(GaitoptError) as error:
        DaskExecutor(address, ClusterSettings(answer_s=1.0))
    assert str(error.value) == f"--executor: no dask scheduler answers at dask://{address}"


STRANGE = {
    "random bytes": np.random.default_rng(1).bytes(4096),
    "a length of 8 EiB": b"\xff\xff\xff\xff\xff\xff\xff\x7f",
    "a length of 100 GB": (100 * 10**9).to_bytes(8, "little") + b"x" * 100,
    "HTTP": b"HTTP/1.1 400 Bad Request\r\n\r\n",
    "SSH": b"SSH-2.0-OpenSSH_9.6\r\n",
    "an empty message": bytes(8),
    "a message of something else": b"\4\0\0\0\0\0\0\0\x80\x04N.",
}


@pytest.mark.parametrize("kind", STRANGE)
def test_a_peer_that_is_no_scheduler_is_one_line(kind: str, capfd: pytest.CaptureFixture[str]) -> None:
    with serving(lambda connection, _: connection.sendall(STRANGE[kind])) as address:
        arguments = ["compare", "arcfold", "square-1s", "--executor", f"dask://{address}"]
        assert cli.main(arguments) == 1
    assert capfd.readouterr() == (
        "",
        f"gaitopt: --executor: what answers at dask://{address} is no dask scheduler\n",
    )


@pytest.mark.slow
def test_a_silent_peer_costs_ten_seconds_and_no_more() -> None:
    """By default; and the process can end, because nothing left over blocks it."""
    with serving(SILENT["silence"]) as address:
        program = "from gaitopt.cli import main; raise SystemExit(main())"
        arguments = ["compare", "arcfold", "square-1s", "--executor", f"dask://{address}"]
        done = subprocess.run(
            [sys.executable, "-c", program, *arguments], capture_output=True, text=True, timeout=60.0
        )
    line = f"gaitopt: --executor: no dask scheduler answers at dask://{address}\n"
    assert (done.returncode, done.stdout, done.stderr) == (1, "", line)


def test_help_says_that_an_address_must_be_trusted(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["optimise", "--help"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "dask://HOST:PORT, an address that you trust: what answers there can run code here" in text


# --- workers that are lost --------------------------------------------------------------------


@contextmanager
def cluster(folder: Path, workers: int = 2) -> Iterator[tuple[str, list[int]]]:
    """A scheduler and workers that are not restarted: its address, the workers' process ids."""
    address, running = start_cluster(folder, nanny=False, workers=workers)
    try:
        yield address, [process.pid for process in running]
    finally:
        for process in running:
            process.send_signal(signal.SIGCONT)
            process.kill()
        for process in running:
            process.wait(20.0)


def slept(seconds: float) -> int:
    time.sleep(seconds)
    return os.getpid()


@pytest.mark.slow
def test_when_every_worker_is_killed_calls_end_in_one_line(tmp_path: Path) -> None:
    settings = ClusterSettings(no_worker_s=3.0)
    with cluster(tmp_path) as (address, (_, *workers)), DaskExecutor(address, settings) as executor:
        while len(executor._client.scheduler_info()["workers"]) < 2:
            time.sleep(0.1)
        calls = [executor.submit(slept, 60.0 + n) for n in range(5)]
        for worker in workers:
            os.kill(worker, signal.SIGKILL)
        line = f"--executor: no worker is left at dask://{address} since 3 s"
        for call in calls:
            with pytest.raises(GaitoptError, match=line):
                call.result(60.0)
        with pytest.raises(GaitoptError, match=line):
            executor.submit(slept, 0.0).result(60.0)


@pytest.mark.slow
def test_a_search_whose_workers_are_killed_ends_in_one_line_and_keeps_its_gaits(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    rows = out / "evaluations.csv"
    with cluster(tmp_path) as (address, (_, *workers)):

        def kill() -> None:
            while not rows.exists() or rows.read_bytes().count(b"\n") < 8:
                time.sleep(0.02)
            for worker in workers:
                os.kill(worker, signal.SIGKILL)

        threading.Thread(target=kill, daemon=True).start()
        arguments = ["optimise", str(ROBOTS / "strider"), "--budget", "400", "--no-warm-start", "--quiet"]
        code = cli.main([*arguments, "--out", str(out), "--executor", f"dask://{address}"])
    said = f"gaitopt: --executor: no worker is left at dask://{address} since 10 s\n"
    assert (code, capfd.readouterr().err) == (1, said)
    assert 7 <= rows.read_bytes().count(b"\n") - 1 < 400


@pytest.mark.slow
def test_a_scheduler_that_is_killed_ends_every_call_in_one_line(tmp_path: Path) -> None:
    with cluster(tmp_path, 1) as (address, (scheduler, *_)), DaskExecutor(address) as executor:
        calls = [executor.submit(slept, 60.0 + n) for n in range(3)]
        time.sleep(0.5)
        os.kill(scheduler, signal.SIGKILL)
        for call in calls:
            with pytest.raises(GaitoptError, match="--executor: the connection to its workers was lost"):
                call.result(60.0)
        with pytest.raises(GaitoptError, match="--executor: the connection to its workers was lost"):
            executor.submit(slept, 0.0).result(60.0)


@pytest.mark.slow
def test_a_scheduler_that_is_halted_is_one_line(tmp_path: Path) -> None:
    settings = ClusterSettings(look_s=0.2, no_answer_s=3.0)
    with cluster(tmp_path, 1) as (address, (scheduler, *_)), DaskExecutor(address, settings) as executor:
        call = executor.submit(slept, 60.0)
        os.kill(scheduler, signal.SIGSTOP)
        with pytest.raises(GaitoptError, match="--executor: the connection to its workers was lost"):
            call.result(60.0)
        os.kill(scheduler, signal.SIGCONT)


def test_no_workers_from_the_start_is_one_line(tmp_path: Path) -> None:
    with cluster(tmp_path, 0) as (address, _):
        with pytest.raises(GaitoptError) as error:
            DaskExecutor(address, ClusterSettings(answer_s=1.0))
        assert str(error.value) == f"--executor: the dask scheduler at dask://{address} has no workers"
        with pytest.raises(GaitoptError, match="works with the workers it has"):
            open_executor(f"dask://{address}", 2)
