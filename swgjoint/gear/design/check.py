"""One finding about a design."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from swgjoint.errors import DesignError


@dataclass(frozen=True, kw_only=True)
class Check:
    """A figure of a design against its limit, in the unit of the report."""

    name: str
    ok: bool
    value: float | None
    unit: str = ""
    limit: float | None = None
    fault: str = ""
    """One line for a failed check: the key, its value, what is accepted."""
    numerical: bool = False
    """Whether the value is round-off that says nothing of a design which passes."""

    @classmethod
    def upper_limit(
        cls, name: str, value: float, limit: float, unit: str, fault: str
    ) -> Check:
        """Passes where value <= limit."""
        return cls(
            name=f"{name}, at most",
            ok=value <= limit,
            value=value,
            unit=unit,
            limit=limit,
            fault=fault,
        )

    @classmethod
    def lower_limit(
        cls, name: str, value: float, limit: float, unit: str, fault: str
    ) -> Check:
        """Passes where value >= limit."""
        return cls(
            name=f"{name}, at least",
            ok=value >= limit,
            value=value,
            unit=unit,
            limit=limit,
            fault=fault,
        )

    @classmethod
    def strict_lower_limit(
        cls, name: str, value: float, limit: float, unit: str, fault: str
    ) -> Check:
        """Passes where value > limit."""
        return cls(
            name=f"{name}, above",
            ok=value > limit,
            value=value,
            unit=unit,
            limit=limit,
            fault=fault,
        )


def raise_faults(checks: Iterable[Check]) -> None:
    """Refuse a design with a failed check.

    Raises:
        DesignError: With one line per failed check.
    """
    lines = [check.fault for check in checks if not check.ok]
    if lines:
        raise DesignError("\n".join(lines))
