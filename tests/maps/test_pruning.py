"""Harmonics below a tolerance: what a map loses is bounded, and not far below."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from messages import naming
from scipy.optimize import brentq

from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.pruning import stiffness_range, torque_amplitudes
from swgjoint.units import arcmin

TOLERANCES = (0.02, 0.1, 0.3)


def rippled(base: DriveMap, seed: int) -> DriveMap:
    """A map of twelve harmonics whose strengths lie up to two decades apart."""
    rng, n = np.random.default_rng(seed), 12
    knots, strength = base.torsion_knots, 10.0 ** rng.uniform(-2.0, 0.0, (n, 1))
    # torque that grows with the torsion, and torque that does not
    grows, constant = strength * rng.uniform(-1.0, 1.0, (2, n, 2))
    at_rest = np.zeros((knots.size - 1, 5))
    at_rest[:, 0], at_rest[:, 1] = knots[:-1], 1.0
    potential = 0.003 * grows[..., None, None] * base.potential[0, 0]
    potential += constant[..., None, None] * at_rest
    ends = 0.003 * grows[..., None] * base.end_stiffness[0, 0]
    error = 3e-5 * strength * rng.uniform(-1.0, 1.0, (n, 2))
    orders = np.stack([np.arange(1, n + 1), rng.integers(-3, 4, n)], axis=-1)
    return replace(
        base,
        orders=np.vstack([[[0, 0]], orders]),
        potential=np.concatenate([base.potential[:1], potential]),
        end_stiffness=np.concatenate([base.end_stiffness[:1], ends]),
        kinematic_error=np.vstack([[[0.0, 0.0]], error]),
    )


@pytest.fixture(params=range(3))
def drive(request, synthetic_map) -> DriveMap:
    """Three of these."""
    return rippled(synthetic_map, request.param)


def kept_of(few: DriveMap, drive: DriveMap) -> list[bool]:
    """Which harmonics of a map a pruned one still has."""
    return [any((few.orders == row).all(axis=1)) for row in drive.orders]


def torque(drive: DriveMap, torsion: np.ndarray, phases: np.ndarray) -> np.ndarray:
    """Torque at given phases of all harmonics."""
    ab = drive.coefficients(torsion, 1)
    return np.sum(ab[..., 0] * np.cos(phases) + ab[..., 1] * np.sin(phases), axis=-1)


def random_phases(rng: np.random.Generator, drive: DriveMap, count: int) -> np.ndarray:
    """Of all harmonics, independent; that of the mean is zero."""
    phases = rng.uniform(0.0, 2.0 * np.pi, (count, len(drive.orders)))
    phases[:, 0] = 0.0
    return phases


def states(drive: DriveMap, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Random phases of all harmonics, independent, and torsions inside the knots."""
    rng = np.random.default_rng(5)
    low, high = drive.torsion_knots[[0, -1]]
    return random_phases(rng, drive, count), rng.uniform(low, high, count)


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_bounds_hold_and_are_near(drive, tolerance):
    """Kinematic error and torque of random states: below the bound, half of it reached.

    Half: phases of up to ten harmonics that are random seldom add up.
    """
    few = drive.pruned(tolerance)
    note = few.info["pruned"]
    kept = kept_of(few, drive)
    phases, torsion = states(drive, 20_000)
    e0 = drive.error_at(phases)[0]
    e0_few = few.error_at(phases[:, kept])[0]
    bound = note["kinematic_error_bound_arcmin"] * arcmin
    off = np.abs(e0 - e0_few).max()
    assert off <= bound * (1.0 + 1e-12)
    assert len(few.orders) < len(drive.orders)
    assert off >= 0.5 * bound

    # at the same angles of input and output the torsion differs by that of e0
    inside = np.clip(torsion, *(0.98 * drive.torsion_knots[[0, -1]]))
    shifted = inside + e0_few - e0
    off = np.abs(
        torque(drive, inside, phases) - torque(few, shifted, phases[:, kept])
    ).max()
    assert off <= note["torque_bound_Nm"]
    assert off >= 0.3 * note["torque_bound_Nm"]


def off_balance(x: float, drive: DriveMap, phases: np.ndarray, load: float) -> float:
    """Torque less the load."""
    return float(torque(drive, x, phases) - load)


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_the_output_angle_stays_within_the_tolerance(drive, tolerance):
    """Equal torque and input angle: the output turns by less than the bound."""
    few = drive.pruned(tolerance)
    note = few.info["pruned"]
    assert note["output_angle_bound_arcmin"] <= tolerance
    rng = np.random.default_rng(9)
    kept = kept_of(few, drive)
    largest = 0.0
    for load in rng.uniform(-10.0, 10.0, 300):
        [phases] = random_phases(rng, drive, 1)
        found = []
        for of, at in ((drive, phases), (few, phases[kept])):
            ends = of.torsion_knots[[0, -1]]
            torsion = brentq(off_balance, *ends, args=(of, at, load))
            found.append(of.error_at(at)[0] - torsion)
        largest = max(largest, abs(found[0] - found[1]) / arcmin)
    assert 0.2 * note["output_angle_bound_arcmin"] < largest
    assert largest <= note["output_angle_bound_arcmin"]


