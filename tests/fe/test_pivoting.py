"""Complementarity problems that share a matrix."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.common import pivoting
from swgjoint.fe.common.pivoting import solve_active, solve_many


def problems(seed: int, size: int = 40, count: int = 100):
    """A matrix whose symmetric part is positive definite, as a pivot leaves it."""
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((size, size))
    skew = rng.standard_normal((size, size))
    scale = np.exp(rng.uniform(-6, 6, size))
    matrix = a @ a.T / size + 0.01 * np.eye(size) + skew - skew.T
    offset = rng.standard_normal((count, size)) / scale
    return matrix / scale[:, None] / scale, offset


def test_solutions_are_complementary():
    """Neither v nor w is negative, one of them is zero, and w = q + M v."""
    for seed in range(3):
        matrix, q = problems(seed)
        found = solve_many(matrix, q)
        assert found.solved.all()
        assert not (found.value * found.slack).any()
        scale = np.sqrt(np.diag(matrix))
        small = 1e-8 * np.abs(q / scale).max()
        assert (found.value * scale).min() > -small
        assert (found.slack / scale).min() > -small
        rest = (q + found.value @ matrix.T - found.slack) / scale
        assert np.abs(rest).max() < small
        assert 0.2 < found.active.mean() < 0.8


def test_start_does_not_change_the_solution():
    """A wrong guess of the active sets ends at the same forces."""
    matrix, q = problems(7)
    found = solve_many(matrix, q)
    again = solve_many(matrix, q, ~found.active)
    assert np.allclose(again.value, found.value, rtol=1e-6, atol=1e-12)
    # also one problem at a time, without neighbours to share a batch with
    alone = np.concatenate([solve_many(matrix, row[None]).value for row in q[:5]])
    assert np.allclose(alone, found.value[:5], rtol=1e-6, atol=1e-12)


def test_derivative_agrees_with_differences():
    """Within an active set v is linear in the offset."""
    matrix, q = problems(3, count=20)
    direction = np.random.default_rng(0).standard_normal(q.shape[1])
    found = solve_many(matrix, q)
    step = 1e-7
    moved = solve_many(matrix, q + step * direction, found.active)
    same = (moved.active == found.active).all(axis=1)
    assert same.sum() > 10
    slope = solve_active(matrix, direction, found.active)
    wanted = (moved.value - found.value) / step
    scale = np.abs(slope).max()
    assert np.allclose(wanted[same], slope[same], atol=1e-5 * scale)


def test_a_problem_without_a_solution_is_nan():
    """A singular set of contacts: the others are still solved."""
    matrix = np.array([[1.0, -1.0], [-1.0, 1.0]])
    found = solve_many(matrix, np.array([[-1.0, -1.0], [-1.0, 2.0]]))
    assert found.solved.tolist() == [False, True]
    assert np.isnan(found.value[0]).any()
    assert np.allclose(found.value[1], [1.0, 0.0])


def held(generator, n):
    """A matrix as of contacts, half of them closed: definite by a millionth."""
    half = n // 2
    roots = [generator.normal(size=(half, half // 4)) for _ in range(2)]
    blocks = [root @ root.T / half + 3e-6 * np.eye(half) for root in roots]
    coupling = generator.normal(size=(half, half))
    return np.block([[blocks[0], coupling], [-coupling.T, blocks[1]]])


@pytest.mark.parametrize("alone", [False, True])
def test_every_definite_problem_is_solved(alone, monkeypatch):
    """Known solutions come back, from whole blocks and from Lemke's pivots alone."""
    if alone:
        monkeypatch.setattr(pivoting, "TRIES", -1)
        monkeypatch.setattr(pivoting, "SINGLES", 0)
    generator = np.random.default_rng(11)
    matrix = held(generator, 60)
    known = generator.normal(size=(40, 60))
    value, slack = np.maximum(known, 0.0), np.maximum(-known, 0.0)
    found = solve_many(matrix, slack - value @ matrix.T)
    assert found.solved.all()
    np.testing.assert_array_equal(found.active, known > 0.0)
    np.testing.assert_allclose(found.value, value, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.slack, slack, rtol=0, atol=1e-8)


def test_lemke_begins_wherever_it_is_told():
    """The same end from no guess, from any guess and from the solution itself."""
    generator = np.random.default_rng(2)
    matrix = held(generator, 40)
    scale = np.sqrt(np.diag(matrix))
    scaled = matrix / scale[:, None] / scale
    known = generator.normal(size=40)
    offset = np.maximum(-known, 0.0) - scaled @ np.maximum(known, 0.0)
    guesses = [np.zeros(40, bool), known > 0.0, generator.random(40) < 0.5]
    for guess in guesses:
        found = pivoting.lemke(scaled, offset, guess)
        np.testing.assert_array_equal(found, known > 0.0)


def test_problems_without_active_unknowns_are_solved():
    """All offsets positive, alone, with a start, and beside other problems."""
    matrix, offset = np.eye(3) + 0.1, np.array([[1.0, 2.0, 3.0], [1.0, -2.0, 3.0]])
    for rows in (offset[:1], offset):
        found = solve_many(matrix, rows)
        assert found.solved.all() and not found.active[0].any()
        np.testing.assert_array_equal(found.slack[0], rows[0])
    warm = solve_many(matrix, offset[:1], np.ones((1, 3), dtype=bool))
    assert warm.solved.all() and not warm.active.any()


def test_unknowns_that_turn_negative_later_are_found():
    """An offset is positive, but another unknown pushes its row below zero."""
    matrix = np.array([[1.0, -0.9], [-0.9, 1.0]])
    found = solve_many(matrix, np.array([[-1.0, 0.5]]))
    assert found.active.all()
    np.testing.assert_allclose(found.value[0], np.linalg.solve(matrix, [1.0, -0.5]))
