"""Neutral line and rigid teeth: lengths, derivatives, passage through the space."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from scipy.special import ellipe

from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.neutral_line import neutral_line
from swgjoint.gear.teeth.tooth_motion import tooth_motions
from swgjoint.gear.teeth.tooth_path import tooth_path

INVOLUTE = {
    "flexspline.profile": {"kind": "involute"},
    "circular_spline.profile": {"kind": "involute"},
}
GENERATORS = {
    "elliptical": {"kind": "elliptical"},
    "simplified": {"kind": "simplified", "minor_axis_coefficient": 0.97},
    "cosine": {"kind": "cosine"},
}


def reference(**changes):
    return Design.load("reference-2d").with_changes(
        {key.replace("__", "."): value for key, value in changes.items()}
    )


def test_neutral_line_of_the_ellipse():
    """Its length is the ellipse's (elliptic integral) plus pi times the rim."""
    line = neutral_line(reference())
    a, b = 59.2e-3, 57.2e-3
    outline = 4.0 * a * ellipe(1.0 - (b / a) ** 2)
    assert line.length == pytest.approx(outline + pi * 1e-3, rel=1e-12)
    assert line.radius == pytest.approx(58.7e-3, rel=1e-12)
    excess = line.length / (2.0 * pi * line.radius) - 1.0
    assert line.extension == pytest.approx(2.0 * excess, rel=1e-9)
    assert line.extension < 2e-4


@pytest.mark.parametrize("kind", GENERATORS)
def test_neutral_line_is_followed_by_its_arc_length(kind):
    """Teeth move along the line without stretch at a lobe, and derivatives are true."""
    line = neutral_line(reference(wave_generator=GENERATORS[kind]))
    lobes = line.pose(np.array([0.0, pi, 2.0 * pi, -pi]))
    assert np.hypot(*lobes.d_point.T) == pytest.approx(line.radius, rel=1e-12)
    assert lobes.angle == pytest.approx([0.0, pi, 2.0 * pi, -pi], abs=1e-12)
    theta = np.linspace(-4.0, 9.0, 173)
    here, step = line.pose(theta), 1e-6
    ahead, behind = line.pose(theta + step), line.pose(theta - step)
    slope = (ahead.point - behind.point) / (2 * step)
    assert slope == pytest.approx(here.d_point, abs=1e-8)
    turn = (ahead.angle - behind.angle) / (2 * step)
    assert np.median(np.abs(turn - here.d_angle)) < 1e-7
    # the tooth stands on the line: it moves at right angles to itself
    along = np.stack([-np.sin(here.angle), np.cos(here.angle)], axis=-1)
    assert np.abs(np.sum(here.d_point * along, axis=-1)).max() < 1e-12
    # half a bore from the outline
    offset, _, _ = line.outline.signed_distance(here.point)
    assert offset == pytest.approx(0.5e-3, abs=1e-12)


def test_motion_there_and_back():
    """The two directions of the motion are inverse, with true velocities."""
    (motion,) = tooth_motions(reference())
    theta = np.linspace(-1.0, 1.0, 41) * motion.half_range
    point = np.broadcast_to([0.4e-3, 60.1e-3], (41, 2))
    there = motion.to_circular_spline(theta)
    back = motion.to_flexspline(theta)
    assert back.points(there.points(point)) == pytest.approx(point, abs=1e-16)
    step = 1e-6
    for to in (motion.to_circular_spline, motion.to_flexspline):
        slope = to(theta + step).points(point) - to(theta - step).points(point)
        speed = to(theta).velocities(point)
        assert slope / (2 * step) == pytest.approx(speed, abs=1e-9)


def test_a_passage_moves_the_tooth_by_one_space():
    """From minor to minor axis the tooth falls back by one pitch of the ring."""
    (motion,) = tooth_motions(reference())
    ends = motion.in_space(np.array([-1.0, 1.0]) * motion.half_range)
    tip = ends.points(np.broadcast_to([0.0, 60.6e-3], (2, 2)))
    polar = np.arctan2(tip[:, 0], tip[:, 1])
    assert polar[0] - polar[1] == pytest.approx(2.0 * pi / 122, rel=1e-12)


def test_symmetric_generators_need_one_motion_and_mirrors_agree():
    """The passage of an ellipse is its own mirror image; an unsymmetric one is not."""
    (motion,) = tooth_motions(reference())
    mirrored = replace(motion, mirrored=True)
    theta = np.linspace(-1.5, 1.5, 31)
    assert mirrored.in_space(theta).turn == pytest.approx(
        motion.in_space(theta).turn, abs=1e-12
    )
    skew = Design.load("reference-2d-asymmetric")
    side = {
        "parabola_coefficient_per_mm": 0.0097,
        "parabola_length_coefficient": 0.5,
        "connector_radius_mm": 40.0,
    }
    turned = {"kind": "asymmetric_parabolic", "rotation_deg": 1.0} | side
    assert len(tooth_motions(skew.with_changes({"wave_generator": turned}))) == 2


def test_edge_contact_of_involutes_is_where_the_thesis_sees_it():
    """Below 20 deg the flexspline's tips dig in, above it the ring gear's (6.3.1).

    Pressure angle of the ring gear 20 deg; thesis figure 6.11 and its text. Overlap
    is least between, as the stresses are.
    """
    found = {}
    for angle in (19.8, 20.0, 20.4):
        design = reference(**INVOLUTE, flexspline__pressure_angle_deg=angle)
        found[angle] = tooth_path(design, positions=361, points=201)
    assert found[19.8].where[found[19.8].worst] == "flexspline_tip"
    assert found[20.4].where[found[20.4].worst] == "circular_spline_tip"
    assert found[19.8].interference > found[20.0].interference > 1e-7
    assert found[20.4].interference > found[20.0].interference


def test_conjugate_pair_touches_without_overlap():
    """The generated ring gear is touched and never cut: under 1e-7 m over a turn."""
    design = reference(circular_spline__profile={"kind": "conjugate"})
    path = tooth_path(design, positions=361, points=201)
    assert path.interference < 1e-7
    assert abs(path.smallest_clearance) < 1e-8
    assert path.where[path.worst] == "flank"


def test_backlash_opens_the_flanks():
    """A ring gear thinned by c_P clears by half the backlash times cos of the flank."""
    made = {"kind": "conjugate"}
    design = reference(
        circular_spline__profile=made, circular_spline__thickness_coefficient=0.9
    )
    path = tooth_path(design, positions=721, points=401)
    # (6.3): both flanks together 0.1 pi m / 2; inclined by about 20 deg at the pitch
    half = 0.05 * pi * 1e-3 / 2.0
    assert 0.6 * half < path.smallest_clearance < half


def test_tooth_leaves_the_space():
    """Half-way between the lobes the tooth is out, at the lobe it is deepest."""
    path = tooth_path(reference(), positions=181, points=101)
    assert np.isinf(path.clearance[[0, -1]]).all()
    assert np.isfinite(path.clearance[90])
    assert path.tip[:, 1].argmax() == 90
    assert path.tip[90] == pytest.approx([0.0, 61.6e-3], abs=1e-12)
    assert 1.0 < path.engaged < pi
