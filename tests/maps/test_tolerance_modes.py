"""Harmonics of errors of the teeth: a known potential of both angles comes back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.gear.kinematics import LAYOUTS, angle_coefficients, periodicity, ratio
from swgjoint.gear.ratings import Ratings
from swgjoint.maps.fit import tolerance_modes
from swgjoint.maps.fit.fit import fit_map
from swgjoint.maps.fit.knots import _end_at_largest_torque
from swgjoint.maps.fit.tolerance_modes import (
    orders_of,
    register_by_torque,
    relative_amplitudes,
    weakest,
)
from swgjoint.maps.samples import MapSamples, ToleranceSamples

RATINGS = Ratings(rated_torque=20, repeated_peak=50, momentary_peak=90, T1=5, T2=15)
FLEXSPLINE, CIRCULAR_SPLINE, CYCLE = 30, 32, 480
K = 2e4
ERRORS = {(2, 0): 3e-5, (0, 2): 2e-5, (1, -1): 4e-6, (5, 3): 3e-6}
SWINGS = {(2, 0): 0.1, (0, 4): 0.05}
COGGING = {(4, 0): 2e-6, (0, 2): 1e-6}


def waves(terms, alpha, beta):
    """Sum of waves of p alpha + q beta, neither even nor odd."""
    return sum(
        a * np.cos(p * alpha + q * beta + 0.3 * p - 0.5) for (p, q), a in terms.items()
    )


def known(layout: str, phases: int = 4, part: float = 1.0) -> MapSamples:
    """Equilibria of V = K x^2/2 (1 + swings) + cogging with the errors e0."""
    i = ratio(layout, FLEXSPLINE, CIRCULAR_SPLINE)
    cycles = periodicity(layout, FLEXSPLINE, CIRCULAR_SPLINE)
    angles = np.array(angle_coefficients(layout))
    order = (cycles, 0) if angles[0].tolist() == [1, 0] else (0, cycles * angles[1, 0])
    levels = np.linspace(-50.0, 50.0, 7)

    def table(theta, part):
        alpha, beta = angles @ np.stack([theta, theta / i])
        stiffness = K * (1.0 + part * waves(SWINGS, alpha, beta))
        tooth = np.cos(cycles * theta)
        e0 = 1e-6 * tooth + part * waves(ERRORS, alpha, beta)
        x = levels[:, None] / stiffness
        energy = 0.5 * stiffness * x**2 + part * waves(COGGING, alpha, beta)
        energy = energy + 1e-7 * tooth
        return np.stack([e0 - x, energy, np.broadcast_to(1.0 / stiffness, x.shape)])

    period = 2.0 * np.pi / cycles
    every = period * np.arange(CYCLE * phases) / phases
    theta = period * np.arange(12) / 12
    error, energy, compliance = table(theta, 0.0)
    return MapSamples(
        name="known",
        level="2d",
        layout=layout,
        teeth_flexspline=FLEXSPLINE,
        teeth_circular_spline=CIRCULAR_SPLINE,
        ratings=RATINGS,
        damping_ratio=0.02,
        order=order,
        input_angle=theta,
        torque=levels,
        output_error=error,
        energy=energy,
        compliance=compliance,
        input_torque=levels[:, None] / i
        - cycles * (1e-6 * levels[:, None] + 1e-7) * np.sin(cycles * theta),
        tolerances=ToleranceSamples(
            pitches=CYCLE,
            phases=phases,
            torque=levels,
            table=table(every, part),
            perfect=table(every[:phases], 0.0),
        ),
    )


@pytest.mark.parametrize("layout", LAYOUTS)
def test_known_potential_of_both_angles_comes_back(layout):
    """Error and energy at unseen angles, orders named by the member that has them."""
    samples = known(layout)
    drive = fit_map(samples, keep=1e-6)
    found = {(p, q) for p, q in drive.orders.tolist()}
    for p, q in {*ERRORS, *SWINGS, *COGGING}:
        assert (p, q) in found or (-p, -q) in found
    theta = np.random.default_rng(1).uniform(0, 200, 300)
    ideal = theta / drive.ratio
    alpha, beta = np.array(angle_coefficients(layout)) @ np.stack([theta, ideal])
    e0, _, _ = drive.error_at(drive.phases(theta, ideal))
    cycles = periodicity(layout, FLEXSPLINE, CIRCULAR_SPLINE)
    wanted = waves(ERRORS, alpha, beta) + 1e-6 * np.cos(cycles * theta)
    assert np.abs(e0 - wanted).max() < 1e-9
    # to two thirds of the largest torque: beyond, stiff angles are continued
    for x in (-1.5e-3, 0.0, 1.6e-3):
        wanted = 0.5 * K * x**2 * (1 + waves(SWINGS, alpha, beta))
        wanted = wanted + waves(COGGING, alpha, beta) + 1e-7 * np.cos(cycles * theta)
        energy = drive.energy(x, theta, ideal)
        assert np.abs(energy - wanted).max() < 1e-4 * np.ptp(wanted) + 1e-10
        torque = K * x * (1 + waves(SWINGS, alpha, beta))
        assert np.abs(drive.torque(x, theta, ideal) - torque).max() < 1e-3 * K * 2e-3


def test_pattern_of_other_order_than_the_teeth(monkeypatch):
    """Balls pass 8 times a turn, errors are sampled at every pitch: orders of both.

    Errors of the order of the balls are added to it.
    """
    balls = 8
    monkeypatch.setitem(ERRORS, (balls, 0), 2e-6)
    samples = known("circular_spline_fixed", phases=1)
    few = replace(
        samples,
        order=(balls, 0),
        input_angle=2.0 * np.pi / balls * np.arange(12) / 12,
        tolerances=replace(samples.tolerances, order=samples.order),
    )
    drive = fit_map(few, keep=1e-6)
    theta = np.random.default_rng(1).uniform(0, 200, 300)
    ideal = theta / drive.ratio
    e0, _, _ = drive.error_at(drive.phases(theta, ideal))
    wanted = waves(ERRORS, theta, theta - ideal) + 1e-6 * np.cos(balls * theta)
    assert np.abs(e0 - wanted).max() < 1e-9
    assert len(np.unique(drive.orders, axis=0)) == len(drive.orders)
    # the tables contain no other harmonics than these
    cycle = np.array([[CYCLE // CIRCULAR_SPLINE, CYCLE // FLEXSPLINE]])
    named = [(2, 0), (0, 2)]
    kept = np.sort(np.abs(np.array(named) @ cycle[0]))
    fewer = replace(few, tolerances=replace(few.tolerances, waves=kept))
    orders = fit_map(fewer, keep=1e-6).orders.tolist()
    assert {(p, q) for p, q in orders if p % balls or q} == set(named)


def test_stiffness_of_the_linearised_drive_does_not_matter():
    """Only what errors change at a torque counts, unless clearances differ."""
    samples = known("circular_spline_fixed")
    exact = samples.tolerances
    softer = replace(samples, tolerances=exact.in_series(0.1 / K))
    found = register_by_torque(softer)
    assert np.abs(found.table - exact.table).max() < 1e-12
    assert np.abs(found.perfect - exact.perfect).max() < 1e-12
    loose = exact.in_series(100.0 / K)
    assert register_by_torque(replace(samples, tolerances=loose)) is loose


def test_errors_may_be_sampled_at_other_torques_and_phases():
    """The drive without errors is interpolated over torque and angle."""
    samples = known("circular_spline_fixed", phases=5)
    rows = [0, 3, 6]
    sampled = samples.tolerances
    fewer = replace(
        sampled,
        torque=sampled.torque[rows],
        table=sampled.table[:, rows],
        perfect=sampled.perfect[:, rows],
    )
    shifted = replace(
        samples,
        torque=samples.torque * 1.1,
        output_error=samples.output_error - 0.1 * samples.torque[:, None] / K,
        energy=samples.energy + 0.5 * 0.21 * samples.torque[:, None] ** 2 / K,
        tolerances=fewer,
    )
    found = register_by_torque(shifted)
    assert np.abs(found.perfect - fewer.perfect).max() < 1e-12
    assert np.abs(found.table - fewer.table).max() < 1e-12


def test_forces_are_the_gradient_of_the_potential():
    """A map of both angles is conservative: forces are differences of its energy."""
    drive = fit_map(known("circular_spline_fixed"))
    theta, psi, step = 1.234, 1.234 / drive.ratio - 4e-4, 1e-6

    def energy(t, p):
        return float(drive.energy(drive.torsion(t, p), t, p))

    on_input, on_output = drive.forces(theta, psi)
    by_theta = (energy(theta + step, psi) - energy(theta - step, psi)) / (2 * step)
    by_psi = (energy(theta, psi + step) - energy(theta, psi - step)) / (2 * step)
    assert -by_theta == pytest.approx(float(on_input), rel=1e-5)
    assert -by_psi == pytest.approx(float(on_output), rel=1e-5)


def test_perfect_teeth_add_nothing():
    """Without errors the map of the perfect drive comes back, tooth order alone."""
    samples = known("circular_spline_fixed", part=0.0)
    flawless = fit_map(replace(samples, tolerances=None))
    drive = fit_map(samples)
    assert np.array_equal(drive.orders[:2], [(0, 0), (CIRCULAR_SPLINE, 0)])
    assert not np.any(drive.orders % [CIRCULAR_SPLINE, 1])
    theta = np.linspace(0.0, 3.0, 50)
    psi = theta / drive.ratio - 1e-3
    for mine, other in zip(
        drive.forces(theta, psi), flawless.forces(theta, psi), strict=True
    ):
        assert mine == pytest.approx(other, rel=1e-9)


def test_threshold_drops_harmonics_and_the_record_says_how_much(monkeypatch):
    """Fewer harmonics, their share of the rms in the record."""
    monkeypatch.setattr(tolerance_modes, "LEFT_OUT", 0.2)
    samples = known("circular_spline_fixed")
    full, sparse = fit_map(samples, keep=0.0), fit_map(samples, keep=0.5)
    record = sparse.info["tolerances"]
    assert record["kept"] == len(sparse.orders) < len(full.orders)
    assert full.info["tolerances"]["dropped"] == 0
    errors = ERRORS | {(CIRCULAR_SPLINE, 0): 1e-6}
    kept = sum(a**2 for pq, a in errors.items() if list(pq) in sparse.orders.tolist())
    total = sum(a**2 for a in errors.values())
    wanted = np.sqrt(1.0 - kept / total)
    assert record["dropped_kinematic_error_rms"] == pytest.approx(wanted, rel=1e-3)
    middle = next(r for r in record["transmission_error"] if r["torque_Nm"] == 0.0)
    zero = samples.tolerances.table[0, 3]
    assert middle["peak_to_peak_rad"] == pytest.approx(np.ptp(zero))


@pytest.mark.parametrize("most", [0.01, 0.05, 0.2])
def test_harmonics_left_out_stay_within_their_limit_at_every_torque(most):
    """Their rms is at most the limit, and the next weakest one would exceed it."""
    parts = np.random.default_rng(4).exponential(0.02, (300, 5))
    kept = np.zeros(300, dtype=bool)
    kept[7] = True
    out = weakest(parts, kept, most)
    assert not out[7] and out.any() and not out.all()
    assert np.sqrt(0.5 * (parts[out] ** 2).sum(axis=0)).max() <= most
    rest = np.flatnonzero(~out & ~kept)
    out[rest[parts[rest].max(axis=1).argmin()]] = True
    assert np.sqrt(0.5 * (parts[out] ** 2).sum(axis=0)).max() > most


def test_amplitudes_under_load_are_those_of_the_known_potential():
    """Ripple and error of a single wave of e0 under constant stiffness."""
    samples = known("circular_spline_fixed", part=0.0)
    tolerances = samples.tolerances
    pitch = 2.0 * np.pi / CIRCULAR_SPLINE
    theta = pitch * np.arange(4 * CYCLE) / 4
    table = np.tile(tolerances.perfect, (1, 1, CYCLE))
    table[0] += 3e-5 * np.cos(theta)  # 15 waves in the cycle
    flawed = replace(tolerances, table=table)
    parts, height = relative_amplitudes(flawed, CIRCULAR_SPLINE)
    loaded = np.flatnonzero(tolerances.torque)
    # dominated by one wave, whose amplitude is half of the peak to peak
    wanted = np.abs(tolerances.torque[loaded]) * 3e-5
    ripple = height[0, loaded] * parts[15, loaded]
    assert ripple == pytest.approx(wanted, rel=1e-6)
    error = height[1] * parts[15, tolerances.torque.size :]
    assert error == pytest.approx(np.full(7, 3e-5), rel=1e-6)


def test_errors_of_one_member_have_orders_of_its_angle_alone():
    """One turn of the circular spline: p alpha; of the flexspline: q beta."""
    samples = known("circular_spline_fixed")
    waves_in = np.array([0, 2, 5, CIRCULAR_SPLINE + 2])
    assert samples.tolerances is not None
    one = replace(
        samples,
        tolerances=replace(
            samples.tolerances,
            pitches=CIRCULAR_SPLINE,
            table=samples.tolerances.table[:, :, : 4 * CIRCULAR_SPLINE],
        ),
    )
    expected = [(0, 0), (2, 0), (5, 0), (CIRCULAR_SPLINE + 2, 0)]
    assert orders_of(waves_in, one).tolist() == [list(pq) for pq in expected]
    other = replace(
        samples,
        tolerances=replace(
            samples.tolerances,
            pitches=FLEXSPLINE,
            table=samples.tolerances.table[:, :, : 4 * FLEXSPLINE],
        ),
    )
    waves_in[-1] = FLEXSPLINE + 2
    expected = [(0, 0), (0, 2), (0, 5), (CIRCULAR_SPLINE, 2)]
    assert orders_of(waves_in, other).tolist() == [list(pq) for pq in expected]


def test_torque_range_ends_with_the_samples():
    """The mean torque at the last knots is the largest sampled one."""
    drive = fit_map(known("circular_spline_fixed"))
    assert drive.torque_range == pytest.approx((-50.0, 50.0), rel=1e-3)


def test_the_end_of_the_knots_moves_them_all():
    """Where a level lies next to the largest torque no interval collapses."""
    samples = known("circular_spline_fixed")
    found = samples.tolerances
    torsion = found.table[0, found.torque == 0.0] - found.table[0]
    knots = torsion.mean(axis=1) * 1.05
    # the last but one beyond the torsion at which the map is to end
    knots[-2] = 0.999 * knots[-1]
    before = np.diff(knots)
    _end_at_largest_torque(knots, found, torsion)
    scale = np.diff(knots) / before
    assert scale[[0, -1]] == pytest.approx([1.0 / 1.05] * 2, rel=0.01)
    assert scale[-2] == pytest.approx(scale[-1], rel=1e-9)
