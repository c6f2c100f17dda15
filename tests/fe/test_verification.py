"""Work and energy of the simulation of meshing: the torque nobody prescribed."""

from __future__ import annotations

from functools import cache

import numpy as np
from solved import FEW_PITCH as PITCH
from solved import few_teeth, kept

from swgjoint.fe.plane.continuation import Continuation
from swgjoint.fe.plane.drive2d import sector_model

TORQUE = 20.0


@cache
def follow():
    design = few_teeth()
    return Continuation(model=sector_model(design, half=True), ratio=design.ratio)


@cache
def loaded():
    meshed = follow().engage(follow().deflect())
    return follow().to_torque(meshed, TORQUE)


def contact_set(state):
    """Stations of the bore that touch, and arcs of the profile where teeth touch."""
    c = state.contacts
    arc = np.searchsorted(follow().model.element.profile.stations, c.station)
    teeth = set(zip(c.sector.tolist(), c.side.tolist(), arc.tolist(), strict=True))
    return state.touching.tobytes(), teeth


def stored(state):
    """U + T psi, whose slope along theta at constant T is the input torque."""
    return state.energy + TORQUE * state.rotation


def test_input_torque_is_the_slope_of_the_energy():
    """T_wg from contact forces is d(U + T psi)/d theta to 1e-6 of T/|i|."""
    h = 6e-4 * PITCH
    state, errors = loaded(), []
    for part in np.arange(0.013, 1.0, 0.04):
        state = follow().to_angle(state, part * PITCH)
        steps = (-h, -h / 2, h / 2, h)
        near = [follow().to_angle(state, part * PITCH + step) for step in steps]
        if any(contact_set(other) != contact_set(state) for other in near):
            continue  # the torque has a corner where a contact opens or closes
        low, half_low, half_high, high = map(stored, near)
        # central differences over 2 h and h, extrapolated
        slope = (4 * (half_high - half_low) / h - (high - low) / (2 * h)) / 3
        errors.append(abs(slope - state.wave_generator_torque))
    assert len(errors) >= 5
    assert max(errors) < 1e-6 * TORQUE / abs(follow().ratio)


@cache
def one_pitch(angles):
    """theta, psi, T_wg and U over one pitch of the fixed member."""
    return kept(f"one pitch {angles}", lambda: _one_pitch(angles))


def _one_pitch(angles):
    state, rows = loaded(), []
    for theta in PITCH * np.arange(angles + 1) / angles:
        state = follow().to_angle(state, theta)
        assert state.outcome.ok
        rows.append((theta, state.rotation, state.wave_generator_torque, state.energy))
    return np.array(rows).T


def out_of_balance(theta, psi, torque, energy):
    """Sum over the steps of |T_wg dtheta - T dpsi - dU|, of the work over them."""
    work_in = 0.5 * (torque[1:] + torque[:-1]) * np.diff(theta)
    work_out = TORQUE * np.diff(psi)
    missing = np.abs(work_in - work_out - np.diff(energy)).sum()
    return missing / abs(work_out.sum())


def test_balance_of_work_over_a_pitch():
    """Work in minus work out minus energy vanishes with the square of the step."""
    fine = one_pitch(192)
    errors = [out_of_balance(*fine[:, ::every]) for every in (4, 2, 1)]
    assert errors[2] < 1e-3
    # trapezoidal rule: 2, less where torque has a corner inside a step
    assert 0.5 * np.log2(errors[0] / errors[2]) > 1.7, errors


def test_equilibria_do_not_depend_on_the_path():
    """Without friction 24 steps to an angle lead where 192 lead."""
    coarse, fine = one_pitch(24)[1:], one_pitch(192)[1:, ::8]
    mean = TORQUE / abs(follow().ratio)
    scale = np.array([[np.ptp(fine[0])], [mean], [fine[2].max()]])
    # 5e-7 seen in the torque, where flanks conform and several sets of points hold
    assert (np.abs(coarse - fine) < 1e-6 * scale).all()
