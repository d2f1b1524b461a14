"""A browser without a window, driven by its own protocol over two pipes."""

from __future__ import annotations

import base64
import contextlib
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-extensions",
    "--disable-default-apps",
    "--hide-scrollbars",
    "--remote-debugging-pipe",
)
#: The protocol reads from 3 and writes to 4.
LAUNCH = """
import os, sys
spare = [os.open(os.devnull, os.O_RDONLY) for _ in range(5)]  # so that copies lie above 4
read, write = (os.dup(int(number)) for number in sys.argv[1:3])
os.dup2(read, 3)
os.dup2(write, 4)
os.execv(sys.argv[3], sys.argv[3:])
"""


def installed() -> str | None:
    """The browser of this machine; `PHASEKIT_BROWSER` names another. None is ever downloaded."""
    names = (os.environ.get("PHASEKIT_BROWSER") or "", *NAMES)
    return next((found for name in names if name and (found := shutil.which(name))), None)


class Browser:
    """One page of a browser: what it is told, and all that it said."""

    def __init__(self, program: str) -> None:
        self.folder = tempfile.TemporaryDirectory(prefix="phasekit-browser-")
        to_read, self.to = os.pipe()
        self.out, out_write = os.pipe()
        words = [program, *FLAGS, f"--user-data-dir={self.folder.name}/profile", "about:blank"]
        self.errors = open(f"{self.folder.name}/stderr", "w")  # noqa: SIM115
        self.process = subprocess.Popen(
            [sys.executable, "-c", LAUNCH, str(to_read), str(out_write), *words],
            pass_fds=(to_read, out_write),
            stdout=self.errors,
            stderr=self.errors,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )
        os.close(to_read)
        os.close(out_write)
        self.buffer = b""
        self.number = 0
        self.events: list[dict] = []
        self.session = None
        try:
            self.attach()
        except BaseException:
            self.close()
            raise

    def attach(self) -> None:
        """Open a page, and listen to it."""
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        attached = self.send("Target.attachToTarget", targetId=target, flatten=True)
        self.session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.send(f"{domain}.enable")

    def close(self) -> None:
        self.session = None
        with contextlib.suppress(OSError, RuntimeError, TimeoutError):
            self.send("Browser.close", wait=5)
        os.close(self.to)
        os.close(self.out)
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        self.errors.close()
        for _ in range(50):  # its last files
            try:
                self.folder.cleanup()
                break
            except OSError:
                time.sleep(0.1)

    # ------------------------------------------------------------ protocol

    def send(self, method: str, *, wait: float = 60, **params) -> dict:
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.to, json.dumps(message).encode() + b"\0")
        end = time.monotonic() + wait
        while True:
            answer = self.receive(end, method)
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]
            if "method" in answer:
                self.events.append(answer)

    def receive(self, end: float, doing: str) -> dict:
        while b"\0" not in self.buffer:
            left = end - time.monotonic()
            if left <= 0 or not select.select([self.out], [], [], left)[0]:
                raise TimeoutError(f"the browser did not answer: {doing}")
            piece = os.read(self.out, 1 << 16)
            if not piece:
                log = Path(self.errors.name).read_text()[-2000:]
                raise RuntimeError(f"the browser has ended: {log}")
            self.buffer += piece
        line, _, self.buffer = self.buffer.partition(b"\0")
        return json.loads(line)

    # ------------------------------------------------------------ page

    def open(self, url: str, width: int = 1400, height: int = 1000, *, dark: bool = False) -> None:
        self.events.clear()
        self.send(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 600,
        )
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.send("Emulation.setEmulatedMedia", features=scheme)
        self.send("Page.navigate", url="about:blank")
        self.send("Page.navigate", url=url)
        self.until("document.readyState === 'complete'")
        self.settle()

    def settle(self) -> None:
        """Wait until words and map have followed the pictures."""
        self.run(
            "(async () => { await new Promise(requestAnimationFrame);"
            " await new Promise((done) => setTimeout(done, 150)); })()"
        )

    def until(self, condition: str, wait: float = 20) -> None:
        end = time.monotonic() + wait
        while not self.run(condition):
            if time.monotonic() > end:
                raise TimeoutError(condition)
            time.sleep(0.05)

    def run(self, script: str):
        """The value of an expression; numbers that are not finite come as text."""
        text = (
            f"(async () => JSON.stringify(await ({script}), (k, v) => typeof v === 'number' && "
            "!Number.isFinite(v) ? String(v) : v))()"
        )
        answer = self.send(
            "Runtime.evaluate", expression=text, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in answer:
            raise RuntimeError(json.dumps(answer["exceptionDetails"])[:2000])
        value = answer["result"].get("value")
        return None if value is None else json.loads(value)

    def complaints(self) -> list[str]:
        """Errors and messages of the console since the page was opened."""
        self.run("0")
        named = ("Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded")
        return [json.dumps(event) for event in self.events if event["method"] in named]

    def requests(self) -> list[str]:
        """Addresses that were asked for since the page was opened."""
        self.run("0")
        sent = [e for e in self.events if e["method"] == "Network.requestWillBeSent"]
        return [event["params"]["request"]["url"] for event in sent]

    def place(self, selector: str) -> list[float]:
        """Where an element lies on the screen: left, top, width, height."""
        return self.run(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)});"
            " e.scrollIntoView({block: 'center'}); const b = e.getBoundingClientRect();"
            " return [b.x, b.y, b.width, b.height]; })()"
        )

    def click(self, x: float, y: float) -> None:
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y)
        self.mouse("mouseReleased", x, y)

    def mouse(self, kind: str, x: float, y: float) -> None:
        pressed = {} if kind == "mouseMoved" else {"button": "left", "clickCount": 1}
        self.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, **pressed)

    def press(self, selector: str) -> None:
        """Click the middle of an element."""
        left, top, width, height = self.place(selector)
        self.click(left + width / 2, top + height / 2)

    def key(self, key: str, code: int, text: str = "") -> None:
        common = {"key": key, "code": key, "windowsVirtualKeyCode": code}
        down = "keyDown" if text else "rawKeyDown"
        self.send("Input.dispatchKeyEvent", type=down, text=text, **common)
        self.send("Input.dispatchKeyEvent", type="keyUp", **common)

    def screenshot(self, path: str | Path, *, whole: bool = True) -> None:
        clip = {}
        if whole:
            size = self.send("Page.getLayoutMetrics")["cssContentSize"]
            area = {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}
            clip = {"clip": area, "captureBeyondViewport": True}
        data = self.send("Page.captureScreenshot", format="png", **clip)["data"]
        Path(path).write_bytes(base64.b64decode(data))
