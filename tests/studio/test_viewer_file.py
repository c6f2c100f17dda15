"""Files of the rerun viewer that the studio passes on."""

from __future__ import annotations

import subprocess
import sys
import threading
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from fastapi import HTTPException

from swgjoint.studio import recording


class Viewer(BaseHTTPRequestHandler):
    """A server with one page."""

    def do_GET(self):
        """Answer with the page or status 404."""
        found = self.path == "/"
        self.send_response(200 if found else 404)
        self.send_header("content-type", "text/html")
        self.end_headers()
        self.wfile.write(b"page" if found else b"")

    def log_message(self, *_):
        """Write nothing."""


@pytest.fixture
def address():
    with ThreadingHTTPServer(("127.0.0.1", 0), Viewer) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


@pytest.fixture
def process():
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=-1) as one:
        yield one
        one.kill()


@pytest.mark.parametrize("name", ["no file", "a\r\nX: y", "\0", "é", "\ufffd", "a#b"])
def test_names_that_no_file_has_are_not_found(monkeypatch, address, process, name):
    """Any name has an answer; it is never an internal error."""
    monkeypatch.setattr(recording, "_viewer", cache(lambda: (process, address)))
    assert recording.viewer_file().body == b"page"
    with pytest.raises(HTTPException) as raised:
        recording.viewer_file(name)
    assert raised.value.status_code == 404


def test_a_viewer_that_was_killed_starts_again(monkeypatch, address):
    """Once its server has ended, the next request starts another one."""
    started = []

    def start(*_):
        one = subprocess.Popen([sys.executable, "-c", "input()"], stdin=-1)
        started.append(one)
        return one, ""

    monkeypatch.setattr(recording, "start_viewer", start)
    monkeypatch.setattr(recording, "wait_for", lambda *_: None)
    monkeypatch.setattr(recording, "free_port", lambda: int(address.split(":")[2][:-1]))
    for count in (1, 1):
        assert recording.viewer_file().body == b"page"
        assert len(started) == count
    started[0].kill()
    started[0].wait()
    assert recording.viewer_file().body == b"page" and len(started) == 2
    recording.end_viewer()
    for one in started:
        assert one.poll() is not None
        one.stdin.close()
