"""Thin rings with errors of their teeth: laws of the superposition and of its map."""

from __future__ import annotations

import numpy as np
import pytest
from solved import hundred_elements

from swgjoint.fe.rings import sampling
from swgjoint.fe.rings import tolerances as ring_tolerances
from swgjoint.fe.rings.influence import tooth_influence, with_shifting_teeth
from swgjoint.fe.rings.loading import (
    recall_over_torque,
    solve_loaded,
    solve_over_torque,
    solve_unloaded,
)
from swgjoint.fe.rings.model import thin_ring
from swgjoint.fe.rings.sampling import sample_thin_rings
from swgjoint.fe.tolerances.cycle import gap_errors, pitch_of
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.tolerances import with_perfect_teeth
from swgjoint.maps.fit.fit import fit_map
from swgjoint.maps.unfinished import Unfinished

# a rim of 0.0125 pitch diameters; with 0.0100, an error of 0.4 N·m at the end of the
# clearance is 8 % of the peak to peak at one of the positions below
PERFECT = Design.preset("size-25-50").with_changes({"flexspline.rim_mm": 0.79375})
FLAWED = PERFECT.with_changes(
    {
        "tolerances.flexspline_cumulative_pitch_um": 8.0,
        "tolerances.circular_spline_cumulative_pitch_um": 8.0,
        "tolerances.random_pitch_um": 0.5,
        "tolerances.wave_generator_eccentricity_um": 3.0,
        "tolerances.seed": 2,
    }
)
OVAL = PERFECT.with_changes(
    {
        "tolerances.circular_spline_ovality_um": 6.0,
        "tolerances.circular_spline_cumulative_pitch_um": 8.0,
    }
)
SMALL = 0.4
"""Torque that takes up the clearance [N·m]."""
SINGLE = 0.1
"""Torque that a single contact carries, with a force that does not depend on its
opening [N·m]."""
REACH = 20e-6


@pytest.fixture(scope="module", autouse=True)
def few_elements():
    """The laws hold for rings of any number of elements."""
    with hundred_elements():
        yield


@pytest.fixture(scope="module")
def loaded():
    """Rings with an eccentric wave generator under two torques of both signs."""
    model = with_shifting_teeth(thin_ring(with_perfect_teeth(FLAWED)))
    rest = solve_unloaded(model, 0.0)
    states = {}
    for sign in (1.0, -1.0):
        state = rest
        for torque in (SINGLE, SMALL, 40.0):
            state = solve_loaded(model, state, sign * torque)
            assert state.outcome.ok
            states[sign * torque] = state
    return model, states


def test_drives_with_other_errors_of_the_teeth_share_their_equilibria(monkeypatch):
    """They are solved once; other torques, elements and wave generators are not."""
    solves = []

    def counted(model, phase, levels, nearby=None):
        solves.append(levels.tolist())
        return solve_over_torque(model, phase, levels, nearby)

    monkeypatch.setattr("swgjoint.fe.rings.loading.solve_over_torque", counted)
    coarse = FLAWED.with_changes({"tolerances.random_pitch_um": 2.0})
    worse = FLAWED.with_changes({"tolerances.wave_generator_eccentricity_um": 6.0})

    def found(design, *levels):
        rings = with_perfect_teeth(design)
        model = with_shifting_teeth(thin_ring(rings))
        return recall_over_torque(rings.content_hash(), model, 0.0, np.array(levels))

    first = found(FLAWED, SMALL, 40.0)
    assert found(coarse, SMALL, 40.0) is first and len(solves) == 1
    assert found(worse, SMALL, 40.0)[40.0].rotation != first[40.0].rotation
    assert found(coarse, SMALL) is not first and len(solves) == 3
    monkeypatch.setattr("swgjoint.fe.rings.model.ELEMENTS", 200)
    assert found(coarse, SMALL, 40.0)[40.0].q.size > first[40.0].q.size


@pytest.mark.parametrize("torque", [SINGLE, -SINGLE, SMALL, -SMALL, 40.0, -40.0])
def test_without_errors_the_equilibrium_returns(loaded, torque):
    """The linearised drive has angle, compliance and potential of its equilibrium."""
    model, states = loaded
    state = states[torque]
    at = tooth_influence(model, state, REACH)
    assert (at.closed.sum() == 1) == (abs(torque) == SINGLE)
    none = np.zeros((1, len(at.sector)))
    result = at.respond(none, torque)
    assert result.output_angle == pytest.approx(state.rotation, abs=1e-12)
    assert result.potential == pytest.approx(0.0, abs=1e-15)
    assert result.compliance == pytest.approx(state.compliance, rel=1e-6)


