"""Recordings and pictures: read back and compared with memory."""

import json
import os
from dataclasses import replace
from urllib.request import urlopen

import numpy as np
import pytest
import rerun as rr
from messages import naming
from rerun.chunk import RrdReader

from swgjoint.cli.main import main
from swgjoint.errors import ComputationError, InputError, OutputWarning
from swgjoint.maps.drive_map import DriveMap
from swgjoint.sim.run import Run
from swgjoint.units import mm
from swgjoint.view.plots.runs import comparison_png, draw_ripple
from swgjoint.view.recording import recording
from swgjoint.view.recording.blueprint import joints_shown
from swgjoint.view.recording.entities import pose_rows, signals_of
from swgjoint.view.recording.paths import body_path, joint_path, phase_path
from swgjoint.view.recording.recording import write_recording
from swgjoint.view.recording.viewer import STARTED
from swgjoint.view.run import run_scene

SHORT = {"simulation.duration_s": 1.0, "trajectory.settle_s": 0.2}


@pytest.fixture
def run(synthetic_map: DriveMap) -> Run:
    return run_scene("bench", overrides=SHORT, drives={"reference-2d": synthetic_map})


def columns(path, entity: str, component: str) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and values of one component of one entity of a recording."""
    times, values = [], []
    for chunk in RrdReader(path).stream():
        if chunk.entity_path != entity or chunk.is_static:
            continue
        batch = chunk.to_record_batch()
        if component not in batch.schema.names:
            continue
        times.append(batch.column("time").cast("int64").to_numpy() * 1e-9)
        values += [item[0] for item in batch.column(component).to_pylist()]
    return np.concatenate(times), np.array(values)


@pytest.mark.parametrize("part", [recording.PART, 300])
def test_the_recording_holds_what_the_metrics_were_computed_from(
    run, tmp_path, monkeypatch, part
):
    """Every signal of every joint comes back bit by bit, however it was sent."""
    monkeypatch.setattr(recording, "PART", part)
    path = run.to_rerun(tmp_path / "run.rrd")
    for name, expected in signals_of(run, 0).items():
        time, values = columns(path, "/joint/joint", name)
        np.testing.assert_allclose(time, run.time, atol=1e-9)
        np.testing.assert_array_equal(values, expected)
    _, error = columns(path, "/tool/error_mm", "Scalars:scalars")
    np.testing.assert_array_equal(error, run.tool_error() / mm)


def test_the_arm_moves_in_the_recording(run, tmp_path):
    """Poses of the load are those of the link angle about the vertical axis."""
    path = run.to_rerun(tmp_path / "run.rrd")
    rows = pose_rows(run)
    assert rows[0] == 0
    assert rows[-1] == run.time.size - 1
    time, turns = columns(path, "/arm/load", "Transform3D:quaternion")
    _, places = columns(path, "/arm/load", "Transform3D:translation")
    np.testing.assert_allclose(time, run.time[rows], atol=1e-9)
    np.testing.assert_allclose(places, np.tile([0, 0, 0.25], (rows.size, 1)), atol=1e-6)
    angle = 2.0 * np.arctan2(turns[:, 2], turns[:, 3])  # x, y, z, w
    np.testing.assert_allclose(angle, run.position[rows, 0], atol=1e-6)  # float32
    assert np.ptp(angle) > 0.04


def test_the_recording_carries_geometry_and_a_layout(run, tmp_path):
    """Every geom is there once, and a blueprint comes with the file."""
    path = run.to_rerun(tmp_path / "run.rrd")
    reader = RrdReader(path)
    assert len(reader.blueprints()) == 1
    static = {c.entity_path for c in reader.stream() if c.is_static}
    shapes = {"/arm/stand/foot", "/arm/stand/housing", "/arm/load/flange"}
    assert shapes | {"/arm/load/bar", "/tool/path"} <= static


def names_in_layout(path) -> tuple[list[str], list[str]]:
    """Names of the tabs and of the plots over time of a recording, sorted."""
    reader = RrdReader(path)
    tabs, plots = [], []
    for chunk in reader.stream(store=reader.blueprints()[0]):
        batch = chunk.to_record_batch()

        def value(key, batch=batch):
            return batch.column(key).to_pylist()[0] if key in batch.schema.names else []

        if chunk.entity_path.startswith("/container/"):
            tabs += value("ContainerBlueprint:display_name")
        elif value("ViewBlueprint:class_identifier") == ["TimeSeries"]:
            plots += value("ViewBlueprint:display_name")
    return sorted(tabs), sorted(plots)


def test_a_scene_says_which_joints_and_signals_have_a_place(synthetic_map, tmp_path):
    """All joints, the most loaded first, or those named; their signals stay whole."""
    short = {
        "simulation.duration_s": 0.4,
        "trajectory.hold_s": 0.05,
        "trajectory.ramp_s": 0.1,
        "trajectory.settle_s": 0.05,
    }
    drives = {"reference-2d": synthetic_map}
    path = tmp_path / "run.rrd"
    run = run_scene("ur5e-sweep", overrides=short, drives=drives, recording=path)
    tabs, plots = names_in_layout(path)
    assert len(tabs) == 6 and len(plots) == 6 * 4 + 1
    weight = np.abs(run.assembly.link_torque).max(axis=0)
    # in so short a time all joints are too fast for the strongest order of their drive
    assert run.joints[weight.argmax()] == joints_shown({"": run.assembly})[0]
    layout = {
        "recording.joints": ["wrist_2_joint", "elbow_joint"],
        "recording.plots": ["position_deg"],
    }
    again = run_scene(
        "ur5e-sweep", overrides=short | layout, drives=drives, recording=path
    )
    assert joints_shown({"": again.assembly}) == layout["recording.joints"]
    tabs, plots = names_in_layout(path)
    assert tabs == ["elbow", "wrist_2"]
    assert plots == 2 * ["link angle [deg]"] + ["tool error [mm]"]
    _, torsion = columns(path, "/joint/shoulder_lift_joint", "torsion_arcmin")
    lift = run.joints.index("shoulder_lift_joint")
    np.testing.assert_array_equal(torsion, signals_of(run, lift)["torsion_arcmin"])


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("joints", ["hip"], ("recording.joints = 'hip'", "arm 'bench'", "joint")),
        (
            "plots",
            ["torque"],
            ("recording.plots[0]", "'torque'", "'torsion_arcmin'", "'position_deg'"),
        ),
    ],
)
def test_a_layout_of_what_is_not_there_is_refused(synthetic_map, key, value, message):
    """One line with the key."""
    with pytest.raises(InputError, match=naming(*message)):
        run_scene(
            "bench",
            overrides={**SHORT, f"recording.{key}": value},
            drives={"reference-2d": synthetic_map},
        )


def test_names_of_an_arm_are_one_part_of_a_path_each(tmp_path, capfd):
    """The viewer need not guess what spaces and slashes in names mean."""
    name = "left arm/joint 1"
    part = "left\\ arm\\/joint\\ 1"
    paths = [joint_path(name, "a b"), phase_path(name, ""), body_path("", name)]
    assert paths == [f"a\\ b/joint/{part}", f"phase/{part}/run", f"arm/{part}"]
    stream = rr.RecordingStream("names")
    stream.save(tmp_path / "names.rrd")
    for path in paths:
        stream.log(path, rr.Scalars(1.0), static=True)
    stream.disconnect()
    found = {chunk.entity_path for chunk in RrdReader(tmp_path / "names.rrd").stream()}
    assert {f"/{path}" for path in paths} <= found
    assert "WARN" not in capfd.readouterr().err


def test_several_runs_share_one_recording(run, synthetic_map, tmp_path):
    """Runs lie below their names; tool errors refer to the rigid arm."""
    rigid = run_scene(
        "bench",
        overrides={**SHORT, "defaults.level": "rigid"},
        drives={"reference-2d": synthetic_map},
    )
    path = write_recording(
        {"soft": run, "rigid": rigid}, tmp_path / "both.rrd", rigid=rigid
    )
    _, soft = columns(path, "/soft/joint/joint", "torsion_arcmin")
    _, none = columns(path, "/rigid/joint/joint", "torsion_arcmin")
    assert soft.min() > 1.0
    assert not none.any()
    _, error = columns(path, "/soft/tool/error_mm", "Scalars:scalars")
    np.testing.assert_array_equal(error, run.tool_error(rigid) / mm)


def test_a_recording_is_written_whole_or_not_at_all(run, tmp_path, monkeypatch):
    """A failure on the way leaves neither the file nor a part of it."""

    def fail(*_: object) -> None:
        raise RuntimeError("no pose")

    monkeypatch.setattr("swgjoint.view.recording.entities._send_poses", fail)
    with pytest.raises(RuntimeError, match="no pose"):
        run.to_rerun(tmp_path / "run.rrd")
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_one_line_and_costs_no_run(
    run, synthetic_map, tmp_path, monkeypatch
):
    """The thread of the viewer's library that writes gives up; nothing is left."""

    def full(*_: object, **__: object) -> None:
        raise RuntimeError("File-writer thread shut down prematurely")

    monkeypatch.setattr("rerun.RecordingStream.flush", full)
    path = tmp_path / "run.rrd"
    with pytest.raises(ComputationError, match=naming(str(path), "disk")) as told:
        run.to_rerun(path)
    assert "\n" not in str(told.value)
    with pytest.warns(OutputWarning, match=naming(str(path), "not written", "disk")):
        again = run_scene(
            "bench",
            overrides=SHORT,
            drives={"reference-2d": synthetic_map},
            recording=path,
        )
    assert again.recording is None and again.metrics()["joints"]
    assert list(tmp_path.iterdir()) == []


