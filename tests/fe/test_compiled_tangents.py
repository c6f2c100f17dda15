"""Compiled sums behind the tangent against the numpy code that they repeat."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.common.block_circulant import contact_compliance, respond
from swgjoint.fe.plane.bore_contact import BoreStations
from swgjoint.fe.plane.compiled_tangent import add_blocks
from swgjoint.kernels import kernels

pytestmark = pytest.mark.skipif(
    kernels() is None, reason="the package was built without compiled loops"
)


def near(ours, theirs):
    scale = np.abs(theirs).max()
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-14 * scale)


@pytest.mark.parametrize("touching", [0.0, 0.2, 1.0])
def test_springs_of_stations_add_up_as_in_numpy(monkeypatch, touching):
    """Stations with negative stiffness count, those without do not."""
    rng = np.random.default_rng(2)
    angle = np.linspace(-0.1, 0.1, 9)
    nodes = 0.03 * np.stack([np.sin(angle), np.cos(angle)], -1)
    stations = BoreStations.subdivide(nodes, layer=1e9)
    q = len(stations.stiffness)
    direction = rng.normal(size=(5, q, 2))
    stiffness = rng.normal(size=(5, q)) * (rng.random((5, q)) < touching)
    ours = stations.stiffness_of(direction, stiffness)
    assert ours.any() == (touching > 0.0)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    near(ours, stations.stiffness_of(direction, stiffness))


def test_springs_at_the_nodes_themselves(monkeypatch):
    """One station an interval, as on a race."""
    rng = np.random.default_rng(3)
    stations = BoreStations.from_nodes(np.ones(6))
    direction, stiffness = rng.normal(size=(4, 6, 2)), rng.random((4, 6))
    ours = stations.stiffness_of(direction, stiffness)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    near(ours, stations.stiffness_of(direction, stiffness))


def test_blocks_are_added_in_their_rows_and_columns(monkeypatch):
    """Rows in any order; all other numbers stay, and no row beyond the end is written.

    The result is bit for bit that of numpy.
    """
    rng = np.random.default_rng(5)
    into, blocks = np.array([4, 0, 5]), rng.normal(size=(7, 3, 3))
    before = rng.normal(size=(7, 6, 6))
    ours, theirs = before.copy(), before.copy()
    add_blocks(blocks, into, ours)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    add_blocks(blocks, into, theirs)
    np.testing.assert_array_equal(ours, theirs)
    assert (ours != before).sum() == blocks.size
    monkeypatch.delenv("SWGJOINT_KERNELS")
    with pytest.raises(ValueError):
        add_blocks(blocks, np.array([4, 0, 6]), ours)
    with pytest.raises(ValueError):
        add_blocks(blocks, into, ours[:6])
    np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("most", [2, 5, 11])
def test_compliance_between_points_as_in_numpy(monkeypatch, most):
    """Teeth in any order, pairs without a block or with two, no point at all."""
    rng = np.random.default_rng(4)
    offsets, teeth, size = np.arange(-most, most + 1), 11, 8
    blocks = rng.normal(size=(len(offsets), size, size))
    blocks += blocks[::-1].transpose(0, 2, 1)  # reciprocal
    tooth = rng.integers(0, teeth, 20)
    weight = rng.normal(size=(20, size)) * (rng.random((20, size)) < 0.5)
    for n in (20, 1, 0):
        given = offsets, blocks, tooth[:n], weight[:n], teeth
        monkeypatch.delenv("SWGJOINT_KERNELS", raising=False)
        ours = contact_compliance(*given)
        monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
        theirs = contact_compliance(*given)
        assert ours.shape == (n, n)
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("most", [2, 5, 11])
def test_displacements_of_teeth_as_in_numpy(monkeypatch, most):
    """One flank of a tooth loaded, both or none; offsets once round and back."""
    rng = np.random.default_rng(9)
    offsets, teeth, size = np.arange(-most, most + 1), 11, 20
    blocks = rng.normal(size=(len(offsets), 6, size))
    force = rng.normal(size=(teeth, size))
    force[2], force[4, :10], force[5, 7:] = 0.0, 0.0, 0.0
    ours = respond(offsets, blocks, force)
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    near(ours, respond(offsets, blocks, force))
    assert np.abs(ours).min() > 0.0


def test_shapes_that_do_not_fit_are_refused():
    native = kernels()
    index = np.zeros(2, dtype=np.int64)
    with pytest.raises(ValueError):
        native.add_station_stiffness(
            np.zeros((2, 2, 4)),
            np.zeros((1, 4, 2)),
            np.zeros((1, 4)),
            np.zeros((1, 4, 4)),
        )
    with pytest.raises(ValueError):
        native.contact_compliance(
            np.array([0, 7]),
            index - 1,
            np.zeros((2, 4, 4)),
            index,
            np.zeros((2, 4)),
            np.zeros((2, 2)),
        )
    for wrong in (
        (index[:1], np.zeros((2, 3, 4)), np.zeros((5, 4)), np.zeros((5, 3))),
        (index, np.zeros((2, 3, 4)), np.zeros((5, 3)), np.zeros((5, 3))),
        (index, np.zeros((2, 3, 4)), np.zeros((5, 4)), np.zeros((5, 4))),
    ):
        with pytest.raises(ValueError):
            native.respond(*wrong)
    with pytest.raises(ValueError):  # a circle of blocks would never end
        native.contact_compliance(
            index, index, np.zeros((2, 4, 4)), index, np.zeros((2, 4)), np.zeros((2, 2))
        )
    with pytest.raises(ValueError):
        ellipse = np.array([[0.0, 1.0, 0.9, 0.0, 0.0, 0.0, 0.0]])
        native.outline_distance(np.zeros((2, 3)), ellipse, np.zeros((2, 4)))
