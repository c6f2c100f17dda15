"""The tangent of the ring that Newton's method keeps over iterations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from solved import BEARING

from swgjoint.fe.solid import tangent as module
from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.equilibrium import SolidSolver
from swgjoint.fe.solid.linearise import linearise
from swgjoint.fe.solid.tangent import SolidTangent, keeps_tangent


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
    lifted = with_other_contact(loaded, first.bore)
    # equal forces: the tangent that is kept contains those of the sector that lifts off
    pressure = np.where(lifted.touching, loaded.pressure, 0.0)
    first = linearise(small_ring, replace(loaded, pressure=pressure))
    other = linearise(small_ring, replace(lifted, pressure=pressure))
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


def quadratic_forms(model, state, way):
    """Of a motion: from the tangent, and from the difference of the forces.

    The motion is one of the positions ``faces``, ``inside`` and ``race``.
    """
    h, n = 1e-6, model.sectors

    def forces(step):
        moved = {key: getattr(state, key) + step * d for key, d in way.items()}
        linear = linearise(model, replace(state, **moved), tangent=False)
        return linear.gradient + linear.pushed

    linear = linearise(model, state)
    last = np.roll(way["faces"], -1, axis=0)
    last[-1] *= model.closure
    d = np.zeros((n, model.size))
    masters = np.concatenate([way["faces"], way["inside"], last], axis=1)
    d[:, model.dofs(np.arange(masters.shape[1]))] = masters.reshape(n, -1)
    free = np.ones_like(d)
    if "race" in way:
        d[:, model.race_dofs] = model.race.elements(way["race"]).reshape(n, -1)
        free[:, model.race_dofs] = ~linear.race.fixed
    ours = np.array([linear.hessian[k] @ one for k, one in enumerate(d)])
    change = (forces(h) - forces(-h)) / (2.0 * h)
    return float(np.sum(free * d * ours)), float(np.sum(free * d * change))


def turn_about_axis(positions):
    """Motion of a rotation about the axis of the drive by 1 rad, to first order."""
    turned = np.zeros_like(positions)
    turned[..., 0], turned[..., 1] = -positions[..., 1], positions[..., 0]
    return turned


def test_ring_that_turns_on_its_wave_generator(small_ring, deflected):
    """The contact forces follow the normals of the wave generator.

    Forces that turned with the bore would make the quadratic form 0.7 % less.
    """
    way = {key: turn_about_axis(getattr(deflected, key)) for key in ("faces", "inside")}
    ours, expected = quadratic_forms(small_ring, deflected, way)
    assert ours == pytest.approx(expected, rel=2e-4)


def test_ring_and_race_that_turn_on_the_balls(few_masters, small_design):
    """Only the balls resist, hardly; each of ring and race alone, too.

    Forces that turned with the bore would make the first form 29 % less.
    """
    design = small_design.with_changes(BEARING)
    model = solid_sector_model(
        design,
        half=True,
        bearing="free",
        elastic_circular_spline=False,
        orders=few_masters,
    )
    state = SolidContinuation(model=model, ratio=design.ratio).deflect()
    way = {k: turn_about_axis(getattr(state, k)) for k in ("faces", "inside", "race")}
    ours, expected = quadratic_forms(model, state, way)
    assert ours == pytest.approx(expected, rel=1e-4)
    for still in ("race",), ("faces", "inside"):
        alone = way | {key: 0.0 * way[key] for key in still}
        ours, expected = quadratic_forms(model, state, alone)
        assert ours == pytest.approx(expected, rel=1e-4)


def test_compliance_is_the_derivative_of_the_output_angle(small_drive, loaded):
    """Difference over a thousandth of the torque."""
    h = 5e-3
    low, high = (
        small_drive.output_angle(small_drive.to_torque(loaded, loaded.torque + d))
        for d in (-h, h)
    )
    assert loaded.compliance == pytest.approx((low - high) / (2.0 * h), rel=1e-3)


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


@pytest.mark.parametrize(
    ("history", "since", "settled", "kept"),
    [
        ([], 0, True, False),
        ([2e-6], 0, False, False),
        # contacts change one after the other
        ([3e-6, 9e-7, 8e-7, 7e-7], 1, False, True),
        # they are settled, but the tangent is that of a state 2.4 um away
        ([3e-6, 9e-7, 8e-7, 7e-7, 1e-9], 1, True, False),
        ([3e-6, 9e-7, 8e-7, 7e-7, 1e-9], 3, True, True),
        # nothing but the tangent explains the slow convergence
        ([3e-6, 1e-7, 8e-8], 1, True, False),
        ([3e-6, 1e-7, 8e-8], 1, False, True),
    ],
)
def test_tangent_is_kept_while_contacts_change(history, since, settled, kept):
    """Below 1 um, unless settled contacts converge slowly or the tangent is old."""
    assert keeps_tangent(history, since, (1e-6, 0.5), settled=settled) is kept


def test_tangent_needs_a_linearisation_with_tangent(small_ring, loaded):
    """A linearisation whose tangent was not computed."""
    linear = linearise(small_ring, loaded, tangent=False)
    with pytest.raises(ValueError, match="without a tangent"):
        SolidTangent(small_ring, linear)
