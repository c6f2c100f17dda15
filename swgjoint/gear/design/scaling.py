"""A design of another tooth count or module, scaled from one and made feasible.

Lengths of the teeth grow with the module, all others with the pitch diameter, the
shape of the wave generator with its axes, micro-geometry with the deflection, torques
and stiffnesses with the cube of the pitch diameter. Manufacturing errors, clearances
of the bearing, coefficients and angles stay. Where the scaled design cannot be built,
single values are moved to the nearest ones with which it can, with a margin.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

from swgjoint.errors import DesignError
from swgjoint.faults import unit_of, validate
from swgjoint.gear.design.bounds import AcceptedBound, nearest_bound
from swgjoint.gear.design.check import Check
from swgjoint.gear.design.design import Design
from swgjoint.gear.design.feasibility import (
    MEMBERS,
    PARTS,
    engagement_checks,
    part_checks,
)
from swgjoint.gear.design.sections import DriveSection
from swgjoint.gear.teeth.tooth_bounds import MEMBER_KEYS
from swgjoint.gear.teeth.tooth_path import tooth_path
from swgjoint.gear.wave_generators.wave_generator import lobe_height
from swgjoint.units import mm

MARGIN = 0.02
"""By which a value that is moved goes beyond its bound, where that is accepted too."""
DIGITS = 6
"""Of a scaled value."""
ROUNDS = 8
"""Values that are moved at most."""
ENGAGEMENT = "engagement"
"""Of rigid flanks: the part that is checked last, for it takes longest."""
COARSE: dict[str, int] = {"positions": 241, "points": 101}
"""Fineness of the passage of a tooth while a bound is sought."""
_KEPT = ("material", "tolerances", "friction", "joint", "mesh")
"""Tables without a value that scales."""
_KEPT_KEYS = ("module_mm", "clearance_um", "fit_clearance_um")
_LARGEST = {
    **MEMBER_KEYS,
    "minor_axis_coefficient": 1.0,
    "parabola_length_coefficient": 1.0,
    "aperture_deg": 44.0,
}
"""Largest value of a key that is tried."""


@dataclass(frozen=True, kw_only=True)
class MovedValue:
    """A value with which the scaled design could not be built."""

    key: str
    value: float
    """What it is now."""
    bound: AcceptedBound
    """What it was, and the nearest accepted value."""
    fault: str

    def __str__(self) -> str:
        """The change, its bound and its reason in one line."""
        unit = f" {unit_of(self.key)}".rstrip()
        return (
            f"{self.key} = {self.value:.6g}{unit}, not {self.bound.rejected:.6g}{unit};"
            f" accepted: {self.bound.sign} {self.bound.accepted:.6g}{unit}"
            f" ({self.fault})"
        )


@dataclass(frozen=True, kw_only=True)
class Scaled:
    """A feasible design and how it came about."""

    design: Design
    factors: dict[str, float]
    """By what was multiplied: ``module``, ``pitch_diameter``, ``deflection``."""
    moved: tuple[MovedValue, ...]


def scaled_design(
    design: Design,
    *,
    name: str,
    teeth: tuple[int, int] | None = None,
    module: float | None = None,
    changes: Mapping[str, Any] | None = None,
) -> Scaled:
    """A design with other teeth or another module, all lengths scaled, feasible.

    Args:
        design: The template.
        name: Name of the new design.
        teeth: Of flexspline and circular spline; those of the template if None.
        module: Module [mm]; that of the template if None.
        changes: Dotted keys set after scaling; they are not moved.

    Raises:
        DesignError: If a value is not accepted, or no single change of one makes a
            part feasible; one line per fault.
    """
    old = design.drive
    own: dict[str, Any] = {
        "name": name,
        "source": f"scaled by swgjoint from {old.name}: {old.source or 'no source'}",
    }
    if teeth is not None:
        own["teeth_flexspline"], own["teeth_circular_spline"] = teeth
    if module is not None:
        own["module_mm"] = module
    asked = {**old.model_dump(), **own}
    new = validate(
        DriveSection, asked, where=f"design {name!r}: drive", error=DesignError
    )
    by_module = new.module_mm / old.module_mm
    difference = new.teeth_circular_spline - new.teeth_flexspline
    factors = {
        "module": by_module,
        "pitch_diameter": by_module * new.teeth_flexspline / old.teeth_flexspline,
        "deflection": by_module * difference / design.tooth_difference,
    }
    values: dict[str, Any] = {f"drive.{key}": value for key, value in own.items()}
    for key, value in _numbers(design.model_dump(exclude_unset=True)):
        if (factor := _factor(key, factors)) is not None:
            values[key] = _rounded(value * factor)
    found = design.with_changes(values)
    found = found.with_changes(_outline_to_scale(design, found))
    if changes:
        found = found.with_changes(changes)
    found, moved = _made_feasible(found, frozenset(changes or ()))
    return Scaled(design=found, factors=factors, moved=moved)


def _numbers(table: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, float]]:
    """Dotted keys with a number that is not zero, lists left out."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{above}{key}.")
        elif isinstance(value, int | float) and not isinstance(value, bool) and value:
            yield f"{above}{key}", float(value)


