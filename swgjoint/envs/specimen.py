"""Drives of simulated joints and the tolerances of individual specimens."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

import numpy as np

from swgjoint.drives.references import load_drive
from swgjoint.envs.arguments import format_value, is_flag, is_number
from swgjoint.errors import InputError
from swgjoint.joint.variation import Variation
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.fit.error_spectrum import with_assumed_error
from swgjoint.units import arcmin


def load_drive_once(
    reference: str, *, kinematic_error_arcmin: float | None = None
) -> DriveMap:
    """Load a drive map once for many environments.

    The map is kept in memory and is loaded again only if the content of its file
    changes.

    Args:
        reference: See :func:`swgjoint.drives.references.load_drive`.
        kinematic_error_arcmin: See :func:`swgjoint.drives.references.load_drive`.

    Raises:
        InputError: As :func:`swgjoint.drives.references.load_drive`.
    """
    file = Path(reference)
    try:
        content = sha256(file.read_bytes()).digest() if file.is_file() else None
    except (OSError, ValueError):  # the loader rejects unreadable files
        content = None
    return _load_once(
        reference if content is None else str(file.resolve()),
        content,
        kinematic_error_arcmin=kinematic_error_arcmin,
    )


@lru_cache(maxsize=256)
def _load_once(
    reference: str, content: bytes | None, *, kinematic_error_arcmin: float | None
) -> DriveMap:
    """Load a map; ``content`` is the hash of its file, as part of the cache key."""
    return load_drive(reference, kinematic_error_arcmin=kinematic_error_arcmin)


@dataclass(frozen=True, kw_only=True)
class SpecimenTolerances:
    """Relative tolerances of a drive and its load: largest deviations of either sign.

    A drive of level ``linear`` is one constant spring; all its tolerances except
    ``load_inertia`` must be zero.
    """

    stiffness: float = 0.15
    """Tolerance of the stiffness [-]."""
    kinematic_error: float = 0.5
    """Tolerance of the amplitude of the kinematic error [-]."""
    losses: float = 0.3
    """Tolerance of hysteresis and friction [-]."""
    load_inertia: float = 0.2
    """Tolerance of the load inertia [-]."""
    phase: bool = True
    """Whether the angles at which kinematic error and stiffness vary are shifted at
    random."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value, flag = getattr(self, field.name), field.name == "phase"
            good = is_flag(value) if flag else is_number(value) and 0.0 <= value < 1.0
            if not good:
                accepted = "True, False" if flag else "0 to 1, 1 excluded"
                raise InputError(
                    f"tolerance {field.name} {format_value(value)}; accepted:"
                    f" {accepted}"
                )

    def draw(self, rng: np.random.Generator) -> tuple[Variation, float]:
        """Draw a specimen of the drive and a relative deviation of load inertia [-]."""
        share, turn = rng.uniform(-1.0, 1.0, 4), rng.uniform(0.0, 2.0 * np.pi, 2)
        variation = Variation(
            stiffness=float(self.stiffness * share[0]),
            kinematic_error=float(self.kinematic_error * share[1]),
            losses=float(self.losses * share[2]),
            theta=float(self.phase * turn[0]),
            psi=float(self.phase * turn[1]),
        )
        return variation, float(self.load_inertia * share[3])

    def extremes(self) -> tuple[Variation, Variation]:
        """Softest and stiffest specimen, both with the largest kinematic error."""
        error = self.kinematic_error
        return (
            Variation(stiffness=-self.stiffness, kinematic_error=error),
            Variation(stiffness=self.stiffness, kinematic_error=error),
        )


def tolerances_of(
    argument: bool | Mapping[str, float] | SpecimenTolerances, level: str
) -> SpecimenTolerances | None:
    """Tolerances from the argument ``randomise`` of an environment.

    Args:
        argument: Value of the argument; True means the default tolerances.
        level: Level of the drives; ``linear`` supports only ``load_inertia``.

    Returns:
        The tolerances; None if the argument is False.

    Raises:
        InputError: If the argument is not accepted, or if the level does not support a
            tolerance.
    """
    known = {field.name for field in fields(SpecimenTolerances)}
    if argument is False:
        return None
    if isinstance(argument, Mapping):
        unknown = [format_value(key) for key in argument if key not in known]
    else:
        unknown = [format_value(argument)]
    if (
        unknown
        and argument is not True
        and not isinstance(argument, SpecimenTolerances)
    ):
        raise InputError(
            f"randomise {unknown[0]}; accepted: True, False or a mapping with"
            f" {', '.join(sorted(known))}"
        )
    absent = dict.fromkeys(known - {"load_inertia"}, 0) if level == "linear" else {}
    if isinstance(argument, SpecimenTolerances):
        tolerances = argument
    else:
        chosen = argument if isinstance(argument, Mapping) else {}
        tolerances = SpecimenTolerances(**{**absent, **chosen})  # type: ignore[arg-type]
    for key in sorted(absent):
        if value := getattr(tolerances, key):
            raise InputError(
                f"tolerance {key} {value} at level linear; accepted: load_inertia only,"
                " or level full"
            )
    return tolerances


def drive_of_environment(drive: str | DriveMap, error: float | None) -> DriveMap:
    """Drive map with the kinematic error that the arguments of an environment state.

    Args:
        drive: Catalogue name or file of a drive, or its map.
        error: Peak-to-peak value of an assumed kinematic error [arcmin], for a drive
            without one. None uses the transmission accuracy of the catalogue for a
            catalogue name and leaves other drives unchanged.

    Raises:
        InputError: If the drive does not exist, or if it already has a kinematic error
            and ``error`` is greater than zero.
    """
    if isinstance(drive, str):
        return load_drive_once(drive, kinematic_error_arcmin=error)
    return with_assumed_error(drive, (error or 0.0) * arcmin)
