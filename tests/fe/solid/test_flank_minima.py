"""Tooth contact between the planes of the mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.flank_minima import FlankSurfaces
from swgjoint.fe.solid.flank_points import FlankPoints
from swgjoint.fe.solid.strip import mesh
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import without_errors

TORQUE = 5.0
PITCH = 2 * np.pi / 42


def candidates(model, state, *, held=True, reach=0.1):
    """Of a state, as the solver finds them."""
    return model.teeth.find(
        model.frames(state)[0],
        model.loads(state),
        model.teeth.displace_circular_spline(state.circular_spline_force),
        reach * model.lobe_height,
        state.held if held else None,
        thorough=True,
        held_force=state.tooth_force if held else None,
    )


def test_crowned_teeth_touch_between_the_planes(small_ring, loaded):
    """Every contact that carries force is a minimum, found without knowing of it."""
    held, z = loaded.held, small_ring.strip.mesh.teeth.z
    assert (np.abs(held.z[:, None] - z).min(axis=1) > 1e-5).any()
    rows = candidates(small_ring, loaded, held=False)
    assert rows.slopes == 0
    assert rows.contacts.gap.min() > -1e-9
    for k, sector in enumerate(held.contacts.sector):
        same = np.flatnonzero(
            (rows.contacts.sector == sector)
            & (rows.contacts.side == held.contacts.side[k])
        )
        apart = np.abs(rows.z[same] - held.z[k])
        assert apart.min() < 1e-3 * (z[1] - z[0])
        assert abs(rows.contacts.gap[same[apart.argmin()]]) < 1e-9
    # at rest no slope pushes
    rows = candidates(small_ring, loaded)
    assert rows.slopes == 2 * len(held)
    length = np.subtract(*small_ring.strip.flank_range[::-1])
    along = rows.contacts.gap[rows.slope]
    assert np.abs(along * length).max() < 1e-9


def test_no_flank_enters_another_anywhere(small_ring, loaded, monkeypatch):
    """The gap on a grid over flanks and face width is never negative."""
    seen, minima = [], FlankSurfaces.minima

    def spy(self, seeds, reach):
        seen.append(self)
        return minima(self, seeds, reach)

    monkeypatch.setattr(FlankSurfaces, "minima", spy)
    rows = candidates(small_ring, loaded, held=False)
    surfaces, touching = seen[0], np.flatnonzero(rows.contacts.gap < 1e-8)
    assert len(touching) >= 2
    stations = np.linspace(*surfaces.ends, 60)
    places = np.linspace(0.0, surfaces.planes - 1.0, 10 * surfaces.planes)
    station, place = (part.ravel() for part in np.meshgrid(stations, places))
    for k in touching:
        of = np.full(len(place), k)
        contacts = replace(rows.contacts.chosen(of), station=station)
        gap = surfaces.gaps(
            FlankPoints.from_contacts(contacts, place, surfaces.planes)
        ).value
        assert np.isfinite(gap).sum() > 100
        assert gap.min() > -1e-9


def test_minima_move_as_the_slopes_say(small_ring, loaded):
    """Their motion, when the masters move, is -H^-1 (g_s, g_t)', by differences."""
    rng, step = np.random.default_rng(2), 1e-9
    faces, inside = (
        rng.normal(size=part.shape) for part in (loaded.faces, loaded.inside)
    )

    def at(part):
        return replace(
            loaded,
            faces=loaded.faces + part * faces,
            inside=loaded.inside + part * inside,
        )

    way = small_ring.masters(replace(loaded, faces=faces, inside=inside))
    way = way[:, small_ring.strip.teeth.masters].reshape(small_ring.sectors, -1)
    here = candidates(small_ring, loaded)
    slopes = np.flatnonzero(here.slope)
    ours = np.einsum("km,km->k", here.rows, way[here.contacts.sector])[slopes]
    # two slopes of each contact: along the flank and along the valley of the gap
    held = loaded.held
    order = np.lexsort([held.z, held.contacts.side, held.contacts.sector])
    force = np.repeat(loaded.tooth_force[order], 2)
    ours = -ours / (here.spring[slopes] * force)
    across = ours[1::2]
    z = small_ring.strip.mesh.teeth.z

    def places(part):
        rows = candidates(small_ring, at(part))
        return rows.z[rows.slope][1::2]

    by = (places(step) - places(-step)) / (2 * step) / (z[1] - z[0])
    assert across == pytest.approx(by, rel=1e-2)


