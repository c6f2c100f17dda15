r"""Assumed kinematic error of a drive whose source states only an upper bound.

A catalogue bounds the peak-to-peak error over one output turn and does not state its
orders. Two opposite lobes average the position errors of the teeth, which then appear
mainly at 2 and 4 cycles per turn of the wave generator. The assumed specimen therefore
has

.. math:: e_0 = a\left[\cos(2x + \phi_2) + r\cos(4x + \phi_4)\right]

where x is the input angle: that of the wave generator relative to the fixed spline or,
with the wave generator fixed, relative to the flexspline. A random generator with a
given seed draws r and both phases; a is such that the peak-to-peak error equals the
stated value. The assumed error repeats with every input turn. The error of a real drive
is also modulated over the output turn and stays below the bound.

Studies of specimens use more orders (:data:`AMPLITUDES`), which come from finite
elements of one drive at the limits of its tolerances.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike

from swgjoint.errors import InputError
from swgjoint.gear.kinematics import angle_coefficients
from swgjoint.units import arcmin

if TYPE_CHECKING:
    from swgjoint.maps.potential import Potential

    Map = TypeVar("Map", bound=Potential)


AMPLITUDES: dict[tuple[int, int], float] = {
    (2, 0): 1.0,
    (0, 2): 0.98,
    (4, 0): 0.46,
    (0, 4): 0.48,
    (-1, 1): 0.18,
    (1, 1): 0.18,
    (1, 0): 0.15,
    (0, 1): 0.07,
}
"""Amplitudes by (p, q) of p alpha + q beta, relative to that of 2 alpha [-].

They are the low orders of e0 in the 2D map of ``reference-2d-tolerances``, where the
amplitude of 2 alpha is 0.138 arcmin. The teeth of that drive have errors of ISO 1328-1
class 4; roundness and concentricity of its members follow ISO 286-1 IT3 and IT4.
"""
SHARE = (0.25, 0.75)
"""Range of r, the amplitude at 4 cycles per turn over that at 2 [-]; it includes the
values 0.46 and 0.48 of :data:`AMPLITUDES`."""
LARGEST = 60.0
"""Largest accepted peak-to-peak error [arcmin], 40 times the largest bound of a
catalogue drive."""
_SAMPLES = 2**16  # per period; the relative error of the peak to peak is below 1e-8


def peak_to_peak(drive: Potential) -> float:
    """Peak to peak of e0 over one output turn [rad], at 40 positions per input turn."""
    psi = np.linspace(0.0, 2.0 * np.pi, 40 * round(abs(drive.ratio)) + 1)
    phases = drive.phases(drive.ratio * psi, psi)
    return float(np.ptp(drive.error_at(phases)[0]))


def with_error(drive: Map, orders: ArrayLike, amplitudes: ArrayLike) -> Map:
    """The drive with another kinematic error in place of its original one.

    The potential is kept. The label of the original error and the validation record,
    which no longer apply, are removed.

    Args:
        drive: The map.
        orders: (p, q) of p alpha + q beta. Shape (n, 2).
        amplitudes: Cosine and sine amplitudes [rad]. Shape (n, 2).
    """
    wanted = np.array(orders, dtype=np.int64).reshape(-1, 2).tolist()
    present = drive.orders.tolist()
    every = present + [row for row in wanted if row not in present]
    count, old = len(every), len(present)
    error = np.zeros((count, 2))
    error[[every.index(row) for row in wanted]] = amplitudes
    potential = np.zeros((count, *drive.potential.shape[1:]))
    ends = np.zeros((count, 2, 2))
    potential[:old], ends[:old] = drive.potential, drive.end_stiffness
    info = {key: one for key, one in drive.info.items() if key not in _OF_OWN_ERROR}
    return replace(
        drive,
        info=info,
        orders=np.array(every, dtype=np.int64),
        kinematic_error=error,
        potential=potential,
        end_stiffness=ends,
    )


def with_assumed_error(
    drive: Map,
    peak_to_peak: float,
    *,
    seed: int = 0,
    joint: str = "",
    stated: bool = True,
) -> Map:
    """A drive without kinematic error, completed by the assumed error of one specimen.

    ``info["kinematic_error"]`` states the assumption with its size and seed. Reasons in
    ``info["missing"]`` for the absence of an error are removed.

    Args:
        drive: Map without kinematic error.
        peak_to_peak: Peak-to-peak error over one output turn [rad]; zero leaves the map
            unchanged.
        seed: Seed for the amplitude ratio and the phases of the two orders, >= 0.
        joint: Name of the joint that the drive is for. It is combined with the seed, so
            joints with the same seed get different errors.
        stated: Whether the user stated the size; its orders and phases are assumed in
            any case.

    Raises:
        InputError: If the map already has an error, or a value is out of range.
    """
    wanted = peak_to_peak / arcmin
    if not (np.isfinite(wanted) and 0.0 <= wanted <= LARGEST):
        raise InputError(
            f"kinematic_error_arcmin {wanted:g}; accepted: 0 to {LARGEST:g} arcmin"
        )
    integer = isinstance(seed, int | np.integer) and not isinstance(seed, bool)
    if not (integer and seed >= 0):
        raise InputError(f"seed {seed!r} of a kinematic error; accepted: integers >= 0")
    if wanted == 0.0:
        return drive
    if drive.kinematic_error[1:].any():
        raise InputError(
            f"kinematic_error_arcmin {wanted:g} for map {drive.name!r}, which has its"
            " own error; accepted: 0 or no value"
        )
    rng = np.random.default_rng([seed, crc32(joint.encode())] if joint else seed)
    share = float(rng.uniform(*SHARE))
    phase = rng.uniform(0.0, 2.0 * np.pi, 2)
    size = np.array([1.0, share])
    angle = 2.0 * np.pi * np.arange(_SAMPLES) / _SAMPLES
    wave = np.cos(angle + phase[0]) + share * np.cos(2.0 * angle + phase[1])
    size = size * peak_to_peak / float(np.ptp(wave))
    # a cos(n x + phase) as cosine and sine amplitudes
    pairs = size[:, None] * np.stack([np.cos(phase), -np.sin(phase)], axis=-1)
    first, second = f"{wanted:g} arcmin", "assumed:"
    label = f"{first} stated; {second}" if stated else f"{second} {first}"
    label += f" at 2 and 4 per turn, seed {seed}"
    label += f", joint {joint}" if joint else ""
    missing = dict(drive.info.get("missing") or {})
    missing = {key: why for key, why in missing.items() if key not in _ABSENT}
    info = {**drive.info, "kinematic_error": label, "missing": missing}
    return replace(with_error(drive, _orders(drive.layout), pairs), info=info)


_OF_OWN_ERROR = ("kinematic_error", "validation")
"""Keys of ``info`` that apply to the original error only."""
_ABSENT = (
    "transmission_accuracy_arcmin",
    "transmission_accuracy_rated_arcmin",
    "orders",
    "ripple_rms_percent",
    "ripple_pp_percent",
)
"""Keys of ``info["missing"]`` for figures that a map without error cannot provide."""


def _orders(layout: str) -> Sequence[tuple[int, int]]:
    """(p, q) of 2 and 4 cycles per input turn, independent of the output."""
    _, (_, by_psi) = angle_coefficients(layout)
    return ((0, 2), (0, 4)) if by_psi == 0 else ((2, 0), (4, 0))
