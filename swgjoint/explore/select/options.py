"""Drives to select from, with their cost and limits, from tables of drives."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from math import inf
from pathlib import Path

from swgjoint.csv_columns import read_table
from swgjoint.drives.references import load_drive
from swgjoint.drives.rotors import rotor_inertia_of
from swgjoint.drives.sections import LifeSection
from swgjoint.errors import InputError
from swgjoint.maps.drive_map import DriveMap
from swgjoint.models_path import is_file, models_path, near_names
from swgjoint.progress import Progress, silent
from swgjoint.units import rpm

CATALOGUE = "units"
"""Bundled table of drives in ``models/catalogue``."""
MASS = "mass_kg"
"""Default column of the cost."""
NUMBERS = (
    MASS,
    "max_input_speed_rpm",
    "average_input_speed_rpm",
    "rotor_inertia_kgm2",
    "L50_h",
)
"""Columns with a meaning, all of them positive numbers; others may state a cost."""

Row = Mapping[str, str | float | None]


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveOption:
    """A drive that a joint can get."""

    drive: str
    """Design, map or catalogue drive."""
    cost: Decimal
    """Cost in the unit of its column."""
    mass: float | None
    """Mass [kg]; None if the table does not state it."""
    max_input_speed: float
    """Largest input speed [rad/s]; inf if not stated."""
    average_input_speed: float
    """Limit of the average input speed [rad/s]; inf if not stated."""
    rotor_inertia: float | None
    """Inertia of rotor and wave generator [kg·m²]; None to keep that of the scene."""
    life: LifeSection | None
    """Rated life; None for that of the scene or of the catalogue."""
    map: DriveMap
    """Map of the drive, without the options of a joint."""


def read_options(
    table: str | Path | None = None,
    *,
    by: str = MASS,
    catalogue: bool = True,
    progress: Progress = silent,
) -> tuple[DriveOption, ...]:
    """Read the drives to select from.

    A row of the user's table replaces the row of the catalogue with the same name, and
    takes its empty cells from it. A warning counts drives without a cost.

    Args:
        table: CSV file with a column ``drive`` (design, map or catalogue name; paths
            are relative to the file), :data:`NUMBERS` and any other numbers.
        by: Column of the cost.
        catalogue: Whether the bundled drives take part.
        progress: Called while maps of designs are built.

    Returns:
        The drives that have a cost, in the order of the tables.

    Raises:
        InputError: If the table or a drive cannot be used, or if no drive has a cost.
    """
    bundled_path = models_path() / "catalogue" / f"{CATALOGUE}.csv"
    bundled: dict[str, Row] = {str(r["drive"]): r for r in _rows(bundled_path)}
    rows: dict[str, Row] = dict(bundled) if catalogue else {}
    for row in [] if table is None else _rows(Path(table)):
        name = str(row["drive"])
        stated = {key: value for key, value in row.items() if value is not None}
        rows[name] = {**bundled.get(name, {}), **stated}
    columns = dict.fromkeys(key for row in rows.values() for key in row)
    if by not in columns or by == "drive":
        accepted = [key for key in columns if key != "drive"]
        near = near_names(by, accepted)
        hint = f"did you mean {' or '.join(near)}? " if near else ""
        raise InputError(
            f"--by {by}: no such column; {hint}accepted: {', '.join(accepted)}"
        )
    options, free = [], [name for name, row in rows.items() if row.get(by) is None]
    if free:
        warnings.warn(
            f"{len(free)} drives have no {by} and are not selected, such as {free[0]}",
            stacklevel=2,
        )
    for name, row in rows.items():
        cost = row.get(by)
        if cost is None:
            continue
        if not isinstance(cost, float) or not 0.0 <= cost < inf:
            raise InputError(
                f"drive {name}: {by} = {cost!r}; accepted: a number that is not"
                " negative"
            )
        options.append(_option(name, row, cost, progress))
    if not options:
        raise InputError("no drive to select from; accepted: a table with drives")
    return tuple(options)


def _rows(path: Path) -> list[Row]:
    rows: list[Row] = []
    for row in read_table(path, "drive"):
        name = str(row["drive"])
        for key in NUMBERS:
            value = row.get(key)
            if value is None or (isinstance(value, float) and 0.0 < value < inf):
                continue
            raise InputError(
                f"{path}: drive {name}: {key} = {value!r}; accepted: a positive number"
            )
        beside = path.parent / name
        rows.append({**row, "drive": str(beside) if is_file(beside) else name})
    return rows


def _option(name: str, row: Row, cost: float, progress: Progress) -> DriveOption:
    def number(key: str, unit: float = 1.0) -> float | None:
        value = row.get(key)
        return value * unit if isinstance(value, float) else None

    inertia, life = number("rotor_inertia_kgm2"), number("L50_h")
    return DriveOption(
        drive=name,
        cost=Decimal(repr(cost)),
        mass=number(MASS),
        max_input_speed=number("max_input_speed_rpm", rpm) or inf,
        average_input_speed=number("average_input_speed_rpm", rpm) or inf,
        rotor_inertia=inertia or rotor_inertia_of(name),
        life=None if life is None else LifeSection(L50_h=life),
        map=load_drive(name, progress=progress),
    )


def check_options(options: Sequence[DriveOption]) -> None:
    """Check that drives given from Python have different names.

    Raises:
        InputError: If two have the same name, or if there is none.
    """
    names = [option.drive for option in options]
    if not names or len(set(names)) < len(names):
        raise InputError(f"drives {', '.join(names)}; accepted: one or more, each once")