def _factor(key: str, factors: Mapping[str, float]) -> float | None:
    """By what a value is multiplied; None for one that stays."""
    table, _, last = key.rpartition(".")
    if table.partition(".")[0] in _KEPT or last in _KEPT_KEYS:
        return None
    if last.endswith("per_mm"):
        return None  # with the axes of the wave generator
    if last.endswith("_mm"):
        tooth = table.endswith(".profile")
        return factors["module" if tooth else "pitch_diameter"]
    if last.endswith("_um"):
        return factors["deflection"]
    if last.endswith(("_Nm", "_Nm_rad")):
        return factors["pitch_diameter"] ** 3
    return None


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _outline_to_scale(old: Design, new: Design) -> dict[str, Any]:
    """Keys of the wave generator that give the outline of the old one on new axes.

    A parabola y = a - c x² is scaled along both axes, a table in its distance from the
    bore.
    """
    spec = old.wave_generator
    bores = (old.flexspline_inner_radius, new.flexspline_inner_radius)
    lobes = (lobe_height(old), lobe_height(new))
    if spec.kind == "table":
        by = lobes[1] / lobes[0]
        away = [radius - bores[0] / mm for radius in spec.radius_mm]
        radii = tuple(_rounded(bores[1] / mm + by * value) for value in away)
        return {"wave_generator.radius_mm": radii}
    flatness = [(r + w) / (r - w) ** 2 for r, w in zip(bores, lobes, strict=True)]
    return {
        key: _rounded(value * flatness[1] / flatness[0])
        for key, value in _numbers(
            spec.model_dump(exclude_unset=True), "wave_generator."
        )
        if key.endswith("per_mm")
    }


def _made_feasible(
    design: Design, fixed: frozenset[str]
) -> tuple[Design, tuple[MovedValue, ...]]:
    """The design with as few values moved as make every check pass."""
    moved: list[MovedValue] = []
    while (failed := _first_failed(design)) is not None and len(moved) < ROUNDS:
        part, faults = failed
        settled = fixed | {one.key for one in moved}
        found = _nearest(design, part, settled)
        if found is None:
            break
        key, bound = found
        beyond = bound.accepted * (1 + MARGIN if bound.sign == ">=" else 1 - MARGIN)
        with_margin = _with(design, key, _rounded(beyond))
        if with_margin is not None and _passes(with_margin, part):
            design, value = with_margin, _rounded(beyond)
        else:
            design, value = design.with_changes({key: bound.accepted}), bound.accepted
        cause = faults[0].partition(": ")[2].partition("; accepted")[0]
        moved.append(MovedValue(key=key, value=value, bound=bound, fault=cause))
    if failed is not None:
        raise DesignError("\n".join(failed[1]))
    return design, tuple(moved)


def _first_failed(design: Design) -> tuple[str, list[str]] | None:
    """The first part with a failed check, and its faults; None of a feasible design."""
    for part in (*PARTS, ENGAGEMENT):
        faults = [c.fault for c in _checks(design, part) if not c.ok]
        if faults:
            return part, [line for fault in faults for line in fault.splitlines()]
    return None


def _checks(
    design: Design, part: str, *, bounds: bool = True, **fineness: int
) -> list[Check]:
    if part != ENGAGEMENT:
        return part_checks(design, part, bounds=bounds)
    try:
        return engagement_checks(design, tooth_path(design, **fineness))
    except DesignError:  # a rim on rollers has no outline to follow
        return []


def _passes(design: Design, part: str) -> bool:
    return all(check.ok for check in _checks(design, part, bounds=False, **COARSE))


def _with(design: Design, key: str, value: float) -> Design | None:
    try:
        return design.with_changes({key: value})
    except DesignError:
        return None


def _nearest(
    design: Design, part: str, fixed: frozenset[str]
) -> tuple[str, AcceptedBound] | None:
    """The key whose smallest change alone makes a part feasible."""
    best: tuple[str, AcceptedBound] | None = None
    for key, value in _candidates(design, part):
        if key in fixed:
            continue

        def accepts(tried: float, key: str = key) -> bool:
            changed = _with(design, key, tried)
            return changed is not None and _passes(changed, part)

        high = _LARGEST.get(key.rpartition(".")[2], inf)
        bound = nearest_bound(value, accepts, high=high)
        if bound is not None and (best is None or bound.change < best[1].change):
            best = key, bound
    return best


def _candidates(design: Design, part: str) -> Iterator[tuple[str, float]]:
    """Numbers that shape a part, by dotted key."""
    members = MEMBERS if part == "teeth" else (part,) if part in MEMBERS else ()
    for member in members:
        spec = getattr(design, member)
        if part != "teeth":
            yield from _numbers(spec.profile.model_dump(), f"{member}.profile.")
        for key in MEMBER_KEYS:
            yield f"{member}.{key}", getattr(spec, key)
    if part in ("wave_generator", "bearing"):
        numbers = _numbers(design.wave_generator.model_dump(), "wave_generator.")
        inside = ".bearing."
        yield from ((k, v) for k, v in numbers if (inside in k) == (part == "bearing"))
    if part == ENGAGEMENT:
        for member in MEMBERS:
            key = "thickness_coefficient"
            yield f"{member}.{key}", getattr(getattr(design, member), key)
    if part == "cup" and design.cup is not None:
        yield from _numbers(design.cup.model_dump(), "cup.")
