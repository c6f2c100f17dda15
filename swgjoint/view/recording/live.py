"""Runs sent to a viewer that is open, on this machine only.

The viewer's own server would listen on every interface of the machine: one is started
that is bound to loopback, and addresses elsewhere are refused. A run is simulated far
faster than real time, so it is sent when it is done, at once or at the pace of a clock.
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
"""At which a viewer listens that the user has opened."""
PART_S = 0.1
"""Time between two parcels of a paced stream [s]."""


def stream_runs(
    runs: Mapping[str, Run],
    *,
    url: str | None = None,
    rigid: Run | None = None,
    pace: float | None = None,
) -> str:
    """Send runs of one motion to a viewer; returns when all is sent.

    Args:
        runs: Runs by the name that the viewer shows; a lone run may be called ``""``.
        url: Of a viewer that is open, ``rerun+http://127.0.0.1:9876/proxy``; None
            starts one.
        rigid: The run that tool errors refer to; None for the commanded path.
        pace: Simulated seconds per second of the clock; None sends all at once.

    Returns:
        The address.

    Raises:
        InputError: If the address is not on this machine, or the pace not positive.
        ComputationError: If no viewer answers.
    """
    import rerun as rr

    if pace is not None and not 0.0 < pace < np.inf:
        raise InputError(f"pace {pace:g}; accepted: > 0")
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
    """Port of an address on this machine.

    Raises:
        InputError: If it is none, or is elsewhere.
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
    """Parts of the samples that go out together."""
    if length is None:
        return [slice(0, times.size)]
    count = max(1, round(float(times[-1] - times[0]) / length))
    edges = np.unique(np.linspace(0, times.size, count + 1).astype(int))
    return [slice(int(a), int(b)) for a, b in pairwise(edges)]
