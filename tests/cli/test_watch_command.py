"""`gaitopt watch`: a run that goes on, on this machine alone, until it ends."""

import http.client
import json
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from browser import Tab, browser_tab, needs_browser
from commandline import Run, refused
from edited_runs import as_if_killed
from helpers import STRIDER

from gaitopt import watch
from gaitopt.jobs import watch as job
from gaitopt.runs.evaluations import JournalReader, read_evaluations
from gaitopt.runs.listing import ListedRun
from gaitopt.runs.lock import FolderLock, is_held


@dataclass
class Watching:
    """A run that is watched: its folder, its lock, the address, and how it ended."""

    folder: Path
    lock: FolderLock
    port: int
    thread: threading.Thread
    ended: list[ListedRun]

    def answer(self, path: str, host: str = "") -> tuple[int, bytes]:
        """What a browser gets, under the address or under another name."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        connection.putrequest("GET", path, skip_host=True)
        connection.putheader("Host", host or f"127.0.0.1:{self.port}")
        connection.endheaders()
        response = connection.getresponse()
        status, content = response.status, response.read()
        connection.close()
        return status, content

    def state(self) -> dict[str, object]:
        """The figures of the page."""
        status, content = self.answer("/state.json")
        assert status == 200
        found: dict[str, object] = json.loads(content)
        return found

    def finish(self, finished: Path) -> None:
        """Let the run end as it did."""
        for name in ("evaluations.csv", "best.toml", "report.html", "summary.json"):
            shutil.copy(finished / name, self.folder / name)
        self.lock.release()


@pytest.fixture
def watching(finished: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Watching]:
    """A run that has evaluated three gaits and is watched."""
    monkeypatch.setattr(job, "_LAST_LOOK_S", 2.5)
    monkeypatch.setattr(job, "_AGAIN_S", 0.1)
    shutil.copytree(finished, "run")
    folder = as_if_killed(Path("run").resolve())
    lock = FolderLock(folder)
    lock.take()
    addresses: list[str] = []
    known = threading.Event()
    ended: list[ListedRun] = []

    def announce(address: str) -> None:
        addresses.append(address)
        known.set()

    thread = threading.Thread(target=lambda: ended.append(watch(folder, on_address=announce)))
    thread.start()
    assert known.wait(20.0)
    yield Watching(folder, lock, int(addresses[0].split(":")[2].strip("/")), thread, ended)
    monkeypatch.setattr(job, "_LAST_LOOK_S", 0.1)
    lock.release()
    thread.join(20.0)
    assert not thread.is_alive()


def test_the_figures_are_those_of_the_journal(watching: Watching, finished: Path) -> None:
    done = read_evaluations(watching.folder)
    state = watching.state()
    assert (state["state"], state["budget"], state["evaluations"]) == ("running", 12, 3)
    gaits = state["gaits"]
    assert isinstance(gaits, list)
    assert [gait["gait"] for gait in gaits] == [1, 2, 3]
    assert [gait["speed_mm_s"] for gait in gaits] == pytest.approx(1e3 * done.speed_m_s, abs=1e-3)
    shutil.copy(finished / "evaluations.csv", watching.folder / "evaluations.csv")
    assert watching.state()["evaluations"] == 12


def test_only_the_page_of_the_run_is_served(watching: Watching) -> None:
    assert b"a search that goes on" in watching.answer("/")[1]
    for path in (
        "/run.toml",
        "/evaluations.csv",
        "/report.html",
        "/../run/best.toml",
        "/%2e%2e/run/run.toml",
        "//etc/passwd",
        "/etc/passwd",
        "/state.json?x",
        "/.lock",
    ):
        assert watching.answer(path)[0] == 404, path
    assert watching.answer("/", host="a-strangers-page.example")[0] == 421
    assert watching.answer("/", host=f"localhost:{watching.port}")[0] == 200


def test_no_other_machine_reaches_it(watching: Watching) -> None:
    others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    for address in sorted(others - {"127.0.0.1"}):
        with pytest.raises(OSError, match="refused"):
            socket.create_connection((address, watching.port), timeout=5.0)


def test_a_page_can_do_nothing_but_ask_for_its_figures(watching: Watching) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", watching.port, timeout=20)
    connection.request("GET", "/")
    response = connection.getresponse()
    assert "default-src 'none'" in (response.getheader("Content-Security-Policy") or "")
    response.read()
    connection.request("POST", "/", b"x")
    assert connection.getresponse().status == 501
    connection.close()


def test_watching_ends_with_the_run_and_leads_to_its_report(watching: Watching, finished: Path) -> None:
    watching.finish(finished)
    assert watching.state()["state"] == "finished"
    assert watching.answer("/report.html") == (200, (finished / "report.html").read_bytes())
    watching.thread.join(20.0)
    assert [run.state for run in watching.ended] == ["finished"]
    assert not is_held(watching.folder)


def test_watching_ends_with_a_run_that_stops(watching: Watching) -> None:
    watching.lock.release()
    watching.thread.join(20.0)
    assert [run.state for run in watching.ended] == ["interrupted"]


@needs_browser
def test_the_page_shows_the_gaits_and_becomes_the_report(watching: Watching, finished: Path) -> None:
    with browser_tab() as tab:
        for width in (1280, 390):
            tab.call(
                "Emulation.setDeviceMetricsOverride",
                width=width,
                height=900,
                deviceScaleFactor=1,
                mobile=False,
            )
            opened(tab, f"http://127.0.0.1:{watching.port}/")
            waited(tab, "document.querySelectorAll('circle').length === 3")
            assert tab.value("document.documentElement.scrollWidth") <= width
            assert "3 of 12" in tab.value("document.body.innerText")
        watching.finish(finished)
        waited(tab, "location.pathname === '/report.html' && document.readyState === 'complete'")
        assert tab.messages == []


def opened(tab: Tab, address: str) -> None:
    """Open an address."""
    for domain in ("Page", "Runtime", "Log"):
        tab.call(f"{domain}.enable")
    tab.call("Page.navigate", url=address)


def waited(tab: Tab, script: str) -> None:
    """Wait until an expression is true; a page that is left meanwhile is asked again."""
    for _ in range(100):
        try:
            if tab.value(script):
                return
            tab.value("new Promise((done) => setTimeout(done, 100))")
        except AssertionError:  # the page was left
            continue
    raise AssertionError(script)


def test_what_cannot_be_watched_is_one_line(gaitopt: Run, finished: Path) -> None:
    shutil.copytree(finished, "finished-run")
    shutil.copytree(finished, "killed")
    as_if_killed(Path("killed"))
    Path("empty").mkdir()
    assert refused(gaitopt, "watch", "nowhere") == "nowhere: no run of optimise (no run.toml)"
    assert refused(gaitopt, "watch", "empty") == "empty: no run of optimise (no run.toml)"
    line = "finished-run: nothing to watch: the run is finished; see finished-run/report.html"
    assert refused(gaitopt, "watch", "finished-run") == line
    assert "the run was stopped" in refused(gaitopt, "watch", "killed")


def test_a_port_that_cannot_be_had_is_one_line(watching: Watching, gaitopt: Run) -> None:
    assert refused(gaitopt, "watch", watching.folder, "--port", watching.port).startswith("--port: ")
    assert refused(gaitopt, "watch", watching.folder, "--port", "70000").startswith("--port: found 70000")


def test_a_journal_is_read_on_from_where_it_ended(finished: Path) -> None:
    lines = (finished / "evaluations.csv").read_bytes().splitlines(keepends=True)
    Path("run").mkdir()
    journal = Path("run/evaluations.csv")
    reader = JournalReader(Path("run"))
    seen = []
    for end in (0, 1, 3, 8, len(lines)):
        torn = lines[end][:20] if end < len(lines) else b""
        journal.write_bytes(b"".join(lines[:end]) + torn)
        seen.append(len(reader.read()))
    assert seen == [0, 0, 2, 7, 12]
    whole_at_once = read_evaluations(finished)
    assert reader.read().cost.tolist() == whole_at_once.cost.tolist()
    journal.write_bytes(b"".join(lines[:4]))  # begun anew
    assert len(reader.read()) == 3


@pytest.mark.slow
def test_a_search_is_watched_from_its_first_seconds_to_its_end() -> None:
    program = "import sys; from gaitopt.cli import main; sys.exit(main())"
    search = [
        sys.executable,
        "-c",
        program,
        "optimise",
        str(STRIDER),
        "--budget",
        "120",
        "--out",
        "run",
        "--quiet",
    ]
    with subprocess.Popen(search, stdout=subprocess.DEVNULL) as searching:
        while not (Path("run/run.toml").is_file() and is_held(Path("run"))):
            assert searching.poll() is None
        watcher = [sys.executable, "-c", program, "watch", "run"]
        done = subprocess.run(watcher, capture_output=True, text=True, check=True)
        assert searching.wait(60) == 0
    assert "http://127.0.0.1:" in done.stdout
    assert "finished" in done.stdout
    assert done.stderr == ""