def test_a_recording_has_the_mode_of_any_file(run, tmp_path):
    """It follows the umask."""
    before = os.umask(0o027)
    try:
        path = run.to_rerun(tmp_path / "run.rrd")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_recording_begun_during_the_run_is_the_same(run, synthetic_map, tmp_path):
    """It holds the same components at as many rows, and the same torsion."""
    after, beside = tmp_path / "after.rrd", tmp_path / "new" / "beside.rrd"
    run.to_rerun(after)
    again = run_scene(
        "bench",
        overrides=SHORT,
        drives={"reference-2d": synthetic_map},
        recording=beside,
    )
    np.testing.assert_array_equal(again.torsion, run.torsion)
    np.testing.assert_array_equal(
        columns(beside, "/joint/joint", "torsion_arcmin")[1],
        columns(after, "/joint/joint", "torsion_arcmin")[1],
    )
    assert contents(beside) == contents(after)
    assert [path.name for path in beside.parent.iterdir()] == ["beside.rrd"]


def contents(path) -> set[tuple[str, int, tuple[str, ...]]]:
    """Entities, rows and components of a recording."""
    chunks = [c for c in RrdReader(path).stream() if "propert" not in c.entity_path]
    return {
        (c.entity_path, c.num_rows, tuple(sorted(c.to_record_batch().schema.names)))
        for c in chunks
    }


