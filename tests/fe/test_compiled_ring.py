"""Factorised ring of sectors against the pivoted solver of the ring."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.common import ring_factor
from swgjoint.fe.common.cyclic import CyclicFactor, SingularCyclicError
from swgjoint.fe.common.ring_factor import RingFactor
from swgjoint.kernels import kernels

FACE = 3

compiled = pytest.mark.skipif(
    kernels() is None, reason="the package was built without compiled loops"
)


def blocks_of(rng, sectors, n):
    """Well-conditioned symmetric matrices."""
    root = rng.normal(size=(sectors, n, n))
    return root @ root.transpose(0, 2, 1) + n * np.eye(n)


def near(ours, theirs):
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-12 * abs(theirs).max())


@pytest.mark.parametrize("native", ["", "numpy"])
@pytest.mark.parametrize("inside", [0, 1, 5])
@pytest.mark.parametrize("sectors", [1, 2, 3, 7, 60])
def test_solutions_are_those_of_the_pivoted_solver(
    monkeypatch, native, sectors, inside
):
    """Loads on all sectors, one at a time and several at once."""
    monkeypatch.setenv("SWGJOINT_KERNELS", native)
    rng = np.random.default_rng(sectors)
    n = 2 * FACE + inside
    blocks = blocks_of(rng, sectors, n)
    factor, twin = RingFactor(blocks, FACE), CyclicFactor(blocks, FACE)
    for columns in (1, 4):
        rhs = rng.normal(size=(sectors, n, columns))
        kept = rhs.copy()
        near(factor.solve(rhs), twin.solve(rhs))
        assert np.array_equal(rhs, kept)


@pytest.mark.parametrize("native", ["", "numpy"])
@pytest.mark.parametrize("sectors", [1, 2, 3, 7, 60])
@pytest.mark.parametrize(("dense", "rows"), [(0, 4), (2, 0), (3, 1), (3, 40)])
def test_products_are_those_of_loads_and_solutions(
    monkeypatch, native, sectors, dense, rows
):
    """Sectors in any order, several rows on one sector."""
    monkeypatch.setenv("SWGJOINT_KERNELS", native)
    rng = np.random.default_rng(rows)
    n = 2 * FACE + 4
    blocks = blocks_of(rng, sectors, n)
    loads = rng.normal(size=(sectors, n, dense))
    sector, row = rng.integers(0, sectors, rows), rng.normal(size=(rows, n))
    every = np.zeros((sectors, n, dense + rows))
    every[:, :, :dense] = loads
    every[sector, :, dense + np.arange(rows)] = row
    expected = np.einsum(
        "snf,snl->fl", every, CyclicFactor(blocks, FACE).solve(every), optimize=True
    )
    near(
        RingFactor(blocks, FACE, np.unique(sector)).condense(loads, sector, row),
        expected,
    )


@pytest.mark.parametrize("native", ["", "numpy"])
def test_an_update_is_a_new_factorisation(monkeypatch, native):
    """Bit for bit, whichever sectors change."""
    monkeypatch.setenv("SWGJOINT_KERNELS", native)
    rng = np.random.default_rng(5)
    blocks = blocks_of(rng, 9, 8)
    kept = blocks.copy()
    factor = RingFactor(kept, FACE)
    rhs = rng.normal(size=(9, 8, 2))
    for changed in ([2, 7], [0], [8], []):
        new = blocks_of(rng, len(changed), 8)
        kept[changed] = blocks[changed] = new
        factor.update(np.array(changed, dtype=np.int64))
        ours = factor.solve(rhs)
        assert np.array_equal(ours, RingFactor(blocks, FACE).solve(rhs))


@pytest.mark.parametrize("native", ["", "numpy"])
def test_products_follow_changes_of_sectors_and_loads(monkeypatch, native):
    """Bit for bit as those of a new factor, whatever changed since the last ones."""
    monkeypatch.setenv("SWGJOINT_KERNELS", native)
    rng = np.random.default_rng(8)
    blocks, loads = blocks_of(rng, 13, 9), rng.normal(size=(13, 9, 3))
    sector, rows = np.array([3, 9, 3, 12]), rng.normal(size=(4, 9))
    factor = RingFactor(blocks, FACE)

    def check():
        ours = factor.condense(loads, sector, rows)
        theirs = RingFactor(blocks.copy(), FACE).condense(loads, sector, rows)
        assert np.array_equal(ours, theirs)

    check()
    for changed in ([], [5], [0, 12], [3]):
        blocks[changed] = blocks_of(rng, len(changed), 9)
        factor.update(np.array(changed, dtype=np.int64))
        check()
        loads[7, 2, 1] += 1.0
        check()
        loads[changed] *= 2.0
        check()
    rows[2, 1] = 0.0
    check()
    sector = np.array([3, 9, 4, 12])
    check()
    loads = loads[:, :, :2]
    check()


@pytest.mark.parametrize("inside", [14, 16, 18, 23])
def test_large_sectors_as_with_pivoting(inside):
    """Unknowns in whole blocks of eight, with four more, and single ones."""
    rng = np.random.default_rng(inside)
    for face in (16, 13):
        n = 2 * face + inside
        blocks, loads = blocks_of(rng, 5, n), rng.normal(size=(5, n, 11))
        twin = CyclicFactor(blocks, face)
        near(RingFactor(blocks, face).solve(loads), twin.solve(loads))
        row = rng.normal(size=(3, n))
        sector = np.array([4, 1, 4])
        every = np.concatenate([loads, np.zeros((5, n, 3))], axis=2)
        every[sector, :, 11 + np.arange(3)] = row
        near(
            RingFactor(blocks, face).condense(loads, sector, row),
            np.einsum("snf,snl->fl", every, twin.solve(every), optimize=True),
        )


def test_indefinite_rings_are_solved_with_pivoting():
    """From the start, and once an update makes a ring indefinite."""
    rng = np.random.default_rng(6)
    definite = blocks_of(rng, 5, 9)
    indefinite = definite.copy()
    indefinite[3] -= 40.0 * np.eye(9)
    rhs = rng.normal(size=(5, 9, 2))
    later = RingFactor(definite, FACE)
    definite[3] = indefinite[3]
    later.update(np.array([3]))
    expected = CyclicFactor(indefinite, FACE).solve(rhs)
    near(later.solve(rhs), expected)
    near(RingFactor(indefinite, FACE).solve(rhs), expected)
    # and further changes are still followed
    for blocks in (definite, indefinite):
        blocks[1] += np.eye(9)
    later.update(np.array([1]))
    near(later.solve(rhs), CyclicFactor(indefinite, FACE).solve(rhs))


def test_a_singular_ring_is_reported():
    with pytest.raises(SingularCyclicError):
        RingFactor(np.zeros((4, 7, 7)), FACE)


@compiled
def test_definite_rings_need_no_pivoting(monkeypatch):
    """Compiled code alone solves them."""
    monkeypatch.setattr(ring_factor, "CyclicFactor", None)
    blocks = blocks_of(np.random.default_rng(7), 6, 7)
    assert np.isfinite(RingFactor(blocks, FACE).solve(np.ones((6, 7, 1)))).all()


@compiled
def test_wrong_shapes_and_sectors_are_rejected():
    """They would read or write beyond the end of an array."""
    native = kernels()
    for wrong in ((0, 7, 3), (4, 5, 3), (4, 7, 0), (-1, 7, 3)):
        with pytest.raises(ValueError, match="sectors, size, face"):
            native.RingFactor(*wrong)
    ring = native.RingFactor(4, 7, 3)
    none, one = np.zeros(0, dtype=np.int64), np.zeros(1, dtype=np.int64)
    with pytest.raises(ValueError, match="blocks"):
        ring.update(np.zeros((3, 7, 7)), none)
    with pytest.raises(ValueError, match="sector"):
        ring.update(np.zeros((4, 7, 7)), one + 4)
    with pytest.raises(ValueError, match="loads"):
        ring.solve(np.zeros((4, 6, 1)))
    loads = np.zeros((4, 7, 2))
    with pytest.raises(ValueError, match="rows"):
        ring.condense(loads, none, np.zeros((1, 7)), np.zeros((3, 3)))
    with pytest.raises(ValueError, match="result"):
        ring.condense(loads, one, np.zeros((1, 7)), np.zeros((2, 2)))
    with pytest.raises(ValueError, match="sector"):
        ring.condense(loads, one - 1, np.zeros((1, 7)), np.zeros((3, 3)))
