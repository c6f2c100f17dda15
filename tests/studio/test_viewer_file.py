"""Files of the rerun viewer that the studio passes on."""

from __future__ import annotations

import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from fastapi import HTTPException

from swgjoint.studio import recording


class Viewer(BaseHTTPRequestHandler):
    """A server with one page."""

    def do_GET(self):
        found = self.path == "/"
        self.send_response(200 if found else 404)
        self.send_header("content-type", "text/html")
        self.end_headers()
        self.wfile.write(b"page" if found else b"")

    def log_message(self, *_):
        pass


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
    monkeypatch.setattr(recording, "_viewer", lambda: (process, address))
    assert recording.viewer_file().body == b"page"
    with pytest.raises(HTTPException) as raised:
        recording.viewer_file(name)
    assert raised.value.status_code == 404
