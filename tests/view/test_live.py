"""Runs streamed to a server on loopback: what arrives there is what was sent."""

import signal
import socket
import time

import numpy as np
import pytest
from messages import naming
from rerun.chunk import RrdReader

from swgjoint.errors import ComputationError, InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.run import Run
from swgjoint.view.recording.entities import signals_of
from swgjoint.view.recording.live import loopback_port, stream_runs
from swgjoint.view.recording.viewer import STARTED, free_port, start_viewer, wait_for
from swgjoint.view.run import run_scene


@pytest.fixture
def run(synthetic_map: DriveMap) -> Run:
    short = {"simulation.duration_s": 1.0, "trajectory.settle_s": 0.2}
    return run_scene("bench", overrides=short, drives={"reference-2d": synthetic_map})


@pytest.fixture
def server(tmp_path):
    """The viewer's server, which saves what it receives; ended by the test."""
    process, url = start_viewer("--save", str(tmp_path / "got.rrd"))
    wait_for(loopback_port(url), process)
    yield process, url, tmp_path / "got.rrd"
    process.kill()
    process.wait(timeout=120)
    STARTED.clear()


def received(process, path, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and values of a signal of the joint, when the server wrote all."""
    size, end = -1, time.monotonic() + 120.0
    while time.monotonic() < end and size != (size := path.stat().st_size):
        time.sleep(2.0)
    process.send_signal(signal.SIGTERM)  # a job in the background ignores SIGINT
    process.wait(timeout=120)
    times, values = [], []
    with pytest.warns(Warning, match="footer"):  # the server was interrupted
        reader = RrdReader(path)
    for chunk in reader.stream():
        if chunk.entity_path == "/joint/joint" and not chunk.is_static:
            batch = chunk.to_record_batch()
            times += (batch.column("time").cast("int64").to_numpy() * 1e-9).tolist()
            column = batch.column(name).to_pylist()
            values += [item[0] for item in column]
    order = np.argsort(times)
    return np.array(times)[order], np.array(values)[order]


def test_a_stream_arrives_whole(run, server):
    """Torsion comes back bit by bit at every step."""
    process, url, path = server
    assert stream_runs({"": run}, url=url) == url
    time_of, values = received(process, path, "torsion_arcmin")
    np.testing.assert_allclose(time_of, run.time, atol=1e-9)
    np.testing.assert_array_equal(values, signals_of(run, 0)["torsion_arcmin"])


def test_a_paced_stream_takes_its_time_and_loses_nothing(run, server):
    """One second at twice its pace takes half a second; parcels join without a gap."""
    process, url, path = server
    begin = time.monotonic()
    stream_runs({"": run}, url=url, pace=2.0)
    assert time.monotonic() - begin > 0.45
    _, values = received(process, path, "output_torque_Nm")
    np.testing.assert_array_equal(values, run.output_torque[:, 0])


def test_the_server_listens_on_loopback_only(server):
    """It answers at 127.0.0.1 and at no other address of the machine."""
    _, url, _ = server
    port = loopback_port(url)
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", port)) == 0
    # all of 127/8 is this machine: a server on every interface would answer there, too
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.2", port)) != 0


@pytest.mark.parametrize(
    "url",
    [
        "rerun+http://192.0.2.7:9876/proxy",
        "rerun+http://example.org/proxy",
        "rerun+https://127.0.0.1:9876/proxy",
        "rerun+http://127.0.0.1:9876/",
        "rerun+http://127.0.0.1:port/proxy",
        "somewhere",
    ],
)
def test_an_address_elsewhere_is_refused(run, url):
    """Nothing leaves the machine; the line says what is accepted."""
    with pytest.raises(
        InputError,
        match=naming(f"'{url}'", "this machine", "rerun+http://127.0.0.1:9876/proxy"),
    ):
        stream_runs({"": run}, url=url)


def test_addresses_of_this_machine_are_accepted():
    """By number, by name, of either protocol; the port has a default."""
    assert loopback_port("rerun+http://127.0.0.1:1234/proxy") == 1234
    assert loopback_port("rerun+http://localhost/proxy") == 9876
    assert loopback_port("rerun+http://[::1]:4321/proxy") == 4321


def test_a_viewer_that_is_not_there_is_told():
    """The line names the port."""
    port = free_port()
    with pytest.raises(ComputationError, match=naming("rerun", f"{port}")):
        wait_for(port, limit=0.3)


def test_a_pace_must_be_positive(run):
    """Zero and less are refused before anything starts."""
    with pytest.raises(InputError, match=naming("pace = 0", "> 0")):
        stream_runs({"": run}, pace=0.0)
    assert STARTED == []
