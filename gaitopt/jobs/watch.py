"""The job `watch`: a run that goes on, in a browser on this machine, until it ends."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socketserver import TCPServer

from gaitopt.core.errors import GaitoptError, bad_value
from gaitopt.core.files import read_bytes, read_toml
from gaitopt.core.own_files import check_own
from gaitopt.report.live import EVERY_S, LIVE_POLICY, LiveFigures, Watched, live_page
from gaitopt.runs.folder import PAGE_FILE, REQUEST_FILE
from gaitopt.runs.listing import FINISHED, INTERRUPTED, RUNNING, ListedRun, list_runs
from gaitopt.runs.lock import is_held
from gaitopt.runs.run_folder import SUMMARY_FILE

_LOOPBACK = "127.0.0.1"

_AGAIN_S = 1.0
"""Seconds after which it is looked again whether the run goes on."""

_LAST_LOOK_S = 3.0 * EVERY_S
"""Seconds after the end of the run in which open pages still learn of it."""


def watch(
    folder: Path | str, *, port: int = 0, on_address: Callable[[str], object] = lambda address: None
) -> ListedRun:
    """Show a run in a browser until it ends. Nobody but this machine can reach the page.

    Args:
        folder: the run folder of a search that is running.
        port: port of the page; 0 for any free one.
        on_address: called with the address of the page when it can be opened.

    Returns:
        The run as it ended.

    Raises:
        GaitoptError: no search is running there, or the port is not free.
    """
    run = _running(Path(folder))

    def state() -> str:
        if is_held(run.folder):
            return RUNNING
        return FINISHED if (run.folder / SUMMARY_FILE).is_file() else INTERRUPTED

    with _served(run, state, port) as address:
        on_address(address)
        while state() == RUNNING:
            time.sleep(_AGAIN_S)
        time.sleep(_LAST_LOOK_S)
    (listed,) = list_runs([run.folder])
    return listed


def _running(folder: Path) -> Watched:
    """Return the search that is running in a folder.

    Raises:
        GaitoptError: there is none.
    """
    if not check_own(folder / REQUEST_FILE):
        raise GaitoptError(f"{folder}: no run of optimise (no {REQUEST_FILE})")
    if not is_held(folder):
        done = (folder / SUMMARY_FILE).is_file()
        what = (
            f"the run is finished; see {folder / PAGE_FILE}" if done else "the run was stopped; --resume it"
        )
        raise GaitoptError(f"{folder}: nothing to watch: {what}")
    (listed,) = list_runs([folder])
    asked = read_toml(folder / REQUEST_FILE)
    for key in ("budget", "seed"):
        if not isinstance(asked.get(key), int):
            raise bad_value(folder / REQUEST_FILE, key, asked.get(key), "a whole number")
    return Watched(folder, listed.problem, asked["budget"], asked["seed"])


class _Server(ThreadingHTTPServer):
    """Serves one run on this machine."""

    daemon_threads = True
    allow_reuse_address = False

    def __init__(self, run: Watched, state: Callable[[], str], port: int):
        self.page = live_page(run).encode()
        self.figures = LiveFigures(run, state)
        self.state = state
        self.report = run.folder / PAGE_FILE
        self.one_at_a_time = threading.Lock()
        super().__init__((_LOOPBACK, port), _Handler)

    def server_bind(self) -> None:
        """Bind, without asking for the name of the machine."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = _LOOPBACK, int(self.server_address[1])

    def handle_error(self, request: object, client_address: object) -> None:
        """Say nothing of a browser that has gone."""

    def content(self, path: str) -> tuple[str, bytes, str] | None:
        """Return type, content and policy of a page; None where there is none."""
        if path == "/":
            return "text/html; charset=utf-8", self.page, LIVE_POLICY
        with self.one_at_a_time:
            if path == "/state.json":
                return "application/json", self.figures.json(), LIVE_POLICY
            if path == f"/{PAGE_FILE}" and self.state() == FINISHED and check_own(self.report):
                return "text/html; charset=utf-8", read_bytes(self.report), ""
        return None


class _Handler(BaseHTTPRequestHandler):
    """Answers what a browser on this machine asks under the address that was printed."""

    server: _Server
    timeout = 10.0
    server_version = "gaitopt"
    sys_version = ""

    def do_GET(self) -> None:
        """Answer."""
        port = self.server.server_port
        if self.headers.get("Host") not in (f"{_LOOPBACK}:{port}", f"localhost:{port}"):
            self.send_error(421)  # another name that leads here: a page of a stranger may be behind it
            return
        try:
            found = self.server.content(self.path)
        except GaitoptError:
            found = None
        if found is None:
            self.send_error(404)
            return
        kind, content, policy = found
        self.send_response(200)
        headers = {
            "Content-Type": kind,
            "Content-Length": str(len(content)),
            "Cache-Control": "no-store",
            "X-Content-Type-Options": "nosniff",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Referrer-Policy": "no-referrer",
        }
        for name, value in (headers | ({"Content-Security-Policy": policy} if policy else {})).items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        """Print nothing."""


@contextmanager
def _served(run: Watched, state: Callable[[], str], port: int) -> Iterator[str]:
    """Serve a run on this machine, and yield the address of its page.

    Raises:
        GaitoptError: the port is not free, or no port.
    """
    if not 0 <= port <= 65535:
        raise GaitoptError(f"--port: found {port}; allowed: 0 to 65535")
    try:
        server = _Server(run, state, port)
    except OSError as error:
        raise GaitoptError(f"--port: {port}: {error.strerror}") from None
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://{_LOOPBACK}:{server.server_port}/"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
