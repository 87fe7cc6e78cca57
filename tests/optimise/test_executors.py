"""Executors: the same bits on every executor, and no work lost with a worker."""

import gc
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path

import pytest
from cluster import running_cluster
from helpers import ROBOTS, edited, problem_folder, same_numbers

from gaitopt.cli import app as cli
from gaitopt.core.errors import GaitoptError
from gaitopt.core.streams import Stream
from gaitopt.core.versions import versions_text
from gaitopt.gait.gait import Gait
from gaitopt.optimise.cluster import ClusterSettings, DaskExecutor
from gaitopt.optimise.evaluator import Evaluator, Outcome, assess
from gaitopt.optimise.executors import SerialExecutor, open_executor
from gaitopt.optimise.processes import ProcessExecutor
from gaitopt.optimise.quasi_random import quasi_random
from gaitopt.optimise.verification import scenarios_of
from gaitopt.problem.problem import Problem, load_problem
from gaitopt.simulation.setup import RobotSetup

TETRAHEDRON = b"v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\nv 0 0 0.01\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def end_once(marker: Path) -> int:
    """Kill the process that runs this, the first time."""
    if not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return os.getpid()


def end(_: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def setting(problem: Problem) -> RobotSetup:
    return RobotSetup.of(
        problem, scenarios_of(problem, 1, Stream.SEARCH_SCENARIOS), problem.simulation.working
    )


def gaits(problem: Problem, count: int = 6) -> list[Gait]:
    return [problem.space.decode(point) for point in quasi_random(problem.space, count, 1)]


def outcomes(problem: Problem, executor: Executor) -> list[Outcome]:
    rows = Evaluator(setting(problem), executor).outcomes(gaits(problem))
    return [outcome for row in rows for outcome in row]


def same(ones: list[Outcome], others: list[Outcome]) -> bool:
    return all(
        (one.status, one.simulated_s) == (other.status, other.simulated_s)
        and same_numbers(one.metrics, other.metrics)
        for one, other in zip(ones, others, strict=True)
    )


# --- problems travel as values ----------------------------------------------------------------


def meshed(folder: Path) -> Problem:
    """The strider with a mesh, its actuators in a file of their own."""
    problem_folder(folder, ROBOTS / "strider")
    (folder / "meshes").mkdir()
    (folder / "meshes" / "wedge.obj").write_bytes(TETRAHEDRON)
    mjcf = folder / "strider.xml"
    text = mjcf.read_text()
    begin, stop = text.index("<actuator>"), text.index("</actuator>") + len("</actuator>")
    (folder / "parts").write_text(f"<mujocoinclude>{text[begin:stop]}</mujocoinclude>")
    mesh = '<asset><mesh name="wedge" file="meshes/wedge.obj"/></asset>'
    mjcf.write_text(text[:begin] + '<include file="parts"/>' + mesh + text[stop:])
    edited(mjcf, "<worldbody>", '<worldbody><geom type="mesh" mesh="wedge" pos="5 5 5"/>')
    return load_problem(folder)


def test_a_setting_needs_no_file(tmp_path: Path) -> None:
    """No MJCF, include or mesh: a worker may be on a machine without these files."""
    problem = meshed(tmp_path / "robot")
    here = setting(problem)
    gait = gaits(problem)[0]
    expected = assess(here, gait, 0)
    shutil.rmtree(tmp_path / "robot")
    there = replace(here, key="on another machine")
    assert same([assess(there, gait, 0)], [expected])
    assert expected.status == "ok"


@pytest.mark.slow
def test_a_run_folder_holds_the_meshes(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """So a run can be resumed, and is a problem, after its original problem was deleted."""
    meshed(tmp_path / "robot")
    run = tmp_path / "run"
    arguments = ["--budget", "1", "--out", str(run), "--quiet"]
    assert cli.main(["optimise", str(tmp_path / "robot"), *arguments]) == 0
    shutil.rmtree(tmp_path / "robot")
    before = (run / "summary.json").read_bytes()
    assert cli.main(["simulate", str(run), str(run)]) == 0
    (run / "summary.json").unlink()
    assert cli.main(["optimise", str(run), "--resume", str(run), "--quiet"]) == 0
    clock = [line for line in before.splitlines() if b"wall_s" not in line]
    assert [x for x in (run / "summary.json").read_bytes().splitlines() if b"wall_s" not in x] == clock


def test_settings_are_equal_when_their_content_is(strider: Problem, tmp_path: Path) -> None:
    copy = load_problem(problem_folder(tmp_path / "copy", ROBOTS / "strider"))
    assert setting(copy).key == setting(strider).key
    assert setting(strider.with_parameters({"k_servo": 1.5})).key != setting(strider).key
    edited(tmp_path / "copy" / "strider.xml", "<worldbody>", '<worldbody><site name="other"/>')
    assert setting(copy).key != setting(strider).key


def test_a_worker_of_another_version_is_refused(strider: Problem) -> None:
    other = replace(setting(strider), key="other", versions="gaitopt 0.0.1")
    with pytest.raises(GaitoptError) as error:
        assess(other, gaits(strider)[0], 0)
    said = f"--executor: found a worker with {versions_text()}; allowed: gaitopt 0.0.1, as here"
    assert str(error.value) == said


# --- processes --------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_killed_process_is_replaced_and_its_work_redone(strider: Problem, tmp_path: Path) -> None:
    expected = outcomes(strider, SerialExecutor())
    with open_executor("processes", 2) as executor:
        first = executor.submit(os.getpid).result()
        killing = executor.submit(end_once, tmp_path / "killed")
        assert same(outcomes(strider, executor), expected)
        assert killing.result() not in (first, os.getpid())


@pytest.mark.slow
def test_a_call_that_kills_every_process_is_one_line() -> None:
    with open_executor("processes", 1) as executor, pytest.raises(GaitoptError) as error:
        executor.submit(end, 0).result()
    assert str(error.value) == (
        "--executor processes: 5 worker processes in a row were killed; is memory short?"
    )


def test_worker_processes_end_with_a_killed_parent(tmp_path: Path) -> None:
    script = (
        "import os, time\n"
        "from gaitopt.optimise.executors import open_executor\n"
        "if __name__ == '__main__':\n"
        "    print(open_executor('processes', 1).submit(os.getpid).result(), flush=True)\n"
        "    time.sleep(60)\n"
    )
    (tmp_path / "parent.py").write_text(script)
    with subprocess.Popen([sys.executable, tmp_path / "parent.py"], stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline())
        parent.kill()
    assert gone(worker)


def gone(process: int, limit_s: float = 10.0) -> bool:
    """Whether a process ends within the limit; one that only waits to be reaped has ended."""
    until = time.monotonic() + limit_s
    while time.monotonic() < until:
        try:
            os.kill(process, 0)
            state = Path(f"/proc/{process}/stat")
            if state.exists() and state.read_text().rsplit(")", 1)[1].split()[0] == "Z":
                return True
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


def test_a_pool_shuts_down_what_it_opened() -> None:
    executor = open_executor("processes", 1)
    assert isinstance(executor, ProcessExecutor)
    worker = executor.submit(os.getpid).result()
    executor.shutdown()
    assert gone(worker)
    with pytest.raises(RuntimeError):
        executor.submit(os.getpid)


# --- a cluster --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a dask scheduler with two workers."""
    pytest.importorskip("distributed", reason="dask.distributed (the extra `cluster`) is not installed")
    with running_cluster(tmp_path_factory.mktemp("dask")) as address:
        yield address


@pytest.mark.slow
def test_a_cluster_gives_the_same_bits_though_a_worker_is_killed(
    strider: Problem, scheduler: str, tmp_path: Path
) -> None:
    expected = outcomes(strider, SerialExecutor())
    with open_executor(f"dask://{scheduler}") as executor:
        assert same(outcomes(strider, executor), expected)
        killing = executor.submit(end_once, tmp_path / "killed")
        assert same(outcomes(strider, executor), expected)
        assert killing.result() != os.getpid()


@pytest.mark.slow
def test_optimise_on_a_cluster(scheduler: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    arguments = ["optimise", str(ROBOTS / "strider"), "--budget", "6", "--quiet", "--out"]
    for name, executor in (("cluster", f"dask://{scheduler}"), ("here", "serial")):
        assert cli.main([*arguments, str(tmp_path / name), "--executor", executor]) == 0
    for name in ("evaluations.csv", "best.toml"):
        assert (tmp_path / "cluster" / name).read_bytes() == (tmp_path / "here" / name).read_bytes()


def _clients() -> int:
    return sum(type(known).__module__ == "distributed.client" for known in gc.get_objects())


def test_a_cluster_that_is_not_there_is_one_line(scheduler: str) -> None:
    gc.collect()
    before = _clients()
    for address in ("127.0.0.1:1", "nonsense", "127.0.0.1:port"):
        with pytest.raises(GaitoptError) as error:
            DaskExecutor(address, ClusterSettings(answer_s=0.3))
        assert str(error.value) == f"--executor: no dask scheduler answers at dask://{address}"
        assert _clients() == before  # one left over would lock a later start
    with pytest.raises(GaitoptError, match=r"--workers: found 2; dask:// works with the workers it has"):
        open_executor(f"dask://{scheduler}", 2)


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(GaitoptError) as error:
        open_executor("dask://127.0.0.1:8786")
    assert str(error.value) == (
        "--executor: dask:// needs dask.distributed; install gaitopt with its extra: gaitopt[cluster]"
    )