def test_derivative_of_the_potential_is_the_output_angle(loaded):
    """Energy and angle of the superposition belong to one potential."""
    model, states = loaded
    at = tooth_influence(model, states[40.0], REACH)
    change = at.gap_change(*gap_errors(FLAWED, np.arange(0, 5100, 400)))
    low, middle, high = (at.respond(change, t) for t in (39.99, 40.0, 40.01))
    assert (high.potential - low.potential) / 0.02 == pytest.approx(
        middle.output_angle, rel=1e-6
    )


@pytest.mark.parametrize("torque", [SINGLE, -SINGLE, SMALL, -SMALL, 40.0, -40.0])
def test_superposed_errors_are_those_of_full_solves(loaded, torque):
    """Within 5 % of the peak to peak over the cycle, also with errors of the cam."""
    model, states = loaded
    pitches = np.array([300, 1700, 3100, 4444])
    at = tooth_influence(model, states[torque], REACH)
    errors = gap_errors(FLAWED, pitches)
    superposed = at.respond(at.gap_change(*errors), torque).output_angle
    flawed, full = thin_ring(FLAWED), []
    for theta in (pitch_of(FLAWED) * pitches).tolist():
        rest = solve_unloaded(flawed, theta, -flawed.cage_lag * theta)
        begin = np.sign(torque) * min(SMALL, abs(torque))
        state = solve_loaded(flawed, rest, begin)
        state = solve_loaded(flawed, state, torque)
        assert state.outcome.ok
        full.append(state.rotation - theta / flawed.ratio)
    cycle = gap_errors(FLAWED, np.arange(0, 5100, 30))
    size = np.ptp(at.respond(at.gap_change(*cycle), torque).output_angle)
    assert size > 100e-6
    assert superposed == pytest.approx(np.array(full), abs=0.05 * size)


def test_twice_the_errors_double_their_effect(loaded):
    """As long as no contact opens or closes: errors of nanometres under load."""
    model, states = loaded
    at = tooth_influence(model, states[40.0], REACH)
    change = 1e-4 * at.gap_change(*gap_errors(FLAWED, np.arange(0, 5100, 300)))
    once, twice = (
        at.respond(k * change, 40.0).output_angle - states[40.0].rotation
        for k in (1.0, 2.0)
    )
    assert twice == pytest.approx(2.0 * once, rel=0.02, abs=1e-11)


def test_errors_of_one_member_have_its_orders(monkeypatch):
    """Those of the circular spline are even orders of alpha; the clearance stays."""
    monkeypatch.setattr(sampling, "LEVELS", (0.03, 0.1, 0.22, 0.43, 0.7, 1.01))
    monkeypatch.setattr(ring_tolerances, "CHECKS", 2)
    drive = fit_map(sample_thin_rings(OVAL, angles=3))
    size = dict(
        zip(
            map(tuple, drive.orders.tolist()),
            np.hypot(*drive.kinematic_error.T),
            strict=True,
        )
    )
    assert not drive.orders[:, 1].any()
    assert min(size[2, 0], size[4, 0]) > 5e-6
    low = {p: a for (p, _), a in size.items() if p < 10}
    assert max((a for p, a in low.items() if p % 2), default=0.0) < 0.1 * size[2, 0]
    # the passage of balls is there as without errors
    assert (drive.info["ball_passage"]["carried_as"], 0) in size
    assert drive.info["stiffness_range_Nm_rad"][0] > 0.0
    assert drive.info["label"]["tolerances"]["circular_spline_ovality_um"] == 6.0
    rows = drive.info["validation"]["rows"]
    assert next(row["torque_Nm"] for row in rows) == 0.0
    # only two torques are sampled with errors, and the map lacks the tooth passage
    assert all(row["output_error_largest"] < 0.2 for row in rows)


