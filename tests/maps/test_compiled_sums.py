"""The compiled sums of maps and hysteresis elements against their numpy versions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swgjoint.kernels import kernels
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.equilibrium import output_angle
from swgjoint.maps.hysteresis import Jenkin, stretches
from swgjoint.maps.phase_bounds import MANY
from swgjoint.maps.sliders import Sliders
from swgjoint.maps.sums import error_sums, error_sums_at, law_sums

pytestmark = pytest.mark.skipif(kernels() is None, reason="needs the compiled loops")

ELEMENTS = (
    Jenkin(stiffness=2e4, yield_torque=1.5),
    Jenkin(stiffness=9e3, yield_torque=0.0, yield_curve=((10.0, 0.5), (40.0, 3.0))),
    Jenkin(stiffness=7e3, yield_torque=2.0, yield_curve=((25.0, 1.0),)),
)


def both(monkeypatch, compute):
    """Results with the compiled loops and with numpy."""
    compiled = compute()
    monkeypatch.setenv("SWGJOINT_KERNELS", "numpy")
    plain = compute()
    monkeypatch.delenv("SWGJOINT_KERNELS")
    return compiled, plain


@pytest.mark.parametrize("shape", [(), (1,), (700,), (20, 7)])
def test_sums_over_harmonics(monkeypatch, synthetic_map, shape):
    """Law, derivatives and error have the same bits, inside and beyond the knots."""
    rng = np.random.default_rng(7)
    drive = synthetic_map
    theta = rng.uniform(-90.0, 90.0, shape)
    span = 1.5 * drive.torsion_knots[-1]
    psi = theta / drive.ratio + rng.uniform(-span, span, shape)

    def compute():
        law = drive.law(theta, psi)
        return [
            *vars(law).values(),
            *drive.error_at(drive.phases(theta, psi)),
            *[f(law.torsion, theta, psi) for f in (drive.torque, drive.stiffness)],
        ]

    for got, wanted in zip(*both(monkeypatch, compute), strict=True):
        assert np.shape(got) == shape
        assert np.array_equal(got, wanted)


def with_many_harmonics(drive, rng, sign=1):
    """The map with 340 random harmonics, of which some orders are negative."""
    orders = [(a, b) for a in range(12) for b in range(-14, 15) if (a, b) > (0, 0)]
    orders = sign * rng.permutation(orders)
    size = len(orders) + 1
    assert size > MANY
    return replace(
        drive,
        orders=np.concatenate([[[0, 0]], orders]),
        kinematic_error=1e-5 * rng.normal(size=(size, 2)),
        potential=1e-3 * rng.normal(size=(size, *drive.potential.shape[1:])),
        end_stiffness=rng.normal(size=(size, 2, 2)),
    )


@pytest.mark.parametrize("shape", [(), (50,), (4, 7)])
def test_sums_over_many_harmonics(synthetic_map, shape):
    """Products of waves differ from cosines and sines of the phases by round-off."""
    rng = np.random.default_rng(11)
    drive = with_many_harmonics(synthetic_map, rng)
    theta = rng.uniform(-90.0, 90.0, shape)
    psi = theta / drive.ratio + rng.uniform(-1e-3, 1e-3, shape)
    cos, sin, errors = error_sums_at(drive, theta, psi)
    wanted_cos, wanted_sin, wanted = error_sums(drive, drive.phases(theta, psi))
    for got, right in zip(
        (cos, sin, *errors), (wanted_cos, wanted_sin, *wanted), strict=True
    ):
        assert got.shape == right.shape
        assert np.allclose(got, right, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("shape", [(), (1,), (300,), (20, 7)])
def test_law_of_many_harmonics(monkeypatch, synthetic_map, shape, sign):
    """The law is that of numpy to round-off, inside, on and beyond the knots."""
    rng = np.random.default_rng(12)
    drive = with_many_harmonics(synthetic_map, rng, sign)
    knots = drive.torsion_knots
    theta = rng.uniform(-90.0, 90.0, shape)
    psi = theta / drive.ratio + rng.uniform(-1.5, 1.5, shape) * knots[-1]

    def compute():
        sums = law_sums(drive, theta, psi, stiffness=True)
        return [*vars(drive.law(theta, psi)).values(), *sums]

    outside = 0
    for got, wanted in zip(*both(monkeypatch, compute), strict=True):
        assert np.shape(got) == np.shape(wanted) == shape
        # a phase of 90 rad times 14 waves has a rounding error of 1e-13
        assert np.allclose(got, wanted, rtol=0.0, atol=1e-11 * np.abs(wanted).max())
        outside += int(np.sum(np.abs(got) > knots[-1]))
    assert outside or np.size(theta) < 50


def test_law_along_a_slow_motion(monkeypatch, synthetic_map):
    """Harmonics with few orders in theta are waves, to round-off as the others.

    The motion passes seven positions of the polynomials and crosses knots. The same
    states in random sequence are summed by harmonics, with other bits.
    """
    rng = np.random.default_rng(14)
    orders = [(n - q, q) for n in range(6) for q in range(-24, 25) if (n, q) > (0, 0)]
    size = len(orders) + 1
    drive = replace(
        synthetic_map,
        orders=np.concatenate([[[0, 0]], orders]),
        kinematic_error=1e-5 * rng.normal(size=(size, 2)),
        potential=1e-3 * rng.normal(size=(size, *synthetic_map.potential.shape[1:])),
        end_stiffness=rng.normal(size=(size, 2, 2)),
    )
    psi = 0.3 + np.linspace(0.0, 2.8 / 24, 300)
    twist = 1.3 * drive.torsion_knots[-1] * np.sin(np.linspace(0.0, 20.0, 300))
    theta = drive.ratio * (psi + twist)
    mixed = rng.permutation(psi.size)

    def compute():
        sums = law_sums(drive, theta, psi, stiffness=True)
        return [*vars(drive.law(theta, psi)).values(), *sums]

    for got, wanted in zip(*both(monkeypatch, compute), strict=True):
        assert np.allclose(got, wanted, rtol=0.0, atol=1e-11 * np.abs(wanted).max())
    one_by_one = law_sums(drive, theta[mixed], psi[mixed]).torque
    together = law_sums(drive, theta, psi).torque[mixed]
    assert (one_by_one != together).any()


def test_law_on_the_knots(monkeypatch, synthetic_map):
    """At the outermost knots the law is that of numpy, from one side to the other."""
    drive = with_many_harmonics(synthetic_map, np.random.default_rng(13))
    drive = replace(drive, kinematic_error=0.0 * drive.kinematic_error)
    ends = drive.torsion_knots[[0, -1]]
    psi = -np.concatenate([np.nextafter(ends, x) for x in (-1.0, ends, 1.0)])

    def compute():
        return list(law_sums(drive, np.zeros(psi.size), psi, stiffness=True))

    for got, wanted in zip(*both(monkeypatch, compute), strict=True):
        assert np.allclose(got, wanted, rtol=0.0, atol=1e-11 * np.abs(wanted).max())


@pytest.mark.parametrize("count", [1, 7, 8, 50, 129, 300])
def test_order_of_additions(count):
    """The sum over any number of harmonics has the same bits as that of numpy."""
    rng = np.random.default_rng(count)
    native = kernels()
    phases, amplitudes = rng.normal(size=(5, count)), rng.normal(size=(count, 2))
    orders = rng.integers(-99, 99, (count, 2))
    cos, sin = np.empty((2, *phases.shape))
    sums = np.empty((3, 5))
    native.error_sums(phases, amplitudes, orders, cos, sin, sums)
    a, b = amplitudes.T
    slope = b * np.cos(phases) - a * np.sin(phases)
    # the libraries' sines may differ in the last bit off Linux
    assert np.allclose(cos, np.cos(phases), rtol=0.0, atol=2e-16)
    assert np.allclose(sin, np.sin(phases), rtol=0.0, atol=2e-16)
    if np.array_equal(cos, np.cos(phases)) and np.array_equal(sin, np.sin(phases)):
        assert np.array_equal(sums[0], np.sum(a * cos + b * sin, axis=-1))
        assert np.array_equal(sums[1], np.sum(slope * orders[:, 0], axis=-1))
        assert np.array_equal(sums[2], np.sum(slope * orders[:, 1], axis=-1))


def test_sliders(monkeypatch):
    """Torque and tangent of the elements have the same bits, also at the points."""
    rng = np.random.default_rng(3)
    elastic = np.concatenate([rng.uniform(-60, 60, 400), [0.0, 10.0, -25.0, 40.0]])
    torsion = rng.uniform(-1e-3, 1e-3, elastic.size)

    def compute():
        sliders = Sliders.relax(ELEMENTS, 1e-4).move_to(4e-4, 30.0)
        return [
            sliders.rest,
            *sliders.torque_and_tangent(torsion, elastic, 3e4),
            sliders.energy(torsion, elastic),
            sliders.torque(torsion[0], elastic[0]),
        ]

    for got, wanted in zip(*both(monkeypatch, compute), strict=True):
        assert np.shape(got) == np.shape(wanted)
        assert np.array_equal(got, wanted)


@pytest.mark.parametrize("count", [1, 2, 17, 1000])
def test_stretches(monkeypatch, count):
    """The stretch of an element has the same bits for constant and varying reach."""
    rng = np.random.default_rng(count)
    torsion = np.cumsum(rng.normal(size=count))
    for reach in (0.7, rng.uniform(0.0, 2.0, count)):
        got, wanted = both(monkeypatch, lambda reach=reach: stretches(torsion, reach))
        assert np.array_equal(got, wanted)


def test_equilibrium_with_many_harmonics(monkeypatch, synthetic_map):
    """Output angles are those of numpy to round-off."""
    rng = np.random.default_rng(5)
    linear = DriveMap.linear(2e4)
    many = with_many_harmonics(synthetic_map, rng)
    size = len(many.orders)
    potential, ends = np.zeros((size, 2, 1, 5)), np.zeros((size, 2, 2))
    potential[0], ends[0] = linear.potential[0], linear.end_stiffness[0]
    potential[1:, :, 0, 0] = 1e-6 * rng.normal(size=(size - 1, 2))
    drive = replace(
        linear,
        orders=many.orders,
        potential=potential,
        end_stiffness=ends,
        kinematic_error=0.01 * many.kinematic_error,
    )
    theta, torque = rng.uniform(-9.0, 9.0, 60), rng.uniform(-40.0, 40.0, 60)
    got, wanted = both(monkeypatch, lambda: output_angle(drive, theta, torque))
    assert np.allclose(got, wanted, rtol=0.0, atol=1e-13)


def test_equilibrium(monkeypatch, synthetic_map):
    """Output angles with hysteresis elements have the same bits."""
    rng = np.random.default_rng(5)
    theta, torque = rng.uniform(-9.0, 9.0, 60), rng.uniform(-40.0, 40.0, 60)

    def compute():
        return output_angle(synthetic_map, theta, torque, Sliders.relax(ELEMENTS))

    got, wanted = both(monkeypatch, compute)
    assert np.array_equal(got, wanted)


def test_wrong_shapes_are_rejected():
    """Arrays that do not fit raise an error instead of reading beyond their end."""
    native = kernels()
    with pytest.raises(ValueError, match="reach"):
        native.stretches(np.zeros(3), np.zeros(2), np.zeros(3))
    with pytest.raises(ValueError, match="orders"):
        native.error_sums(
            np.zeros((2, 3)),
            np.zeros((3, 2)),
            np.zeros((2, 2), dtype=np.int64),
            *np.zeros((2, 2, 3)),
            np.zeros((3, 2)),
        )
    arrays = {
        "knots": np.zeros(2),
        "powers": np.zeros((3, 2, 1, 5)),
        "ends": np.zeros((3, 2, 2)),
        "amplitudes": np.zeros((3, 2)),
        "orders": np.zeros((3, 2), dtype=np.int64),
        "of_theta": np.zeros(1),
        "of_psi": np.zeros(1),
        "which": np.zeros((3, 2), dtype=np.int64),
    }
    for name in ("knots", "powers", "ends", "amplitudes", "which"):
        with pytest.raises(ValueError, match=name):
            native.HarmonicSums(**{**arrays, name: arrays[name][1:]}, ratio=1.0)
    with pytest.raises(ValueError, match="which"):
        native.HarmonicSums(**{**arrays, "which": arrays["which"] + 1}, ratio=1.0)
    with pytest.raises(ValueError, match="result"):
        native.HarmonicSums(**arrays, ratio=1.0).evaluate(
            *np.zeros((2, 2)), np.zeros((6, 2))
        )
    with pytest.raises(ValueError, match="first"):
        native.yield_torsions(
            np.array([0, 3]), *np.ones((2, 2)), *np.ones((2, 1)), *np.ones((2, 1, 1))
        )
