"""The corotational sector: exact derivatives, invariance, linear limit."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.plane.corotation import (
    elastic_energy,
    elastic_force,
    project_to_frames,
    rotate,
    rotate_right_angle,
    sector_frames,
    tangent,
)
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.fe.plane.elasticity import plane_basis
from swgjoint.gear.design.design import Design


@pytest.fixture(scope="module")
def element():
    return sector_model(Design.load("reference-2d"), half=True).element


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
    force = project_to_frames(frames, elastic_force(element, frames))
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
    force = elastic_force(element, frames)
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


def test_tangent_in_other_axes_is_the_turned_tangent(element):
    """Of sectors that stretch and turn, and of those of a linear model."""
    place, x = deformed(element, 1e-4)
    turn = np.array([0.3, -2.0, 4.0])
    for fixed in (None, np.zeros(3)):
        frames = sector_frames(element, rotate(x, 0.3), place, fixed=fixed)
        force = elastic_force(element, frames)
        matrix = tangent(element, frames, force)
        cos, sin = np.cos(turn), np.sin(turn)
        axes = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], -2)
        blocks = matrix.reshape(3, matrix.shape[1] // 2, 2, -1, 2)
        expected = np.einsum("sab,snbmc,sdc->snamd", axes, blocks, axes)
        ours = tangent(element, frames, force, turn)
        # round-off of sums over terms of this size
        atol = 1e-13 * np.abs(matrix).max()
        np.testing.assert_allclose(
            ours, expected.reshape(matrix.shape), rtol=0.0, atol=atol
        )


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


def test_tension_resists_slopes_within_a_sector(element):
    """Energy of third order is that of the stress on rotations in the whole sector.

    Tension T and a bent shape v: the interior turns by omega, which lengthens the
    tensioned sector, 1/2 sum over the mesh of tr(sigma) omega^2. The condensed sector
    has only the slopes of its bore for that.
    """
    x = element.skeleton
    bent = np.zeros_like(x)
    bent[:, 1] = 0.5 * (x[:, 0] ** 2) / 60e-3
    bent[:, 0] = -(x[:, 1] - x[:, 1].mean()) * x[:, 0] / 60e-3
    v, p = bent.ravel(), element.elongation
    hoop = p @ element.stiffness @ p
    slopes = element.rim_slopes @ v
    ours = 0.5 * hoop * (slopes @ slopes)

    basis = plane_basis(element.mesh.mesh)
    field = element.displacement_from_skeleton
    turned_by, stretch = (np.zeros(basis.N), np.zeros(basis.N))
    at_nodes = basis.nodal_dofs.T
    turned_by[at_nodes] = (field @ v).reshape(-1, 2)
    stretch[at_nodes] = (field @ p).reshape(-1, 2)
    E, nu, width = 210e9, 0.29, 10e-3
    turns, pulled = (basis.interpolate(u).grad for u in (turned_by, stretch))
    omega = 0.5 * (turns[1, 0] - turns[0, 1])
    trace = E / (1.0 - nu) * (pulled[0, 0] + pulled[1, 1])
    exact = 0.5 * width * float(np.sum(trace * omega**2 * basis.dx))
    # 2 % at this mesh: the tooth turns with the rim, but not as one with the bore
    assert ours == pytest.approx(exact, rel=0.05)


@pytest.mark.parametrize("columns", [2, 3, 8, 16])
def test_right_angle_does_not_depend_on_the_layout_of_the_vectors(columns):
    """Vectors that are columns of a wider array turn like their copy."""
    rows = np.random.default_rng(0).normal(size=(40, columns))
    strided = rows[:, :2]
    np.testing.assert_array_equal(
        rotate_right_angle(strided), np.stack([-rows[:, 1], rows[:, 0]], axis=-1)
    )
