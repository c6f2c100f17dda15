"""Mesh of the strip and its master nodes."""

from __future__ import annotations

import numpy as np
import pytest
from skfem import Basis, ElementHex1

from swgjoint.fe.solid.corotation import about_z
from swgjoint.fe.solid.strip.masters import Orders, SegmentMasters, strip_masters
from swgjoint.fe.solid.strip.mesh import circular_spline_strip, flexspline_strip
from swgjoint.fe.solid.strip.segment import condense_segment
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_profile import tooth_profile


def strip_of(name="reference-3d", **changes):
    design = Design.load(name).with_changes(**changes)
    return flexspline_strip(design, tooth_profile(design, "flexspline"))


@pytest.fixture(scope="module")
def strip():
    return strip_of()


@pytest.fixture(scope="module", params=["cup", "hat"])
def any_strip(request, strip):
    if request.param == "cup":
        return strip
    return strip_of(cup__kind="hat", cup__bore_radius_mm=80.0)


def test_mesh_has_the_size_of_that_of_the_thesis(strip):
    """2783 nodes and 1940 elements a tooth, 1991 and 1460 of the circular spline."""
    design = Design.load("reference-3d")
    facing = circular_spline_strip(design, tooth_profile(design, "circular_spline"))
    assert (strip.nodes, strip.elements) == (2783, 1940)
    assert (facing.nodes, facing.elements) == (1991, 1460)
    # every sector with both of its faces, as the thesis counts them
    assert 120 * strip.nodes + 122 * facing.nodes == 576_862


def test_volume_is_that_of_the_parts(any_strip):
    """Teeth by their section, the shells by Pappus; no element is turned inside out."""
    for segment in any_strip.segments:
        basis = Basis(segment.mesh, ElementHex1(), intorder=3)
        assert basis.mapping.detDF(basis.X).min() > 0.0
    plane = any_strip.teeth.plane
    x, y = plane.mesh.p[:, plane.mesh.t]
    area = 0.5 * np.sum(x * np.roll(y, -1, axis=0) - y * np.roll(x, -1, axis=0))
    z = any_strip.teeth.z
    disc = any_strip.cup[-1]
    face = np.asarray(disc.mesh.p)[:, disc.first]
    wall = np.ptp(face[2])
    r = np.hypot(face[0], face[1])
    found = Basis(disc.mesh, ElementHex1(), intorder=3).dx.sum()
    # chords over a tenth of a pitch
    chord = np.sinc(plane.half_pitch / 5.0 / np.pi)
    assert found == pytest.approx(
        plane.half_pitch * abs(r.max() ** 2 - r.min() ** 2) * wall * chord, rel=1e-9
    )
    teeth = any_strip.teeth.segment.mesh
    inside = teeth.p[2, teeth.t].mean(axis=0) < z[-1]
    found = Basis(teeth, ElementHex1(), intorder=3).dx.sum(axis=1)[inside].sum()
    assert found == pytest.approx(area * np.ptp(z), rel=1e-12)


def test_faces_and_sections_meet(any_strip):
    """A last face is the next tooth's first face; segments share their sections."""
    turn = about_z(np.array(2.0 * any_strip.teeth.plane.half_pitch))
    before = None
    for segment in any_strip.segments:
        p = np.asarray(segment.mesh.p).T
        assert p[segment.last] == pytest.approx(p[segment.first] @ turn.T, abs=1e-12)
        if before is not None:
            assert p[segment.begin] == pytest.approx(before, abs=1e-9)
        before = None if segment.end is None else p[segment.end]


@pytest.mark.parametrize(
    "orders",
    [
        Orders(),
        Orders(rim=1, wall=1),
        Orders(teeth=8, cup=9, around=3, rim=4, rim_bending=9, wall_bending=2),
    ],
)
def test_masters_add_up_and_carry_linear_fields(any_strip, orders):
    """Weights of every boundary node sum to one, and place it where it is."""
    masters = strip_masters(any_strip, orders)
    assert np.isfinite(masters.position).all()
    scale = np.ptp(masters.position, axis=0).max()
    for segment, follow in zip(any_strip.segments, masters.segments, strict=True):
        assert np.abs(follow.weight.sum(axis=1) - 1.0).max() < 1e-12
        p = np.asarray(segment.mesh.p).T[follow.boundary]
        carried = follow.weight @ masters.position[follow.masters]
        # the surface between teeth and cup is curved; its masters are fitted to it
        assert np.abs(carried - p).max() < 2e-3 * scale


