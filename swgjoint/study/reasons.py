"""Why a value differs from the printed one, from what the runs themselves show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

WITHIN = 15.0
"""Deviation beyond which a row needs a reason [%]."""
MESH = 5.0
"""Change between the mesh of the thesis and the finest one that is worth a word [%]."""

_PLACES = {
    "fillet": "in the tooth fillets",
    "flank": "on the flanks",
    "bore": "on the bore, under the wave generator",
    "inside": "inside the teeth",
    "contact": "beside loaded tooth contacts",
}


@dataclass(frozen=True, kw_only=True)
class Facts:
    """What is known about one row [MPa]."""

    printed: float | None
    nominal: float | None
    tenth: float | None
    away: float | None
    """At T/10, away from loaded tooth contacts."""
    fine: float | None
    """At T/10 on the finest mesh."""
    places: Mapping[str, int]
    """How often the largest stress at T/10 sat where."""
    failures: tuple[str, ...] = ()
    note: str = ""


def percent(value: float | None, reference: float | None) -> float | None:
    """Deviation of a value from a reference [%]; None without both."""
    if value is None or reference is None:
        return None
    return 100.0 * (value / reference - 1.0)


def reason_for(facts: Facts) -> str | None:
    """Reason of a row, None where there is nothing to explain.

    Failures always; beyond 15 % at T/10 where the stress sits, what the contacts and
    the mesh have to do with it, and what the source leaves open; beyond 15 % at T only,
    the torque.
    """
    parts = list(facts.failures)
    tenth = percent(facts.tenth, facts.printed)
    nominal = percent(facts.nominal, facts.printed)
    if tenth is not None and abs(tenth) > WITHIN:
        parts += _deviation(facts, tenth)
    elif nominal is not None and tenth is not None and abs(nominal) > WITHIN:
        assert facts.nominal is not None and facts.tenth is not None
        parts.append(
            f"torque: {nominal:+.0f} % at T, {tenth:+.0f} % at T/10; from T/10 to T"
            f" ours changes by {facts.nominal - facts.tenth:+.0f} MPa"
        )
    return "; ".join(parts) or None


def _deviation(facts: Facts, tenth: float) -> list[str]:
    parts = [f"{tenth:+.0f} % at T/10"]
    total = sum(facts.places.values())
    if total:
        place, count = max(facts.places.items(), key=lambda item: item[1])
        where = _PLACES.get(place, f"at the {place}")
        parts.append(f"largest {where} at {count} of {total} positions")
        away = percent(facts.away, facts.printed)
        if place == "contact" and away is not None:
            parts.append(f"{away:+.0f} % away from the contacts")
    change = percent(facts.fine, facts.tenth)
    fine = percent(facts.fine, facts.printed)
    if change is not None and fine is not None:
        if abs(change) > MESH:
            parts.append(f"the finest mesh changes it by {change:+.0f} %")
        else:
            parts.append(f"no matter of the mesh ({change:+.0f} % on the finest)")
    if facts.note:
        parts.append(facts.note)
    return parts
