"""Compiled banded solver of the thin rings against the one of LAPACK."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.rings.assembly import BandedAssembly
from swgjoint.kernels import kernels

compiled = pytest.mark.skipif(
    kernels() is None, reason="the package was built without compiled loops"
)
SIZE = 60


def assembly(sign: float) -> tuple[BandedAssembly, np.ndarray]:
    """Random parts of two sizes along a closed ring, and its order of narrow band."""
    rng = np.random.default_rng(0)
    total = BandedAssembly(SIZE)
    for m in (3, 5):
        dofs = (np.arange(SIZE)[:, None] + np.arange(m)) % SIZE
        root = rng.standard_normal((SIZE, m, m))
        total.add("part", dofs, None, root @ root.transpose(0, 2, 1))
    softer = sign * np.ones((1, 1, 1))
    total.add("part", np.array([[7]]), None, softer)
    place = np.arange(SIZE)
    order = np.where(2 * place < SIZE, 2 * place, 2 * (SIZE - place) - 1)
    return total, order


@pytest.mark.parametrize("count", [1, 2, 9])
@pytest.mark.parametrize("sign", [1.0, -1e3])
@compiled
def test_solutions_are_those_of_lapack(monkeypatch, count, sign):
    """Also of an indefinite matrix, which the compiled loop leaves to LAPACK."""
    total, order = assembly(sign)
    right = np.random.default_rng(1).standard_normal((SIZE, count))
    options = {"held": 11, "right": right, "anchor": 1e-11}
    native = kernels()
    done = []

    class Noted:
        add_banded = native.add_banded

        @staticmethod
        def solve_banded(columns, loads):
            done.append(native.solve_banded(columns, loads))
            return done[-1]

    monkeypatch.setattr("swgjoint.fe.rings.assembly.kernels", lambda: Noted)
    ours = total.solve(order, **options)
    assert done == [sign > 0.0]
    monkeypatch.setattr("swgjoint.fe.rings.assembly.kernels", lambda: None)
    theirs = total.solve(order, **options)
    assert ours == pytest.approx(theirs, rel=0.0, abs=1e-12 * np.abs(theirs).max())
    assert np.abs(ours[11]).max() < 1e-5 * np.abs(ours).max()


@compiled
def test_rows_outside_the_band_are_refused():
    """Instead of writing beyond the matrix."""
    native = kernels()
    columns, parts = np.zeros((6, 2)), np.ones((1, 2, 2))
    for rows in ([0, 2], [5, 6], [-1, 0]):
        with pytest.raises(ValueError, match="band"):
            native.add_banded(np.array([rows]), parts, columns)
    assert not columns.any()
