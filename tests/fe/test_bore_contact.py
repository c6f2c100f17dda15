"""Contact between bore and wave generator, between the nodes of the bore, too."""

from math import pi

import numpy as np
import pytest

from swgjoint.fe.plane import linearise
from swgjoint.fe.plane.bore_contact import DEPTH, NARROW_POINTS, BoreStations
from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.corotation import rotate
from swgjoint.fe.plane.drive2d import sector_model
from swgjoint.gear.design.design import Design

RADIUS, STEP = 0.03, 0.01
"""Of a circle of nodes [m] and the angle between them [rad]."""


def chain(count=8):
    angle = STEP * np.arange(count)
    return RADIUS * np.stack([-np.sin(angle), np.cos(angle)], axis=-1)


def stations():
    return BoreStations.subdivide(chain(), layer=2.1e9)


def test_stations_of_the_undeformed_bore_lie_on_its_circle():
    """Chords leave no facets: radius to 1e-12, in order, inside their intervals."""
    points = stations().positions(chain()[None])[0]
    assert np.hypot(*points.T) == pytest.approx(RADIUS, rel=1e-14)
    angle = np.arctan2(-points[:, 0], points[:, 1]) / STEP
    assert (np.diff(angle) > 0.0).all()
    interval = np.floor(angle).astype(int)
    assert (interval == 1 + np.arange(len(angle)) // stations().per_interval).all()


def test_stations_travel_with_their_nodes():
    """A rigid motion of the nodes is that of the stations."""
    turn, shift = 0.7, np.array([1e-3, -2e-3])
    moved = stations().positions(rotate(chain(), turn)[None] + shift)[0]
    there = rotate(stations().positions(chain()[None])[0], turn) + shift
    assert moved == pytest.approx(there, abs=1e-15)


def test_layer_yields_to_a_uniform_pressure_as_a_bar_of_its_depth():
    """Force of the stations of an interval under 1 um: E b h / (depth h) times that."""
    own = stations()
    per_interval = own.stiffness.reshape(-1, own.per_interval).sum(axis=1)
    assert per_interval == pytest.approx(2.1e9 / DEPTH, rel=1e-12)
    assert (own.stiffness > 0.0).all()


def test_force_between_nodes_meets_the_compliance_of_a_node():
    """The compliance below a force varies by a tenth of that along straight lines.

    The nodes yield like those of a half-space.
    """
    count = 40
    own = BoreStations.subdivide(chain(count), layer=2.1e9)
    apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    yielding = 4.0 - np.log(apart + 0.5)
    normal = own.positions(chain(count)[None]) / RADIUS
    rows = own.forces_of(np.eye(normal.shape[1])[:, :, None] * normal)
    radial = np.einsum("qni,ni->qn", rows, chain(count) / RADIUS)
    inner = radial[20 * own.per_interval : 21 * own.per_interval]
    part = np.linspace(0.0, 1.0, 21)
    straight = np.zeros((21, count))
    straight[:, 20], straight[:, 21] = 1.0 - part, part
    varies = [
        np.ptp(np.einsum("qn,nm,qm->q", share, yielding, share))
        for share in (inner, straight)
    ]
    assert varies[0] < 0.1 * varies[1]


@pytest.mark.fe
def test_input_torque_does_not_feel_the_nodes_of_the_bore():
    """On four rollers the torque has no line of the passage of bore nodes.

    Contact at the nodes alone gave a sawtooth five times as high as all the rest.
    """
    design = Design.preset("reference-2d-four-roller").with_changes(
        {"mesh.refinement": 0.6}
    )
    model = sector_model(design, half=True)
    follow = Continuation(model=model, ratio=design.ratio)
    state = follow.to_torque(follow.engage(follow.deflect()), 20.0)
    per_tooth, angles = model.element.bore_size + 1, 40
    torque = []
    for angle in 2.0 * pi / 122 * np.arange(angles) / angles:
        state = follow.to_angle(state, float(angle))
        assert state.outcome.ok
        torque.append(follow.input_torque(state))
    line = 2.0 * np.abs(np.fft.rfft(torque)) / angles
    assert per_tooth < angles // 2
    assert line[per_tooth] < 0.04 * np.ptp(torque)


@pytest.mark.fe
@pytest.mark.parametrize("name", ["reference-2d-parabolic", "reference-2d-simplified"])
def test_intervals_far_from_contact_decide_nothing(name, monkeypatch):
    """Their stations stay apart; the equilibrium is that with all gaps exact."""
    design = Design.preset(name).with_changes({"mesh.refinement": 0.5})
    model = sector_model(design, half=True)
    follow = Continuation(model=model, ratio=design.ratio)
    one = follow.to_torque(follow.engage(follow.deflect()), 15.0)
    coarse, _, _ = linearise._gaps(model, one)
    monkeypatch.setattr(linearise, "FAR", np.inf)
    exact, _, _ = linearise._gaps(model, one)
    other = follow.to_torque(follow.engage(follow.deflect()), 15.0)
    same = coarse == exact
    assert 0.1 < same.mean() < 0.9
    assert one.touching.any() and same[one.touching].all()
    assert (coarse[~same] > 0.0).all() and (exact[~same] > 0.0).all()
    assert (one.touching == other.touching).all()
    assert one.wave_generator_torque == pytest.approx(
        other.wave_generator_torque, rel=1e-9
    )


@pytest.mark.fe
@pytest.mark.parametrize("name", ["reference-2d-parabolic", "reference-2d-asymmetric"])
def test_narrow_contacts_have_stations_enough_for_the_energy(name):
    """The mean input torque of a pitch is that of the output over the ratio.

    So it is for any potential. Stations that begin to press one after the other, a
    whole number of them from angle to angle, add up to a mean instead: 8 and 10 % of
    the peak to peak on this mesh with half as many, 1.8 and 1.2 % now.
    """
    design = Design.preset(name).with_changes({"mesh.refinement": 0.5})
    model = sector_model(design, half=True)
    assert model.stations.per_interval == NARROW_POINTS
    follow = Continuation(model=model, ratio=design.ratio)
    torque, angles, found = 1.2, 24, []
    state = follow.to_torque(follow.engage(follow.deflect()), torque)
    for angle in 2.0 * pi / 122 * np.arange(angles) / angles:
        state = follow.to_angle(state, float(angle))
        found.append(follow.input_torque(state))
    mean = np.mean(found) - torque / design.ratio
    assert abs(mean) < 0.03 * np.ptp(found)
