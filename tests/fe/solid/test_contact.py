"""Rows of both contacts against differences, in a loaded state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.fe.solid.linearise import bore_contact
from swgjoint.fe.solid.teeth import FlankCrowning

STEP = 1e-8


@pytest.fixture(scope="module")
def moved(small_ring, loaded):
    """States with the masters moved along a random smooth way, and the way."""
    rng = np.random.default_rng(1)
    faces = rng.normal(size=(*loaded.faces.shape[:1], 1, 3)) * np.ones_like(
        loaded.faces
    )
    faces += 0.3 * rng.normal(size=faces.shape)
    inside = rng.normal(size=loaded.inside.shape)
    way = replace(loaded, faces=faces, inside=inside)

    def at(part):
        return replace(
            loaded,
            faces=loaded.faces + part * faces,
            inside=loaded.inside + part * inside,
        )

    masters = small_ring.masters(way)[:, small_ring.strip.teeth.masters]
    return at, masters.reshape(small_ring.sectors, -1)


def test_rows_of_the_wave_generator(small_ring, loaded, moved):
    """Change of the gaps at fixed forces in the frames of the teeth."""
    at, way = moved

    def gap(part):
        state = at(part)
        return bore_contact(small_ring, state, small_ring.frames(state)[0]).gap

    here = bore_contact(small_ring, loaded, small_ring.frames(loaded)[0])
    ours = here.change(way)
    # the rows of the points that touch say the same
    at_points = np.einsum("spm,sm->sp", here.rows, way)
    touching = here.among_points(here.active)
    assert touching.sum() == here.active.sum() > 50
    assert at_points[touching] == pytest.approx(
        here.among_points(ours)[touching], rel=1e-9, abs=1e-9
    )
    by = (gap(STEP) - gap(-STEP)) / (2 * STEP)
    # nodes, and vertices, which stay vertices as they roll
    b = here.normal.shape[1]
    vertex = here.present[:, b : b + (here.gap.shape[1] - b) // 2]
    assert vertex.size >= 100 and vertex.all()
    known = np.concatenate(
        [np.ones((len(vertex), b), bool), vertex, np.zeros_like(vertex)], axis=1
    )
    ours, by = ours[known], by[known]
    assert np.abs(ours - by).max() < 1e-6 * np.abs(by).max()


@pytest.mark.parametrize("crowned", [True, False])
def test_rows_of_the_teeth(small_ring, loaded, moved, crowned):
    """The same for the candidates on the flanks, whose feet move along."""
    at, way = moved
    model, crowning = small_ring, small_ring.teeth.crowning
    if not crowned:  # teeth that touch in the planes of the mesh
        straight = replace(crowning, height=0.0)
        model = replace(model, teeth=replace(model.teeth, crowning=straight))

    def found(part):
        state = at(part)
        return model.teeth.find(
            model.frames(state)[0],
            model.loads(state),
            model.teeth.displace_circular_spline(state.circular_spline_force),
            (0.4 if crowned else 0.2) * model.lobe_height,
            None,
            thorough=False,
        )

    def table(rows):
        c = rows.contacts
        keys = list(zip(c.sector, c.side, c.tooth, rows.plane, strict=True))
        return {key: k for k, key in enumerate(keys) if keys.count(key) == 1}

    here, low, high = found(0.0), found(-STEP), found(STEP)
    ours = np.einsum("km,km->k", here.rows, way[here.contacts.sector])
    at_low, at_high = table(low), table(high)
    # feet of the least gap: along the flank it does not change to first order
    pairs = [
        (ours[k], high.contacts.gap[at_high[key]] - low.contacts.gap[at_low[key]])
        for key, k in table(here).items()
        if key in at_low and key in at_high
    ]
    assert len(pairs) > (10 if crowned else 20)
    slope, by = np.array(pairs).T / [[1.0], [2 * STEP]]
    assert np.abs(slope - by).max() < 1e-3 * np.abs(by).max()


def test_contact_forces_push_and_close_gaps(small_ring, loaded):
    """Nothing pulls, no bore node enters, every one that is pushed touches."""
    contact = bore_contact(small_ring, loaded, small_ring.frames(loaded)[0])
    nodes, points = contact.normal.shape[1], loaded.pressure.shape[1]
    forces = np.split(loaded.pressure, [(nodes + points) // 2], axis=1)
    assert forces[0].min() >= 0.0
    # slopes do no work: what the last iteration leaves
    assert np.abs(forces[1]).max() < 1e-6 * forces[0].max()
    assert loaded.tooth_force.min() >= 0.0
    assert contact.gap.min() > -1e-9
    assert np.abs(contact.gap[loaded.touching]).max() < 1e-9
    assert not loaded.pressure[~loaded.touching].any()
    assert (loaded.pressure > 0.0).sum() > 50


@pytest.mark.parametrize("circular", [False, True])
def test_crowned_teeth_are_thinner_at_the_edges(small_ring, circular):
    """Both flanks recede along their normals, a parabola or an arc over the width."""
    strip = small_ring.strip
    z = strip.mesh.teeth.z - strip.mesh.teeth.z.mean()
    width = float(np.ptp(z))
    crowning = FlankCrowning(height=20e-6, width=width, circular=circular)
    moved = crowning.displacement(strip)  # (n_planes, 2 n_b, 2)
    depth = np.linalg.norm(moved, axis=-1)
    expected = 20e-6 * (2.0 * z / width) ** 2
    if circular:
        arc = (0.25 * width**2 + 20e-6**2) / (2.0 * 20e-6)
        expected = arc - np.sqrt(arc**2 - z**2)
    assert depth[0] == pytest.approx(20e-6, rel=1e-6)
    np.testing.assert_allclose(depth.T - expected, 0.0, atol=1e-13)
    right, left = np.split(moved[0], 2)
    assert (right[:, 0] <= 0.0).all() and (left[:, 0] >= 0.0).all()
    assert np.abs(right * np.array([-1.0, 1.0]) - left).max() < 1e-15
    # the tooth gets thinner where the flank is steep, and no flank grows outward
    assert right[:, 0].min() < -15e-6
    assert (moved[0, :, 1] <= 1e-12).all()
