"""Result of one check of a design."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from swgjoint.errors import DesignError


@dataclass(frozen=True, kw_only=True)
class Check:
    """A figure of a design compared with its limit."""

    name: str
    """Name of the figure, followed by the kind of limit, such as ", at most"."""
    ok: bool
    """Whether the design passes."""
    value: float | None
    """Value of the figure in ``unit``; None if it could not be computed."""
    unit: str = ""
    """Unit of value and limit in reports; empty if they have none."""
    limit: float | None = None
    """Limit of the value, in ``unit``; None if there is no value to compare."""
    fault: str = ""
    """Message for a failed check: the key, its value and what is accepted."""
    numerical: bool = False
    """Whether the value of a passed check is nothing but round-off."""

    @classmethod
    def upper_limit(
        cls, name: str, value: float, limit: float, unit: str, fault: str
    ) -> Check:
        """Check that passes if value <= limit.

        Args:
            name: Name of the figure; ", at most" is appended.
            value: Value of the figure.
            limit: Largest accepted value.
            unit: Unit of value and limit.
            fault: Message if the check fails.
        """
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
        """Check that passes if value >= limit.

        Args:
            name: Name of the figure; ", at least" is appended.
            value: Value of the figure.
            limit: Smallest accepted value.
            unit: Unit of value and limit.
            fault: Message if the check fails.
        """
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
        """Check that passes if value > limit.

        Args:
            name: Name of the figure; ", above" is appended.
            value: Value of the figure.
            limit: Accepted values are greater than this.
            unit: Unit of value and limit.
            fault: Message if the check fails.
        """
        return cls(
            name=f"{name}, above",
            ok=value > limit,
            value=value,
            unit=unit,
            limit=limit,
            fault=fault,
        )


def raise_faults(checks: Iterable[Check]) -> None:
    """Raise an error if any check has failed.

    Raises:
        DesignError: If a check has failed; the message contains the fault of each.
    """
    lines = [check.fault for check in checks if not check.ok]
    if lines:
        raise DesignError("\n".join(lines))
