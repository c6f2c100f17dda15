"""Checks that a map must pass in addition to array shapes and finite values."""

from __future__ import annotations

import numpy as np

from swgjoint.maps.potential import Potential
from swgjoint.typing import Array

JUMP = 1e-6
"""Largest accepted jump at a knot, relative to the sum of the largest magnitudes at the
starts and at the ends of all intervals. It applies to the coefficients of the potential
and to those of the torque."""

FALL = 5e-3
"""Largest accepted fall of the mean torque between two knots, relative to the rated
torque [-]: half of the torque that takes up a clearance. Where the clearance ends, the
torque between these two is interpolated."""


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
    _refuse_falls(knots, torque, 1e-9 * float(np.abs(torque).max()))
    _refuse_falls(*_extremes_of_torque(drive), FALL * r.rated_torque)
    if (drive.end_stiffness[0, 0] <= 0).any():
        raise ValueError("mean torque decreases with the torsion beyond the knots")


def _refuse_falls(torsion: Array, torque: Array, largest: float) -> None:
    """Reject a torque [N·m] that falls by more than the largest from one to the next.

    Raises:
        ValueError: If it does; the message states where.
    """
    falls = np.diff(torque) < -largest
    if falls.any():
        k = int(falls.argmax())
        raise ValueError(
            f"mean torque decreases with the torsion: {torque[k]:.4g} N·m at"
            f" {torsion[k]:.4g} rad and {torque[k + 1]:.4g} N·m at"
            f" {torsion[k + 1]:.4g} rad"
        )


def _extremes_of_torque(drive: Potential) -> tuple[Array, Array]:
    """Knots, and torsions between them where the mean torque may be extreme.

    Returns:
        Torsions, increasing (n,) [rad], and mean torques (n,) [N·m].
    """
    width = np.diff(drive.torsion_knots)
    _, c1, c2, c3, c4 = drive.potential[0, 0].T * np.arange(5)[:, None]
    # zeros of the stiffness c2 + 2 c3 d + 3 c4 d^2, at any place without a zero
    with np.errstate(all="ignore"):
        root = np.sqrt(np.maximum(c3**2 - 3.0 * c2 * c4, 0.0))
        far = -(c3 + np.copysign(root, c3))
        zeros = np.nan_to_num([far / (3.0 * c4), c2 / far], posinf=0.0, neginf=0.0)
    inside = np.sort(np.clip(zeros, 0.0, width), axis=0)
    d = np.concatenate([np.zeros((1, len(width))), inside, width[None]])
    torque = c1 + d * (c2 + d * (c3 + d * c4))
    return (drive.torsion_knots[:-1] + d).T.ravel(), torque.T.ravel()
