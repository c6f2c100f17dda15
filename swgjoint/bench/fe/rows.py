"""Rows of ``swgjoint bench fe``: errors of the settings, and the cheapest settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from swgjoint.bench.fe.setting import FeSetting, Found
from swgjoint.units import arcsec, mm

QUANTITIES = {
    "torsional_stiffness_Nm_rad": "%",
    "kinematic_error_pp_arcsec": "arcsec",
    "tensile_MPa": "%",
    "rim_shape_mm": "%",
}
"""Quantities with the unit of their error. The error of the kinematic error is the peak
to peak of the difference of two curves. The error of the rim shape is the largest
difference along the rim divided by the largest deflection."""
NEXT_LEVEL = {"ring": "2d", "2d linear": "2d", "2d": "3d", "3d linear": "3d"}
"""For each kind of setting, the next more accurate kind."""
SAME = 1e-6
"""Relative difference up to which two errors count as equal [-]."""
BOUNDS = (1.0, 5.0, 15.0)
"""Error bounds for which the cheapest setting is listed [%]."""


def rows_of(
    settings: Sequence[FeSetting],
    found: Mapping[str, Found | str],
    *,
    best: FeSetting,
) -> list[dict[str, Any]]:
    """Rows of the settings: one per quantity, or one for a setting without solution.

    Args:
        settings: Settings, from coarse to fine within each kind.
        found: Results by key of the setting, or the reason for missing results.
        best: Setting that is the reference.

    Returns:
        ``bench``, ``model``, ``setting``, ``kind``, ``quantity``, ``value``; ``unit``
        of the errors; ``error`` relative to ``reference``, ``error_of_kind`` relative
        to ``reference_of_kind`` and ``error_next_level`` relative to
        ``reference_next_level``; ``error_percent`` and ``error_of_kind_percent``:
        magnitudes of the first two errors in percent, that of the kinematic error
        relative to the peak to peak of the reference; ``pareto`` and
        ``pareto_of_kind``: whether no other setting, or no other one of its kind, is
        both cheaper and closer to the reference; ``wall_s``, ``cpu_s``, ``peak_MB``,
        ``cores``, ``nodes`` of a sector, ``outcome``. Errors without a
        reference, such as those of the only mesh of a kind, are None.
        ``kinematic_error_pp_arcsec`` contains only the first harmonic over a pitch,
        because four positions resolve no more.
    """
    meshes = [
        s
        for s in settings
        if not s.full and isinstance(found[s.key], Found) and s.refinement
    ]
    finest = {s.kind: s for s in meshes}
    rows: list[dict[str, Any]] = []
    for setting in settings:
        one = found[setting.key]
        same = {
            "bench": "fe",
            "model": setting.model,
            "setting": setting.name,
            "kind": setting.kind,
            "cores": 1,
        }
        if isinstance(one, str):
            row = _failed(same, best, one)
            rows.append(row)
            continue
        same |= {
            "wall_s": one.wall_s,
            "cpu_s": one.cpu_s,
            "peak_MB": one.peak_MB,
            "nodes": one.nodes,
            "outcome": "converged",
        }
        up = NEXT_LEVEL.get(setting.kind)
        while up is not None and up not in finest:
            up = NEXT_LEVEL.get(up)
        alone = [s for s in meshes if s.kind == setting.kind] == [setting]
        others = (
            ("", best),
            ("_of_kind", None if alone else finest.get(setting.kind)),
            ("_next_level", None if up is None else finest[up]),
        )
        for quantity, unit in QUANTITIES.items():
            value = _value(one, quantity)
            if value is None:
                continue
            row = same | {"quantity": quantity, "value": value, "unit": unit}
            for tail, other in others:
                than = None if other is None else found[other.key]
                there = isinstance(than, Found)
                row[f"error{tail}"] = _error(one, than, quantity) if there else None  # type: ignore[arg-type]
                row[f"reference{tail}"] = other.key if there and other else None
            for tail in ("", "_of_kind"):
                row[f"error{tail}_percent"] = _percent(row, found, tail)
            rows.append(row)
    for row in rows:
        beside = [
            other
            for other in rows
            if other["quantity"] == row["quantity"] and other["value"] is not None
        ]
        kind = [other for other in beside if other["kind"] == row["kind"]]
        row["pareto"] = _on_front(row, beside, "error")
        row["pareto_of_kind"] = _on_front(row, kind, "error_of_kind")
    return [{key: row[key] for key in _ORDER} for row in rows]


_ORDER = (
    *("bench", "model", "setting", "kind", "quantity", "value", "unit"),
    *("error", "reference", "error_percent"),
    *("error_of_kind", "reference_of_kind", "error_of_kind_percent"),
    *("error_next_level", "reference_next_level", "pareto", "pareto_of_kind"),
    *("wall_s", "cpu_s", "peak_MB", "cores", "nodes", "outcome"),
)


def _failed(same: dict[str, Any], best: FeSetting, outcome: str) -> dict[str, Any]:
    nothing = {key: None for key in _ORDER if key not in same}
    return (
        same
        | nothing
        | {
            "quantity": "torsional_stiffness_Nm_rad",
            "unit": "%",
            "reference": best.key,
            "outcome": outcome,
        }
    )


def _value(found: Found, quantity: str) -> float | None:
    """Value of a quantity, in the unit of its name; None if the setting lacks it."""
    if quantity == "torsional_stiffness_Nm_rad":
        return found.stiffness
    if quantity == "tensile_MPa":
        return None if found.tensile is None else found.tensile / 1e6
    if quantity == "kinematic_error_pp_arcsec":
        error = found.kinematic_error
        return None if error is None else float(np.ptp(error)) / arcsec
    shape = found.rim_shape
    return None if shape is None else float(np.ptp(shape)) / mm


def _error(one: Found, than: Found, quantity: str) -> float | None:
    """Error of a quantity, in the unit of :data:`QUANTITIES`; None if unknown.

    Errors of stiffness and stress are signed, the other errors are magnitudes.
    """
    if quantity == "kinematic_error_pp_arcsec":
        if one.kinematic_error is None or than.kinematic_error is None:
            return None
        return float(np.ptp(one.kinematic_error - than.kinematic_error)) / arcsec
    if quantity == "rim_shape_mm":
        if one.rim_shape is None or than.rim_shape is None:
            return None
        apart = np.abs(one.rim_shape - than.rim_shape).max()
        return 100.0 * float(apart / np.abs(than.rim_shape).max())
    a, b = _value(one, quantity), _value(than, quantity)
    return None if a is None or b is None else 100.0 * (a / b - 1.0)


def _percent(
    row: dict[str, Any], found: Mapping[str, Found | str], tail: str
) -> float | None:
    """Magnitude of an error, relative to the value of its reference [%]."""
    error, than = row[f"error{tail}"], found.get(row[f"reference{tail}"])
    if error is None or not isinstance(than, Found):
        return None
    if row["unit"] == "%":
        return float(abs(error))
    whole = _value(than, row["quantity"])
    return 100.0 * float(abs(error)) / whole if whole else None


def seconds(row: Mapping[str, Any]) -> float:
    """Cost of a setting [s]: CPU time, on which other processes have little effect.

    If the CPU time is missing, the wall time is used.
    """
    return float(row["wall_s"] if row["cpu_s"] is None else row["cpu_s"])


def _on_front(row: dict[str, Any], beside: list[dict[str, Any]], key: str) -> bool:
    """Whether a row is Pareto-optimal in CPU time and in the error under ``key``."""
    if row["value"] is None or row[key] is None:
        return False
    cost, error = seconds(row), abs(row[key])
    for other in beside:
        if other is row or other[key] is None or seconds(other) > cost:
            continue
        than = abs(other[key])
        # models of half the teeth and of all teeth differ only in the last digits
        if than < (1.0 - SAME) * error or (
            than <= (1.0 + SAME) * error and seconds(other) < cost
        ):
            return False
    return True


def cheapest(
    rows: Sequence[dict[str, Any]], kind: str | None = None
) -> list[dict[str, Any]]:
    """Cheapest setting that meets each bound, by quantity.

    Finer meshes of the same kind must meet the bound too. A setting that meets it by
    chance, although a finer mesh does not, does not count.

    Args:
        rows: Rows of all settings.
        kind: Kind of the settings to choose from, which are compared with the finest
            mesh of this kind; None for all settings, compared with the reference.

    Returns:
        One entry per quantity and bound: ``quantity``, ``bound_percent``, ``model``,
        ``setting``, ``error_percent``, ``wall_s``, ``cpu_s``. All but the first two are
        None if only the reference meets the bound.
    """
    tail, found = "" if kind is None else "_of_kind", []
    error = f"error{tail}_percent"
    for quantity in QUANTITIES:
        solved = [r for r in rows if r["quantity"] == quantity]
        solved = [r for r in solved if r[error] is not None]
        for bound in BOUNDS:
            good = [
                row
                for k, row in enumerate(solved)
                if kind in (None, row["kind"])
                and row["model"] + ", " + row["setting"] != row[f"reference{tail}"]
                and all(
                    later[error] <= bound
                    for later in solved[k:]
                    if later["kind"] == row["kind"]
                )
            ]
            pick = min(good, key=seconds, default=None)
            found.append(
                {
                    "quantity": quantity,
                    "bound_percent": bound,
                    "error_percent": None if pick is None else pick[error],
                }
                | {
                    key: None if pick is None else pick[key]
                    for key in ("model", "setting", "wall_s", "cpu_s")
                }
            )
    return found
