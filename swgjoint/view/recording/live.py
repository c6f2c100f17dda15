"""Send runs to an open viewer on this machine.

By default the server of the viewer would listen on all network interfaces. It is
therefore started on the loopback interface, and addresses of other machines are
rejected. A simulation is usually much faster than real time, so a run is sent when it
is finished, either at once or at a given pace.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from ipaddress import ip_address
from itertools import pairwise
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray

from swgjoint.errors import InputError
from swgjoint.view.recording.blueprint import blueprint_of, joints_shown
from swgjoint.view.recording.drive_view import drives_shown
from swgjoint.view.recording.entities import log_known, log_measured, log_moving
from swgjoint.view.recording.joint_pictures import phase_scales
from swgjoint.view.recording.recording import stream_name
from swgjoint.view.recording.viewer import LOOPBACK, start_viewer, wait_for

if TYPE_CHECKING:
    from swgjoint.sim.run import Run

DEFAULT_PORT = 9876
"""Port on which a viewer listens by default."""
PART_S = 0.1
"""Real time between two parts of a paced stream [s]."""


def stream_runs(
    runs: Mapping[str, Run],
    *,
    url: str | None = None,
    rigid: Run | None = None,
    pace: float | None = None,
) -> str:
    """Send runs of one motion to a viewer and return when everything has been sent.

    Args:
        runs: Runs by the name that the viewer shows; a single run may be called ``""``.
        url: Address of an open viewer, such as ``rerun+http://127.0.0.1:9876/proxy``;
            None starts a viewer.
        rigid: Run of the rigid arm to which tool errors refer; None for the commanded
            path.
        pace: Simulated time per real time [-]; None sends everything at once.

    Returns:
        Address of the viewer.

    Raises:
        InputError: If the address is not on this machine, or the pace is not a positive
            finite number.
        ComputationError: If the viewer is not installed or does not answer.
    """
    import rerun as rr

    if pace is not None and not 0.0 < pace < np.inf:
        raise InputError(f"pace = {pace:g}; accepted: > 0")
    process = None
    if url is None:
        process, url = start_viewer()
    wait_for(loopback_port(url), process)
    scenes = {label: run.assembly for label, run in runs.items()}
    stream = rr.RecordingStream(stream_name(scenes))
    joints = joints_shown(scenes)
    stream.connect_grpc(url, default_blueprint=blueprint_of(scenes, joints))
    drives = drives_shown(scenes, joints)
    log_known(stream, scenes, drives=drives)
    scales = phase_scales(runs)
    log_measured(stream, runs, scales)
    time_of = next(iter(runs.values())).time
    begin = time.monotonic()
    for part in _parcels(time_of, None if pace is None else pace * PART_S):
        if pace is not None:
            due = begin + float(time_of[part.stop - 1] - time_of[0]) / pace
            time.sleep(max(0.0, due - time.monotonic()))
        log_moving(stream, runs, scales, drives=drives, rigid=rigid, part=part)
    stream.flush()
    stream.disconnect()
    return url


def loopback_port(url: str) -> int:
    """Port of a viewer address on this machine; :data:`DEFAULT_PORT` if it names none.

    Raises:
        InputError: If the address is malformed or on another machine.
    """
    try:
        parts = urlsplit(url)
        host, port = parts.hostname or "", parts.port
        here = host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        here, port = False, None
    if not here or parts.scheme != "rerun+http" or parts.path != "/proxy":
        raise InputError(
            f"viewer {url!r}; accepted: an address on this machine such as"
            f" rerun+http://{LOOPBACK}:{DEFAULT_PORT}/proxy"
        )
    return DEFAULT_PORT if port is None else port


def _parcels(times: NDArray[np.float64], length: float | None) -> list[slice]:
    """Divide the samples into parts of about ``length`` [s]; a single part for None."""
    if length is None:
        return [slice(0, times.size)]
    count = max(1, round(float(times[-1] - times[0]) / length))
    edges = np.unique(np.linspace(0, times.size, count + 1).astype(int))
    return [slice(int(a), int(b)) for a, b in pairwise(edges)]
