"""A headless Chromium that tests drive through its own protocol, without any package."""

from __future__ import annotations

import base64
import io
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no browser: apt install chromium")

SOFTWARE_WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
WITHOUT_WEBGL = ("--disable-gpu", "--disable-3d-apis")


class Tab:
    """A page that is open.

    Attributes:
        messages: what its console and its errors said.
    """

    def __init__(self, send: Any, receive: Any, session: str):
        self._send, self._receive, self._session, self._number = send, receive, session, 0
        self.messages: list[str] = []

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """What a method of the protocol answers."""
        self._number += 1
        self._send({"id": self._number, "sessionId": self._session, "method": method, "params": parameters})
        while (message := self._receive()).get("id") != self._number:
            self._noted(message)
        assert "error" not in message, message["error"]
        answer: dict[str, Any] = message["result"]
        return answer

    def _noted(self, message: Mapping[str, Any]) -> None:
        said = message.get("params", {})
        if message.get("method") == "Runtime.exceptionThrown":
            self.messages.append(str(said["exceptionDetails"].get("exception", said).get("description")))
        if message.get("method") == "Log.entryAdded" and said["entry"]["level"] == "error":
            self.messages.append(said["entry"]["text"])
        if message.get("method") == "Runtime.consoleAPICalled" and said["type"] in ("error", "warning"):
            self.messages.append(str([one.get("value") for one in said["args"]]))

    def value(self, script: str) -> Any:
        """The value of a JavaScript expression; promises are awaited."""
        answer = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def opened(self, path: Path, width: int = 1280, height: int = 900, **media: str) -> Tab:
        """Open a file at a size, with media features such as ``prefers_color_scheme="dark"``."""
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        features = [{"name": name.replace("_", "-"), "value": value} for name, value in media.items()]
        self.call("Emulation.setEmulatedMedia", features=features)
        self.call("Page.navigate", url=path.resolve().as_uri())
        loaded = "document.readyState === 'complete' ? done() : addEventListener('load', done)"
        self.value(f"new Promise(done => {loaded})")
        self.settled()
        return self

    def settled(self) -> None:
        """Wait for what was asked to be drawn."""
        self.value("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done())))")

    def screenshot(self, whole: bool = False) -> Image.Image:
        """The window, or the whole page."""
        answer = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        return Image.open(io.BytesIO(base64.b64decode(answer["data"])))


@contextmanager
def browser_tab(*options: str) -> Generator[Tab]:
    """A tab of a browser of its own, which is closed afterwards."""
    assert CHROMIUM is not None
    to_browser, from_browser = os.pipe(), os.pipe()

    def ends() -> None:  # in the browser, which expects the pipes as 3 and 4
        reads, writes = os.dup(to_browser[0]), os.dup(from_browser[1])
        os.dup2(reads, 3)
        os.dup2(writes, 4)

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [CHROMIUM, "--headless=new", "--no-sandbox", "--remote-debugging-pipe", *options]
        command += [
            f"--user-data-dir={profile}",
            "--no-first-run",
            "--disable-dev-shm-usage",
            "--hide-scrollbars",
        ]
        process = subprocess.Popen(
            [*command, "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            preexec_fn=ends,
            close_fds=False,
        )
        os.close(to_browser[0])
        os.close(from_browser[1])
        answers = os.fdopen(from_browser[0], "rb")
        waiting = bytearray()

        def send(message: Mapping[str, Any]) -> None:
            os.write(to_browser[1], json.dumps(message).encode() + b"\0")

        def receive() -> dict[str, Any]:
            while b"\0" not in waiting:
                more = answers.read1(1 << 20)
                assert more, "the browser ended"
                waiting.extend(more)
            text, _, rest = bytes(waiting).partition(b"\0")
            waiting[:] = rest
            answer: dict[str, Any] = json.loads(text)
            return answer

        def asked(number: int, method: str, **parameters: Any) -> dict[str, Any]:
            send({"id": number, "method": method, "params": parameters})
            while (message := receive()).get("id") != number:
                pass
            answer: dict[str, Any] = message["result"]
            return answer

        try:
            target = asked(1000001, "Target.createTarget", url="about:blank")["targetId"]
            session = asked(1000002, "Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
            yield Tab(send, receive, session)
            send({"id": 1000003, "method": "Browser.close"})
            process.wait(20)
        finally:
            process.kill()
            process.wait()
            os.close(to_browser[1])
            answers.close()
