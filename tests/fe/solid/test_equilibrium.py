"""Balance of forces, work and energy of the drive in space."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from swgjoint.fe.solid.continuation import SolidContinuation
from swgjoint.fe.solid.corotation import about_z
from swgjoint.fe.solid.drive3d import solid_sector_model
from swgjoint.fe.solid.equilibrium import SolidLoad
from swgjoint.fe.solid.linearise import linearise
from swgjoint.gear.design.design import Design

TORQUE = 5.0
PITCH = 2 * pi / 42
"""Of the circular spline, which is fixed [rad]."""


def contact_set(state):
    c = state.held.contacts
    pairs = zip(c.sector.tolist(), c.side.tolist(), state.held.plane, strict=True)
    return state.touching.tobytes(), sorted(pairs)


def test_teeth_carry_what_wave_generator_and_load_leave(loaded):
    """The moment of the tooth forces is T - T_wg; nobody prescribed either."""
    assert loaded.torque == pytest.approx(TORQUE, rel=1e-9)
    assert loaded.tooth_moment == pytest.approx(
        TORQUE - loaded.wave_generator_torque, abs=1e-7 * TORQUE
    )
    # at no position of symmetry the input torque is not T/i
    assert abs(loaded.wave_generator_torque - TORQUE / -20) > 1e-5 * TORQUE


@pytest.mark.parametrize("torque", [0.4, -TORQUE])
def test_free_output_turns_until_its_teeth_resist(small_drive, deflected, torque):
    """One load step, against turning the output in small steps until teeth touch."""
    free = small_drive.engage(deflected)
    assert not len(free.tooth_force)
    ours = small_drive.load(free, torque, 0.0)
    touching = small_drive._taken_up(free, torque)
    expected = small_drive.load(touching, torque, 0.0)
    assert ours.outcome.ok and expected.outcome.ok
    assert ours.torque == pytest.approx(torque, rel=1e-12)
    # the solver's tolerance, 1e-10 m
    assert np.abs(ours.faces - expected.faces).max() < 1e-10
    assert ours.tooth_force.sum() == pytest.approx(expected.tooth_force.sum(), rel=1e-5)


def energy_slopes(drive, state, parts):
    """Relative errors of T_wg against d(U + T psi)/d theta at smooth positions."""
    h, errors = 2e-3 * PITCH, []
    for part in parts:
        state = drive.to_angle(state, part * PITCH)
        near = [
            drive.to_angle(state, part * PITCH + step)
            for step in (-h, -h / 2, h / 2, h)
        ]
        if any(contact_set(other) != contact_set(state) for other in near):
            continue  # the torque has a corner where a contact opens or closes
        low, half_low, half_high, high = (s.energy + TORQUE * s.rotation for s in near)
        slope = (4 * (half_high - half_low) / h - (high - low) / (2 * h)) / 3
        errors.append(abs(slope - state.wave_generator_torque) / (TORQUE / 20))
    return errors


def test_input_torque_is_the_slope_of_the_energy(small_drive, loaded):
    """T_wg from contact forces is d(U + T psi)/d theta to 1e-5 of T/|i|."""
    errors = energy_slopes(small_drive, loaded, [0.55])
    assert errors
    assert max(errors) < 1e-5


@pytest.mark.slow
def test_input_torque_is_the_slope_of_the_energy_over_a_pitch(small_drive, loaded):
    """The same at more positions."""
    errors = energy_slopes(small_drive, loaded, np.arange(0.45, 1.4, 0.24))
    assert len(errors) >= 2
    assert max(errors) < 1e-5


def test_turning_everything_changes_nothing(small_drive, deflected):
    """Wave generator and bore turned by 0.37 rad: the same energy, the shape turned."""
    model, angle = small_drive.model, 0.37
    start = model.initial_guess(angle, angle)
    turned = small_drive.solver(model, start, SolidLoad(rotation=angle, teeth=False))
    assert turned.outcome.ok
    assert turned.energy == pytest.approx(deflected.energy, rel=1e-9)
    expected = deflected.faces @ about_z(np.array(angle)).T
    assert np.abs(turned.faces - expected).max() < 1e-9
    # without load the wave generator is free to turn at positions of symmetry
    assert abs(turned.torque) < 1e-6


def test_shape_travels_with_the_wave_generator(small_drive, deflected):
    """One tooth pitch on, the bore held: every sector is like the one before it."""
    model, pitch = small_drive.model, 2 * pi / 40
    start = model.initial_guess(pitch, 0.0)
    ahead = small_drive.solver(model, start, SolidLoad(rotation=0.0, teeth=False))
    assert ahead.energy == pytest.approx(deflected.energy, rel=1e-9)
    expected = deflected.faces[:-1] @ about_z(np.array(pitch)).T
    assert np.abs(ahead.faces[1:] - expected).max() < 1e-9


def test_bore_of_the_diaphragm_stays_where_it_is_held(small_ring, deflected):
    """All masters of its section at their places."""
    held = small_ring.strip.masters.held
    apart = small_ring.masters(deflected)[:, held] - small_ring.reference[:, held]
    assert np.abs(apart).max() < 1e-12


def test_linear_level_keeps_its_stiffness(small_ring, deflected):
    """Far from rest the tangent is that at rest, the forces K (x - X); no more."""
    model = replace(small_ring, nonlinear=False)
    untouched = np.zeros_like(deflected.touching)
    state = replace(deflected, touching=untouched)
    size = model.strip.masters.face_size
    last = model.strip.masters.size - size
    rest = replace(
        state, faces=model.reference[:, :size], inside=model.reference[:, size:last]
    )
    at_rest, far = linearise(model, rest), linearise(model, state)
    stiffness = np.stack(list(at_rest.hessian))
    scale = np.abs(stiffness).max()
    assert np.abs(np.stack(list(far.hessian)) - stiffness).max() < 1e-12 * scale
    moved = (model.masters(state) - model.reference).reshape(model.sectors, -1)
    force = np.einsum("sij,sj->si", stiffness, moved)
    assert np.abs(far.gradient - force).max() < 1e-9 * np.abs(force).max()
    bent = np.stack(list(linearise(small_ring, state).hessian))
    assert np.abs(bent - stiffness).max() > 1e-3 * scale


def test_linear_level_finds_its_equilibrium(small_design, small_ring, deflected):
    """With the contact known there is nothing left to iterate; the shape differs."""
    model = replace(small_ring, nonlinear=False)
    follow = SolidContinuation(model=model, ratio=small_design.ratio)
    state = follow.deflect()
    assert state.outcome.ok
    # tenths of a millimetre apart: a lobe of a twentieth of the radius
    assert 1e-5 < np.abs(state.faces - deflected.faces).max() < 5e-4


@pytest.mark.slow
def test_half_model_is_the_whole_drive(small_design, small_ring, loaded, small_drive):
    """Energy, moments, output angle and masters of all sectors."""
    teeth = replace(small_ring.teeth, circular_spline_teeth=42)
    whole = replace(small_ring, half=False, teeth=teeth)
    follow = SolidContinuation(model=whole, ratio=small_design.ratio)
    state = follow.to_torque(follow.engage(follow.deflect()), TORQUE)
    state = follow.to_angle(state, loaded.wave_generator_angle)
    assert state.outcome.ok
    assert state.energy == pytest.approx(loaded.energy, rel=1e-8)
    assert state.rotation == pytest.approx(loaded.rotation, abs=1e-9)
    assert state.wave_generator_torque == pytest.approx(
        loaded.wave_generator_torque, abs=1e-6 * TORQUE
    )
    assert np.abs(state.faces[:20] - loaded.faces).max() < 1e-9
    opposite = loaded.faces * small_ring.closure
    assert np.abs(state.faces[20:] - opposite).max() < 1e-9
    # the half and its copy are in equilibrium, and every contact has its tooth
    both = loaded.of_both_halves()
    again = follow.load(both, TORQUE, loaded.wave_generator_angle)
    assert again.outcome.ok and again.history[0] < 1e-9

    def pairs(one):
        c = one.held.contacts
        keys = (c.sector.tolist(), c.side.tolist(), c.tooth.tolist())
        return set(zip(*keys, strict=True))

    assert pairs(both) == pairs(again) == pairs(state)


def test_sectors_fit_together(small_ring, loaded):
    """A node of a face is where both sectors put it: their masters agree there."""
    masters = small_ring.masters(loaded)
    size = small_ring.strip.masters.face_size
    assert masters[:-1, -size:] == pytest.approx(masters[1:, :size])
    assert masters[-1, -size:] == pytest.approx(masters[0, :size] * small_ring.closure)


@pytest.mark.slow
def test_crowned_wave_generator_engages_under_a_short_cup():
    """It rocks: without half steps two sets of contacts ask for each other for ever."""
    design = Design.load("stress-cup").with_changes(
        {
            "micro_geometry.wave_generator_crowning_um": 40.0,
            "micro_geometry.wave_generator_slope_um": 45.0,
            "mesh.refinement": 0.5,
        }
    )
    # with fewer masters it does not rock
    follow = SolidContinuation(
        model=solid_sector_model(design, half=True), ratio=design.ratio
    )
    engaged = follow.engage(follow.deflect())
    assert engaged.outcome.ok
    assert len(engaged.history) < 40
