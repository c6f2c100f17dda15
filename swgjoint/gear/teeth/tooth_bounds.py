"""Which values make a tooth possible that cannot be built."""

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
"""Keys besides the profile that shape a tooth, and the largest value tried."""
SHOWN = 2


def with_bounds(
    fault: ToothFault, start: Blank, build: Callable[[Blank], ToothProfile]
) -> ToothFault:
    """The fault with what is accepted as values, unchanged where nothing is found.

    Bounds of the keys that alone make the tooth possible, its own first, then the one
    that changes least; else the factor by which all lengths of the profile must change.

    Args:
        fault: Why the tooth cannot be built.
        start: Its blank.
        build: What builds a tooth from a blank.
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
    found: dict[str, AcceptedBound] = {}
    for key in (*lengths, *MEMBER_KEYS):
        bound = nearest_bound(
            start.value(key),
            lambda value, key=key: builds(start.with_change(key, value)),  # type: ignore[misc]
            high=MEMBER_KEYS.get(key, float("inf")),
        )
        if bound is not None:
            found[key] = bound
    nearest = sorted(found, key=lambda key: (key != fault.key, found[key].change))
    told = [
        f"{'' if key == fault.key else f'{key} '}{_told(key, found[key])}"
        for key in nearest[:SHOWN]
    ]
    if not told and (all_of_them := _common(start, lengths, builds)) is not None:
        told = [f"all lengths of the profile times {_told('', all_of_them)}"]
        if fault.key in lengths:
            size = start.value(fault.key) * all_of_them.accepted
            told[0] += f", this one {size:.4g}{_unit(fault.key)}"
    return fault.with_bounds(" or ".join(told)) if told else fault


def _common(
    start: Blank, lengths: list[str], builds: Callable[[Blank], bool]
) -> AcceptedBound | None:
    """Bound of a factor of all lengths, one that alone changes nothing rejected."""

    def builds_with(factor: float) -> bool:
        changed = start
        for key in lengths:
            changed = changed.with_change(key, factor * start.value(key))
        return builds(changed)

    return nearest_bound(1.0, builds_with)


def _told(key: str, bound: AcceptedBound) -> str:
    return f"{bound.sign} {bound.accepted:.6g}{_unit(key)}"


def _unit(key: str) -> str:
    return f" {unit_of(key)}".rstrip()
