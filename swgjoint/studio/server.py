"""Server of the page: one session for each browser tab, on this machine only."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

from fastapi import HTTPException
from fastapi.responses import FileResponse
from nicegui import app, ui
from starlette.middleware.trustedhost import TrustedHostMiddleware

from swgjoint.studio.arm_page import ArmPage
from swgjoint.studio.drive_page import DrivePage
from swgjoint.studio.jobs import start_server
from swgjoint.studio.recording import end_viewer, viewer_file
from swgjoint.studio.session import Session
from swgjoint.view.recording.viewer import LOOPBACK

POLL_S = 0.15
"""Interval at which an open page looks for results [s]."""
LEFT_S = 2.0
"""Time without connection after which a page counts as closed [s]."""
SESSIONS: dict[str, Session] = {}
"""Sessions by the identifier of their tab, which a reload keeps."""
_STYLE = """
:root { --nicegui-default-padding: 8px; --nicegui-default-gap: 6px; }
body { background: #f4f5f7; }
.pane { height: calc(100vh - 82px); overflow-y: auto; }
.fault { color: #c10015; font-size: 12px; line-height: 1.3; overflow-wrap: anywhere; }
.field-label { font-size: 13px; line-height: 1.2; }
.q-expansion-item .q-item { min-height: 32px; }
.faulty > .q-expansion-item__container > .q-item { color: #c10015; }
.value .q-field__control, .value .q-field__marginal, .value .q-field__native {
  min-height: 30px; height: 30px; font-size: 13px;
}
.value .q-field__suffix { line-height: 30px; padding: 0 0 0 4px; }
"""


def serve_studio(port: int, *, show: bool) -> None:
    """Serve the page until the process is interrupted.

    Args:
        port: Port on the loopback interface.
        show: Whether to open the page in the browser.
    """
    start_server()
    ui.page("/", title="swgjoint studio")(_page)
    app.get("/files/{tab}/{name}")(_file)
    app.get("/viewer/")(viewer_file)
    app.get("/viewer/{name}")(viewer_file)
    app.on_shutdown(_end)
    # a name that resolves to this machine must not open the page to other sites
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=[LOOPBACK, "localhost"])
    ui.run(
        host=LOOPBACK,
        port=port,
        show=show,
        reload=False,
        reconnect_timeout=LEFT_S,
        show_welcome_message=False,
        uvicorn_logging_level="error",
        favicon="⚙",
    )


async def _page() -> None:
    """Build the page of one tab."""
    client = ui.context.client
    ui.add_css(_STYLE)
    client.content.classes("q-pa-none gap-0")
    await client.connected()
    if client.is_deleted:  # something else than a browser has read the page
        return
    tab = str(client.tab_id)
    session = SESSIONS[tab] = SESSIONS.get(tab) or Session()
    session.pages += 1
    client.on_delete(session.leave)
    with (
        ui.header()
        .classes("items-center q-py-none bg-blue-grey-9")
        .style("height:50px")
    ):
        ui.label("swgjoint studio").classes("text-h6 q-mr-lg")
        with ui.tabs().props("dense") as tabs:
            for name in ("Drive", "Arm"):
                ui.tab(name)
    panels = ui.tab_panels(
        tabs,
        value=session.page,
        on_change=lambda e: setattr(session, "page", e.value),
    )
    with panels.classes("w-full bg-transparent"):
        with ui.tab_panel("Drive").classes("q-pa-none"):
            drive_page = DrivePage(session, tab)
        with ui.tab_panel("Arm").classes("q-pa-none"):
            arm_page = ArmPage(session, tab, str(client.request.base_url))
    seen = -1

    def poll() -> None:
        nonlocal seen
        session.poll()
        if seen != session.version:
            seen = session.version
            drive_page.update()
            arm_page.update()

    session.resume()
    ui.timer(POLL_S, poll)


def _file(tab: str, name: str) -> FileResponse:
    """A result of one tab."""
    session = SESSIONS.get(tab)
    path = session.folder / Path(name).name if session else None
    if path is None or not path.is_file():
        raise HTTPException(status_code=404)
    return FileResponse(path)


def _end(*_: Any) -> None:
    # asyncio.wait_for of Python 3.11 loses a cancellation that comes when its wait
    # ends; NiceGUI then reports a task that goes on, and cancels it again
    logging.getLogger("nicegui").setLevel(logging.CRITICAL)
    for session in SESSIONS.values():
        session.close()
    end_viewer()
