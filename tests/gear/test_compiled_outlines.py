"""Compiled distances from outlines against the numpy code and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.gear.design.design import Design
from swgjoint.gear.wave_generators.chain import Chain
from swgjoint.gear.wave_generators.curve import Kind
from swgjoint.gear.wave_generators.ellipse import Elliptical
from swgjoint.gear.wave_generators.parabolic import Side, parabolic
from swgjoint.gear.wave_generators.pieces import Arc, Line
from swgjoint.gear.wave_generators.radial import Cosine, TableOutline
from swgjoint.gear.wave_generators.wave_generator import wave_generator
from swgjoint.kernels import kernels

SIDE = Side(coefficient=9.7, length_coefficient=0.51, connector_radius=0.01)

pytestmark = pytest.mark.skipif(
    kernels() is None, reason="the package was built without compiled loops"
)


@pytest.mark.parametrize("minor", [1.0, 0.98, 0.5, 0.1])
def test_distances_are_those_of_numpy(monkeypatch, minor):
    """Inside, outside, on the axes, at the centre and at the evolute's cusps."""
    outline = Elliptical(major=0.03, minor=0.03 * minor)
    rng = np.random.default_rng(3)
    axis = np.linspace(-0.05, 0.05, 101)
    still = np.zeros_like(axis)
    points = np.concatenate(
        [
            rng.uniform(-0.05, 0.05, (4000, 2)),
            outline.evaluate(np.linspace(0.0, outline.perimeter, 500))[0],
            np.stack([axis, still], -1),
            np.stack([still, axis], -1),
        ]
    )
    distance, normal, curvature = outline.signed_distance(points)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    wanted = outline.signed_distance(points)
    np.testing.assert_allclose(distance, wanted[0], rtol=0.0, atol=1e-15)
    # the foot of a point on the inner part of the minor axis is not unique
    off = (np.abs(points) > 1e-12).all(axis=1)
    np.testing.assert_allclose(normal[off], wanted[1][off], rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(curvature[off], wanted[2][off], rtol=1e-10)


def test_distance_from_a_circle():
    """Radius of the point less that of the circle."""
    points = np.random.default_rng(5).uniform(-0.05, 0.05, (1000, 2))
    circle = Elliptical(major=0.03, minor=0.03)
    distance, normal, curvature = circle.signed_distance(points)
    radius = np.hypot(*points.T)
    np.testing.assert_allclose(distance, radius - 0.03, rtol=0.0, atol=1e-16)
    np.testing.assert_allclose(normal, points / radius[:, None], atol=1e-14)
    np.testing.assert_allclose(curvature, 1.0 / 0.03, rtol=1e-14)


@pytest.mark.parametrize(
    "outline",
    [
        wave_generator(Design.load("reference-2d-parabolic")),
        wave_generator(Design.load("reference-2d-asymmetric")),
        parabolic(major=0.0311, minor=0.029, left=SIDE, right=SIDE, turn=0.05),
        wave_generator(Design.load("reference-2d-four-roller")).band,
    ],
    ids=["parabolic", "asymmetric", "rotated lobes", "band"],
)
def test_distances_from_chains_are_those_of_numpy(monkeypatch, outline):
    """Outside, inside as far as contact reaches, on the outline, at the junctions."""
    rng = np.random.default_rng(4)
    along = rng.uniform(0.0, outline.perimeter, 4000)
    foot, normal, curvature = outline.evaluate(np.append(along, outline.stations))
    depth = rng.uniform(-0.3, 1.0, len(foot)) / np.maximum(curvature, 50.0)
    points = np.concatenate([foot, foot + depth[:, None] * normal])
    found = outline.signed_distance(points)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    wanted = outline.signed_distance(points)
    np.testing.assert_allclose(found[0], wanted[0], rtol=0.0, atol=2e-16)
    np.testing.assert_allclose(found[1], wanted[1], rtol=0.0, atol=1e-12)
    # at a junction, the foot may be on either piece; its curvature jumps there
    jump = np.abs(found[2] - wanted[2]) > 1e-9 * np.abs(wanted[2])
    at = np.abs(np.append(along, outline.stations)[:, None] - outline.stations)
    assert (np.tile(at.min(axis=1), 2)[jump] < 1e-12).all()


def test_far_inside_all_pieces_are_searched(monkeypatch):
    """Distances where no end normals enclose the point, and at the centre of an arc."""
    outline = wave_generator(Design.load("reference-2d-asymmetric"))
    points = np.random.default_rng(6).uniform(-0.02, 0.02, (2000, 2))
    found = outline.signed_distance(points)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    np.testing.assert_allclose(
        found[0], outline.signed_distance(points)[0], rtol=0.0, atol=1e-15
    )


def measured_table(count):
    """Outline through the radii of an ellipse, rounded to a micrometre."""
    at = 2.0 * np.pi * np.arange(count) / count
    radius = 1.0 / np.hypot(np.cos(at) / 0.0311, np.sin(at) / 0.029)
    return TableOutline((at + 0.02).tolist(), np.round(radius, 6).tolist())


@pytest.mark.parametrize(
    "outline",
    [
        measured_table(9),
        measured_table(72),
        Cosine(major=0.0311, minor=0.029),
        Cosine(major=0.0311, minor=0.029, lobes=3),
        Cosine(major=0.03, minor=0.015),  # concave
    ],
    ids=["few radii", "table", "two lobes", "three lobes", "concave"],
)
@pytest.mark.parametrize("nearest, farthest", [(0.97, 1.03), (0.01, 3.0)])
def test_distances_from_radii_are_those_of_numpy(
    monkeypatch, outline, nearest, farthest
):
    """As near as contact is, and from the centre to far outside."""
    rng = np.random.default_rng(8)
    at = rng.uniform(-10.0, 10.0, 1500)
    foot, _, _ = outline.evaluate_at(at)
    points = foot * rng.uniform(nearest, farthest, at.size)[:, None]
    found = outline.signed_distance(points)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    wanted = outline.signed_distance(points)
    np.testing.assert_allclose(found[0], wanted[0], rtol=0.0, atol=2e-16)
    np.testing.assert_allclose(found[1], wanted[1], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found[2], wanted[2], rtol=0.0, atol=1e-10)


def test_outlines_of_no_kind_are_refused():
    """Two whole outlines, a mixture, angles that fall, and an unknown number."""
    whole = [[Kind.COSINE, 0.03, 0.02, 2.0, 0.0, 0.0, 0.0]]
    spline = measured_table(9).rows.tolist()
    arc = [[Kind.ARC, 0.0, 0.0, 0.01, 0.0, 1.0, 0.0]]
    for rows in (2 * whole, whole + spline, spline + arc, spline[::-1], [[7.0] * 7]):
        with pytest.raises(ValueError):
            kernels().outline_distance(
                np.zeros((2, 2)), np.array(rows, float), np.zeros((2, 4))
            )


def test_distance_from_a_rounded_square():
    """Arcs and lines against the closed form of a square enlarged by a radius."""
    half, r = 0.02, 0.005
    corners = [(-half, half), (-half, -half), (half, -half), (half, half)]
    pieces = [Line(start=(0.0, half + r), end=(-half, half + r))]
    for k, (centre, after) in enumerate(
        zip(corners, [*corners[1:], corners[0]], strict=True)
    ):
        start = 0.5 * np.pi * (k + 1)
        pieces.append(Arc(centre=centre, radius=r, start=start, end=start + np.pi / 2))
        out = np.array([np.cos(start + np.pi / 2), np.sin(start + np.pi / 2)]) * r
        end = np.add(after, out) if k < 3 else np.array([0.0, half + r])
        pieces.append(Line(start=tuple(np.add(centre, out)), end=tuple(end)))
    outline = Chain(pieces=tuple(pieces))
    assert np.abs(outline.gaps()).max() < 1e-17
    points = np.random.default_rng(7).uniform(-0.05, 0.05, (3000, 2))
    beyond = np.abs(points) - half
    wanted = (
        np.hypot(*np.maximum(beyond, 0.0).T) + np.minimum(beyond.max(axis=1), 0.0) - r
    )
    np.testing.assert_allclose(outline.signed_distance(points)[0], wanted, atol=1e-16)