def test_straight_flanks_touch_in_the_planes(small_ring, loaded):
    """Without crowning there are no points between the planes and no slopes."""
    teeth = small_ring.teeth
    straight = replace(teeth, crowning=replace(teeth.crowning, height=0.0))
    rows = candidates(replace(small_ring, teeth=straight), loaded, held=False)
    assert len(rows) > 20
    assert np.isin(rows.z, small_ring.strip.mesh.teeth.z).all()
    assert not rows.slope.any()


def size_25(few_masters):
    """Drive of size 25 on a coarse mesh; its loaded flanks are nearly flat."""
    design = without_errors(Design.load("size-25-100-bought"))
    design = design.with_changes({"mesh.refinement": 0.5})
    model = solid_sector_model(design, half=True, orders=few_masters)
    return SolidContinuation(model=model, ratio=design.ratio)


def test_minima_beside_a_loaded_one_do_not_replace_it(few_masters):
    """Approached over the angle or not: one state, 1.2e-7 rad apart without this."""
    drive, angle = size_25(few_masters), 3 / 16 * 2 * np.pi / 202
    state = drive.to_angle(drive.engage(drive.deflect()), angle)
    again = drive.to_torque(drive.engage(drive.deflect(angle)), 0.0)
    assert state.outcome.ok and again.outcome.ok
    assert state.rotation == pytest.approx(again.rotation, abs=1e-10)


@pytest.mark.slow
def test_state_does_not_depend_on_the_path(small_drive, loaded):
    """Over a pitch and back, and from other torques: the same output to 1e-9 rad."""
    places = [(0.4 + k / 8) * PITCH for k in range(9)]
    state, there = loaded, []
    for angle in places:
        state = small_drive.to_angle(state, angle)
        there.append(state)
    errors = [s.rotation - s.wave_generator_angle / small_drive.ratio for s in there]
    assert abs(errors[-1] - errors[0]) < 1e-6 * np.ptp(errors)
    for angle, one in zip(places[::-1], there[::-1], strict=True):
        state = small_drive.to_angle(state, angle)
        assert state.rotation == pytest.approx(one.rotation, abs=1e-9)
    for torque in (0.2 * TORQUE, 2.0 * TORQUE):
        other = small_drive.to_torque(small_drive.to_torque(there[5], torque), TORQUE)
        assert other.rotation == pytest.approx(there[5].rotation, abs=1e-9)


@pytest.mark.slow
def test_stiffness_does_not_depend_on_the_planes(
    small_design, few_masters, monkeypatch
):
    """11 to 13 elements over the face width: 0.6 %; contact in planes made it 6 %."""
    tangent, secant = [], []
    for elements in (11, 12, 13):
        monkeypatch.setattr(mesh, "FACE_WIDTH", elements / 0.5)
        model = solid_sector_model(small_design, half=True, orders=few_masters)
        assert model.strip.planes == elements + 1
        drive = SolidContinuation(model=model, ratio=small_design.ratio)
        low = drive.to_torque(drive.engage(drive.deflect()), 0.5 * TORQUE)
        low = drive.to_angle(low, 0.4 * PITCH)
        high = drive.to_torque(low, TORQUE)
        assert low.outcome.ok and high.outcome.ok
        tangent.append(1.0 / high.compliance)
        secant.append(0.5 * TORQUE / (low.rotation - high.rotation))
    for values in (tangent, secant):
        assert np.ptp(values) < 0.015 * np.mean(values)


def test_compliance_is_the_slope_of_the_torsion(small_drive, loaded):
    """By central differences; the minima of both loaded flanks move with the load."""
    near = [small_drive.to_torque(loaded, TORQUE + d) for d in (-0.02, 0.02)]
    slope = (near[0].rotation - near[1].rotation) / 0.04
    assert loaded.compliance == pytest.approx(slope, rel=5e-3)
