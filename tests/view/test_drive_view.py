"""The drive in a recording: where its teeth are, and what moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rerun.chunk import RrdReader

from swgjoint.sim.run import Run
from swgjoint.view.recording.drive_view import (
    FRAMES,
    angles,
    drives_shown,
    frames_of,
    stress_color,
)
from swgjoint.view.recording.entities import pose_rows
from swgjoint.view.run import run_scene

SHORT = {"simulation.duration_s": 1.0, "trajectory.settle_s": 0.2}


@pytest.fixture
def run(synthetic_map, fields) -> Run:
    shown = replace(synthetic_map, fields=fields)
    return run_scene("bench", overrides=SHORT, drives={"reference-2d": shown})


def values(path, entity: str, component: str) -> list:
    found = []
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        if chunk.entity_path == entity and component in batch.schema.names:
            found += batch.column(component).to_pylist()
    return found


def test_the_flexspline_follows_the_recorded_angles(run, tmp_path):
    """Its long axis lies along the wave generator, its teeth turn with the output."""
    path = run.to_rerun(tmp_path / "run.rrd")
    rows = frames_of(run, "joint", pose_rows(run))
    at = "/drive/joint/flexspline"
    half = np.array(values(path, at, "Mesh3D:vertex_positions"))
    assert half.shape == (rows.size, 180, 3)
    # both lobes are alike: the same mesh once more, turned
    (poses,) = values(path, at, "InstancePoses3D:quaternions")
    frames = np.concatenate([half, half * [-1.0, -1.0, 1.0]], axis=1)
    assert np.array(poses) == pytest.approx(
        np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]]), abs=1e-7
    )
    (triangles,) = values(path, at, "Mesh3D:triangle_indices")
    assert np.array(triangles).shape == (60, 3)
    theta, psi = run.motor_position[rows, 0], run.position[rows, 0]
    bottom = frames[:, 2::3]
    radius = np.hypot(bottom[..., 0], bottom[..., 1])
    polar = np.arctan2(-bottom[..., 0], bottom[..., 1])
    # second harmonic of the radius: where the lobes are, half of the turn's angle
    lobes = 0.5 * np.angle((radius * np.exp(2j * polar)).sum(axis=1))
    apart = (lobes - theta + np.pi / 2) % np.pi - np.pi / 2
    assert np.abs(apart).max() < 1e-3
    assert np.ptp(theta) > 2.0
    first = polar[:, 0]
    assert first == pytest.approx(psi, abs=1e-6)
    colors = np.array(values(path, at, "Mesh3D:vertex_colors"))
    assert colors.shape == (rows.size, 180)
    assert len(np.unique(colors)) > 50


def test_outlines_turn_and_forces_end_where_they_push(run, tmp_path):
    """The wave generator turns with the input, the circular spline stands."""
    path = run.to_rerun(tmp_path / "run.rrd")
    rows = frames_of(run, "joint", pose_rows(run))
    for name, turn in (
        ("wave_generator", run.motor_position[rows, 0]),
        ("circular_spline", np.zeros(rows.size)),
    ):
        found = values(path, f"/drive/joint/{name}", "Transform3D:quaternion")
        quaternion = np.array(found)[:, 0]
        angle = 2.0 * np.arctan2(quaternion[:, 2], quaternion[:, 3])
        apart = (angle - turn + np.pi) % (2.0 * np.pi) - np.pi
        assert apart == pytest.approx(np.zeros(rows.size), abs=1e-5)
    (strip,) = values(path, "/drive/joint/circular_spline", "LineStrips3D:strips")
    assert len(strip[0]) == 122 * 3 + 1
    for name, sign in (("tooth_forces", -1.0), ("bore_forces", 1.0)):
        vectors, origins = (
            np.array(values(path, f"/drive/joint/{name}", f"Arrows3D:{key}"))
            for key in ("vectors", "origins")
        )
        assert vectors.shape == origins.shape == (rows.size, 120, 3)
        outward = (vectors * origins).sum(axis=2)
        assert (sign * outward > 0.0).all()


@pytest.mark.parametrize("level", ["rigid", "full"])
def test_a_drive_without_fields_or_torsion_is_not_drawn(
    synthetic_map, fields, level, tmp_path
):
    """Nothing of it is in the recording."""
    shown = replace(synthetic_map, fields=fields if level == "rigid" else None)
    run = run_scene(
        "bench",
        overrides=SHORT | {"defaults.level": level},
        drives={"reference-2d": shown},
    )
    assert drives_shown({"": run.assembly}, list(run.joints)) == {}
    path = run.to_rerun(tmp_path / "run.rrd")
    entities = {chunk.entity_path for chunk in RrdReader(path).stream()}
    assert not [entity for entity in entities if entity.startswith("/drive")]


def test_long_runs_have_no_more_frames(run):
    """Frames are thinned evenly, the first included."""
    rows = frames_of(run, "joint", np.arange(0, 100_000))
    assert 0.5 * FRAMES <= rows.size <= FRAMES
    assert rows[0] == 0
    assert len(np.unique(np.diff(rows))) == 1


def test_members_turn_as_the_layout_says():
    """Rotations relative to the fixed member."""
    theta, psi = np.array([0.6]), np.array([0.01])
    still = np.zeros(1)
    assert angles("circular_spline_fixed", theta, psi) == (psi, still, theta)
    assert angles("flexspline_fixed", theta, psi) == (still, psi, theta)
    assert angles("wave_generator_fixed", theta, psi) == (theta, psi, still)


def test_stress_goes_from_blue_to_red():
    """Opaque, and clipped."""
    low, high, beyond = stress_color(np.array([0.1, 0.95, 2.0]))
    assert low & 255 == 255
    assert (low >> 8) & 255 > low >> 24
    assert high >> 24 > (high >> 8) & 255
    assert beyond == stress_color(np.array([1.0]))[0]
