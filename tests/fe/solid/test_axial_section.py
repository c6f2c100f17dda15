"""Axial sections and coning: rigid motion, recovered displacements, the cone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.fe.solid.corotation import about_z
from swgjoint.fe.solid.figures.axial_section import (
    axial_sections,
    axis_sectors,
    coning,
    sector_points,
)

TURN = 0.3


def turned(model, state, angle):
    """A state turned about the axis of the drive as a whole."""
    matrix = about_z(np.array(angle))
    return replace(
        state,
        faces=state.faces @ matrix.T,
        inside=state.inside @ matrix.T,
        rotation=state.rotation + angle,
        wave_generator_angle=state.wave_generator_angle + angle,
    )


@pytest.fixture(scope="module")
def at_rest(small_ring):
    """The undeformed flexspline as a state."""
    x, size = small_ring.reference, small_ring.strip.masters.face_size
    start = small_ring.initial_guess()
    last = small_ring.strip.masters.size - size
    return replace(start, faces=x[:, :size], inside=x[:, size:last])


def test_rigid_rotation_is_no_deflection(small_ring, at_rest):
    """Turned as a whole the sections stay, and there is no coning."""
    state = turned(small_ring, at_rest, TURN)
    found = coning(small_ring, state)
    assert np.abs([found.major, found.minor]).max() < 1e-12
    for sector in axis_sectors(small_ring, state):
        for part in axial_sections(small_ring, state, sector):
            assert part.moved == pytest.approx(part.rest, abs=1e-12)


def test_coning_does_not_depend_on_where_the_drive_stands(small_ring, deflected):
    """Wave generator and flexspline turned together: the same cone."""
    here = coning(small_ring, deflected)
    there = coning(small_ring, turned(small_ring, deflected, TURN))
    assert there.major == pytest.approx(here.major, abs=1e-12)
    assert there.minor == pytest.approx(here.minor, abs=1e-12)


def test_small_coning_is_the_recovered_displacement(small_ring, at_rest, deflected):
    """A thousandth of the deflection, linear frames: displacements of the nodes."""
    model = replace(small_ring, nonlinear=False)
    small = 1e-3

    def part(name):
        rest = getattr(at_rest, name)
        return rest + small * (getattr(deflected, name) - rest)

    state = replace(at_rest, faces=part("faces"), inside=part("inside"))
    found = coning(model, state)
    teeth, frame = model.strip.teeth, model.frames(state)[0]
    u = teeth.displacement(frame.displacement)
    mesh = model.strip.mesh.teeth
    points = np.asarray(mesh.segment.mesh.p)
    low = np.flatnonzero(np.abs(points[0]) < 1e-9)
    low = low[np.hypot(*points[:2, low]) < np.hypot(*points[:2, low]).min() + 1e-9]
    low = low[np.argsort(points[2, low])][: len(found.z)]  # the cup goes on behind
    assert points[2, low] == pytest.approx(found.z)
    both = zip(axis_sectors(model, state), (found.major, found.minor), strict=True)
    for sector, radial in both:
        # y is radial in the frame of the tooth; the rest is of second order
        assert radial == pytest.approx(u[sector, low, 1], abs=2e-3 * abs(radial).max())
    assert found.major.min() > 0.0 > found.minor.max()


def test_the_cup_is_a_cone(small_ring, deflected):
    """The open edge moves farther than the closed one, out and in, on the axes."""
    major, minor = axis_sectors(small_ring, deflected)
    assert (major, minor) == (0, 10)  # 20 sectors in the half
    shown = coning(small_ring, deflected).to_json()
    assert shown["major"]["open_edge"] > shown["major"]["closed_edge"] > 0.0
    assert shown["minor"]["open_edge"] < shown["minor"]["closed_edge"] < 0.0


def test_section_is_cut_through_the_tooth(small_ring, small_design, deflected):
    """From the tip of the tooth to the bore of the diaphragm, without a gap."""
    parts = axial_sections(small_ring, deflected, 0)
    teeth, disc = parts[0].rest, parts[-1].rest
    tip = small_ring.strip.profile.addendum_radius
    assert teeth[:, 1].max() == pytest.approx(tip)
    assert disc[:, 1].min() == pytest.approx(small_design.cup.bore_radius_mm * 1e-3)
    area = 0.0
    for part in parts:
        corner = part.rest[part.cells]
        one, other = corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]
        signed = 0.5 * (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
        assert np.abs(signed).min() > 0.0
        area += np.abs(signed).sum()
    # the tooth with its rim, and a wall of 0.8 mm along 14 mm, a turn and the disc
    inner = small_design.flexspline_inner_radius
    width = small_design.drive.face_width_mm * 1e-3
    assert width * (tip - inner) < area < width * (tip - inner) + 0.8e-3 * 45e-3
    # the boss stands still
    still = disc[:, 1] < disc[:, 1].min() + 1e-9
    assert parts[-1].moved[still] == pytest.approx(disc[still], abs=1e-9)


def test_points_are_where_the_masters_are(small_ring, deflected):
    """Face nodes of neighbours meet: one section, seen from two sectors."""
    face = small_ring.strip.mesh.teeth.segment
    one, other = (sector_points(small_ring, deflected, k)[0] for k in (3, 4))
    assert one[face.last] == pytest.approx(other[face.first], abs=1e-9)
