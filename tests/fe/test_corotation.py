"""The corotational sector: exact derivatives, invariance, linear limit."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.corotation import (
    elastic_energy,
    projected,
    rotate,
    sector_frames,
    tangent,
)
from swgjoint.fe.drive2d import ring_model
from swgjoint.gear.design import Design


@pytest.fixture(scope="module")
def element():
    return ring_model(Design.load("reference-2d"), half=True).element


def deformed(element, scale, seed=3):
    """Sectors at three places with a random displacement of the given size."""
    rng = np.random.default_rng(seed)
    place = np.array([0.0, 0.4, 2.0])
    x = np.broadcast_to(element.skeleton, (3, *element.skeleton.shape))
    x = rotate(x, place[:, None]) + scale * rng.normal(size=x.shape)
    return place, x


def energy(element, place, x):
    frames = sector_frames(element, x, place)
    return elastic_energy(element, frames, np.zeros((3, 4 * element.flank_size)))


def gradient(element, place, x):
    frames = sector_frames(element, x, place)
    force = projected(frames, frames.deformation @ element.stiffness)
    return rotate(force.reshape(x.shape), frames.angle[:, None]).reshape(3, -1)


def test_small_displacement_is_linear(element):
    """For a small displacement the forces are those of the linear element."""
    place, x = deformed(element, 1e-12)
    local = rotate(x, -place[:, None]) - element.skeleton
    # part without rigid rotation, which the linear element carries too
    linear = rotate(
        (local.reshape(3, -1) @ element.stiffness).reshape(x.shape), place[:, None]
    )
    ours = gradient(element, place, x).reshape(x.shape)
    assert np.abs(ours - linear).max() < 1e-6 * np.abs(linear).max()


def test_rigid_rotation_changes_nothing(element):
    """A rotation by 1 rad leaves energy and forces (turned along) as they were."""
    place, x = deformed(element, 1e-6)
    turned = rotate(x, 1.0) + np.array([1e-3, -2e-3])
    assert energy(element, place, turned) == pytest.approx(
        energy(element, place, x), rel=1e-10
    )
    before = rotate(gradient(element, place, x).reshape(x.shape), 1.0)
    after = gradient(element, place, turned).reshape(x.shape)
    assert np.abs(after - before).max() < 1e-10 * np.abs(before).max()


def test_gradient_is_the_derivative_of_the_energy(element):
    """Forces against central differences of the energy."""
    place, x = deformed(element, 1e-5)
    rng = np.random.default_rng(5)
    direction = rng.normal(size=x.shape)
    h = 1e-8
    slope = (
        energy(element, place, x + h * direction)
        - energy(element, place, x - h * direction)
    ) / (2 * h)
    ours = np.einsum("sn,sn->s", gradient(element, place, x), direction.reshape(3, -1))
    assert ours == pytest.approx(slope, rel=1e-6)


def test_tangent_is_the_derivative_of_the_gradient(element):
    """Tangent against central differences of the forces, large rotation included."""
    place, x = deformed(element, 1e-5)
    x = rotate(x, 0.3)
    frames = sector_frames(element, x, place)
    force = frames.deformation @ element.stiffness
    matrix = tangent(element, frames, force)
    rng = np.random.default_rng(6)
    direction = rng.normal(size=x.shape)
    h = 1e-8
    slope = (
        gradient(element, place, x + h * direction)
        - gradient(element, place, x - h * direction)
    ) / (2 * h)
    local = rotate(direction, -frames.angle[:, None]).reshape(3, -1)
    ours = np.einsum("sij,sj->si", matrix, local).reshape(x.shape)
    ours = rotate(ours, frames.angle[:, None]).reshape(3, -1)
    assert np.abs(ours - slope).max() < 1e-7 * np.abs(slope).max()
    assert np.abs(matrix - matrix.transpose(0, 2, 1)).max() < 1e-6 * matrix.max()


def test_condensed_sector_carries_rigid_motion_without_force(element):
    """Translation and small rotation of a sector give no force and no stress."""
    x, y = element.skeleton.T
    for motion in (np.array([1.0, 0.0]) + 0 * x[:, None], np.stack([-y, x], axis=-1)):
        d = motion.ravel()
        scale = np.abs(element.stiffness).max() * np.abs(d).max()
        assert np.abs(element.stiffness @ d).max() < 1e-9 * scale
        stress = element.stress_from_skeleton @ d
        bound = np.abs(element.stress_from_skeleton).max() * np.abs(d).max()
        assert np.abs(stress).max() < 1e-9 * bound
