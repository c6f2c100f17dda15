"""The tangent of the ring that Newton's method keeps over iterations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.fe.solid import tangent as module
from swgjoint.fe.solid.equilibrium import SolidSolver
from swgjoint.fe.solid.linearise import linearise
from swgjoint.fe.solid.tangent import SolidTangent


def with_other_contact(state, bore):
    """The state with a sector lifted off and bore nodes of another one in contact."""
    touching = state.touching.copy()
    touching[np.flatnonzero(bore.active.any(axis=1))[1]] = False
    nodes = bore.normal.shape[1]
    free = (bore.present & ~bore.active)[:, :nodes]
    closed = int(free.sum(axis=1)[2:].argmax()) + 2
    touching[closed, np.flatnonzero(free[closed])[:3]] = True
    return replace(state, touching=touching)


def test_changed_contact_is_added_to_the_tangent(small_ring, loaded, monkeypatch):
    """Low-rank change of a factorised tangent against one factorised anew."""
    monkeypatch.setattr(module, "NEGLIGIBLE", 1e-12)
    first = linearise(small_ring, loaded)
    other = linearise(small_ring, with_other_contact(loaded, first.bore))
    changed = (first.bore.active != other.bore.active).any(axis=1)
    assert changed.sum() == 2
    rng = np.random.default_rng(4)
    loads = rng.normal(size=(*other.gradient.shape, 3))
    kept, anew = SolidTangent(small_ring, first), SolidTangent(small_ring, other)
    sector, rows = np.array([2, 0]), rng.normal(size=(2, loads.shape[1]))
    factors = rng.normal(size=5)
    expected = anew.respond(loads, sector, rows, other.bore)
    found = kept.respond(loads, sector, rows, other.bore)
    # without the change the tangents differ
    ignored = kept.respond(loads, sector, rows, first.bore)
    for got, wanted, unchanged in (
        (found.products, expected.products, ignored.products),
        *[[r.combine(factors) for r in (found, expected, ignored)]],
    ):
        scale = np.abs(wanted).max()
        assert np.abs(got - wanted).max() < 1e-8 * scale
        assert np.abs(unchanged - wanted).max() > 1e-4 * scale


def test_kept_tangent_reaches_the_same_state(small_drive, loaded):
    """One position later, with the tangent kept and with one of every iteration."""
    angle = loaded.wave_generator_angle + 0.02
    states = []
    for keep_below in (SolidSolver().keep_below, 0.0):
        follow = replace(small_drive, solver=SolidSolver(keep_below=keep_below))
        states.append(follow.to_angle(loaded, angle))
    kept, anew = states
    assert kept.outcome.ok and anew.outcome.ok
    assert np.abs(kept.faces - anew.faces).max() < 1e-10
    assert kept.wave_generator_torque == pytest.approx(
        anew.wave_generator_torque, rel=1e-7
    )


def test_tangent_needs_a_linearisation_with_tangent(small_ring, loaded):
    """A linearisation whose tangent was not computed."""
    linear = linearise(small_ring, loaded, tangent=False)
    with pytest.raises(ValueError, match="without a tangent"):
        SolidTangent(small_ring, linear)
