"""Compiled loops of the Hermite ring against those of numpy."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.rings.facing import distances_to_ring
from swgjoint.fe.rings.hermite_ring import HermiteRing
from swgjoint.kernels import kernels

pytestmark = pytest.mark.skipif(
    kernels() is None, reason="the package was built without compiled loops"
)


@pytest.mark.parametrize("elements", [3, 24, 101])
@pytest.mark.parametrize("bending", [0.0, 0.1, 1e3])
def test_forces_are_those_of_numpy(monkeypatch, elements, bending):
    """Energy, gradient and Hessian of a stretched, bent and turned ring."""
    ring = HermiteRing(radius=30e-3, elements=elements, stretching=2e6, bending=bending)
    rng = np.random.default_rng(elements)
    q = ring.reference.ravel() * 1.01
    q = q + 2e-3 * ring.step * rng.normal(size=ring.size)
    ours = ring.forces(q)
    monkeypatch.setattr("swgjoint.fe.rings.hermite_ring.kernels", lambda: None)
    theirs = ring.forces(q)
    assert ours[0] == theirs[0]
    for own, other in zip(ours[1:], theirs[1:], strict=True):
        assert own.shape == other.shape
        assert own == pytest.approx(other, rel=0.0, abs=1e-13 * np.abs(other).max())
    assert np.abs(theirs[1]).max() > 0.0


def test_arrays_of_other_shapes_are_refused():
    """Instead of reading or writing beyond their ends."""
    shapes = [
        (2, 3),
        (3, 2, 4),
        (5, 3, 2, 2),
        (5, 3),
        (5, 3),
        (5, 3),
        (5, 8),
        (5, 8, 8),
    ]
    ring_forces = kernels().ring_forces
    arrays = [np.ones(shape) for shape in shapes]
    ring_forces(1.0, *arrays)
    for k, shape in enumerate(shapes):
        wrong = [*arrays[:k], np.ones((*shape[:-1], shape[-1] + 1)), *arrays[k + 1 :]]
        with pytest.raises(ValueError, match=":"):
            ring_forces(1.0, *wrong)
    for k in range(2, len(shapes)):
        wrong = [*arrays[:k], arrays[k][:-1].copy(), *arrays[k + 1 :]]
        with pytest.raises(ValueError, match=":"):
            ring_forces(1.0, *wrong)


@pytest.mark.parametrize("inside", [True, False])
@pytest.mark.parametrize("bound", [True, False])
@pytest.mark.parametrize("turns", [0, -1, 3])
def test_distances_are_those_of_numpy(monkeypatch, inside, bound, turns):
    """All fields; feet on every element, also beyond the ends of prescribed ones."""
    ring = HermiteRing(radius=30e-3, elements=20, stretching=2e6, bending=0.1)
    rng = np.random.default_rng(turns + 5)
    q = ring.reference.ravel() + 5e-3 * ring.step * rng.normal(size=ring.size)
    angle = 2.0 * np.pi * np.arange(57) / 57
    radius = ring.radius + 1e-3 * rng.normal(size=57)
    points = radius[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
    start = 20 / 57 * np.arange(57) + rng.uniform(-0.4, 0.4, 57)
    own = np.round(start).astype(np.int64) % 20 if bound else None
    start += 0 if bound else 20 * turns
    options = {"inside": inside, "own": own}
    ours = distances_to_ring(ring, q, points, start, **options)
    monkeypatch.setattr("swgjoint.fe.rings.facing.kernels", lambda: None)
    theirs = distances_to_ring(ring, q, points, start, **options)
    assert np.array_equal(ours.dofs, theirs.dofs)
    for key in ("place", "distance", "normal", "tangent", "by_ring", "curvature"):
        own_field, other = getattr(ours, key), getattr(theirs, key)
        assert own_field.shape == other.shape
        size = np.abs(other).max()
        assert own_field == pytest.approx(other, rel=0.0, abs=1e-13 * size), key


def test_points_without_a_foot_have_no_distance():
    """Not a number, in place of an element outside the ring."""
    ring = HermiteRing(radius=30e-3, elements=20, stretching=2e6, bending=0.1)
    points = np.array([[0.0, 31e-3], [0.0, 31e-3], [np.nan, 0.0]])
    start = np.array([0.0, np.inf, 0.0])
    with np.errstate(all="ignore"):
        seen = distances_to_ring(
            ring, ring.reference.ravel(), points, start, inside=False
        )
    assert np.isfinite(seen.distance).tolist() == [True, False, False]


def test_arrays_that_do_not_face_a_ring_are_refused():
    """Wrong shapes, and elements outside the ring."""
    face_ring = kernels().face_ring
    whole = np.zeros(7, np.int64)
    arrays = [np.ones(80), np.ones((7, 2)), np.ones(7), whole, False]
    arrays += [np.ones(7), whole.copy(), np.ones(7), np.ones((7, 2)), np.ones((7, 2))]
    arrays += [np.ones((7, 3, 8)), np.ones(7)]
    face_ring(*arrays)
    for k, array in enumerate(arrays):
        if k == 4:
            continue
        last = (*array.shape[:-1], array.shape[-1] + 1)
        with pytest.raises(ValueError, match=":"):
            wrong = np.zeros(last, array.dtype)
            face_ring(*arrays[:k], wrong, *arrays[k + 1 :])
    for outside in (-1, 20):
        own = np.full(7, outside)
        with pytest.raises(ValueError, match="own: elements"):
            face_ring(*arrays[:3], own, *arrays[4:])
