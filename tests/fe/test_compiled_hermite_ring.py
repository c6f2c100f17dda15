"""Compiled forces of the Hermite ring against those of numpy."""

from __future__ import annotations

import numpy as np
import pytest

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
