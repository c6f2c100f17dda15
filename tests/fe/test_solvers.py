"""Ring solver and complementarity against dense twins."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.common import complementarity
from swgjoint.fe.common.complementarity import (
    ActiveSetError,
    _least_squares,
    solve_mixed,
)
from swgjoint.fe.common.cyclic import CyclicFactor


@pytest.mark.parametrize("sectors", [2, 3, 4, 7, 60])
def test_ring_solver_equals_a_dense_solution(sectors):
    """The folded band solution is that of the assembled dense matrix."""
    rng = np.random.default_rng(sectors)
    face, inside = 4, 5
    n, step = 2 * face + inside, face + inside
    blocks = rng.normal(size=(sectors, n, n))
    blocks = blocks @ blocks.transpose(0, 2, 1) + np.eye(n)
    rhs = rng.normal(size=(sectors, n, 3))
    dense, total = np.zeros((sectors * step,) * 2), np.zeros((sectors * step, 3))
    index = [
        np.r_[s * step : (s + 1) * step, (s + 1) % sectors * step + np.arange(face)]
        for s in range(sectors)
    ]
    for s in range(sectors):
        dense[np.ix_(index[s], index[s])] += blocks[s]
        total[index[s]] += rhs[s]
    exact = np.linalg.solve(dense, total)
    found = CyclicFactor(blocks, face).solve(rhs)
    for s in range(sectors):
        assert np.abs(found[s] - exact[index[s]]).max() < 1e-12


@pytest.mark.parametrize("sectors", [1, 2, 3, 4, 7, 60, 61])
@pytest.mark.parametrize("loaded", [[0], [2, 3], [5, 6, 7, 8, 9], [1, 31], [], None])
def test_loads_in_some_sectors(sectors, loaded):
    """The same there as the whole solution, wherever the ring is folded."""
    rng = np.random.default_rng(sectors)
    face, n = 3, 10
    blocks = rng.normal(size=(sectors, n, n)) + 8.0 * np.eye(n)
    within = np.unique(np.array([4] if loaded is None else loaded, dtype=int) % sectors)
    factor = CyclicFactor(blocks, face, None if loaded is None else within)
    rhs = np.zeros((sectors, n, 3))
    rhs[within] = rng.normal(size=(len(within), n, 3))
    whole = CyclicFactor(blocks, face).solve(rhs)
    np.testing.assert_allclose(factor.solve(rhs), whole, rtol=0.0, atol=1e-13)
    found = factor.solve_within(within, rhs[within])
    np.testing.assert_allclose(found, whole[within], rtol=0.0, atol=1e-13)
    # also for other sectors than those for which the ring was folded
    other = (within[::-1] + 1) % sectors
    rhs = np.roll(rhs, 1, axis=0)
    found = factor.solve_within(other, rhs[other])
    np.testing.assert_allclose(found, factor.solve(rhs)[other], rtol=0.0, atol=1e-13)


def test_sectors_that_change_are_eliminated_anew():
    """An update is a factorisation of the changed matrices."""
    rng = np.random.default_rng(5)
    blocks = rng.normal(size=(9, 8, 8)) + 8.0 * np.eye(8)
    factor = CyclicFactor(blocks, 3)
    blocks[[2, 7]] += rng.normal(size=(2, 8, 8))
    factor.update(blocks, np.array([2, 7]))
    rhs = rng.normal(size=(9, 8, 2))
    assert np.array_equal(factor.solve(rhs), CyclicFactor(blocks, 3).solve(rhs))


def random_problem(seed, m=12):
    """A contact-like problem with one free displacement and one multiplier."""
    rng = np.random.default_rng(seed)
    n = m + 2
    flexibility = rng.normal(size=(n, n + 3))
    flexibility = flexibility @ flexibility.T
    matrix = flexibility
    matrix[m, m] = -1e-3 * matrix[m, m]
    return matrix, rng.normal(size=n), m


@pytest.mark.parametrize("seed", range(20))
def test_complementarity_holds(seed):
    """Forces and gaps are non-negative, one of each pair vanishes, equations hold."""
    matrix, offset, m = random_problem(seed)
    z, active = solve_mixed(matrix, offset, m, 1, np.zeros(m, dtype=bool))
    gap = offset + matrix @ z
    scale = np.abs(offset).max()
    assert (z[:m] >= -1e-9).all() and (gap[:m] >= -1e-9 * scale).all()
    assert np.abs(gap[m:]).max() < 1e-9 * scale
    assert np.abs(z[:m] * gap[:m]).max() < 1e-8
    assert (z[:m][~active] == 0.0).all()


@pytest.mark.parametrize("seed", range(20))
def test_least_squares_finds_the_same_active_set(seed):
    """The fallback agrees with the active-set iteration."""
    matrix, offset, m = random_problem(seed)
    _, active = solve_mixed(matrix, offset, m, 1, np.zeros(m, dtype=bool))
    assert (_least_squares(matrix, offset, m, 1) == active).all()


@pytest.mark.parametrize("seed", range(10))
def test_neighbouring_contacts_need_no_least_squares(seed, monkeypatch):
    """Single exchanges end the cycles of many contacts on a smooth, soft surface."""
    monkeypatch.setattr(complementarity, "_least_squares", None)
    x = np.sort(np.random.default_rng(seed).random(40))
    matrix = np.exp(-(((x[:, None] - x) / 0.3) ** 2)) + 1e-5 * np.eye(40)
    offset = 3.0 * x**2 - 1.0 + 0.02 * np.cos(40.0 * x)
    z, active = solve_mixed(matrix, offset, 40, 0, np.ones(40, dtype=bool))
    assert 2 <= np.count_nonzero(active) < 10
    assert (z >= 0.0).all() and (offset + matrix @ z >= -1e-11).all()


def test_contradiction_is_reported():
    """Two opposed gaps that no force can open end with an error, not with numbers."""
    matrix = np.array([[1.0, -1.0], [-1.0, 1.0]])
    with pytest.raises(ActiveSetError):
        solve_mixed(matrix, np.array([-1.0, -1.0]), 2, 0, np.ones(2, dtype=bool))
