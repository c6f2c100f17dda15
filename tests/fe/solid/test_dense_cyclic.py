"""Rings of sectors with large faces, against the band solver of the plane model."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.common.cyclic import CyclicFactor, SingularCyclicError
from swgjoint.fe.solid.cholesky_cyclic import (
    CholeskyCyclicFactor,
    IndefiniteCyclicError,
    factorise_ring,
)
from swgjoint.fe.solid.dense_cyclic import DenseCyclicFactor
from swgjoint.fe.solid.sector_matrices import SectorMatrices


def blocks(sectors, face, inside, seed=1):
    rng = np.random.default_rng(seed)
    n = 2 * face + inside
    half = rng.normal(size=(sectors, n, n))
    # indefinite, as contact leaves it
    return half + half.transpose(0, 2, 1) + np.diag(rng.choice([-6.0, 9.0], n))


@pytest.mark.parametrize("sectors", [3, 4, 7])
def test_ring_is_solved_as_by_a_band(sectors):
    """Symmetric indefinite rings of three sectors and more, many right-hand sides."""
    matrix = blocks(sectors, 3, 2)
    rhs = np.random.default_rng(2).normal(size=(sectors, 8, 5))
    ours = DenseCyclicFactor(matrix, 3).solve(rhs)
    assert ours == pytest.approx(CyclicFactor(matrix, 3).solve(rhs), rel=1e-9, abs=1e-9)
    # and it is a solution: forces of neighbours on a shared face add up
    force = np.einsum("sij,sjk->sik", matrix, ours) - rhs
    assert np.abs(force[:, 3:5]).max() < 1e-10
    assert np.abs(force[:, :3] + np.roll(force[:, 5:], 1, axis=0)).max() < 1e-9
    assert ours[:, 5:] == pytest.approx(np.roll(ours[:, :3], -1, axis=0))


def test_singular_ring_is_reported():
    """A ring without any stiffness."""
    with pytest.raises(SingularCyclicError):
        DenseCyclicFactor(np.zeros((4, 5, 5)), 2)


@pytest.mark.parametrize(("sectors", "inside"), [(3, 2), (4, 0), (7, 2)])
def test_cholesky_factor_solves_the_same_ring(sectors, inside):
    """Positive definite rings, many right-hand sides; the matrix is not changed."""
    matrix = blocks(sectors, 3, inside) + 30.0 * np.eye(6 + inside)
    before = matrix.copy()
    rhs = np.random.default_rng(2).normal(size=(sectors, 6 + inside, 5))
    ours = CholeskyCyclicFactor(matrix, 3).solve(rhs)
    expected = DenseCyclicFactor(matrix, 3).solve(rhs)
    assert ours == pytest.approx(expected, rel=1e-11, abs=1e-13)
    assert (matrix == before).all()


@pytest.mark.parametrize("kind", [CholeskyCyclicFactor, DenseCyclicFactor])
@pytest.mark.parametrize(("sectors", "inside"), [(3, 2), (4, 0), (7, 2)])
def test_products_and_combinations_of_loads(kind, sectors, inside):
    """Loads on all sectors and on single ones, against the solutions for them."""
    matrix = blocks(sectors, 3, inside) + 30.0 * np.eye(6 + inside)
    rng = np.random.default_rng(3)
    sector = np.array([2, 0, 2, sectors - 1])
    loads = rng.normal(size=(sectors, 6 + inside, 2))
    rows = rng.normal(size=(4, 6 + inside))
    columns = np.concatenate([loads, np.zeros((sectors, 6 + inside, 4))], axis=2)
    columns[sector, :, 2 + np.arange(4)] = rows
    factor = kind(matrix, 3)
    solved = factor.solve(columns)
    response = factor.respond(loads, sector, rows)
    expected = np.einsum("snk,snl->kl", columns, solved)
    assert response.products == pytest.approx(expected, rel=1e-11, abs=1e-13)
    factors = rng.normal(size=6)
    combined = response.combine(factors)
    assert combined == pytest.approx(solved @ factors, rel=1e-11, abs=1e-13)


def test_indefinite_ring_is_factorised_with_pivoting():
    """Cholesky's factor does not exist; the solution does."""
    matrix = blocks(5, 3, 2)
    with pytest.raises(IndefiniteCyclicError):
        CholeskyCyclicFactor(matrix, 3)
    factor = factorise_ring(matrix, 3)
    assert isinstance(factor, DenseCyclicFactor)
    definite = factorise_ring(matrix + 30.0 * np.eye(8), 3)
    assert isinstance(definite, CholeskyCyclicFactor)


def test_singular_ring_is_reported_by_either():
    """A ring without any stiffness."""
    with pytest.raises(SingularCyclicError):
        factorise_ring(np.zeros((4, 5, 5)), 2)


def test_sector_matrices_are_sums_of_their_terms():
    """Terms over several runs of degrees of freedom, against full matrices."""
    rng = np.random.default_rng(5)
    full, terms = np.zeros((4, 9, 9)), []
    for dofs in (np.array([0, 1, 2, 5, 6]), np.array([1, 4, 5, 8])):
        term = rng.normal(size=(4, len(dofs), len(dofs)))
        term += term.transpose(0, 2, 1)
        full[:, dofs[:, None], dofs] += term
        terms.append((dofs, term))
    matrices = SectorMatrices(size=9, terms=tuple(terms))
    assert len(matrices) == 4
    assert np.stack(list(matrices)) == pytest.approx(full, rel=1e-15)
    columns = np.array([8, 0, 5, 3])
    assert matrices.columns(columns) == pytest.approx(full[:, :, columns], rel=1e-15)
    assert matrices.mean_diagonal == pytest.approx(np.einsum("sii->", full) / 36)