def test_a_run_that_fails_leaves_no_recording(synthetic_map, tmp_path, monkeypatch):
    """Nothing is left of what was sent while it went on."""

    def fail(*_: object, **__: object) -> None:
        assert [path.name.startswith(".run.rrd.") for path in tmp_path.iterdir()]
        raise ComputationError("diverged")

    monkeypatch.setattr("swgjoint.sim.simulation._recorded", fail)
    with pytest.raises(ComputationError, match="diverged"):
        run_scene(
            "bench",
            overrides=SHORT,
            drives={"reference-2d": synthetic_map},
            recording=tmp_path / "run.rrd",
        )
    assert list(tmp_path.iterdir()) == []


def test_the_picture_compares_the_runs(run, tmp_path):
    """One PNG of readable size; a folder that does not exist is refused."""
    path = comparison_png({"soft": run}, tmp_path / "demo.png")
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG")
    width, height = (int.from_bytes(data[k : k + 4], "big") for k in (16, 20))
    assert width > 1000
    assert height > 800
    with pytest.raises(InputError):
        comparison_png({"soft": run}, tmp_path / "none" / "demo.png")


def test_the_spectrum_shows_every_run_whole(synthetic_map):
    """The axis reaches the highest line of all runs, whatever their order."""
    import matplotlib.pyplot as plt

    turn = SHORT | {"simulation.duration_s": 2.5}  # most of an input turn
    run = run_scene("bench", overrides=turn, drives={"reference-2d": synthetic_map})
    strong = replace(run, output_torque=3.0 * run.output_torque)
    for pair in ((run, strong), (strong, run)):
        figure, (over_turns, over_order) = plt.subplots(2)
        for one in pair:
            draw_ripple(over_turns, over_order, one, 0, {})
        heights = [line.get_ydata().max() for line in over_order.lines]
        assert max(heights) > 2.0 * min(heights) > 0.0
        assert over_order.get_ylim()[0] == 0.0
        assert over_order.get_ylim()[1] > max(heights)
        plt.close(figure)


def test_figures_can_be_recomputed_from_the_recording(run, tmp_path):
    """Torsion figures of the JSON output follow from the recorded samples."""
    path = run.to_rerun(tmp_path / "run.rrd")
    _, torsion = columns(path, "/joint/joint", "torsion_arcmin")
    window = torsion[run.steady]
    figures = run.metrics()["joints"]["joint"]["torsion_arcmin"]
    assert figures["mean"] == pytest.approx(window.mean(), rel=1e-12)
    assert figures["pp"] == pytest.approx(np.ptp(window), rel=1e-12)
    assert json.dumps(run.metrics(), allow_nan=False)


def test_the_view_command_serves_a_page_on_loopback(run, tmp_path, capsys):
    """The page answers at the printed address until the viewer is ended."""
    path = run.to_rerun(tmp_path / "run.rrd")
    assert main(["view", str(path), "--web", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    try:
        assert result["url"].startswith("http://127.0.0.1:")
        with urlopen(result["url"], timeout=120) as page:
            assert page.status == 200
            assert b"<html" in page.read().lower()
    finally:
        for process in STARTED:
            process.terminate()
            process.wait(timeout=120)
        STARTED.clear()
