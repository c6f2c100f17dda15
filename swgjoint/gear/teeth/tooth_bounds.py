"""Changes of single values that make an infeasible tooth feasible."""

from __future__ import annotations

from collections.abc import Callable

from swgjoint.errors import DesignError
from swgjoint.faults import unit_of
from swgjoint.gear.design.bounds import AcceptedBound, nearest_bound
from swgjoint.gear.teeth.blank import Blank, ToothFault
from swgjoint.gear.teeth.profile import ToothProfile

MEMBER_KEYS = {
    "addendum_coefficient": 5.0,
    "dedendum_coefficient": 5.0,
    "thickness_coefficient": 1.5,
    "pressure_angle_deg": 59.0,
}
"""Keys outside the profile table that affect a tooth, with their largest trial value in
the unit of the key."""
SHOWN = 2
"""Largest number of bounds in a message."""


def with_bounds(
    fault: ToothFault, start: Blank, build: Callable[[Blank], ToothProfile]
) -> ToothFault:
    """The fault with accepted values in its message; unchanged if none are found.

    The message states bounds of single keys within which the tooth becomes feasible:
    first the bound of the key in the fault, then the one that needs the smallest
    change. If no single key has a bound, the message states the factor by which all
    lengths of the profile must be multiplied.

    Args:
        fault: Reason why the tooth cannot be built.
        start: Blank of the tooth.
        build: Function that builds a tooth from a blank.
    """

    def builds(blank: Blank) -> bool:
        try:
            build(blank)
        except DesignError:
            return False
        return True

    lengths = [
        f"profile.{name}"
        for name, value in start.spec.profile.model_dump().items()
        if name.endswith("_mm") and value
    ]
    bounds: dict[str, AcceptedBound] = {}
    for key in (*lengths, *MEMBER_KEYS):
        bound = nearest_bound(
            start.value(key),
            lambda value, key=key: builds(start.with_change(key, value)),  # type: ignore[misc]
            high=MEMBER_KEYS.get(key, float("inf")),
        )
        if bound is not None:
            bounds[key] = bound
    nearest = sorted(bounds, key=lambda key: (key != fault.key, bounds[key].change))
    texts = [
        f"{'' if key == fault.key else f'{key} '}{_text(key, bounds[key])}"
        for key in nearest[:SHOWN]
    ]
    if not texts and (common := _common(start, lengths, builds)) is not None:
        texts = [f"all lengths of the profile times a factor {_text('', common)}"]
        if fault.key in lengths:
            size = start.value(fault.key) * common.accepted
            texts[0] += f", which makes this value {size:.4g}{_unit(fault.key)}"
    return fault.with_bounds(" or ".join(texts)) if texts else fault


def _common(
    start: Blank, lengths: list[str], builds: Callable[[Blank], bool]
) -> AcceptedBound | None:
    """Bound of a common factor of all lengths; None if the search finds no factor."""

    def builds_with(factor: float) -> bool:
        changed = start
        for key in lengths:
            changed = changed.with_change(key, factor * start.value(key))
        return builds(changed)

    return nearest_bound(1.0, builds_with)


def _text(key: str, bound: AcceptedBound) -> str:
    return f"{bound.sign} {bound.accepted:.6g}{_unit(key)}"


def _unit(key: str) -> str:
    return f" {unit_of(key)}".rstrip()
