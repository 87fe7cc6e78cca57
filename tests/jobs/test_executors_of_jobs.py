"""Executors reach every job, and change no bit of it."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from benches import bench, write_bench
from cluster import running_cluster
from planting import dataset, recording_of, rollout

from gaitopt import blind_make, check, compare, diagnose, export, sweep
from gaitopt.core.errors import GaitoptError
from gaitopt.core.json import to_json
from gaitopt.jobs.diagnose import AUTO
from gaitopt.jobs.executor import opened
from gaitopt.optimise.executors import SerialExecutor
from gaitopt.problem.problem import Problem

Job = Callable[..., list[dict[str, object]]]


def content(folder: Path) -> dict[str, bytes]:
    """Every file of a folder."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def compared(problem: Problem, **options: object) -> list[dict[str, object]]:
    """Rows of a comparison."""
    return [row.to_dict() for row in compare(problem, ["stride", "square"], **options)]  # type: ignore[arg-type]


def swept(problem: Problem, **options: object) -> list[dict[str, object]]:
    """Rows of a sweep over a parameter of the model."""
    return [row.to_dict() for row in sweep(problem, over="mu_rear=0.3,0.9", **options).rows]  # type: ignore[arg-type]


def checked(problem: Problem, **options: object) -> list[dict[str, object]]:
    """Rows of an audit."""
    return [finding.to_dict() for finding in check(problem, **options)]  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("job", [compared, swept, checked])
def test_the_same_bits_on_every_executor(strider: Problem, job: Job) -> None:
    rows = to_json({"rows": job(strider, executor="serial")})
    assert rows.count("\n") > 3
    for executor in ("threads", "processes"):
        assert to_json({"rows": job(strider, executor=executor, workers=2)}) == rows, executor


@pytest.fixture(scope="module")
def dask(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The name of the executor of a dask cluster."""
    pytest.importorskip("distributed", reason="dask.distributed (the extra `cluster`) is not installed")
    with running_cluster(tmp_path_factory.mktemp("dask")) as address:
        yield f"dask://{address}"


@pytest.mark.slow
@pytest.mark.parametrize("job", [compared, swept, checked])
def test_the_same_bits_on_a_cluster(strider: Problem, job: Job, dask: str) -> None:
    assert to_json({"rows": job(strider, executor=dask)}) == to_json(
        {"rows": job(strider, executor="serial")}
    )


@pytest.mark.slow
def test_a_diagnosis_and_a_blind_case_on_a_cluster(quick: Problem, dask: str) -> None:
    options = {"seed": 2, "seconds": 2.2, "gaits": ["square-1s"], "kind": "outside"}
    blind_make(quick, 1, "cluster", executor=dask, **options)  # type: ignore[arg-type]
    blind_make(quick, 1, "here", executor="serial", **options)  # type: ignore[arg-type]
    assert content(Path("cluster")) == content(Path("here"))
    trials, few = Path("here") / "case-000", ["ground_slope"]
    runs = [diagnose(quick, trials, effects=few, next_gait=False, executor=e) for e in (dask, "serial")]
    assert to_json(runs[0].diagnosis.to_dict()) == to_json(runs[1].diagnosis.to_dict())


@pytest.mark.slow
def test_an_export_is_the_same_on_every_executor(quick: Problem) -> None:
    said = []
    for executor in ("serial", "processes"):
        exported = export(quick, "square-1s", "csv", executor, executor=executor)
        said.append(exported.to_dict() | {"files": [Path(f).name for f in exported.files]})
    assert said[0] == said[1]
    assert content(Path("serial")) == content(Path("processes"))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "only"), [("single", "servo_trim"), ("outside", None)])
def test_blind_cases_are_the_same_on_every_executor(quick: Problem, kind: str, only: str | None) -> None:
    for executor in ("serial", "processes"):
        made = blind_make(
            quick,
            1,
            executor,
            seed=2,
            seconds=2.2,
            gaits=["square-1s"],
            kind=kind,
            only=only,
            executor=executor,
        )
        assert made.kinds == (kind,)
    assert content(Path("serial")) == content(Path("processes"))


@pytest.mark.slow
def test_a_diagnosis_is_the_same_on_every_executor(quick: Problem) -> None:
    sloped = rollout(quick, "square-1s", 4.0, {"ground_slope": {"angle_rad": 0.08}})
    recording = recording_of(sloped, signals=("marker.x", "marker.z"))
    trials = dataset(Path("trials"), {"one": ("square-1s", recording)})
    found = []
    for executor in ("serial", "processes"):
        run = diagnose(quick, trials, effects=["ground_slope"], next_gait=False, executor=executor)
        found.append(to_json(run.diagnosis.to_dict()))
    assert found[0] == found[1]
    assert '"ground_slope"' in found[0]


@pytest.mark.slow
def test_a_diagnosis_of_logged_commands_is_the_same_on_every_executor(tmp_path: Path) -> None:
    arm = bench(tmp_path / "arm")
    trials = write_bench(tmp_path / "trials", arm.with_effects({"servo_stiction": {"torque_n_m": 0.03}}))
    few, found = ["servo_stiction", "servo_gain"], []
    for executor in ("serial", "processes"):
        run = diagnose(arm, trials, effects=few, next_gait=False, executor=executor)
        found.append(to_json(run.diagnosis.to_dict()))
    assert found[0] == found[1]
    assert '"servo_stiction"' in found[0]


def test_by_itself_a_diagnosis_of_logged_commands_uses_processes(
    quick: Problem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class ChosenError(Exception):
        """Ends a diagnosis where it would open its executor."""

    def opened(executor: object, _: int | None) -> None:
        raise ChosenError(executor)

    def chosen(problem: Problem, trials: Path, **options: Any) -> object:
        with pytest.raises(ChosenError) as found:
            diagnose(problem, trials, **options)
        return found.value.args[0]

    monkeypatch.setattr("gaitopt.jobs.diagnose.opened", opened)
    arm = bench(tmp_path / "arm")
    logs = write_bench(tmp_path / "logs", arm)
    walked = recording_of(rollout(quick, "square-1s", 3.0), signals=("marker.x",))
    films = dataset(tmp_path / "films", {"one": ("square-1s", walked)})
    assert chosen(arm, logs, executor=AUTO) == "processes"
    assert chosen(quick, films, executor=AUTO) == "threads"
    own = SerialExecutor()
    assert [chosen(arm, logs, executor=one) for one in ("serial", "threads", own)] == [
        "serial",
        "threads",
        own,
    ]
    assert chosen(arm, logs) == "threads"  # a script may not be importable by a process


def test_an_executor_that_is_given_stays_open(strider: Problem) -> None:
    with ThreadPoolExecutor(2) as pool:
        first = compared(strider, executor=pool)
        assert compared(strider, executor=pool) == first == compared(strider, executor=SerialExecutor())


def test_workers_are_not_for_an_executor_that_is_given() -> None:
    with (
        pytest.raises(GaitoptError, match="--workers: found 2; an executor that is given has its own"),
        opened(SerialExecutor(), 2),
    ):
        pass


def test_an_unknown_executor_is_one_line(strider: Problem) -> None:
    with pytest.raises(GaitoptError, match=r"--executor: found 'thread'; allowed: .*nearest: 'threads'"):
        compare(strider, ["stride"], executor="thread")
