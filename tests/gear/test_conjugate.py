"""Conjugate profiles: no overlap, contact everywhere, both directions, refusals."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given as for_any
from hypothesis import settings
from hypothesis import strategies as st
from messages import naming

from swgjoint.errors import DesignError
from swgjoint.gear.design.design import Design
from swgjoint.gear.teeth.tooth_motion import tooth_motions
from swgjoint.gear.teeth.tooth_profile import tooth_profile

MEMBERS = ("flexspline", "circular_spline")
PROFILES = {
    "qca": None,
    "dca": {
        "kind": "dca",
        "addendum_radius_mm": 1.0,
        "dedendum_radius_mm": 0.6,
        "straight_split": 0.0,
    },
    "involute": {"kind": "involute"},
}
GENERATORS = {
    "elliptical": None,
    "simplified": {"kind": "simplified", "minor_axis_coefficient": 0.97},
    "cosine": {"kind": "cosine"},
    "parabolic": {
        "kind": "parabolic",
        "parabola_coefficient_per_mm": 0.0097,
        "parabola_length_coefficient": 0.5,
        "connector_radius_mm": 50.0,
    },
}
GENERATORS["turned"] = {
    **GENERATORS["parabolic"],
    "kind": "asymmetric_parabolic",
    "rotation_deg": 0.5,
    "connector_radius_mm": 40.0,
}
SYMMETRIC = [name for name in GENERATORS if name != "turned"]
CASES = [("qca", generator) for generator in SYMMETRIC]
CASES += [("dca", "elliptical"), ("involute", "elliptical")]


@cache
def pair(member, kind, generator, thickness=1.0, teeth=122):
    """Design, given and generated profile, and the motions between them."""
    other = MEMBERS[1 - MEMBERS.index(member)]
    changes = {
        f"{member}.profile": {"kind": "conjugate"},
        f"{member}.thickness_coefficient": thickness,
        "drive.teeth_circular_spline": teeth,
    }
    if PROFILES[kind]:
        changes[f"{other}.profile"] = PROFILES[kind]
    if GENERATORS[generator]:
        changes["wave_generator"] = GENERATORS[generator]
    design = Design.load("reference-2d").with_changes(changes)
    return (
        tooth_profile(design, other),
        tooth_profile(design, member),
        tooth_motions(design),
    )


def gaps(given, made, motion, theta, count=601):
    """Distance of points of the given flank to the generated one (n_theta, count)."""
    points, _, _ = given.evaluate(np.linspace(*given.contact_range, count))
    wide = np.broadcast_to(points, (len(theta), *points.shape))
    seen = motion.map_to(made.member, theta).points(wide).reshape(-1, 2)
    return made.signed_distance(seen)[0].reshape(len(theta), count)


@pytest.mark.parametrize("member", MEMBERS)
@pytest.mark.parametrize(("kind", "generator"), CASES)
def test_no_overlap_and_laws(member, kind, generator, profile_laws):
    """A rigid tooth turned past its mate touches it and overlaps nowhere.

    Dense and independent of the envelope: positions and points on equal grids, distance
    by projection.
    """
    given, made, motions = pair(member, kind, generator)
    profile_laws(made)
    for motion in motions:
        wide = np.linspace(-1.0, 1.0, 101) * motion.half_range
        near = np.linspace(-0.1, 0.1, 201) * motion.half_range
        gap = gaps(given, made, motion, np.concatenate([wide, near]), 201)
        assert -1e-9 < gap.min() < 1e-9  # the demand is 1e-7


@pytest.mark.parametrize("member", MEMBERS)
@pytest.mark.parametrize(("kind", "generator"), CASES)
def test_every_point_of_the_flank_touches_once(member, kind, generator):
    """Each point of the generated flank meets the given one tangentially.

    The reverse of how it was generated: at off-node points, the position at which the
    slip vanishes has distance zero; the meshing equation holds to 1e-10 of the radius.
    """
    given, made, motions = pair(member, kind, generator)
    names = [p.name for p in made.segments if p.name.startswith("conjugate")]
    s = np.linspace(*made.range_of(names[0], names[-1]), 39)[1:-1]
    points, normals, _ = made.evaluate(s)
    (motion,) = motions

    def slip(theta):
        moved = motion.map_to(given.member, theta)
        return np.sum(moved.vectors(normals) * moved.velocities(points), axis=-1)

    # the distance is smallest where the slip changes sign
    grid = np.linspace(-0.15, 0.15, 241)
    seen = np.stack(
        [motion.map_to(given.member, np.full(len(s), t)).points(points) for t in grid]
    )
    gap = given.signed_distance(seen.reshape(-1, 2))[0].reshape(len(grid), len(s))
    k = np.clip(np.argmin(gap, axis=0), 1, len(grid) - 2)
    low, high = grid[k - 1], grid[k + 1]
    sign = np.sign(slip(low))
    for _ in range(60):
        middle = 0.5 * (low + high)
        same = np.sign(slip(middle)) == sign
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    theta = 0.5 * (low + high)
    residual = np.abs(slip(theta)) / motion.line.radius
    assert residual.max() < 1e-10
    touching = motion.map_to(given.member, theta).points(points)
    distance, other, _ = given.signed_distance(touching)
    assert np.abs(distance).max() < 1e-10
    turned = motion.map_to(given.member, theta).vectors(normals)
    assert np.abs(other + turned).max() < 1e-6


@pytest.mark.parametrize("member", MEMBERS)
def test_unsymmetric_generator_clears_on_both_flanks(member, profile_laws):
    """With turned lobes left and right differ; the tooth keeps off both of them."""
    given, made, motions = pair(member, "qca", "turned")
    profile_laws(made)
    assert len(motions) == 2
    lowest = []
    for motion in motions:
        theta = np.linspace(-0.12, 0.12, 201) * motion.half_range
        lowest.append(gaps(given, made, motion, theta, 201).min())
    assert -1e-9 < min(lowest) < 1e-9


def test_three_lobes_mesh_as_two_do(profile_laws):
    """With three lobes and three teeth more the pair is conjugate as well."""
    given, made, motions = pair("circular_spline", "qca", "cosine", teeth=123)
    profile_laws(made)
    (motion,) = motions
    assert motion.half_range == pytest.approx(np.pi / 3)
    theta = np.linspace(-1.0, 1.0, 251) * motion.half_range
    assert gaps(given, made, motion, theta, 301).min() > -1e-9


def test_backlash_turns_the_flank(profile_laws):
    """A thickness of 0.9 thins the tooth by 0.1 pi/(2N) on either side (6.3)."""
    _, full, _ = pair("circular_spline", "qca", "elliptical")
    _, thin, _ = pair("circular_spline", "qca", "elliptical", thickness=0.9)
    profile_laws(thin)
    name = "conjugate_straight"
    ends = []
    for p in (full, thin):
        points, _, _ = p.evaluate(np.array(p.range_of(name, name)))
        ends.append(np.arctan2(*points.T))
    turn = 0.1 * np.pi / (2 * full.teeth)
    assert ends[0] - ends[1] == pytest.approx([turn, turn], rel=1e-9)


def test_double_conjugation_returns_the_flank():
    """The flexspline conjugate to the generated ring is the flexspline it came from."""
    given, made, motions = pair("circular_spline", "qca", "elliptical")
    from swgjoint.gear.teeth.blank import blank
    from swgjoint.gear.teeth.conjugate import _Builder
    from swgjoint.gear.teeth.envelope import Envelope

    design = Design.load("reference-2d")
    envelope = Envelope(
        given=made, receiver="flexspline", motions=motions, tip=given.addendum_radius
    )
    back = _Builder(blank(design, "flexspline"), envelope)
    run = envelope.runs()[0]
    names = [p.name for p in made.segments if p.name.startswith("conjugate")]
    low, high = made.range_of(names[0], names[-1])
    s = np.linspace(low, high, 60)[5:-25]
    points, _, _ = envelope.trace(run, s)
    assert np.abs(given.signed_distance(points @ back.turn)[0]).max() < 1e-9


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"thickness_coefficient": 1.1}, ("thickness_coefficient", "1.1", "<= 1")),
        (
            {"dedendum_coefficient": 0.5},
            ("dedendum_coefficient", "0.5", "> 0.6"),
        ),
        (
            {"addendum_coefficient": 0.9},
            ("circular_spline.addendum_coefficient", "0.9", "< 0.7898"),
        ),
        (
            {"addendum_coefficient": 0.01, "dedendum_coefficient": 2.0},
            ("circular_spline.dedendum_coefficient", "2.0", "0.6"),
        ),
        (
            {"profile": {"kind": "conjugate", "root_radius_mm": 2.0}},
            ("circular_spline.profile.root_radius_mm", "2.0 mm"),
        ),
    ],
)
def test_impossible_conjugates_are_refused(make_profile, values, message):
    """What has no conjugate tooth is refused in one line with the key."""
    values = {"profile": {"kind": "conjugate"}} | values
    with pytest.raises(DesignError, match=naming(*message)) as error:
        make_profile("circular_spline", values)
    assert "\n" not in str(error.value)


any_pair = for_any(
    member=st.sampled_from(MEMBERS),
    kind=st.sampled_from(["dca", "involute", "two_arc"]),
    generator=st.sampled_from(["elliptical", "simplified", "cosine"]),
    teeth=st.integers(25, 100),
    addenda=st.tuples(st.floats(0.3, 0.8), st.floats(0.3, 0.8)),
    clearance=st.tuples(st.floats(0.0, 0.4), st.floats(0.0, 0.4)),
    angle=st.floats(10.0, 30.0),
    thickness=st.floats(0.7, 1.0),
)


@settings(max_examples=8, deadline=None)
@any_pair
def test_any_conjugate_is_right_or_refused(profile_laws, **drawn):
    """Parameters give a flank that obeys the laws and clears, or one line."""
    assert_right_or_refused(profile_laws, **drawn)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@any_pair
def test_many_conjugates_are_right_or_refused(profile_laws, **drawn):
    """The same of more of them."""
    assert_right_or_refused(profile_laws, **drawn)


def assert_right_or_refused(
    profile_laws, member, kind, generator, teeth, addenda, clearance, angle, thickness
):
    """Laws and clearance of a pair, or a line that names a key."""
    other = MEMBERS[1 - MEMBERS.index(member)]
    section = PROFILES.get(kind) or {"kind": kind}
    changes = {
        f"{member}.profile": {"kind": "conjugate"},
        f"{other}.profile": section,
        f"{other}.pressure_angle_deg": angle,
        f"{other}.thickness_coefficient": thickness,
        "drive.teeth_flexspline": 2 * teeth,
        "drive.teeth_circular_spline": 2 * teeth + 2,
    }
    for k, name in enumerate((member, other)):
        changes[f"{name}.addendum_coefficient"] = addenda[k]
        changes[f"{name}.dedendum_coefficient"] = addenda[1 - k] + clearance[k]
    if GENERATORS[generator]:
        changes["wave_generator"] = GENERATORS[generator]
    try:
        design = Design.load("reference-2d").with_changes(changes)
        made = tooth_profile(design, member)
    except DesignError as error:
        assert "\n" not in str(error)
        keys = ("_coefficient", "_mm", "_deg", "kind", "wave_generator", "_teeth")
        assert any(key in str(error) for key in keys)
        return
    profile_laws(made)
    for motion in tooth_motions(design):
        theta = np.linspace(-0.3, 0.3, 201) * motion.half_range
        gap = gaps(tooth_profile(design, other), made, motion, theta, 201)
        assert gap.min() > -1e-7


def test_rollers_are_refused():
    """Between rollers the rim leaves the outline: no rigid kinematics."""
    design = Design.load("reference-2d").with_changes(
        {
            "wave_generator": {
                "kind": "four_roller",
                "aperture_deg": 30.0,
                "roller_radius_mm": 15.0,
            },
            "flexspline.profile": {"kind": "conjugate"},
        }
    )
    with pytest.raises(
        DesignError, match=naming("wave_generator.kind", "'four_roller'")
    ):
        tooth_profile(design, "flexspline")
