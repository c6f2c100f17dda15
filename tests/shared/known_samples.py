"""Equilibria of a potential in closed form."""

from __future__ import annotations

import numpy as np

from swgjoint.gear.ratings import Ratings
from swgjoint.maps.samples import MapSamples

RATINGS = Ratings(rated_torque=20, repeated_peak=50, momentary_peak=90, T1=5, T2=15)
N = 122


def samples_of(
    stiffness=2e4, swing=0.1, error=3e-6, cogging=2e-6, n_angles=24, n_torques=11
):
    """Equilibria of V = K x^2/2 (1 + h x^2)(1 + s cos phi) + c sin 2 phi, e0 known."""
    hard = 4e4

    def v(x, phi):
        return 0.5 * stiffness * x**2 * (1 + hard * x**2) * (
            1 + swing * np.cos(phi)
        ) + cogging * np.sin(2 * phi)

    def torque(x, phi):
        return stiffness * x * (1 + 2 * hard * x**2) * (1 + swing * np.cos(phi))

    theta = 2 * np.pi / N * np.arange(n_angles) / n_angles
    phi = N * theta
    levels = np.linspace(-50, 50, n_torques)
    x = np.zeros((n_torques, n_angles))
    for _ in range(50):  # Newton
        k = stiffness * (1 + 6 * hard * x**2) * (1 + swing * np.cos(phi))
        x -= (torque(x, phi) - levels[:, None]) / k
    k = stiffness * (1 + 6 * hard * x**2) * (1 + swing * np.cos(phi))
    e0 = error * np.cos(phi) + 0.3 * error * np.sin(2 * phi)
    de0 = N * (-error * np.sin(phi) + 0.6 * error * np.cos(2 * phi))
    base = 0.5 * stiffness * x**2 * (1 + hard * x**2)
    dv = N * (-swing * np.sin(phi) * base + 2 * cogging * np.cos(2 * phi))
    return MapSamples(
        name="known",
        level="2d",
        layout="circular_spline_fixed",
        teeth_flexspline=120,
        teeth_circular_spline=122,
        ratings=RATINGS,
        damping_ratio=0.02,
        order=(N, 0),
        input_angle=theta,
        torque=levels,
        output_error=e0 - x + 5e-6,
        energy=v(x, phi) + 0.02,
        compliance=1 / k,
        input_torque=levels[:, None] * (-1 / 60 + de0) + dv,
    )