@pytest.mark.parametrize("count", [60, 61])
def test_errors_count_for_the_lobe_whose_ball_is_there(count):
    """Where a ball is on the one lobe or on the other, its own quantities result.

    In between there is their mean, and each is resolved by every other pitch.
    """
    rng, pitch = np.random.default_rng(3), np.arange(count)
    angle = 2.0 * np.pi * pitch[:, None] / count * np.arange(12)
    amplitudes = rng.normal(size=(2, 2, 3, 4, 12))
    on_one, on_other = (
        a @ np.cos(angle).T + b @ np.sin(angle).T for a, b in amplitudes
    )
    shares = 2 if count % 2 == 0 else 1
    spectra = [
        ring_tolerances._spectrum(table[..., first::shares], first, count)
        for first, table in zip((0, shares - 1), (on_one, on_other), strict=True)
    ]
    passages = count // 4  # one ball on a lobe at every other pitch
    found = np.fft.irfft(ring_tolerances._over_passage(spectra, passages, count), count)
    wave = np.cos(2.0 * np.pi * passages * pitch / count)
    wanted = 0.5 * (on_one + on_other) + 0.5 * (on_one - on_other) * wave
    assert found == pytest.approx(wanted, abs=1e-12)
    assert found[..., 0] == pytest.approx(on_one[..., 0], abs=1e-12)
    if count == 60:
        assert found[..., 2] == pytest.approx(on_other[..., 2], abs=1e-12)
        assert found[..., 1] == pytest.approx(
            0.5 * (on_one + on_other)[..., 1], abs=1e-12
        )


class Stop(Exception):
    """An interruption."""


class OtherStop(Exception):
    """An interruption at the errors, after everything without them."""


def fail_with_other(*others, **options):
    raise OtherStop


def test_what_the_rings_lack_is_left_out(monkeypatch, tmp_path):
    """Misalignment and friction change no sample, and the label names them."""
    monkeypatch.setattr(sampling, "LEVELS", (0.1, 1.01))
    monkeypatch.setattr(sampling, "UNSEEN", (0.5,))
    monkeypatch.setattr(sampling, "UNSEEN_PHASES", 1)
    tilted = PERFECT.with_changes(
        {"tolerances.misalignment_arcmin": 1.0, "friction.tooth_coefficient": 0.1}
    )
    plain, other = (sample_thin_rings(d, angles=2) for d in (PERFECT, tilted))
    for key in ("output_error", "energy", "compliance", "input_torque"):
        assert np.array_equal(getattr(plain, key), getattr(other, key))
    assert other.tolerances is None
    assert "misalignment" in other.info["label"]["left_out"]
    assert "misalignment" not in plain.info["label"]["left_out"]
    assert other.info["label"]["friction"] == "left out of the potential"
    assert other.info["label"]["tolerances"] is None


def test_an_interrupted_map_with_errors_resumes_bit_for_bit(monkeypatch, tmp_path):
    """Finished positions and checks are read from the store."""
    monkeypatch.setattr(sampling, "LEVELS", (0.1, 1.01))
    monkeypatch.setattr(ring_tolerances, "CHECKS", 1)
    keep, perfect = Unfinished(folder=tmp_path / "a"), Unfinished(folder=tmp_path / "b")
    stores = {"keep": keep, "perfect_keep": perfect}
    whole = sample_thin_rings(OVAL, angles=2, **stores)

    def fail(*others, **options):
        raise Stop

    monkeypatch.setattr(ring_tolerances, "solve_unloaded", fail)
    monkeypatch.setattr(sampling, "solve_unloaded", fail)
    again = sample_thin_rings(OVAL, angles=2, **stores)
    assert np.array_equal(whole.tolerances.table, again.tolerances.table)
    for key in ("output_error", "input_torque"):
        pair = (getattr(s.tolerances.solved, key) for s in (whole, again))
        assert np.array_equal(*pair)
    # other errors need only what depends on them
    other = OVAL.with_changes({"tolerances.circular_spline_ovality_um": 7.0})
    with pytest.raises(Stop):
        sample_thin_rings(other, angles=2, keep=Unfinished(folder=tmp_path / "c"))
    monkeypatch.undo()
    monkeypatch.setattr(sampling, "LEVELS", (0.1, 1.01))
    monkeypatch.setattr(sampling, "solve_unloaded", fail)
    monkeypatch.setattr(ring_tolerances.RingErrors, "sample", fail_with_other)
    with pytest.raises(OtherStop):
        sample_thin_rings(other, angles=2, perfect_keep=perfect)


def test_unstable_superpositions_are_no_equilibria(monkeypatch):
    """Sets of errors with a negative compliance have no result, the others keep it.

    Size 25 with 21.7 um of clearance had K1 = -294 N·m/rad for one drive of a lot.
    """
    table = np.arange(1.0, 25.0).reshape(3, 2, 4)
    table[2, 1, 2] = -0.009
    monkeypatch.setattr(
        ring_tolerances, "respond_over_torque", lambda *_: (table.copy(), 0)
    )
    found = ring_tolerances.superpose(None, (), np.array([1.0]), 0.1)
    assert np.isnan(found[:, 1, 2]).all()
    kept = np.ones((2, 4), dtype=bool)
    kept[1, 2] = False
    assert np.array_equal(found[:, kept], table[:, kept])
