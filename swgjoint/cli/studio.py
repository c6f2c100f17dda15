"""``swgjoint studio``: design a drive and run an arm on a local web page."""

from __future__ import annotations

import argparse
import socket
import sys
from contextlib import suppress
from typing import Any

from swgjoint.errors import InputError, MissingExtraError


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments: port, and whether to open the browser."""
    parser.add_argument(
        "--port",
        type=int,
        metavar="N",
        help="port on the loopback interface; default: a free one",
    )
    parser.add_argument(
        "--no-browser",
        action="store_true",
        help="print the address only, without opening it in the browser",
    )


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Print the address on stderr and serve the page until Ctrl+C.

    Returns:
        ``url``, the address of the page.

    Raises:
        InputError: If the port cannot be used.
        MissingExtraError: If NiceGUI is not installed.
    """
    from swgjoint.view.recording.viewer import LOOPBACK, free_port

    port = free_port() if args.port is None else _checked(args.port, LOOPBACK)
    try:
        from swgjoint.studio.server import serve_studio
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] == "swgjoint":
            raise
        raise MissingExtraError(
            "studio needs NiceGUI: pip install 'swgjoint[studio]'"
        ) from None
    url = f"http://{LOOPBACK}:{port}/"
    print(f"studio: {url} (Ctrl+C ends it)", file=sys.stderr, flush=True)
    with suppress(KeyboardInterrupt):  # which the server passes on once it has ended
        serve_studio(port, show=not args.no_browser)
    return {"url": url}


def report(result: dict[str, Any]) -> str:
    """Format the end of the page."""
    return f"studio: {result['url']} has ended"


def _checked(port: int, host: str) -> int:
    """Reject a port that is out of range or in use."""
    if not 1 <= port <= 65535:
        raise InputError(f"--port {port}; accepted: 1 to 65535")
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as exc:
            raise InputError(
                f"--port {port}: {exc.strerror}; accepted: a free port"
            ) from None
    return port
