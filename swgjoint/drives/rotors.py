"""Assumed rotor inertia of catalogue drives."""

from __future__ import annotations

from swgjoint.errors import InputError
from swgjoint.gear.catalogue import table
from swgjoint.maps.from_catalogue import find_row, is_catalogue_name


def catalogue_rotor_inertia(drive: str) -> float | None:
    """Rotor inertia of a catalogue drive, twice the inertia of its wave generator.

    This assumes a motor whose inertia equals that of the wave generator.

    Args:
        drive: Name of a catalogue drive.

    Returns:
        Inertia of rotor and wave generator [kg·m²]; None for other drives, and where
        the tables state no inertia.
    """
    if not is_catalogue_name(drive):
        return None
    try:
        row = find_row(drive)
    except InputError:
        return None  # loading the drive reports what is wrong with the name
    for rated in table("ratings"):
        if (rated["size"], rated["ratio"]) == (row.size, row.ratio):
            wave_generator = rated["input_inertia_1e-4kgm2"]
            if isinstance(wave_generator, float):
                return round(2e-4 * wave_generator, 12)
    return None
