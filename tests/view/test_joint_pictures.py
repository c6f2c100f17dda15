"""Collars, spectra and phase pictures of a recording."""

import mujoco
import numpy as np
import pytest
from rerun.chunk import RrdReader

from swgjoint.maps.drive_map import DriveMap
from swgjoint.models_path import models_path
from swgjoint.sim.figures.metrics import torque_ripple
from swgjoint.sim.run import Run
from swgjoint.units import arcmin
from swgjoint.view.recording.drive_markers import (
    RADIUS,
    housing_radius,
    load_color,
    rotation_to,
)
from swgjoint.view.recording.entities import pose_rows
from swgjoint.view.recording.joint_pictures import (
    BARS,
    WIDTH,
    phase_points,
    phase_scales,
    ripple_bars,
)
from swgjoint.view.run import run_scene

SHORT = {"simulation.duration_s": 2.0, "trajectory.settle_s": 0.5}


@pytest.fixture
def run(synthetic_map: DriveMap) -> Run:
    return run_scene("bench", overrides=SHORT, drives={"reference-2d": synthetic_map})


def component(path, entity: str, name: str) -> list:
    """Values of one component of one entity, static or not."""
    found = []
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        if chunk.entity_path == entity and name in batch.schema.names:
            found += batch.column(name).to_pylist()
    return found


def test_the_bars_of_a_spectrum_keep_its_lines(run):
    """The highest bar lies at the strongest line of the metrics, as high as it is."""
    orders, heights = ripple_bars(run, 0)
    assert orders.size <= BARS and (np.diff(orders) > 0).all()
    (line, *_) = run.metrics()["joints"]["joint"]["orders"]
    peak = int(heights.argmax())
    turns = np.ptp(run.motor_position[run.steady, 0]) / (2.0 * np.pi)
    assert orders[peak] == pytest.approx(line["order"], abs=0.5 / turns)
    # a Hann window between bins and the slope of the load: a few percent
    assert heights[peak] == pytest.approx(line["amplitude_percent"], rel=0.1)
    # no energy is made: half the mean square of all lines is that of the ripple
    rated = run.assembly.transmissions[0].drive.ratings.rated_torque
    rms = 100.0 / rated * np.sqrt(np.mean(torque_ripple(run, 0) ** 2))
    assert heights.max() <= 1.5 * np.sqrt(2.0) * rms


def test_a_joint_at_rest_has_no_spectrum(synthetic_map):
    """There is no order without a turn of the input."""
    still = {**SHORT, "trajectory.speed_deg_s.joint": 0.0}
    run = run_scene("bench", overrides=still, drives={"reference-2d": synthetic_map})
    assert ripple_bars(run, 0) is None


def test_the_phase_picture_is_torque_over_torsion(run, synthetic_map):
    """Right is forward torsion, up is positive torque; the largest reach the ends."""
    rigid = run_scene(
        "bench",
        overrides={**SHORT, "defaults.level": "rigid"},
        drives={"reference-2d": synthetic_map},
    )
    assert phase_scales({"": rigid})["joint"] is None
    torsion, torque = scales = phase_scales({"a": run, "b": rigid})["joint"]
    points = phase_points(run, 0, scales)
    assert points[:, 0].max() == pytest.approx(WIDTH)
    np.testing.assert_allclose(
        points[:, 0] / WIDTH * torsion * arcmin, run.torsion[:, 0], rtol=1e-12
    )
    # the viewer's plane has its second axis downwards
    np.testing.assert_allclose(
        -points[:, 1] * torque, run.output_torque[:, 0], rtol=1e-12
    )
    assert (points[:, 1] < 0.0).all()  # the load is carried throughout


def test_the_recording_shows_load_orders_and_phase(run, tmp_path):
    """Colours, bars and the moving point come back as they were computed."""
    path = run.to_rerun(tmp_path / "run.rrd")
    rows = pose_rows(run)
    peak = run.assembly.transmissions[0].drive.ratings.repeated_peak
    colors = component(path, "/arm/load/drive/joint", "Cylinders3D:colors")
    expected = load_color(np.abs(run.output_torque[rows, 0]) / peak)
    assert [value[0] for value in colors] == expected.tolist()
    (radius,) = component(path, "/arm/load/drive/joint", "Cylinders3D:radii")
    assert radius[0] > RADIUS
    orders, heights = ripple_bars(run, 0)
    entity = "/joint/joint/ripple_orders"
    (values,) = component(path, entity, "BarChart:values")
    np.testing.assert_array_equal(values[0]["buffer"], heights)
    (places,) = component(path, entity, "BarChart:abscissa")
    np.testing.assert_array_equal(places[0]["buffer"], orders)
    now = component(path, "/phase/joint/run/now", "Points2D:positions")
    points = phase_points(run, 0, phase_scales({"": run})["joint"])[rows]
    np.testing.assert_allclose([p[0] for p in now], points, atol=1e-6)  # float32


def test_load_runs_from_green_over_yellow_to_red():
    """Ends and middle of the scale; beyond the peak it stays red."""
    found = [hex(value) for value in load_color(np.array([0.0, 0.5, 1.0, 3.0]))]
    assert found == ["0x2ca02cff", "0xf0c81eff", "0xd62728ff", "0xd62728ff"]


@pytest.mark.parametrize("arm", ["bench", "ur5e", "iiwa14", "kinova", "panda"])
def test_collars_stand_out_of_the_housings(arm):
    """Every collar is as wide as a joint of such an arm, none as wide as a link."""
    model = mujoco.MjModel.from_xml_path(str(models_path() / "arms" / f"{arm}.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    radii = [housing_radius(model, data, j) for j in range(model.njnt)]
    assert min(radii) >= 0.02 and max(radii) < 0.15


def test_a_collar_lies_about_the_axis():
    """The turn takes z into the axis of the joint."""
    for axis in np.array([[0, 0, 1], [0, 1, 0], [1, 0, 0], [0.6, 0, -0.8]]):
        x, y, z, w = rotation_to(axis)
        turned = np.zeros(3)
        mujoco.mju_rotVecQuat(turned, np.array([0.0, 0, 1]), np.array([w, x, y, z]))
        np.testing.assert_allclose(turned, axis, atol=1e-12)
