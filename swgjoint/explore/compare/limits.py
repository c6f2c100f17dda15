"""Limits of a comparison: reading and checking."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any

from swgjoint.errors import InputError
from swgjoint.models_path import near_names
from swgjoint.sim.figures.keys import LOWER, OF_CYCLE, UPPER
from swgjoint.sim.scene.scene import Scene
from swgjoint.toml_file import read_toml

SORTABLE = (*UPPER, *LOWER)
"""Figures that can be limited, and by which rows can be sorted."""


def read_spec(path: str | Path, accepted: Sequence[str] = SORTABLE) -> dict[str, float]:
    """Read the limits of a ``[spec]`` table.

    Args:
        path: TOML file.
        accepted: Figures that may be limited.

    Raises:
        InputError: If the file cannot be read, has no limits or other keys beside them,
            or a limit is invalid.
    """
    data = read_toml(Path(path), what="spec")
    table = data.pop("spec", None)
    if not isinstance(table, Mapping) or not table:
        raise InputError(f"{path}: no limits; accepted: a table [spec] with limits")
    if data:
        raise InputError(
            f"{path}: {', '.join(data)}: unknown key; accepted: the table [spec] alone"
        )
    return checked_limits(table, accepted, where=f"{path}: spec.")


def checked_limits(
    limits: Mapping[str, Any], accepted: Sequence[str] = SORTABLE, *, where: str = ""
) -> dict[str, float]:
    """Check limits by figure: all of them must be positive numbers.

    Args:
        limits: Values by figure.
        accepted: Figures that may be limited.
        where: Text that messages put before the name of a figure.

    Returns:
        The limits as floats.

    Raises:
        InputError: With one line for every unknown figure and invalid value.
    """
    faults = []
    for key, value in limits.items():
        if key not in accepted:
            near = near_names(key, accepted)
            hint = f"did you mean {' or '.join(near)}? " if near else ""
            faults.append(
                f"{where}{key} = {value!r}: unknown key; {hint}accepted: a positive"
                f" number for {', '.join(accepted)}"
            )
        elif (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not 0.0 < value < inf
        ):
            faults.append(f"{where}{key} = {value!r}; accepted: a positive number")
    if faults:
        raise InputError("\n".join(faults))
    return {key: float(value) for key, value in limits.items()}


def require_cycle(scene: Scene, keys: Collection[str]) -> None:
    """Check that a scene has a duty cycle if figures need one.

    Args:
        scene: The scene.
        keys: Keys of limited or sorted figures.

    Raises:
        InputError: If the scene has none.
    """
    needed = [key for key in OF_CYCLE if key in keys]
    if needed and not scene.cycle:
        raise InputError(
            f"{needed[0]}: scene {scene.name!r} has no duty cycle; accepted: with a"
            " scene that has [[cycle]]"
        )
