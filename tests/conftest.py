"""Fixtures that several parts share."""

from __future__ import annotations

import os

# before numpy starts a pool of threads in each of several processes
for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import numpy as np  # noqa: E402
import pytest  # noqa: E402

from swgjoint.gear.ratings import Ratings  # noqa: E402
from swgjoint.maps.drive_map import DriveMap  # noqa: E402
from swgjoint.maps.fields import DriveFields  # noqa: E402
from swgjoint.maps.friction import Friction  # noqa: E402

pytest_plugins = ["scheduling"]


def make_synthetic_map(
    stiffness: float = 2e4,
    hardening: float = 2.0,
    error: float = 5e-5,
    ripple: float = 0.02,
    orders: tuple[tuple[int, int], ...] = ((2, 0), (4, 0), (122, 0), (3, 1)),
) -> DriveMap:
    """A hardening spring with angle harmonics and kinematic error, all exact.

    T(x) = K x (1 + hardening (x/x0)^2) with x0 the torsion at K x0 = 100 N·m; every
    harmonic scales that torque by a few percent and adds a constant cogging energy.
    """
    x0 = 100.0 / stiffness
    knots = np.linspace(-x0, x0, 9)
    n = 1 + len(orders)
    potential = np.zeros((n, 2, knots.size - 1, 5))
    # V = K x^2/2 + K h x^4/(4 x0^2), expanded about each knot
    polynomial = np.polynomial.Polynomial(
        [0, 0, stiffness / 2, 0, stiffness * hardening / 4 / x0**2]
    )
    ends = np.zeros((n, 2, 2))
    for j, knot in enumerate(knots[:-1]):
        shifted = polynomial(np.polynomial.Polynomial([knot, 1.0])).coef
        potential[0, 0, j, : shifted.size] = shifted
    ends[0, 0] = polynomial.deriv(2)(knots[[0, -1]])
    rng = np.random.default_rng(7)
    e0 = np.zeros((n, 2))
    for k in range(1, n):
        scale = ripple * rng.uniform(-1, 1, 2) / k
        potential[k] = scale[:, None, None] * potential[0, 0]
        ends[k] = scale[:, None] * ends[0, 0]
        potential[k, :, :, 0] += 1e-3 * rng.uniform(-1, 1, 2)[:, None]
        e0[k] = error * rng.uniform(-1, 1, 2) / k
    return DriveMap(
        name="synthetic",
        level="synthetic",
        layout="circular_spline_fixed",
        teeth_flexspline=120,
        teeth_circular_spline=122,
        torsion_knots=knots,
        orders=np.array([(0, 0), *orders]),
        potential=potential,
        end_stiffness=ends,
        kinematic_error=e0,
        ratings=Ratings(
            rated_torque=50.0, repeated_peak=100.0, momentary_peak=200.0, T1=10, T2=30
        ),
    )


@pytest.fixture
def synthetic_map() -> DriveMap:
    return make_synthetic_map()


@pytest.fixture
def fields() -> DriveFields:
    """A ring of 120 teeth that the lobes push out; stress 1 to 3 MPa."""
    places, radius, lobe = 120, 0.06, 1e-3
    place = np.pi * np.arange(places) / places
    u = np.zeros((2, places, 3, 3))
    u[..., 1] = lobe * np.cos(2.0 * place)[None, :, None]
    stress = 2e6 + 1e6 * np.cos(2.0 * place)
    force = np.zeros((2, places, 3))
    force[..., 1] = -10.0
    return DriveFields(
        torque=np.array([-100.0, 100.0]),
        first_place=np.zeros(2),
        period=np.pi,
        points=radius
        * np.array([[-0.01, 1.0, 0.0], [0.01, 1.0, 0.0], [0.0, 0.9, 0.0]]),
        triangles=np.array([[0, 1, 2]]),
        displacement=u,
        von_mises=np.broadcast_to(stress[None, :, None], (2, places, 3)),
        tooth_force=force,
        wave_generator_force=-force,
        wave_generator=radius
        * np.array([[0.0, 0.9], [-0.9, 0.0], [0.0, -0.9], [0.9, 0]]),
        circular_spline=radius * np.array([[0.02, 1.05], [0.0, 1.0], [-0.02, 1.05]]),
    )


@pytest.fixture
def friction_law() -> Friction:
    """Every term of the law, none of them small."""
    return Friction(
        stiffness=70.0,
        coulomb=0.04,
        static=0.07,
        stribeck_speed=3.0,
        viscous=6e-4,
        load=0.1,
        bending=0.005,
        damping=0.05,
    )
