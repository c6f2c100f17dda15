"""Scale a design to another tooth count or module and make the result feasible.

The lengths of the tooth profiles are scaled with the module and all other lengths with
the pitch diameter. The shape of the wave generator is scaled with its axes, the
micro-geometry with the deflection, and torques and stiffnesses with the cube of the
pitch diameter. Manufacturing errors, bearing clearances, coefficients and angles do not
change. If the scaled design is not feasible, single values are moved to the nearest
feasible ones, with a margin.
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
"""Relative margin by which a value is moved beyond its bound [-], provided that the
result is accepted."""
DIGITS = 6
"""Significant digits of a scaled value."""
ROUNDS = 8
"""Largest number of values that are moved before the search gives up."""
ENGAGEMENT = "engagement"
"""Name of the check of rigid flanks in engagement, which is last because it is the
slowest."""
COARSE: dict[str, int] = {"positions": 241, "points": 101}
"""Coarse resolution of the passage of a tooth, used in the search for a bound."""
_KEPT = ("material", "tolerances", "friction", "losses", "joint", "mesh")
"""Tables that are not scaled."""
# the module is set by itself, and clearances keep their value
_KEPT_KEYS = ("module_mm", "clearance_um", "fit_clearance_um")
_LARGEST = {
    **MEMBER_KEYS,
    "minor_axis_coefficient": 1.0,
    "parabola_length_coefficient": 1.0,
    "aperture_deg": 44.0,
}
"""Largest trial value by key, in the unit of the key."""


@dataclass(frozen=True, kw_only=True)
class MovedValue:
    """A value that was moved because the scaled design was not feasible with it."""

    key: str
    """Dotted key of the value."""
    value: float
    """New value, in the unit of the key."""
    bound: AcceptedBound
    """Scaled value, which was rejected, and the nearest accepted value."""
    fault: str
    """Reason why the scaled value was rejected."""

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
    """A feasible scaled design with its scale factors and moved values."""

    design: Design
    """The scaled design."""
    factors: dict[str, float]
    """Scale factors of ``module``, ``pitch_diameter`` and ``deflection`` [-]."""
    moved: tuple[MovedValue, ...]
    """Values that had to be moved, in the order of the changes."""


def scaled_design(
    design: Design,
    *,
    name: str,
    teeth: tuple[int, int] | None = None,
    module: float | None = None,
    changes: Mapping[str, Any] | None = None,
) -> Scaled:
    """Scale a design to other tooth counts or another module and make it feasible.

    Args:
        design: The template.
        name: Name of the new design.
        teeth: Tooth counts of flexspline and circular spline; None keeps those of the
            template.
        module: Module [mm]; None keeps that of the template.
        changes: Values by dotted key that are set after scaling and are not moved.

    Returns:
        The scaled design with its scale factors and moved values.

    Raises:
        DesignError: If a value is not accepted, if no change of a single value makes a
            part feasible, or if more than :data:`ROUNDS` values would have to be moved;
            one line per fault.
    """
    old = design.drive
    new_keys: dict[str, Any] = {
        "name": name,
        "source": f"scaled by swgjoint from {old.name}: {old.source or 'no source'}",
    }
    if teeth is not None:
        new_keys["teeth_flexspline"], new_keys["teeth_circular_spline"] = teeth
    if module is not None:
        new_keys["module_mm"] = module
    new = validate(
        DriveSection,
        {**old.model_dump(), **new_keys},
        where=f"design {name!r}: drive",
        error=DesignError,
    )
    by_module = new.module_mm / old.module_mm
    difference = new.teeth_circular_spline - new.teeth_flexspline
    factors = {
        "module": by_module,
        "pitch_diameter": by_module * new.teeth_flexspline / old.teeth_flexspline,
        "deflection": by_module * difference / design.tooth_difference,
    }
    values: dict[str, Any] = {f"drive.{key}": value for key, value in new_keys.items()}
    for key, value in _numbers(design.model_dump(exclude_unset=True)):
        if (factor := _factor(key, factors)) is not None:
            values[key] = _rounded(value * factor)
    scaled = design.with_changes(values)
    scaled = scaled.with_changes(_outline_to_scale(design, scaled))
    if changes:
        scaled = scaled.with_changes(changes)
    scaled, moved = _made_feasible(scaled, frozenset(changes or ()))
    return Scaled(design=scaled, factors=factors, moved=moved)


def _numbers(table: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, float]]:
    """Dotted keys with non-zero numbers, without lists."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{above}{key}.")
        elif isinstance(value, int | float) and not isinstance(value, bool) and value:
            yield f"{above}{key}", float(value)


def _factor(key: str, factors: Mapping[str, float]) -> float | None:
    """Scale factor of a value; None if it does not change."""
    table, _, last = key.rpartition(".")
    if table.partition(".")[0] in _KEPT or last in _KEPT_KEYS:
        return None
    if last.endswith("per_mm"):
        return None  # scaled with the axes of the wave generator
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
    """Values by key of the wave generator that give the old outline on the new axes.

    A parabola y = a - c x² is scaled along both axes. A table is scaled in terms of the
    distance between its radius and that of the bore.
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
    """The design after moving one value at a time until every check passes."""
    moved: list[MovedValue] = []
    while (failed := _first_failed(design)) is not None and len(moved) < ROUNDS:
        part, faults = failed
        settled = fixed | {one.key for one in moved}
        nearest = _nearest(design, part, settled)
        if nearest is None:
            break
        key, bound = nearest
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
    """The first part with a failed check and its faults; None if all checks pass."""
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
    except DesignError:  # e.g. rollers: the rim does not follow their outline
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
    """The key for which the smallest change makes a part feasible, with its bound."""
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
    """Numbers that determine the shape of a part, by dotted key."""
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
