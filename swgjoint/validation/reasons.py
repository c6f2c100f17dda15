"""Reasons why our values differ from printed ones, derived from the runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

WITHIN = 15.0
"""Deviation from the printed value beyond which a row needs a reason [%]."""
MESH = 5.0
"""Change from the mesh of the thesis to the finest mesh beyond which the reason names
the mesh [%]."""
SETTLED = 2.0
"""Change from the second finest to the finest mesh up to which a stress counts as
settled [%]."""

_PLACES = {
    "fillet": "in the tooth fillets",
    "flank": "on the flanks",
    "bore": "on the bore, under the wave generator",
    "inside": "inside the teeth",
    "contact": "next to loaded tooth contacts",
}


@dataclass(frozen=True, kw_only=True)
class Facts:
    """Stresses of one row [MPa], and where they occur."""

    printed: float | None
    """Value of the source."""
    value: float | None
    """Stress at the load by which rows are judged."""
    nominal: float | None
    """Stress at T."""
    away: float | None
    """Stress at the judged load, away from loaded tooth contacts; None if unknown."""
    fine: float | None
    """Stress at the judged load on the finest mesh; None if it was not computed."""
    places: Mapping[str, int]
    """Number of positions with the largest stress at each place."""
    load: str = "T/10"
    """Load by which rows are judged."""
    tenth: float | None = None
    """Stress at T/10 if rows are judged at T."""
    by_mesh: Mapping[float, float] = field(default_factory=dict)
    """Stress at T by mesh refinement, which the reason of every 3D row lists; empty in
    2D. In 3D the largest stresses, at edge contacts, grow with mesh refinement."""
    failures: tuple[str, ...] = ()
    """Messages of failed runs."""
    note: str = ""
    """What the source leaves open."""


def percent(value: float | None, reference: float | None) -> float | None:
    """Deviation of a value from a reference [%]; None if either is None.

    Args:
        value: Value to compare.
        reference: Nonzero reference, in the same unit.
    """
    if value is None or reference is None:
        return None
    return 100.0 * (value / reference - 1.0)


def reason_for(facts: Facts) -> str | None:
    """Reason why a stress deviates from the printed value; None if none is needed.

    Failures are always listed, and so are the stresses by mesh if they are known. If
    the deviation exceeds 15 % at the judged load (T/10 in 2D, T in 3D), the reason
    names the place of the stress, the influence of contacts and mesh, and what the
    source leaves open. If it exceeds 15 % only at T, the reason is the torque.
    """
    parts = list(facts.failures)
    value = percent(facts.value, facts.printed)
    nominal = percent(facts.nominal, facts.printed)
    if value is not None and abs(value) > WITHIN:
        parts += _deviation(facts, value)
    elif nominal is not None and value is not None and abs(nominal) > WITHIN:
        assert facts.nominal is not None and facts.value is not None
        parts.append(
            f"torque: {nominal:+.0f} % at T, {value:+.0f} % at T/10; from T/10 to T our"
            f" value changes by {facts.nominal - facts.value:+.0f} MPa"
        )
    parts += _ladder(facts.by_mesh)
    return "; ".join(parts) or None


def _ladder(by_mesh: Mapping[float, float]) -> list[str]:
    """Stresses on all meshes and whether they converge; empty for a single mesh."""
    if len(by_mesh) < 2:
        return []
    *_, before, last = by_mesh.values()
    change = 100.0 * (last / before - 1.0)
    values = ", ".join(f"{value:.0f}" for value in by_mesh.values())
    meshes = ", ".join(f"{mesh:g}" for mesh in by_mesh)
    settled = "settles" if abs(change) <= SETTLED else "has no converged value"
    return [
        f"{values} MPa at refinement {meshes}, {change:+.1f} % in the last step:"
        f" {settled}"
    ]


def _deviation(facts: Facts, value: float) -> list[str]:
    parts = [f"{value:+.0f} % at {facts.load}"]
    tenth = percent(facts.tenth, facts.printed)
    if tenth is not None:
        assert facts.value is not None and facts.tenth is not None
        more = facts.value - facts.tenth
        parts.append(f"{tenth:+.0f} % at T/10, the torque adds {more:+.0f} MPa")
    total = sum(facts.places.values())
    if total:
        place, count = max(facts.places.items(), key=lambda item: item[1])
        where = _PLACES.get(place, f"at the {place}")
        parts.append(f"largest {where} at {count} of {total} positions")
        away = percent(facts.away, facts.printed)
        if place == "contact" and away is not None:
            parts.append(f"{away:+.0f} % away from the contacts")
    change = percent(facts.fine, facts.value)
    fine = percent(facts.fine, facts.printed)
    if change is not None and fine is not None and not facts.by_mesh:
        if abs(change) > MESH:
            parts.append(f"the finest mesh changes it by {change:+.0f} %")
        else:
            parts.append(f"independent of the mesh ({change:+.0f} % on the finest)")
    if facts.note:
        parts.append(facts.note)
    return parts
