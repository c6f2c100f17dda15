"""Pages in a headless Chromium, driven through its DevTools protocol."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import tempfile
import time
import urllib.request
from contextlib import ExitStack
from pathlib import Path

PROGRAM = shutil.which("chromium") or shutil.which("google-chrome")


SOFTWARE_WEBGL = (
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
)
"""Options for pages that draw with WebGL, on a machine without a graphics card."""


class Browser:
    """A browser with a profile of its own."""

    def __init__(self, size=(1500, 1000), options=("--disable-gpu",)):
        self._profile = tempfile.mkdtemp()
        self._process = subprocess.Popen(
            [
                *(PROGRAM, "--headless=new", "--no-sandbox", "--no-first-run"),
                *("--disable-dev-shm-usage", "--disable-background-networking"),
                *("--disable-component-update", "--hide-scrollbars", *options),
                f"--window-size={size[0]},{size[1]}",
                f"--user-data-dir={self._profile}",
                *("--remote-debugging-port=0", "about:blank"),
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        file = Path(self._profile, "DevToolsActivePort")
        end = time.monotonic() + 60
        while not (file.exists() and file.read_text().strip()):
            assert time.monotonic() < end, "chromium does not start"
            time.sleep(0.05)
        self.port = int(file.read_text().split()[0])

    def open(self, url):
        """Open a page in a tab of its own."""
        request = urllib.request.Request(
            f"http://127.0.0.1:{self.port}/json/new?about:blank", method="PUT"
        )
        with urllib.request.urlopen(request) as answer:
            tab = json.load(answer)
        return Page(self, tab, url)

    def close(self):
        """End the browser."""
        self._process.terminate()
        self._process.wait(20)
        shutil.rmtree(self._profile, ignore_errors=True)


class Page:
    """One tab."""

    def __init__(self, browser, tab, url):
        from websockets.sync.client import connect

        self._browser, self._id, self._number = browser, tab["id"], 0
        self._open = ExitStack()
        self._socket = self._open.enter_context(
            connect(tab["webSocketDebuggerUrl"], max_size=None, ping_interval=None)
        )
        self._urls, self._loads, self.errors = {}, 0, []
        for part in ("Network", "Page", "Runtime"):
            self.command(f"{part}.enable")
        self.command("Page.navigate", url=url)

    def command(self, method, **params):
        """Send one command and return its result."""
        self._number += 1
        self._socket.send(
            json.dumps({"id": self._number, "method": method, "params": params})
        )
        while (reply := self._receive()).get("id") != self._number:
            pass
        assert "error" not in reply, reply
        return reply["result"]

    def _receive(self):
        """Next message, a reply or an event."""
        message = json.loads(self._socket.recv(timeout=60))
        content = message.get("params", {})
        match message.get("method"):
            case "Network.requestWillBeSent":
                self._urls[content["requestId"]] = content["request"]["url"]
            case "Network.loadingFailed" if content.get("blockedReason"):
                self._urls.pop(content["requestId"], None)
            case "Page.loadEventFired":
                self._loads += 1
            case "Runtime.exceptionThrown":
                self.errors.append(content["exceptionDetails"])
        return message

    @property
    def requests(self):
        """Addresses that the page has asked for, without those that it must not ask."""
        self.value("0")  # takes in what has happened
        return list(self._urls.values())

    def reload(self):
        """Load the page again."""
        self.command("Page.bringToFront")  # a page in the back has slow timers
        before = self._loads
        self.command("Page.reload")
        while self._loads == before:  # the event may come before the reply
            self._receive()

    def value(self, script):
        """Value of a JavaScript expression."""
        answer = self.command("Runtime.evaluate", expression=script, returnByValue=True)
        assert "exceptionDetails" not in answer, (script, answer)
        return answer["result"].get("value")

    def wait(self, script, limit=60.0):
        """Wait until an expression is true; return the time that took [s]."""
        begin = time.monotonic()
        while not self.value(f"!!({script})"):
            if time.monotonic() - begin > limit:
                raise AssertionError(f"not true after {limit} s: {script}")
            time.sleep(0.1)
        return time.monotonic() - begin

    def text(self, key):
        """Text of the element with a data-key."""
        return self.value(f"document.querySelector('[data-key=\"{key}\"]').innerText")

    def type(self, key, text):
        """Replace the text of the input with a data-key by typing."""
        where = f"document.querySelector('input[data-key=\"{key}\"]')"
        self.wait(where)
        self.command("Page.bringToFront")  # a page in the back has slow timers
        self.wait(f"{where}.select(), {where} == document.activeElement")
        self.command("Input.insertText", text=text)

    def click(self, key):
        """Click the middle of the element with a data-key once it is at rest."""
        where = f"document.querySelector('[data-key=\"{key}\"]')"
        self.wait(where)
        place = (
            f"(e => {{ e.scrollIntoView({{block: 'center', behavior: 'instant'}});"
            " const r = e.getBoundingClientRect();"
            f" return [r.x + r.width / 2, r.y + r.height / 2]; }})({where})"
        )
        before, (x, y) = None, self.value(place)
        while (x, y) != before:  # the layout may still move
            time.sleep(0.1)
            before, (x, y) = (x, y), self.value(place)
        for kind in ("mousePressed", "mouseReleased"):
            self.command(
                "Input.dispatchMouseEvent",
                **{"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1},
            )

    def choose(self, key, option):
        """Select an option by its text, which is typed if that filters the list."""
        item = (
            "[...document.querySelectorAll('.q-menu .q-item')]"
            f".find(e => e.innerText.trim() == {json.dumps(option)})"
        )
        self.command("Page.bringToFront")  # a page in the back has slow timers
        begin = time.monotonic()
        while not self.value(f"!!({item})"):
            assert time.monotonic() - begin < 60.0, f"{key} does not offer {option}"
            if not self.value("!!document.querySelector('.q-menu')"):
                self.click(key)  # the menu closes where the page is drawn anew
            elif self.value("document.activeElement.matches('input:not([readonly])')"):
                self.value("document.activeElement.select()")
                self.command("Input.insertText", text=option)
            time.sleep(0.5)
        self.value(f"{item}.click(), 1")

    def upload(self, selector, path):
        """Choose a file in the file input that a selector finds."""
        root = self.command("DOM.getDocument")["root"]["nodeId"]
        found = self.command("DOM.querySelector", nodeId=root, selector=selector)
        self.command("DOM.setFileInputFiles", nodeId=found["nodeId"], files=[str(path)])

    def download(self, key, folder):
        """Click what downloads a file to an empty folder, and return its path."""
        self.command(
            "Browser.setDownloadBehavior", behavior="allow", downloadPath=str(folder)
        )
        self.click(key)
        begin = time.monotonic()
        while True:
            found = list(Path(folder).iterdir())
            if found and not any(p.suffix == ".crdownload" for p in found):
                return found[0]
            assert time.monotonic() - begin < 30, "no file has arrived"
            time.sleep(0.1)

    def picture(self, path):
        """Write a screenshot."""
        data = self.command("Page.captureScreenshot", format="png")["data"]
        Path(path).write_bytes(base64.b64decode(data))

    def close(self):
        """Close the tab."""
        self._open.close()
        url = f"http://127.0.0.1:{self._browser.port}/json/close/{self._id}"
        urllib.request.urlopen(url).close()