def test_the_weakest_go_first_and_the_mean_stays(drive):
    """More tolerance drops more, in the order of strength; at the end only the mean."""
    gone: set[tuple[int, int]] = set()
    for tolerance in (1e-6, *TOLERANCES, 1e3):
        few = drive.pruned(tolerance)
        now = {(p, q) for p, q in few.info["pruned"]["dropped"]}
        assert gone <= now
        gone = now
        np.testing.assert_array_equal(few.potential[0], drive.potential[0])
        assert len(few.orders) == few.info["pruned"]["harmonics"] + 1
        assert len(few.orders) + len(gone) == len(drive.orders)
    assert len(few.orders) == 1


def test_enclosures_hold_between_the_knots(drive):
    """Amplitudes and stiffness bounds enclose dense samples, and touch them closely."""
    x = np.linspace(*drive.torsion_knots[[0, -1]], 20_001)
    dense = np.hypot(*np.moveaxis(drive.coefficients(x, 1), -1, 0)).max(axis=0)
    ours = torque_amplitudes(drive)
    assert (dense <= ours * (1.0 + 1e-12)).all()
    np.testing.assert_allclose(ours, dense, rtol=0.02)
    bend = drive.coefficients(x, 2)
    swing = np.hypot(bend[:, 1:, 0], bend[:, 1:, 1]).sum(axis=1)
    low, high = stiffness_range(drive)
    assert low <= (bend[:, 0, 0] - swing).min()
    assert high >= (bend[:, 0, 0] + swing).max()


def test_a_pruned_map_is_saved_with_its_bounds(drive, tmp_path):
    """What was dropped is read back from the file."""
    few = drive.pruned(0.1)
    few.save(tmp_path / "few.swg")
    again = DriveMap.load(tmp_path / "few.swg")
    assert again.info["pruned"] == few.info["pruned"]
    np.testing.assert_array_equal(again.orders, few.orders)


def test_pruning_twice_keeps_the_first_bound(drive):
    """All that is gone is listed, and the sum of the bounds holds for all of it."""
    once = drive.pruned(TOLERANCES[0])
    twice = once.pruned(TOLERANCES[2])
    first, both = once.info["pruned"], twice.info["pruned"]
    gone = {tuple(row) for row in drive.orders} - {tuple(row) for row in twice.orders}
    assert first["dropped"] == both["dropped"][: len(first["dropped"])]
    assert len(first["dropped"]) < len(both["dropped"]) == len(gone)
    assert {tuple(row) for row in both["dropped"]} == gone
    assert both["harmonics"] == len(twice.orders) - 1
    assert both["tolerance_arcmin"] == pytest.approx(TOLERANCES[0] + TOLERANCES[2])
    assert both["output_angle_bound_arcmin"] <= both["tolerance_arcmin"]
    phases, _ = states(drive, 20_000)
    off = (
        drive.error_at(phases)[0] - twice.error_at(phases[:, kept_of(twice, drive)])[0]
    )
    bound = both["kinematic_error_bound_arcmin"] * arcmin
    assert 0.5 * bound <= np.abs(off).max() <= bound * (1.0 + 1e-12)
    again = once.pruned(1e-9).info["pruned"]
    assert again["dropped"] == first["dropped"]
    assert again["torque_bound_Nm"] == first["torque_bound_Nm"]


@pytest.mark.parametrize("tolerance", [0.0, -1.0, float("nan"), float("inf")])
def test_a_tolerance_is_positive(drive, tolerance):
    """One line with the value and what is accepted."""
    with pytest.raises(
        InputError, match=naming("tolerance", f"{tolerance:g} arcmin", "> 0")
    ):
        drive.pruned(tolerance)


def test_no_bound_is_claimed_where_none_follows(synthetic_map):
    """Harmonics that may cancel the mean stiffness are refused in one line."""
    drive = rippled(synthetic_map, 0)
    more = np.array([1.0, *12 * [300.0]])[:, None, None, None]
    with pytest.raises(
        InputError,
        match=naming(
            "map 'synthetic'",
            "stiffness",
            "N·m/rad",
            "tolerance",
            "rigid",
            "linear",
            "native",
        ),
    ):
        replace(drive, potential=more * drive.potential).pruned(0.1)
