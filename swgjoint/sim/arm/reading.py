"""Choices for reading an arm's file: hinges that move, and pose of held joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase


@dataclass(frozen=True, kw_only=True)
class ArmReading:
    """Choices that the file of an arm leaves open."""

    driven: tuple[str, ...] = ()
    """Names or patterns (``*``, ``?``) of the hinges that move; all if empty. Names may
    omit the suffix ``_joint``."""
    pose: str | None = None
    """Keyframe of the file at which the other joints are held; None holds them at the
    reference position."""
    angles: Mapping[str, float] = field(default_factory=dict)
    """Angles of held hinges that differ from ``pose`` [rad]."""
    balance_inertia: bool = False
    """Whether to repair inertias that no rigid body can have: their mean replaces the
    three principal moments."""

    def drives(self, hinge: str) -> bool:
        """Whether a hinge is to have a drive and move."""
        return not self.driven or matches(hinge, self.driven)


def matches(name: str, patterns: Sequence[str]) -> bool:
    """Whether a joint name, with or without its suffix ``_joint``, matches a pattern.

    The comparison is case-sensitive.

    Args:
        name: Name of the joint.
        patterns: Names or patterns (``*``, ``?``).
    """
    names = {name, name.removesuffix("_joint")}
    return any(fnmatchcase(one, pattern) for one in names for pattern in patterns)


def patterns_of(texts: Sequence[str]) -> tuple[str, ...]:
    """Split comma-separated strings, such as ``"shoulder*,elbow"``, into patterns.

    Args:
        texts: Strings with one or several patterns each.

    Returns:
        All patterns in their order, without duplicates.
    """
    parts = (part.strip() for text in texts for part in text.split(","))
    return tuple(dict.fromkeys(part for part in parts if part))
