"""Contact between the planes of the mesh."""

from __future__ import annotations

import numpy as np
import pytest

from swgjoint.fe.solid.across import crown_bend, spread_forces, vertices
from swgjoint.fe.solid.linearise import bore_contact
from swgjoint.fe.solid.wave_generator.surface import crown

Z = np.linspace(-5e-3, 5e-3, 11)
HEIGHT, WIDTH = 100e-6, 10e-3


def crowned(at):
    """Gaps under a crown whose middle lies at a place, a micrometre closed there."""
    depth, _ = crown(Z[:, None] - at, HEIGHT, WIDTH, circular=False)
    return depth - 1e-6


def test_crown_touches_between_planes_as_in_them():
    """The least gap is the crown's wherever it stands; planes miss a micrometre."""
    at = np.linspace(-4e-3, 4e-3, 33)
    gap = crowned(at)
    seen = vertices(gap, np.zeros(len(at)))
    assert seen.found.all()
    assert np.einsum("pn,pn->n", seen.weight, gap) == pytest.approx(-1e-6, abs=1e-15)
    assert seen.weight.T @ Z == pytest.approx(at, abs=1e-12)
    assert np.einsum("pn,pn->n", seen.slope, gap) == pytest.approx(0.0, abs=1e-15)
    assert seen.bend == pytest.approx(crown_bend(HEIGHT, Z))
    assert gap.min(axis=0).max() + 1e-6 == pytest.approx(crown_bend(HEIGHT, Z) / 8)


@pytest.mark.parametrize(
    "gap",
    [Z, -Z, -(Z**2), 0.0 * Z],
    ids=["edge", "other edge", "both edges", "flat"],
)
def test_edges_and_flat_gaps_have_no_vertex(gap):
    """They touch in the planes of the mesh."""
    assert not vertices(gap[:, None], np.full(1, 1e-9)).found.any()


def test_hollow_gap_has_no_vertex():
    """Two of them, beside a plane that stands out: a small tilt would change which."""
    gap = crowned(np.zeros(1))
    dent = np.zeros_like(gap)
    dent[len(Z) // 2] = crown_bend(HEIGHT, Z)
    for tilt in (-1e-9, 1e-9):
        seen = vertices(gap + dent + tilt * Z[:, None] / Z[-1], np.full(1, 1e-9))
        assert not seen.found.any()


def test_weights_are_derivatives_of_the_least_gap():
    """Change of the interpolated minimum by every plane's gap, by differences."""
    gap = crowned(np.array([0.37e-3]))
    gap[:, 0] += 2e-7 * np.sin(900.0 * Z)
    none = np.zeros(1)
    seen = vertices(gap, none)

    def least(change):
        moved = gap + change[:, None]
        return float((vertices(moved, none).weight * moved).sum())

    step = 1e-9 * np.eye(len(Z))
    by = [(least(part) - least(-part)) / 2e-9 for part in step]
    assert seen.weight[:, 0] == pytest.approx(np.array(by), abs=1e-6)


def test_spread_forces_keep_force_and_moment():
    """Patches move no force along the width, and none is lost."""
    spread = spread_forces(Z, 1).toarray()
    assert spread.sum(axis=0) == pytest.approx(1.0)
    assert Z @ spread == pytest.approx(Z, abs=1e-15)
    # a patch is wider than an element
    assert spread[5, 5] < 0.8


def test_wave_generator_touches_at_vertices_alone(small_ring, deflected):
    """A crowned one under this small cup; the iteration ends as Newton's does."""
    contact = bore_contact(small_ring, deflected, small_ring.frames(deflected)[0])
    b = contact.normal.shape[1]
    lines = (contact.gap.shape[1] - b) // 2
    touching = deflected.pressure > 0.0
    assert not touching[:, :b].any()
    assert touching[:, b : b + lines].sum() > 50
    # slopes carry nothing at rest
    assert (
        np.abs(deflected.pressure[:, b + lines :]).max()
        < 1e-4 * deflected.pressure.max()
    )
    assert contact.gap[contact.present].min() > -1e-9
    steps = deflected.history
    assert len(steps) < 25
    assert steps[-1] < 0.3 * steps[-2] < 0.1 * steps[-3]
