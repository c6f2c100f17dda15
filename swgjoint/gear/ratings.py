"""Rated and limit torques of a drive."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Ratings:
    """Catalogue torques at the output [N·m]."""

    rated_torque: float
    """Rated torque [N·m]."""
    repeated_peak: float
    """Limit for repeated peak torque [N·m]."""
    momentary_peak: float
    """Limit for momentary peak torque [N·m]."""
    T1: float
    """Torque at the end of the first line of the torsion curve, whose slope is K1
    [N·m]."""
    T2: float
    """Torque at the end of the second line of the torsion curve, whose slope is K2
    [N·m]."""
    source: str = "given"
    """Origin of the values: ``given``, or the rule that supplied defaults."""
    ratcheting_torque: float | None = None
    """Torque at which the teeth ratchet [N·m]; None if it is not known."""


_TORQUES = (
    "rated_torque_Nm",
    "repeated_peak_Nm",
    "momentary_peak_Nm",
    "T1_Nm",
    "T2_Nm",
    "ratcheting_torque_Nm",
)
_CATALOGUE, _DEFAULT, _RATED = "catalogue ", "default (", "rated torque given; "


def rule_of(source: str) -> tuple[tuple[str, ...], str]:
    """Torques that a rule supplied instead of the user or the catalogue, and the rule.

    Both are empty if all torques are stated.

    Args:
        source: Field ``source`` of :class:`Ratings`.

    >>> rule_of("default (T1_Nm, T2_Nm): catalogue CSG-32-50 scaled by 0.8")
    (('T1_Nm', 'T2_Nm'), 'catalogue CSG-32-50 scaled by 0.8')
    >>> rule_of("catalogue CSG-25-100")
    ((), '')
    """
    if source.startswith(_DEFAULT):
        keys, _, rule = source.removeprefix(_DEFAULT).partition("): ")
        return tuple(keys.split(", ")), rule
    if source.startswith(_RATED):
        return _TORQUES[1:-1], source.removeprefix(_RATED)
    if source.startswith(_CATALOGUE) and "; " in source:  # another series
        return _TORQUES, source
    return (), ""
