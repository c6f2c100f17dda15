"""Specimens of one drive, which differ within manufacturing tolerances.

The kinematic error of a specimen is drawn as a spectrum. The amplitudes come from
finite elements of a drive at the limits of its tolerances
(:mod:`swgjoint.maps.fit.error_spectrum`), the phases from a seed. The *systematic* part
belongs to the specimen: low orders from cumulative pitch error, roundness and centring.
The *random* part, higher orders from single pitch errors, has a separate seed. The
record for identification can therefore have another random part than the drive whose
error is compensated.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swgjoint.control.kinematic_error import KinematicErrorTable
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import AMPLITUDES
from swgjoint.units import arcmin

RANDOM = 0.07
"""Amplitude of each of :data:`RANDOM_ORDERS`, which single pitch errors cause, relative
to the amplitude of order 2 alpha [-]."""
RANDOM_ORDERS = (*((p, 0) for p in range(5, 13)), *((0, q) for q in range(5, 13)))
"""Orders (p, q) of the random part."""
LOW = 4
"""Largest order of a map with kinematic error that belongs to its systematic part."""
ACCURACY = 1.0
"""Transmission accuracy of a drive whose catalogue states none [arcmin]."""
FRICTION = 0.2
"""Largest relative deviation of the friction of a specimen from the nominal one [-]."""


def specimen(base: DriveMap, seed: int, *, random_seed: int = 0) -> DriveMap:
    """Draw one specimen of a drive.

    A map with kinematic error keeps its amplitudes and gets other phases, shifted
    equally for potential and error. A map without kinematic error gets the orders of
    :mod:`swgjoint.maps.fit.error_spectrum` and the random orders. Their peak-to-peak
    value over one output turn is the transmission accuracy that the catalogue states,
    or else :data:`ACCURACY`. The friction is scaled at random.

    Args:
        base: Nominal drive.
        seed: Seed of systematic part and friction.
        random_seed: Seed of the random part.
    """
    systematic = np.random.default_rng([seed, 0])
    random = np.random.default_rng([seed, 1, random_seed])
    drive = _turned(base, systematic, random)
    if not base.kinematic_error.any():
        drive = _drawn(base, systematic, random)
    if base.friction is None:
        return drive
    share = 1.0 + FRICTION * float(systematic.uniform(-1.0, 1.0))
    law = base.friction
    parts = {
        key: share * getattr(law, key)
        for key in ("coulomb", "static", "viscous", "load")
    }
    return replace(drive, friction=replace(law, **parts))


def nominal(base: DriveMap) -> DriveMap:
    """Map that the controllers know for every specimen: mean curve and friction."""
    return base.with_harmonics(np.zeros(len(base.orders), dtype=bool))


def _drawn(
    base: DriveMap, systematic: np.random.Generator, random: np.random.Generator
) -> DriveMap:
    orders = np.array([*AMPLITUDES, *RANDOM_ORDERS])
    size = [*AMPLITUDES.values(), *np.full(len(RANDOM_ORDERS), RANDOM)]
    phase = (
        2.0
        * np.pi
        * np.concatenate(
            [
                systematic.uniform(size=len(AMPLITUDES)),
                random.uniform(size=len(RANDOM_ORDERS)),
            ]
        )
    )
    pairs = np.array(size)[:, None] * np.stack([np.cos(phase), np.sin(phase)], axis=-1)
    stated = (base.info.get("stated") or {}).get("transmission_accuracy_arcmin")
    wanted = (stated or ACCURACY) * arcmin
    table = KinematicErrorTable(orders=orders, amplitudes=pairs)
    return table.scale_to(base, wanted).apply_to(base)


def _turned(
    base: DriveMap, systematic: np.random.Generator, random: np.random.Generator
) -> DriveMap:
    low = (np.abs(base.orders) <= LOW).all(axis=1)
    phase = np.where(
        low,
        systematic.uniform(0.0, 2.0 * np.pi, low.size),
        random.uniform(0.0, 2.0 * np.pi, low.size),
    )
    phase[0] = 0.0
    turn = np.array([[np.cos(phase), -np.sin(phase)], [np.sin(phase), np.cos(phase)]])
    return replace(
        base,
        kinematic_error=np.einsum("abk,kb->ka", turn, base.kinematic_error),
        potential=np.einsum("abk,kbmc->kamc", turn, base.potential),
        end_stiffness=np.einsum("abk,kbe->kae", turn, base.end_stiffness),
    )