def test_neighbours_agree_on_the_face_between_them(strip):
    """Masters of a last face are those of the next first face, and move it alike."""
    masters = strip_masters(strip)
    size = masters.face_size
    turn = about_z(np.array(2.0 * strip.teeth.plane.half_pitch))
    first, last = masters.position[:size], masters.position[-size:]
    assert last == pytest.approx(first @ turn.T, abs=1e-12)
    for segment, follow in zip(strip.segments, masters.segments, strict=True):
        rows = np.zeros((len(follow.boundary), masters.size))
        rows[:, follow.masters] = follow.weight
        a = rows[np.searchsorted(follow.boundary, segment.first)]
        b = rows[np.searchsorted(follow.boundary, segment.last)]
        assert a[:, :size] == pytest.approx(b[:, -size:], abs=1e-14)
        assert not a[:, size:].any()
        assert not b[:, :-size].any()


def test_segments_agree_on_the_section_between_them(strip):
    """The same masters move a section the same way, seen from either segment."""
    masters, seen = strip_masters(strip), None
    for segment, follow in zip(strip.segments, masters.segments, strict=True):
        rows = np.zeros((len(follow.boundary), masters.size))
        rows[:, follow.masters] = follow.weight
        if seen is not None:
            begin = np.searchsorted(follow.boundary, segment.begin.ravel())
            assert rows[begin] == pytest.approx(seen, abs=1e-12)
        seen = rows[np.searchsorted(follow.boundary, segment.end.ravel())]


def test_degrees_are_cut_to_what_the_nodes_can_tell_apart(strip):
    """More masters along a segment than stations of nodes would move nothing."""
    orders = {"wall_bending": 99, "rim_bending": 99}
    most = strip_masters(
        strip, Orders(teeth=12, cup=4, at_teeth=10, around=10, rim=2, wall=2, **orders)
    )
    more = Orders(teeth=99, cup=9, at_teeth=99, around=99, rim=2, wall=2, **orders)
    assert strip_masters(strip, more).size == most.size
    for follow in most.segments:
        assert np.linalg.matrix_rank(follow.weight) == len(follow.masters)


@pytest.mark.parametrize(("wall", "low", "high"), [(2, 0.9985, 1.0), (1, 0.98, 0.99)])
@pytest.mark.parametrize("along", [0, 2])
def test_a_wall_that_bends_may_swell(strip, wall, low, high, along):
    """Compliance of a piece of the cup under the forces of pure bending, either way.

    One side gets thicker and the other one thinner: a parabola through the wall.
    Straight lines forbid it, which made the whole cup 0.5 % too stiff.
    """
    design = Design.load("reference-3d")
    steel = design.material_of("flexspline")
    masters = strip_masters(strip, Orders(wall=wall))
    number = 2
    mesh, follow = strip.segments[number], masters.segments[number]
    nodes = np.asarray(mesh.mesh.p).T
    every = SegmentMasters(
        boundary=follow.boundary,
        masters=np.arange(len(follow.boundary)),
        weight=np.eye(len(follow.boundary)),
    )
    full, few = (
        condense_segment(
            mesh,
            which,
            position,
            youngs_modulus=steel.youngs_modulus,
            poisson_ratio=steel.poisson_ratio,
        ).stiffness
        for which, position in (
            (every, nodes[follow.boundary]),
            (follow, masters.position),
        )
    )
    # bent about the other one of the axes along the wall: Timoshenko and Goodier,
    # "Theory of elasticity", article 102
    x = nodes[follow.boundary] - nodes.mean(axis=0)
    across = 2 - along
    nu, u = steel.poisson_ratio, np.zeros_like(x)
    u[:, along] = -x[:, along] * x[:, 1]
    u[:, across] = nu * x[:, across] * x[:, 1]
    u[:, 1] = 0.5 * (x[:, along] ** 2 + nu * (x[:, 1] ** 2 - x[:, across] ** 2))
    force = full @ u.ravel()
    pull = np.kron(follow.weight, np.eye(3)).T @ force
    found = pull @ np.linalg.lstsq(few, pull, rcond=1e-11)[0]
    ratio = found / (force @ u.ravel())
    assert low < ratio < high
