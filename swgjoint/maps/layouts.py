r"""The map of a gear with another fixed member.

The energy of a gear depends only on the angles of the wave generator relative to the
circular spline, alpha, and to the flexspline, beta. With the circular spline fixed the
torsion is :math:`\Delta = \beta - \alpha z_{cs}/z_{fs} + e_0`. With one of the other
members fixed it is

.. math:: \Delta' = \alpha - s\beta + e_0' = -s\Delta, \quad e_0' = -s e_0, \quad
    s = z_{fs}/z_{cs},

so that :math:`V'(\Delta', \alpha, \beta) = V(-\Delta'/s, \alpha, \beta)` is exact: the
stiffness at the output is :math:`1/s^2` times as large.
"""

from __future__ import annotations

from dataclasses import replace
from math import comb

import numpy as np

from swgjoint.gear.ratings import Ratings
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fields import DriveFields
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.typing import Array


def with_layout(drive: DriveMap, layout: str, ratings: Ratings) -> DriveMap:
    """The map of the same gear with another member fixed than the circular spline.

    Hysteresis opposes the same motion of the teeth. Friction of the wave generator,
    which a map keeps for one ratio of input torque to output torque, is left out.

    Args:
        drive: The map with the circular spline fixed.
        layout: The other layout, ``flexspline_fixed`` or ``wave_generator_fixed``.
        ratings: Ratings of the drive in that layout.
    """
    assert drive.layout == "circular_spline_fixed" != layout
    s = drive.teeth_flexspline / drive.teeth_circular_spline
    changed = replace(
        drive,
        layout=layout,
        torsion_knots=-s * drive.torsion_knots[::-1],
        potential=_mirrored(drive.potential, np.diff(drive.torsion_knots), s),
        end_stiffness=drive.end_stiffness[..., ::-1] / s**2,
        kinematic_error=-s * drive.kinematic_error,
        ratings=ratings,
        hysteresis=tuple(_scaled(element, s) for element in drive.hysteresis),
        friction=None,
        fields=None if drive.fields is None else _turned(drive.fields, s),
    )
    return changed.with_parts(info=_described(drive, changed, s))


def _mirrored(potential: Array, length: Array, s: float) -> Array:
    """Coefficients in powers of the distance from the mirrored knots.

    A distance y from a mirrored knot is the distance h - y/s from the knot at the other
    end of an interval of the length h.

    Args:
        potential: Coefficients (n_harmonics, 2, n_intervals, 5).
        length: Lengths h of the intervals (n_intervals,) [rad].
        s: Ratio of the torsions [-].
    """
    result = np.zeros_like(potential)
    for power in range(potential.shape[-1]):
        for k in range(power + 1):
            factor = comb(power, k) * length ** (power - k) * (-1.0 / s) ** k
            result[..., k] += factor * potential[..., power]
    return result[:, :, ::-1]


def _scaled(element: Jenkin, s: float) -> Jenkin:
    """The element along the torsion of the other layout."""
    return Jenkin(
        stiffness=element.stiffness / s**2,
        yield_torque=element.yield_torque / s,
        yield_curve=tuple((at / s, torque / s) for at, torque in element.yield_curve),
    )


def _turned(fields: DriveFields, s: float) -> DriveFields:
    """Fields for display in the order of the output torques of the other layout.

    The place of a tooth depends on beta alone.
    """
    by_torque = (key for key, shape in fields.SHAPES.items() if shape[0] == "torques")
    turned = {key: getattr(fields, key)[::-1] for key in by_torque}
    return replace(fields, **{**turned, "torque": -fields.torque[::-1] / s})


def _described(drive: DriveMap, changed: DriveMap, s: float) -> dict[str, object]:
    """Provenance of the map; torque and stiffness ranges are those of the layout."""
    info = dict(drive.info)
    if "label" in info:
        made = "computed with the circular spline fixed and transformed exactly"
        info["label"] = {**info["label"], "layout": made}
    if "sampled_torque_Nm" in info:
        low, high = info["sampled_torque_Nm"]
        info["sampled_torque_Nm"] = [-high / s, -low / s]
    if "stiffness_range_Nm_rad" in info:
        info["stiffness_range_Nm_rad"] = [
            value / s**2 for value in info["stiffness_range_Nm_rad"]
        ]
    if "torque_range_Nm" in info:
        ends = changed.with_parts(info=info).torque_range
        info["torque_range_Nm"] = [float(value) for value in ends]
    return info
