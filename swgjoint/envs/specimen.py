"""Drives of simulated joints and the spread of their specimens."""

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
    """The map that a reference names now: environments are made by the hundred.

    It is kept as long as the file has the same content, wherever the process works.

    Args:
        reference: See :func:`swgjoint.drives.references.load_drive`.
        kinematic_error_arcmin: The same.

    Raises:
        InputError: The same.
    """
    file = Path(reference)
    try:
        content = sha256(file.read_bytes()).digest() if file.is_file() else None
    except (OSError, ValueError):  # what cannot be read is refused by the loader
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
    """The map of a reference whose file, if it is one, has this content."""
    return load_drive(reference, kinematic_error_arcmin=kinematic_error_arcmin)


@dataclass(frozen=True, kw_only=True)
class SpecimenTolerances:
    """Within what a drive and its load may differ from the nominal ones; ± shares.

    At ``linear`` a drive is one constant spring, and ``load_inertia`` is all there is:
    the others are then 0, and refused where they are not.
    """

    stiffness: float = 0.15
    kinematic_error: float = 0.5
    """Share of its amplitude."""
    losses: float = 0.3
    """Share of hysteresis and friction."""
    load_inertia: float = 0.2
    phase: bool = True
    """Whether the angle functions begin anywhere in their cycle."""

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
        """A specimen of the drive, and by what share the load's inertia differs."""
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
        """The softest and the stiffest specimen, with the largest error."""
        error = self.kinematic_error
        return (
            Variation(stiffness=-self.stiffness, kinematic_error=error),
            Variation(stiffness=self.stiffness, kinematic_error=error),
        )


def tolerances_of(
    argument: bool | Mapping[str, float] | SpecimenTolerances, level: str
) -> SpecimenTolerances | None:
    """What the argument ``randomise`` of an environment means; None: off.

    Args:
        argument: As given.
        level: Of the drives; ``linear`` carries what the load has alone.

    Raises:
        InputError: If it is of another kind, or says what the level cannot carry.
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
        got = argument
    else:
        given = argument if isinstance(argument, Mapping) else {}
        got = SpecimenTolerances(**{**absent, **given})  # type: ignore[arg-type]
    for key in sorted(absent):
        if value := getattr(got, key):
            raise InputError(
                f"tolerance {key} {value} at level linear, whose drives are all alike;"
                " accepted: load_inertia alone, or level full"
            )
    return got


def drive_of_environment(drive: str | DriveMap, error: float | None) -> DriveMap:
    """The map of a drive with the kinematic error that an environment asks for.

    Args:
        drive: Reference, or a map, which is taken as it is.
        error: Peak to peak of an assumed error [arcmin], for a drive without one; None:
            what its catalogue states, of others nothing.

    Raises:
        InputError: If there is no such drive, or it has an error of its own and another
            one is asked for.
    """
    if isinstance(drive, str):
        return load_drive_once(drive, kinematic_error_arcmin=error)
    return with_assumed_error(drive, (error or 0.0) * arcmin)
