"""Changes of contact over the torque, predicted at one equilibrium, against solves."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from solved import coarse

from swgjoint.fe.common.sampling import follower_in_plane
from swgjoint.fe.plane.condensed_model import (
    ALIKE,
    REACH,
    CondensedModel,
    Supports,
    distinct,
)
from swgjoint.fe.plane.contact_points import Contacts
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.corotation import rotate_right_angle
from swgjoint.fe.plane.linearise import linearise
from swgjoint.fe.plane.state import State
from swgjoint.gear.catalogue import ratings_of
from swgjoint.gear.design.design import Design

pytestmark = pytest.mark.fe

NAMES = (
    "reference-2d",
    "reference-2d-dca",
    "reference-2d-four-roller",
    "reference-2d-flexspline-fixed",
)


def loaded(name: str, part: float) -> tuple[Design, Continuation, State]:
    """A coarse drive at an angle of its own, under a part of its peak torque."""
    design = coarse(name)
    follow = follower_in_plane(design)
    state = follow.engage(follow.deflect())
    state = follow.to_torque(state, part * ratings_of(design).repeated_peak)
    return design, follow, follow.to_angle(state, 0.37 * 2.0 * pi / design.periodicity)


@pytest.mark.parametrize("name", NAMES)
def test_the_predicted_compliance_is_that_of_the_equilibrium(name):
    """At its own torque, in half of the drive as in the whole one."""
    _, follow, state = loaded(name, 0.35)
    found = follow.predicted_changes(state, state.torque - 5.0, state.torque + 5.0)
    assert found is not None
    own = found.compliance[np.searchsorted(found.torque, state.torque)]
    assert own == pytest.approx(state.compliance, rel=1e-5)


@pytest.mark.parametrize(
    ("name", "part"), [("reference-2d-dca", 0.65), ("reference-2d-four-roller", 0.35)]
)
def test_steps_of_the_compliance_are_where_solves_find_them(name, part):
    """The largest step within a quarter of the peak: its place and both compliances."""
    design, follow, state = loaded(name, part)
    reach = 0.25 * ratings_of(design).repeated_peak
    found = follow.predicted_changes(state, state.torque - reach, state.torque + reach)
    assert found is not None
    steps = np.abs(np.diff(found.compliance))
    k = int(steps.argmax())
    place, before, after = found.torque[k], *found.compliance[k : k + 2]
    assert steps[k] > 0.05 * state.compliance
    # halve the torques around it until solves tell where the compliance steps
    low, high = place - 0.2 * reach, place + 0.2 * reach
    under = follow.to_torque(state, float(low))
    assert under.compliance == pytest.approx(before, rel=0.02)
    assert follow.to_torque(under, float(high)).compliance == pytest.approx(
        after, rel=0.02
    )
    for _ in range(6):
        middle = 0.5 * (low + high)
        tried = follow.to_torque(under, float(middle)).compliance
        if abs(tried - before) < abs(tried - after):
            low = middle
        else:
            high = middle
    assert place == pytest.approx(0.5 * (low + high), abs=0.03 * reach)


def test_forces_of_the_teeth_balance_the_torque_where_many_contacts_change():
    """Their moment follows the torque though all points of a flank come off.

    Points of a flank that are nearly one would carry moment that no equation sees.
    """
    design, follow, state = loaded("reference-2d-simplified", 1.0)
    held, force = state.contacts, state.tooth_force
    assert held is not None
    # a third of every force a tenth of a micrometre further on
    twin = replace(held, station=held.station + 1e-7)
    state = replace(
        state,
        contacts=Contacts.join(held, twin),
        tooth_force=np.concatenate([force * 2.0 / 3.0, force / 3.0]),
    )
    linear = linearise(follow.model, state, state.torque)
    reach = REACH * follow.model.lobe_height
    found = linear.search.search(linear.flank, reach, state.contacts)
    contacts, carries = distinct(found, state)
    drive = CondensedModel(
        model=follow.model,
        state=state,
        linear=linear,
        circular_spline_is_output=False,
        contacts=contacts,
        carries=carries,
    )
    none = np.zeros(
        (len(linear.gap), linear.gap.shape[1] // linear.stations.per_interval)
    )
    condensed = drive.influence(Supports.from_state(linear, state, none.astype(bool)))
    arm = np.einsum("ki,ki->k", rotate_right_angle(contacts.point), contacts.normal)
    moments, opened = [], []
    torques = state.torque * np.linspace(1.0, 0.4, 13)
    for torque in torques:
        answer = condensed.respond(np.zeros((1, len(contacts))), float(torque))
        offset = condensed.slack + (torque - condensed.torque) * condensed.by_torque
        active = answer.active[0]
        inside = np.ix_(active, active)
        value = np.zeros(len(offset))
        value[active] = np.linalg.solve(condensed.matrix[inside], -offset[active])
        slack = offset + condensed.matrix @ value
        force = np.where(condensed.closed, slack, value)
        moments.append(2.0 * float(force @ arm))
        opened.append(int((active & condensed.closed).sum()))
    assert opened[-1] >= 3
    ratio = 1.0 - 1.0 / design.ratio
    assert np.diff(moments) / np.diff(torques) == pytest.approx(ratio, rel=0.01)


def test_points_of_a_flank_that_are_nearly_one_are_one():
    """The larger force stays, other flanks do not matter."""
    _, _, state = loaded("reference-2d", 0.35)
    held = state.contacts
    assert held is not None
    twin = replace(held, station=held.station + 0.4 * ALIKE)
    other = replace(held, station=held.station + 3.0 * ALIKE)
    three = Contacts.join(Contacts.join(held, twin), other)
    found, carries = distinct(three, state)
    assert len(found) == 2 * len(held)
    assert carries.sum() == len(held)
    assert np.array_equal(found.station[carries], held.station)


@pytest.mark.parametrize("name", ["reference-2d", "reference-2d-parabolic"])
def test_exchanges_at_one_linearisation_lead_to_the_same_equilibrium(name):
    """The bore's stations settle without another search for contact."""
    design, follow, state = loaded(name, 0.35)
    plain = replace(follow, solver=replace(follow.solver, exchanges=0))
    angle = 0.41 * 2.0 * pi / design.periodicity
    one, other = follow.to_angle(state, angle), plain.to_angle(state, angle)
    assert len(one.history) < len(other.history)
    assert np.abs(one.faces - other.faces).max() < 1e-11
    assert one.touching.tobytes() == other.touching.tobytes()
    assert follow.input_torque(one) == pytest.approx(
        plain.input_torque(other), abs=1e-7
    )


def test_an_exchange_changes_the_gradient_as_the_station_does():
    """Taken in or out of the linearised ring, or linearised anew."""
    _, follow, state = loaded("reference-2d-parabolic", 0.35)
    model = follow.model
    linear, found = (linearise(model, state, state.torque) for _ in range(2))
    near = (np.abs(linear.gap) < 3e-8) | state.touching
    stations = near & (np.random.default_rng(1).random(near.shape) < 0.5)
    assert (stations & state.touching).any() and (stations & ~state.touching).any()
    sectors = found.exchange(stations, state.touching)
    assert sectors.tolist() == np.flatnonzero(stations.any(axis=1)).tolist()
    other = replace(state, touching=state.touching ^ stations)
    wanted = linearise(model, other, state.torque)
    scale = np.abs(wanted.gradient).max()
    assert np.abs(found.gradient - wanted.gradient).max() < 1e-12 * scale
    # but for the curvature of the outline, a millionth of the stiffness
    size = np.abs(wanted.hessian).max()
    assert np.abs(linear.hessian - wanted.hessian).max() > 1e-3 * size
    assert np.abs(found.hessian - wanted.hessian).max() < 1e-5 * size
