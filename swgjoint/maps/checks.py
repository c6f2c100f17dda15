"""Checks that a map must pass in addition to array shapes and finite values."""

from __future__ import annotations

import numpy as np

from swgjoint.maps.potential import Potential

JUMP = 1e-6
"""Largest accepted jump at a knot, relative to the sum of the largest magnitudes at the
starts and at the ends of all intervals. It applies to the coefficients of the potential
and to those of the torque."""


def check_map(drive: Potential) -> None:
    """Reject a map that no real drive can have.

    Teeth, ratings, damping ratio, orders and magnitudes must be plausible, the mean
    torque must not decrease with the torsion, and the potential and the torque must be
    continuous at the knots.

    Raises:
        ValueError: If the map fails a check; the message describes the first fault.
    """
    z_fs, z_cs = drive.teeth_flexspline, drive.teeth_circular_spline
    if not 0 < z_fs < z_cs <= 100_000:
        raise ValueError(
            f"teeth {z_fs} and {z_cs}; accepted: 0 < flexspline < circular spline"
            " <= 100000"
        )
    r = drive.ratings
    torques = np.array([r.rated_torque, r.repeated_peak, r.momentary_peak, r.T1, r.T2])
    if not (np.isfinite(torques).all() and (torques > 0).all()):
        raise ValueError(f"ratings {torques.tolist()} N·m; accepted: > 0 N·m")
    skips = r.ratcheting_torque
    if skips is not None and not (np.isfinite(skips) and skips > 0):
        raise ValueError(f"ratcheting torque {skips} N·m; accepted: > 0 N·m or none")
    if not 0 <= drive.damping_ratio <= 10:
        raise ValueError(f"damping ratio {drive.damping_ratio}; accepted: 0 to 10")
    if len(drive.orders) > 100_000 or not (abs(drive.orders.astype(float)) < 1e6).all():
        raise ValueError(
            "orders out of range; accepted: at most 100000 harmonics, orders below 1e6"
        )

    knots = drive.torsion_knots
    # far above the values of any drive, and products of such values do not overflow
    for key in ("torsion_knots", "potential", "end_stiffness", "kinematic_error"):
        if np.abs(getattr(drive, key)).max() > 1e60:
            raise ValueError(f"{key} has a value above 1e60")
    if np.abs(drive.kinematic_error).max() > np.pi or np.abs(knots).max() > np.pi:
        raise ValueError("torsion or kinematic error above half a turn")

    d = np.diff(knots)[None, None, :, None]
    c = drive.potential
    powers = d ** np.arange(5)
    value = (c * powers).sum(axis=-1)
    slope = (c[..., 1:] * np.arange(1, 5) * powers[..., :4]).sum(axis=-1)
    for name, end, start in (
        ("potential", value, c[..., 0]),
        ("torque", slope, c[..., 1]),
    ):
        scale = np.abs(start).max() + np.abs(end).max()
        if (np.abs(end[..., :-1] - start[..., 1:]) > JUMP * scale).any():
            raise ValueError(f"{name} is discontinuous at a torsion knot")
    # the mean torque is constant within a clearance, where round-off may lower it
    torque = np.append(c[0, 0, :, 1], slope[0, 0, -1])
    if (np.diff(torque) < -1e-9 * np.abs(torque).max()).any() or (
        drive.end_stiffness[0, 0] <= 0
    ).any():
        raise ValueError("mean torque decreases with the torsion")
